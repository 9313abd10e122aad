"""Which columns of a design belong to which terms, and which of them have random coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


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
    def n_groups(self) -> int:
        """Number of groups of coefficients that differ from run to run."""
        return max(self.run_group, default=-1) + 1
