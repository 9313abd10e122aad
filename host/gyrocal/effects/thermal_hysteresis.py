"""Thermal hysteresis: the reading at one temperature depends on where the temperature came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Case, Effect, Law, Parameter, Values, stack
from gyrocal.effects.mistaken import over_temperature
from gyrocal.effects.quantities import from_seconds, temperature_by_second
from gyrocal.parameter import POSITIVE
from gyrocal.recording.once import once_a_run
from gyrocal.recording.session import Array, Run

LEAST_C = 1.0
"""Least rise and fall of the temperature within power cycles that can show a loop, degC."""
WIDTHS_C = tuple(0.5 * 2 ** (k / 2) for k in range(13))
STARTS = (0.0, -1.0, -0.5, 0.5, 1.0)
"""Where the part may begin between the branches. Its temperature before the power cycle decides on it, and is not known."""


class ThermalHysteresis(Effect):
    id = "thermal_hysteresis"
    title = "Thermal hysteresis"
    cause = (
        "Glue, solder and moulding compound creep and stick, so the stress on the structure at one temperature depends on "
        "whether the part was warmer or colder before. The bias follows one branch while warming and another while cooling. "
        "After the temperature turns round, the bias moves from one branch to the other over a few degrees, and it stays "
        "where it is while the temperature rests."
    )
    equation = "amplitude_dps·(T - h)/(width_c/2), where h follows T at a distance of width_c/2 at most (play operator)"
    looks_like = (
        "thermal_lag, if the temperature always changes at the same speed; drift and colored_noise, if the temperature goes "
        "up and down only once"
    )
    measure_next = (
        "take the part up and down through the same temperatures twice and at two speeds, and let the temperature rest: a "
        "hysteresis keeps its size at any speed and stays during the rest, a lag does not"
    )
    parameters = (
        Parameter(
            "amplitude_dps", "dps", (0.01, 0.3), "half the loop of consumer MEMS gyroscopes over -40 to 85 °C", 0.1
        ),
        Parameter(
            "width_c", "degC", (0.5, 30.0), "from one branch to the other: a part of the temperature range", 5.0, POSITIVE,
            search=(0.2, 60.0), sized=False,
        ),
        Parameter(
            "start", "of half the width", (-1.0, 1.0), "1: the part came from the cold before its power-on, -1: from the heat",
            0.0, (-1.0, 1.0), sized=False,
        ),
    )  # fmt: skip
    linear = ("amplitude_dps",)
    nonlinear, chosen = ("width_c",), ("start",)
    law = Law({"amplitude_dps": 0.1, "width_c": 4.0}, None)
    cases = (Case({"amplitude_dps": 0.1, "width_c": 5.0}, ("amplitude_dps", "width_c"), "chamber"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        measured = bool(runs) and all(r.temp_c is not None for r in runs)
        if measured and _both_ways_c(runs) >= LEAST_C:
            return None
        return "power cycles in which the temp_c column rises and falls by 1 °C or more"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        range_c = max(float(np.ptp(_course_c(r))) for r in runs if r.temp_c is not None)
        widths = [w for w in WIDTHS_C if w <= max(range_c, WIDTHS_C[0])]
        return [{"width_c": w, "start": s, "amplitude_dps": 0.0} for w in widths for s in STARTS]

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """Any function of the temperature: where all runs go the same way from the same temperature, a hysteresis is one."""
        return [over_temperature(runs)]

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        if run.temp_c is None:
            return np.zeros((len(run), 1))
        branch = _branch(run, values["width_c"] / 2, values.get("start", 0.0))
        return stack(from_seconds(run, branch))


@once_a_run
def _branch(run: Run, half_c: float, start: float) -> Array:
    """How far the temperature of each second is from the middle of the play, in halves of its width, shape [m]."""
    course_c = _course_c(run)
    apart = (course_c - play_c(course_c, half_c, start)) / half_c
    return apart[-temperature_by_second(run)[0].size :].copy()


def _course_c(run: Run) -> Array:
    """The temperature by the second in a run, after the turning points of those before it in its power cycle, [m], degC.

    Between two runs it is taken to go from the last to the first temperature without a detour.
    """
    before = [_turning_points_c(earlier) for earlier in run.earlier if earlier.temp_c is not None]
    return np.concatenate([*before, temperature_by_second(run)[1]])


@once_a_run
def _turning_points_c(run: Run) -> Array:
    """The first and last temperature of a run, and those at which it turns, [k], degC: all that a play operator remembers."""
    temp_c = temperature_by_second(run)[1]
    turns = np.diff(np.sign(np.diff(temp_c)), prepend=1.0, append=1.0) != 0
    turns[[0, -1]] = True
    return temp_c[turns]


def play_c(temp_c: Array, half_c: float, start: float = 0.0) -> Array:
    """The play operator: a value that stays until the temperature [n] is further than ``half_c`` away, shape [n], degC.

    It begins ``start`` times this distance below the first temperature.
    """
    out = np.empty_like(temp_c)
    at = float(temp_c[0]) - start * half_c
    for i, temp in enumerate(temp_c.tolist()):
        at = min(max(at, temp - half_c), temp + half_c)
        out[i] = at
    return out


def _both_ways_c(runs: Sequence[Run]) -> float:
    """The largest rise of the temperature within a power cycle, or the largest fall within one, if that is smaller, degC."""
    courses = [_course_c(r) for r in runs if r.temp_c is not None]
    rise = max((float((c - np.minimum.accumulate(c)).max()) for c in courses), default=0.0)
    fall = max((float((np.maximum.accumulate(c) - c).max()) for c in courses), default=0.0)
    return min(rise, fall)
