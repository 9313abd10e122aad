"""The guide of a recording by hand on the live page: the next turn, the rests so far, and the errors beside their aims."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.digits import percentage
from gyrocal.policy import POLICY
from gyrocal.web.device.coach import Advice, aim, ring

if TYPE_CHECKING:
    from gyrocal.web.device.live import Live

FIRST_REST = "Lay the sensor down and leave it still for ten seconds."
KINDS = (("scale_se", "scale_aim", "{:.3%}", "{:.2%}"), ("misalignment_se", "misalignment_aim", "{:.4f}", "{:g}"))
"""Keys of an error and of its aim, and their formats."""


def guidance(recording: dict[str, Any]) -> Advice:
    """What the person should do now and why, for the state of a recording by hand as the listener tells it."""
    now, going = recording.get("hands"), recording.get("going")
    if now is None:
        if going:
            return Advice(FIRST_REST, "Then turn it from pose to pose, and keep it still for two seconds in each.", "wait")
        return Advice("The recording has ended without a rest.", "Record again, and begin with a rest of ten seconds.", "wait")
    if now["met"]:
        return Advice("Done: every axis is known well enough.", "The calibration will state the errors below.", "done")
    told = missing(now)
    if not going:
        again = "Record by hand in the same folder adds to it, as long as the sensor stays switched on"
        return Advice("The recording has ended before its aims were met.", f"{told} {again}.", "wait")
    return Advice(f"{now['turn'][0].upper()}{now['turn'][1:]}.", told, "turn")


def missing(now: dict[str, Any]) -> str:
    """What keeps a recording by hand from its aims, in a sentence."""
    if any(aim["scale_se"] is None for aim in now["aims"]):
        return f"The errors are known from {POLICY.fewest_rests} rests on."
    axes = {se: [aim["axis"] for aim in now["aims"] if aim[se] > aim[wanted]] for se, wanted, *_ in KINDS}
    lacking = [f"{_name(se)} of {', '.join(of)}" for se, of in axes.items() if of]
    if lacking:
        return f"Not yet known well enough: {'; '.join(lacking)}. This turn lowers the errors most."
    left = POLICY.aim_rests - now["rests"]
    return f"Every axis is known well enough; {left} more rest{'s' * (left > 1)} in other poses make it sure."


class Guide:
    """The section of a recording by hand; hidden when there is none."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._was: dict[str, Any] | None = None
        with ui.element("div").classes("column") as self._all:
            with ui.element("section").classes("face coach").props('aria-label="what to do by hand"') as self._section:
                self._ring = ui.html("", sanitize=False).classes("ring")
                with ui.element("div").classes("grow"):
                    self._tell = ui.label().classes("big").props('role="status"')
                    self._why = ui.label().classes("dim")
                    self._state = ui.label().classes("badge")
            with ui.element("section").classes("face").props('aria-label="errors by hand"') as self._errors:
                ui.html("<h2>Standard errors so far, and the aims</h2>", sanitize=False)
                self._table = ui.html("", sanitize=False).classes("sideways")

    @property
    def shown(self) -> bool:
        """True if a recording by hand is there."""
        return bool((self._live.status.get("recording") or {}).get("by_hand"))

    def update(self) -> None:
        """Draw what has changed."""
        self._all.set_visibility(self.shown)
        recording = self._live.status.get("recording") or {}
        if not self.shown or recording == self._was:
            return
        self._was = recording
        advised, now = guidance(recording), recording.get("hands")
        rests = now["rests"] if now else 0
        by_itself = bool(self._live.status.get("replays")) and advised.stage != "done"
        self._tell.text = advised.tell
        self._why.text = advised.why + " The simulated sensor turns by itself, in poses of its own." * by_itself
        self._section.classes(replace=f"face coach {advised.stage}")
        self._ring.content = ring(rests / POLICY.aim_rests, str(rests), aim(rests, POLICY.aim_rests, "rests"))
        at_rest = bool(now and now["at_rest"])
        self._state.text = "at rest" if at_rest else "moving"
        self._state.classes(replace=f"badge {'good' if at_rest else ''}")
        self._state.set_visibility(bool(recording.get("going")))
        self._errors.set_visibility(now is not None)
        if now is not None:
            self._table.content = errors(now["aims"])


def errors(aims: list[dict[str, Any]]) -> str:
    """Standard errors of each axis as bars that are full when the aim is met."""
    head = "".join(f"<th class=text>{_name(se)} ±</th><th class=text></th>" for se, *_ in KINDS)
    rows = "".join(f"<tr><td class=text>{aim['axis']}</td>{''.join(_cell(aim, *kind) for kind in KINDS)}</tr>" for aim in aims)
    return f"<table class=plain><thead><tr><th class=text>axis</th>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _name(error: str) -> str:
    return error.removesuffix("_se")


def _cell(aim: dict[str, Any], error: str, wanted_error: str, form: str, wanted_form: str) -> str:
    se, wanted = aim[error], aim[wanted_error]
    if se is None:
        return "<td class=text>not known yet</td><td></td>"
    part = min(1.0, wanted / se)
    told = f"{form.format(se)}, aim {wanted_form.format(wanted)}".replace("%", " %")
    said = f'role="img" aria-label="{percentage(part)} of the way to the aim"'
    bar = f'<div class="reached {"good" if part >= 1 else ""}" {said}><div style="width: {part:.1%}"></div></div>'
    return f"<td class=text>{told}</td><td>{bar}</td>"
