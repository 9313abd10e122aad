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
ALONE = 0.05
"""Width of the bin of a variable that has one value."""
HUNDREDTHS = 200
"""Parts of a variable's range in which its values are looked for: half a hundredth each."""
MOST_PLATEAUS = 10
APART, NARROW = 2, 8
"""Empty parts that divide two plateaus at least, and the parts that one plateau takes at most."""


def plateaus(x: Array) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Edges [k + 1] between the k values that ``x`` [n] takes, if these are a few with nothing between them; else None.

    A table that turns evenly holds its rate to a part of a hundredth. Equal bins would divide some of these rates.
    """
    if x.size == 0:
        return None
    low, high = float(x.min()), float(x.max())
    if low == high:
        return np.array([low - 0.5, high + 0.5])
    part = np.minimum(((x - low) / (high - low) * HUNDREDTHS).astype(np.intp), HUNDREDTHS - 1)
    there = np.flatnonzero(np.bincount(part, minlength=HUNDREDTHS))
    gap = np.flatnonzero(np.diff(there) > APART)
    first, last = there[np.concatenate([[0], gap + 1])], there[np.concatenate([gap, [-1]])]
    if first.size > MOST_PLATEAUS or int((last - first).max()) >= NARROW:
        return None
    middle = low + (last[:-1] + 1 + first[1:]) / 2 * (high - low) / HUNDREDTHS
    beyond = (high - low) / HUNDREDTHS
    return np.concatenate([[low - beyond], middle, [high + beyond]])


PRIOR = 4.0
"""Degrees of freedom of the variance that all places show together."""


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
    recordings, which all places show together, over their number (weighted as the mean is). It is averaged with the scatter of
    the place's own recordings, which has their degrees of freedom and the other ``PRIOR``: values within a recording need not
    be independent.
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
        apart = np.sum(np.where(count > 0, own - middle, 0.0) ** 2, axis=0)
        of_noise = np.where(count > 0, 1 / count, 0.0).sum(axis=0) * within * (1 - 1 / kept)
        between = np.nansum(np.maximum(apart - of_noise, 0.0)) / max(int(np.maximum(kept - 1, 0).sum()), 1)
        weight = np.sum((count / n) ** 2, axis=0)
        own_free = np.maximum(kept - 1, 0)
        shown = weight * apart / np.maximum(own_free, 1)
        se = np.sqrt((own_free * shown + PRIOR * (within / n + between * weight)) / (own_free + PRIOR))
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

    The bins reach from the lowest to the highest value of ``x``; each of its :func:`plateaus` is one. A bin that holds one
    value of ``x`` alone, as a face or a direction, has it in its middle. ``run`` [n] numbers the recordings from 0; without it
    all values are of one.
    """
    use = np.isfinite(x) & np.isfinite(y)
    run = np.zeros(x.size, dtype=np.intp) if run is None else run
    runs = int(run.max(initial=-1)) + 1
    x, y, run = np.asarray(x[use], dtype=float), np.asarray(y[use], dtype=float), run[use]
    if x.size == 0:
        none = np.zeros(0)
        return Binned(none, none, none, none, none, np.zeros((runs, 0)))
    low, high = float(x.min()), float(x.max())
    width = (high - low) / bins or ALONE
    edges = plateaus(x)
    if edges is None:
        place = np.minimum(((x - low) / width).astype(np.intp), bins - 1)
    else:
        place, bins = np.searchsorted(edges, x, side="right") - 1, edges.size - 1
    found = cells(place, y, run, bins)
    kept = np.isfinite(found.mean)
    centre = (np.bincount(place, x, bins) / np.maximum(np.bincount(place, minlength=bins), 1))[kept]
    one = np.full(centre.size, edges is not None) | _of_one_value(x, place, bins, width)[kept]
    middle = np.where(one, centre, low + (np.flatnonzero(kept) + 0.5) * width)
    of_runs = np.full((runs, centre.size), np.nan)
    of_runs[: len(found.of_runs)] = found.of_runs[:, kept]
    return Binned(centre, found.mean[kept], found.se[kept], middle - width / 2, middle + width / 2, of_runs)


def _of_one_value(x: Array, place: Index, bins: int, width: float) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether the values of ``x`` [n] in each bin [bins] are one."""
    first, last = np.full(bins, np.inf), np.full(bins, -np.inf)
    np.minimum.at(first, place, x)
    np.maximum.at(last, place, x)
    return np.asarray(last - first < ONE_VALUE * width)
