"""Linear drift of the bias within a power cycle."""

from __future__ import annotations

from collections.abc import Mapping

from gyrocal.effects.base import Case, Effect, Law, Parameter, elapsed_s, stack
from gyrocal.effects.quantities import power_on_time_s
from gyrocal.recording.session import Array, Run


class Drift(Effect):
    id = "drift"
    title = "Drift of the bias"
    offered_as = "a drift of the bias"
    cause = (
        "The bias changes linearly from power-on, in the same way in each power cycle. Causes are slow charging of the sense "
        "electrodes, or a warm-up that takes much longer than the recording. Noise also wanders, but "
        "differently each time."
    )
    equation = "k_dps_per_s·p"
    looks_like = (
        "warmup (decays, whereas drift continues); bias_temperature while the part warms up; colored_noise in a "
        "single run"
    )
    measure_next = "one run at rest of ten minutes or more from power-on: a warm-up flattens, a drift does not"
    parameters = (
        Parameter(
            "k_dps_per_s", "dps/s", (2e-5, 1e-3), "consumer MEMS gyroscopes: 5-50 mdps over the first minutes", 2e-4
        ),
    )
    linear = ("k_dps_per_s",)
    origin_free = True
    on_device = True
    law = Law({"k_dps_per_s": 2e-4}, "2e-4*power_on_s")
    cases = (Case({"k_dps_per_s": 4e-4}, ("k_dps_per_s",)),)

    def lacks(self, run: Run) -> bool:
        return run.power_on_s is None

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        p_s = power_on_time_s(run)
        return stack(elapsed_s(run) if p_s is None else p_s)
