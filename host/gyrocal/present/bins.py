"""Means of block means in bins of a variable, with errors that allow for what differs from recording to recording.

Scale and bias differ between power cycles, so the means of two recordings in one bin differ by more than their noise. A mean
over few recordings is as uncertain as that difference makes it, however many samples it has.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray[Any, np.dtype[np.floating[Any]]]
Index = np.ndarray[Any, np.dtype[np.integer[Any]]]

ONE_VALUE = 0.01
"""Part of a bin's width within which values count as one."""


class Cells(NamedTuple):
    """Means [k] of values in places, their standard errors [k], and the means [recordings, k] of each recording.

    What is empty is NaN.
    """

    mean: Array
    se: Array
    of_runs: Array


def cells(place: Index, y: Array, run: Index, places: int) -> Cells:
    """Means of ``y`` [n] in their ``place`` [n] from 0 to below ``places``; ``run`` [n] numbers the recordings from 0.

    The variance of a mean is that of the noise within recordings over the number of values, plus the variance between
    recordings, which all places show together, over the number of recordings (weighted as the mean is).
    """
    runs = int(run.max(initial=-1)) + 1
    cell = run * places + place
    count = np.bincount(cell, minlength=runs * places).reshape(runs, places)
    with np.errstate(invalid="ignore", divide="ignore"):
        own = np.bincount(cell, y, runs * places).reshape(runs, places) / count
        n, kept = count.sum(axis=0), np.count_nonzero(count, axis=0)
        mean = np.bincount(place, y, places) / n
        scatter = np.bincount(place, (y - own.reshape(-1)[cell]) ** 2, places)
        free = n - kept
        usual = scatter.sum() / max(int(free.sum()), 1)
        within = np.where(free > 0, scatter / free, usual)
        middle = np.nansum(np.where(count > 0, own, 0.0), axis=0) / kept
        apart = float(np.sum(np.where(count > 0, own - middle, 0.0) ** 2))
        of_noise = np.where(count > 0, 1 / count, 0.0).sum(axis=0) * within * (1 - 1 / kept)
        between = max(0.0, apart - float(np.nansum(of_noise))) / max(int(np.maximum(kept - 1, 0).sum()), 1)
        se = np.sqrt(within / n + between * np.sum((count / n) ** 2, axis=0))
    return Cells(mean, se, own)


class Binned(NamedTuple):
    """Means of x and y in bins [k], the standard errors of those of y [k], the ends of the bins [k], and each recording's mean
    of y in them [recordings, k], which is NaN where it has none.
    """

    centre: Array
    mean: Array
    se: Array
    low: Array
    high: Array
    of_runs: Array


def binned(x: Array, y: Array, bins: int, run: Index | None = None) -> Binned:
    """Means of ``y`` [n] in equal bins of ``x`` [n], without empty bins. Values that are not finite are left out.

    The bins reach from the lowest to the highest value of ``x``. A bin that holds one value of ``x`` alone, as a face or a
    direction, has it in its middle. ``run`` [n] numbers the recordings from 0; without it all values are of one.
    """
    use = np.isfinite(x) & np.isfinite(y)
    run = np.zeros(x.size, dtype=np.intp) if run is None else run
    runs = int(run.max(initial=-1)) + 1
    x, y, run = np.asarray(x[use], dtype=float), np.asarray(y[use], dtype=float), run[use]
    if x.size == 0:
        none = np.zeros(0)
        return Binned(none, none, none, none, none, np.zeros((runs, 0)))
    low, high = float(x.min()), float(x.max())
    width = (high - low) / bins or 1.0
    place = np.minimum(((x - low) / width).astype(np.intp), bins - 1)
    found = cells(place, y, run, bins)
    kept = np.isfinite(found.mean)
    first, last = np.full(bins, np.inf), np.full(bins, -np.inf)
    np.minimum.at(first, place, x)
    np.maximum.at(last, place, x)
    centre = (np.bincount(place, x, bins) / np.maximum(np.bincount(place, minlength=bins), 1))[kept]
    one = (last - first)[kept] < ONE_VALUE * width
    middle = np.where(one, centre, low + (np.flatnonzero(kept) + 0.5) * width)
    of_runs = np.full((runs, centre.size), np.nan)
    of_runs[: len(found.of_runs)] = found.of_runs[:, kept]
    return Binned(centre, found.mean[kept], found.se[kept], middle - width / 2, middle + width / 2, of_runs)
