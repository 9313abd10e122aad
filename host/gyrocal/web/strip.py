"""The strip of all runs, coloured by their excess error. A click leaves a run out of the fit, another takes it in again."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nicegui import ui

from gyrocal.web.views import RunView


def strip(runs: Sequence[RunView], left: Mapping[str, float], excluded: frozenset[str], act: Callable[[str], Any]) -> None:
    """A button for each run. ``left`` is the excess by file, mdps; ``act`` is called with the file of the pressed run."""
    worst = max(left.values(), default=0.0)
    with ui.element("section").classes("face strip").props('aria-label="runs"'):
        told = f"coloured by excess error, up to {worst:.3g} mdps" if left else "excess error not known yet"
        out = f"; {len(excluded)} left out" if excluded else ""
        plural = "s" if len(runs) > 1 else ""
        ui.label(f"{len(runs)} run{plural}, {told}{out}. Press one to leave it out of the fit.").classes("dim small")
        with ui.element("div").classes("cells"):
            for run in runs:
                with _cell(run, left.get(run.file), worst, run.file in excluded).on("click", lambda r=run: act(r.file)):
                    ui.label("▲" if run.face == "up" else "▼").props('aria-hidden="true"')


def _cell(run: RunView, excess: float | None, worst: float, out: bool) -> ui.element:
    told = "left out" if out else "excess not known" if excess is None else f"excess {excess:.3g} mdps"
    words = html.escape(f"{run.file}, {run.scenario}, face {run.face}: {told}", quote=True)
    share = 0 if excess is None or worst <= 0 else round(100 * excess / worst)
    cell = ui.element("button").classes("cell out" if out else "cell").style(f"--share: {share}%")
    return cell.props(f'type="button" title="{words}" aria-label="{words}" aria-pressed="{str(out).lower()}"')
