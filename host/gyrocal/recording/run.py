"""A run: the columns of one recording, and the true rate that it shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.angle_slopes import GAP_STEPS
from gyrocal.recording.header import Axis, Face, Reference
from gyrocal.recording.measured_rates import QUATERNION, MeasuredRates, measured_rates
from gyrocal.recording.once import once_a_run
from gyrocal.recording.registration import Registration
from gyrocal.recording.smoothing import NoiseLevel, Smoothed, smoothed, smoothed_temperature
from gyrocal.recording.stamped import right_times, without_jitter
from gyrocal.recording.stamps import in_bursts, regression, step_range_s, weights
from gyrocal.recording.table import check_table, read_table_and_damage
from gyrocal.recording.timing import SYNCHRONOUS, Motion, Timing, between

AXES = ("x", "y", "z")
GAP_PERIODS = 1.5
"""Two samples that are further apart have lost one between them (GC_GAP_PERIODS in the core)."""
MEAN_S = 0.1
"""Time over which readings are averaged to see whether they vary, s."""
OF_FILE = (
    "_read", "t_s", "sample_s", "t_us", "gyro_dps", "step_dps", "acc_g", "temp_c", "smooth_temp", "measured_rates",
)  # fmt: skip
"""Values of a run that depend only on its file, stored once they are read or computed."""
BY_GRAVITY = (
    "the reference is gravity, so no true rate is known; what reads such sessions is compare, diagnose, add, explain, and "
    "calibrate --method model"
)
NO_RATE = (
    "no rate follows from the reference: it needs 16 samples in a row without a gap or a jump. Leave its columns out "
    "and state the run's true rate, as by --rate or --turn-deg when importing"
)
KEPT = (*OF_FILE, "reference_dps", "motion", "one_rate_dps")
"""Values that do not depend on the run's timing."""
Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Run:
    """One recording. Arrays are read from the file at first use and kept.

    Attributes have the names of session.toml's keys; ``rate_dps`` is the true rate about the sensed axis in the sensor's sign.
    """

    index: int
    file: str
    scenario: str
    face: Face
    axis: Axis
    table_rate_dps: float | None
    turn_deg: float | None
    day: int | None
    power_on_s: float | None
    sample_rate_hz: float
    path: Path | None = None
    frame: pl.DataFrame | None = field(default=None, repr=False, compare=False)
    lsb_dps: float | None = None
    latitude_deg: float | None = None
    unread: tuple[str, ...] = ()
    """Keys of the run's entry in session.toml that no command reads."""
    table_rate_se_dps: float | None = None
    """Standard error of ``table_rate_dps``."""
    turn_se_deg: float | None = None
    """Standard error of ``turn_deg``."""
    reference: Reference = field(default_factory=Reference)
    """The session's description of its references."""
    smooth: bool = True
    """False if noisy columns are taken as they are, sample by sample, as the device takes them."""
    timing: Timing = SYNCHRONOUS
    """The timing of the reading relative to the reference; ``rate_dps`` is the true rate with this timing."""
    registration: Registration = field(default_factory=Registration)
    """The reference's frame and clock relative to the sensor's."""
    earlier: tuple[Run, ...] = field(default=(), repr=False, compare=False)
    """The runs of the same power cycle before this one."""
    lost: np.ndarray[Any, np.dtype[np.bool_]] | None = field(default=None, compare=False)
    """True for the samples [n] whose reference is left out, because it shows another motion than the sensor's."""

    @property
    def axis_index(self) -> int:
        """Number of the run's axis, 0 to 2."""
        return AXES.index(self.axis)

    @property
    def face_sign(self) -> float:
        """1 for the face up, -1 for down."""
        return 1.0 if self.face == "up" else -1.0

    @cached_property
    def _read(self) -> tuple[pl.DataFrame, str]:
        if self.frame is not None:
            return check_table(self.frame, self.file), ""
        assert self.path is not None
        return read_table_and_damage(self.path, self.file)

    @property
    def table(self) -> pl.DataFrame:
        """The run's table, checked."""
        return self._read[0]

    @property
    def damage(self) -> str:
        """The rows that were left out of the table, in words; empty if there are none."""
        return self._read[1]

    def __len__(self) -> int:
        return self.table.height

    def __repr__(self) -> str:
        return f"<Run: {self.file}, power cycle {self.scenario}, face {self.face}, axis {self.axis}>"

    @cached_property
    def t_s(self) -> Array:
        """Time in the run, shape [n], s, as in the file."""
        return self.table["t_s"].to_numpy()

    @cached_property
    def sample_s(self) -> Array:
        """Time of each sample, shape [n], s: as in the file, or by regression on its number if times come in bursts, or if
        they jitter and measured orientations do not.
        """
        if not in_bursts(self.t_s):
            found = [self.column(name) for name in QUATERNION]
            orientations = [column for column in found if column is not None]
            return without_jitter(self.t_s, np.column_stack(orientations)) if len(orientations) == len(found) else self.t_s
        stamps = regression(self.t_s)
        forward = step_range_s(self.t_s)[0] > 0  # uneven samples are told from stamps in bursts by their readings
        return self.t_s if forward and right_times(self.t_s, stamps, self.gyro_dps) == "stamps" else stamps.t_s

    @property
    def weights(self) -> Array:
        """The time that each sample stands for over their mean, shape [n]: what makes a mean over samples one over time."""
        return weights(self.sample_s)

    @cached_property
    def t_us(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Whole microseconds since the first sample, shape [n]: what the device sees."""
        us = np.rint(self.t_s * 1e6).astype(np.int64)
        return us - us[0]

    @cached_property
    def gyro_dps(self) -> Array:
        """Measured rates, shape [n, 3], deg/s."""
        return np.stack([self.table[name].to_numpy() for name in ("gx_dps", "gy_dps", "gz_dps")]).T

    @cached_property
    def step_dps(self) -> Array:
        """The smallest step of the readings of each axis, shape [3], deg/s; 0 if all are equal."""
        steps = np.abs(np.diff(self.gyro_dps, axis=0))
        least = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
        return np.where(np.isfinite(least), least, 0.0)

    def count_dps(self, axis: int) -> float:
        """One count of an axis's readings, deg/s: the stated one, else their smallest step; 0 if there is neither."""
        return float(self.lsb_dps or self.step_dps[axis])

    @once_a_run
    def column(self, name: str) -> Array | None:
        """An optional column, shape [n]; missing cells are NaN. None if the file lacks it or has no value in it."""
        if name not in self.table.columns or self.table[name].null_count() == self.table.height:
            return None
        return self.table[name].to_numpy()

    def has(self, name: str) -> bool:
        """True if the run has an optional column, or its time since power-on (``power_on_s``)."""
        return self.power_on_s is not None if name == "power_on_s" else self.column(name) is not None

    @cached_property
    def acc_g(self) -> Array | None:
        """Acceleration, shape [n, 3], g; None unless all three columns are there."""
        parts = [self.column(name) for name in ("ax_g", "ay_g", "az_g")]
        return None if any(p is None for p in parts) else np.column_stack([p for p in parts if p is not None])

    @cached_property
    def temp_c(self) -> Array | None:
        """Temperature, shape [n], degC."""
        return self.column("temp_c")

    @cached_property
    def rate_dps(self) -> Array:
        """True rate about the run's axis in the sensor's sign, shape [n], deg/s, with the reference's noise.

        From the reference where the file has one, else the table's rate. Missing cells of the reference lie on a smooth curve
        through those that are there, because an encoder may be slower than the gyroscope, and in a gap on a line. For a run
        known by its angle alone, it is the mean rate ``turn_deg / duration`` (only its integral is meaningful; see
        :attr:`rate_is_mean`).
        """
        reference = self.reference_dps
        if reference is not None:
            return _filled(self.sample_s, reference) if self.untimed is self else self.untimed.rate_dps + self._moved_dps
        if self.table_rate_dps is not None:
            return np.full(len(self), self.table_rate_dps * self.face_sign)
        if self.measured_rates is not None:
            raise InputError(f"{self.file}: {NO_RATE}")
        if self.turn_deg is None:
            raise InputError(f"{self.file}: {BY_GRAVITY}")
        return np.full(len(self), self.turn_deg * self.face_sign / self.duration_s)

    def beside_rate_dps(self, axis: int) -> Array:
        """The readings of an axis, shape [n], less what follows the true rate: their own slope on it times the rate."""
        rate_dps = self.rate_dps - self.rate_dps.mean()
        readings = self.gyro_dps[:, axis]
        return readings - rate_dps * float(rate_dps @ readings) / (float(rate_dps @ rate_dps) or 1.0)

    @cached_property
    def measured_rates(self) -> MeasuredRates | None:
        """The reference in its own frame and by its own clock; None if the rate is not measured but known."""
        found = measured_rates(self.column, self.sample_s, self.file)
        return found if found is None or self.lost is None else found.without(self.lost)

    @cached_property
    def reference_dps(self) -> Array | None:
        """The measured true rate about the run's axis in the sensor's sign, shape [n], deg/s; NaN if it is missing."""
        measured = self.measured_rates
        found = None if measured is None else measured.about(self.axis_index, self.registration)
        return found if found is not None and np.isfinite(found).any() else None

    @property
    def three_axes(self) -> bool:
        """True if the reference measures the true rate about all three axes."""
        return self.measured_rates is not None and self.measured_rates.three_axes

    def about(self, axis: str) -> Run:
        """The run with the true rate about another axis of the sensor; the run itself unless its reference has three axes."""
        if axis == self.axis or not self.three_axes:
            return self
        views: dict[str, Run] = self.__dict__.setdefault("_views", {self.axis: self})
        if axis not in views:
            still = self.untimed
            views[axis] = self._sharing(OF_FILE, axis=axis) if still is self else still.about(axis)._at(self.timing)
            views[axis].__dict__["_views"] = views
        return views[axis]

    def registered(self, registration: Registration) -> Run:
        """The run with its reference in another frame or by another clock."""
        return self if registration == self.registration else self._sharing(OF_FILE, registration=registration)

    def without_reference(self, samples: np.ndarray[Any, np.dtype[np.bool_]]) -> Run:
        """The run without the reference of some samples [n]."""
        return self._sharing((name for name in OF_FILE if name != "measured_rates"), lost=samples)

    def after(self, earlier: Iterable[Run]) -> Run:
        """The run with others that were recorded before it in its power cycle."""
        return self._sharing(OF_FILE, earlier=tuple(earlier))

    @property
    def earlier_s(self) -> float:
        """Seconds that were recorded in the same power cycle before this run."""
        return sum(run.duration_s for run in self.earlier)

    def turning(self, *, table_rate_dps: float | None = None, turn_deg: float | None = None) -> Run:
        """The run with another known rate of the table, deg/s, or another net turn, deg."""
        return self._sharing(OF_FILE, table_rate_dps=table_rate_dps, turn_deg=turn_deg)

    def _sharing(self, names: Iterable[str], **changes: Any) -> Run:
        """A changed run that keeps what this one has read or computed under these names."""
        out = replace(self, **changes)
        out.__dict__.update({name: self.__dict__[name] for name in names if name in self.__dict__})
        return out

    @cached_property
    def one_rate_dps(self) -> float | None:
        """The mean of a measured rate that is the same all through the run, deg/s; None if it varies.

        It is the same if it varies by less than 1 % of it, or if the readings do, in means of a tenth of a second. What else
        varies is the reference's error: its noise, or the eccentricity of an encoder. The scale must not follow that.
        """
        reference = self.reference_dps
        if reference is None:
            return None
        mean_dps = float(np.nanmean(reference))
        if float(np.nanstd(reference)) < POLICY.one_rate * abs(mean_dps):
            return mean_dps
        read_dps = self.gyro_dps[np.isfinite(reference), self.axis_index]
        samples = max(1, min(round(MEAN_S * self.sample_rate_hz), read_dps.size // 2))
        means_dps = read_dps[: read_dps.size // samples * samples].reshape(-1, samples).mean(axis=1)
        least_dps = min(abs(mean_dps), abs(float(means_dps.mean())))
        return mean_dps if float(means_dps.std()) < POLICY.one_rate * least_dps else None

    @cached_property
    def _smooth_reference(self) -> Smoothed | None:
        """The reference without its noise, which does not depend on the timing; None if the rate is not measured but known.

        The rate of a rest is zero. The residual holds the reference's noise, so a column of what is left of it at rest
        would fit it.
        """
        reference, measured = self.reference_dps, self.measured_rates
        if reference is None or not self.smooth:
            return None
        if self.one_rate_dps is not None:
            noise = NoiseLevel(float(np.nanstd(reference)), 0.0)
            return Smoothed(np.full(len(self), self.one_rate_dps), np.zeros(len(self)), noise)
        if measured is not None and measured.derived:
            steadier = measured.steadier_about(self.axis_index, self.registration)
            return None if steadier is None else steadier.at_most(self.gyro_dps[:, self.axis_index])
        known = np.isfinite(reference)
        found = smoothed(
            reference[known], self.reference.ref_noise_dps, self.gyro_dps[known, self.axis_index]
        ).at_rest()
        return found if known.all() else found.at(self.sample_s, self.sample_s[known])

    @cached_property
    def smooth_rate(self) -> Smoothed | None:
        """The true rate without the reference's noise (``values`` in deg/s); None if the rate is not measured but known."""
        found = self.untimed._smooth_reference
        return found if found is None or self.untimed is self else replace(found, values=found.values + self._moved_dps)

    @cached_property
    def untimed(self) -> Run:
        """The run by the reference's own time, the same for each timing; the run itself if it has no other timing."""
        return self if self.timing == SYNCHRONOUS or self.motion is None else self._sharing(KEPT, timing=SYNCHRONOUS)

    @cached_property
    def _motion_dps(self) -> Array:
        """The smooth rate of the reference at each sample, shape [n], deg/s, by the reference's own time."""
        assert self.motion is not None
        return self.motion.rate_dps(self.sample_s)

    @cached_property
    def _moved_dps(self) -> Array:
        """What the run's timing adds to the rate of each sample, shape [n], deg/s."""
        assert self.motion is not None
        return self.motion.rate_dps(self.sample_s, self.timing) - self.untimed._motion_dps

    @cached_property
    def smooth_temp(self) -> Smoothed | None:
        """The temperature without the thermometer's noise (``values`` in degC); None without a thermometer."""
        if self.temp_c is None or not self.smooth:
            return None
        known = np.isfinite(self.temp_c)
        found = smoothed_temperature(self.temp_c[known], self.t_s[known], self.reference.temp_noise_c)
        return found if known.all() else found.at(self.t_s, self.t_s[known])

    def as_measured(self) -> Run:
        """The run with every column as the device has it: smoothing needs samples that are not there yet."""
        return replace(self, frame=self.table, smooth=False)

    @cached_property
    def motion(self) -> Motion | None:
        """The true rate between the samples of the reference; None if the run has fewer than five."""
        reference = self.reference_dps
        known = np.zeros(0, dtype=bool) if reference is None else np.isfinite(reference)
        return None if reference is None or known.sum() < 5 else Motion(self.sample_s[known], reference[known])

    @cached_property
    def reached(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """False for the samples [n] that show a moment at which no reference was recorded (the first of a delayed run)."""
        if self.motion is None or self.timing == SYNCHRONOUS:
            return self._recorded
        return self.motion.reached(self.sample_s, self.timing)

    @property
    def _recorded(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """True for the samples [n] with a reference; for all of them if the reference is interpolated."""
        measured, rate_dps = self.measured_rates, self.reference_dps
        if measured is None or rate_dps is None or (measured.interpolated and self.registration.same_clock):
            return np.ones(len(self), dtype=bool)
        return np.isfinite(rate_dps)

    def timed(self, timing: Timing) -> Run:
        """The same run with another timing; the run itself if its true rate is constant."""
        if timing == self.timing or self.motion is None:
            return self
        return self.untimed if timing == SYNCHRONOUS else self.untimed._at(timing)

    def _at(self, timing: Timing) -> Run:
        out = self._sharing(KEPT, timing=timing)
        out.__dict__["untimed"] = self
        return out

    @property
    def shown_s(self) -> Array:
        """The moment that each sample shows, shape [n], s; behind a low-pass, that of a slow motion."""
        start_s, timing = self.sample_s[0], self.timing
        return np.asarray(start_s + (1 + timing.clock) * (self.sample_s - start_s) - timing.delay_s - timing.filter_s)

    @property
    def relative_rate_se(self) -> float:
        """Standard error of the stated table rate, as a fraction of the rate; 0 if none is given."""
        return abs(self.table_rate_se_dps / self.table_rate_dps) if self.table_rate_se_dps and self.table_rate_dps else 0.0

    @property
    def rate_is_mean(self) -> bool:
        """True if only the run's net angle is known, and not its rate at each moment."""
        return self.table_rate_dps is None and self.turn_deg is not None and self.reference_dps is None

    @property
    def duration_s(self) -> float:
        """Time from the first sample to one period past the last, s."""
        return float(self.sample_s[-1] - self.sample_s[0]) * len(self) / (len(self) - 1)

    def first(self, seconds: float) -> Run | None:
        """The run's first ``seconds``; None if the run is shorter (docs/details/device.md says how that is judged), or if they
        hold fewer than two samples.
        """
        limit_us = round(seconds * 1e6)
        inside = int(np.searchsorted(self.t_us, limit_us, side="left"))
        if inside < 2:
            return None
        if inside == len(self) and self.t_us[-1] + 1.5e6 / self.sample_rate_hz < limit_us:
            return None
        return self.part(0, inside)

    def part(self, start: int, stop: int) -> Run:
        """Rows ``start:stop`` as a run of its own; a net angle is not known for a part, so ``turn_deg`` goes."""
        whole = start == 0 and stop == len(self)
        power_on_s = None if self.power_on_s is None else self.power_on_s + float(self.t_s[start] - self.t_s[0])
        earlier = (*self.earlier, self.part(0, start)) if start > 1 else self.earlier
        return Run(
            self.index, self.file, self.scenario, self.face, self.axis, self.table_rate_dps,
            self.turn_deg if whole else None, self.day, power_on_s, self.sample_rate_hz,
            frame=self.table.slice(start, stop - start), lsb_dps=self.lsb_dps, latitude_deg=self.latitude_deg,
            table_rate_se_dps=self.table_rate_se_dps, turn_se_deg=self.turn_se_deg, reference=self.reference,
            smooth=self.smooth, registration=self.registration.from_later(float(self.sample_s[start] - self.sample_s[0])),
            lost=None if self.lost is None else self.lost[start:stop], earlier=earlier,
        )  # fmt: skip


def _filled(t_s: Array, rate_dps: Array) -> Array:
    """A reference's rate [n] at times [n], s, with its missing cells filled: on a smooth curve, and in gaps on a line."""
    known = np.isfinite(rate_dps)
    if known.all():
        return rate_dps
    known_s, values = t_s[known], rate_dps[known]
    usual_s = float(np.median(np.diff(known_s))) if known_s.size > 1 else 0.0
    curve = between(known_s, values, t_s, GAP_STEPS * usual_s)
    return np.where(np.isfinite(curve), curve, np.interp(t_s, known_s, values))


def points_up(acc_g: Array, axis: int) -> float:
    """+1 if an axis points up by accelerations [n, 3], g; -1 if it points down, 0 if neither or if gravity turns about it."""
    along = float(np.nanmean(acc_g[:, axis])) / max(float(np.nanmedian(np.linalg.norm(acc_g, axis=1))), 1e-12)
    return float(np.sign(along)) if abs(along) > POLICY.gravity_along else 0.0
