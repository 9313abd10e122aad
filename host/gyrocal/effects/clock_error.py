"""Rate error of the recorder's clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from gyrocal.effects.base import Law, Parameter
from gyrocal.effects.timing import TimingEffect
from gyrocal.recording.session import Array
from gyrocal.recording.timing import Motion, Timing

CLOCK_SE = 1e-4
"""Standard error of the sample clock, a fraction: crystals are good to 20-100 ppm."""


class ClockError(TimingEffect):
    id = "clock_error"
    title = "Error of the clock"
    cause = (
        "The clock that stamps the samples runs fast or slow compared with the table's clock, so the reading and the "
        "reference drift apart during a run. If time is computed by counting samples, the clock is the chip's own "
        "oscillator, which may be wrong by a percent. The error does not show at a constant rate, but an angle "
        "integrated with that clock is wrong."
    )
    equation = "w((1 + e)·t) - w(t)"
    uncorrected = "it belongs to the clock of the recorder; correct the times of the recording"
    looks_like = "lag (constant over the run); scale, if only the net angle of a turn is known"
    measure_next = (
        "swing the table for some minutes and record its encoder as rate_ref_dps, or compare the recorder's clock with "
        "a watch over an hour; if the reference was stamped by a clock of its own, import it with --ref-clock own"
    )
    parameters = (
        Parameter("e", "fraction", (2e-5, 0.02), "crystals +-20 ppm; MEMS gyroscopes' own oscillators +-1-2 %", 0.001),
    )
    linear = ("e",)
    of_recording = True
    law = Law({"e": 0.001}, None, degree=1)

    def set(self, timing: Timing, values: Mapping[str, float]) -> Timing:
        return replace(timing, clock=values.get("e", 0.0))

    def derivative(self, motion: Motion, t_s: Array, timing: Timing) -> Array:
        return motion.by_clock(t_s, timing)
