"""The monitor of a device: state, samples, results and losses on the screen."""

from __future__ import annotations

import contextlib
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gyrocal.device.port import Link, PortGone, describe_error
from gyrocal.device.wire import Sentence, parse_real, parse_value, raw_table
from gyrocal.digits import pair
from gyrocal.units import CELSIUS

if TYPE_CHECKING:
    from rich.console import RenderableType

ERRORS = 4
"""So many different errors are kept."""
EVENTS = {"HEL": "hello", "RUN": "run", "CAL": "result", "STA": "state", "TST": "selftest", "ACK": "ack", "ERR": "error"}
SAMPLE_UNITS = ("gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g", "temp_c")
RATE_OVER_S = 2.0
BLOCKS_A_SECOND = 8.0
"""Blocks of 0.25 s that two faces have in one second."""

Event = dict[str, Any]


def misfit_limit(seconds: float) -> float:
    """The largest misfit that noise explains after ``seconds`` of each face; the core's GC_MISFIT_LIMIT."""
    return 1 + 2.5 / math.sqrt(2 * BLOCKS_A_SECOND * seconds)


def doubtful(result: Event) -> bool:
    """True if the device does not trust this result.

    For a device that does not report trust, True if the misfit is above its limit.
    """
    if isinstance(result.get("trusted"), int):
        return result["trusted"] == 0
    misfit, seconds = result.get("misfit"), result.get("seconds")
    return isinstance(misfit, int | float) and misfit > misfit_limit(seconds if isinstance(seconds, int | float) else 6.0)


@dataclass
class Sensor:
    """The latest state, settings, sample and results of one sensor of the board."""

    state: str = "?"
    face: str = ""
    waits: str = ""
    """What the device waits for, as its ``$STA`` says; empty if it does not say."""
    second: bool = False
    """True while the run in progress is the second one of a pair, or would be."""
    missed: int = 0
    hello: dict[str, str] = field(default_factory=dict)
    samples: int = 0
    latest: Event | None = None
    self_test: Event | None = None
    """What the sensor's own test found last."""
    results: dict[tuple[Any, ...], Event] = field(default_factory=dict)
    earlier: set[tuple[Any, ...]] = field(default_factory=set)
    """The results that came before the device started again."""
    restarts: int = 0
    """Restarts of the device that this sensor's sentences have told of."""
    _arrivals: deque[tuple[float, int, int, int]] = field(default_factory=deque, repr=False)
    """Of the samples that came together: this machine's time, s, their number, and the device's times of the first and the
    last one, us."""

    def take(self, samples: list[Event]) -> None:
        """Count ``samples`` that have arrived now, and keep the last one."""
        self.samples += len(samples)
        self.latest = samples[-1]
        first_us, last_us = samples[0]["t_us"], samples[-1]["t_us"]
        if self._arrivals and first_us < self._arrivals[-1][3]:
            self._arrivals.clear()  # the device's clock began anew
        self._arrivals.append((time.monotonic(), len(samples), first_us, last_us))

    def run_s(self) -> float:
        """The length of the device's run in progress so far in s; 0 between runs."""
        rate_hz = parse_real(self.hello.get("rate_hz", ""))
        number = -1 if self.latest is None else self.latest["n"]
        return 0.0 if self.state != "recording" or not rate_hz else (number + 1) / rate_hz

    def rate_hz(self) -> float:
        """The mean number of samples per second of the device's time, of those that came in the last two seconds.

        A simulated device may play faster than in real time; its sampling rate is the same then.
        """
        now = time.monotonic()
        while self._arrivals and now - self._arrivals[0][0] > RATE_OVER_S:
            self._arrivals.popleft()
        if not self._arrivals:
            return 0.0
        span_s = 1e-6 * (self._arrivals[-1][3] - self._arrivals[0][2])
        return (sum(n for _, n, *_ in self._arrivals) - 1) / span_s if span_s > 0 else 0.0


@dataclass
class Told:
    """An error: when the device last sent it (its own clock), how often, and after how many restarts."""

    t_us: int
    times: int
    restarts: int

    def line(self, text: str, restarts: int) -> str:
        """The error with its time and count for the screen."""
        when = f"{1e-6 * self.t_us:9.3f} s  " if self.restarts == restarts else "before restart: "
        return when + text + (f" ({self.times} times)" if self.times > 1 else "")


class Monitor:
    """Listens to a device and keeps its state for display; :meth:`screen` draws it.

    ``sensors`` holds the sensors of the board that have sent a sentence, by number.
    """

    def __init__(self, link: Link, *, self_test: bool = False) -> None:
        self.link = link
        self.self_test = self_test
        self.sensors: dict[int, Sensor] = {}
        self.ended = ""
        """Why it ended; empty while it listens."""
        self._told: dict[str, Told] = {}

    def run(self, heard: Callable[[list[Event]], None], seconds: float | None = None) -> None:
        """Listen until the device ends or ``seconds`` have passed.

        ``heard`` is called at least about twenty times a second with the events since the last call. An event is a dictionary
        with ``event`` (hello, sample, run, result, state, selftest, ack, error), ``t_us`` and ``imu``. The last one is ``end``.

        Raises:
            DeviceError: no device answers at the port, or a sentence is of another version of the protocol.
        """
        deadline = np.inf if seconds is None else time.monotonic() + seconds
        reason = "the time is over"
        connected = True
        with contextlib.suppress(PortGone):  # the sentences before the device went away are kept
            self.link.greet()
            self._ask()
        while time.monotonic() < deadline:
            try:
                sentences = self.link.receive()
                if self.link.connected and not connected:
                    self.link.send("hello")
                    self._ask()
                connected = self.link.connected
            except PortGone as gone:
                reason = str(gone)
                break
            heard(self._digest(sentences))
        self.ended = reason
        heard([{"event": "end", "reason": reason, **self.counts()}])

    @property
    def errors(self) -> list[str]:
        """The latest different errors that the device sent, the last one at the end."""
        return list(self._told)

    def counts(self) -> dict[str, int]:
        """The numbers of good, lost and bad sentences so far, of bytes that belong to none, and of restarts of the device."""
        r = self.link.reader
        return {"good": r.good, "lost": r.lost, "bad": r.bad + r.overlong, "skipped": r.skipped, "restarts": r.restarts}

    def ask_state(self) -> None:
        """Ask the device for its state, which the next ``$STA`` tells."""
        self._tell("status")

    def _ask(self) -> None:
        if self.self_test:
            self.link.send("selftest")
        self.link.send(self.link.stream)
        self.link.send("status")

    def _tell(self, command: str) -> None:
        with contextlib.suppress(PortGone):  # the next read raises the error, after the pending sentences
            self.link.send(command)

    def _digest(self, sentences: list[Sentence]) -> list[Event]:
        events: list[Event] = []
        samples: list[Sentence] = []
        for sentence in sentences:
            if sentence.tag == "RAW":
                samples.append(sentence)
            elif sentence.tag in EVENTS:
                events += self._samples(samples)
                samples = []
                events.append(self._other(sentence))
        return events + self._samples(samples)

    def _samples(self, sentences: list[Sentence]) -> list[Event]:
        if not sentences:
            return []
        table = raw_table(sentences)
        values = table.counts
        for imu in set(table.imu.tolist()):
            mine, sensor = table.imu == imu, self._sensor(imu)
            values[mine] *= _unit(sensor, "lsb_dps", "lsb_dps", "lsb_dps", "lsb_g", "lsb_g", "lsb_g", "lsb_c")
            values[mine, 6] += _unit(sensor, "zero_c")
        events: list[Event] = []
        for sentence, n, row in zip(sentences, table.number.tolist(), values.tolist(), strict=True):
            named = {name: None if v != v else round(v, 9) for name, v in zip(SAMPLE_UNITS, row, strict=True)}
            events.append({"event": "sample", "t_us": sentence.t_us, "imu": sentence.imu, "n": n, **named})
        for imu in set(table.imu.tolist()):
            self.sensors[imu].take([e for e in events if e["imu"] == imu])
        return events

    def _sensor(self, imu: int) -> Sensor:
        return self.sensors.setdefault(imu, Sensor())

    def _other(self, sentence: Sentence) -> Event:
        kind, fields = EVENTS[sentence.tag], sentence.fields
        sensor = self._sensor(sentence.imu)
        values = {name: parse_value(text) for name, text in fields.items() if name != "state"}
        if "state" in fields:
            values["state"] = fields["state"]
        if kind == "hello":
            sensor.hello = fields
            if sensor.restarts != self.link.reader.restarts:
                sensor.restarts, sensor.missed = self.link.reader.restarts, 0
                sensor.earlier = set(sensor.results)
            if not self.link.answered:  # the device has just started, and its settings may still follow
                self._tell("hello")
        elif kind == "state":
            sensor.state, sensor.face = fields.get("state", "?"), fields.get("face", "")
            sensor.waits = fields.get("waits", "")
            sensor.second = sensor.state == "flip" or (sensor.second and sensor.state == "recording")
            missed = parse_real(fields.get("missed", ""))
            sensor.missed = sensor.missed if missed is None else int(missed)
        elif kind == "run":
            sensor.face = fields.get("face", "")
            sensor.state = "recording" if fields.get("state") == "start" else "idle"
            sensor.waits = ""
            if sensor.state == "recording":
                sensor.latest = None  # the last run's sample says nothing of the length of this one
            if sensor.state == "idle":
                self._tell("status")  # the device may be waiting for a flip, or be done
        elif kind == "selftest":
            sensor.self_test = values
        elif kind == "result":
            which = values.get("axis"), values.get("method"), values.get("seconds")
            sensor.results[which] = values
            sensor.earlier.discard(which)
        elif kind == "error":
            text = (f"sensor {sentence.imu}: " if len(self.sensors) > 1 else "") + describe_error(sentence)
            before = self._told.pop(text, None)
            self._told[text] = Told(sentence.t_us, 1 if before is None else before.times + 1, self.link.reader.restarts)
            for oldest in self.errors[:-ERRORS]:
                del self._told[oldest]
        return {"event": kind, "t_us": sentence.t_us, "imu": sentence.imu, **values}

    def screen(self) -> RenderableType:
        """The current state as a table for the terminal."""
        from rich.console import Group
        from rich.text import Text

        counts = self.counts()
        missed = sum(sensor.missed for sensor in self.sensors.values())
        restarts = f"{counts['restarts']} restart{'s' * (counts['restarts'] != 1)}"
        loss = Text(f"{counts['lost']} lost, {counts['bad']} bad, {missed} missed, {restarts}")
        loss.stylize("bold red" if counts["lost"] or counts["bad"] or missed else "dim")
        head = Text.assemble(
            (self.link.name, "bold"), "" if self.link.connected else ("  disconnected, trying again", "bold red"), "   ", loss
        )
        parts = [part for imu in sorted(self.sensors) for part in self._sensor_lines(imu)]
        errors = [Text(told.line(error, counts["restarts"]), style="red") for error, told in self._told.items()]
        end = [Text(f"ended: {self.ended}")] if self.ended else []
        return Group(head, *parts, *errors, *end)

    def _sensor_lines(self, imu: int) -> list[RenderableType]:
        from rich.text import Text

        sensor = self.sensors[imu]
        hello = sensor.hello
        state = Text.assemble(
            ("● ", "red" if sensor.state == "recording" else "dim"),
            f"sensor {imu} " if len(self.sensors) > 1 else "",
            (f"{sensor.state} {sensor.face}", "bold"),
            f"  {hello.get('sensor', '?')}, firmware {hello.get('fw', '?')}, {hello.get('rate_hz', '?')} Hz, "
            f"+-{hello.get('full_scale_dps', '?')} dps, {sensor.samples} samples, {sensor.rate_hz():.0f} a second",
        )
        tested = [] if sensor.self_test is None else [_self_test_line(sensor.self_test)]
        return [state, *tested, _sample_line(sensor), _result_table(sensor)]


def self_test_words(found: Event) -> str:
    """What the sensor's own test found, in words."""
    sizes = [found.get(f"{axis}_dps") for axis in "xyz"]
    if any(not isinstance(size, int | float) for size in sizes):
        return "passed" if found.get("passed") == 1 else "failed"
    moved = ", ".join(f"{axis} {size:.0f}" for axis, size in zip("xyz", sizes, strict=True))
    words = f"{'passed' if found.get('passed') == 1 else 'failed'}: it moved {moved} dps, the maker wants {_limits(found)}"
    most = found.get("rest_most_dps")
    if not isinstance(most, int | float):
        return words
    rest_dps = {axis: round(float(found.get(f"rest_{axis}_dps") or 0.0), 1) for axis in "xyz"}
    at_rest = ", ".join(f"{axis} {rate_dps + 0.0:.1f}" for axis, rate_dps in rest_dps.items())  # no -0.0
    return f"{words}; at rest {at_rest} dps, at most {most:g}"


def _limits(found: Event) -> str:
    """The limits of all axes, or of each its own."""
    if "least_dps" in found:
        return _limit(found, "")
    return ", ".join(f"{axis} {_limit(found, f'{axis}_')}" for axis in "xyz")


def _limit(found: Event, axis: str) -> str:
    least, most = found.get(f"least_{axis}dps"), found.get(f"most_{axis}dps")
    if not isinstance(least, int | float):
        return "a code of the factory, which is missing"
    return f"{least:.0f} to {most:.0f}" if isinstance(most, int | float) else f"{least:.0f} or more"


def _self_test_line(found: Event) -> RenderableType:
    from rich.text import Text

    return Text(f"self-test {self_test_words(found)}", style="dim" if found.get("passed") == 1 else "bold red")


def _unit(sensor: Sensor, *names: str) -> np.ndarray[Any, Any]:
    """A unit from the sensor's hello; NaN before the hello came."""
    found = [parse_real(sensor.hello.get(name, "")) for name in names]
    return np.array([np.nan if value is None else value for value in found])


def _sample_line(sensor: Sensor) -> RenderableType:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2), header_style="dim")
    cells = []
    for name in SAMPLE_UNITS:
        quantity, unit = name.rsplit("_", 1)
        table.add_column(f"{quantity} {UNIT_WORDS[unit]}", justify="right", min_width=10)
        value = None if sensor.latest is None else sensor.latest[name]
        cells.append("" if value is None else f"{value:.3f}")
    table.add_row(*cells)
    return table


def _result_table(sensor: Sensor) -> RenderableType:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 1), header_style="dim")
    for name in ("axis", "method", "seconds", "scale %", "bias dps", f"temp {CELSIUS}", "misfit"):
        table.add_column(name, justify="left" if name in ("axis", "method") else "right", no_wrap=True)
    table.add_column("flags", overflow="fold")
    for which, values in sorted(sensor.results.items(), key=lambda item: tuple(map(str, (item[0][0], item[0][2], item[0][1])))):
        flags = str(values.get("flags") or "").replace("+", " ")
        table.add_row(
            str(values.get("axis", "")),
            str(values.get("method", "")),
            _number(values.get("seconds"), "g"),
            _with_error(values.get("scale"), values.get("scale_se"), 100.0),
            _with_error(values.get("bias_dps"), values.get("bias_se_dps"), 1.0),
            _number(values.get("temp_c"), ".1f"),
            Text(_number(values.get("misfit"), ".2f"), style="bold red" if doubtful(values) else ""),
            Text.assemble(("before restart " if which in sensor.earlier else "", "dim"), (flags, "bold red")),
        )
    return table


UNIT_WORDS = {"dps": "dps", "g": "g", "c": CELSIUS}


def _number(value: Any, form: str) -> str:
    return "" if value is None else format(value, form)


def _with_error(value: float | None, error: float | None, factor: float) -> str:
    if value is None:
        return ""
    shown, within = pair(value, error, factor, 4)
    return shown if error is None else f"{shown} ± {within}"
