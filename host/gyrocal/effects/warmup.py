"""Settling of the bias after power-on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import AtSample, Case, Effect, Law, OneCycle, Parameter, Values, stack
from gyrocal.effects.mistaken import settling_scale
from gyrocal.effects.optional import CourseWithoutData
from gyrocal.effects.quantities import cycle_time_s, power_on_time_s, turns
from gyrocal.parameter import POSITIVE
from gyrocal.recording.session import Array, Run

SEARCH_S = (3.0, 200.0)
"""Range of the time constant, s. Settling that is slower than the thermal time of any package is called drift."""


class Warmup(Effect, CourseWithoutData):
    id = "warmup"
    title = "Warm-up after power-on"
    cause = (
        "After power-on the part heats itself, and its drive loop and charges settle, so the bias approaches its "
        "final value over tens of seconds to minutes. The settling starts again with each power cycle, at any rate of "
        "the table and also at rest."
    )
    equation = "A_dps·exp(-p/tau_s)"
    requires = ("power_on_s",)
    looks_like = (
        "spin_up (an effect of the table, which changes its sign with the rate and vanishes at rest); drift, if tau_s "
        "is long; bias_temperature, if the thermometer shows the same warming"
    )
    measure_next = (
        "wait two minutes after power-on before the first run, or leave the part at rest from power-on for five minutes"
    )
    one_cycle = OneCycle(
        "In the only power cycle of this session the bias approaches a final value, which does not tell whether it does so "
        "after each power-on. A warm-up has the same A_dps and tau_s in a second power cycle, and noise that wanders has not.",
        "the same runs in a second power cycle: A_dps and tau_s are the same again if each power-on causes the settling",
    )
    parameters = (
        Parameter("A_dps", "dps", (0.005, 0.05), "consumer MEMS gyroscopes, the first minutes after power-on", 0.03),
        Parameter(
            "tau_s", "s", (10.0, 120.0), "thermal time constants of package and board", 20.0, POSITIVE,
            search=SEARCH_S, sized=False,
        ),
    )
    linear = ("A_dps",)
    nonlinear = ("tau_s",)
    on_device = True
    offered_as = "a slow warm-up"
    law = Law({"A_dps": 0.03, "tau_s": 12.0}, "0.03*exp(-power_on_s/12)")
    cases = (Case({"A_dps": 0.05, "tau_s": 15.0}, ("A_dps", "tau_s")),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        known = any(r.power_on_s is not None for r in runs)
        return None if known else "power_on_s (from power-on to the first sample) of the runs in session.toml"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        return [{"A_dps": 0.0, "tau_s": float(tau_s)} for tau_s in np.geomspace(5.0, 160.0, 6)]

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """A scale that settles after power-on, which changes its sign with the rate and does nothing at rest."""
        return [settling_scale()] if turns(runs, axis) else []

    def unmeasured(self, run: Run, axis: int) -> Array | None:
        """The slowest of the typical ones, shape [n], without the pauses between runs of a cycle: it is most like a drift."""
        return np.exp(-cycle_time_s(run) / self.parameter("tau_s").typical[1])

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        p_s = power_on_time_s(run)
        return stack(np.zeros(len(run)) if p_s is None else np.exp(-p_s / values["tau_s"]))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        size_dps, tau_s = values["A_dps"], values["tau_s"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: size_dps * math.e ** (-power_on_s / tau_s)  # of arrays too
