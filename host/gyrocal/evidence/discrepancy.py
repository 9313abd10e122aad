"""What may be left over: a smooth function of one variable that no effect of the library describes.

Every sensor has a small disturbance that nobody has named. Beside it a comparison of effects alone names the effect that
resembles it most, with certainty. Each hypothesis here, also that of no effect, may therefore hold such a function, and an
effect is named only where it explains the data better than a function without a name (Kennedy and O'Hagan, J. R. Stat. Soc. B
63 (2001) 425). The function is a sum of cosines over the variable's range, with amplitudes that fall as 1/k.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal.effects.base import elapsed_s
from gyrocal.effects.quantities import (
    acceleration_g,
    cosines,
    cycle_time_s,
    power_on_time_s,
    rate_slope_dps_s,
    temperature_c,
    true_rate_dps,
)  # fmt: skip
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.variables.acceleration import Acceleration
from gyrocal.variables.face import Face
from gyrocal.variables.power_on_time import PowerOnTime
from gyrocal.variables.rate import Rate
from gyrocal.variables.temperature import Temperature
from gyrocal.variables.time import Time

SLOPE = "rate_slope"
COSINES = 6
"""Number of cosines: the shortest wave has a third of the variable's range."""
LEAST_RANGE = 1e-6
"""A variable that moves by less than this part of its size does not move."""
LEAST_SPREAD = 0.05
"""Speeds that differ by less than this part of their size are one speed."""
SLOW = 0.05
"""Rate, as a part of its rms, below which the direction of the table is not taken as known."""
THE_SAME = 1e-3
"""Of two variables that differ by less than this part of their range, in this session, the first stands for both."""


Factor = Callable[[Run], Array]
"""What a function is multiplied by, shape [n] of about one."""


@dataclass(frozen=True)
class Shape:
    """A smooth function of one variable, ``against``, alone or times the true rate, its size or its sign (``times``).

    ``line`` [2, COSINES] is what a constant and a line explain of each cosine, if that part is taken out.
    """

    against: str
    values: Callable[[Run], Array | None]
    low: float
    high: float
    times: Factor | None
    line: Array | None = None

    @property
    def count(self) -> int:
        """Number of columns."""
        return COSINES

    def columns(self, run: Run) -> Array:
        """The cosines [n, COSINES] in a run, deg/s for an amplitude of 1 deg/s; zero where the run lacks the variable."""
        found = self.values(run)
        if found is None:
            return np.zeros((len(run), COSINES))
        part = np.clip((found - self.low) / (self.high - self.low), 0.0, 1.0)
        waves = _cosines(part)
        if self.line is not None:
            waves -= self.line[:1].T + self.line[1:].T * part
        if self.times is not None:
            waves *= self.times(run)
        return waves.T


def _cosines(part: Array) -> Array:
    """The cosines [COSINES, n] over the part of the range [n] that a variable has reached, with falling amplitudes."""
    waves = cosines(part, COSINES)
    waves /= np.arange(1, COSINES + 1)[:, None]
    return waves


def shapes(runs: Sequence[Run]) -> list[Shape]:
    """Every shape that these runs can show on any axis."""
    known = [run for run in runs if not run.rate_is_mean]
    if not known:
        return []
    factors = _factors(known)
    out: list[Shape] = []
    seen: list[Array] = []
    for against, values in _variables(runs):
        found = [v for run in known if (v := values(run)) is not None]
        if not found:
            continue
        low, high = (float(of([of(v) for v in found])) for of in (np.min, np.max))
        if high - low <= LEAST_RANGE * max(abs(low), abs(high)):
            continue
        course = np.concatenate([(v[:: max(1, v.size // 20)] - low) / (high - low) for v in found])
        if any(course.size == other.size and np.abs(course - other).max() < THE_SAME for other in seen):
            continue
        seen.append(course)
        if against == Rate.name:
            out.append(Shape(against, values, low, high, None, _line(course)))
            continue
        times = (None,) if against == SLOPE else (None, *factors)
        out += [Shape(against, values, low, high, t) for t in times]
    return out


def _line(course: Array) -> Array:
    """The constant and the slope [2, COSINES] of each cosine over the course [n] of the rate.

    What is proportional to the rate is no disturbance without a name: it is the scale, or misalignment, by their definition.
    """
    line = np.column_stack([np.ones(course.size), course])
    return np.asarray(np.linalg.lstsq(line, _cosines(course).T, rcond=None)[0])


def _factors(runs: Sequence[Run]) -> list[Factor]:
    """The true rate of the table about whatever axis it turns, and its size and sign if it has several sizes and both signs."""
    rates_dps = np.concatenate([true_rate_dps(run) for run in runs])
    rms_dps = float(np.sqrt(np.mean(rates_dps**2)))
    if not rms_dps:
        return []
    speeds_dps = np.abs(rates_dps)
    one_way = abs(float(rates_dps @ speeds_dps)) > (1 - LEAST_SPREAD) * float(rates_dps @ rates_dps)

    def rate(run: Run) -> Array:
        return np.asarray(true_rate_dps(run) / rms_dps)

    def speed(run: Run) -> Array:
        return np.abs(rate(run))

    def direction(run: Run) -> Array:
        """The sign of the rate, which goes through zero where the table turns slowly."""
        return np.asarray(np.tanh(rate(run) / SLOW))

    if float(np.std(speeds_dps)) < LEAST_SPREAD * rms_dps:
        return [rate]
    return [rate] if one_way else [rate, speed, direction]


def _variables(runs: Sequence[Run]) -> list[tuple[str, Callable[[Run], Array | None]]]:
    """Name and values of each variable, in the words of a finding."""
    begins_s: dict[str, float] = {}
    for run in runs:
        begins_s[run.scenario] = min(float(cycle_time_s(run)[0]), begins_s.get(run.scenario, np.inf))

    def in_cycle_s(run: Run) -> Array | None:
        return cycle_time_s(run) - begins_s[run.scenario]

    def early_s(run: Run) -> Array:
        """The logarithm of the time in the run from a second on, in which what settles in seconds is smooth."""
        return np.asarray(np.log1p(elapsed_s(run)))

    def along(component: int) -> Callable[[Run], Array | None]:
        def values(run: Run) -> Array | None:
            found = acceleration_g(run)
            return None if found is None else found[:, component]

        return values

    return [
        (Time.name, elapsed_s), (Time.name, early_s), (PowerOnTime.name, power_on_time_s), ("cycle_time", in_cycle_s),
        (Temperature.name, temperature_c), (Rate.name, true_rate_dps),
        (Face.name, lambda run: np.full(len(run), run.face_sign)),
        (SLOPE, lambda run: rate_slope_dps_s(run, run.axis_index)),
        *((Acceleration.name, along(i)) for i in range(len(AXES))),
    ]  # fmt: skip
