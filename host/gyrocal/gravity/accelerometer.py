"""Calibration of the accelerometer from rests, where it measures 1 g in every pose.

A reading is ``M·a + bias`` with M lower triangular: three scales and three angles. Gauss-Newton steps make the size of every
corrected mean one. A Gaussian prior of the parameters' usual sizes determines those that few poses leave open, and its share
of the error is kept. Source: Tedaldi, Pretto and Menegatti, ICRA 2014, with the frame of :mod:`gyrocal.gravity`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gyrocal.errors import InputError
from gyrocal.gravity.rests import Rest
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

ENTRIES = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
"""Entries of M that are free, in the order of the parameters; the three biases follow."""
PRIOR_SD = np.array([0.05, 0.03, 0.05, 0.03, 0.03, 0.05, 0.1, 0.1, 0.1])
"""Prior standard deviations: a few percent in scale and angle (MPU-6050 datasheet: +-3 %, +-2 %), 0.1 g in bias."""
LEAST_NOISE_G = 2e-5
ITERATIONS = 30


@dataclass(frozen=True)
class Accelerometer:
    """The matrix M [3, 3] and the bias [3], g, of readings ``M·a + bias``.

    ``gain`` [9, 3 rests] is the derivative of the parameters by the means of the rests, ``prior_cov`` [9, 9] the share of
    their covariance that the prior leaves, and ``noise_g`` [rests] the standard deviation of each rest's mean on one axis.
    """

    matrix: Array
    bias_g: Array
    gain: Array = field(repr=False)
    prior_cov: Array = field(repr=False)
    noise_g: Array = field(repr=False)
    misfit: float

    @property
    def inverse(self) -> Array:
        """The inverse of M, shape [3, 3]."""
        return np.asarray(np.linalg.inv(self.matrix))

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters, shape [9, 9]."""
        noise = np.repeat(self.noise_g**2, 3)
        return np.asarray((self.gain * noise) @ self.gain.T + self.prior_cov)

    def true_g(self, reading_g: Array) -> Array:
        """Acceleration in the common frame from readings, shape [n, 3], g."""
        return np.asarray((reading_g - self.bias_g) @ self.inverse.T)

    def slopes(self, reading_g: Array) -> Array:
        """Derivative [3, 9] of :meth:`true_g` of one reading [3] by the parameters."""
        a = self.true_g(reading_g[None])[0]
        by_reading = np.zeros((3, 9))
        for k, (i, j) in enumerate(ENTRIES):
            by_reading[i, k] = -a[j]
        by_reading[:, 6:] = -np.eye(3)
        return np.asarray(self.inverse @ by_reading)

    @property
    def se(self) -> tuple[Array, Array]:
        """Standard errors of the matrix [3, 3], zero where an entry is none of the parameters, and of the bias [3], g."""
        se = np.sqrt(np.diag(self.covariance))
        matrix_se = np.zeros((3, 3))
        for k, (i, j) in enumerate(ENTRIES):
            matrix_se[i, j] = se[k]
        return matrix_se, np.asarray(se[6:])


def calibrate(rests: Sequence[Rest], white_g: Array) -> Accelerometer:
    """Calibrate the accelerometer from the means of rests.

    ``white_g`` [rests] is the noise of each mean, averaged over the axes. Scatter of the sizes beyond it (because the part
    settles differently in each pose) is added to the noise of every rest. Raises InputError if the means are
    in another unit. An accelerometer whose scale is wrong is calibrated from its rests alone.
    """
    means = np.array([r.acc_g for r in rests])
    sizes = np.linalg.norm(means, axis=1)
    size, off = float(np.median(sizes)), POLICY.gravity_size_g
    if not POLICY.smallest_gravity_g < size < POLICY.largest_gravity_g:
        raise InputError(
            f"the acceleration at rest is {size:.4g}, and gravity is 1 g; give its unit when importing "
            "(--map ax_g=COLUMN:m/s2), or the scale of raw counts"
        )
    wrong = abs(size - 1) > off or float(np.std(sizes)) > off * size
    prior = (size, POLICY.wrong_accelerometer * size * PRIOR_SD) if wrong else (1.0, PRIOR_SD)
    extra_g = 0.0
    for _ in range(3):
        noise_g = np.maximum(np.hypot(white_g, extra_g), LEAST_NOISE_G)
        found = _least_squares(means, noise_g, *prior)
        freedom = len(rests) - _effective(found, prior[1])
        if freedom < 3 or found.misfit <= 1:
            break
        residual = np.linalg.norm(found.true_g(means), axis=1) - 1
        extra_g = float(np.sqrt(max(np.sum(residual**2) / freedom - np.mean(white_g**2), 0.0)))
    return found


def _effective(found: Accelerometer, prior_sd: Array) -> float:
    """Number of parameters that the data determine rather than the prior."""
    return float(prior_sd.size - np.sum(np.diag(found.covariance) / prior_sd**2))


def _least_squares(means: Array, noise_g: Array, scale: float, prior_sd: Array) -> Accelerometer:
    """The accelerometer whose three scales are near ``scale``, within ``prior_sd`` [9] of the parameters."""
    first = scale * np.eye(3)
    found = Accelerometer(first, np.zeros(3), np.zeros((9, means.size)), np.diag(prior_sd**2), noise_g, 1.0)
    prior = np.diag(1 / prior_sd**2)
    start = _parameters(first, np.zeros(3))
    for _ in range(ITERATIONS):
        true_g = found.true_g(means)
        sizes = np.linalg.norm(true_g, axis=1)
        direction = true_g / sizes[:, None]
        by_parameter = np.stack([d @ found.slopes(m) for d, m in zip(direction, means, strict=True)])
        by_mean = direction @ found.inverse
        weight = 1 / (noise_g**2 * np.sum(by_mean**2, axis=1))
        information = by_parameter.T @ (weight[:, None] * by_parameter) + prior
        now = _parameters(found.matrix, found.bias_g)
        step = np.linalg.solve(information, -by_parameter.T @ (weight * (sizes - 1)) - prior @ (now - start))
        covariance = np.linalg.inv(information)
        gain = -np.einsum("pr,rj->prj", covariance @ by_parameter.T * weight, by_mean).reshape(9, -1)
        matrix, bias_g = _of_parameters(now + step)
        chi2 = float(np.sum(weight * (sizes - 1) ** 2))
        found = Accelerometer(matrix, bias_g, gain, covariance @ prior @ covariance, noise_g, chi2)
        if np.max(np.abs(step)) < 1e-12:
            break
    freedom = max(len(means) - _effective(found, prior_sd), 1.0)
    return Accelerometer(
        found.matrix, found.bias_g, found.gain, found.prior_cov, noise_g, float(np.sqrt(found.misfit / freedom))
    )


def _parameters(matrix: Array, bias_g: Array) -> Array:
    return np.array([*(matrix[i, j] for i, j in ENTRIES), *bias_g])


def _of_parameters(values: Array) -> tuple[Array, Array]:
    matrix = np.zeros((3, 3))
    for k, (i, j) in enumerate(ENTRIES):
        matrix[i, j] = values[k]
    return matrix, values[6:]
