"""Dependence of the bias on the rate of change of the temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Case, Effect, Law, Parameter, stack
from gyrocal.effects.quantities import TEMPERATURE_WINDOW_S, temperature_by_second, temperature_slope_c_s
from gyrocal.recording.session import Array, Run

LEAST_CHANGE_C = 0.2


class ThermalLag(Effect):
    id = "thermal_lag"
    title = "Thermal lag"
    offered_as = "a bias that follows changes of temperature"
    cause = (
        "While the part warms or cools, the vibrating mass, the package and the thermometer are at different "
        "temperatures, and the gradient between them bends the structure. The bias at 40 °C differs between "
        "warming and cooling. This loop (hysteresis) cannot be removed by a curve over temperature."
    )
    equation = "k_dps_s_per_c·dT/dt"
    requires = ("temp_c",)
    looks_like = (
        "warmup, if the part is only recorded while it warms up after power-on; bias_temperature, if it only warms or cools"
    )
    measure_next = (
        "heat the part and let it cool within one run, so that the slope changes its sign and the temperature returns"
    )
    parameters = (
        Parameter(
            "k_dps_s_per_c",
            "dps·s/degC",
            (0.05, 1.0),
            "0.010 dps/°C times 5-100 s that the thermometer is ahead or behind",
            1.0,
        ),
    )
    linear = ("k_dps_s_per_c",)
    law = Law({"k_dps_s_per_c": 0.4}, None)
    cases = (Case({"k_dps_s_per_c": 2.0}, ("k_dps_s_per_c",)),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        measured = [r for r in runs if r.temp_c is not None and r.duration_s >= TEMPERATURE_WINDOW_S]
        if any(np.ptp(temperature_by_second(r)[1]) >= LEAST_CHANGE_C for r in measured):
            return None
        return "a run of 10 s or more in which the temp_c column moves by 0.2 °C or more"

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(temperature_slope_c_s(run))
