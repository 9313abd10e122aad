"""Orientations as a reference: unit quaternions (Hamilton, body to fixed frame) and the rotations between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from gyrocal.errors import InputError

Array = np.ndarray[Any, np.dtype[np.float64]]

UNIT_WITHIN = 0.02
"""A quaternion's length may deviate from 1 by this much: more than rounding to three digits does."""
ALIKE_WITHIN = 0.05
"""Quaternions whose lengths are within this part of one another's median are of one scale, that of counts for example."""
JUMP_DEG = 1.0
JUMP_FACTOR = 8.0
"""A step is a jump if it exceeds both the steps before and those after it by this factor, and :data:`JUMP_DEG`."""
BESIDE = 4
"""Steps on either side with which a step is compared."""
FINE_DEG = 1e-3
"""Smaller counts need no allowance."""
WHOLE, MOST_WHOLE = 0.05, 0.9
"""More of the steps than the second are within the first of a whole number of counts."""


def of_one_sign(quaternion: Array) -> Array:
    """The quaternions [n, 4] with signs that do not jump: q and -q are the same orientation. Rows with NaN keep the sign."""
    products = np.nansum(quaternion[1:] * quaternion[:-1], axis=1)
    return quaternion * np.concatenate([[1.0], np.cumprod(np.where(products < 0, -1.0, 1.0))])[:, None]


def turned_deg(quaternion: Array, label: str) -> Array:
    """The rotation from each sample to the next in the body's frame, rotation vectors [n - 1, 3], deg.

    ``quaternion`` [n, 4] holds w, x, y, z; a row with NaN is missing and gives NaN. The rotation vector is the logarithm of
    the exact relative rotation; q and -q are the same orientation. Raises InputError for a row that is not a unit quaternion.
    """
    size = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(np.abs(size - 1) > UNIT_WITHIN)
    if bad.size:
        raise InputError(
            f"{label}: row {bad[0] + 2}: the quaternion has the length {size[bad[0]]:.4g}, not 1 ({bad.size} such rows). "
            "Map ref_qw, ref_qx, ref_qy, ref_qz to a quaternion's own columns, and leave cells without a measurement empty. "
            "Quaternions of about one length are divided by it at the import"
        )
    before, after = quaternion[:-1] / size[:-1, None], quaternion[1:] / size[1:, None]
    real = np.sum(before * after, axis=1)
    a, b = before[:, 1:], after[:, 1:]
    imaginary = before[:, :1] * b - after[:, :1] * a - np.cross(a, b)
    sine = np.linalg.norm(imaginary, axis=1)
    angle = 2 * np.arctan2(sine, np.abs(real)) * np.where(real < 0, -1.0, 1.0)
    return np.asarray(np.rad2deg(imaginary * (angle / np.maximum(sine, 1e-300))[:, None]))


def jumps(turned: Array, times: Array | float = 1.0) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """True for the steps [n - 1, k] in which the reference jumped: a marker was exchanged, a tracker found itself again.

    A coarse angle is compared where it moves, and a count or two more are no jump. ``times`` [n - 1] is what each step is to be
    multiplied by to be that of the usual time.
    """
    size, count = np.linalg.norm(turned, axis=1), count_deg(turned)
    moves = np.flatnonzero(size > 0) if count else np.arange(size.size)
    known, out = (size * times)[moves], np.zeros(size.size, dtype=bool)
    if known.size < 2 * BESIDE:
        return out
    padded = np.pad(known, BESIDE, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, BESIDE)
    usual = np.maximum(np.median(around[: known.size], axis=1), np.median(around[BESIDE + 1 :], axis=1))
    out[moves] = known > JUMP_DEG + 2 * count + JUMP_FACTOR * np.maximum(usual - count, 0.0)
    return out


def count_deg(turned: Array) -> float:
    """The count of a coarse angle, of which nearly all its steps [n - 1, k] are whole multiples, deg; 0 if there is none."""
    moved = np.linalg.norm(turned, axis=1)
    moved = moved[moved > FINE_DEG]
    count = float(moved.min(initial=np.inf))
    off = np.abs(moved / count - np.round(moved / count))
    return count if moved.size and float(np.mean(off < WHOLE)) > MOST_WHOLE else 0.0
