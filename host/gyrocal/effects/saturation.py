"""Clipping of rates beyond the sensor's full scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Mask, Parameter
from gyrocal.effects.quantities import white_sd_dps
from gyrocal.effects.reading_fault import Detected, ReadingFault
from gyrocal.recording.session import Array, Run

BELOW = 3.0
"""Width of the examined range below the largest reading, in standard deviations of the noise."""


class Saturation(ReadingFault):
    id = "saturation"
    title = "Clipping at full scale"
    cause = (
        "The rate with its noise and vibration exceeds the range of the chip, and the reading stays at the limit. "
        "Near the limit only the peaks are cut, so the mean is slightly too small. This looks like a scale error of "
        "the fastest run alone."
    )
    equation = "min(max(y, -full_scale_dps), full_scale_dps) - y"
    looks_like = "scale_nonlinearity, which bends gradually from the middle of the range"
    measure_next = "the same rate at the next larger range of the chip"
    parameters = (
        Parameter(
            "full_scale_dps", "dps", (125.0, 2000.0), "LSM6DSO datasheet, table 2: ranges of 125-2000 dps", 125.0
        ),
    )

    clips = True

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Detect more readings at exactly the largest value than noise would produce."""
        readings = np.concatenate([r.gyro_dps[:, axis] for r in runs])
        size = np.abs(readings)
        limit = float(size.max())
        heaped = int(np.count_nonzero(size > limit - 1e-6))
        below = int(np.count_nonzero(size > limit - BELOW * white_sd_dps(runs, axis))) - heaped
        # noise leaves only one or two of the readings near the largest value at exactly that value
        if heaped < 10 or heaped <= below / 2 or heaped > 0.8 * readings.size:
            return None
        return Detected({"full_scale_dps": limit}, {}, float(np.exp(-min(heaped, 500))))

    def usable(self, run: Run, axis: int, values: Mapping[str, float]) -> Mask | None:
        return np.abs(run.gyro_dps[:, axis]) < values["full_scale_dps"] - 1e-6

    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        """The mean of a Gaussian reading that is clipped at both limits, shape [n], deg/s."""
        from scipy.stats import norm

        limit = values["full_scale_dps"]
        high, low = (limit - modelled_dps) / white_sd_dps, (-limit - modelled_dps) / white_sd_dps
        inside = modelled_dps * (norm.cdf(high) - norm.cdf(low)) - white_sd_dps * (norm.pdf(high) - norm.pdf(low))
        return np.asarray(inside + limit * norm.sf(high) - limit * norm.cdf(low))

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """The readings [n, 3] with this fault, deg/s."""
        return np.clip(y_dps, -values["full_scale_dps"], values["full_scale_dps"])
