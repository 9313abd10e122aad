"""The base class of effects of time: the reading shows the true rate of another moment."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from gyrocal.effects.base import Effect, Values
from gyrocal.effects.mistaken import course
from gyrocal.effects.quantities import VARYING_RATE, rate_varies, sense_of_change
from gyrocal.recording.session import Array, Run
from gyrocal.recording.timing import Motion, Timing

ONE_CLOCK = "a reference by the clock of the readings; by a clock of its own, its offset and drift hide the effect"


class TimingEffect(Effect):
    """An effect of time with one linear parameter.

    It is exact at any size. A run that is :meth:`~gyrocal.recording.session.Run.timed` has the true rate that the reading
    shows, and every effect's columns are computed from it. The effect's own column is the derivative of that rate by the
    parameter, so the fit only determines by how much the parameter differs from the value of the timing
    (:mod:`gyrocal.inference.timing`).
    """

    of_recording: ClassVar[bool] = False
    """True if all axes share the effect, so that each axis that moves must show it with the same value."""

    @abstractmethod
    def set(self, timing: Timing, values: Mapping[str, float]) -> Timing:
        """A timing with the effect at these values; everything else stays as it is. Without values, the effect is absent."""

    @abstractmethod
    def derivative(self, motion: Motion, t_s: Array, timing: Timing) -> Array:
        """Derivative of the true rate by the parameter at the times ``t_s`` [n], s, shape [n]."""

    def shapes(self, values: Mapping[str, float]) -> list[Values]:
        """The values with each form of the effect that only the likelihood can tell apart, the simplest first."""
        return [dict(values)]

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        if any(run.reference.clock == "own" and run.measured_rates is not None for run in runs):
            return ONE_CLOCK
        return None if rate_varies(runs, axis) else VARYING_RATE

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        if axis != run.axis_index or run.motion is None:
            return np.zeros((len(run), 1))
        return self.derivative(run.motion, run.sample_s, run.timing)[:, None]

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """Friction or play of the mount, an offset with the sign of the rate's change."""
        return (course(sense_of_change),)

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        if axis != run.axis_index:
            return np.zeros(len(run))
        return run.timed(self.set(run.timing, values)).rate_dps - run.timed(self.set(run.timing, {})).rate_dps
