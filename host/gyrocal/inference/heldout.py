"""Held-out evaluation: parameters are fitted to a part of the data and judged on the rest.

The unit that is left out is a day if there are two or more, else a power cycle if there are three or more, else a run. If this
would leave a parameter unidentified, the units are blocks of time with gaps around them. Samples are never left out at random,
because they share the drift of their run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.inference.blocks import Blocks, known_dps
from gyrocal.inference.design import Mask
from gyrocal.inference.fitted import AxisFit, Fit, SampleColumns
from gyrocal.inference.reml import Equations, Solution, Spreads, fit_spreads
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Run


@dataclass(frozen=True)
class Fold:
    """The data that one step leaves out: whole runs (``time`` is None), or a time interval of every run (as fractions)."""

    label: str
    runs: tuple[int, ...]
    time: tuple[float, float] | None = None


EVERYTHING = Fold("all", ())
"""The name of a prediction in sample, which is used if nothing can be left out."""
SESSION = "session"
"""Label of the fold that leaves out all runs: the parameters are those of another session."""


@dataclass(frozen=True)
class Prediction:
    """Held-out samples of one run and axis: their rows, and measured and modelled rate [rows] in deg/s."""

    run: Run
    axis: int
    rows: slice
    modelled_dps: Array

    @property
    def measured_dps(self) -> Array:
        """Measured rates of the predicted samples, shape [n], dps."""
        return self.run.gyro_dps[self.rows, self.axis]

    @property
    def residual_dps(self) -> Array:
        """Measured minus predicted rates, shape [n], dps."""
        return self.measured_dps - self.modelled_dps


def folds(fit: Fit, only_day: int | None = None) -> list[Fold]:
    """The steps of leave-one-out for a fitted model; empty if nothing can be left out."""
    runs = [b.run for b in fit.blocks]
    everything = range(len(runs))

    def grouped(labels: list[Any]) -> list[Fold]:
        return [Fold(str(k), tuple(i for i in everything if labels[i] == k)) for k in dict.fromkeys(labels)]

    days = [r.day for r in runs]
    scenarios = [r.scenario for r in runs]
    choices: list[list[Fold]] = []
    if None not in days and len(set(days)) >= 2:
        choices.append(grouped(days))
    elif len(set(scenarios)) >= 3:
        choices.append(grouped(scenarios))
    elif len(runs) >= 2:
        choices.append([Fold(r.file, (i,)) for i, r in enumerate(runs)])
    for choice in choices:
        if all(_identified(fit, fold) for fold in choice):
            if only_day is not None:
                choice = [f for f in choice if f.label == str(only_day)]
            return choice
    if any(r.rate_is_mean for r in runs) or min(r.duration_s for r in runs) < POLICY.shortest_run_s:
        return []
    edges = np.linspace(0, 1, POLICY.time_blocks + 1)
    return [
        Fold(f"time block {k + 1}", tuple(everything), (a, b))
        for k, (a, b) in enumerate(pairwise(edges))
    ]


def whole(fit: Fit) -> Fold:
    """The fold of all runs, for parameters that come from another session."""
    return Fold(SESSION, tuple(range(len(fit.blocks))))


def _identified(fit: Fit, fold: Fold) -> bool:
    kept = np.ones(len(fit.blocks), dtype=bool)
    kept[list(fold.runs)] = False
    if not kept.any():
        return False
    for axis in fit.axes.values():
        p = len(axis.design.layout.fixed)
        gram = axis.grams[kept][:, 1 : 1 + p, 1 : 1 + p].sum(axis=0)
        everything = axis.grams[:, 1 : 1 + p, 1 : 1 + p].sum(axis=0)
        scale = np.sqrt(np.maximum(np.diag(everything), 1e-300))
        # the least part of what all runs know that is left, for columns of any unit and origin
        try:
            root = np.linalg.inv(np.linalg.cholesky(everything / np.outer(scale, scale)))
        except np.linalg.LinAlgError:
            return False
        if p and np.linalg.eigvalsh(root @ (gram / np.outer(scale, scale)) @ root.T)[0] < POLICY.least_left:
            return False
    return True


@dataclass(frozen=True)
class Step:
    """One axis with one fold left out."""

    fold: Fold
    trained: AxisFit
    solution: Solution
    spreads: Spreads
    gain: dict[str, float]
    """Predictive log-likelihood of each held-out power cycle, or of each run if runs are left out."""


def steps(axis: AxisFit, all_folds: list[Fold]) -> Iterator[Step]:
    """Leave each fold out in turn.

    The shared parameters and the spreads over runs are fitted to the rest. The noise stays as fitted to all data. What is
    fitted is kept with the fit of the axis, because gains and predictions ask for the same folds.
    """
    kept: dict[Fold, _Rest] = axis.__dict__.setdefault("_without", {})
    for fold in all_folds:
        if fold not in kept:
            kept[fold] = _Rest.of(axis, fold)
        rest = kept[fold]
        yield Step(fold, rest.trained or axis, rest.solution, rest.spreads, rest.gain)


@dataclass(frozen=True)
class _Rest:
    """What is fitted without a fold; ``trained`` is None if it is of the design of all data."""

    trained: AxisFit | None
    solution: Solution
    spreads: Spreads
    gain: dict[str, float]

    @staticmethod
    def of(axis: AxisFit, fold: Fold) -> _Rest:
        """The fit of an axis without a fold."""
        if fold.label == SESSION and len(fold.runs) == len(axis.design.blocks):
            return _Rest(None, axis.solution, axis.spreads, {})
        if fold.time is not None:
            return _without_time(axis, fold)
        held = np.zeros(len(axis.design.blocks), dtype=bool)
        held[list(fold.runs)] = True
        spreads = axis.spreads_without(held)
        solution = axis.subset(~held, spreads)
        return _Rest(None, solution, spreads, dict(_gains(axis, held, solution, spreads)))


def _gains(axis: AxisFit, held: Mask, trained: Solution, spreads: Spreads) -> Iterator[tuple[str, float]]:
    runs = [b.run for b in axis.design.blocks]
    labels = [r.scenario if axis.design.layout.scenario else r.file for r in runs]
    for label in dict.fromkeys(labels[i] for i in np.flatnonzero(held)):
        mine = np.array([h and x == label for h, x in zip(held, labels, strict=True)])
        yield label, axis.subset(~held | mine, spreads).loglik - trained.loglik


def _without_time(axis: AxisFit, fold: Fold) -> _Rest:
    masks = [time_masks(b, fold) for b in axis.design.blocks]
    fits = []
    for kept in ([~inside & ~near for inside, near in masks], [~near for _, near in masks]):
        design = axis.design.selected(kept)
        grams, logdet = design.grams(axis.noise)
        equations = Equations(design.layout, grams, logdet, design.scenarios, int(design.n_blocks.sum()))
        fits.append((design, equations, logdet))
    (design, equations, logdet), (_, more, _) = fits
    spreads = fit_spreads(design, equations, axis.spreads)
    solution, both = equations.solve(spreads), more.solve(spreads)
    fitted = AxisFit(design, axis.noise, spreads, solution, axis.design.terms, equations.grams, logdet)
    return _Rest(fitted, solution, spreads, {fold.label: both.loglik - solution.loglik})


def time_masks(b: Blocks, fold: Fold) -> tuple[Mask, Mask]:
    """Masks [m] of a run's blocks that a fold leaves out, and of those beside them that no fit uses."""
    assert fold.time is not None
    elapsed = b.t_s - b.run.sample_s[0]
    start, stop = (f * b.run.duration_s for f in fold.time)
    gap_s = min(POLICY.time_gap_s, 0.05 * b.run.duration_s)
    inside = (elapsed >= start) & (elapsed < stop)
    near = ~inside & (elapsed >= start - gap_s) & (elapsed < stop + gap_s)
    return inside, near


def predictions(fit: Fit, all_folds: list[Fold], *, net: bool = False) -> Iterator[Prediction]:
    """Every held-out sample by run and axis. The phases and sizes of each run are refitted in the held-out run.

    ``net`` includes runs of which only the net angle is known, so that only the sum over a run means something.
    """
    for axis in fit.axes.values():
        shared: dict[int, SampleColumns] = {}  # of the runs of which each fold of time leaves out a part
        for step in steps(axis, all_folds):
            design = step.trained.design
            for i in step.fold.runs:
                b = design.blocks[i]
                if step.fold.time is not None and not design.levels and b.run.index not in shared:
                    shared[b.run.index] = design.sample_columns(b)
                if net or not b.run.rate_is_mean:
                    yield _predict(step, i, shared.get(b.run.index))


def fitted(fit: Fit, *, net: bool = False) -> Iterator[Prediction]:
    """The same predictions in sample, if nothing can be left out, by the values that the model tells."""
    for axis in fit.axes.values():
        everything = Step(EVERYTHING, axis, _told(axis), axis.spreads, {})
        for i, b in enumerate(fit.blocks):
            if net or not b.run.rate_is_mean:
                yield _predict(everything, i)


def _told(axis: AxisFit) -> Solution:
    """The solution with the bias that the model tells: where turns of known angle leak into the axis, they do not pull it."""
    beta = axis.solution.beta.copy()
    for k, (i, _) in enumerate(axis.design.layout.fixed):
        term = axis.terms[i]
        if term.effect.role is Role.BIAS and term.values and any(b.run.rate_is_mean for b in axis.design.blocks):
            beta[k] = term.effect.coding.coefficients(term.values)[0]
    return replace(axis.solution, beta=beta)


def _predict(step: Step, i: int, columns: SampleColumns | None = None) -> Prediction:
    axis = step.trained
    run = axis.design.blocks[i].run
    u = axis.run_coefficients(i, step.solution.beta, step.spreads)
    modelled = axis.predict(i, step.solution.beta, u, columns)
    modelled = modelled + known_dps(run, axis.design.axis)
    for term in axis.design.terms:
        if not term.values or term.fault is None:
            continue
        modelled = term.fault.respond(run, axis.design.axis, modelled, term.values, axis.noise.white_sd_dps)
    # A sample that shows a moment without a reference has no prediction. It counts as read, so that it adds no error.
    modelled = np.where(run.reached, modelled, run.gyro_dps[:, axis.design.axis])
    rows = slice(0, len(run))
    if step.fold.time is not None:
        elapsed = run.sample_s - run.sample_s[0]
        first, stop = (int(np.searchsorted(elapsed, f * run.duration_s)) for f in step.fold.time)
        rows = slice(first, len(run) if step.fold.time[1] >= 1 else stop)
    return Prediction(run, axis.design.axis, rows, modelled[rows])
