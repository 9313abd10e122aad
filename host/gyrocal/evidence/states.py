"""The states that the noise of an axis may be in, and each one's sums with everything integrated out that is no hypothesis.

The level of the noise is integrated exactly (Student's t). Drift and the spreads of bias and scale over power cycles are summed
over a grid: the noise of the model without an effect is no measure of them, because it has swallowed the effect. Drift goes on
from run to run of a power cycle, or begins anew in each run, as where the part is clamped anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.evidence.matrix import Index, Matrix
from gyrocal.inference.carried_drift import times_of_cycles
from gyrocal.inference.factors import with_prior
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array

DRIFTS = (0.25, 0.6, 1.5, 3.5, 8.0)
"""Standard deviations of the drift, in standard deviations of the white noise's mean over a second."""
TIMES_S = (6.0, 25.0, 100.0, 400.0, 1600.0)
"""Correlation times of the drift, as far as they are shorter than the longest power cycle."""
SHORT = 0.5
"""Correlation times in lengths of a run that make no difference whether the drift goes on: it is another one by then."""
BIAS_SPREADS_DPS = (3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)
SCALE_SPREADS = (3e-5, 1e-4, 3e-4, 1e-3, 3e-3)
"""Spreads of bias and scale over power cycles."""
ABSENT = 0.5
"""Probability that a component of the noise is absent."""
LEAST_NORM = 1e-9
LEAST_OF_NOISE = 0.5
"""Least part of a squared norm or of chi-square that the noise of measured columns leaves: more of it is not taken to be
theirs."""


@dataclass(frozen=True, eq=False)
class States:
    """The states [s] of one axis: products [s, q, q] of reading and hypotheses, and logarithms [s] of weights.

    Row 0 is the reading. Columns that are no hypothesis are zero. ``degrees`` are those of freedom of chi-square.
    """

    products: Array
    log_weight: Array
    degrees: int
    noises: tuple[Noise, ...]
    """The noise [s] of each state."""
    carried: tuple[bool, ...]
    """Whether the drift of each state [s] goes on from run to run of a power cycle, or begins anew in each run."""
    spreads: tuple[tuple[float, ...], ...]
    """The spreads [s] of the columns of power cycles."""

    @staticmethod
    def of(matrix: Matrix) -> States:
        """All states of an axis."""
        products, weights, noises, carried = [], [], [], []
        spreads = _spreads(matrix)
        sds, of_spread = np.array([sd for sd, _ in spreads]), np.array([log for _, log in spreads])
        drifts = _drifts(matrix)
        for noise, goes_on, log_prior in drifts:
            cycles, of_runs = _of_cycles(matrix, noise, carried=goes_on)
            total, of_columns = _beside(cycles, matrix.of_cycles, sds, matrix.shared)
            products.append(_told_from_noise(total, matrix, noise, sds) if matrix.measured else total)
            weights.append(log_prior + of_spread - 0.5 * (of_runs + of_columns))
            noises += [noise] * len(spreads)
            carried += [goes_on] * len(spreads)
        degrees, of_all = matrix.n - matrix.shared.size, tuple(sd for sd, _ in spreads) * len(drifts)
        return States(np.concatenate(products), np.concatenate(weights), degrees, tuple(noises), tuple(carried), of_all)


def _told_from_noise(products: Array, matrix: Matrix, noise: Noise, sds: Array) -> Array:
    """Products [s, q, q] without the hypotheses of which the noise of the model's measured columns leaves too little to tell.

    Where one has the shape of such a column, their difference is that noise. What is left of it after the noise is taken out
    is as often negative as positive.
    """
    cycles, _ = _of_cycles(matrix, noise, as_measured=True)
    measured, _ = _beside(cycles, matrix.of_cycles, sds, matrix.shared)
    left, whole = (np.diagonal(of, axis1=-2, axis2=-1) for of in (products, measured))
    told = left >= LEAST_OF_NOISE * whole
    told[:, 0] = True
    return np.where(told[:, :, None] & told[:, None, :], products, 0.0)


def _of_cycles(
    matrix: Matrix, noise: Noise, *, as_measured: bool = False, carried: bool = False
) -> tuple[Array, float]:  # fmt: skip
    """Products [cycles, q, q] of each power cycle without the coefficients of each run, and the log-determinant of all."""
    if carried:
        found = [cycle.normal_equations(noise) for cycle in matrix.going_on]
        return np.concatenate([of_one for of_one, _ in found]), sum(of_one for _, of_one in found)
    grams, logdet = matrix.grams(noise, as_measured=as_measured)
    if matrix.of_runs.size:
        sd = matrix.fit.spreads.run[list(matrix.design.layout.run_group)]
        grams, of_runs = integrated(grams, matrix.of_runs, sd)
        logdet = logdet + of_runs
    scenarios = matrix.design.scenarios
    members = (np.arange(int(scenarios.max()) + 1)[:, None] == scenarios).astype(float)
    return (members @ grams.reshape(len(grams), -1)).reshape(-1, *grams.shape[1:]), float(logdet.sum())


def beside_model(matrix: Matrix, noise: Noise, spreads: Sequence[float], *, carried: bool = False) -> Array:
    """Products [q, q] in one state of the noise, without the columns of the model."""
    cycles, _ = _of_cycles(matrix, noise, carried=carried)
    return _beside(cycles, matrix.of_cycles, np.array([spreads]), matrix.shared)[0][0]


def integrated(grams: Array, columns: Index, sd: Array) -> tuple[Array, Array]:
    """Products [r, q, q] without ``columns`` [k] whose coefficients are ~ N(0, sd^2), and log-determinants [r]."""
    if not columns.size or not np.any(sd):
        return grams, np.zeros(len(grams))
    half, logdet = _taken(grams, columns, sd)
    return grams - half.swapaxes(-1, -2) @ half, logdet


def _taken(grams: Array, columns: Index, sd: Array) -> tuple[Array, Array]:
    """Rows [..., r, k, q] whose products are what ``columns`` [k] with coefficients ~ N(0, sd^2) take of ``grams`` [r, q, q],
    and log-determinants [..., r].
    """
    rows = sd[..., :, None] * grams[:, columns]
    root, logdet = with_prior(np.eye(columns.size) + rows[..., columns] * sd[..., None, :])
    return root @ rows, logdet


def _beside(cycles: Array, columns: Index, sds: Array, free: Index) -> tuple[Array, Array]:
    """Products [s, q, q] summed over ``cycles`` [r, q, q] without the model's columns, and log-determinants [s].

    ``columns`` [k] have coefficients of each cycle, ~ N(0, sd^2) for each of ``sds`` [s, k]; the coefficients of ``free`` [p]
    are the same in all. What all of them take is a product of a few rows, which is subtracted at once.
    """
    together, q = cycles.sum(axis=0), cycles.shape[-1]
    rows, of_cycles = _taken(cycles, columns, sds[:, None])
    rows, logdet = rows.reshape(len(sds), len(cycles) * columns.size, q), of_cycles.sum(axis=-1)
    left = together[free] - rows[:, :, free].swapaxes(-1, -2) @ rows
    taken, norms = np.zeros_like(left), [left[:, k, j].copy() for k, j in enumerate(free.tolist())]
    for k, j in enumerate(free.tolist()):
        norm = left[:, k, j]
        known = norm > LEAST_NORM * norms[k]
        norm = np.where(known, norm, 1.0)
        taken[:, k] = np.where(known[:, None], left[:, k] / np.sqrt(norm)[:, None], 0.0)
        logdet = logdet + np.log(norm)
        left -= taken[:, k, free][:, :, None] * taken[:, k, None]
        left[:, :, j] = 0.0
    rows = np.concatenate([rows, taken], axis=1)
    out = rows.swapaxes(-1, -2) @ rows
    np.subtract(together, out, out=out)
    out[:, free], out[:, :, free] = 0.0, 0.0
    return out, logdet


def _drifts(matrix: Matrix) -> list[tuple[Noise, bool, float]]:
    """The states of drift, whether it goes on from run to run of a power cycle, and the logarithm of their probability."""
    fit = matrix.fit
    white = matrix.white_sd_dps
    of_model = fit.design.noise_model.drift
    if of_model is None or of_model.known is not None:
        return [(fit.noise.times(white / fit.noise.white_sd_dps), False, 0.0)]
    of_cycles = [np.concatenate(times_s) for _, times_s in times_of_cycles(fit.design)]
    longest_s, second = max((float(np.ptp(t_s)) for t_s in of_cycles), default=0.0), matrix.second_dps
    times_s = [t for t in TIMES_S if t <= max(longest_s, TIMES_S[0])]
    states = [(Noise(white), False, float(np.log(ABSENT)))]
    run_s = float(np.median([np.ptp(b.t_s) for b in fit.design.blocks if b.t_s.size]))
    longer = [t for t in times_s if t > SHORT * run_s] if matrix.going_on else []
    times = [*product((False,), DRIFTS, times_s), *product((True,), DRIFTS, longer)]
    each = float(np.log((1 - ABSENT) / len(times)))
    return states + [(Noise(white, size * second, tau_s), on, each) for on, size, tau_s in times]


def _spreads(matrix: Matrix) -> list[tuple[tuple[float, ...], float]]:
    """The spreads of the columns of power cycles, with the logarithm of their probability."""
    bias = matrix.role(Role.BIAS)
    grids = [_grid(BIAS_SPREADS_DPS if j == bias else SCALE_SPREADS) for j in matrix.of_cycles.tolist()]
    return [(tuple(value for value, _ in chosen), sum(log for _, log in chosen)) for chosen in product(*grids)]


def _grid(values: Sequence[float]) -> list[tuple[float, float]]:
    each = float(np.log((1 - ABSENT) / len(values)))
    return [(0.0, float(np.log(ABSENT))), *((value, each) for value in values)]
