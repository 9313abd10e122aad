"""A first estimate of how a reference's frame and clock lie relative to the sensor's, by ordinary least squares.

At each offset on a grid, the linear map from the reference to the readings that leaves least is known from their
cross-correlations, whatever the rotation is. The best offsets are refined by Gauss-Newton steps over longer and longer parts of
the recording, in which a clock that runs fast shows. The rotation is found beside scale and
misalignment, from the start that solves Wahba's problem.
:mod:`gyrocal.inference.registering` refines all of it together with the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.lost import lost
from gyrocal.recording.measured_rates import MeasuredRates
from gyrocal.recording.registration import (
    ReferenceParameter,
    Registration,
    RegistrationFit,
    nearest_rotation,
    rotation_deg,
    structured,
)
from gyrocal.recording.session import Run, Session
from gyrocal.recording.timing import SYNCHRONOUS

Array = np.ndarray[Any, np.dtype[np.float64]]

LATEST_S = 2.0
"""Largest offset of the reference's clock, either sign, s."""
LOOKED_S = 60.0
"""A reference that is later than :data:`LATEST_S` is looked for within this time, s, and a quarter of the longest run."""
GRID_HZ = 100.0
CANDIDATES = 8
"""Maxima of the correlation that are refined."""
FIRST_S = 30.0
"""The search looks for no drift of a clock in less than this; it doubles it until it holds the whole recording, s."""
MOST_SAMPLES = 30_000
ROUNDS = 20
SETTLED_S = 1e-7
AMBIGUOUS = 3.0
"""Another offset is an alternative if it leaves more than the best one by less than this many standard errors of that."""
WORSE = 0.5
"""A reference is too late if a later offset leaves less than this part of what the best allowed one leaves."""
CAUCHY = 2.4
"""Scale of Cauchy's loss in medians of the difference: 95 % efficient for Gaussian noise."""
NOISE_ERRORS = 10.0
"""Products of readings and reference below this many standard errors of white noise show no rotation."""
LEAST_OVERLAP = 0.5
"""Part of the samples that readings and reference have in common at an offset; fewer resemble each other by chance."""
COARSE = 0.03
"""Part of the readings' rms above which the noise of a rate from a coarse angle is averaged out, as in the readings."""
ONE_UNIT = 10.0
"""Readings and reference whose sizes differ by more than this factor are in different units, such as rad/s and deg/s."""
ROUNDING = 1e-9
"""Of the products of readings and reference: a motion that is smaller than this fraction is none."""
LEAST_SIZE = 1e-150
"""Stands for the size of a column that is zero, such as the rate of a reference that never turns; its square is a number."""
ROTATIONS = 5
"""Gauss-Newton steps from Wahba's rotation to that beside scale and misalignment."""
PAIRS = ((0, 1), (0, 2), (1, 2))
SLOW_STEPS, FEWEST_MEANS = 8, 20
"""A reference shows means over so many of its steps, of which a run has at least so many."""
LEAST_EXPLAINED = 0.5
"""Smallest fraction of the readings' power that an additional offset must explain."""


def registered(session: Session) -> Session:
    """The session with the frame and the clock of its reference estimated; the session itself if there is nothing to estimate.

    Raises InputError if the reference fits only at an offset of more than :data:`LATEST_S`.
    """
    own_clock, runs = session.reference.clock == "own", _with_reference(session)
    if session.registration_fit is not None or not runs or not (own_clock or runs[0].three_axes):
        return session
    search = _Search([_Reading.of(r) for r in _thinned(runs)])
    fit = search.fit(own_clock)
    moved = [r.registered(fit.registration) for r in session.runs]
    gone = {found.file: found for r in moved if r.three_axes and (found := lost(r)) is not None}
    seen = [r.without_reference(gone[r.file].samples) if r.file in gone and gone[r.file].left_out else r for r in moved]
    return replace(session.with_runs(seen), registration_fit=replace(fit, lost=tuple(gone.values())))


def later_by_s(session: Session) -> float:
    """What is to be added to the times of a reference with a clock of its own, s, where more than :data:`LATEST_S` is missing.

    0 where less is, and where no shift makes the reference fit the readings.
    """
    runs = _with_reference(session) if session.reference.clock == "own" else []
    return (_Search([_Reading.of(r) for r in _thinned(runs)]).later_by_s() or 0.0) if runs else 0.0


def _with_reference(session: Session) -> list[Run]:
    """The runs with a reference whose motion is known; those with three axes, if there are any."""
    runs = [r for r in session.runs if r.measured_rates is not None and r.measured_rates.motions]
    return [r for r in runs if r.three_axes] or runs


def _thinned(runs: Sequence[Run]) -> list[tuple[Run, int]]:
    every = max(1, round(sum(map(len, runs)) / MOST_SAMPLES))
    return [(run, every) for run in runs]


def _mean(columns: Array, samples: int) -> Array:
    """Moving means of columns [n, k] over a number of samples."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(columns, samples, axis=0)) if samples > 1 else columns


def _whole(n: int, samples: int) -> slice:
    """The rows of ``n`` whose moving means over a number of samples hold no row beyond the ends."""
    return slice(samples // 2, n - samples // 2)


@dataclass(frozen=True)
class _Reading:
    """Some samples of a run: times [n], s, readings [n, a] and the reference, a = 3 axes or the run's own."""

    t_s: Array
    y_dps: Array
    reference: MeasuredRates

    @staticmethod
    def of(thinned: tuple[Run, int]) -> _Reading:
        run, every = thinned
        assert run.measured_rates is not None
        y = run.gyro_dps if run.three_axes else run.gyro_dps[:, [run.axis_index]]
        return _Reading(run.sample_s[::every], y[::every], run.measured_rates)

    def rates(self, at_s: Array) -> Array:
        return np.column_stack([m.rate_dps(at_s) for m in self.reference.motions])

    def slopes(self, at_s: Array) -> Array:
        return np.column_stack([-m.by_delay(at_s, SYNCHRONOUS) for m in self.reference.motions])

    def recorded(self, at_s: Array) -> Any:
        return self.reference.motions[0].reached(at_s, SYNCHRONOUS)

    @cached_property
    def noise(self) -> float:
        """The mean square of what smoothing removed from that of the reference's rates from which it removed most, dps^2."""
        known = self.reference.known
        smooth = self.rates(self.reference.t_s[known])
        return float(np.max(np.mean((self.reference.rates_dps[known] - smooth) ** 2, axis=0)))

    @cached_property
    def averaged(self) -> int:
        """The number of samples over which readings and reference are averaged alike: 1 but for a coarse angle.

        The rate of an angle between two counts is off by up to a count over the time between them.
        """
        left_deg, rms_dps = self.reference.left_deg, float(np.sqrt(np.mean(np.var(self.y_dps, axis=0))))
        if left_deg is None or not np.isfinite(left_deg).any() or rms_dps <= 0:
            return 1
        needed_s = np.sqrt(2) * float(np.nanstd(left_deg)) / (COARSE * rms_dps)
        return min(max(1, round(needed_s / float(np.median(np.diff(self.t_s))))), max(1, self.t_s.size // FEWEST_MEANS))

    @cached_property
    def reference_step_s(self) -> float:
        """The usual time from one sample of the reference to the next, s."""
        return float(np.median(np.diff(self.reference.t_s[self.reference.known])))

    @cached_property
    def middle_s(self) -> float:
        """The time about which the motion is strongest, s."""
        power = np.cumsum(np.sum(self.rates(self.t_s) ** 2, axis=1))
        return float(self.t_s[np.searchsorted(power, power[-1] / 2)])


@dataclass(frozen=True)
class _Trial:
    """Least squares at one offset and drift: the mean square left, by axis in ``squares`` [a], and the next step of both.

    ``cross`` [a, k] and ``power`` [k, k] are the mean products of the readings and of the reference with the reference, dps^2;
    ``noise`` is the reference's noise, which flattens the map, ``readings`` the readings' mean square, over all axes.
    """

    offset_s: float
    drift: float
    square: float
    step: Array
    samples: int
    squares: Array
    cross: Array
    power: Array
    noise: float
    readings: float

    @property
    def left(self) -> float:
        """The part of the readings' power that is left. Offsets reach different samples, of which some hardly move."""
        return float(self.squares.sum()) / max(self.readings, 1e-300)

    def rotation(self) -> tuple[Array, bool]:
        """The rotation [3, 3] and whether the readings follow the reference only as its mirror image.

        It starts from Wahba's problem, in which each direction counts by how much the sensor moves in it. A rotation that the
        motion does not show, such as one about the only axis of motion, is the smallest one there.
        """
        from scipy.linalg import block_diag

        noise = NOISE_ERRORS * np.sqrt(self.square * max(float(np.linalg.eigvalsh(self.power)[0]), 0.0) / self.samples)
        least = ROUNDING * float(np.linalg.norm(self.cross)) or 1.0
        rotation, proper = nearest_rotation(self.cross + max(noise, least) * np.eye(3))
        sizes = np.linalg.svd(self.cross, compute_uv=False)
        turned = max(float(np.trace(self.power)), LEAST_SIZE)
        size = max(sizes @ [1, 1, 1], sizes @ [1, 1, -1]) / turned
        unit = 1.0 if 1 / ONE_UNIT < size < ONE_UNIT or size <= 0 else size
        left = [self.readings - float(sizes @ [1, 1, sign]) ** 2 / turned for sign in (1, -1)]
        inverse = np.linalg.pinv(self.power, rcond=1e-9)
        flattened = inverse * self.noise
        known = [np.linalg.pinv(inverse * left / self.samples + flattened @ flattened.T) for left in self.squares]
        for _ in range(ROTATIONS):
            weight = block_diag(*(rotation @ of_axis @ rotation.T for of_axis in known))
            off = self.cross / unit @ inverse @ rotation.T - np.eye(3)
            step = structured(weight, weight @ off.reshape(-1), PAIRS)
            rotation = Registration(tuple(np.rad2deg(step.rotation))).matrix @ rotation
        return rotation, not proper and left[0] < WORSE * left[1]


class _Search:
    def __init__(self, readings: Sequence[_Reading]) -> None:
        self.readings = readings
        self.longest_s = max(float(r.t_s[-1] - r.t_s[0]) for r in readings)

    def fit(self, own_clock: bool) -> RegistrationFit:
        best = self.trial(0.0, 0.0, self.longest_s)
        alternatives: tuple[float, ...] = ()
        drifts = own_clock and self.longest_s >= FIRST_S
        if own_clock:
            best, alternatives = self._timed(drifts)
        best = self.trial(best.offset_s, best.drift, self.longest_s, robust=True)
        turning = best.cross.shape[0] == 3
        rotation, mirrored = best.rotation() if turning else (np.eye(3), False)
        registration = Registration(rotation_deg(rotation), best.offset_s, best.drift)
        angles_deg = zip("xyz", registration.rotation_deg, strict=True)
        parameters = [ReferenceParameter("alignment", f"r{a}_deg", angle, None) for a, angle in angles_deg]
        parameters = parameters if turning else []
        if own_clock:
            parameters.append(ReferenceParameter("time_offset", "offset_s", best.offset_s, None))
            parameters.append(ReferenceParameter("clock_drift", "e", best.drift, None))
        left = min(best.left, self._left_slowly(best))
        return RegistrationFit(registration, tuple(parameters), alternatives, mirrored, best.readings**0.5, left)

    def _left_slowly(self, best: _Trial) -> float:
        """The part of the power of slow means of the readings that the best linear map of the reference's leaves.

        A reference with few samples cannot show what is faster, such as the steps of who carries the sensor.
        """
        pairs = []
        for r in self.readings:
            at_s = Registration(offset_s=best.offset_s, drift=best.drift).moment_s(r.t_s)
            use = r.recorded(at_s)
            size = round(SLOW_STEPS * r.reference_step_s / float(np.median(np.diff(r.t_s))))
            if size > 1 and use.sum() > FEWEST_MEANS * size:
                pairs.append([_mean(v[use] - v[use].mean(axis=0), size) for v in (r.y_dps, r.rates(at_s))])
        if not pairs:
            return 1.0
        y, w = (np.concatenate(columns) for columns in zip(*pairs, strict=True))
        left = y - w @ np.linalg.lstsq(w, y, rcond=None)[0]
        return float(np.sum(left**2) / max(float(np.sum(y**2)), 1e-300))

    def _timed(self, drifts: bool) -> tuple[_Trial, tuple[float, ...]]:
        starts = self._starts_s()
        span_s = min(FIRST_S, self.longest_s)
        trials = sorted((self._refined(self.trial(o, 0.0, span_s), span_s, False) for o in starts), key=lambda t: t.left)
        best = trials[0]
        allowed = best.left * (1 + AMBIGUOUS * np.sqrt(2 / best.samples))
        others = {round(t.offset_s, 3) for t in trials[1:] if t.left < allowed and abs(t.offset_s - best.offset_s) > 0.02}
        while drifts:
            best = self._refined(self.trial(best.offset_s, best.drift, span_s), span_s, True)
            if span_s >= self.longest_s:
                break
            span_s = min(2 * span_s, self.longest_s)
        return best, tuple(sorted(o for o in others if abs(o) <= LATEST_S))

    def trial(self, offset_s: float, drift: float, span_s: float, *, robust: bool = False) -> _Trial:
        """Least squares of the readings on the reference, with an offset of each run, over ``span_s`` about the motion.

        ``robust``: samples that lie far off count less (Cauchy's loss), as where a tracker lost the sensor.
        """
        a = self.readings[0].y_dps.shape[1]
        parts = []
        for r in self.readings:
            at_s = Registration(offset_s=offset_s, drift=drift).moment_s(r.t_s)
            use = r.recorded(at_s) & (np.abs(r.t_s - r.middle_s) <= max(span_s / 2, span_s - (r.t_s[-1] - r.t_s[0]) / 2))
            if use.sum() < 4 * (a + 1) + r.averaged - 1:
                continue
            w, slope, y, t = r.rates(at_s[use]), r.slopes(at_s[use]), r.y_dps[use], r.t_s[use, None] - r.t_s[0]
            w, slope, y, t = (_mean(v, r.averaged)[_whole(len(v), r.averaged)] for v in (w, slope, y, t))
            parts.append((y - y.mean(axis=0), w - w.mean(axis=0), slope, slope * t))
        if not parts:
            raise InputError(self._too_few(4 * (a + 1)))
        y, w, slope, late = (np.concatenate([p[i] for p in parts]) for i in range(4))
        found = np.linalg.lstsq(w, y, rcond=None)[0]
        left = y - w @ found
        if robust:
            for _ in range(ROUNDS):
                off = np.linalg.norm(left, axis=1)
                root = 1 / np.hypot(1.0, off / (CAUCHY * np.median(off) + 1e-300))[:, None]
                found = np.linalg.lstsq(root * w, root * y, rcond=None)[0]
                left = y - w @ found
            root = root / np.sqrt(np.mean(root**2))
            y, w, left = root * y, root * w, root * left
        columns = np.stack([-(slope @ found), late @ found], axis=-1)  # by offset and by drift, [n, a, 2]
        columns = columns - columns.mean(axis=0)
        columns -= np.einsum("nk,kac->nac", w, np.linalg.lstsq(w, columns.reshape(len(w), -1), rcond=None)[0].reshape(-1, a, 2))
        size = np.sqrt(np.sum(columns**2, axis=(0, 1))) + LEAST_SIZE
        step = np.linalg.lstsq(columns.reshape(-1, 2) / size, left.reshape(-1), rcond=1e-9)[0] / size
        only_offset = float(columns[..., 0].reshape(-1) @ left.reshape(-1)) / size[0] ** 2
        return _Trial(
            offset_s, drift, float(np.mean(left**2)), np.array([*step, only_offset]), left.size, np.mean(left**2, axis=0),
            y.T @ w / len(w), w.T @ w / len(w), max(r.noise for r in self.readings), float(np.sum(y**2)) / len(y),
        )  # fmt: skip

    def _too_few(self, least: int) -> str:
        r = self.readings[0]
        known_s = r.reference.t_s[r.reference.known]
        if known_s[0] <= r.t_s[-1] and known_s[-1] >= r.t_s[0]:
            return f"the reference covers fewer than {least} samples of the readings; record longer"
        return "reference and readings do not overlap in time: shift the reference's times and import again"

    def _refined(self, trial: _Trial, span_s: float, drifts: bool) -> _Trial:
        """Gauss-Newton steps, halved until less of the readings' power is left."""
        for _ in range(ROUNDS):
            offset_s, drift = (trial.step[0], trial.step[1]) if drifts else (trial.step[2], 0.0)
            for halved in (1.0, 0.5, 0.25, 0.1):
                try:
                    following = self.trial(trial.offset_s + halved * offset_s, trial.drift + halved * drift, span_s)
                except InputError:  # so far off that the reference reaches too few readings
                    continue
                if following.left < trial.left:
                    break
            else:
                return trial
            moved_s = abs(following.offset_s - trial.offset_s)
            trial = following
            if moved_s < SETTLED_S:
                break
        return trial

    def _starts_s(self) -> list[float]:
        """Offsets at which the readings follow the reference best, on a grid within :data:`LATEST_S`.

        Raises InputError if they follow it only at a larger one.
        """
        later_s = self.later_by_s()
        if later_s is not None:
            raise InputError(
                f"the reference fits the readings only if its times are shifted by {later_s:+.2f} s, more than "
                f"{LATEST_S:g} s. Add {later_s:.2f} s to the reference's times and import again"
            )
        lags_s, left = self._left
        low = np.flatnonzero(np.abs(lags_s) <= LATEST_S)
        padded = np.concatenate([[np.inf], left[low], [np.inf]])
        minima = low[(padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:])]
        return [float(lags_s[i]) for i in minima[np.argsort(left[minima])][:CANDIDATES]]

    def later_by_s(self) -> float | None:
        """The offset beyond :data:`LATEST_S` at which alone the readings follow the reference; None if there is no such one."""
        lags_s, left = self._left
        inside = np.abs(lags_s) <= LATEST_S
        best_in, best_out = float(left[inside].min()), int(np.argmin(left))
        late = not inside[best_out] and left[best_out] < min(WORSE * best_in, 1 - LEAST_EXPLAINED)
        return float(lags_s[best_out]) if late else None

    @cached_property
    def _left(self) -> tuple[Array, Array]:
        """Offsets of the grid [m], s, and the part of the readings' power [m] that the best linear map leaves at each."""
        step_s = max(1 / GRID_HZ, min(float(np.median(np.diff(r.t_s))) for r in self.readings))
        most = round(min(LOOKED_S, max(LATEST_S, self.longest_s / 4)) / step_s)
        sums = [_Sums.of(r, step_s, most) for r in self.readings]
        cross, power, total = (sum(getattr(of_run, name) for of_run in sums) for name in ("cross", "power", "total"))
        enough = sum(of_run.samples for of_run in sums) >= LEAST_OVERLAP * sum(of_run.samples.max() for of_run in sums)
        maps = cross @ np.linalg.pinv(power, rcond=1e-9)
        explained = np.sum(maps * cross, axis=(1, 2))
        left = np.where(enough, 1 - explained / np.maximum(total, 1e-300), 1.0)
        return np.asarray(step_s * np.arange(-most, most + 1)), left


@dataclass(frozen=True)
class _Sums:
    """Sums over the samples that a run's readings and its reference have in common at each offset [m], about their means.

    ``cross`` [m, a, k] and ``power`` [m, k, k] are those of the products with the reference of the readings and of itself,
    ``total`` [m] that of the readings' squares, and ``samples`` [m] how many they are.
    """

    cross: Array
    power: Array
    total: Array
    samples: Array

    @staticmethod
    def of(r: _Reading, step_s: float, most: int) -> _Sums:
        """The sums at offsets of up to ``most`` steps of ``step_s``, s, either sign."""
        even_s = np.arange(r.t_s[0], r.t_s[-1], step_s)
        over = round(r.averaged * float(np.median(np.diff(r.t_s))) / step_s)
        y = np.column_stack([np.interp(even_s, r.t_s, column) for column in r.y_dps.T])
        y, w, there = _mean(y - y.mean(axis=0), over), _mean(r.rates(even_s), over), r.recorded(even_s)
        mine, whole = np.zeros(len(y)), _whole(len(y), over)
        mine[whole], there[: whole.start], there[whole.stop :] = 1.0, False, False
        y, w = y * mine[:, None], np.where(there[:, None], w - w[there].mean(axis=0) if there.any() else 0.0, 0.0)
        a, k = y.shape[1], w.shape[1]
        size = 2 ** int(np.ceil(np.log2(max(even_s.size, most) + most + 1)))
        pairs = [(i, j) for i in range(k) for j in range(i, k)]
        of_readings = np.fft.rfft(np.column_stack([mine, y, np.sum(y**2, axis=1)]), size, axis=0)
        other = np.fft.rfft(np.column_stack([there, w, *(w[:, i] * w[:, j] for i, j in pairs)]), size, axis=0).conj()

        def over_both(i: int, j: int) -> Array:
            return np.roll(np.fft.irfft(of_readings[:, i] * other[:, j], size), most)[: 2 * most + 1]

        samples = np.maximum(np.rint(over_both(0, 0)), 0.0)
        n = np.maximum(samples, 1.0)
        of_y = np.column_stack([over_both(1 + i, 0) for i in range(a)])
        of_w = np.column_stack([over_both(0, 1 + j) for j in range(k)])
        cross = np.array([[over_both(1 + i, 1 + j) for j in range(k)] for i in range(a)]).transpose(2, 0, 1)
        power = np.empty((n.size, k, k))
        for at, (i, j) in enumerate(pairs):
            power[:, i, j] = power[:, j, i] = over_both(0, 1 + k + at) - of_w[:, i] * of_w[:, j] / n
        total = over_both(1 + a, 0) - np.sum(of_y**2, axis=1) / n
        return _Sums(cross - of_y[:, :, None] * of_w[:, None, :] / n[:, None, None], power, total, samples)
