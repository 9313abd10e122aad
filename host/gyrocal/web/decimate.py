"""Reduction of long traces to the resolution of a screen by the minimum and maximum of each interval, which keeps spikes.

A :class:`Pyramid` stores minima and maxima of 16, 256, 4096, ... samples in memory-mapped files beside the samples. Any
interval of ten million samples then costs the same few thousand numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FACTOR = 16

Array = np.ndarray[Any, np.dtype[np.floating[Any]]]


class Pyramid:
    """Channels [k, n] with their minima and maxima in a folder of ``.npy`` files."""

    def __init__(self, folder: Path) -> None:
        self.samples: Array = np.load(folder / "samples.npy", mmap_mode="r")
        self.levels: list[tuple[Array, Array]] = []
        while (folder / f"min{len(self.levels)}.npy").is_file():
            i = len(self.levels)
            self.levels.append((np.load(folder / f"min{i}.npy", mmap_mode="r"), np.load(folder / f"max{i}.npy", mmap_mode="r")))

    @staticmethod
    def write(folder: Path, channels: int, n: int, fill: Callable[[Array], None]) -> None:
        """Create the folder. ``fill`` writes the samples into the given array [channels, n]."""
        folder.mkdir(parents=True)
        samples = np.lib.format.open_memmap(folder / "samples.npy", "w+", np.float32, (channels, n))
        samples[:] = np.nan
        fill(samples)
        samples.flush()
        low: Array = samples
        high: Array = samples
        i = 0
        while low.shape[1] > FACTOR:
            starts = np.arange(0, low.shape[1], FACTOR)
            low, high = np.fmin.reduceat(low, starts, axis=1), np.fmax.reduceat(high, starts, axis=1)
            np.save(folder / f"min{i}.npy", low)
            np.save(folder / f"max{i}.npy", high)
            i += 1

    def window(self, channel: int, start: int, stop: int, stretches: int) -> tuple[Array, Array]:
        """Rows ``start:stop`` of a channel as (row, value), at most two for each interval: its minimum and maximum.

        Short windows are not reduced. The bounds of an interval are those of the stored level, within 6 % of its length.
        """
        n = stop - start
        if n <= 2 * stretches:
            return np.arange(start, stop, dtype=float), np.asarray(self.samples[channel, start:stop], dtype=float)
        size, level = 1, -1
        while level + 1 < len(self.levels) and size * FACTOR * FACTOR <= n / stretches:
            size, level = size * FACTOR, level + 1
        low, high = (self.samples, self.samples) if level < 0 else self.levels[level]
        first, last = start // size, -(-stop // size)
        edges = np.unique(np.linspace(first, last, stretches + 1).astype(np.intp))
        inside = edges[:-1] - first
        minima = np.fmin.reduceat(low[channel, first:last], inside)
        maxima = np.fmax.reduceat(high[channel, first:last], inside)
        rows = np.clip(quarters(edges[:-1].astype(float), edges[1:].astype(float)) * size, start, stop - 1)
        return rows, zigzag(minima, maxima).astype(float)


def zigzag(low: Array, high: Array, first: int = 0) -> Array:
    """Minima and maxima [n] of intervals as one curve [2 n], rising in even intervals; ``first`` numbers the first one."""
    pairs = np.column_stack([low, high])
    odd = slice(1 - first % 2, None, 2)
    pairs[odd] = pairs[odd, ::-1]
    return pairs.ravel()


def quarters(first: Array, last: Array) -> Array:
    """Positions [2 n] of the two points of each interval [n]: at a quarter and at three quarters of it."""
    return np.column_stack([0.75 * first + 0.25 * last, 0.25 * first + 0.75 * last]).ravel()


class Binned(NamedTuple):
    """Centres of bins [k], and the means in them with their standard errors [k]."""

    centre: Array
    mean: Array
    se: Array


def binned(x: Array, y: Array, bins: int) -> Binned:
    """Means of ``y`` [n] in equal bins of ``x`` [n], without empty bins. Values that are not finite are left out."""
    use = np.isfinite(x) & np.isfinite(y)
    x, y = np.asarray(x[use], dtype=float), np.asarray(y[use], dtype=float)
    if x.size == 0:
        return Binned(np.zeros(0), np.zeros(0), np.zeros(0))
    low, high = float(x.min()), float(x.max())
    width = (high - low) / bins or 1.0
    place = np.minimum(((x - low) / width).astype(np.intp), bins - 1)
    count = np.bincount(place, minlength=bins)
    kept = count > 0
    n = count[kept]
    mean = np.bincount(place, y, bins)[kept] / n
    scatter = np.bincount(place, (y - mean[np.cumsum(kept)[place] - 1]) ** 2, bins)[kept]
    error = np.sqrt(scatter / np.maximum(n - 1, 1) / n)
    return Binned(low + (np.flatnonzero(kept) + 0.5) * width, mean, error)


def thinned(x: Array, y: Array, stretches: int) -> tuple[Array, Array]:
    """A curve [n], reduced to minimum and maximum of each interval if it has more points than a screen shows."""
    if x.size <= 2 * stretches:
        return x, y
    edges = np.unique(np.linspace(0, x.size, stretches + 1).astype(np.intp))[:-1]
    ends = np.append(x[edges[1:]], x[-1])
    return quarters(x[edges], ends), zigzag(np.fmin.reduceat(y, edges), np.fmax.reduceat(y, edges))
