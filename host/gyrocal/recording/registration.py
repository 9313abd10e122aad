"""The position of a reference's axes and clock relative to those of the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gyrocal.policy import POLICY

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Registration:
    """``v_sensor = R · v_reference``, and a reading at time t shows the reference at the time ``(1 + drift)·t - offset_s``.

    ``rotation_deg`` is the rotation vector of R (axis times angle, deg). The time t is counted from the run's first sample.
    """

    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_s: float = 0.0
    drift: float = 0.0

    @property
    def matrix(self) -> Array:
        """R, shape [3, 3]."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_rotvec(self.rotation_deg, degrees=True).as_matrix())

    @property
    def same_clock(self) -> bool:
        """True if the reference has the clock of the readings."""
        return self.offset_s == 0.0 and self.drift == 0.0

    def moment_s(self, t_s: Array) -> Array:
        """The moment of the reference that readings at ``t_s`` [n], s, show, shape [n], s."""
        return np.asarray(t_s[0] + (1 + self.drift) * (t_s - t_s[0]) - self.offset_s)

    def from_later(self, elapsed_s: float) -> Registration:
        """The registration of a part of the run that begins ``elapsed_s`` after its first sample."""
        return replace(self, offset_s=self.offset_s - self.drift * elapsed_s)


class ReferenceParameter(NamedTuple):
    """One estimated number about a reference's frame or clock, in the unit of its name; ``se`` is None in a first estimate."""

    effect: str
    name: str
    value: float
    se: float | None


@dataclass(frozen=True)
class Lost:
    """The stretches of a run in which its reference shows another motion than the sensor: the samples [n]
    in or beside them, where they begin, s, their part of the run, and how far both differ there and usually, deg/s.

    The reference is not used there. If this is so large a part that it is not clear which of both is wrong, it is used
    everywhere (``left_out`` is False).
    """

    file: str
    samples: np.ndarray[Any, np.dtype[np.bool_]]
    starts_s: Array
    part: float
    largest_dps: float
    usual_dps: float

    @property
    def left_out(self) -> bool:
        """True if the part is small enough to tell that the reference is wrong."""
        return self.part <= POLICY.lost_most


@dataclass(frozen=True)
class RegistrationFit:
    """A registration that was estimated from the readings.

    ``alternatives_s`` are other offsets that fit a repeated motion as well. ``mirrored`` is True if the readings follow the
    reference only as a mirror image. ``readings_dps`` is the rms of the readings about their means, over all axes, and ``left``
    the part of its square that the reference leaves under the best linear map. The reference is left out in ``lost``.
    """

    registration: Registration
    parameters: tuple[ReferenceParameter, ...] = ()
    alternatives_s: tuple[float, ...] = ()
    mirrored: bool = False
    readings_dps: float = 0.0
    left: float = 0.0
    lost: tuple[Lost, ...] = ()


def rotation_deg(matrix: Array) -> tuple[float, float, float]:
    """The rotation vector of a rotation matrix [3, 3], deg."""
    from scipy.spatial.transform import Rotation

    x, y, z = Rotation.from_matrix(matrix).as_rotvec(degrees=True)
    return float(x), float(y), float(z)


def nearest_rotation(matrix: Array) -> tuple[Array, bool]:
    """The rotation R [3, 3] of the polar decomposition ``matrix = S·R`` with S symmetric, and whether it mirrors nothing.

    Source: Wahba's problem by singular values (Markley, J. Astronaut. Sci. 36 (1988) 245).
    """
    u, _, vt = np.linalg.svd(matrix)
    sign = float(np.sign(np.linalg.det(u @ vt)))
    return np.asarray(u @ np.diag([1.0, 1.0, sign]) @ vt), sign > 0


SCALE_SD, MISALIGNMENT_SD = 0.05, 0.03
"""Standard deviations of scale and misalignment before the data speak: consumer parts have 1-3 % and 1-2 %."""
ROTATION_SD = 1.0
"""That of the small rotation, rad: one that the data do not show, such as that about the only axis of motion, stays zero."""
UNKNOWN_ROTATION = ROTATION_SD / 2
"""A standard error of a rotation, rad, from which on the data do not show it."""


class Structure(NamedTuple):
    """A small rotation [3], rad, and further parameters [m], with their covariance [3 + m, 3 + m], inf if unknown."""

    rotation: Array
    others: Array
    cov: Array


def structured(information: Array, score: Array, pairs: Sequence[tuple[int, int]]) -> Structure:
    """The small rotation in a map of rates near the unit matrix, by generalised least squares.

    ``information`` [9 + m, 9 + m] and ``score`` [9 + m] are those of the map minus I, row by row, and of m further parameters.
    The map is a scale of each axis, a rotation, and between the axes of ``pairs`` also a symmetric part, the misalignment. What
    one axis shows of the rotation about another counts by how well it is known. Where the sensor hardly turns about some axis,
    only sums of these parts show, and scale and misalignment are taken to be small. A rotation that does not show is zero.
    """
    m = score.size - 9
    kinds = np.zeros((9 + m, 6 + m + len(pairs)))  # rotation, further parameters, scale, misalignment
    for k, (row, column) in enumerate(((2, 1), (0, 2), (1, 0))):
        kinds[3 * row + column, k], kinds[3 * column + row, k] = 1.0, -1.0
    kinds[9:, 3 : 3 + m] = np.eye(m)
    kinds[[0, 4, 8], [3 + m, 4 + m, 5 + m]] = 1.0
    for k, (i, j) in enumerate(pairs):
        kinds[[3 * i + j, 3 * j + i], 6 + m + k] = 1.0
    normal = kinds.T @ information @ kinds
    shown = np.diag(normal) > 0
    prior = [ROTATION_SD**-2] * 3 + [0.0] * m + [SCALE_SD**-2] * 3 + [MISALIGNMENT_SD**-2] * len(pairs)
    shown[:3] = True
    normal[np.diag_indices(len(normal))] += prior
    seen = np.flatnonzero(shown)
    cov = np.diag(np.where(shown, 0.0, np.inf))
    cov[np.ix_(seen, seen)] = np.linalg.inv(normal[np.ix_(seen, seen)])
    found = np.zeros(len(normal))
    found[seen] = cov[np.ix_(seen, seen)] @ (kinds.T @ score)[seen]
    return Structure(found[:3], found[3 : 3 + m], cov[: 3 + m, : 3 + m])
