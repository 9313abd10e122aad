"""Single readings that are off by the value of one bit, or have a part of another sample: told from other outliers by their
sizes, sides and bits.

This file defines no effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal import tails
from gyrocal.effects.dead_band import outliers_of
from gyrocal.effects.quantities import grid_dps, rate_about
from gyrocal.effects.quantization import coarse_step_dps
from gyrocal.noise.sample import white_sd_dps
from gyrocal.recording.once import once
from gyrocal.recording.outliers import Index
from gyrocal.recording.session import Array, Run
from gyrocal.recording.torn import Codes

BITS = range(4, 15)
HALF = 0.5
"""Part of the low bits' range in which readings lie that have just carried."""
LEAST_SINGLE = 5
SIZE_WITHIN, TOLD_APART = 5.0, 20.0
"""Standard deviations of the noise by which an outlier may miss a bit's value, and that a bit's value must exceed unless the
low bits alone show the fault."""
WHOLE = 0.7
"""Mean cosine of the sizes of outliers, with a bit's value as the period, above which they are multiples of it. It is 0 for any
sizes, and 0.7 for multiples with errors of an eighth of the period."""
BY_CHANCE = 1e-4
"""Probability of the sizes or low bits of outliers of another cause, below which these show the fault."""
DOUBTED = 0.05
"""Such a probability below which outliers may be lost bits or carries, so that no other cause is sure."""
RMS_WITHIN = 2.0
"""Standard deviations of the noise by which outliers may miss a bit's value, rms. The noise itself makes 1.4."""
OCTAVE = 0.7
"""Range of the sizes to which a bit's value is nearest, over that value."""
MOST = 0.9
"""Part of the outliers that must have the size of one bit, or the upper part of a neighbour."""

Found = tuple[Run, Index, Array]
"""A run, the rows of its outliers [k], and their deviations [k], deg/s."""


def count_dps_of(runs: Sequence[Run], axis: int) -> float:
    """One count, deg/s: as the session says, else the grid of the readings; infinite if there is none."""
    stated = [r.lsb_dps for r in runs if r.lsb_dps]
    if not stated and not runs:
        return np.inf
    count_dps = min(stated) if stated else grid_dps([r.gyro_dps[:, axis] for r in runs])
    return count_dps if count_dps >= 1e-4 else np.inf


def noise_of(runs: Sequence[Run], axis: int) -> float:
    """Standard deviation of one sample's noise by the median of successive differences, which faults hardly change, deg/s.

    It is at least the noise of rounding to coarse steps.
    """
    return max(white_sd_dps(runs, axis), coarse_step_dps(runs, axis) / 12**0.5)


def single_power(runs: Sequence[Run], axis: int) -> tuple[int, int] | None:
    """The bit of whose value nearly all outliers are a multiple, and the number of outliers; None if they have no such size."""
    bit, number, chance = _single(runs, axis)
    return (bit, number) if chance < BY_CHANCE else None


def may_be_single_power(runs: Sequence[Run], axis: int) -> bool:
    """True if outliers look as if each lacked one bit or carry, although too few are there to be sure."""
    return _single(runs, axis)[2] < DOUBTED


@once
def _single(runs: Sequence[Run], axis: int) -> tuple[int, int, float]:
    """The bit that outliers show, the number of outliers, and the probability that those of another cause show one."""
    count_dps = count_dps_of(runs, axis)
    found = [(r, *apart_of(r, axis)) for r in runs]
    number = sum(rows.size for _, rows, _ in found)
    if not number or not np.isfinite(count_dps):
        return 0, number, 1.0
    noise = noise_of(runs, axis) / count_dps
    if number >= LEAST_SINGLE:
        tried = (
            _bit_without_carry(found, axis, count_dps, noise), _upper_part_of_another_sample(found, axis, count_dps),
            _lower_part_of_another_sample(found, axis, count_dps),
        )  # fmt: skip
        sure = next((bit for bit in tried if bit is not None), None)
        if sure is not None:
            return sure, number, 0.0
    bit, chance = _one_sided(found, axis, count_dps, noise)
    return bit, number, chance


def _bit_without_carry(found: Sequence[Found], axis: int, count_dps: float, noise: float) -> int | None:
    """The bit whose value nearly all outliers deviate by; ``noise`` in counts.

    Their low bits must also lie in one half of the range, as those of readings that have just carried do, and in the other half
    where the reading is too large: there it is the neighbours that lack the carry.
    """
    apart_dps = np.concatenate([apart for _, _, apart in found])
    sizes = np.abs(apart_dps) / count_dps
    bit = round(float(np.log2(np.median(sizes))))
    alike = np.abs(sizes - 2.0**bit) < max(1.0, SIZE_WITHIN * noise)
    if bit not in BITS or float(np.mean(alike)) < MOST:
        return None
    readings = np.concatenate([r.gyro_dps[rows, axis] for r, rows, _ in found])
    low = np.mod(np.rint(readings / count_dps), 2.0**bit) / 2.0**bit + 0.5 * (apart_dps > 0)
    in_half = max(float(np.mean(np.mod(low - start, 1.0) <= 0.5)) for start in low)
    certain = TOLD_APART * noise < 2.0**bit or low.size * _all_in_half(round(in_half * low.size), low.size) < BY_CHANCE
    return bit if in_half >= MOST and certain else None


def _one_sided(found: Sequence[Found], axis: int, count_dps: float, noise: float) -> tuple[int, float]:
    """The bit whose value nearly all outliers lack, or have too much, and the probability that those of another cause do.

    A carry or a bit is always lost to one side. Beside the side count the size, the bit's state in each run, and the half of
    the low bits' range in which they lie after a carry. ``noise`` in counts.
    """
    apart = np.concatenate([apart for _, _, apart in found]) / count_dps
    bit = round(float(np.log2(np.median(np.abs(apart)))))
    if bit not in BITS:
        return 0, 1.0
    above = bool(np.median(apart) > 0)
    alike = (np.abs(np.abs(apart) - 2.0**bit) < max(1.0, SIZE_WITHIN * noise)) & ((apart > 0) == above)
    error = max(1.0, RMS_WITHIN * noise)
    if float(np.mean(alike)) < MOST or float(np.sqrt(np.mean((np.abs(apart[alike]) - 2.0**bit) ** 2))) > error:
        return 0, 1.0
    codes = [codes_of(r, axis, count_dps)[rows] for r, rows, _ in found if rows.size]
    states = [float(np.mean((of_run >> bit & 1) == above)) for of_run in codes]
    low = np.mod(np.concatenate(codes), 2.0**bit) / 2.0**bit
    in_half = max(int(np.count_nonzero(np.mod(low - start, 1.0) <= HALF)) for start in low)
    by_state = 0.5 ** len(states) if min(states) >= MOST else 1.0
    by_half = min(1.0, low.size * _all_in_half(in_half, low.size))
    size = min(1.0, 2 * error / (OCTAVE * 2.0**bit))
    return bit, 2 * float(tails.binomial(int(np.count_nonzero(alike)), apart.size, 0.5)) * size * min(by_state, by_half)


def _lower_part_of_another_sample(found: Sequence[Found], axis: int, count_dps: float) -> int | None:
    """The bit below which outliers have the bits of the sample before, or of the one after; by chance, 2^-bit of them have.

    Those that are equal to it in all bits may be repeated.
    """
    inner = [(r, rows[keep]) for r, rows, _ in found for keep in [(rows > 0) & (rows < len(r) - 1)]]
    before, own, after = (
        np.concatenate([codes_of(r, axis, count_dps)[rows + shift] for r, rows in inner]) for shift in (-1, 0, 1)
    )
    for bit in (b for b in reversed(BITS) if own.size >= LEAST_SINGLE):
        for other in (before, after):
            equal, whole = (own ^ other) % 2**bit == 0, own == other
            differ = int(np.count_nonzero(equal & ~whole))
            by_chance = 2 * len(BITS) * float(tails.binomial(differ, int(np.count_nonzero(~whole)), 2.0**-bit))
            if float(np.mean(equal)) >= MOST and differ >= LEAST_SINGLE and by_chance < BY_CHANCE:
                return bit
    return None


def _upper_part_of_another_sample(found: Sequence[Found], axis: int, count_dps: float) -> int | None:
    """The lowest bit of an upper part that outliers have of the sample before, or of the one after.

    Where the rate moves by more than the lower part from sample to sample, they deviate by any multiple of the bit's value, and
    their low bits are anywhere. Outliers of another cause have neither such sizes nor the upper part of a neighbour.
    """
    inner = [(r, rows[keep], apart[keep]) for r, rows, apart in found for keep in [(rows > 0) & (rows < len(r) - 1)]]
    sizes = np.concatenate([apart for _, _, apart in inner]) / count_dps
    before, own, after = (
        np.concatenate([codes_of(r, axis, count_dps)[rows + shift] for r, rows, _ in inner]) for shift in (-1, 0, 1)
    )
    for bit in (b for b in reversed(BITS) if sizes.size >= LEAST_SINGLE):
        whole = float(np.mean(np.cos(2 * np.pi * sizes / 2**bit)))
        by_chance = len(BITS) * float(tails.normal(whole * np.sqrt(2 * sizes.size)))
        of_neighbour = max(float(np.mean(own >> bit == other >> bit)) for other in (before, after))
        large = float(np.mean(np.abs(sizes) > 2.0 ** (bit - 1)))
        if min(large, of_neighbour) >= MOST and whole > WHOLE and by_chance < BY_CHANCE:
            return bit
    return None


def _all_in_half(inside: int, number: int) -> float:
    """The probability that so many of a number of low bits lie in the half of the range that begins at one of them."""
    return float(tails.binomial(inside - 1, number - 1, 0.5))


def apart_of(run: Run, axis: int) -> tuple[Index, Array]:
    """Rows [k] of a run's outliers and their deviations [k] from their neighbours, deg/s; none where only a mean is known."""
    if run.rate_is_mean:
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    return outliers_of(run, axis, run.gyro_dps[:, axis] - rate_about(run, axis))


def codes_of(run: Run, axis: int, count_dps: float) -> Codes:
    """The codes [n] of a run's readings, in counts of ``count_dps``."""
    return np.rint(run.gyro_dps[:, axis] / count_dps).astype(np.int64)
