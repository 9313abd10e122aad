"""Dependence of the bias on temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gyrocal.effects.base import AtSample, Case, Effect, Law, Parameter, Values, stack
from gyrocal.effects.optional import CourseWithoutData
from gyrocal.effects.quantities import MOVING_TEMPERATURE, REFERENCE_C, temperature_moves, temperature_noise, warming_c
from gyrocal.recording.session import Array, Run

POWERS = {"k1_dps_per_c": 1, "k2_dps_per_c2": 2, "k3_dps_per_c3": 3}


class BiasTemperature(Effect, CourseWithoutData):
    id = "bias_temperature"
    title = "Bias over temperature"
    cause = (
        "Silicon, glue and board expand differently, and the amplifiers' offsets drift, so the bias follows the "
        "temperature of the die: along a line over a few degrees, along a curve over tens. A part that warms by 5 "
        "°C after power-on, or is calibrated in a cooler room than it is used in, reads a rate that is not "
        "there."
    )
    equation = "k1_dps_per_c·(T-25) + k2_dps_per_c2·(T-25)^2 + k3_dps_per_c3·(T-25)^3"
    requires = ("temp_c",)
    looks_like = (
        "warmup and drift, if the part warms up in the same way after each power-on; turn_on_bias, if the "
        "room differs"
    )
    measure_next = (
        "the part at rest over a wide range of temperature, warming and cooling, because only the temperature returns to "
        "its earlier value"
    )
    parameters = (
        Parameter("k1_dps_per_c", "dps/degC", (0.001, 0.03), "LSM6DSO datasheet, table 2: +-0.010 dps/°C", 0.01),
        Parameter("k2_dps_per_c2", "dps/degC^2", (1e-5, 1e-3), "as much as k1 at 30-100 °C from 25", 0.0),
        Parameter("k3_dps_per_c3", "dps/degC^3", (1e-7, 1e-5), "as much as k2 at 100 °C from 25", 0.0),
    )
    linear = tuple(POWERS)
    origin_free = True
    on_device, device_columns = True, POWERS
    law = Law(
        {"k1_dps_per_c": 0.01, "k2_dps_per_c2": -3e-4, "k3_dps_per_c3": 2e-6},
        "(temp_c - 25)*(0.01 + (temp_c - 25)*(-3e-4 + (temp_c - 25)*2e-6))",
    )
    cases = (Case({"k1_dps_per_c": 0.01}, ("k1_dps_per_c",)),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if temperature_moves(runs) else MOVING_TEMPERATURE

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        return [dict.fromkeys(self.linear[:order], 0.0) for order in (1, 2, 3)]

    def unmeasured(self, run: Run, axis: int) -> Array | None:
        """The temperature [n] about its mean: it hardly moves, but with a large coefficient the readings may follow it.

        Between the runs, the spread of the bias from one power cycle to the next hides it.
        """
        return None if run.temp_c is None else run.temp_c - float(np.mean(run.temp_c))

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        above_c = warming_c(run)
        return stack(*(above_c ** POWERS[name] for name in self.coding.used(values)))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        k1, k2, k3 = (values.get(name, 0.0) for name in POWERS)

        def term(rate_dps: Any, temp_c: Any, power_on_s: Any, acc_g: Any) -> Any:
            above_c = temp_c - REFERENCE_C
            return above_c * (k1 + above_c * (k2 + above_c * k3))

        return term

    def noise(self, run: Run, axis: int, values: Mapping[str, float], samples: float) -> tuple[Array, float] | None:
        found, above_c = temperature_noise(run, samples), warming_c(run)
        if found is None:
            return None
        slopes = (POWERS[name] * above_c ** (POWERS[name] - 1) for name in self.coding.used(values))
        return stack(*(found[0] * slope**2 for slope in slopes)), found[1]
