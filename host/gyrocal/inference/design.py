"""Block-mean regressors of one axis for a list of terms: what the fit solves.

``y = X·beta + Z_run·u + Z_scenario·v + noise``: the columns of X, Z_run and Z_scenario come from the effects, reduced to
block means run by run; a column that says nothing beside the others is left out.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gyrocal.effects.base import Role, Values
from gyrocal.error_model.model import Term
from gyrocal.inference.blocks import Blocks
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.whitening import Noise, Summed
from gyrocal.recording.session import Array

Mask = np.ndarray[Any, np.dtype[np.bool_]]

UNIDENTIFIED = 1e-7
"""A column with less of its (whitened, squared) norm left after the others cannot be told from them."""
LEAST_DPS = 1e-9
"""Root mean square of a column, per unit of its coefficient: less is nothing."""
SLOW_S = 4.0
"""Drift is slower than this: a bias wanders over many seconds. Anything faster is a signal for the tests of whiteness."""
LEAST_SCENARIOS = 3
"""Fewer power cycles say nothing of their spread."""


@dataclass(frozen=True)
class Layout:
    """Which column belongs to which term: ``fixed`` and ``run`` hold (term index, column within the term)."""

    fixed: tuple[tuple[int, int], ...]
    run: tuple[tuple[int, int], ...]
    run_group: tuple[int, ...]
    scenario: tuple[int, ...]
    """Fixed columns that also vary, at random, from scenario to scenario."""

    @property
    def random(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Columns of ``[y | fixed | run]`` whose coefficients are random in one run: its own, and its power cycle's."""
        own = 1 + len(self.fixed) + np.arange(len(self.run))
        return np.concatenate([own, np.array(self.scenario) + 1]).astype(np.intp)

    @property
    def n_groups(self) -> int:
        return max(self.run_group, default=-1) + 1


class Design:
    """Block-mean regressors of one axis for a list of terms: ``[y | fixed | run]`` for each run.

    ``noise_model``: which noise is reckoned with; with a turn-on bias the bias is random from power cycle to power cycle.
    ``cell_s``: how long drift is taken to be constant, s; 0 = a block.
    """

    def __init__(
        self, blocks: Sequence[Blocks], axis: int, terms: Sequence[Term], noise_model: AxisNoise, cell_s: float = 0.0,
        like: Design | None = None,
    ) -> None:  # fmt: skip
        self.axis = axis
        self.noise_model = noise_model
        self.cell_s = cell_s
        self.terms = tuple(terms)
        self.blocks = [self._usable(b) for b in blocks]
        runs = [b.run for b in blocks]
        self.scopes = [term.effect.scope_in(runs) for term in terms]
        self.means = [self._means(i, like) for i in range(len(self.blocks))]
        self.alike = self._alike(like)
        self.layout, self._summed = self._build()

    def changed(self, terms: Sequence[Term]) -> Design:
        """The same runs with other terms; what stays the same is not computed again."""
        return Design(self.blocks, self.axis, terms, self.noise_model, self.cell_s, like=self)

    def with_values(self, i: int, values: Values) -> Design:
        """The design with other values of one term, the same in all runs."""
        terms = list(self.terms)
        terms[i] = replace(terms[i], values={**terms[i].values, **values}, of_run={})
        return self.changed(terms)

    def over(self, blocks: Sequence[Blocks], terms: Sequence[Term] | None = None, cell_s: float | None = None) -> Design:
        """The same noise model, and terms and cells unless others are given, on other blocks of these runs."""
        cell_s = self.cell_s if cell_s is None else cell_s
        return Design(blocks, self.axis, self.terms if terms is None else terms, self.noise_model, cell_s)

    def _means(self, i: int, like: Design | None) -> list[Array | None]:
        """Block means of each term's columns in one run, [m, k]; None for a term without columns."""
        known = []
        if like is not None and like.axis == self.axis and like.blocks[i] is self.blocks[i]:
            known = [(t, m) for t, m in zip(like.terms, like.means[i], strict=True)]
        out: list[Array | None] = []
        for term in self.terms:
            same = next((m for t, m in known if t == term and t.effect is term.effect), None)
            if same is None and term.fault is None:
                columns = self._at_samples(term, self.blocks[i])
                same = self.blocks[i].mean(columns) if columns.shape[1] else None
            out.append(same)
        return out

    def _usable(self, b: Blocks) -> Blocks:
        """The blocks of a run without samples that a fault of the reading has emptied of meaning."""
        for term in self.terms:
            fault = term.fault if term.values else None
            usable = None if fault is None else fault.usable(b.run, self.axis, term.values)
            if usable is not None and b.t_s.size:
                whole = b.mean(usable[:, None].astype(float))[:, 0] == 1.0
                b = b.select(whole) if not whole.all() else b
        return b

    def _build(self) -> tuple[Layout, list[Summed]]:
        fixed: list[tuple[int, int]] = []
        run: list[tuple[int, int]] = []
        group: list[int] = []
        n_groups = 0
        for i, term in enumerate(self.terms):
            kind = term.effect
            k = len(kind.groups(term.values)) if term.values or kind.nonlinear else len(kind.linear)
            scope = self.scopes[i]
            if term.fault is not None:
                continue
            if scope == "session" or kind.common_mean:
                fixed += [(i, j) for j in range(k)]
            if scope == "run" and k:
                run += [(i, j) for j in range(k)]
                group += [n_groups + g for g in kind.groups(term.values)]
                n_groups = max(group) + 1
        fixed = [f for f in fixed if self._says_anything(f)]
        summed = [
            Summed.of((self._columns(i, fixed, run) for i in index), b.t_s, b.n, self.cell_s)
            for index, b in ((index, self.blocks[index[0]]) for index in self.alike)
        ]
        # where two columns say the same, the bias stays: power cycles have an offset of their own
        order = sorted(range(len(fixed)), key=lambda j: self.terms[fixed[j][0]].effect.role is not Role.BIAS)
        kept = self._identified(sum((s.gram.sum(axis=0) for s in summed), np.zeros(())), order, LEAST_DPS**2 * self._samples)
        if not kept.all():
            rows = np.flatnonzero(np.concatenate([[True], kept, np.ones(len(run), dtype=bool)]))
            fixed, summed = [f for f, keep in zip(fixed, kept, strict=True) if keep], [s.of_columns(rows) for s in summed]
        scenario = [j for j, (i, _) in enumerate(fixed) if self._varies(self.terms[i].effect.role)]
        return Layout(tuple(fixed), tuple(run), tuple(group), tuple(scenario)), summed

    def _varies(self, role: Role | None) -> bool:
        """Whether an effect of this role is another one in each power cycle."""
        if self.noise_model.turn_on_bias is None:
            return False
        return role is Role.BIAS or (role is Role.SCALE and self._scale_within_scenarios)

    @cached_property
    def _scale_within_scenarios(self) -> bool:
        """Two or more scenarios that each hold two true rates: their scales can be told apart one by one."""
        rates: dict[int, set[float]] = {}
        for b in self.blocks:
            on_axis = b.run.axis_index == self.axis
            rates.setdefault(b.scenario, set()).add(round(float(np.mean(b.run.rate_dps)), 3) if on_axis else 0.0)
        return len(rates) >= LEAST_SCENARIOS and all(len(r) > 1 for r in rates.values())

    def sample_columns(self, b: Blocks) -> dict[int, Array]:
        """Each term's columns at every sample of a run, by the term's index."""
        return {i: self._at_samples(term, b) for i, term in enumerate(self.terms) if term.fault is None}

    def _at_samples(self, term: Term, b: Blocks) -> Array:
        return term.effect.columns(b.run, self.axis, term.values_in(b.run) or dict.fromkeys(term.effect.linear, 0.0))

    def _says_anything(self, column: tuple[int, int]) -> bool:
        term, j = column
        return any(m is not None and bool(m[:, j].any()) for m in (means[term] for means in self.means))

    @staticmethod
    def _identified(gram: Array, order: Sequence[int], least: float) -> Mask:
        """Keep a shared column [p] only if something of it is left when those kept before it, in that order, are taken out.

        ``least``: of a column's squared norm; less is nothing (a transient that is long over).
        """
        keep = np.zeros(len(order), dtype=bool)
        for j in order:
            rest = norm = gram[1 + j, 1 + j]
            if keep.any():
                others = 1 + np.flatnonzero(keep)
                solved = np.linalg.lstsq(gram[np.ix_(others, others)], gram[others, 1 + j], rcond=None)[0]
                rest = norm - gram[others, 1 + j] @ solved
            keep[j] = rest > UNIDENTIFIED * norm and norm > least
        return keep

    def _alike(self, like: Design | None) -> list[list[int]]:
        """Indices of runs that share their blocks' times."""
        if like is not None and len(like.blocks) == len(self.blocks) and all(map(operator.is_, like.blocks, self.blocks)):
            return like.alike
        together: dict[Any, list[int]] = {}
        for i, b in enumerate(self.blocks):
            if not b.t_s.size:
                continue
            even = b.t_s.size > 2 and np.ptp(b.n) == 0 and _off_grid_s(b.t_s) <= 1e-3 * SLOW_S
            key = (b.t_s.size, float(b.n[0]), round(float(b.t_s[-1] - b.t_s[0]), 2)) if even else i
            together.setdefault(key, []).append(i)
        return list(together.values())

    def columns(self, i: int) -> Array:
        """``[y | fixed | run]`` of one run, shape [q, m]."""
        return self._columns(i, self.layout.fixed, self.layout.run)

    def _columns(self, i: int, fixed: Sequence[tuple[int, int]], run: Sequence[tuple[int, int]]) -> Array:
        out = np.empty((1 + len(fixed) + len(run), self.blocks[i].t_s.size))
        out[0] = self.blocks[i].y_dps[:, self.axis]
        for row, (term, j) in zip(out[1:], (*fixed, *run), strict=True):
            means = self.means[i][term]
            assert means is not None
            row[:] = means[:, j]
        return out

    def grams(self, noise: Noise) -> tuple[Array, Array]:
        """Whitened normal equations of each run, shape [runs, q, q], and log-determinants [runs]."""
        q = 1 + len(self.layout.fixed) + len(self.layout.run)
        grams = np.zeros((len(self.blocks), q, q))
        logdet = np.zeros(len(self.blocks))
        for index, summed in zip(self.alike, self._summed, strict=True):
            grams[index], logdet[index] = summed.normal_equations(noise)
        return grams, logdet

    @property
    def scenarios(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        return np.array([b.scenario for b in self.blocks], dtype=np.intp)

    @property
    def n_blocks(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        return np.array([b.t_s.size for b in self.blocks], dtype=np.intp)

    @cached_property
    def extent_s(self) -> tuple[float, float]:
        """Longest run and shortest step from block to block, s."""
        longest_s = max(float(b.t_s[-1] - b.t_s[0]) for b in self.blocks if b.t_s.size)
        return longest_s, min((float(np.median(np.diff(b.t_s))) for b in self.blocks if b.t_s.size > 1), default=1.0)

    @cached_property
    def column_rms(self) -> Array:
        """Root mean square of each column [q] over all samples: the natural scale of its coefficient."""
        squares = sum(np.diagonal(s.gram, axis1=1, axis2=2).sum(axis=0) for s in self._summed)
        return np.asarray(np.sqrt(squares / self._samples) + 1e-300)

    @property
    def _samples(self) -> float:
        return max(1.0, sum(float(b.n.sum()) for b in self.blocks))


def _off_grid_s(t_s: Array) -> float:
    """How far times [n] stray from an even grid, s."""
    return float(np.max(np.abs(t_s - np.linspace(t_s[0], t_s[-1], t_s.size))))
