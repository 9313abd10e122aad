"""Rows before the first reading or after the last one that no sensor read: a program filled its array with zeros, or wrote out
erased memory, all of whose bits are set.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

Array = np.ndarray[Any, np.dtype[np.float64]]

WINDOW, WINDOWS = 32, 8
"""Readings in which noise is taken, also the shortest stretch of zeros that noise of a count does not make; and so many windows
beside the zeros, whose means scatter less than the readings in them where the sensor lies still."""
BESIDE = 2
"""Rows next to the zeros that a filter may have smeared."""
SELDOM, GRAVITY = 0.01, 0.5
"""Accelerations hold gravity if no more than the first part of their sizes is below the second part of the usual one."""
FORWARD, BACK = 0.5, 0.01
"""Parts of the steps of a clock that go forward, at least, and back, at most."""


def erased_from(frame: pl.DataFrame) -> int:
    """The first of the rows at a table's end that are of erased memory; its height if there are none.

    They repeat one row, time and all, and their time is far off the course of the clock: the largest number, or below zero. A
    sensor or a logger that hung repeats a row whose time is on the course.
    """
    if not frame.width or any(column.n_unique() > 1 for column in frame.tail(WINDOW)):
        return frame.height
    begin = max(_repeats_from(column) for column in frame)
    if frame.height - begin < WINDOW or begin < 2:
        return frame.height
    columns = (column for column in frame.head(begin + 1) if column.dtype.is_numeric() or column.dtype == pl.String)
    clocks = (column.cast(pl.Float64, strict=False).to_numpy() for column in columns)
    return begin if any(_leaves_course(t) for t in clocks) else frame.height


def _repeats_from(column: pl.Series) -> int:
    """The row from which on a column is constant up to its end."""
    others = (~column.eq_missing(column[-1])).arg_true() if column[-1] is not None else column.is_not_null().arg_true()
    return int(others[-1]) + 1 if len(others) else 0


def _leaves_course(t: Array) -> bool:
    """True if a column [n] is a clock up to its last entry, which is further ahead than all before are apart, or negative."""
    steps = np.diff(t[:-1])
    if np.mean(steps > 0) < FORWARD or np.mean(steps < 0) > BACK:
        return False
    return bool(t[-1] - t[-2] > t[-2] - t[0] or t[-1] < min(0.0, t[0]))


def readings_within(gyro: Sequence[Array], acc: Sequence[Array]) -> tuple[int, int]:
    """The place of the first reading and the one after the last, without rows of zeros before and after.

    ``gyro`` and ``acc`` are readings [n] by axis, less their zero. With gravity beside, no row is zero. A gyroscope alone may
    read zero on every axis, if it is coarse or hides small rates: then zeros are none where the rest of the file never stands
    still on one reading, and beside them lie readings whose noise is a count and more.
    """
    columns, n = [*gyro, *acc], gyro[0].size if gyro else 0
    if not n or not any(all(column[end] == 0 for column in columns) for end in (0, -1)):
        return 0, n
    rows = np.flatnonzero(np.any([column != 0 for column in columns], axis=0))
    if rows.size < WINDOW:
        return 0, n
    first, end = int(rows[0]), int(rows[-1]) + 1
    if len(acc) == 3 and _holds_gravity(np.column_stack([column[first:end] for column in acc])):
        return first, end
    read = np.column_stack([column[first:end] for column in gyro])
    beside = WINDOWS * WINDOW
    if len(read) < BESIDE + beside or _stands(read):
        return 0, n
    begins = first if first >= WINDOW and _is_noise(read[BESIDE : BESIDE + beside]) else 0
    ends = end if n - end >= WINDOW and _is_noise(read[-BESIDE - beside : -BESIDE]) else n
    return begins, ends


def _holds_gravity(acc: Array) -> bool:
    """True if accelerations [n, 3] are hardly ever much smaller than usual."""
    sizes = np.linalg.norm(acc, axis=1)
    return float(np.nanquantile(sizes, SELDOM)) > GRAVITY * float(np.nanmedian(sizes))


def _stands(gyro: Array) -> bool:
    """True if readings [n, axes] repeat one reading on every axis for half a window somewhere."""
    same = np.concatenate([[0], np.cumsum(np.all(np.diff(gyro, axis=0) == 0, axis=1))])
    half = WINDOW // 2
    return bool(np.any(same[half:] - same[:-half] == half))


def _is_noise(gyro: Array) -> bool:
    """True if readings [n, axes] lie still, and their noise is a count or more on one axis at least."""
    windows = gyro[: len(gyro) // WINDOW * WINDOW].reshape(-1, WINDOW, gyro.shape[1])
    noise, wander = windows.std(axis=1).mean(axis=0), windows.mean(axis=1).std(axis=0)
    steps = np.abs(np.diff(gyro, axis=0))
    count = np.array([axis[axis > 0].min(initial=np.inf) for axis in steps.T])
    return bool(np.all(wander <= noise) and np.any(noise >= count))
