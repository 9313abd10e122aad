"""Standard errors of the spreads of random coefficients.

The coefficients ``u`` of the columns Z are N(0, theta) with one variance for each group of columns. With P the REML projection,
``G = Z'PZ`` and the sums over the columns of two groups, the information matrix of the variances is

    J[g, h] = 1/2 sum of squares of G over g and h

and its inverse is their covariance if the coefficients are drawn anew. That is what a spread over power cycles means. The
amplitude of a wave, in contrast, is the root mean square of its amplitudes in these very runs, and their scatter is no error of
it. For given ``u``, the score of the variances has the covariance ``J - S``, where ``S[g, h]`` is half the sum of squares of
``H = G Theta G`` with Theta restricted to the columns whose size is that in these runs. The variances then have the covariance

    J^-1 (J - S) J^-1.

For one wave in R equal runs, each of whose coefficients has the error s, this is the variance (4 theta s^2 + 2 s^4) / 2R of the
mean of 2R squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Index, Spreads, SpreadScale
from gyrocal.recording.session import Array

WEAK = 0.5
"""A standard error above this fraction of a spread is replaced by that of the profile likelihood."""
FALL = 0.5
"""Fall of the log-likelihood at the ends of an interval of one standard error."""
PARTS, PARTITIONS, SCORINGS = 16, 3, 3
"""An end of an interval is sought by dividing into so many parts, so many times."""


def settled(current: AxisFit) -> AxisFit:
    """The fit with its spreads at the maximum of the likelihood, by Fisher scoring.

    The search for noise and spreads stops where the log-likelihood is within a thousandth of its maximum. A spread may then be
    off by a few percent of its error over a population of runs, which is far more than the error of a strong wave's amplitude.
    """
    k = current.spreads.run.size
    if not (current.spreads.run > 0).any():
        return current
    equations = current.equations()
    for _ in range(SCORINGS):
        sd = np.concatenate([current.spreads.run, current.spreads.scenario])
        free = np.flatnonzero(sd > 0)
        solution, slopes = equations.solve_with_slopes(current.spreads)
        inverse, _ = _inverse(current, sd, free)
        sd[free] *= np.exp(np.clip(inverse @ slopes[free] / 4, -0.2, 0.2))  # slopes are by log sd, the inverse by log variance
        spreads = Spreads(sd[:k], sd[k:])
        moved = equations.solve(spreads)
        if not moved.loglik > solution.loglik:
            break
        current = replace(current, spreads=spreads, solution=moved)
    return current


def spread_errors(current: AxisFit) -> tuple[Array, Array]:
    """Standard errors of the spreads, those of runs and those of power cycles.

    The error of a spread that vanishes is the size at which the log-likelihood has fallen by a half; that of one that hardly
    differs from zero is half of the interval within which it has fallen by less.
    """
    sd, k = np.concatenate([current.spreads.run, current.spreads.scenario]), current.spreads.run.size
    out = np.full(sd.size, np.nan)
    free = np.flatnonzero(sd > 0)
    if free.size:
        inverse, scatter = _inverse(current, sd, free)
        variance = np.diag(inverse) - np.einsum("ij,jk,ik->i", inverse, scatter, inverse)
        out[free] = sd[free] / 2 * np.sqrt(np.maximum(variance, 0.0))
    weak = np.flatnonzero(~(out <= WEAK * sd) | (out <= 0))
    out[weak] = _profiled(current, sd, weak)
    return out[:k], out[k:]


def _inverse(current: AxisFit, sd: Array, free: Index) -> tuple[Array, Array]:
    """Covariance of the logarithms of the free variances: inverse information, and the scatter of these runs' coefficients."""
    of_these_runs = np.concatenate([_about_zero(current), np.zeros(current.spreads.scenario.size, dtype=bool)])
    unit = np.outer(sd[free] ** 2, sd[free] ** 2)
    population, scatter = (m[np.ix_(free, free)] * unit for m in _information(current, sd, of_these_runs))
    return np.linalg.pinv(population, hermitian=True), scatter


def _about_zero(current: AxisFit) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """True for each group of run coefficients whose spread is a size in these runs: they have no common mean."""
    layout = current.design.layout
    out = np.zeros(layout.n_groups, dtype=bool)
    for (i, _), group in zip(layout.run, layout.run_group, strict=True):
        out[group] = not current.design.terms[i].effect.common_mean
    return out


@dataclass(frozen=True)
class _Symmetric:
    """A symmetric matrix over all random coefficients: a block for each power cycle, and ``low @ core @ low.T``."""

    blocks: list[Array]
    low: list[Array]
    core: Array

    def squares(self, groups: list[Array]) -> Array:
        """Sums of squared elements over the rows of a group and the columns of another; ``groups`` [n, k] are indicators."""
        out = np.zeros((groups[0].shape[1],) * 2)
        own = np.zeros((out.shape[0], *self.core.shape))
        for block, low, group in zip(self.blocks, self.low, groups, strict=True):
            outer = low @ self.core @ low.T
            out += group.T @ ((block + 2 * outer) * block) @ group
            own += np.einsum("ng,na,nb->gab", group, low, low)
        return np.asarray(out + np.einsum("ab,hbc,cd,gda->gh", self.core, own, self.core, own, optimize=True))


def _information(current: AxisFit, sd: Array, of_these_runs: Array) -> tuple[Array, Array]:
    """Information of the variances [k, k], and the part of it that is the scatter of the coefficients of these runs."""
    layout, scenarios = current.design.layout, current.design.scenarios
    p, own, k = len(layout.fixed), len(layout.run), current.spreads.run.size
    blocks, low, groups, sizes = [], [], [], []
    for cycle in np.unique(scenarios):
        runs = np.flatnonzero(scenarios == cycle)
        index = np.concatenate([np.tile(layout.run_group, runs.size), k + np.arange(len(layout.scenario))]).astype(np.intp)
        w, x = _coupled(current.grams[runs], p, own, [1 + j for j in layout.scenario])
        s = sd[index]
        scaled: Array = w * s
        inside = np.linalg.solve(np.eye(index.size) + s[:, None] * scaled, s[:, None] * np.column_stack([w, x]))
        blocks.append(np.asarray(w - scaled @ inside[:, : index.size]))
        low.append(np.asarray(x - scaled @ inside[:, index.size :]))
        groups.append(np.eye(sd.size)[index])
        sizes.append(np.where(of_these_runs[index], s**2, 0.0))
    g = _Symmetric(blocks, low, -current.solution.cov)
    weighted = [b @ (size[:, None] * f) for b, size, f in zip(blocks, sizes, low, strict=True)]
    within = sum((f.T @ (size[:, None] * f) for f, size in zip(low, sizes, strict=True)), np.zeros((p, p)))
    core = np.block([[g.core @ within @ g.core, g.core], [g.core, np.zeros((p, p))]])
    h = _Symmetric(
        [b @ (size[:, None] * b) for b, size in zip(blocks, sizes, strict=True)],
        [np.column_stack([f, d]) for f, d in zip(low, weighted, strict=True)],
        core,
    )
    return g.squares(groups) / 2, h.squares(groups) / 2


def _coupled(grams: Array, p: int, own: int, scenario: list[int]) -> tuple[Array, Array]:
    """Products Z'V^-1 Z [n, n] and Z'V^-1 X [n, p] of one power cycle's runs for the noise V without random coefficients."""
    runs, n = grams.shape[0], grams.shape[0] * own + len(scenario)
    w, x = np.zeros((n, n)), np.zeros((n, p))
    cycle = slice(runs * own, n)
    for r, gram in enumerate(grams):
        mine = slice(r * own, (r + 1) * own)
        w[mine, mine] = gram[1 + p :, 1 + p :]
        w[mine, cycle] = gram[1 + p :, scenario]
        w[cycle, mine] = w[mine, cycle].T
        x[mine] = gram[1 + p :, 1 : 1 + p]
    total = grams.sum(axis=0)
    w[cycle, cycle] = total[np.ix_(scenario, scenario)]
    x[cycle] = total[scenario, 1 : 1 + p]
    return w, x


def _profiled(current: AxisFit, sd: Array, which: Index) -> Array:
    """Errors of single spreads from the REML log-likelihood, the other spreads as fitted; NaN if no run shows the column."""
    k, equations = current.spreads.run.size, current.equations()
    unit = SpreadScale.of(current.design, current.grams).unit

    def fallen(j: int, log_values: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
        trial = np.tile(sd, (log_values.size, 1))
        trial[:, j] = np.exp(log_values)
        return np.asarray(current.loglik - equations.logliks(Spreads(trial[:, :k], trial[:, k:])) > FALL)

    def ends(j: int, inside: float, outside: float) -> tuple[float, float]:
        """Spreads on both sides of where the log-likelihood has fallen, from the logarithms of two such spreads."""
        for _ in range(PARTITIONS):
            log_values = np.linspace(inside, outside, PARTS + 1)
            first = int(np.argmax(np.append(fallen(j, log_values[1:-1]), True)))
            inside, outside = float(log_values[first]), float(log_values[first + 1])
        return float(np.exp(inside)), float(np.exp(outside))

    out = np.full(which.size, np.nan)
    for n, j in enumerate(which.tolist()):
        if unit[j] <= 0:
            continue
        least, most = np.log(1e-3 * unit[j]), np.log(1e3 * max(unit[j], sd[j]))
        middle = max(least, np.log(sd[j])) if sd[j] > 0 else least
        upper, lower = ends(j, middle, most)[1], 0.0
        if sd[j] > 0 and fallen(j, np.array([least]))[0]:
            lower = ends(j, middle, least)[0]
        out[n] = (upper - lower) / 2 if sd[j] > 0 else upper
    return out
