"""Boards that the population does not explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.fleet.pooling import Pooled
from gyrocal.fleet.summary import Summary
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Outlier:
    """A session whose board deviates from the population in one parameter, by ``z`` standard deviations of the prediction."""

    session: str
    board: str
    parameter: str
    value: float
    z: float
    why: str

    def to_json(self) -> dict[str, Any]:
        return dict(self.__dict__)

    def order(self) -> tuple[float, str, str]:
        """The furthest first."""
        return (-abs(self.z), self.session, self.parameter)


def outliers(name: str, pooled: Pooled, values: Array, boards: Sequence[Summary]) -> list[Outlier]:
    """The sessions with weight zero in the population of one parameter, with its ``values`` [n] of all boards."""
    found = []
    for i in np.flatnonzero(~pooled.used).tolist():
        why = (
            f"{name} is {values[i]:.4g}, where the population has {pooled.mean:.4g} with a spread of {pooled.sd:.2g} "
            f"over boards: {abs(pooled.z[i]):.1f} standard deviations off"
        )
        found.append(Outlier(boards[i].session, boards[i].board, name, float(values[i]), float(pooled.z[i]), why))
    return found
