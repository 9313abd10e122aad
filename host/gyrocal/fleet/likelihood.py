"""The likelihood of every candidate from each board: score and information, with one turn-on spread for the whole fleet.

The spread of bias and scale over power cycles is poorly known from the three or four cycles of one board, and every standard
error depends on it. Boards of one kind share the spread, so it is estimated from all of them by restricted maximum likelihood.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from gyrocal.fleet.summary import AxisSummary
from gyrocal.inference.reml import Index, integrate
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

Kind = tuple[tuple[str, ...], tuple[int, ...]]
"""The model's columns that a board could show, and which of them differ from power cycle to power cycle."""


def kind_of(one: AxisSummary) -> Kind:
    """What sessions must have in common for their power cycles to be pooled."""
    return one.columns, one.random


@dataclass
class CycleSpreads:
    """Collects the power cycles of many boards, whose common spreads :meth:`fit` finds."""

    cycles: dict[tuple[Kind, int], list[Array]] = field(default_factory=dict)
    unit: dict[Kind, list[Array]] = field(default_factory=dict)

    def add(self, one: AxisSummary, weights: Array) -> None:
        """Add the power cycles of one session on one axis, at the drift that ``weights`` [3] say."""
        if one.random:
            p, cycles = 1 + len(one.columns), one.at_drift(weights)
            self.cycles.setdefault((kind_of(one), len(cycles)), []).append(cycles[:, :p, :p].copy())  # the candidates' is freed

    def fit(self) -> dict[Kind, Array]:
        """Spreads over power cycles [k], in the units of the columns, for each kind of board (see :func:`kind_of`)."""
        kinds = sorted({kind for kind, _ in self.cycles})
        return {kind: self._fit(kind) for kind in kinds}

    def _fit(self, kind: Kind) -> Array:
        from scipy.optimize import minimize

        random = np.array(kind[1]) + 1
        groups = [np.stack(grams) for (of, _), grams in sorted(self.cycles.items(), key=lambda item: item[0]) if of == kind]
        boards = sum(len(g) for g in groups)
        unit = np.mean([1 / np.sqrt(np.einsum("bcii->i", g)[random] / (g.shape[0] * g.shape[1])) for g in groups], axis=0)

        def cost(x: Array) -> float:
            return -sum(_loglik(g, random, unit * x) for g in groups) / boards

        starts = [np.full(random.size, first) for first in (0.3, 3.0, 30.0)]
        bounds = [(0.0, 1e4)] * random.size
        options = {"ftol": 1e-13, "gtol": 1e-9}
        tried = [minimize(cost, start, method="L-BFGS-B", bounds=bounds, options=options) for start in starts]
        return np.asarray(unit * min(tried, key=lambda t: t.fun).x)


def _loglik(cycles: Array, random: Index, sd: Array) -> float:
    """REML log-likelihood of boards [boards, cycles, 1 + p, 1 + p], each with coefficients of its own; up to a constant."""
    found = integrate(cycles, random, np.arange(cycles.shape[-1]), sd)
    total = found.grams.sum(axis=1)
    h, g = total[:, 1:, 1:], total[:, 1:, 0]
    chi2 = total[:, 0, 0] - np.einsum("bi,bi->b", g, np.linalg.solve(h, g[..., None])[..., 0])
    return float(-0.5 * (found.logdet.sum() + np.linalg.slogdet(h)[1].sum() + chi2.sum()))


def evidence(one: AxisSummary, weights: Array, spreads: dict[Kind, Array], names: Sequence[str]) -> tuple[Array, Array]:
    """Score [k] and information [k, k] of the candidates ``names`` at size zero; zero where the board cannot show one."""
    score, information = np.zeros(len(names)), np.zeros((len(names), len(names)))
    whole = cycles = one.at_drift(weights)
    if one.random:
        cycles = integrate(cycles, np.array(one.random) + 1, np.arange(cycles.shape[-1]), spreads[kind_of(one)]).grams
    total = cycles.sum(axis=0)
    p = len(one.columns)
    model, rest = np.arange(1, 1 + p), np.r_[0, np.arange(1 + p, len(total))]
    left = total[np.ix_(rest, rest)] - total[np.ix_(rest, model)] @ np.linalg.solve(
        total[np.ix_(model, model)], total[np.ix_(model, rest)]
    )
    seen = np.diag(left)[1:] > POLICY.fleet_identified * np.diag(whole.sum(axis=0))[1 + p :]
    at = {name: j for j, name in enumerate(names)}
    mine = [(1 + i, at[name]) for i, name in enumerate(one.candidates) if seen[i] and name in at]
    if mine:
        here, there = (list(index) for index in zip(*mine, strict=True))
        score[there] = left[here, 0]
        information[np.ix_(there, there)] = left[np.ix_(here, here)]
    return score, information


def names_of(summaries: Iterable[AxisSummary]) -> list[str]:
    """The candidates of any board, sorted."""
    return sorted({name for one in summaries for name in one.candidates})
