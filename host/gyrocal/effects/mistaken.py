"""What is no effect of the library but can be mistaken for one: terms that are fitted to contradict a candidate, never named.

This file defines no effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Effect, Parameter, Values, elapsed_s, stack, table_angle_rad
from gyrocal.effects.quantities import (
    cosines,
    cycle_time_s,
    power_on_time_s,
    rate_about,
    slope_squared,
    temperature_c,
    warming_c,
)
from gyrocal.recording.session import Array, Run

Course = Callable[[Run, int, Mapping[str, float]], Array]
"""Regressors [n, k] of one run and axis at given nonlinear values."""


class _Mistaken(Effect):
    """``count`` columns with coefficients that are the same in all runs, and the nonlinear ``parameters`` that shape them."""

    id, title, cause, equation, looks_like, measure_next = "mistaken", "", "", "", "", ""

    def __init__(
        self, course: Course, count: int = 1, parameters: Sequence[Parameter] = (), tried: Sequence[Values] = ({},)
    ) -> None:
        self.course = course
        self.linear = tuple(f"c{k}" for k in range(count))
        self.parameters = tuple(parameters)  # type: ignore[misc]
        self.nonlinear = tuple(p.name for p in parameters)  # type: ignore[misc]
        self.tried = tried

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        return [dict.fromkeys(self.linear, 0.0) | values for values in self.tried]

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return self.course(run, axis, values)


def course(of: Callable[[Run, int], Array]) -> Effect:
    """One known course [n]."""
    return _Mistaken(lambda run, axis, values: of(run, axis)[:, None])


class _Surely(_Mistaken):
    """What contradicts a known effect only if it gains more than rounding."""


class _SquareOfSlope(_Surely):
    """What grows with the slope of the rate: it is largest where the rate is small. No known effect does."""

    def __init__(self) -> None:
        super().__init__(_square_of_slope)


def _square_of_slope(run: Run, axis: int, values: Mapping[str, float]) -> Array:
    found = slope_squared(run)
    return np.zeros((len(run), 1)) if found is None else found[:, None]


def square_of_slope() -> Effect:
    """The square of the slope of the table's rate."""
    return _SquareOfSlope()


def must_be_sure(other: Effect) -> bool:
    """True for what must gain more than rounding before it contradicts a known effect.

    No physics suggests it, or it is free to be as the effect is within noise.
    """
    return isinstance(other, _Surely)


def once_per_turn() -> Effect:
    """A wave once per turn of the table's recorded angle, which may have another phase with the other face up."""

    def columns(run: Run, axis: int, values: Mapping[str, float]) -> Array:
        angle_rad, up = table_angle_rad(run), float(run.face_sign > 0)
        return UNIT_DPS * stack(*(side * wave(angle_rad) for side in (up, 1 - up) for wave in (np.cos, np.sin)))

    return _Mistaken(columns, 4)


SETTLING = Parameter("tau_s", "s", (10.0, 120.0), "thermal time constants of package and board", search=(3.0, 600.0))


def settling_scale() -> Effect:
    """A scale that settles after power-on, as that of a part that heats itself. It does nothing at rest."""

    def decay(run: Run, axis: int, values: Mapping[str, float]) -> Array:
        p_s = power_on_time_s(run)
        return (rate_about(run, axis) * (0.0 if p_s is None else np.exp(-p_s / values["tau_s"])))[:, None]

    return _Mistaken(decay, 1, [SETTLING], [{"tau_s": float(tau_s)} for tau_s in np.geomspace(5.0, 320.0, 7)])


def settling_bias() -> Effect:
    """A bias that settles over each power cycle whose time of power-on is not known.

    It is a drift that flattens, in a drift's unit, because a restricted likelihood depends on the units of the columns.
    """

    def decay(run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return -values["tau_s"] * np.expm1(-cycle_time_s(run) / values["tau_s"])[:, None]

    return _Surely(decay, 1, [SETTLING], [{"tau_s": float(tau_s)} for tau_s in np.geomspace(5.0, 320.0, 7)])


COSINES = 12
"""Cosines of a course that is the same in each run: up to six waves in the longest run."""
UNIT_DPS = 0.01
"""Size of one of them. The restricted likelihood takes coefficients of about one for usual ones."""


def same_in_each_run(runs: Sequence[Run]) -> list[Effect]:
    """Courses over the time in the run that are the same in all runs: alone, times the rate, and times its size."""
    longest_s = max(run.duration_s for run in runs)
    fastest_dps = max(float(np.abs(run.rate_dps).max()) for run in runs) or 1.0

    def times(factor: Callable[[Array], Array]) -> Effect:
        def columns(run: Run, axis: int, values: Mapping[str, float]) -> Array:
            waves = cosines(elapsed_s(run) / longest_s, COSINES)
            waves *= UNIT_DPS * factor(rate_about(run, axis) / fastest_dps)
            return waves.T

        return _Mistaken(columns, COSINES)

    return [times(np.ones_like), times(np.asarray), times(np.abs)]


def by_temperature() -> Effect:
    """A bias and a scale in proportion to the measured temperature."""
    return _Mistaken(lambda run, axis, values: stack(warming_c(run), warming_c(run) * rate_about(run, axis)), 2)


def over_temperature(runs: Sequence[Run]) -> Effect:
    """A bias that is any smooth function of the measured temperature."""
    known = [temp_c for run in runs if (temp_c := temperature_c(run)) is not None]
    low_c, high_c = min(float(t.min()) for t in known), max(float(t.max()) for t in known)

    def columns(run: Run, axis: int, values: Mapping[str, float]) -> Array:
        temp_c = temperature_c(run)
        if temp_c is None:
            return np.zeros((len(run), COSINES))
        return UNIT_DPS * cosines((temp_c - low_c) / max(high_c - low_c, 1e-9), COSINES).T

    return _Mistaken(columns, COSINES)
