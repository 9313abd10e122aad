"""Linear drift of the bias within a power cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import AtSample, Case, Effect, Law, OneCycle, Parameter, stack
from gyrocal.effects.mistaken import settling_bias
from gyrocal.effects.quantities import cycle_time_s
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
    one_cycle = OneCycle(
        "In the only power cycle of this session the bias changes linearly with time, which does not tell whether it does so "
        "in each: noise wanders too, but differently each time. A drift has the same k_dps_per_s in a second power cycle.",
        "the same runs in a second power cycle: k_dps_per_s is the same again if the bias drifts in each",
    )
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
        """Without the time since power-on, the pauses between runs are unknown: a drift can be removed then, but not shown."""
        return run.power_on_s is None

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """A warm-up, which is no candidate where the time of power-on is not known."""
        return [] if any(r.power_on_s is not None for r in runs) else [settling_bias()]

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(cycle_time_s(run))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        k = values["k_dps_per_s"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: k * power_on_s
