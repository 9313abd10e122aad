"""The position of a reference's axes and clock relative to those of the sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

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
class RegistrationFit:
    """A registration that was estimated from the readings.

    ``alternatives_s`` are other offsets that fit a repeated motion as well. ``mirrored`` is True if the readings follow the
    reference only as a mirror image.
    """

    registration: Registration
    parameters: tuple[ReferenceParameter, ...] = ()
    alternatives_s: tuple[float, ...] = ()
    mirrored: bool = False


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
