"""Overlapping Allan deviation of data and of the noise model.

White noise with standard deviation sigma per sample at the sample rate f has the Allan deviation ``sigma / sqrt(f tau)``. An
Ornstein-Uhlenbeck drift with standard deviation s and correlation time T has the Allan variance
``s^2 (2 T / tau) (1 - T/(2 tau) (3 - 4 exp(-tau/T) + exp(-2 tau/T)))``. Source: IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import AXES, Array, Run, Session


def averaging_factors(n: int, per_decade: int = 8) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Numbers of samples from 1 to n/3, evenly spaced in their logarithm."""
    top = max(1, n // 3)
    count = max(2, round(per_decade * np.log10(top)) + 1)
    return np.unique(np.geomspace(1, top, count).round().astype(np.intp))


def allan_deviation(series: Sequence[Array], rate_hz: float, factors: Sequence[int] | None = None) -> tuple[Array, Array]:
    """Overlapping Allan deviation pooled over series [n] of a rate in deg/s.

    ``factors`` are the numbers of samples that are averaged; without them, those of :func:`averaging_factors`. Returns the
    averaging times [k] in s and the deviations [k] in deg/s, without those for which every series is too short.
    """
    factors = averaging_factors(max(s.size for s in series)).tolist() if factors is None else factors
    times, deviations = [], []
    for m in factors:
        total, count = 0.0, 0
        for s in series:
            if s.size >= 3 * m:
                angle = np.concatenate([[0.0], np.cumsum(s)])
                second = angle[2 * m :] - 2 * angle[m:-m] + angle[: -2 * m]
                total += float(np.sum(second**2))
                count += second.size
        if count:
            times.append(m / rate_hz)
            deviations.append(np.sqrt(total / (2 * m**2 * count)))
    return np.array(times), np.array(deviations)


WHITE = -0.5, 0.1
"""The slope of white noise over averaging times, both in logarithms, and how far a slope may be from it."""
FLOOR = float(np.sqrt(2 * np.log(2) / np.pi))
"""Allan deviation of flicker noise over its coefficient, the bias instability (IEEE Std 952-1997)."""
WELL_KNOWN = 0.1
"""Up to this part of the longest averaging time, a deviation is known to about a tenth."""


@dataclass(frozen=True)
class AllanFigures:
    """What a datasheet states of a gyroscope's noise, read off its Allan deviation.

    ``noise_density_dps`` is that of white noise, dps/sqrt(Hz), two-sided as Kalibr takes it: a datasheet's is larger by the
    root of 2. It is None where no stretch of the curve falls like white noise. ``bias_instability_dps`` is the lowest deviation
    over 0.664, at the averaging time ``at_s``; without a ``bottom`` of the curve where it is well known, the true one is lower.
    """

    noise_density_dps: float | None
    bias_instability_dps: float
    at_s: float
    bottom: bool

    @property
    def angle_random_walk_deg(self) -> float | None:
        """The same white noise as an angle random walk, deg/sqrt(h)."""
        return None if self.noise_density_dps is None else 60 * self.noise_density_dps

    @staticmethod
    def of(taus_s: Array, deviations_dps: Array) -> AllanFigures | None:
        """The figures of a curve [k]; None of fewer than three points."""
        if taus_s.size < 3:
            return None
        slope = np.gradient(np.log(deviations_dps), np.log(taus_s))
        known = taus_s <= WELL_KNOWN * taus_s[-1]
        white = (np.abs(slope - WHITE[0]) < WHITE[1]) & known
        density = float(np.median(deviations_dps[white] * np.sqrt(taus_s[white]))) if white.any() else None
        lowest = int(np.argmin(deviations_dps))
        return AllanFigures(density, float(deviations_dps[lowest]) / FLOOR, float(taus_s[lowest]), bool(known[lowest]))

    def to_json(self) -> dict[str, Any]:
        return {
            "noise_density_dps_per_rthz": self.noise_density_dps, "angle_random_walk_deg_per_rth": self.angle_random_walk_deg,
            "bias_instability_dps": self.bias_instability_dps, "at_s": self.at_s, "bottom": self.bottom,
        }  # fmt: skip


STEADY, STILL_DPS = 0.03, 1.0
"""Largest variation of a measured true rate that counts as constant: of its mean, and of a rest, deg/s."""


def _turns_steadily(run: Run) -> bool:
    """True if the run is at rest or turns at a constant rate, so that its readings vary by noise alone."""
    if run.table_rate_dps is not None:
        return True
    if run.rate_is_mean or run.measured_rates is None:  # turned by hand
        return False
    for axis in AXES if run.three_axes else (run.axis,):
        rate_dps = run.about(axis).rate_dps
        low, high = np.quantile(rate_dps, [0.01, 0.99])
        if high - low > max(STEADY * abs(float(np.mean(rate_dps))), STILL_DPS):
            return False
    return True


def of_session(session: Session, axis: str = "z", taus_s: Sequence[float] | None = None) -> tuple[Array, Array]:
    """Overlapping Allan deviation of a session's readings, pooled over its runs at rest and at constant rates.

    Args:
        session: the session.
        axis: x, y or z.
        taus_s: averaging times, s, each at most a third of the longest run; they are rounded to whole samples. Without them,
            eight in each decade.

    Returns:
        The averaging times [k], s, and the deviations [k], deg/s.

    Raises:
        InputError: another axis, a time that no run can show, or a session whose runs all move.
    """
    if axis not in AXES:
        raise InputError(f"axis is {axis!r}, not x, y or z")
    runs = [run for run in session.runs if _turns_steadily(run)]
    if not runs:
        raise InputError(
            f"{session.path or 'the session'}: it moves, and the deviation would be that of the motion; record some minutes "
            "of the sensor at rest, and import them with --rate 0"
        )
    rate_hz, longest = session.sample_rate_hz, max(len(run) for run in runs) // 3
    factors = None if taus_s is None else [round(tau_s * rate_hz) for tau_s in taus_s]
    for tau_s, factor in zip(taus_s or (), factors or (), strict=True):
        if not 1 <= factor <= longest:
            ends = f"from {1 / rate_hz:.3g} to {longest / rate_hz:.3g} s"
            raise InputError(f"--taus {tau_s:g}: it cannot be shown; give times {ends}, a sample to a third of the longest run")
    return allan_deviation([run.gyro_dps[:, AXES.index(axis)] for run in runs], rate_hz, factors)


def model_deviation(tau_s: Array, noise: Noise, rate_hz: float) -> Array:
    """Allan deviation of the noise model at averaging times ``tau_s`` [k] in s, shape [k], deg/s."""
    white = noise.white_sd_dps**2 / (rate_hz * tau_s)
    if noise.ou_sd_dps == 0:
        return np.sqrt(white)
    x = tau_s / noise.ou_tau_s
    shape = np.where(
        x > 1e-3, (2 / x) * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * np.maximum(x, 1e-3))), 2 * x / 3
    )
    return np.sqrt(white + noise.ou_sd_dps**2 * shape)
