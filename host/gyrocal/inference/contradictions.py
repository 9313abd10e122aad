"""What a misfit adds to the errors of the shared coefficients.

A standard error holds what noise does to an estimate. If the model does not fit, the estimate also depends on which data there
are. Parts of the data are therefore left out one by one: parts of the session, of the time in the run and since power-on, of
the rate and its size, and of the temperature. Let ``d`` be the change of a coefficient without a part. If the model fits, the
fit to all data is efficient, and the variance of ``d`` is ``v = var(without) - var(with)`` (Hausman, Econometrica 46 (1978)
1251). If ``sum d^2 / v`` over the parts of a variable exceeds that of noise, ``sum (d^2 - v)`` is added to the variance of the
coefficient, which the jackknife would give it. Of several variables the largest sum counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gyrocal import tails
from gyrocal.effects.quantities import power_on_time_s, rate_about, temperature_c
from gyrocal.inference.blocks import Blocks
from gyrocal.inference.design import Mask
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Equations, Index, Solution
from gyrocal.noise.whitening import Summed
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.variables.base import quantile_edges

PARTS = 5
"""Largest number of parts of one variable."""
RUNS = 10
"""Largest number of parts of a session, each of which is one run or several in a row."""
RESOLUTION = 0.1
"""Finest part of a rate or a temperature, as a fraction of the range. Rates that differ by less are one part."""
NO_INCREASE = 1e-6
"""Of a variance: an increase below this is rounding, and the part says nothing of the coefficient."""


def misfit_factor(current: AxisFit) -> Array:
    """The factor [p] on the standard error of each shared coefficient; 1 where the parts of the data do not contradict."""
    own, refit = np.diag(current.solution.cov), _Refit(current)
    groupings = list(_groupings(current))
    added = np.zeros(own.size)
    for labels in groupings:
        moved, increase = refit.without_each(labels)
        told = (increase > NO_INCREASE * own) & np.isfinite(moved)
        square = np.divide(moved**2, increase, out=np.zeros_like(moved), where=told).sum(axis=0)
        chance = tails.chi_square(square, np.maximum(told.sum(axis=0), 1)) * own.size * len(groupings)
        beyond = np.where(told, moved**2 - increase, 0.0).sum(axis=0)
        added = np.maximum(added, np.where(chance < POLICY.contradiction_chance, beyond, 0.0))
    return np.asarray(np.sqrt(1 + added / own))


def _groupings(current: AxisFit) -> Iterator[list[Index]]:
    """For each variable that divides the session, the number of the part of every block [m] of each run."""
    design = current.design
    blocks = [b for b in design.blocks if b.t_s.size]
    yield from _evenly([np.full(b.t_s.size, float(i)) for i, b in enumerate(blocks)], RUNS)
    yield from _evenly([b.t_s - b.t_s[0] for b in blocks])
    since_power_on = [_means(b, power_on_time_s(b.run)) for b in blocks]
    if all(known.size for known in since_power_on):
        yield from _evenly(since_power_on)
    rates = [_means(b, rate_about(b.run, design.axis)) for b in blocks]
    yield from _by_level(rates)
    yield from _by_level([np.abs(rate) for rate in rates])
    temperatures = [_means(b, temperature_c(b.run)) for b in blocks]
    if all(known.size for known in temperatures):
        yield from _by_level(temperatures)


def _means(b: Blocks, values: Array | None) -> Array:
    """Block means [m] of values [n] at the samples of a run; empty if the run has none."""
    return np.zeros(0) if values is None else b.mean(values[:, None])[:, 0]


def _evenly(values: Sequence[Array], parts: int = PARTS) -> Iterator[list[Index]]:
    """The parts of equal width of a variable from its values [m] in each run; none if it does not change."""
    every = np.concatenate(values)
    low, width = float(every.min()), float(np.ptp(every)) / parts
    return _divided(values, low + width * np.arange(1.0, parts))


def _by_level(values: Sequence[Array]) -> Iterator[list[Index]]:
    """The parts of a variable that hold about equally many values and divide no plateau; none if it does not change."""
    every = np.concatenate(values)
    return _divided(values, quantile_edges(every, RESOLUTION * float(np.ptp(every)), PARTS))


def _divided(values: Sequence[Array], edges: Array) -> Iterator[list[Index]]:
    if np.unique(np.searchsorted(edges, np.concatenate(values))).size > 1:
        yield [np.searchsorted(edges, of_run) for of_run in values]


class _Refit:
    """The solution at the fitted noise from a part of the blocks."""

    def __init__(self, current: AxisFit) -> None:
        self.current = current
        self.runs = [i for i, b in enumerate(current.design.blocks) if b.t_s.size]
        self.whole = [self._equations(i, np.ones(current.design.blocks[i].t_s.size, dtype=bool)) for i in self.runs]
        self.solution = self._solved(self.whole)

    def without_each(self, labels: list[Index]) -> tuple[Array, Array]:
        """How much each shared coefficient moves without each part, and the increase of its variance, both [parts, p]."""
        without = [self._without([label != part for label in labels]) for part in np.unique(np.concatenate(labels))]
        moved = np.array([one.beta - self.solution.beta for one in without])
        return moved, np.array([np.diag(one.cov) - np.diag(self.solution.cov) for one in without])

    def _without(self, kept: list[Mask]) -> Solution:
        pairs = zip(self.runs, kept, self.whole, strict=True)
        return self._solved([whole if keep.all() else self._equations(i, keep) for i, keep, whole in pairs])

    def _equations(self, i: int, keep: Mask) -> tuple[Array, float, int]:
        """Normal equations [q, q] of the blocks of one run that are kept, their log-determinant and their number."""
        design, b = self.current.design, self.current.design.blocks[i]
        q = 1 + len(design.layout.fixed) + len(design.layout.run)
        if not keep.any():
            return np.zeros((q, q)), 0.0, 0
        columns = design.columns(i)[:, keep]
        summed = Summed.of([columns], b.t_s[keep], b.precision[keep], design.cell_s, design.color)
        grams, logdet = summed.less(float(keep.mean()) * design.noise_products[i]).normal_equations(self.current.noise)
        return grams[0], logdet, int(keep.sum())

    def _solved(self, of_runs: list[tuple[Array, float, int]]) -> Solution:
        design = self.current.design
        grams, logdet, n = (np.array(x) for x in zip(*of_runs, strict=True))
        equations = Equations(design.layout, grams, logdet, design.scenarios[self.runs], int(n.sum()))
        return equations.solve(self.current.spreads)
