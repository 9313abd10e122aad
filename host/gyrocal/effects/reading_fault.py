"""Faults of the reading: what happens to a number after it was sensed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gyrocal.effects.base import Array, Effect, Mask, Run, Values


@dataclass(frozen=True)
class Detected:
    """A fault that was found: its values and their standard errors, and the chance that a sound reading looks so."""

    values: Values
    se: Values
    chance: float


class ReadingFault(Effect):
    """A fault of the reading. It has no columns: :meth:`detect` finds it, :meth:`distort` plants it."""

    clips: ClassVar[bool] = False
    """Whether readings stay at a limit that this fault knows."""

    def fault_of(self, values: Mapping[str, float]) -> ReadingFault | None:
        return self

    @property
    def fault(self) -> ReadingFault:
        return self

    def axes(self, run: Run) -> tuple[int, ...]:
        return (0, 1, 2)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))

    @abstractmethod
    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """The fault as the readings of one axis show it; None where they do not."""

    @abstractmethod
    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """Readings [n, 3] with the fault, deg/s, from those without, for the simulator."""

    @abstractmethod
    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        """What such a sensor is expected to read [n] where the model says ``modelled_dps`` [n], deg/s."""

    def usable(self, run: Run, axis: int, values: Mapping[str, float]) -> Mask | None:
        """The samples [n] that still say something of the rate; None = all."""
        return None

    def step_dps(self, values: Mapping[str, float]) -> float:
        """The grid on which this fault puts the readings, deg/s; 0 = none."""
        return 0.0

    def throws_out(self, values: Mapping[str, float]) -> bool:
        """Whether this fault throws single readings far out."""
        return False
