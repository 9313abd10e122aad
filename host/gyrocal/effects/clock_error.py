"""Rate error of the recorder's clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import Effect, Law, Parameter, elapsed_s, stack
from gyrocal.effects.quantities import VARYING_RATE, rate_slope_dps_s, rate_varies
from gyrocal.recording.session import Array, Run


class ClockError(Effect):
    id = "clock_error"
    title = "Error of the clock"
    cause = (
        "The clock that stamps the samples runs fast or slow compared with the table's clock, so the reading and the "
        "reference drift apart during a run. If time is computed by counting samples, the clock is the chip's own "
        "oscillator, which may be wrong by a percent. The error does not show at a constant rate, but an angle "
        "integrated with that clock is wrong."
    )
    equation = "e·t·dw/dt"
    uncorrected = "it belongs to the clock of the recorder; correct the times of the recording"
    looks_like = "lag (constant over the run); scale, if only the net angle of a turn is known"
    measure_next = (
        "swing the table for some minutes and record its encoder as rate_ref_dps, or compare the recorder's clock with "
        "a watch over an hour"
    )
    parameters = (
        Parameter("e", "fraction", (2e-5, 0.02), "crystals +-20 ppm; MEMS gyroscopes' own oscillators +-1-2 %", 0.001),
    )
    linear = ("e",)
    law = Law({"e": 0.001}, None, degree=1)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if rate_varies(runs, axis) else VARYING_RATE

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(elapsed_s(run) * rate_slope_dps_s(run, axis))
