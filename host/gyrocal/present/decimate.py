"""Reduction of long traces to the resolution of a screen: minimum, maximum and mean of each interval.

The minimum and the maximum keep spikes, and the mean shows what is not noise. A :class:`Pyramid` stores them for 16, 256,
4096, ... samples in memory-mapped files beside the samples. Any interval of ten million samples then costs the same few
thousand numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FACTOR = 16
STORED = ("min", "max", "mean")

Array = np.ndarray[Any, np.dtype[np.floating[Any]]]


class Stretches(NamedTuple):
    """Intervals of a trace: rows ``first`` to ``last`` [k], and the minimum, maximum and mean in them [k].

    An interval of one row is that sample; its three values are the same.
    """

    first: Array
    last: Array
    low: Array
    high: Array
    mean: Array


class Pyramid:
    """Channels [k, n] with their minima, maxima and means in a folder of ``.npy`` files."""

    def __init__(self, folder: Path) -> None:
        self.samples: Array = np.load(folder / "samples.npy", mmap_mode="r")
        self.levels: list[tuple[Array, Array, Array]] = []
        while (folder / f"min{len(self.levels)}.npy").is_file():
            low, high, mean = (np.load(folder / f"{name}{len(self.levels)}.npy", mmap_mode="r") for name in STORED)
            self.levels.append((low, high, mean))

    @staticmethod
    def write(folder: Path, channels: int, n: int, fill: Callable[[Array], None]) -> None:
        """Create the folder. ``fill`` writes the samples into the given array [channels, n]."""
        folder.mkdir(parents=True)
        samples = np.lib.format.open_memmap(folder / "samples.npy", "w+", np.float32, (channels, n))
        samples[:] = np.nan
        fill(samples)
        low: Array = samples
        high: Array = samples
        mean: Array = samples
        i = 0
        while low.shape[1] > FACTOR:
            starts = np.arange(0, low.shape[1], FACTOR)
            low, high = np.fmin.reduceat(low, starts, axis=1), np.fmax.reduceat(high, starts, axis=1)
            mean = means(mean, starts)
            for name, level in zip(STORED, (low, high, mean), strict=True):
                np.save(folder / f"{name}{i}.npy", level)
            i += 1

    def largest(self, channels: Sequence[int]) -> float:
        """The largest size of a sample of these channels."""
        low, high, _ = self.levels[-1] if self.levels else (self.samples,) * 3
        sizes = np.abs(np.stack([low[list(channels)], high[list(channels)]]))
        return float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))

    def window(self, channel: int, start: int, stop: int, stretches: int) -> Stretches:
        """Rows ``start:stop`` of a channel, as at most so many intervals.

        Short windows are not reduced. The bounds between intervals are those of the stored level, within 6 % of their length;
        no sample beyond the window counts.
        """
        n = stop - start
        if n <= 2 * stretches:
            rows, values = np.arange(start, stop, dtype=float), np.asarray(self.samples[channel, start:stop], dtype=float)
            return Stretches(rows, rows, values, values, values)
        size, level = 1, -1
        while level + 1 < len(self.levels) and size * FACTOR * FACTOR <= n / stretches:
            size, level = size * FACTOR, level + 1
        first, last = start // size, -(-stop // size)
        edges = np.unique(np.linspace(first, last, stretches + 1).astype(np.intp))
        inside = edges[:-1] - first
        bounds = np.clip(edges.astype(float) * size, start, stop - 1)
        stored = (self.samples,) * 3 if level < 0 else self.levels[level]
        low, high, mean = (np.array(one[channel, first:last], dtype=float) for one in stored)
        for k, cell in ((0, slice(start, min(stop, (first + 1) * size))), (-1, slice(max(start, (last - 1) * size), stop))):
            part = np.asarray(self.samples[channel, cell], dtype=float)
            low[k], high[k], mean[k] = np.fmin.reduce(part), np.fmax.reduce(part), means(part, [0])[0]
        return Stretches(
            bounds[:-1], bounds[1:], np.fmin.reduceat(low, inside), np.fmax.reduceat(high, inside), means(mean, inside)
        )


def means(values: Array, starts: Any) -> Array:
    """Means of ``values`` [..., n] over intervals that begin at ``starts`` [k]; NaN where an interval holds no finite value."""
    there = np.isfinite(values)
    total = np.add.reduceat(np.where(there, values, 0.0), starts, axis=-1, dtype=float)
    count = np.add.reduceat(there, starts, axis=-1, dtype=float)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1.0), np.nan))


def by_octave(x: Array, y: Array, stretches: int) -> tuple[Array, Stretches]:
    """A curve over positive ``x`` [n], ascending, as at most so many intervals of equal ratio: centres [k] and intervals.

    An interval with one point is that point. Where all have one, nothing is lost.
    """
    none = np.zeros(0)
    if x.size == 0:
        return none, Stretches(none, none, none, none, none)
    place = np.floor(np.log(x / x[0]) / max(np.log(x[-1] / x[0]), 1e-300) * stretches * (1 - 1e-12))
    starts = np.flatnonzero(np.diff(place, prepend=-1.0))
    ends = np.append(starts[1:], x.size) - 1
    middle = np.sqrt(x[starts] * x[ends])
    return middle, Stretches(x[starts], x[ends], np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts), means(y, starts))
