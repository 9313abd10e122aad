"""Single readings that are off by the value of one bit, or have a part of another sample: told from other outliers by their
sizes, sides and bits.

This file defines no effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Mask
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
"""Part of the low bits' range in which readings lie that have just carried, at most."""
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
    of_few = _one_sided(found, axis, count_dps, noise), _flipped(found, axis, count_dps, noise)
    bit, chance = min(of_few, key=lambda one: one[1])
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
    part, chance = _together(found, axis, count_dps, bit)
    return bit if part <= HALF and (TOLD_APART * noise < 2.0**bit or chance < BY_CHANCE) else None


def _one_sided(found: Sequence[Found], axis: int, count_dps: float, noise: float) -> tuple[int, float]:
    """The bit whose value nearly all outliers lack, or have too much, and the probability that those of another cause do.

    A carry or a bit is always lost to one side. Beside the side count the size, the bit's state in each run, and the part of
    the low bits' range in which they lie after a carry. ``noise`` in counts.
    """
    above = bool(np.median(np.concatenate([apart for _, _, apart in found])) > 0)
    bit, alike, size = _of_one_size(found, count_dps, noise, [(apart > 0) == above for _, _, apart in found])
    if not alike.any():
        return 0, 1.0
    codes = [codes_of(r, axis, count_dps)[rows] for r, rows, _ in found if rows.size]
    states = [float(np.mean((of_run >> bit & 1) == above)) for of_run in codes]
    by_state = 0.5 ** len(states) if min(states) >= MOST else 1.0
    by_part = _together(found, axis, count_dps, bit)[1]
    return bit, 2 * float(tails.binomial(int(np.count_nonzero(alike)), alike.size, 0.5)) * size * min(by_state, by_part)


def _flipped(found: Sequence[Found], axis: int, count_dps: float, noise: float) -> tuple[int, float]:
    """The bit that is the wrong one in nearly all outliers, and the probability that it is so in those of another cause.

    A reading whose bit was set by mistake is too large by its value, and one whose bit was cleared too small. ``noise`` in
    counts.
    """
    bit, alike, size = _of_one_size(found, count_dps, noise, [np.ones(rows.size, dtype=bool) for _, rows, _ in found])
    if not alike.any():
        return 0, 1.0
    wrong = np.concatenate([(codes_of(r, axis, count_dps)[rows] >> bit & 1) == (apart > 0) for r, rows, apart in found]) & alike
    if float(np.mean(wrong)) < MOST:
        return 0, 1.0
    return bit, 2 * float(tails.binomial(int(np.count_nonzero(wrong)), wrong.size, 0.5)) * size


def _of_one_size(found: Sequence[Found], count_dps: float, noise: float, sides: Sequence[Mask]) -> tuple[int, Mask, float]:
    """The bit whose value nearly all outliers deviate by, to the right side (``sides`` of each run), those that do, and the
    probability of such a size; none do if they are too few, or miss it by more than the noise (in counts).
    """
    apart = np.abs(np.concatenate([apart for _, _, apart in found])) / count_dps
    bit, none = round(float(np.log2(np.median(apart)))), np.zeros(apart.size, dtype=bool)
    if bit not in BITS:
        return 0, none, 1.0
    alike = (np.abs(apart - 2.0**bit) < max(1.0, SIZE_WITHIN * noise)) & np.concatenate(sides)
    error = max(1.0, RMS_WITHIN * noise)
    if float(np.mean(alike)) < MOST or float(np.sqrt(np.mean((apart[alike] - 2.0**bit) ** 2))) > error:
        return 0, none, 1.0
    return bit, alike, min(1.0, 2 * error / (OCTAVE * 2.0**bit))


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


def _together(found: Sequence[Found], axis: int, count_dps: float, bit: int) -> tuple[float, float]:
    """The smallest part of the low bits' range that holds nearly all outliers, and the probability of that by chance.

    An outlier that is too large counts by its neighbours, which lack the carry then and are in the other half. Where other
    readings of the same runs lie in that part as often, it shows nothing.
    """
    lows = [np.mod(codes_of(r, axis, count_dps), 2**bit) / 2.0**bit for r, _, _ in found]
    low = np.concatenate([of_run[rows] + HALF * (apart > 0) for of_run, (_, rows, apart) in zip(lows, found, strict=True)])
    least = int(np.ceil(MOST * low.size))
    order = np.sort(np.mod(low, 1.0))
    around = np.concatenate([order, order + 1.0])
    widths = around[least - 1 : least - 1 + low.size] - order
    start, part = float(order[np.argmin(widths)]), float(widths.min())
    shares = [
        float(np.mean(np.mod(of_run + HALF * above - start, 1.0) <= part))
        for of_run, (_, _, apart) in zip(lows, found, strict=True)
        for above in (apart > 0)
    ]
    return part, min(1.0, low.size * float(tails.binomial(least - 1, low.size - 1, max(part, float(np.mean(shares))))))


def apart_of(run: Run, axis: int) -> tuple[Index, Array]:
    """Rows [k] of a run's outliers and their deviations [k] from their neighbours, deg/s; none where only a mean is known."""
    if run.rate_is_mean:
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    return outliers_of(run, axis, run.gyro_dps[:, axis] - rate_about(run, axis))


def codes_of(run: Run, axis: int, count_dps: float) -> Codes:
    """The codes [n] of a run's readings, in counts of ``count_dps``."""
    return np.rint(run.gyro_dps[:, axis] / count_dps).astype(np.int64)
