"""The power that noise alone is expected to leave in held-out samples.

A held-out residual is a linear function of the readings, because the shared parameters come from generalised least squares and
a run's own coefficients from their posterior mean. Under the fitted noise its expected square is therefore exact. With e for
white noise and drift, u for the coefficients of a run and v for those of its power cycle, one held-out part of a run leaves

    r = e + X·(v - delta) + Z·(u - u_hat),    delta = beta_hat - beta

``delta`` and ``u_hat`` depend on the noise of the data that the prediction used. Drift that these data share with the held-out
samples cancels in r; only the part that they cannot predict remains. The random quantities are few for each run, so their joint
covariance is a small matrix, and the drift's covariance is applied by tridiagonal solves in O(n).

Nonlinear parameters and the noise itself are taken as known, as in ``heldout.predictions``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gyrocal.inference.blocks import Blocks, Index
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.heldout import EVERYTHING, Fold, time_masks
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array

OFFSET_AND_SCALE = 2
"""Number of columns that are removed from each power cycle: one, and the true rate."""
UNDETERMINED = 1e-9
"""Relative eigenvalue below which offset and scale of a power cycle count as one column."""


@dataclass(frozen=True)
class Expected:
    """Expected squares of the block means of held-out residuals, each times its number of samples, summed, in dps^2.

    ``within`` is the same with the offset and scale of each power cycle removed. ``samples`` and ``blocks`` are the numbers of
    held-out samples and blocks.
    """

    squares: float
    within: float
    samples: float
    blocks: int


def of_cycle(rate_dps: Array) -> Array:
    """The columns that ``within`` figures remove from the samples or blocks of a power cycle, shape [n, 2]."""
    return np.column_stack([np.ones(rate_dps.size), rate_dps])


def removed(sums: Array, norm: Array) -> float:
    """The trace of ``norm^-1·sums``, for columns that may be collinear: the power that their fit removes, dps^2.

    ``norm`` [k, k] holds the products of the columns, ``sums`` [k, k] those of their products with the residual.
    """
    scale = np.sqrt(np.maximum(np.diag(norm), 1e-300))
    inverse = np.linalg.pinv(norm / np.outer(scale, scale), rcond=UNDETERMINED, hermitian=True)
    return float(np.trace(inverse @ (sums / np.outer(scale, scale))))


@dataclass(frozen=True)
class _Kernels:
    """What the linear functionals of one run's noise have to do with the run.

    There are ``groups`` sets of functionals: the scores ``C·V^-1`` [c] of the data that a fit uses, and the sums [2] over the
    held-out samples, weighted by their numbers. ``cov`` is their covariance, ``columns`` [functionals, c] what they make of the
    model's columns, ``gram`` [groups, c, c] the scores' part of it. For the held-out samples of each group, ``shared``
    [groups, functionals, c] is the covariance with the noise there, times the columns, and ``square`` [groups, c, c] the
    products of the columns; ``sums`` [groups, 2, c] and ``norm`` [groups, 2, 2] are those with offset and rate. ``own``
    [groups] is the expected power of the noise.
    """

    cov: Array
    columns: Array
    gram: Array
    shared: Array
    square: Array
    sums: Array
    norm: Array
    own: Array
    samples: Array
    blocks: Array


def _kernels(axis: AxisFit, i: int, masks: Sequence[tuple[Array, Array]]) -> _Kernels:
    """Of run ``i``; ``masks`` holds, for each group, the blocks that a fit uses and those that are held out (1 or 0)."""
    b, noise = axis.design.blocks[i], axis.noise
    columns = axis.design.columns(i)[1:].T  # [m, c]
    c, groups = columns.shape[1], len(masks)
    on_axis = b.run.axis_index == axis.design.axis
    rate = b.mean(b.run.rate_dps[:, None])[:, 0] if on_axis else np.zeros(b.t_s.size)
    cycle = of_cycle(rate)
    kernel = np.hstack(
        [_inverse_times(noise, b.t_s, b.precision * used, columns) for used, _ in masks]
        + [(b.n * held)[:, None] * cycle for _, held in masks]
    )
    spread = _covariance_times(noise, b.t_s, b.precision, kernel)
    weights = [b.n * held for _, held in masks]
    weighted = [w[:, None] * columns for w in weights]
    samples = np.array([float(w.sum()) for w in weights])
    blocks = np.array([int(np.count_nonzero(w)) for w in weights])
    color = axis.design.color  # the level of the noise is that of slow variations; between blocks, coloured noise cancels
    white = noise.white_sd_dps**2 * color.level
    return _Kernels(
        kernel.T @ spread, kernel.T @ columns,
        np.array([kernel[:, g * c : (g + 1) * c].T @ columns for g in range(groups)]),
        np.array([spread.T @ w for w in weighted]), np.array([columns.T @ w for w in weighted]),
        np.array([cycle.T @ w for w in weighted]), np.array([(cycle * w[:, None]).T @ cycle for w in weights]),
        white * np.array([float(np.sum(w / b.precision)) for w in weights]) + samples * noise.ou_sd_dps**2, samples, blocks,
    )  # fmt: skip


def _precision(noise: Noise, t_s: Array) -> tuple[Array, Array]:
    """Diagonal [m] and first off-diagonal [m - 1] of the drift's inverse covariance."""
    variance = noise.ou_sd_dps**2
    steps = np.diff(t_s) / noise.ou_tau_s
    phi, driven = np.exp(-steps), -variance * np.expm1(-2 * steps)
    diagonal = np.zeros(t_s.size)
    diagonal[0] = 1 / variance
    diagonal[1:] += 1 / driven
    diagonal[:-1] += phi**2 / driven
    return diagonal, np.asarray(-phi / driven)


def _tridiagonal(diagonal: Array, coupling: Array, right: Array) -> Array:
    from scipy.linalg.lapack import dpttrf, dpttrs

    off = coupling if coupling.size else np.zeros(1)  # LAPACK needs one element even for a single block
    pivots, factors, _ = dpttrf(diagonal, off)
    return np.asarray(dpttrs(pivots, factors, right)[0])


def _covariance_times(noise: Noise, t_s: Array, n: Array, right: Array) -> Array:
    """``V·right`` [m, k]: the covariance of white noise and drift at blocks of ``n`` [m] samples at times ``t_s`` [m] in s."""
    white = noise.white_sd_dps**2 / n[:, None] * right
    if noise.ou_sd_dps <= 0:
        return np.asarray(white)
    return white + _tridiagonal(*_precision(noise, t_s), right)


def _inverse_times(noise: Noise, t_s: Array, n: Array, right: Array) -> Array:
    """``V^-1·right`` [m, k] on the blocks with samples (``n`` > 0), and zero at the others."""
    weight = n[:, None] / noise.white_sd_dps**2
    weighted = weight * right
    if noise.ou_sd_dps <= 0:
        return np.asarray(weighted)
    diagonal, coupling = _precision(noise, t_s)
    return weighted - weight * _tridiagonal(diagonal + weight[:, 0], coupling, weighted)


class _Sources:
    """The independent random quantities of a session, in one vector: the functionals and coefficients of each run, the
    coefficients of each power cycle. These parts of the vector are independent of each other.
    """

    def __init__(self, axis: AxisFit, runs: dict[int, _Kernels]) -> None:
        layout, self.of_run, self.of_cycle = axis.design.layout, {}, {}
        own = axis.spreads.run[list(layout.run_group)] ** 2
        self._parts: dict[int, list[tuple[int, Array]]] = defaultdict(list)
        self.size = 0
        for i, k in runs.items():
            self.of_run[i] = (self._add(k.cov), self._add(np.diag(own)))
        for cycle in np.unique(axis.design.scenarios).tolist():
            self.of_cycle[cycle] = self._add(np.diag(axis.spreads.scenario**2))

    def _add(self, cov: Array) -> slice:
        part = slice(self.size, self.size + len(cov))
        self._parts[len(cov)].append((part.start, cov))
        self.size = part.stop
        return part

    @cached_property
    def _alike(self) -> list[tuple[Index, Array]]:
        """The sources [parts, s] and the covariances [parts, s, s] of all parts of one size, for each size."""
        return [
            (np.array([first for first, _ in parts])[:, None] + np.arange(size), np.array([cov for _, cov in parts]))
            for size, parts in self._parts.items()
        ]  # fmt: skip

    def covariance(self, rows: Array) -> Array:
        """Covariance [k, k] of linear combinations ``rows`` [k, sources]."""
        out = np.zeros((len(rows), len(rows)))
        for index, cov in self._alike:
            of_parts = rows[:, index].swapaxes(0, 1)
            out += (of_parts @ cov @ of_parts.swapaxes(-1, -2)).sum(axis=0)
        return out


def expected(axis: AxisFit, folds: Sequence[Fold]) -> Expected:
    """The expectation for the predictions that ``heldout.predictions`` makes, or ``heldout.fitted`` without ``folds``."""
    design = axis.design
    by_time = bool(folds) and folds[0].time is not None
    runs = {}
    for i, b in enumerate(design.blocks):
        if not b.t_s.size:
            continue
        everything = np.ones(b.t_s.size)
        masks = [_masks(b, fold) for fold in folds] if by_time else [(everything, everything)]
        runs[i] = _kernels(axis, i, masks)
    sources = _Sources(axis, runs)
    squares, samples, blocks = 0.0, 0.0, 0
    sums: dict[int, Array] = {}
    norms: dict[int, Array] = {}
    for g, fold in enumerate(folds or [EVERYTHING]):
        group = g if by_time else 0
        trained = [i for i in runs if by_time or not folds or i not in fold.runs]
        error = _Error(axis, runs, sources, trained, group)
        for i in runs if by_time or not folds else fold.runs:
            if i not in runs or design.blocks[i].run.rate_is_mean:
                continue
            k, own = runs[i], sources.of_run[i][0]
            rows = error.of_part(i)
            squares += float(k.own[group]) + 2 * float(np.sum(rows[:, own] * k.shared[group].T))
            squares += float(np.sum(sources.covariance(rows) * k.square[group]))
            samples += float(k.samples[group])
            blocks += int(k.blocks[group])
            cycle = design.blocks[i].scenario
            part = k.sums[group] @ rows
            first = own.start + k.gram.shape[0] * k.gram.shape[1] + OFFSET_AND_SCALE * group
            part[:, first : first + OFFSET_AND_SCALE] += np.eye(OFFSET_AND_SCALE)
            sums[cycle] = sums.get(cycle, 0) + part
            norms[cycle] = norms.get(cycle, 0) + k.norm[group]
    within = squares - sum(removed(sources.covariance(sums[c]), norms[c]) for c in sums)
    return Expected(squares, max(within, 0.0), samples, blocks)


def _masks(b: Blocks, fold: Fold) -> tuple[Array, Array]:
    inside, near = time_masks(b, fold)
    return (~inside & ~near).astype(np.float64), inside.astype(np.float64)


class _Error:
    """The error of a fit to the runs ``trained`` as a linear function of the sources: ``rows`` [p, sources] for ``delta``."""

    def __init__(self, axis: AxisFit, runs: dict[int, _Kernels], sources: _Sources, trained: Sequence[int], group: int) -> None:
        self.axis, self.runs, self.sources, self.group = axis, runs, sources, group
        self.p = len(axis.design.layout.fixed)
        self.scenario = list(axis.design.layout.scenario)
        pulls = {i: self._without_own(i) for i in trained}
        total = np.zeros((self.p, self.p))
        cycle_of = axis.design.scenarios
        rows = np.zeros((self.p, sources.size))
        for cycle in dict.fromkeys(cycle_of[trained].tolist()):
            members = [i for i in trained if cycle_of[i] == cycle]
            gram = sum((pulls[i] @ runs[i].gram[group][:, : self.p] for i in members), np.zeros((self.p, self.p)))
            pull = self._without_cycle(gram)
            total += pull @ gram
            for i in members:
                self._put(rows, pull @ pulls[i], i)
        self.rows = np.linalg.pinv(total, hermitian=True) @ rows if self.p else rows

    def _put(self, rows: Array, of_scores: Array, i: int) -> None:
        """Add ``of_scores`` [k, c] times the scores of run ``i`` to ``rows`` [k, sources]."""
        k = self.runs[i]
        c = k.gram.shape[-1]
        scores = slice(self.group * c, (self.group + 1) * c)
        functionals, own = self.sources.of_run[i]
        cycle = self.sources.of_cycle[int(self.axis.design.scenarios[i])]
        gram = of_scores @ k.columns[scores]
        rows[:, functionals.start + scores.start : functionals.start + scores.stop] += of_scores
        rows[:, own] += gram[:, self.p :]
        rows[:, cycle] += gram[:, self.scenario]

    def _without_own(self, i: int) -> Array:
        """Matrix [p, c] that takes a run's scores to those of the shared columns, its own coefficients integrated out."""
        gram = self.runs[i].gram[self.group]
        sd = self.axis.spreads.run[list(self.axis.design.layout.run_group)]
        out = np.eye(self.p, len(gram))
        if sd.size:
            inner = np.eye(sd.size) + sd[:, None] * gram[self.p :, self.p :] * sd
            out[:, self.p :] = -gram[: self.p, self.p :] @ (sd[:, None] * np.linalg.solve(inner, np.diag(sd)))
        return out

    def _without_cycle(self, gram: Array) -> Array:
        """Matrix [p, p] that takes the scores of a power cycle to those with its offset and scale integrated out."""
        s, sd = self.scenario, self.axis.spreads.scenario
        out = np.eye(self.p)
        if s:
            inner = np.eye(sd.size) + sd[:, None] * gram[np.ix_(s, s)] * sd
            out[:, s] -= gram[:, s] @ (sd[:, None] * np.linalg.solve(inner, np.diag(sd)))
        return out

    def of_part(self, i: int) -> Array:
        """The coefficients [c, sources] of the model's columns in the held-out residual of run ``i``."""
        layout, gram = self.axis.design.layout, self.runs[i].gram[self.group]
        shared = -self.rows
        own = np.zeros((len(layout.run), self.sources.size))
        if layout.run:
            random, sd = layout.random - 1, self.axis.spreads.of(layout)
            inner = np.eye(sd.size) + sd[:, None] * gram[np.ix_(random, random)] * sd
            weight = (sd[:, None] * np.linalg.solve(inner, np.diag(sd)))[: len(layout.run)]
            of_scores = np.zeros((len(layout.run), len(gram)))
            of_scores[:, random] = -weight
            self._put(own, of_scores, i)
            own -= weight @ gram[random][:, : self.p] @ shared
            part = self.sources.of_run[i][1]
            own[:, part] += np.eye(part.stop - part.start)
        shared = shared.copy()
        cycle = self.sources.of_cycle[int(self.axis.design.scenarios[i])]
        shared[self.scenario, cycle] += np.eye(len(self.scenario))
        return np.vstack([shared, own])
