"""Patches of a spectrogram: noise of its own in a band of frequencies, all the time, from time to time or for some seconds.

A resonance of the mount is a band that is a little louder than the frequencies on both sides of it. Interference that comes and
goes, and a fan that changes its speed, are loud for a part of the time, and spectra over whole runs show little of them. All
are looked for in periodograms of one second. These statistics are used, and the sum of the first two:

- *louder*: the mean over all seconds of a band, against a parabola of the logarithmic density through both sides and
  against each side.
- *unsteady*: the mean square of the values of a band. Those of noise are exponentially distributed with a mean square of two; a
  tone that comes and goes makes it larger (spectral kurtosis; Antoni, Mech. Syst. Signal Process. 20 (2006) 282). Heavy tails
  and changing levels of the noise do so at all frequencies, and the other bands are subtracted.
- *for some seconds*: the sum over a few seconds of a band, relative to the same frequencies at other times and to all
  frequencies in the same second, and certainly larger than the frequencies on both sides in these seconds.

The first two are approximately normal, the last one is Gamma-distributed. The chance counts every
patch that was looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyrocal import tails
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

SECONDS = 1.0
"""Length of a segment, s. A tone that sweeps by 1 Hz/s stays within one frequency of it."""
LOWEST_HZ = 5.0
"""Below, block means are tested (``diagnosis/residual/whiteness.py``, ``diagnosis/residual/power_band.py``)."""
LEAST_FREQUENCIES, LEAST_SEGMENTS = 12, 20
BANDS = (2, 3, 4, 6, 8, 12, 16)
"""Widths of a band, in frequencies of a segment."""
SIDES = (1, 2)
"""Widths of a side in widths of the band, and at least ``LEAST_SIDE`` frequencies."""
LEAST_SIDE = 4
STATISTICS = 4
LOUD = 5.0
"""Ratio to the noise that a value of noise exceeds in 0.7 % of cases."""
SPANS, NARROW = (1, 2, 4, 8, 16), (1, 2, 4, 8)
"""Lengths and widths of a patch, in segments and in frequencies."""
BEND = 0.4
"""How far a parabola through both sides lies below the density of noise behind a low-pass, over the fourth power of the
distance of the farther ends in the logarithm of frequency. The fourth derivative of ``-log(1 + (f/f_c)^4)`` is at most 32, and
least squares through two sides miss 32/24 times the fourth power by less than a third of it."""
OF_NEXT, OF_SECOND = 4 / 9, 1 / 36
"""Correlation of the power of neighbouring frequencies, and of second ones, under a Hann window. Half of a segment is shared
with the next one, whose power has the correlation ``OF_SECOND``."""
SKEWNESS = 10.0
"""Of the square of an exponential variable less four times the variable, whose variance is 4."""

Whole = np.ndarray[Any, np.dtype[np.intp]]
"""Whole numbers of any shape."""


@dataclass(frozen=True)
class Patch:
    """A band that noise does not make so loud.

    ``chance`` is the probability that noise makes any such patch, ``sigma`` the patch's own significance in standard errors.
    ``amplitude_dps`` is that of a sine with the same power. ``run`` and ``from_s`` tell where a patch of ``seconds`` begins;
    without ``seconds`` it is that of the whole recording, ``unsteady`` if its power comes and goes.
    """

    low_hz: float
    high_hz: float
    amplitude_dps: float
    sigma: float
    chance: float
    unsteady: bool = False
    seconds: float | None = None
    run: int = 0
    from_s: float = 0.0


@dataclass(frozen=True)
class _Cells:
    """Periodograms of segments [segments, f] in units of the noise at each frequency and in each segment.

    ``density`` [f] is that of the noise, dps^2/Hz, ``level`` [segments] the power of each segment over the mean one, ``runs``
    [segments] the run of each segment, and ``starts_s`` [segments] its begin in the run.
    """

    frequency_hz: Array
    ratio: Array
    density: Array
    level: Array
    runs: Whole
    starts_s: Array

    @property
    def bin_hz(self) -> float:
        return float(self.frequency_hz[1] - self.frequency_hz[0])


def patch(residuals: Sequence[Array], rate_hz: float, lines_hz: Sequence[float] = ()) -> Patch | None:
    """The least probable patch in residuals [n] of runs, deg/s, sampled at ``rate_hz``; None if they are too short or too slow.

    Frequencies next to ``lines_hz``, which are known lines, are left out.
    """
    cells = _cells(residuals, rate_hz, lines_hz)
    if cells is None:
        return None
    brief = _of_some_seconds(cells)
    found = [*_of_all_time(cells), *([] if brief is None else [brief])]
    best = min(found, key=lambda p: p.chance, default=None)
    return None if best is None else replace(best, chance=min(1.0, STATISTICS * best.chance))


def _cells(residuals: Sequence[Array], rate_hz: float, lines_hz: Sequence[float]) -> _Cells | None:
    length = round(SECONDS * rate_hz)
    if length < 2 * LEAST_FREQUENCIES:
        return None
    frequency = np.fft.rfftfreq(length, 1 / rate_hz)
    use = (frequency >= LOWEST_HZ) & (frequency < rate_hz / 2)
    for hz in lines_hz:
        use &= np.abs(frequency - hz) > 2 / SECONDS
    if np.count_nonzero(use) < LEAST_FREQUENCIES:
        return None
    window = np.hanning(length + 1)[:-1]
    power, runs, starts = [], [], []
    for k, residual in enumerate(residuals):
        for start in range(0, residual.size - length + 1, max(1, length // 2)):
            piece = residual[start : start + length]
            power.append(np.abs(np.fft.rfft((piece - piece.mean()) * window))[use] ** 2)
            runs.append(k)
            starts.append(start / rate_hz)
    if not power:
        return None
    values = np.stack(power)
    alive = values.mean(axis=1) > 0
    values = values[alive]
    if len(values) < LEAST_SEGMENTS or not np.all(values.mean(axis=0) > 0):
        return None
    level = np.ones(len(values))
    for _ in range(2):  # levels of frequencies and of segments, each relative to the other
        of_frequency = (values / level[:, None]).mean(axis=0)
        level = (values / of_frequency).mean(axis=1)
    mean_level = float(level.mean())
    density = np.asarray(of_frequency * mean_level * 2 / (rate_hz * float(window @ window)))
    return _Cells(
        np.asarray(frequency[use], dtype=np.float64), values / of_frequency / level[:, None], density, level / mean_level,
        np.array(runs)[alive], np.array(starts)[alive],
    )  # fmt: skip


def _values_of_band(frequencies: int) -> float:
    """The number of independent values among so many neighbouring frequencies of a segment."""
    b = frequencies
    return b * b / (b + 2 * (b - 1) * OF_NEXT + 2 * max(b - 2, 0) * OF_SECOND)


def _values_of_time(segments: int) -> float:
    """The number of independent values among so many successive segments."""
    return segments / (1 + 2 * (segments - 1) / segments * OF_SECOND)


def _of_all_time(cells: _Cells) -> Iterator[Patch]:
    """The least probable band that is louder than both sides, the one that is unsteady, and the one that is both."""
    segments = _values_of_time(len(cells.ratio))
    log_hz, log_density = np.log(cells.frequency_hz), np.log(cells.density)
    unsteady = (cells.ratio**2).mean(axis=0) - 2
    best: dict[str, tuple[float, int, int, float, float]] = {}
    scales = 0
    for b in BANDS:
        for side in (max(LEAST_SIDE, of * b) for of in SIDES):
            places = range(side, cells.frequency_hz.size - b - side + 1, max(1, b // 2))
            scales += bool(places)
            for i in places:
                louder, z = _louder(log_hz, log_density, i, b, side, segments)
                comes_and_goes = _unsteady(unsteady, i, b, segments)
                tried = {"louder": z, "unsteady": comes_and_goes}
                if z > 0 and comes_and_goes > 0:
                    tried["both"] = (z + comes_and_goes) / float(np.sqrt(2))
                for name, sigma in tried.items():
                    chance = float(tails.normal(sigma)) * len(places)
                    if name not in best or chance < best[name][0]:
                        best[name] = (chance, i, b, louder, sigma)
    for name, (chance, i, b, louder, sigma) in best.items():
        band = slice(i, i + b)
        power = float(np.sum(cells.density[band])) * (1 - float(np.exp(-louder)))
        if name == "unsteady":  # the noise in its seconds is not known apart: what certainly stands out of it
            loud = np.where(cells.ratio[:, band] > LOUD, cells.ratio[:, band] - 1, 0.0) * cells.level[:, None]
            power = float(loud.mean(axis=0) @ cells.density[band])
        low_hz, high_hz = float(cells.frequency_hz[i]), float(cells.frequency_hz[i + b - 1])
        amplitude_dps = float(np.sqrt(2 * max(power, 0.0) * cells.bin_hz))
        yield Patch(low_hz, high_hz, amplitude_dps, sigma, scales * chance, unsteady=name != "louder")


def _louder(log_hz: Array, log_density: Array, i: int, b: int, side: int, segments: float) -> tuple[float, float]:
    """Excess of the logarithmic mean of ``b`` frequencies from the ``i``-th over both sides, and its significance.

    Both are zero for a band that is not louder than each of the sides.
    """
    band, beside = slice(i, i + b), np.r_[i - side : i, i + b : i + b + side]
    mean = float(np.log(np.exp(log_density[band]).mean()))
    if mean <= max(np.log(np.exp(log_density[part]).mean()) for part in (beside[:side], beside[side:])):
        return 0.0, 0.0  # the density of noise falls with frequency, and some filters bend it more than others
    middle = float(log_hz[band].mean())
    x, own = log_hz[beside] - middle, log_hz[band] - middle
    weight = np.array([1.0, 0.0, float((own**2).mean())]) @ np.linalg.pinv(np.stack([np.ones(x.size), x, x**2], axis=1))
    louder = mean - float(weight @ log_density[beside])
    variance = float(weight @ weight) * (1 + 2 * OF_NEXT + 2 * OF_SECOND) / segments + 1 / (_values_of_band(b) * segments)
    return louder, (louder - BEND * float(np.abs(x).max()) ** 4) / float(np.sqrt(variance))


def _unsteady(unsteady: Array, i: int, b: int, segments: float) -> float:
    """Significance of what a band's mean square exceeds that of the other frequencies [f] by.

    Its distribution is approximated by a Gamma distribution with the same variance and skewness (Pearson's type III).
    """
    own, count = float(unsteady[i : i + b].mean()), _values_of_band(b) * segments
    others = float((unsteady.sum() - unsteady[i : i + b].sum()) / (unsteady.size - b))
    z = (own - others) / (2 * float(np.sqrt(1 / count + 1 / (_values_of_band(unsteady.size - b) * segments))))
    shape = 4 * count / SKEWNESS**2
    at = shape + z * float(np.sqrt(shape))
    return float(tails.normal_z(max(float(tails.chi_square(2 * at, 2 * shape)), 1e-300))) if at > 0 else -np.inf


def _of_some_seconds(cells: _Cells) -> Patch | None:
    """The least probable patch of a few segments."""
    of_run = [np.flatnonzero(cells.runs == k) for k in np.unique(cells.runs)]
    sums = [np.pad(cells.ratio[rows].cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0))) for rows in of_run]
    best: tuple[float, float, int, int, int, int, int, float] | None = None
    scales = 0
    for a in SPANS:
        for b in NARROW:
            looks, least = 0, None
            count = _values_of_time(a) * _values_of_band(b)
            for k, total in enumerate(sums):
                at = np.arange(0, len(total) - a, max(1, a // 2))
                i = np.arange(0, total.shape[1] - b, max(1, b // 2))
                if not at.size or not i.size:
                    continue
                mean = _sums(total, at, i, a, b) / (a * b)
                looks += mean.size
                j, m = np.unravel_index(int(np.argmax(mean)), mean.shape)
                if least is None or mean[j, m] > least[-1]:
                    least = (k, int(at[j]), int(i[m]), float(mean[j, m]))
            if least is None:
                continue
            scales += 1
            k, t, first, mean_ratio = least
            once = float(tails.chi_square(2 * count * mean_ratio, 2 * count))
            if (best is None or looks * once < best[0]) and _beyond_sides(sums[k], t, first, a, b, mean_ratio):
                best = (looks * once, once, k, t, first, a, b, mean_ratio)
    if best is None:
        return None
    chance, once, k, t, first, a, b, mean_ratio = best
    rows = of_run[k][t : t + a]
    leaked = slice(max(0, first - 1), first + b + 1)  # a line is in two or three neighbours
    beyond = (cells.ratio[rows, leaked] - 1) * cells.level[rows, None] * cells.density[leaked]
    power = max(0.0, float(beyond.sum(axis=1).mean()) * cells.bin_hz)
    low_hz, high_hz = float(cells.frequency_hz[first]), float(cells.frequency_hz[first + b - 1])
    sigma = float(tails.normal_z(max(once, np.finfo(np.float64).tiny)))
    return Patch(
        low_hz, high_hz, float(np.sqrt(2 * power)), sigma, scales * chance, seconds=SECONDS * (a + 1) / 2,
        run=int(cells.runs[rows[0]]), from_s=float(cells.starts_s[rows[0]]),
    )  # fmt: skip


def _sums(total: Array, at: Whole, i: Whole, a: int, b: int) -> Array:
    """Sums over ``a`` segments from ``at`` [t] and ``b`` frequencies from ``i`` [k], from cumulated sums, shape [t, k]."""
    upper, lower = total[at + a], total[at]
    return np.asarray(upper[:, i + b] - upper[:, i] - lower[:, i + b] + lower[:, i])


def _beyond_sides(total: Array, t: int, i: int, a: int, b: int, mean: float) -> bool:
    """True if a patch is certainly louder than the frequencies on both sides of it in the same segments."""
    side = max(LEAST_SIDE, 2 * b)
    low, high = max(0, i - side), min(total.shape[1] - 1, i + b + side)
    every = float(_sums(total, np.array([t]), np.array([low]), a, high - low)[0, 0])
    others = high - low - b
    beside = (every - mean * a * b) / (a * others)
    looks = 2 * _values_of_time(a)
    chance = tails.f_ratio(mean / max(beside, 1e-300), looks * _values_of_band(b), looks * _values_of_band(others))
    return bool(chance < POLICY.louder_in_time)
