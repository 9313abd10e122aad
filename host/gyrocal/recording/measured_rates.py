"""The true rate as a reference measured it: about one axis or three, in the reference's own frame and by its own clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.angle_slopes import angle_slopes
from gyrocal.recording.orientation import turned_deg
from gyrocal.recording.registration import Registration
from gyrocal.recording.smoothing import Smoothed
from gyrocal.recording.timing import REACH, SYNCHRONOUS, Motion

Array = np.ndarray[Any, np.dtype[np.float64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]
Index = np.ndarray[Any, np.dtype[np.intp]]
Column = Callable[[str], Array | None]

RATES = ("ref_x_dps", "ref_y_dps", "ref_z_dps")
QUATERNION = ("ref_qw", "ref_qx", "ref_qy", "ref_qz")
THREE_AXES = (*RATES, *QUATERNION)
ANGLE = "ref_angle_deg"
REFERENCES = (*THREE_AXES, "rate_ref_dps", ANGLE)
END_STEPS = 10
"""Steps of the reference from each of its ends within which a smooth curve through it is not relied on."""


@dataclass(frozen=True)
class MeasuredRates:
    """Rates [n, k] in deg/s at the times ``t_s`` [n], s, NaN where missing.

    k is 1 (in the sensor's sign) or 3 (in the reference's frame). ``jumps`` counts the
    places at which an orientation or angle jumped; the samples beside them are missing.
    """

    t_s: Array
    rates_dps: Array
    jumps: int = 0
    derived: bool = False
    """True if the rates are slopes of angles, whose noise grows with frequency."""
    steadier: Smoothed | None = None
    """Of orientations: the rates with less noise, by which the readings are sorted and whose multiples are fitted; [n, 3]."""
    noisy: Mask | None = None
    """Of orientations: True for the samples [n] that were left out because they are much noisier than usual."""
    left_deg: Array | None = None
    """Of one measured angle, whose slopes the rates are: the angle minus the smooth curve through it, [n], deg."""
    noise_dps: float = 0.0
    """The noise of these slopes, deg/s."""
    reach: int = 0
    """Samples from a corner of the motion within which slopes of angles are those of a round curve."""
    interpolated: bool = False
    """True if missing samples lie on a curve through those that are there: a table's encoder may be slower than the sensor."""

    @property
    def three_axes(self) -> bool:
        """True if the reference measures the rate about three axes."""
        return self.rates_dps.shape[1] == 3

    def without(self, samples: Mask) -> MeasuredRates:
        """The rates without those of some samples [n]."""
        return replace(self, rates_dps=np.where(samples[:, None], np.nan, self.rates_dps))

    @cached_property
    def known(self) -> Mask:
        """True for the samples [n] that have a reference."""
        return np.asarray(np.isfinite(self.rates_dps).all(axis=1))

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """The smooth motion between the samples about each of the reference's own axes; empty for fewer than five samples."""
        if self.known.sum() < 5:
            return ()
        return tuple(Motion(self.t_s[self.known], rate, twice=True) for rate in self.rates_dps[self.known].T)

    def about(self, axis: int, registration: Registration) -> Array:
        """The rate about a sensor's axis at the times of the samples, [n], deg/s; NaN where nothing was recorded.

        Moved to another time, the rate is that of the smooth motion and keeps the noise of its own sample, so that no offset
        gains by smoothing.
        """
        rates = self.rates_dps
        if not registration.same_clock and self.motions:
            at_s = registration.moment_s(self.t_s)
            noise = rates - np.column_stack([m.rate_dps(self.t_s) for m in self.motions])
            kept = self.known & self._inside(self.t_s)
            moved = np.column_stack([m.rate_dps(at_s) for m in self.motions]) + np.where(kept[:, None], noise, 0.0)
            rates = np.where(self._inside(at_s)[:, None], moved, np.nan)
        return np.asarray(rates @ registration.matrix[axis] if self.three_axes else rates[:, 0])

    def steadier_about(self, axis: int, registration: Registration) -> Smoothed | None:
        """The rate about a sensor's axis with less noise, [n], deg/s; None unless the rates come from orientations."""
        if self.steadier is None or not self.known.any():
            return None
        row, known = registration.matrix[axis], self.known
        at_s = registration.moment_s(self.t_s)
        steadier = self.steadier
        of_angle = None if steadier.of_angle is None else steadier.of_angle[known] @ row**2
        values, error = steadier.values[known] @ row, steadier.error[known] @ row**2
        return Smoothed(values, error, steadier.noise, of_angle).at(at_s, self.t_s[known])

    def slope_about(self, axis: int, registration: Registration) -> Array:
        """The rate's slope at the moment that each sample shows, [n], deg/s^2: minus its derivative by the offset."""
        at_s = registration.moment_s(self.t_s)
        slopes = np.column_stack([-m.by_delay(at_s, SYNCHRONOUS) for m in self.motions])
        return np.asarray(slopes @ registration.matrix[axis] if self.three_axes else slopes[:, 0])

    def _inside(self, at_s: Array) -> Mask:
        """True for the moments [n] at which the smooth motion is known: not in a gap of the reference, nor near its ends."""
        known_s = self.t_s[self.known]
        steps_s = np.diff(known_s)
        step_s = float(known_s[-1] - known_s[0]) / steps_s.size
        gaps = np.flatnonzero(steps_s > 2 * REACH * step_s)
        ends_s = np.sort(np.concatenate([known_s[[0, -1]], known_s[gaps], known_s[gaps + 1]]))
        after = np.searchsorted(ends_s, at_s)
        nearest_s = np.minimum(np.abs(at_s - ends_s[np.minimum(after, ends_s.size - 1)]), np.abs(at_s - ends_s[after - 1]))
        return np.asarray((after % 2 == 1) & (nearest_s >= END_STEPS * step_s))


def measured_rates(column: Column, t_s: Array, label: str) -> MeasuredRates | None:
    """The reference among the columns of a run, at the times ``t_s`` [n], s; None if the run has none.

    Three axes are preferred to one. Raises InputError for invalid quaternions, or if a column of a reference is missing.
    """
    three, quaternion = _together(column, RATES, label), _together(column, QUATERNION, label)
    if three is not None:
        return MeasuredRates(t_s, three)
    if quaternion is not None:
        return _of_orientation(t_s, quaternion, label)
    rate = column("rate_ref_dps")
    if rate is not None:
        return MeasuredRates(t_s, rate[:, None], interpolated=True)
    angle = column(ANGLE)
    if angle is None:
        return None
    found = angle_slopes(t_s, np.isfinite(angle), lambda rows: np.diff(angle[rows])[:, None])
    return MeasuredRates(
        t_s, found.rates, found.jumps, derived=True, left_deg=found.left_deg[:, 0], noise_dps=found.noise_dps, reach=found.reach
    )


def _together(column: Column, names: tuple[str, ...], label: str) -> Array | None:
    """Columns that belong together, [n, k]; None if none of them is there."""
    found = [column(name) for name in names]
    if all(c is None for c in found):
        return None
    absent = [name for name, c in zip(names, found, strict=True) if c is None]
    if absent:
        raise InputError(f"{label}: the reference lacks {', '.join(absent)}; give all of {', '.join(names)}")
    return np.column_stack([c for c in found if c is not None])


def _of_orientation(t_s: Array, quaternion: Array, label: str) -> MeasuredRates:
    known = np.asarray(np.isfinite(quaternion).all(axis=1) & quaternion.any(axis=1))  # zeros: the tracker saw nothing
    if not known.any():
        raise InputError(
            f"{label}: no row has an orientation. Leave out ref_qw, ref_qx, ref_qy, ref_qz and give the run's true rate: "
            "table_rate_dps = 0 if it was at rest (--rate 0 when importing)"
        )

    def turned(rows: Index) -> Array:
        return turned_deg(quaternion[rows], label)

    found = angle_slopes(t_s, known, turned, steadier=True)
    noisy = found.noisy()
    if noisy.any():
        found = angle_slopes(t_s, known & ~noisy, turned, steadier=True)
    return MeasuredRates(
        t_s, found.rates, found.jumps, derived=True, steadier=found.steadier, noisy=noisy, reach=found.reach
    )
