"""Dependence of the scale on temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import AtSample, Case, Effect, Law, Parameter, Role, stack
from gyrocal.effects.quantities import (
    MOVING_TEMPERATURE,
    REFERENCE_C,
    TURNING_OR_TURNED,
    rate_about,
    temperature_moves,
    temperature_noise,
    turned,
    turns,
    warming_c,
)
from gyrocal.recording.session import Array, Run


class ScaleTemperature(Effect):
    id = "scale_temperature"
    title = "Scale over temperature"
    cause = (
        "The springs of the vibrating mass soften with temperature, and the drive's amplitude and the reference "
        "voltage change too, so the sensitivity depends on the temperature. The error is proportional to the rate "
        "and vanishes at rest."
    )
    equation = "k_per_c·(T-25)·w"
    requires = ("temp_c",)
    looks_like = (
        "spin_up, if the part warms up in the same way in each run; scale, if the temperature hardly changes"
    )
    measure_next = "the same rate at two temperatures (a room and a fridge), in both directions"
    parameters = (Parameter("k_per_c", "1/degC", (1e-5, 3e-4), "LSM6DSO datasheet, table 2: +-0.007 %/°C", 7e-5),)
    linear = ("k_per_c",)
    origin_free = True
    stands_for = Role.SCALE
    on_device = True
    law = Law({"k_per_c": 7e-5}, "7e-5*(temp_c - 25)*rate", degree=1)
    cases = (Case({"k_per_c": 7e-5}, ("k_per_c",)),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        if not turns(runs, axis) and not turned(runs, axis):
            return TURNING_OR_TURNED
        return None if temperature_moves(runs) else MOVING_TEMPERATURE

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(warming_c(run) * rate_about(run, axis))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        k = values["k_per_c"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: k * (temp_c - REFERENCE_C) * rate_dps

    def noise(self, run: Run, axis: int, values: Mapping[str, float], samples: float) -> tuple[Array, float] | None:
        found = temperature_noise(run, samples)
        return None if found is None else (stack(found[0] * rate_about(run, axis) ** 2), found[1])
