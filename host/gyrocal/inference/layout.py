"""Which columns of a design belong to which terms, and which of them have random coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gyrocal.error_model.term import Term

Columns = list[tuple[int, int]]
"""Pairs of a term's index and a column within the term."""


@dataclass(frozen=True)
class Layout:
    """The assignment of columns to terms: ``fixed`` and ``run`` hold pairs of term index and column within the term."""

    fixed: tuple[tuple[int, int], ...]
    run: tuple[tuple[int, int], ...]
    run_group: tuple[int, ...]
    scenario: tuple[int, ...]
    """Fixed columns whose coefficients also vary at random from power cycle to power cycle."""

    @property
    def random(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Columns of ``[y | fixed | run]`` with random coefficients: those of each run and those of each power cycle."""
        own = 1 + len(self.fixed) + np.arange(len(self.run))
        return np.concatenate([own, np.array(self.scenario) + 1]).astype(np.intp)

    @property
    def shared(self) -> Layout:
        """The same without the columns of each run."""
        return replace(self, run=(), run_group=())

    @property
    def n_groups(self) -> int:
        """Number of groups of coefficients that differ from run to run."""
        return max(self.run_group, default=-1) + 1


class Assigned(NamedTuple):
    """The columns that all runs share, those with a coefficient of their own in each run, and the groups of the latter."""

    fixed: Columns
    run: Columns
    group: list[int]


def assigned(terms: Sequence[Term], scopes: Sequence[str], n_runs: int) -> Assigned:
    """The columns of the terms with these scopes in ``n_runs`` runs."""
    fixed: Columns = []
    run: Columns = []
    group: list[int] = []
    n_groups = 0
    for i, (term, scope) in enumerate(zip(terms, scopes, strict=True)):
        kind = term.effect
        k = len(kind.coding.groups(term.values)) if term.values or kind.nonlinear else len(kind.linear)
        if term.fault is not None:
            continue
        if scope == "session" or kind.common_mean:
            fixed += [(i, j) for j in range(k)]
        if scope == "run" and k and not (kind.common_mean and n_runs == 1):  # one run shows the mean alone
            run += [(i, j) for j in range(k)]
            group += [n_groups + g for g in kind.coding.groups(term.values)]
            n_groups = max(group) + 1
    return Assigned(fixed, run, group)
