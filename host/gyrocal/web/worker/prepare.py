"""What the worker computes once for the pictures of a model: traces, block means against every variable, spectra, places."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.api import Comparison
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.inference import heldout
from gyrocal.inference.blocks import Blocks, known_dps
from gyrocal.noise.allan import allan_deviation, model_deviation
from gyrocal.present.bins import binned
from gyrocal.present.decimate import Pyramid
from gyrocal.present.spectra import Curve, against_frequency, against_order
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.units import part_unit
from gyrocal.variables.base import variables
from gyrocal.variables.direction import CHANGING
from gyrocal.variables.frequency import Frequency
from gyrocal.variables.order import Order
from gyrocal.variables.rate import TURNS
from gyrocal.variables.reading import Reading
from gyrocal.variables.shapes import Columns, ShapeOfEachRun, TableWave
from gyrocal.web.values.residual_plots import ChangeOfRate, opened_by, panels
from gyrocal.web.values.views import Place

BINS = 12


class Residuals:
    """The residual of a fitted model in every sample, as its traces and in block means."""

    def __init__(self, found: Comparison, folder: Path, first: dict[int, int], rows: int) -> None:
        """Write the pyramids ``modelled`` and ``residual`` of ``rows`` samples; ``first`` is the first row of each run."""
        self.found = found
        self.by_axis: dict[str, dict[int, Array]] = {axis: {} for axis in found.fit.axes}
        means: dict[tuple[int, int], Array] = {}
        blocks = {b.run.index: b for b in found.fit.blocks}

        def fill_modelled(modelled: Any) -> None:
            def fill_residual(residual: Any) -> None:
                for p in heldout.fitted(found.fit):
                    at = slice(first[p.run.index], first[p.run.index] + len(p.run))
                    modelled[p.axis, at] = p.modelled_dps - known_dps(p.run, p.axis)
                    residual[p.axis, at] = p.residual_dps
                    self.by_axis[AXES[p.axis]][p.run.index] = p.residual_dps
                    means[p.run.index, p.axis] = blocks[p.run.index].mean(p.residual_dps[:, None])[:, 0]

            Pyramid.write(folder / "residual", 3, rows, fill_residual)

        Pyramid.write(folder / "modelled", 3, rows, fill_modelled)
        self.points = points(found.fit.blocks, means)

    def allan(self) -> dict[str, Curve]:
        """Allan deviations, with that of the noise model."""
        rate_hz = self.found.fit.session.sample_rate_hz
        out = {}
        for axis, by_run in self.by_axis.items():
            if by_run:
                tau_s, deviation = allan_deviation(list(by_run.values()), rate_hz)
                expected = model_deviation(tau_s, self.found.fit.axes[axis].noise, rate_hz)
                out[axis] = Curve(tau_s.tolist(), deviation.tolist(), expected.tolist())
        return out

    def spectra(self) -> dict[str, Curve]:
        """Spectra over the frequency."""
        return {a: against_frequency(self.found, a, list(r.values())) for a, r in self.by_axis.items() if r}

    def orders(self) -> dict[str, Curve]:
        """Spectra over the table's angle, of the axes and runs that have them."""
        found = {a: against_order(self.found, a, r) for a, r in self.by_axis.items() if r}
        return {a: curve for a, curve in found.items() if curve is not None}

    def left(self) -> dict[str, float]:
        """The excess error of each run by file, mdps: its mean square over the model's floor, all axes together.

        Empty for a session judged by angle, whose turns have no residual within the run.
        """
        if self.found.angles is not None:
            return {}
        axes = [a for a in self.found.floors if self.by_axis.get(a)]
        out = {}
        for run in self.found.fit.session.runs:
            over = [
                float(np.mean(self.by_axis[a][run.index] ** 2)) - self.found.floors[a].all
                for a in axes if run.index in self.by_axis[a]
            ]  # fmt: skip
            if over:
                out[run.file] = 1e3 * float(np.sqrt(max(0.0, float(np.mean(over)))))
        return out

    def places(self) -> list[Place]:
        """The picture of each finding."""
        return [place(finding, self.points) for finding in self.found.where]


def place(finding: Finding, of: dict[str, Any]) -> Place:
    """The picture that shows a finding, given the points of all pictures."""
    if finding.against == Order.name and isinstance(finding.shape, TableWave):
        return Place(Order.name, finding.shape.order, finding.shape.order)
    if finding.against == Frequency.name:
        low, high = finding.band_hz or _named_hz(finding.note)
        return Place(Frequency.name, low, high)
    if finding.against == Reading.name and finding.shape is None:
        return Place("")  # it shows from one reading to the next, and not against their size
    if isinstance(finding.shape, Columns) and finding.shape.words.startswith(TURNS):
        return Place("")  # a turn of known angle has no residual within the run
    if isinstance(finding.shape, Columns) and finding.shape.words == CHANGING:
        return Place(ChangeOfRate().name)
    kind = variables()[finding.against]
    own = [p for p in panels() if p.variable is kind]
    apart = isinstance(finding.shape, ShapeOfEachRun)
    part = part_unit(finding.note) if finding.times_rate else None
    if len(own) < 2:
        return Place(opened_by(finding.against), about_means=apart, part=part)
    best = max(own, key=lambda p: _visible(of[p.key(finding.axis)], of[finding.axis]))
    return Place(best.name, about_means=apart, part=part)


def _named_hz(note: str) -> tuple[float | None, float | None]:
    """The frequencies that the words of a finding name."""
    found = re.search(r"([\d.e+-]+)(?: and ([\d.e+-]+))? Hz", note)
    return (float(found[1]), float(found[2] or found[1])) if found else (None, None)


def _visible(x: Array, y: Array) -> float:
    """The part of the residual [blocks] that its means against a variable [blocks] describe."""
    use = np.isfinite(x) & np.isfinite(y)
    centre, mean, *_ = binned(x[use], y[use], BINS)
    if centre.size < 2:
        return 0.0
    inside = np.interp(x[use], centre, mean)
    return 1 - float(np.sum((y[use] - inside) ** 2)) / max(float(np.sum((y[use] - y[use].mean()) ** 2)), 1e-300)


def points(blocks: Sequence[Blocks], means: dict[tuple[int, int], Array]) -> dict[str, Any]:
    """Block means of the residual of each axis and of every variable for its plots; shape [blocks] each."""

    def stacked(of: Callable[[Run], Array | None]) -> Any:
        parts = []
        for b in blocks:
            values = None if b.run.rate_is_mean else of(b.run)
            parts.append(np.full(b.t_s.size, np.nan) if values is None else b.mean(values[:, None])[:, 0])
        return np.concatenate(parts).astype(np.float32)

    out: dict[str, Any] = {"run": np.concatenate([np.full(b.t_s.size, b.run.index, np.int32) for b in blocks])}
    for axis, name in enumerate(AXES):
        parts = [means.get((b.run.index, axis), np.full(b.t_s.size, np.nan)) for b in blocks]
        out[name] = np.concatenate(parts).astype(np.float32)
    runs = [b.run for b in blocks]
    for panel in panels():
        variable = panel.variable(runs)
        for axis, name in enumerate(AXES if variable.of_axis else AXES[:1]):
            values = stacked(lambda run, p=panel, v=variable, i=axis: p.values(v, run, i))  # type: ignore[misc]
            out[panel.key(name)] = values if variable.period is None else values % variable.period
    return out
