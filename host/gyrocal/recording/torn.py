"""Readings whose upper bits are those of the reading before, told by their likelihood where noise hides each single one.

A reading is put together from two parts. If the upper part is taken from the reading before, the result is another code only
where the two codes differ in that part. With p for the density of the sound code c given the readings before, a share f of torn
readings and parts that meet at the value s, the probability of the code that was read is

    (1 - f)·p(c) + f·sum over k of p(c + k·s)    if its upper part is that of the reading before,
    (1 - f)·p(c)                                 otherwise.

p is the density of Student's t about the prediction from the readings before, at the offset and the level of its surroundings.
The log-likelihood of f is compared with that of f = 0, and with those of parts that meet at other values, where no driver joins
them: noise with a heavy tail, repeated readings and coarse counts raise these as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyrocal import tails
from gyrocal.recording.session import Array

MEMORY = 4
"""Number of earlier readings that predict one: the noise behind a low-pass is not white."""
SHARES = np.geomspace(0.002, 0.5, 12)
"""Shares of torn readings that are tried."""
BITS = range(4, 15)
SMALLEST, LARGEST = 1.0, 12.0
"""Sizes of a part, in spreads of the prediction's error. Smaller ones are lost in noise, and larger ones stand out singly."""
ELSEWHERE = (0.25, 0.375, 0.5, 0.625, 0.75)
"""Places of a border in the range of the lower part where no driver has one."""
OTHER_SIZES, OTHER_PLACES = (0.6, 0.7, 0.8, 1.25, 1.4, 1.6, 1.8), (0.0, 0.25, 0.5, 0.75)
"""Sizes of a part that are no power of two, over that of the bit, and places of their borders."""
FREEDOMS = (1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 30.0, 1e4)
"""Degrees of freedom of the noise that are tried."""
WINDOW = 64
"""Number of readings over which the level of the noise is constant."""
SLOW = 8 * WINDOW + 1
"""Number of readings over which an offset that the model lacks is constant."""
LEAST_GAIN = 5.0
"""Gain in log-likelihood below which a bit is not examined further."""
MOST_PAIRS = 40_000
"""Number of readings, evenly spread over the runs, that are examined."""

Codes = NDArray[np.int64]


@dataclass(frozen=True)
class _Noise:
    """Errors of predictions [n], their level about each [n], both in counts, and the degrees of freedom of Student's t."""

    error: Array
    level: Array
    freedom: float

    @classmethod
    def of(cls, errors: Sequence[Array]) -> _Noise:
        """The errors of runs with the likeliest tail, at the level that their medians in windows show."""
        error: Array = np.concatenate(errors)
        size: Array = np.concatenate([_sizes(e) for e in errors])
        noises = [cls(error, size / float(tails.student_value(0.25, freedom)), freedom) for freedom in FREEDOMS]
        return max(noises, key=lambda n: float(np.sum(tails.student_log_density(error / n.level, n.freedom) - np.log(n.level))))

    def of_rows(self, rows: NDArray[np.bool_] | slice) -> _Noise:
        """The noise of some of the readings."""
        return _Noise(self.error[rows], self.level[rows], self.freedom)

    def ratios(self, size: int) -> tuple[Array, Array]:
        """Densities of codes that differ by multiples of ``size``, over those of the codes, [n, k], and the steps [k]."""
        reach = int(np.ceil(3 * float(np.median(self.level)) / size))
        steps = np.arange(-reach, reach + 1) * float(size)
        other = ((self.error[:, None] + steps) / self.level[:, None]) ** 2
        power = np.log1p((self.error / self.level) ** 2 / self.freedom)[:, None] - np.log1p(other / self.freedom)
        return np.asarray(np.exp(np.minimum((self.freedom + 1) / 2 * power, 50.0))), np.asarray(steps)


@dataclass(frozen=True)
class Torn:
    """The lowest bit of the upper part, the share of torn readings, and the gain in log-likelihood over other causes."""

    bit: int
    share: float
    gain: float


def torn(codes: Sequence[Codes], rest: Sequence[Array]) -> Torn | None:
    """The bit at which readings are torn, from the codes [n] of each run; None if no bit gains over the other causes.

    ``rest`` [n] are the codes without the known motion, in counts.
    """
    parts = [(c, r) for c, r in zip(codes, rest, strict=True) if c.size > MEMORY + WINDOW]
    if not parts or _coarse([c for c, _ in parts]):
        return None
    noise = _Noise.of(_errors([r for _, r in parts]))
    now, before = (np.concatenate([c[MEMORY - k : c.size - k] for c, _ in parts]) for k in (0, 1))
    changed = now != before  # a reading that was read twice has the same upper bits, too
    every = slice(None, None, max(1, int(np.count_nonzero(changed)) // MOST_PAIRS))
    now, before, noise = now[changed][every], before[changed][every], noise.of_rows(changed).of_rows(every)
    if not now.size:
        return None
    level = float(np.median(noise.level))
    best: Torn | None = None
    for bit in (b for b in BITS if SMALLEST * level < 2**b < LARGEST * level):
        share, gain = _likeliest(now, before, noise, 2**bit, 0)
        if gain > (LEAST_GAIN if best is None else best.gain):
            gain -= max(0.0, *(_likeliest(now, before, noise, size, shift)[1] for size, shift in _others(bit)))
            if gain > (LEAST_GAIN if best is None else best.gain):
                best = Torn(bit, share, gain)
    return best


def _coarse(codes: Sequence[Codes]) -> bool:
    """True if no two codes that occur are neighbours: the readings were rounded to coarser steps, which hide the bits."""
    gaps = np.diff(np.unique(np.concatenate(codes)))
    return gaps.size == 0 or int(gaps.min()) > 1


def _others(bit: int) -> list[tuple[int, int]]:
    """Sizes of a part and places of its border, in counts, where no driver joins two parts of a reading."""
    sizes = [round(2**bit * ratio) for ratio in OTHER_SIZES]
    shifted = [(2**bit, round(2**bit * place)) for place in ELSEWHERE]
    return shifted + [(size, round(size * place)) for size in sizes for place in OTHER_PLACES]


def expected_shift(codes: Codes, rest: Array, bit: int, share: float) -> Array:
    """The mean of what tearing added to each reading [n], in counts, given that ``share`` of the readings are torn."""
    shift = np.zeros(codes.size)
    if codes.size <= MEMORY + WINDOW:
        return shift
    same = codes[MEMORY:] >> bit == codes[MEMORY - 1 : -1] >> bit
    ratios, steps = _Noise.of(_errors([rest])).ratios(2**bit)
    shift[MEMORY:] = np.where(same, -share * (ratios @ steps) / (1 - share + share * ratios.sum(axis=1)), 0.0)
    return shift


def _errors(rest: Sequence[Array]) -> list[Array]:
    """Readings minus their prediction from the ``MEMORY`` readings before, of each run [n - MEMORY].

    Both are taken about the mean of their surroundings: beside an offset that moves slowly over the borders, the parts of a
    reading would say on which side of the prediction it lies.
    """
    from scipy.ndimage import uniform_filter1d

    centred = [r - uniform_filter1d(r, SLOW) for r in rest]
    earlier = [np.column_stack([r[MEMORY - j - 1 : -j - 1] for j in range(MEMORY)]) for r in centred]
    memory = np.linalg.lstsq(np.concatenate(earlier), np.concatenate([r[MEMORY:] for r in centred]), rcond=None)[0]
    return [r[MEMORY:] - e @ memory for r, e in zip(centred, earlier, strict=True)]


def _sizes(error: Array) -> Array:
    """The median size of errors [n] in the window of each, shape [n], in counts."""
    windows = max(1, error.size // WINDOW)
    length, longer = divmod(error.size, windows)
    parts = np.split(np.abs(error), [longer * (length + 1)])  # the first windows are longer by one reading
    counts = (length + 1, length)
    sizes = [np.repeat(np.median(part.reshape(-1, n), axis=1), n) for part, n in zip(parts, counts, strict=True)]
    return np.maximum(np.concatenate(sizes), 0.2)


def _likeliest(now: Codes, before: Codes, noise: _Noise, size: int, shift: int) -> tuple[float, float]:
    """The likeliest share of torn readings if parts meet at ``size`` counts, and its gain; ``shift`` moves the border."""
    same = (now + shift) // size == (before + shift) // size
    if not same.any():
        return float(SHARES[0]), 0.0
    more = noise.of_rows(same).ratios(size)[0].sum(axis=1) - 1
    others = int(np.count_nonzero(~same))
    gains = [float(np.sum(np.log1p(f * more))) + others * float(np.log1p(-f)) for f in SHARES]
    best = int(np.argmax(gains))
    return float(SHARES[best]), gains[best]
