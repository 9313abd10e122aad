"""Delay of the reading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import Effect, Law, Parameter, stack
from gyrocal.effects.quantities import VARYING_RATE, rate_slope_dps_s, rate_varies
from gyrocal.recording.session import Array, Run


class Lag(Effect):
    id = "lag"
    title = "Lag of the reading"
    cause = (
        "The chip's low-pass filter, the wait until the chip is polled and the transport each delay the reading by "
        "milliseconds, and the reference's clock may have an offset. The reading lags behind a changing rate. A "
        "constant rate does not show the delay. If the rate changes slowly compared with tau_s, a delay and a "
        "first-order lag are equivalent."
    )
    equation = "-tau_s·dw/dt"
    uncorrected = "undoing a low-pass would amplify the noise; shift the times by tau_s instead"
    looks_like = "clock_error within a short run (it grows with time, a lag does not)"
    measure_next = "swing the table, or start and stop it, for a minute, and record its encoder as rate_ref_dps"
    parameters = (
        Parameter(
            "tau_s",
            "s",
            (0.0005, 0.02),
            "LSM6DSO datasheet: low-pass of 33-136 Hz is 1-5 ms, and polling at 145 Hz up to 7 ms",
            0.005,
            sized=False,
        ),
    )
    linear = ("tau_s",)
    law = Law({"tau_s": 0.004}, None, degree=1)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if rate_varies(runs, axis) else VARYING_RATE

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(-rate_slope_dps_s(run, axis))
