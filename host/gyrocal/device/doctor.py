"""A device examined: bus, sensor, rates, noise, clock, losses, memory, self-test, and what it keeps over a restart.

Nothing is left changed: the one setting that is changed to see whether the board keeps it is set back.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from gyrocal.device.check import Check, Heard
from gyrocal.device.hand_turn import LEFT, TURN_S, Turn
from gyrocal.device.monitor import self_test_words
from gyrocal.device.port import Link, describe_error
from gyrocal.device.wire import Sentence, parse_real, parse_value
from gyrocal.errors import DeviceError

SECONDS = 10.0
SELF_TEST_S = 8.0
DUMP_S = 10.0
STATUS_S = 3.0
SETTLE_S = 0.5
"""After a change of the stream, until what is heard is of the new one."""
LOOK_S = 0.2
"""Between two looks at a turn that goes on."""
BLOCK_S = 0.25
POLLED_OFF = 0.01
SENSOR_CLOCK_OFF = 0.08
"""The largest fraction by which a sensor's own output rate is off; data sheets give 5 % and more."""
CLOCK_OFF = 1e-3
"""The largest fraction by which the clock of a board with a crystal or a trimmed oscillator is off."""
HOST_LATE_S = 0.02
"""How late this machine may see even the promptest of several sentences."""
BUSY_TIMES, BUSY_S = 5.0, 0.2
"""So many times the change of lateness from one reading to the next is allowed, and no more than so much in all."""
NOISE_RATIO = 3.0
MOVES_DPS = 1.0
GRAVITY_OFF = 0.1
TEMP_C = (-40.0, 85.0)
LEAST_HEAP, LEAST_STACK = 10_000, 512
NUDGE_DPS = 0.25
BUSY_WORDS = "send stop, and begin again; of the simulated devices, one of `gyrocal device --bench` lies still"
LOST_WORDS = "shorten or replace the cable, close other programs that read the port, or lower rate_hz"


class Doctor:
    """Examines the device at ``link``; :meth:`run` gives the checks one by one as they are made.

    Args:
        link: the conversation, best one that reconnects, because some boards leave their port when they start again.
        seconds: how long to listen to the samples.
        restart: False leaves the board running: what it keeps is then not checked.
        ask: asks a person to turn the board; None leaves axes and signs unchecked.
    """

    def __init__(
        self, link: Link, seconds: float = SECONDS, *, restart: bool = True, ask: Callable[[str], None] | None = None
    ) -> None:
        self.link, self.seconds, self.restart, self.ask = link, seconds, restart, ask
        self.sensors: dict[int, Heard] = {}
        self._lost = self._bad = 0

    def run(self, told: Callable[[Check], None] = lambda check: None) -> list[Check]:
        """All checks; ``told`` hears each as soon as it is made.

        Raises:
            DeviceError: no device answers, or it went away for good.
        """
        checks: list[Check] = []

        def tell(*made: Check) -> None:
            for check in made:
                checks.append(check)
                told(check)

        self.link.greet()
        self._take_for(SETTLE_S)
        hello = self.link.hello
        firmware = hello.fields.get("fw", "?") if hello is not None else "?"
        tell(Check("device", True, f"firmware {firmware} at {self.link.name}"))
        self._ask_status("before")
        for imu in sorted(self.sensors):
            tell(self._sensor(imu))
        if all(heard.before.get("waits") == "sensor" for heard in self.sensors.values()):
            return checks
        if self._records("before"):
            tell(Check("idle", False, "a run is going on", BUSY_WORDS))
            return checks
        tell(*self._self_test())
        self._listen()
        if self._records("after"):
            tell(Check("idle", False, "a run began while it was listened to", BUSY_WORDS))
            return checks
        tell(self._losses())
        for imu, heard in sorted(self.sensors.items()):
            if heard.raw:
                tell(*(judge(imu, heard) for judge in (_rate, _clock, _noise, _gravity, _temperature)))
            elif heard.before.get("waits") != "sensor":
                tell(Check("rate", False, "no samples came", "see the errors of the sensor, and power it off and on", imu))
            tell(*_board(imu, heard))
        if self.ask is not None:
            tell(*self._turned(self.ask))
        if self.restart:
            tell(self._kept())
        return checks

    def _records(self, which: str) -> bool:
        return any(getattr(heard, which).get("state") == "recording" for heard in self.sensors.values())

    # what is heard

    def _take(self) -> list[Sentence]:
        sentences = self.link.receive()
        now = time.monotonic()
        for sentence in sentences:
            heard = self.sensors.setdefault(sentence.imu, Heard())
            if sentence.tag == "HEL":
                heard.hello = sentence.fields
            elif sentence.tag == "RAW":
                heard.raw.append(sentence)
                heard.arrived_s.append(now)
            elif sentence.tag == "ERR":
                heard.errors.append(describe_error(sentence))
        return sentences

    def _take_for(self, seconds: float, until: Callable[[Sentence], bool] = lambda sentence: False) -> list[Sentence]:
        deadline, found = time.monotonic() + seconds, []
        while time.monotonic() < deadline:
            fresh = self._take()
            found += fresh
            if any(until(sentence) for sentence in fresh):
                break
        return found

    def _ask_status(self, which: str) -> None:
        self.link.send("status")
        missing = set(self.sensors)
        deadline = time.monotonic() + STATUS_S
        while missing and time.monotonic() < deadline:
            for sentence in self._take():
                if sentence.tag == "STA":
                    setattr(self.sensors[sentence.imu], which, sentence.fields)
                    missing.discard(sentence.imu)

    def _listen(self) -> None:
        reader = self.link.reader
        self.link.send(self.link.stream)
        self._take_for(SETTLE_S)
        self._ask_status("before")
        for heard in self.sensors.values():
            heard.raw, heard.arrived_s = [], []
        self._lost, self._bad = reader.lost, reader.bad + reader.overlong
        self._take_for(self.seconds)
        self._lost, self._bad = reader.lost - self._lost, reader.bad + reader.overlong - self._bad
        self.link.send("stream off")
        raw = {imu: (list(heard.raw), list(heard.arrived_s)) for imu, heard in self.sensors.items()}
        self._take_for(SETTLE_S)
        self._ask_status("after")
        for imu, (sentences, arrived_s) in raw.items():
            self.sensors[imu].raw, self.sensors[imu].arrived_s = sentences, arrived_s

    # the checks

    def _sensor(self, imu: int) -> Check:
        heard = self.sensors[imu]
        name = heard.hello.get("sensor", "?")
        if not heard.before:
            return Check("sensor", False, f"{name}: no answer to status", LOST_WORDS, imu)
        if heard.before.get("waits") != "sensor":
            settings = f"{heard.hello.get('rate_hz', '?')} Hz, +-{heard.hello.get('full_scale_dps', '?')} dps"
            return Check("sensor", True, f"{name} answers, {settings}", imu=imu)
        self._take_for(SELF_TEST_S, lambda sentence: sentence.tag == "ERR" and sentence.imu == imu)
        why = heard.errors[-1] if heard.errors else "it says no reason"
        return Check("sensor", False, f"no {name} is set up: {why}", "check its four wires, its 3.3 V and its address", imu)

    def _self_test(self) -> list[Check]:
        try:
            self.link.command("selftest")
        except DeviceError as error:
            return [Check("self-test", None, str(error).partition("refused: ")[2] or str(error))]
        found = self._take_for(SELF_TEST_S, lambda sentence: sentence.tag == "TST")
        result = next((sentence for sentence in found if sentence.tag == "TST"), None)
        if result is None:
            why = next((describe_error(s) for s in found if s.tag == "ERR"), f"no result within {SELF_TEST_S:g} s")
            return [Check("self-test", False, why, "lay the sensor still and begin again")]
        values = {name: parse_value(text) for name, text in result.fields.items()}
        passed = values.get("passed") == 1
        advice = "" if passed else "lay the sensor still and begin again; if it fails again, replace the sensor"
        return [Check("self-test", passed, self_test_words(values), advice, result.imu)]

    def _losses(self) -> Check:
        missed = {imu: _grown(heard, "missed") for imu, heard in self.sensors.items()}
        words = f"{self._lost} lost, {self._bad} damaged on the wire, {sum(missed.values())} missed by the board"
        words += f" in {self.seconds:g} s"
        if self._lost or self._bad:
            return Check("losses", False, words, LOST_WORDS)
        if any(missed.values()):
            return Check("losses", False, words, "set fifo 16 with one of the sensor's rates, or lower rate_hz")
        return Check("losses", True, words)

    def _turned(self, ask: Callable[[str], None]) -> list[Check]:
        """What the sensors say of a turn by hand, which ends as soon as one of them has seen enough of it."""
        turns = {imu: Turn(heard) for imu, heard in self.sensors.items() if heard.raw}
        self.link.send(self.link.stream)
        self._take_for(SETTLE_S)
        for imu in turns:
            self.sensors[imu].raw, self.sensors[imu].arrived_s = [], []
        ask(LEFT)
        deadline = time.monotonic() + TURN_S
        while time.monotonic() < deadline and not any(turn.is_enough(self.sensors[imu]) for imu, turn in turns.items()):
            self._take_for(LOOK_S)
        self.link.send("stream off")
        self._take_for(SETTLE_S)
        return [turn.judge(imu, self.sensors[imu]) for imu, turn in sorted(turns.items())]

    def _kept(self) -> Check:
        """A setting is changed, the board starts again, the setting is looked at and set back; kept results are compared."""
        name = "kept over a restart"
        before, lines = self._setting(), self._dump()
        wanted = (78.0 if before is None else before) + NUDGE_DPS
        restarts = self.link.reader.restarts
        self.link.command(f"set table_dps {wanted:.9g}")
        try:
            self._take_for(SETTLE_S)
            self.link.command("reboot")
        except DeviceError as error:
            self._set_back(before)
            return Check(name, None, f"the board cannot start itself again ({error}); press RESET, then `get table_dps`")
        self._take_for(SETTLE_S)
        self.link.greet()
        self._take_for(SETTLE_S)
        kept, found = self._setting(), self._dump()
        self._set_back(before)
        if self.link.reader.restarts == restarts:
            return Check(name, False, "the board did not start again", "press RESET, then `get table_dps`")
        if kept is None or not math.isclose(kept, wanted, rel_tol=1e-6):
            shown = "none" if kept is None else f"{kept:g}"
            advice = "flash again, with partitions.csv: the board has no place for results"
            return Check(name, False, f"table_dps was {wanted:g} and is {shown}", advice)
        if found != lines:
            words = f"{len(lines)} lines of results before, {len(found)} after"
            return Check(name, False, words, "see the lines that begin with #")
        return Check(name, True, f"a setting, and {len(lines)} lines of results")

    def _setting(self) -> float | None:
        return parse_real(self.link.command("get table_dps").fields.get("table_dps", ""))

    def _set_back(self, table_dps: float | None) -> None:
        self.link.command("set table_dps " + ("none" if table_dps is None else f"{table_dps:.9g}"))

    def _dump(self) -> list[str]:
        """The kept results and counts of the first sensor, as they are sent."""
        answer = self.link.command("dump")
        wanted = int(answer.real("lines") or 0)
        found: list[str] = []
        deadline = time.monotonic() + DUMP_S
        while len(found) < wanted and time.monotonic() < deadline:
            found += [s.tag + s.text for s in self._take() if s.tag in ("OLD", "WIN") and s.imu == answer.imu]
        return found


def _grown(heard: Heard, name: str) -> int:
    before, after = (parse_real(status.get(name, "")) for status in (heard.before, heard.after))
    return int((after or 0) - (before or 0))


def _rate(imu: int, heard: Heard) -> Check:
    wanted, odr_hz = heard.real("rate_hz"), heard.real("odr_hz")
    t_us = np.array([sentence.t_us for sentence in heard.raw], float)
    if wanted is None or len(t_us) < 3:
        return Check("rate", False, f"{len(t_us)} samples came", "see the errors of the sensor", imu)
    found_hz = 1e6 / float(np.median(np.diff(t_us)))
    limit = POLLED_OFF if wanted != odr_hz else SENSOR_CLOCK_OFF
    words = f"{found_hz:.2f} Hz, {wanted:g} wanted"
    ok = abs(found_hz / wanted - 1) <= limit
    return Check("rate", ok, words, "" if ok else "power the sensor off and on; with a new firmware, flash again", imu)


def _clock(imu: int, heard: Heard) -> Check:
    """The promptest sentences of the first and of the last fifth tell how far the two clocks have gone apart.

    A computer that is busy sees all of them late; how much so shows in how the lateness changes from one reading to the next.
    """
    last = np.append(np.diff(heard.arrived_s) > 0, True)  # of those that came together, the promptest
    device_s = 1e-6 * np.array([sentence.t_us for sentence in heard.raw], float)[last]
    late_s = np.array(heard.arrived_s)[last] - device_s
    fifth = max(len(late_s) // 5, 1)
    span_s = float(device_s[-1] - device_s[0])
    if span_s < 1.0:
        return Check("clock", None, "too few samples to tell", imu=imu)
    apart_s = float(late_s[-fifth:].min() - late_s[:fifth].min())
    limit_s = CLOCK_OFF * span_s + HOST_LATE_S + BUSY_TIMES * float(np.median(np.abs(np.diff(late_s))))
    if limit_s > BUSY_S:
        return Check("clock", None, "this computer is too busy to tell", imu=imu)
    words = f"{1e3 * apart_s:+.1f} ms beside this computer's in {span_s:.0f} s, within {1e3 * limit_s:.0f}"
    ok = abs(apart_s) <= limit_s
    advice = "" if ok else "look for a board that stalls or starts again; listen longer (--seconds 60)"
    return Check("clock", ok, words, advice, imu)


def _noise(imu: int, heard: Heard) -> Check:
    lsb_dps, usual_dps, rate_hz = heard.real("lsb_dps"), heard.real("noise_dps"), heard.real("rate_hz")
    if lsb_dps is None or usual_dps is None or rate_hz is None:
        return Check("noise", None, "the device does not say what is usual: flash it again", imu=imu)
    rates = lsb_dps * heard.counts()[:, :3]
    n = max(int(BLOCK_S * rate_hz), 1)
    blocks = np.median(rates[: len(rates) // n * n].reshape(-1, n, 3), axis=1)  # single readings that stand out move none
    if len(blocks) and float(np.ptp(blocks, axis=0).max()) > MOVES_DPS:
        moves_dps = float(np.ptp(blocks, axis=0).max())
        return Check("noise", False, f"it moves, by {moves_dps:.1f} dps", "lay it still and begin again", imu)
    sd_dps = np.sqrt(0.5 * (np.diff(rates, axis=0) ** 2).mean(axis=0))
    usual_dps = math.hypot(usual_dps, lsb_dps / math.sqrt(12))
    words = ", ".join(f"{axis} {sd:.3f}" for axis, sd in zip("xyz", sd_dps, strict=True)) + f" dps, usual {usual_dps:.3f}"
    if float(sd_dps.min()) == 0.0:
        return Check("noise", False, words, "an axis does not change: power the sensor off and on, or replace it", imu)
    if float(sd_dps.max()) > NOISE_RATIO * usual_dps:
        return Check("noise", False, words, "look for vibration, a bad supply or a long cable", imu)
    is_filtered = bool(heard.real("low_pass"))  # less noise than usual is what the filter is for
    if float(sd_dps.min()) < usual_dps / NOISE_RATIO and not is_filtered:
        advice = "less than the sensor can: look for a filter, or for another sensor than it says"
        return Check("noise", False, words, advice, imu)
    return Check("noise", True, words, imu=imu)


def _gravity(imu: int, heard: Heard) -> Check:
    lsb_g = heard.real("lsb_g")
    size_g = math.nan if lsb_g is None else float(np.linalg.norm(lsb_g * heard.counts()[:, 3:6].mean(axis=0)))
    ok = abs(size_g - 1) <= GRAVITY_OFF
    advice = "" if ok else "lay it still; if it is an LSM6DSO32, send `set sensor LSM6DSO32`"
    return Check("gravity", ok, f"{size_g:.3f} g", advice, imu)


def _temperature(imu: int, heard: Heard) -> Check:
    lsb_c, zero_c = heard.real("lsb_c"), heard.real("zero_c")
    mean_c = math.nan if lsb_c is None or zero_c is None else zero_c + lsb_c * float(heard.counts()[:, 6].mean())
    ok = TEMP_C[0] <= mean_c <= TEMP_C[1]
    return Check("temperature", ok, f"{mean_c:.1f} °C", "" if ok else "power the sensor off and on, or replace it", imu)


def _board(imu: int, heard: Heard) -> list[Check]:
    status = heard.after or heard.before
    slowest_us, heap, stack = (parse_real(status.get(name, "")) for name in ("slowest_us", "heap_bytes", "stack_bytes"))
    rate_hz, checks = heard.real("rate_hz"), []
    if slowest_us is not None and rate_hz:
        ok = slowest_us <= 1e6 / rate_hz
        advice = "" if ok else "samples come late now and then: set fifo 16 with one of the sensor's rates, or lower rate_hz"
        checks.append(Check("time", ok, f"a sample took {slowest_us:g} us at most, {1e6 / rate_hz:.0f} are there", advice, imu))
    if heap is not None and stack is not None:
        ok = heap >= LEAST_HEAP and stack >= LEAST_STACK
        advice = "" if ok else "connect fewer sensors"
        checks.append(Check("memory", ok, f"{heap:g} bytes of heap and {stack:g} of stack were never used", advice, imu))
    return checks
