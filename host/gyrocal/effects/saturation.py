"""Clipping of rates beyond the sensor's full scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gyrocal import tails
from gyrocal.effects.base import Mask, Parameter
from gyrocal.effects.quantities import grid_dps
from gyrocal.effects.reading_fault import Detected, ReadingFault
from gyrocal.noise.sample import white_sd_dps
from gyrocal.parameter import POSITIVE
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run

BELOW = 2.0
"""Width of the examined range below the largest reading, in standard deviations of the noise."""
ROUNDING_DPS = 1e-6
"""Values closer than this are equal, deg/s."""
LEAST_HEAPED, MOST_HEAPED = 10, 0.8
"""Fewest readings at the limit, and the largest fraction. Where nearly all are there, nothing below shows the noise."""
SHOWN = 1e-4
"""Probability under noise above which a heap is no clipping."""
COARSE = 0.5
"""Noise in counts below which the readings of a run may all be equal."""
END = 0.02
"""Readings within this fraction of the largest one are at the end of a range whose readings were corrected afterwards."""
BEYOND = 1.05
"""The true rate of such readings exceeds the largest one by this factor; a working scale is not so small."""


def _below(size: Array, low: float, high: float) -> Mask:
    """Mask [n] of sizes from ``low`` to just below ``high``, deg/s."""
    return np.asarray((size > low - ROUNDING_DPS) & (size < high - ROUNDING_DPS))


def _stays(readings: Array) -> tuple[Array, NDArray[np.intp]]:
    """The values [m] at which readings [n] stay, one after the other, and the number of samples [m] for which they do."""
    first = np.flatnonzero(np.diff(readings, prepend=np.nan) != 0)
    return readings[first], np.diff(first, append=readings.size)


def _chance(stays: NDArray[np.intp], others: NDArray[np.intp]) -> float:
    """Probability of stays [m] at one value, if their lengths are geometric with the longest of the ``others`` as mean."""
    again = 1 - 1 / (int(others.max()) + 1)
    return float(again ** int(stays.sum() - stays.size))


def _dwells(size: Array, low: float, high: float) -> int:
    """Number of times that sizes [n] come to a value in a range; staying at it does not count again."""
    values, _ = _stays(size)
    return int(np.count_nonzero(_below(values, low, high)))


def _mean_dwell(sizes: Sequence[Array], low: float, high: float) -> float:
    """Mean number of samples for which sizes [n] stay at a value in a range."""
    samples = sum(int(np.count_nonzero(_below(size, low, high))) for size in sizes)
    return max(1.0, samples / max(1, sum(_dwells(size, low, high) for size in sizes)))


def _slope(runs: Sequence[Run], axis: int, most_dps: float) -> float:
    """The part of the true rate that readings show of rates of at most ``most_dps``, [0, 1]."""
    if not runs:
        return 1.0
    read, true = (np.concatenate(of) for of in ([r.gyro_dps[:, axis] for r in runs], [r.rate_dps for r in runs]))
    small = np.abs(true) < most_dps
    power = float(true[small] @ true[small])
    return float(np.clip(true[small] @ read[small] / power, 0.0, 1.0)) if power > 0 else 1.0


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
            "full_scale_dps", "dps", (125.0, 2000.0), "LSM6DSO datasheet, table 2: ranges of 125-2000 dps", 125.0, POSITIVE
        ),
    )

    clips = True

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Detect readings that heap up at the largest value, or stay near it while the true rate goes on."""
        at_one_value = (method(runs, axis) for method in (self._heap, self._stay, self.constant))
        shown = [found for found in at_one_value if found is not None and found.chance < SHOWN]
        if shown:
            return min(shown, key=lambda found: found.chance)
        near = self._plateau(runs, axis)
        return near if near is not None and near.chance < SHOWN else None

    def _heap(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """More readings at exactly the largest value than the values below it predict.

        The density of noise near its end is log-concave, so an exponential through two bands below the largest value is an
        upper bound for the count at that value. Slow noise dwells at a value: every dwell counts once.
        """
        step_dps = float(max(r.step_dps[axis] for r in runs)) or grid_dps([r.gyro_dps[:, axis] for r in runs])
        white_dps = white_sd_dps(runs, axis)
        half = max(1, round(BELOW * white_dps / step_dps / 2))  # counts in each of the two bands
        sizes = [np.abs(r.gyro_dps[:, axis]) for r in runs]
        count_dps = min((float(r.step_dps[axis]) for r in runs if r.step_dps[axis] > 0), default=np.inf)
        if white_dps < COARSE * count_dps:  # a run that stands at one or two counts shows no noise below them
            sizes = [size for size in sizes if np.ptp(size) > 1.5 * count_dps]
        limit = max((float(size.max()) for size in sizes), default=0.0)
        heaped = sum(int(np.count_nonzero(size > limit - ROUNDING_DPS)) for size in sizes)
        if heaped < LEAST_HEAPED or heaped > MOST_HEAPED * sum(size.size for size in sizes):
            return None
        # edges between codes: a log's last digit moves readings about their codes
        edges = [limit - (k * half + 0.5) * step_dps for k in range(3)]
        near, far = (sum(_dwells(size, low, high) for size in sizes) for high, low in pairwise(edges))
        slope = (half + 1) / (2 * half)  # distance of the limit from the nearer band, over the distance of the bands
        expected = np.log((near + 0.5) / half) + slope * np.log((near + 0.5) / (far + 0.5))
        variance = (1 + slope) ** 2 / (near + 0.5) + slope**2 / (far + 0.5)
        dwell = _mean_dwell(sizes, edges[-1], edges[0])
        counted = heaped / dwell
        chance = float(tails.normal((np.log(counted) - expected) / np.sqrt(variance + 1 / counted)))
        return Detected({"full_scale_dps": limit}, {}, chance)

    def _stay(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Readings that stay at exactly the largest value much longer than noise lets them stay at any other.

        A table that holds its fastest rate comes there once and stays, so that the number of dwells tells nothing.
        """
        step_dps = max(max(float(r.step_dps[axis]) for r in runs), grid_dps([r.gyro_dps[:, axis] for r in runs]))
        if white_sd_dps(runs, axis) < step_dps:  # between two codes, a sound reading may stay at one as well
            return None
        limit = max((float(np.abs(r.gyro_dps[:, axis]).max()) for r in runs), default=0.0)
        values, samples = map(np.concatenate, zip(*(_stays(r.gyro_dps[:, axis]) for r in runs), strict=True))
        there = np.abs(values) > limit - ROUNDING_DPS
        if samples[there].sum() < LEAST_HEAPED or there.all():
            return None
        return Detected({"full_scale_dps": limit}, {}, _chance(samples[there], samples[~there]))

    def constant(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Runs that never leave the largest value, where a line through the other runs predicts far more.

        If the rate is so far beyond the range that all noise is clipped, no reading lies just below the largest value. By
        chance, a run stays at one value as long as a geometric distribution says whose mean is the longest stay in other runs.
        Other runs of a single rate tell the bias alone, beside which the smallest scale of a working sensor is assumed.
        """
        mine = [r for r in (r.about(AXES[axis]) for r in runs) if r.axis_index == axis and not r.rate_is_mean]
        limit = max((float(np.abs(r.gyro_dps[:, axis]).max()) for r in mine), default=0.0)
        limited = [bool(np.all(np.abs(r.gyro_dps[:, axis]) > limit - ROUNDING_DPS)) for r in mine]
        others = [r for r, at in zip(mine, limited, strict=True) if not at]
        rates = np.array([float(np.mean(r.rate_dps)) for r in others])
        if not rates.size or not np.all(np.isfinite(rates)):
            return None
        means = np.array([float(np.mean(r.gyro_dps[:, axis])) for r in others])
        line = np.polynomial.Polynomial([float(np.mean(means - rates)), 1 - POLICY.largest_scale])
        if np.ptp(rates) > END * limit:
            line = np.polynomial.Polynomial.fit(rates, means, 1)
        beyond = [len(r) for r, at in zip(mine, limited, strict=True)
                  if at and abs(float(line(float(np.mean(r.rate_dps))))) > BEYOND * limit]  # fmt: skip
        if sum(beyond) < LEAST_HEAPED:
            return None
        elsewhere = np.concatenate([_stays(r.gyro_dps[:, axis])[1] for r in others])
        return Detected({"full_scale_dps": limit}, {}, _chance(np.array(beyond), elsewhere))

    def _plateau(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Readings that stay near the largest one, in either sense, while the measured rate would make them far larger.

        A reading that is corrected or filtered after it was clipped differs from sample to sample, and the two ends differ. A
        sound reading would spread over the range of the true rates of these samples. It stays in the narrow range near the
        largest reading with a probability of less than the ratio of both ranges, for each time that it comes there. Slower
        rates tell what is read of a rate, because the reference may be of another unit, or of another motion.
        """
        mine = [r.about(AXES[axis]) for r in runs if r.measured_rates is not None and (r.three_axes or r.axis_index == axis)]
        ends, chance = [], 1.0
        for sign in (1.0, -1.0):
            y = [sign * r.gyro_dps[:, axis] for r in mine]
            limit = max((float(v.max()) for v in y), default=0.0) * (1 - END)
            at = [v > limit for v in y]
            read = sign * _slope(mine, axis, 0.5 * limit)
            rates = [read * r.rate_dps[a] for r, a in zip(mine, at, strict=True)]
            true_dps = np.concatenate(rates) if rates else np.zeros(0)
            true_dps = true_dps[np.isfinite(true_dps)]
            # slopes of a coarse angle jump between two values, whose mean is the rate; a lost tracker pulls the mean alone
            if true_dps.size < LEAST_HEAPED or min(np.median(true_dps), np.mean(true_dps)) < BEYOND * limit / (1 - END):
                continue
            low, high = np.quantile(true_dps, (0.1, 0.9))
            came = sum(int(np.count_nonzero(np.diff(a, prepend=False) & a)) for a in at)
            ends.append(limit)
            chance *= float(min(1.0, END * limit / max(high - low, 1e-300))) ** came
        return Detected({"full_scale_dps": min(ends)}, {}, chance) if ends else None

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
