"""The standard error of the excess: how far held-out power and expected power differ if the residual is noise alone.

Both come from the same data, and the noise is fitted to them, so most of their scatter is common: three power cycles that
happen to differ much raise the rms and the floor. The noise parameters are efficient estimates. Their errors are therefore
uncorrelated with what is left of the held-out power q when its regression on the scores is removed,

    var(q - expectation at the estimates) = var(q) - g' I^-1 g,    g = d E[q] / d parameters,

with the information I of restricted maximum likelihood on the variances. A systematic residual s adds ``2·s'F·n`` to the sum of
squares q = y'Fy, whose variance ``4·s'FVFs`` is taken from the residual itself, less what noise alone makes of it: what is slow
is known no better than the drift and the offsets of power cycles allow. The drift's correlation time is often at a bound and
counts as known. A search that stops short of the maximum adds ``2·SETTLED·g' I^-1 g``. Drift, offsets and columns are taken as
means over some hundred cells of time for this; a standard error needs no more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.inference.blocks import Blocks
from gyrocal.inference.design import Mask
from gyrocal.inference.expected import UNDETERMINED, of_cycle
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.heldout import EVERYTHING, SESSION, Fold, time_masks
from gyrocal.inference.walk import Walk
from gyrocal.recording.session import Array

CELLS = 120
"""Number of cells of time of all runs together, or one for each run if there are more runs."""

OF_ERRORS = 3.0
"""Where a sum of squares is skew, its error is a third of the way to what a normal distribution exceeds as seldom as three of
its standard deviations (Cornish and Fisher, Rev. Int. Stat. Inst. 5 (1938) 307)."""
SETTLED = 0.02
"""Log-likelihood by which a search for the noise typically stops short of the maximum."""


@dataclass(frozen=True)
class _Cells:
    """Cells of time of all runs: ``run`` and ``cycle`` [k], ``n`` [k] samples, as many of the usual noise with the same
    ``precision`` [k], mean times, rates, columns [k, c] and residuals [k]."""

    run: Array
    cycle: Array
    n: Array
    precision: Array
    t_s: Array
    cycle_columns: Array
    columns: Array
    residual_dps: Array
    blocks: int


@dataclass(frozen=True)
class Errors:
    """Standard errors, dps^2, of a sum of squares (times samples) over its expectation.

    ``noise`` is that of noise alone, ``systematic`` that of the product of a systematic residual with the drift and with the
    offsets of power cycles. ``walk`` is what a walk of the bias from run to run adds to the expectation, dps^2.
    """

    noise: float
    systematic: float
    walk: float = 0.0


def difference_errors(axis: AxisFit, folds: Sequence[Fold], walk: Walk | None = None) -> tuple[Errors, Errors]:
    """The errors of all, and those within power cycles; beside a ``walk`` of the bias, if the runs show one."""
    cells = _cells(axis)
    covariance, derivatives = _covariance(axis, cells)
    residual, held = _residual(axis, cells, covariance, folds)
    without, slowly = covariance, slice(1, 1 + (axis.noise.ou_sd_dps > 0) + len(axis.spreads.scenario))
    if walk is not None:
        _, derivatives = _covariance(replace(axis, noise=walk.noise), cells)
        derivatives.insert(slowly.stop, walk.covariance[np.ix_(cells.run, cells.run)])
        covariance, slowly = np.asarray(np.sum(derivatives, axis=0)), slice(1, slowly.stop + 1)
    weight, cycle = cells.n[held], cells.cycle[held]
    all_power = residual.T @ (weight[:, None] * residual)
    taken = np.zeros_like(all_power)
    for label in np.unique(cycle):
        mine = cycle == label
        o = cells.cycle_columns[held[mine]]
        o = o / np.sqrt(np.maximum(np.mean(o**2, axis=0), 1e-300))
        sums = (o * weight[mine][:, None]).T @ residual[mine]
        norm = (o * weight[mine][:, None]).T @ o
        taken += sums.T @ np.linalg.pinv(norm, rcond=UNDETERMINED, hermitian=True) @ sums
    p = len(axis.design.layout.fixed)
    information = _information(cells.columns[:, :p], covariance, derivatives)
    rest = max(0, cells.blocks - cells.n.size)  # blocks within a cell, which are white
    white = axis.noise.white_sd_dps**2
    information[0, 0] += rest / 2
    of_others = bool(folds) and folds[0].label == SESSION
    slow = np.asarray(np.sum(derivatives[slowly], axis=0))
    out = []
    for form in (all_power, all_power - taken):
        of_data = form @ covariance
        slope = np.array([float(np.sum(form * d)) for d in derivatives])
        slope[0] += rest * white
        if of_others:  # the spreads of power cycles were not fitted to these residuals
            slope[1 + (axis.noise.ou_sd_dps > 0) :] = 0.0
        common = slope @ np.linalg.pinv(information, rcond=1e-10, hermitian=True) @ slope
        variance = 2 * float(np.sum(of_data * of_data.T)) + 2 * rest * white**2
        pulled = form @ cells.residual_dps
        product = 4 * float(pulled @ slow @ pulled - np.sum((form @ slow) * of_data.T)) if slow.ndim else 0.0
        noise, systematic = (float(np.sqrt(max(v, 0.0))) for v in (variance - (1 - 2 * SETTLED) * common, product))
        if walk is not None:  # the sum is mostly the square of the walk's slowest part
            noise *= of_skewed(variance, 8 * float(np.sum(of_data @ of_data * of_data.T)))
        out.append(Errors(noise, systematic, float(np.sum(form * (covariance - without)))))
    return out[0], out[1]


def of_skewed(variance: float, third: float) -> float:
    """The factor on the standard deviation of a sum of squares with which chance exceeds it as rarely as a normal one.

    ``variance`` and ``third`` are its central moments. By Cornish and Fisher, at ``OF_ERRORS`` standard deviations: a sum of
    few squares has a long tail.
    """
    skewness = third / variance**1.5 if variance > 0 else 0.0
    return 1 + skewness * (OF_ERRORS**2 - 1) / (6 * OF_ERRORS)


def net_angles(axis: AxisFit, folds: Sequence[Fold], of_model: Array | None = None) -> Array:
    """Covariance [r, r], deg^2, that noise gives the net angles which held-out predictions of ``r`` runs leave.

    A run of which only the net angle is known is one block, in which the drift averages out in part. ``of_model`` [p, p] is the
    covariance of parameters that come from another session.
    """
    cells = _cells(axis)
    covariance, _ = _covariance(axis, cells)
    residual, held = _residual(axis, cells, covariance, folds, net=True)
    blocks, noise = axis.design.blocks, axis.noise
    for k, i in enumerate(cells.run):
        if blocks[i].run.rate_is_mean and noise.ou_sd_dps > 0:
            times = blocks[i].run.duration_s / noise.ou_tau_s
            covariance[k, k] -= noise.ou_sd_dps**2 * (1 - 2 / times * (1 + np.expm1(-times) / times))
    angle = _seconds(axis, cells)[held] * (np.unique(cells.run[held])[:, None] == cells.run[held])
    leaves, errors = angle @ residual, angle @ _of_model(cells, held, of_model)
    return np.asarray(leaves @ covariance @ leaves.T + errors @ errors.T)


def angles_of_samples(axis: AxisFit, folds: Sequence[Fold], of_model: Array | None = None) -> Array:
    """Covariance [h, h], deg^2, that noise gives the angles at the middle of ``h`` cells, times their numbers of samples.

    A held-out stretch of a run has a start of its own, at which its mean is zero. ``of_model`` is that of :func:`net_angles`.
    """
    cells = _cells(axis)
    covariance, _ = _covariance(axis, cells)
    residual, held = _residual(axis, cells, covariance, folds)
    seconds, weight = _seconds(axis, cells)[held], cells.n[held]
    begins = np.concatenate([[True], (np.diff(held) != 1) | (np.diff(cells.run[held]) != 0)])[: held.size]
    stretch = np.cumsum(begins)
    same = (stretch[:, None] == stretch).astype(float)
    angle = (np.tril(same, -1) + 0.5 * np.eye(held.size)) * seconds
    angle -= (same * weight / (same @ weight)[:, None]) @ angle
    leaves, errors = angle @ residual, angle @ _of_model(cells, held, of_model)
    within = axis.noise.white_sd_dps**2 * seconds**2 / (6 * weight)  # a random walk between the ends of a cell
    root = np.sqrt(weight)
    noise = leaves @ covariance @ leaves.T + errors @ errors.T + np.diag(within)
    return np.asarray(root[:, None] * noise * root)


def end_noise_deg(axis: AxisFit) -> float:
    """The noise of a measured angle at the ends of blocks, deg; 0 where no angle is measured."""
    ratio = axis.design.color.of_angle
    if not ratio:
        return 0.0
    b = next(b for b in axis.design.blocks if b.t_s.size)
    return float(np.sqrt(ratio * float(np.median(b.n))) * axis.noise.white_sd_dps * b.run.duration_s / len(b.run))


def _seconds(axis: AxisFit, cells: _Cells) -> Array:
    """Duration [k] of the cells, s."""
    return cells.n * np.array([b.run.duration_s / len(b.run) for b in axis.design.blocks])[cells.run]


def _of_model(cells: _Cells, held: Array, covariance: Array | None) -> Array:
    """A root [h, p] of what the errors of a model's own parameters make of held-out cells."""
    if covariance is None:
        return np.zeros((held.size, 1))
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(cells.columns[held, : len(covariance)] @ (vectors * np.sqrt(np.maximum(values, 0.0))))


def _cells(axis: AxisFit) -> _Cells:
    design = axis.design
    usable = [i for i, b in enumerate(design.blocks) if b.t_s.size]
    total = sum(design.blocks[i].t_s.size for i in usable)
    run, cycle, n, precision, t_s, rate, columns, residual = [], [], [], [], [], [], [], []
    for i in usable:
        b = design.blocks[i]
        count = min(b.t_s.size, max(1, round(CELLS * b.t_s.size / total)))
        start = np.linspace(0, b.t_s.size, count, endpoint=False).astype(np.intp)
        samples = np.add.reduceat(b.n, start)
        run.append(np.full(count, i))
        cycle.append(np.full(count, b.scenario))
        n.append(samples)
        precision.append(samples**2 / np.add.reduceat(b.n**2 / b.precision, start))
        t_s.append(np.add.reduceat(b.t_s * b.n, start) / samples)
        rate.append(np.add.reduceat(_rate(b, design.axis) * b.n, start) / samples)
        columns.append((np.add.reduceat(design.columns(i)[1:] * b.n, start, axis=1) / samples).T)
        residual.append(np.add.reduceat(axis.block_residuals(i) * b.n, start) / samples)
    of_cycles = of_cycle(np.concatenate(rate))
    return _Cells(
        np.concatenate(run), np.concatenate(cycle), np.concatenate(n), np.concatenate(precision), np.concatenate(t_s),
        of_cycles, np.vstack(columns), np.concatenate(residual), total,
    )  # fmt: skip


def _rate(b: Blocks, axis: int) -> Array:
    return b.mean(b.run.rate_dps[:, None])[:, 0] if b.run.axis_index == axis else np.zeros(b.t_s.size)


def _covariance(axis: AxisFit, cells: _Cells) -> tuple[Array, list[Array]]:
    """Covariance [k, k] of the cells' means, and its derivatives by the logarithm of each variance, white noise first."""
    noise, layout = axis.noise, axis.design.layout
    p = len(layout.fixed)
    parts = [np.diag(noise.white_sd_dps**2 / cells.precision)]
    if noise.ou_sd_dps > 0:
        apart = np.abs(cells.t_s[:, None] - cells.t_s) / noise.ou_tau_s
        parts.append(noise.ou_sd_dps**2 * np.exp(-apart) * (cells.run[:, None] == cells.run))
    same_run, same_cycle = cells.run[:, None] == cells.run, cells.cycle[:, None] == cells.cycle
    for j, sd in zip(layout.scenario, axis.spreads.scenario, strict=True):
        x = cells.columns[:, j]
        parts.append(sd**2 * np.outer(x, x) * same_cycle)
    end_deg = end_noise_deg(axis)
    if end_deg:
        neighbours = np.abs(np.subtract.outer(np.arange(cells.run.size), np.arange(cells.run.size))) == 1
        pattern = 2 * np.eye(cells.run.size) - neighbours * same_run
        per_s = 1 / _seconds(axis, cells)
        parts.append(end_deg**2 * pattern * np.outer(per_s, per_s))
    for group in range(layout.n_groups):
        z = cells.columns[:, [p + j for j, g in enumerate(layout.run_group) if g == group]]
        parts.append(axis.spreads.run[group] ** 2 * (z @ z.T) * same_run)
    return np.asarray(np.sum(parts, axis=0)), parts


def _residual(
    axis: AxisFit, cells: _Cells, covariance: Array, folds: Sequence[Fold], *, net: bool = False
) -> tuple[Array, Array]:
    """The held-out residual [h, k] as a linear function of the cells' means, and the cells [h] that it belongs to.

    The error of a run's own coefficients is left out. ``net`` includes runs of which only the net angle is known.
    """
    p = len(axis.design.layout.fixed)
    x = cells.columns[:, :p]
    rows, held_cells = [], []
    for fold in folds or [EVERYTHING]:
        inside, near = _masks(axis, cells, fold, net)
        used = np.flatnonzero(~inside & ~near) if folds else np.arange(cells.n.size)
        held = np.flatnonzero(inside)
        if not held.size:
            continue
        beta = np.zeros((p, cells.n.size))
        if used.size:
            whitened = np.linalg.solve(covariance[np.ix_(used, used)], x[used])
            beta[:, used] = np.linalg.pinv(x[used].T @ whitened, hermitian=True) @ whitened.T
        elif fold.label != SESSION:
            continue
        rows.append(np.eye(cells.n.size)[held] - x[held] @ beta)
        held_cells.append(held)
    if not rows:
        return np.zeros((0, cells.n.size)), np.zeros(0, dtype=np.intp)
    return np.vstack(rows), np.concatenate(held_cells)


def _masks(axis: AxisFit, cells: _Cells, fold: Fold, net: bool) -> tuple[Mask, Mask]:
    """Masks [k] of the cells that a fold leaves out, and of those beside them."""
    judged = np.array([net or not b.run.rate_is_mean for b in axis.design.blocks])[cells.run]
    if fold.time is None:
        inside = np.isin(cells.run, fold.runs) if fold is not EVERYTHING else np.ones(cells.n.size, dtype=bool)
        return inside & judged, inside & ~judged
    inside, near = np.zeros((2, cells.n.size), dtype=bool)
    for i in np.unique(cells.run):
        b = axis.design.blocks[i]
        mine = np.flatnonzero(cells.run == i)
        at = np.searchsorted(b.t_s, cells.t_s[mine]).clip(0, b.t_s.size - 1)
        inside[mine], near[mine] = (mask[at] for mask in time_masks(b, fold))
    return inside, near


def _information(x: Array, covariance: Array, derivatives: list[Array]) -> Array:
    """Information of restricted maximum likelihood on the parameters by which the covariance has these derivatives."""
    inverse = np.linalg.inv(covariance)
    whitened = inverse @ x
    projector = inverse - whitened @ np.linalg.pinv(x.T @ whitened, hermitian=True) @ whitened.T
    parts = [projector @ d for d in derivatives]
    return np.array([[0.5 * float(np.sum(a * b.T)) for b in parts] for a in parts])
