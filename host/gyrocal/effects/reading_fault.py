"""Faults of the reading: errors that occur after the rate was sensed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gyrocal.effects.base import Array, Effect, Mask, Run, Values


@dataclass(frozen=True)
class Detected:
    """A detected fault: its values, their standard errors, and the probability that sound readings look the same."""

    values: Values
    se: Values
    chance: float


class Fault(ABC):
    """An error that occurs after the rate was sensed: :meth:`detect` finds it, :meth:`distort` plants it."""

    clips: ClassVar[bool] = False
    """True if this fault describes readings that stay at a limit."""

    def describes(self, values: Mapping[str, float]) -> bool:
        """True if these values of its effect are those of the fault; else they are those of a term of the reading."""
        return True

    @abstractmethod
    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """The fault as detected in the readings of one axis; None if they do not show it."""

    @abstractmethod
    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """Readings [n, 3] with the fault, deg/s, from sound readings [n, 3], for the simulator."""

    @abstractmethod
    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        """The expected reading [n] of a sensor with this fault at the modelled rate ``modelled_dps`` [n], deg/s."""

    def usable(self, run: Run, axis: int, values: Mapping[str, float]) -> Mask | None:
        """Mask [n] of the samples that still carry information about the rate; None = all."""
        return None

    def step_dps(self, values: Mapping[str, float]) -> float:
        """The step of the grid on which this fault puts the readings, deg/s; 0 = no grid."""
        return 0.0

    def throws_out(self, values: Mapping[str, float]) -> bool:
        """True if this fault produces outliers."""
        return False


class ReadingFault(Effect, Fault):
    """An effect that is a fault of the reading and nothing else, so that it has no columns."""

    uncorrected = "the reading no longer contains what would be needed to undo it"
    acts_on = "all"

    def __init__(self) -> None:
        self.fault = self

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))
