"""The strip of all runs, coloured by their excess error. A click leaves a run out of the fit, another takes it in again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nicegui import ui

from gyrocal.units import rate_text
from gyrocal.web.pictures import charts
from gyrocal.web.values.views import RunView
from gyrocal.web.widgets.toolbar import toolbar

REFOCUS = """if (document.activeElement === document.body) document.querySelectorAll(".cells .cell")[%d]?.focus()"""
"""The strip is drawn anew after a press; the focus goes back to the cell with this number unless it is elsewhere by now."""


def strip(
    runs: Sequence[RunView], left: Mapping[str, float], floor: float, excluded: frozenset[str], last_run: str | None,
    act: Callable[[str], Any],
) -> None:
    """A button for each run. ``left`` is the excess by file, mdps; ``act`` is called with the file of the pressed run.

    ``last_run`` is the file of the only run in the fit, whose button does nothing and says why; None if there are several.
    """
    worst = max(left.values(), default=0.0)
    with ui.element("section").classes("face strip").props('aria-label="runs"'):
        told = f"each coloured by its own excess error of all axes, at most {_told(worst)}"
        told = f"{told}; full colour is {_told(max(worst, floor))}" if left else "without an excess error of their own"
        out = f"; {len(excluded)} left out" if excluded else ""
        plural = "s" if len(runs) > 1 else ""
        press = "Press one to leave it out of the fit."
        if last_run is not None:
            press = f"{last_run} is the only one in the fit, and stays. Press another to take it in again."
            press = press if excluded else "It cannot be left out of the fit, because there is no other."
        ui.label(f"{len(runs)} run{plural}, {told}{out}. ▲ face up, ▼ face down. {press}").classes("dim small")
        with ui.element("div").classes("cells").style(f"--runs: {len(runs)}") as cells:
            for run in runs:
                excess = left.get(run.file)
                cell = _cell(run, excess, share(excess, worst, floor), run.file in excluded, run.file == last_run)
                if run.file != last_run:
                    cell.on("click", lambda r=run: act(r.file))
                with cell:
                    ui.label("▲" if run.face == "up" else "▼").props('aria-hidden="true"')
        toolbar(cells, "runs in the fit")


def _cell(run: RunView, excess: float | None, part: int, out: bool, stays: bool) -> ui.element:
    told = "left out" if out else "excess not known" if excess is None else f"excess {_told(excess)}"
    told = f"{told}; it stays in the fit, because no other run is left" if stays else told
    words = charts.words([run.file, run.scenario, f"face {run.face}: {told}"])
    kind = "cell out" if out else "cell stays" if stays else "cell"
    cell = ui.element("button").classes(kind).style(f"--share: {part}%")
    states = f'aria-pressed="{str(out).lower()}" aria-disabled="{str(stays).lower()}"'
    return cell.props(f'type="button" title={words} aria-label={words} {states}')


def _told(excess_mdps: float) -> str:
    return rate_text(1e-3 * excess_mdps)


def share(excess: float | None, worst: float, floor: float) -> int:
    """Per cent of the full colour. An excess of the size of the noise floor has all of it, so that noise alone stays pale."""
    full = max(worst, floor)
    return 0 if excess is None or full <= 0 else round(100 * excess / full)
