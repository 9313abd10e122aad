"""Statistics of each run for the checks: mean rate and mean reading of every axis, and the slope if the true rate varies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Set
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.registration import SCALE_SD
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.tails import ROBUST
from gyrocal.warning import Warning

CLUSTERS = 16
"""Number of segments of a run whose scatter gives standard errors. Noise within a segment may be correlated."""


@dataclass(frozen=True)
class Mean:
    """Statistics of one run on one axis. ``slope`` and ``offset_dps`` come from a regression if the true rate varies, else
    they are None.
    """

    run: Run
    rate_dps: float
    mean_dps: float
    se_dps: float
    slope: float | None = None
    slope_se: float = 0.0
    offset_dps: float = 0.0
    omega_rad_s: float = 0.0
    """Root mean square angular frequency of the true rate, rad/s; 0 if the rate does not vary."""
    explained: float = 1.0
    """The part of the readings' power that the slope explains, beside the true rates about other axes."""

    @property
    def rests(self) -> bool:
        """True for a constant true rate of about zero."""
        return self.slope is None and abs(self.rate_dps) < POLICY.rest_dps


class Means:
    """Means of all runs of a session on all axes, without ``skip``: pairs (axis, file) of useless readings (None: any file)."""

    def __init__(self, session: Session, skip: Set[tuple[str | None, str | None]] = frozenset()) -> None:
        self.session, self._skip = session, skip

    @cached_property
    def by_axis(self) -> dict[str, list[Mean]]:
        """The statistics of every run for each axis of the readings.

        The true rate is that about the run's own axis, or about each axis if the reference has three.
        """
        return {
            axis: [_mean(r, i) for r in self.session.about(axis).runs if self._says(axis, r)] for i, axis in enumerate(AXES)
        }  # fmt: skip

    def _says(self, axis: str, run: Run) -> bool:
        return not {(axis, run.file), (axis, None)} & self._skip

    def about(self, table_axis: str, axis: str | None = None) -> list[Mean]:
        """Readings of ``axis`` (the table's by default) in the runs about ``table_axis``."""
        return [m for m in self.by_axis[axis or table_axis] if m.run.axis == table_axis]

    @property
    def turned(self) -> list[str]:
        """Axes about which the table turns in some run."""
        return [a for a in AXES if any(not m.rests for m in self.about(a))]


def _mean(run: Run, axis: int) -> Mean:
    known = run.reached if run.reached.any() else np.ones(len(run), dtype=bool)  # without what lies in a gap of the reference
    y, rate = run.gyro_dps[known, axis], run.rate_dps[known]
    varies_dps = 0.0 if run.rate_is_mean or run.one_rate_dps is not None else float(np.std(rate))
    if varies_dps > POLICY.rest_dps and (varies_dps > POLICY.rate_varies_dps or _follows(y, rate)):
        lag, others = lag_samples(y, rate, longest_lag(run)), _others_dps(run)[:, known]
        others = np.array([_shifted(y, other, lag)[1] for other in others])
        y, rate = _shifted(y, rate, lag)
        samples = max(1, round(POLICY.slow_s * run.sample_rate_hz)) if run.three_axes else _samples_to_tell(run, rate)
        slow = [_block_means(values, samples) for values in (y, rate, *others)]
        beside = np.array(slow[2:]).reshape(len(others), slow[0].size)
        line = _regression(slow[0], slow[1], beside, _noise_dps(run) / samples**0.5, _size(run))
        return Mean(
            run, float(rate.mean()), float(y.mean()), 0.0, line.slope, line.slope_se, line.offset_dps, _omega_rad_s(run),
            line.explained,
        )  # fmt: skip
    if run.rate_is_mean:  # the variation comes from the turn itself
        return Mean(run, float(rate.mean()), float(y.mean()), 0.0)
    return Mean(run, float(rate.mean()), float(y.mean()), clustered_se(np.ones(y.size), y - y.mean()))


def _omega_rad_s(run: Run) -> float:
    """Root mean square angular frequency of the true rate without the reference's noise, rad/s."""
    rate_dps = run.rate_dps if run.smooth_rate is None else run.smooth_rate.values
    return float(np.sqrt(np.mean(np.gradient(rate_dps, run.sample_s) ** 2) / max(float(np.var(rate_dps)), 1e-300)))


def _follows(y: Array, rate: Array) -> bool:
    """True if a reading follows a reference of small variation, such as one in rad/s, rather than the noise of an encoder."""
    return bool(np.ptp(y) > 0) and abs(float(np.corrcoef(y, rate)[0, 1])) > POLICY.follows_correlation


class _Regression(NamedTuple):
    """A straight line of readings over the true rate; the offset is in deg/s. It explains a part of the readings' power."""

    slope: float
    slope_se: float
    offset_dps: float
    explained: float


def _others_dps(run: Run) -> Array:
    """The true rates about the other axes [2, n], deg/s, against a reference with three axes; else none, [0, n]."""
    others = [run.about(name).rate_dps for name in AXES if name != run.axis] if run.three_axes else []
    return np.array(others).reshape(len(others), len(run))


def _block_means(values: Array, samples: int) -> Array:
    """Means of successive blocks of ``samples`` of values [n]; what is left at the end is not used."""
    samples = max(1, min(samples, values.size // CLUSTERS))
    return np.asarray(values[: values.size // samples * samples].reshape(-1, samples).mean(axis=1))


def _samples_to_tell(run: Run, rate: Array) -> int:
    """Samples of the shortest means of a true rate [n] that the noise of its angle hardly changes; 1 without such a noise."""
    left_deg = None if run.measured_rates is None else run.measured_rates.left_deg
    if left_deg is None or not np.isfinite(left_deg).any():
        return 1
    noise_deg, samples = 2**0.5 * float(np.nanstd(left_deg)), 1
    while samples * CLUSTERS < rate.size:
        moved_deg = _block_means(rate, samples).std() * samples / run.sample_rate_hz
        if noise_deg < POLICY.told_noise * moved_deg:
            break
        samples *= 2
    return samples


def _noise_dps(run: Run) -> float:
    return run.smooth_rate.noise.sd if run.three_axes and run.smooth_rate is not None else 0.0


def _size(run: Run) -> float:
    """How large the readings are beside the true rates, over all axes: 1 unless the unit of one of both is wrong."""
    if not run.three_axes:
        return 1.0
    true_dps = np.column_stack([run.about(name).rate_dps for name in AXES])[run.reached]
    power = float(np.sum(np.var(true_dps, axis=0)))
    return float(np.sqrt(np.sum(np.var(run.gyro_dps[run.reached], axis=0)) / max(power, 1e-300)))


def _regression(y: Array, rate: Array, others: Array, noise_dps: float, size: float) -> _Regression:
    """A straight line of readings [n] over the true rate [n], beside the true rates about other axes [m, n].

    An axis about which the sensor hardly turns reads a little of its large rates about the others, and not always the same. The
    part of the true rate that is noise of ``noise_dps`` in each sample flattens the line. The standard error contains both, for
    readings of that ``size`` beside the true rates.
    """
    about, beside = rate - rate.mean(), (others - others.mean(axis=1, keepdims=True)).T
    about, leaked = beside_others(about, beside)
    slope = float(about @ y) / float(about @ about)
    left = y - y.mean() - slope * (rate - rate.mean())
    left = left - beside @ np.linalg.lstsq(beside, left, rcond=None)[0]
    flattened = min(noise_dps**2 * y.size / float(about @ about), 1.0)
    se = float(np.linalg.norm([clustered_se(about, left), size * flattened, size * leaked]))
    shown = slope**2 * float(about @ about)
    explained = shown / max(shown + float(left @ left), 1e-300)
    return _Regression(slope, se, float(y.mean() - slope * rate.mean()), explained)


def beside_others(own: Array, others: Array) -> tuple[Array, float]:
    """The part of a rate [n] that tells its axis's scale beside the rates about other axes [n, m], and the error of the scale
    by what the axis reads of those.

    It is what does not follow the other rates, whatever the axis reads of them. Where hardly anything is left, as where the
    sensor turns about one axis only, it is the whole rate, if an alignment by scales within ``SCALE_SD`` errs less.
    """
    alone = own - others @ np.linalg.lstsq(others, own, rcond=None)[0] if others.any() else own
    other, whole, left = (max(float(np.sqrt(np.sum(v**2))), 1e-150) for v in (others, own, alone))
    by_part, by_whole = POLICY.leak * other / left, POLICY.leak * other / whole + SCALE_SD * (other / whole) ** 2
    return (alone, by_part) if by_part <= by_whole else (own, by_whole)


def told_by_others(run: Run, axis: str) -> bool:
    """True if what an axis reads of the rates about the others may be as large as its own rate, so that it has no scale."""
    at = run.reached
    own, others = run.about(axis).rate_dps[at], np.array([run.about(name).rate_dps[at] for name in AXES if name != axis]).T
    return bool(at.any()) and beside_others(own - own.mean(), others - others.mean(axis=0))[1] >= 1


def clustered_se(x: Array, residual: Array) -> float:
    """Standard error of a regression on ``x`` [n] with ``residual`` [n] correlated within each of :data:`CLUSTERS` segments.

    The sandwich estimator of Liang and Zeger, Biometrika 73 (1986) 13.
    """
    edges = np.unique(np.linspace(0, x.size, CLUSTERS + 1).astype(np.intp))[:-1]
    scores = np.add.reduceat(x * residual, edges)
    k = max(2, edges.size)
    return float(np.sqrt(float(scores @ scores) * k / (k - 1)) / float(x @ x))


def lag_samples(y: Array, rate: Array, longest: int) -> int:
    """Delay of reading ``y`` [n] behind the true ``rate`` [n] with the best correlation, at most ``longest`` either way."""

    def fits(lag: int) -> float:
        a, b = _shifted(y, rate, lag)
        a, b = a - a.mean(), b - b.mean()
        return abs(float(a @ b)) / max(float(np.sqrt((a @ a) * (b @ b))), 1e-300)

    lag, best = 0, fits(0)
    longest = min(longest, y.size // 4)
    step = max((1, -1), key=lambda s: fits(s) if longest else 0.0)
    while abs(lag + step) <= longest and (value := fits(lag + step)) > best:
        lag, best = lag + step, value
    return lag


def longest_lag(run: Run) -> int:
    """Samples of the longest delay that is no contradiction."""
    return round(POLICY.longest_lag_s * run.sample_rate_hz)


def _shifted(y: Array, rate: Array, lag: int) -> tuple[Array, Array]:
    n = y.size - abs(lag)
    return (y[lag:], rate[:n]) if lag >= 0 else (y[:n], rate[-lag:])


def spread(values: Array) -> float:
    """Standard deviation of the bulk of values [n], from the median of their distances to the median."""
    return ROBUST * float(np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def told(
    session: Session, code: str, axis: str | None, runs: Iterable[Run], text: Callable[[Run | None], str], blocking: bool
) -> list[Warning]:
    """One warning for each run, or a single one without a file if it applies to all runs about the axis."""
    hit = list(runs)
    concerned = [r for r in session.runs if r.axis == axis or axis is None] or list(session.runs)
    if len(hit) > 1 and len(hit) >= len(concerned):
        return [Warning(code, axis, None, text(None), blocking)]
    return [Warning(code, axis, run.file, text(run), blocking) for run in hit]
