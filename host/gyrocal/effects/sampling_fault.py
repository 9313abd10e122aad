"""Samples that are repeated, dropped or late."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter
from gyrocal.session import Array, Run


class SamplingFault(Effect):
    id = "sampling_fault"
    title = "Repeated or lost samples"
    cause = (
        "The host asks for data before the chip has a new sample and gets the old one again on all axes, or comes "
        "too late and loses one; a busy bus or a blocked task does the same. Noise between neighbours is then no "
        "longer independent, and standard errors that count samples are too small."
    )
    equation = "y(i) = y(i-1) for a fraction of the samples"
    looks_like = (
        "a low-pass filter, which makes neighbours alike but never equal; quantization, where equal neighbours "
        "are common on one axis"
    )
    measure_next = (
        "record the chip's data-ready flag or use its FIFO; count neighbours that are equal on all three axes"
    )
    parameters = (Parameter("fraction", "fraction", (0.001, 0.1), "hosts that poll by their own timer", 0.05),)

    def axes(self, run: Run) -> tuple[int, ...]:
        return (0, 1, 2)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """The readings [n, 3] with this fault, deg/s: a stale sample is the last fresh one, on all axes at once."""
        stale = rng.random(len(run)) < values["fraction"]
        stale[0] = False
        fresh = np.maximum.accumulate(np.where(stale, 0, np.arange(len(run))))
        return y_dps[fresh]
