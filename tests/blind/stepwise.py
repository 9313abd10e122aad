"""What most would do: forward selection by the ordinary F-test.

White noise, least squares on the same block means (samples, where an effect is that fast) and the same candidate columns
as the tool, no drift and no random bias of a power cycle. What has a phase or size of its own in each run gets free
coefficients in each run. Faults of the reading have no columns, so no F-test.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from gyrocal.effects import base
from gyrocal.effects.reading_fault import ReadingFault
from gyrocal.inference.blocks import Blocks, by_sample, reduce_session
from gyrocal.recording.session import AXES, Session

Array = NDArray[np.float64]
Fitted = tuple[float, int, int]  # sum of squares, parameters, samples

ALARM = 0.01
"""Chance that any candidate enters where nothing is missing, were the noise white: shared by all of them."""
MOST_STEPS = 3


def select(session: Session) -> list[tuple[str, str]]:
    """(effect id, axis) in the order in which they enter the model."""
    slow = reduce_session(session)
    runs = [b.run for b in slow]
    kinds = [k for k in base.effects().values() if k.role is None and not isinstance(k, ReadingFault)]
    candidates = [(kind, axis) for kind, axis in product(kinds, range(3)) if kind.missing(runs, axis) is None]
    share = ALARM / max(1, len(candidates))
    models = [_Regression(slow, axis) for axis in range(3)]
    chosen: list[tuple[str, str]] = []
    while len(chosen) < MOST_STEPS and candidates:
        tried = [(*models[axis].best_variant(kind), kind, axis) for kind, axis in candidates]
        chance, values, kind, axis = min(tried, key=lambda t: t[0])
        if chance >= share:
            break
        models[axis] = models[axis].with_term(kind, values)
        candidates.remove((kind, axis))
        chosen.append((kind.id, AXES[axis]))
    return chosen


def f_test(before: Fitted, after: Fitted, extra: int = 0) -> float:
    """Chance that noise alone lowers the sum of squares so far; `extra` nonlinear parameters count as linear ones."""
    gained = after[1] - before[1]
    if gained <= 0:
        return 1.0
    gained += extra
    left = after[2] - after[1] - extra
    ratio = (before[0] - after[0]) / gained / (after[0] / left)
    return float(f_distribution.sf(ratio, gained, left))


class _Regression:
    """One axis, least squares on the terms so far."""

    def __init__(
        self, blocks: Sequence[Blocks], axis: int, terms: Sequence[tuple[base.Effect, base.Values]] | None = None
    ) -> None:
        self.blocks = blocks
        self.axis = axis
        inherent = [(kind, dict.fromkeys(kind.linear, 0.0)) for kind in map(base.with_role, base.Role)]
        self.terms = inherent if terms is None else list(terms)

    def with_term(self, kind: base.Effect, values: base.Values) -> _Regression:
        return _Regression(self.blocks, self.axis, [*self.terms, (kind, values)])

    def best_variant(self, kind: base.Effect) -> tuple[float, base.Values]:
        """The likeliest shape of a candidate and its chance, the price of having looked paid."""
        at = self.fast if kind.fast else self
        runs = [b.run for b in self.blocks]
        tried = [(f_test(at.fitted, at._more(kind, v), len(kind.nonlinear)), v) for v in kind.variants(runs, self.axis)]
        chance, values = min(tried, key=lambda t: t[0])
        return min(1.0, chance * kind.looks(runs, self.axis).shapes), values

    @cached_property
    def fast(self) -> _Regression:
        return _Regression(by_sample(self.blocks), self.axis, self.terms)

    @cached_property
    def fitted(self) -> Fitted:
        return _least_squares(*self._target_and_columns)

    def _more(self, kind: base.Effect, values: base.Values) -> Fitted:
        target, shared, own = self._target_and_columns
        more = [b.mean(kind.columns(b.run, self.axis, values)) for b in self.blocks]
        if self._free_in_each_run(kind):
            own = [np.column_stack(parts) for parts in zip(own, more, strict=True)]
        else:
            shared = [np.column_stack(parts) for parts in zip(shared, more, strict=True)]
        return _least_squares(target, shared, own)

    @cached_property
    def _target_and_columns(self) -> tuple[list[Array], list[Array], list[Array]]:
        target, shared, own = [], [], []
        for b in self.blocks:
            columns = [(self._free_in_each_run(k), b.mean(k.columns(b.run, self.axis, v))) for k, v in self.terms]
            target.append(b.y_dps[:, self.axis])
            shared.append(np.column_stack([c for free, c in columns if not free]))
            own.append(np.column_stack([np.zeros((b.t_s.size, 0)), *(c for free, c in columns if free)]))
        return target, shared, own

    def _free_in_each_run(self, kind: base.Effect) -> bool:
        return kind.scope_in([b.run for b in self.blocks]) == "run" and not kind.common_mean


def _least_squares(target: Sequence[Array], shared: Sequence[Array], own: Sequence[Array]) -> Fitted:
    """`own` columns have coefficients of their own in each run: projected out run by run."""
    parameters = 0
    rest = [np.column_stack([y, columns]) for y, columns in zip(target, shared, strict=True)]
    for i, columns in enumerate(own):
        basis = _basis(columns)
        parameters += basis.shape[1]
        rest[i] = rest[i] - basis @ (basis.T @ rest[i])
    everything = np.concatenate(rest)
    basis = _basis(everything[:, 1:])
    left = everything[:, 0] - basis @ (basis.T @ everything[:, 0])
    return float(left @ left), parameters + basis.shape[1], len(left)


def _basis(columns: Array) -> Array:
    """An orthonormal basis of the columns, without those that are sums of the others."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns[:, size > 0] / size[size > 0]
    if not scaled.size:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    return u[:, s > 1e-7 * s[0]]
