"""Repeated, dropped or late samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Mask, Parameter
from gyrocal.effects.dead_band import outliers_of
from gyrocal.effects.quantities import reading_error_dps
from gyrocal.effects.quantization import coarse_step_dps
from gyrocal.effects.reading_fault import Detected, ReadingFault
from gyrocal.effects.single_bits import count_dps_of
from gyrocal.recording.session import Array, Run


def stale(run: Run, apart: int = 1) -> Mask:
    """Mask of samples, ``apart`` from each other, that are equal on all three axes, shape [n - apart]."""
    same: Mask = (run.gyro_dps[apart:] == run.gyro_dps[:-apart]).all(axis=1)
    return same


def _volume(runs: Sequence[Run], apart: int) -> float:
    """Generalised standard deviation, (deg/s)^3, of the differences of samples, without what rounding to counts adds."""
    differences = np.concatenate([r.gyro_dps[apart:] - r.gyro_dps[:-apart] for r in runs])
    covariance = differences.T @ differences / max(1, len(differences))
    rounding = np.minimum(max(np.max(r.step_dps) for r in runs) ** 2 / 6, 0.9 * np.diag(covariance))
    return float(np.sqrt(max(0.0, np.linalg.det(covariance - np.diag(rounding)))))


def _by_chance(runs: Sequence[Run], equal: int) -> float:
    """The probability of so many equal neighbours where their differences in counts have a smooth distribution.

    Neighbours differ in none, in one or in two axes by one count in 1, 6 and 12 ways. The frequency of a way falls with the
    square of the difference, and from none to one at most as it does from one to two. Coarser steps of an axis count as counts.
    """
    coarse_dps = [coarse_step_dps(runs, axis) for axis in range(3)]
    squares = [
        np.sum(np.rint(np.diff(r.gyro_dps, axis=0) / np.maximum(coarse_dps, count_dps)) ** 2, axis=1)
        for r in runs
        if np.isfinite(count_dps := count_dps_of([r], r.axis_index))
    ]
    one, two = (sum(int(np.count_nonzero(s == k)) for s in squares) for k in (1, 2))
    ratio = max(1.0, (one / 6) / (max(two, 0.5) / 12))  # none of two may be half of one by chance
    return float(tails.binomial(equal, equal + one + 1, ratio / (6 + ratio)))


def _stand_out(runs: Sequence[Run], axis: int, fraction: float) -> float:
    """The probability that so many of the readings that stand out are repeated, as ``fraction`` of all readings are."""
    known = [(run, outliers_of(run, axis, reading_error_dps(run, axis))[0]) for run in runs if not run.rate_is_mean]
    repeated = sum(int(np.count_nonzero(stale(run)[rows[rows > 0] - 1])) for run, rows in known)
    return float(tails.binomial(repeated, sum(rows.size for _, rows in known), fraction)) if repeated > 1 else 1.0


def _repeated(neighbours: float, two_apart: float, alike: float) -> float:
    """The fraction of repeated samples from those of equal samples at either distance, of which some are equal by chance.

    Samples two apart are equal because both are repeated, or by chance. Chance makes neighbours equal ``alike`` times as often.
    """
    fraction = neighbours
    for _ in range(5):
        by_chance = min(alike * max(0.0, two_apart - fraction**2) / (1 - fraction**2 + 1e-300), neighbours)
        fraction = (neighbours - by_chance) / (1 - by_chance + 1e-300)
    return fraction


class SamplingFault(ReadingFault):
    id = "sampling_fault"
    title = "Repeated or lost samples"
    offered_as = "repeated samples"
    cause = (
        "The host reads before the chip has a new sample and gets the old one again on all axes, or it reads "
        "too late and loses one. A busy bus or a blocked task has the same result. The noise of neighbours is then "
        "not independent, and standard errors that count samples are too small."
    )
    equation = "y(i) = y(i-1) for a fraction of the samples"
    looks_like = (
        "a low-pass filter, which makes neighbours similar but not equal; quantization, where equal neighbours "
        "are common on one axis"
    )
    measure_next = "record the chip's data-ready flag or use its FIFO, and count neighbours that are equal on all three axes"
    parameters = (Parameter("fraction", "fraction", (0.001, 0.1), "hosts that poll by their own timer", 0.05),)

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Detect more neighbours that are equal on all three axes than samples two apart.

        Coarse counts and axes that share noise make readings equal at either distance. A low-pass filter makes neighbours more
        alike; then equal ones are more frequent by the ratio of the generalised standard deviations of the differences. Where
        the counts are so coarse that chance makes equal neighbours, neighbours that differ by a count are about as frequent.
        Few repeated samples are certain as well where the rate moves, because they stand out.
        """
        pairs = sum(len(r) - 1 for r in runs)
        equal = sum(int(np.count_nonzero(stale(r))) for r in runs)
        apart = sum(int(np.count_nonzero(stale(r, 2))) for r in runs)
        alike = max(1.0, _volume(runs, 2) / max(_volume(runs, 1), 1e-300))
        # of Poisson counts with this ratio of means, the share of one in their sum is binomial
        chance = float(tails.binomial(equal, equal + apart + 1, alike / (1 + alike)))
        chance = min(max(chance, _by_chance(runs, equal)), _stand_out(runs, axis, equal / pairs))
        if chance > 1e-4:
            return None
        neighbours = equal / pairs
        fraction = _repeated(neighbours, apart / pairs, alike)
        return Detected({"fraction": fraction}, {"fraction": float(np.sqrt(neighbours * (1 - neighbours) / pairs))}, chance)

    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        """Readings [n], deg/s. A stale reading equals the previous reading including its noise."""
        out = modelled_dps.copy()
        old = np.flatnonzero(stale(run))
        out[old + 1] = run.gyro_dps[old, axis]
        return out

    @staticmethod
    def late_samples(values: Mapping[str, float]) -> float:
        """The mean age of a reading in samples: after a repeated one, the next is repeated with the same probability."""
        return values["fraction"] / (1 - values["fraction"])

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """Readings [n, 3] with this fault, deg/s. A stale sample repeats the last fresh one on all axes."""
        stale = rng.random(len(run)) < values["fraction"]
        stale[0] = False
        fresh = np.maximum.accumulate(np.where(stale, 0, np.arange(len(run))))
        return y_dps[fresh]
