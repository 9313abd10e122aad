"""How much of the noise of measured columns is taken out of the normal equations.

A column that is measured with noise, such as the rate of a tracker, has a square that is too large by the power of the noise,
and a coefficient that is too small (Fuller, Measurement Error Models, 1987, section 2.2). The expected products of the noise
are therefore subtracted. They are known to some accuracy only. Where a combination of columns is mostly noise, little would be
left of its square, or less than nothing.
"""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array

MOST_NOISE = 0.5
"""Largest part of the square of any combination of columns that is taken out as its noise."""


def part_taken(gram: Array, noise: Array) -> Array | None:
    """The matrix [p, p] by which the noise of columns is multiplied before it is taken out; None if all of it is.

    ``gram`` [p, p] are the products of independent columns and ``noise`` [p, p] those of their noise, positive semidefinite.
    With the matrix A, no combination of columns has more than ``MOST_NOISE`` of its square in ``A·noise·A'``. In the
    combinations that are independent both in their products and in their noise, A is the root of the part that may be taken.
    """
    scale = np.sqrt(np.diagonal(gram))
    factor = np.linalg.cholesky(gram / np.outer(scale, scale))
    of_noise = np.linalg.solve(factor, np.linalg.solve(factor, noise / np.outer(scale, scale)).T)
    part, basis = np.linalg.eigh((of_noise + of_noise.T) / 2)
    if part[-1] <= MOST_NOISE:
        return None
    root = np.sqrt(MOST_NOISE / np.maximum(part, MOST_NOISE))
    forward = factor @ basis
    return np.asarray(scale[:, None] * (forward * root) @ np.linalg.inv(forward) / scale)
