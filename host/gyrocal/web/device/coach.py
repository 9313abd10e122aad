"""The coach of the live page: what the table should do now, how far the run is, and the answer with its error and trust."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.device.monitor import doubtful
from gyrocal.digits import UNKNOWN, percent
from gyrocal.present.tables import number, plain
from gyrocal.units import unit_of
from gyrocal.web.pictures.words import METHODS, method

if TYPE_CHECKING:
    from gyrocal.web.device.live import Live

Result = dict[str, Any]

NEEDED_S = 6.0
"""Seconds of each face after which the answer improves little."""
STATES = {"idle": "waiting", "recording": "measuring", "flip": "waiting for the flip", "done": "done"}
"""The device's states in words. Only a session that is written to disk is called a recording."""
RICHEST = ("model", "cnn", "baseline", "turn", "rest")
BEEP = """(() => { const audio = window.coachAudio ??= new AudioContext(), tone = audio.createOscillator();
    tone.frequency.value = %d; tone.connect(audio.destination); tone.start(); tone.stop(audio.currentTime + 0.25); })()"""
FLIP_HZ, ANSWER_HZ = 880, 1320
STAGES = ("wait", "turn", "flip", "done")


@dataclass(frozen=True)
class Advice:
    """What to do now and why, and how urgent it is: one of ``STAGES``."""

    tell: str
    why: str
    stage: str


def advice(sensor: dict[str, Any], *, replays: bool, ended: bool) -> Advice:
    """The advice for a sensor's status."""
    hello = sensor.get("hello") or {}
    state, waits, run_s = sensor.get("state"), sensor.get("waits"), sensor.get("run_s", 0.0)
    rate = f"{hello['table_dps']} dps" if hello.get("table_dps") else "a constant rate"
    if ended:
        return Advice("The simulated device has stopped.", "It has played its two turns to the end.", "done")
    if waits == "sensor":
        return Advice("The sensor does not answer.", "Check its wires and its power; the device tries again by itself.", "wait")
    if state == "recording":
        second, by_hand = bool(sensor.get("second")), waits == "stop"
        return _turning(run_s, str(sensor.get("face")), second=second, replays=replays, by_hand=by_hand)
    if state == "done":
        return Advice("Both faces are measured.", "Read scale and bias here, or start again with a face up.", "done")
    if replays:
        what = "turns over" if state == "flip" else "is at rest"
        return Advice(f"The simulated sensor {what}.", f"It turns at {rate} within 15 s of its own time, by itself.", "wait")
    if waits == "unsteady":
        return Advice("Stop the table for a moment.", "The device measures when it turns steadily again.", "wait")
    start = "It begins by itself once the table turns steadily." if waits in ("steady", "flip") else "Then press Record."
    if state == "flip":
        return Advice(f"Flip now: turn the sensor over, then turn the table at {rate}.", start, "flip")
    return Advice(f"Lay the sensor face up and turn the table at {rate}.", start, "wait")


def _turning(run_s: float, face: str, *, second: bool, replays: bool, by_hand: bool) -> Advice:
    if run_s < NEEDED_S:
        return Advice("Keep the table turning.", f"Measuring face {face}: {NEEDED_S:g} s are needed.", "turn")
    if second:
        end = "The simulated sensor stops by itself." if replays else "You can stop the table."
        return Advice("Enough: the answer is complete.", end, "done")
    if replays:
        return Advice("Enough for this face.", "The simulated sensor flips by itself at the end of its run.", "turn")
    end = "It ends at the seconds that you asked for, or with Stop recording." if by_hand else "It ends when the table stops."
    return Advice("Flip now: stop the table and turn the sensor over.", f"This face has its {NEEDED_S:g} s. {end}", "flip")


def words(sensor: dict[str, Any]) -> str:
    """State and face of a sensor."""
    state = str(sensor.get("state"))
    return f"{STATES.get(state, state)} {sensor.get('face') or ''}".strip()


def answer(found: Sequence[Result]) -> Result | None:
    """The result that stands for the others: of the longest time, by the richest method that answered."""
    given = [r for r in found if isinstance(r.get("scale"), int | float) or isinstance(r.get("bias_dps"), int | float)]
    order = {method: -i for i, method in enumerate(RICHEST)}
    return max(given, key=lambda r: (r.get("seconds") or 0.0, order.get(r["method"], -len(order))), default=None)


def judged(found: Sequence[Result]) -> list[Result]:
    """The results that show whether the readings fit: the model's, otherwise the baseline's, otherwise the latest method's.

    These have a misfit, or the device has judged them. The network's misfit allows for a ripple and does not show it.
    """
    known = [r for r in found if isinstance(r.get("misfit"), int | float) or "trusted" in r]
    methods = {r["method"] for r in known}
    telling = next((m for m in ("model", "baseline") if m in methods), found[-1]["method"])
    return [r for r in known if r["method"] == telling]


def verdict(found: Sequence[Result]) -> str:
    """The judged results in a sentence."""
    against = {flag for r in found if doubtful(r) for flag in (str(r.get("flags") or "misfit")).split("+")}
    if not against:
        return "The readings agree with the calibration of the device."
    if "misfit" in against:
        return "The readings contain an effect that the calibration lacks: record a session and diagnose it."
    return f"The device does not trust its plain average: {_meaning(against)}."


def _meaning(flags: set[str]) -> str:
    from gyrocal.calibration.flags import FLAGS

    return "; ".join(FLAGS.get(flag, flag.replace("_", " ")) for flag in sorted(flags))


class Coach:
    """The section that says what to do, draws the ring, and shows one large answer; the table of all answers is folded."""

    def __init__(self, live: Live) -> None:
        self._live, self._imu = live, 0
        self._told: str | None = None
        self._found: list[Result] | None = None
        with ui.element("section").classes("face coach").props('aria-label="what to do"') as self._section:
            self._ring = ui.html("", sanitize=False).classes("ring")
            with ui.element("div").classes("grow"):
                self._tell = ui.label().classes("big").props('role="status"')
                self._why = ui.label().classes("dim")
                with ui.row().classes("tight"):
                    self._state = ui.label().classes("badge")
                    self._turns = ui.label().classes("dim small")
                    self._beeps = ui.checkbox("beep").props("dense")
        with ui.element("section").classes("face results").props('aria-label="results"') as self._results:
            self._large = ui.element("div")
            with ui.element("details").classes("fold"):
                with ui.element("summary"):
                    ui.label("All answers")
                self._all = ui.html("", sanitize=False).classes("sideways")

    def show(self, imu: int) -> None:
        """Show another sensor of the board."""
        self._imu, self._told, self._found = imu, None, None

    def update(self) -> None:
        """Draw what has changed."""
        live = self._live
        sensor = live.sensor(self._imu)
        now = advice(sensor, replays=bool(live.status.get("replays")), ended=live.ended)
        self._tell.text, self._why.text = now.tell, now.why
        self._state.text = words(sensor)
        self._state.set_visibility(not live.ended)
        measuring = sensor.get("state") == "recording" and not live.ended
        run_s = sensor.get("run_s", 0.0) if measuring else 0.0
        of = aim(run_s, NEEDED_S, "s")
        self._ring.content = ring(run_s / NEEDED_S, f"{run_s:.1f} s" if run_s else UNKNOWN, of)
        self._section.classes(remove=" ".join(STAGES)).classes(now.stage)
        self._section.set_visibility(bool(sensor.get("hello")) and bool(live.port))
        self._turns.text = self._measured(sensor) if measuring else ""
        self._signal(now.stage)
        found = sensor.get("results") or []
        if found != self._found:
            self._found = found
            self._answers(found)

    def _signal(self, stage: str) -> None:
        """Beep once for each stage of a face: between two sentences of the device, its end may look like a wait."""
        if stage in ("flip", "done") and self._told not in (None, stage) and self._beeps.value:
            ui.run_javascript(BEEP % (FLIP_HZ if stage == "flip" else ANSWER_HZ))
        if stage != "wait" or self._told is None:
            self._told = stage

    def _measured(self, sensor: dict[str, Any]) -> str:
        """The sensor's own reading about the table's axis over the last second, with its scatter."""
        samples, axis = self._live.sensors.get(self._imu), (sensor.get("hello") or {}).get("axis", "z")
        rows = None if samples is None else samples.latest(1.0)
        if rows is None or len(rows) < 2 or axis not in ("x", "y", "z"):
            return ""
        rate = rows[:, 1 + "xyz".index(axis)]
        return f"{axis} reads {rate.mean():.2f} dps, scatter {rate.std(ddof=1):.3f} dps over the last second"

    def _answers(self, found: list[Result]) -> None:
        self._results.set_visibility(bool(found))
        self._large.clear()
        best = answer(found)
        if best is None:
            return
        with self._large:
            with ui.row().classes("answer"):
                _figure("scale, %", percent(best.get("scale"), best.get("scale_se")))
                unit = unit_of([best.get("bias_dps")])
                _figure(f"bias, {unit.name}", unit.pair(best.get("bias_dps"), best.get("bias_se_dps")))
                with ui.element("div"):
                    ui.label("trusted by the device" if not doubtful(best) else "not trusted").classes(
                        f"badge {'bad' if doubtful(best) else 'good'}"
                    )
                    ui.label(_origin(best)).classes("dim small")
                    if doubtful(best):
                        against = set(str(best.get("flags") or "misfit").split("+"))
                        ui.label(f"{_meaning(against)}.").classes("worry small")
            tests = judged(found)
            if tests:
                with ui.row().classes("tight").style("flex-wrap: nowrap"):
                    ui.element("span").classes(f"light {'bad' if any(map(doubtful, tests)) else 'good'}")
                    allows = any(map(doubtful, tests)) and not doubtful(best)
                    ui.label(verdict(tests) + " The answer above allows for it." * allows).classes("small")
        self._all.content = table(found)


def _origin(result: Result) -> str:
    by = METHODS.get(str(result.get("method")), str(result.get("method")))
    seconds = result.get("seconds")
    when = f", from the first {seconds:g} s of each face" if isinstance(seconds, int | float) else ""
    warmth = result.get("temp_c")
    at = f", at {warmth:.1f} °C" if isinstance(warmth, int | float) else ""
    return f"axis {result.get('axis')}, by {by}{when}{at}"


def _figure(name: str, shown: tuple[str, str]) -> None:
    """A value, with its standard error where it has one."""
    value, error = shown
    with ui.element("div").classes("figure"):
        ui.html(f"<b>{value}{'' if error == UNKNOWN else f' ± {error}'}</b>", sanitize=False)
        ui.label(name)


def aim(now: float, needed: float, unit: str) -> str:
    """The words of a ring below its figure; what is beyond its aim is not a part of it."""
    return f"of {needed:g} {unit}" if now <= needed else f"{needed:g} {unit} needed"


def ring(part: float, middle: str, of: str) -> str:
    """A ring that closes as ``part`` reaches 1, with a figure in its middle and what it should become."""
    part = min(1.0, part)
    colour = "var(--good)" if part >= 1 else "var(--accent)"
    return (
        f'<svg viewBox="0 0 88 88" width="88" height="88" role="img" aria-label="{middle} {of}">'
        '<circle cx="44" cy="44" r="38" fill="none" stroke="var(--line)" stroke-width="8"/>'
        f'<circle cx="44" cy="44" r="38" fill="none" stroke="{colour}" stroke-width="8" pathLength="100" '
        f'stroke-dasharray="{100 * part:.1f} 100" transform="rotate(-90 44 44)"/>'
        f'<text x="44" y="44" text-anchor="middle" class="seconds">{middle}</text>'
        f'<text x="44" y="60" text-anchor="middle" class="of">{of}</text></svg>'
    )


COLUMNS = ("axis:", "method:", "first s", "scale, %", "±", "bias, {}", "± ", "misfit", "speaks against it:")
"""With the bias's unit to be put in."""


def table(found: Sequence[Result]) -> str:
    """All results as a table; those that the device does not trust are marked."""
    found = sorted(found, key=lambda r: (str(r.get("axis")), str(r.get("seconds")), str(r.get("method"))))
    unit = unit_of(r.get("bias_dps") for r in found)
    rows = [
        [
            str(r.get("axis", "")), method(str(r.get("method", ""))), number(r.get("seconds"), "g"),
            *percent(r.get("scale"), r.get("scale_se")), *unit.pair(r.get("bias_dps"), r.get("bias_se_dps")),
            number(r.get("misfit"), ".2f"),
            str(r.get("flags") or "").replace("+", ", "),
        ]
        for r in found
    ]  # fmt: skip
    return plain([name.format(unit.name) for name in COLUMNS], rows, [doubtful(r) for r in found])
