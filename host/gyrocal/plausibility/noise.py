"""The noise of the readings, and whether its size is plausible for the stated unit."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.warning import Warning

ROUNDING_DPS = 1e-6
"""Smaller steps come from the rounding of the numbers."""
STRETCHES, LEAST_STRETCH, STILLEST = 16, 32, 0.1
"""Number of stretches of a run, their smallest number of samples, and the stillest part of them, which shows only noise."""
SHEPPARD = 1 / 12
"""Variance, counts^2, that rounding to whole counts adds."""


def still_dps(run: Run, axis: int) -> Array:
    """Readings minus the true rate if it is known at each sample, shape [n], deg/s."""
    run = run.about(AXES[axis])
    about = axis == run.axis_index and not run.rate_is_mean
    return run.gyro_dps[:, axis] - (run.rate_dps if about else 0.0)


def step_dps(session: Session, axis: int) -> float:
    """One count, deg/s: the smallest step of the axis's readings, or the stated one if it is larger; 0 if there is neither."""
    steps = [s for s in (float(r.step_dps[axis]) for r in session.runs) if s > ROUNDING_DPS]
    return max(min(steps, default=0.0), session.lsb_dps or 0.0)


def own_sd_dps(session: Session, axis: int) -> float | None:
    """Noise of one sample without rounding, deg/s: the median over runs with changing readings; None if there are none."""
    step = step_dps(session, axis)
    variances = [
        max(0.0, _change_dps2(r, axis) / 2 - SHEPPARD * step**2) for r in session.runs if np.ptp(r.gyro_dps[:, axis]) > 0
    ]
    return float(np.sqrt(np.median(variances))) if variances else None


def _change_dps2(run: Run, axis: int) -> float:
    """Mean square of a sample's change, (deg/s)^2; that of the stillest tenth if the axis turns unsteadily.

    A noisy reference adds more to readings less true rate than a slow movement adds to readings.
    """
    run = run.about(AXES[axis])
    readings = np.diff(run.gyro_dps[:, axis]) ** 2
    if axis != run.axis_index or (np.ptp(run.rate_dps) == 0 and not run.rate_is_mean):
        return float(readings.mean())
    parts = max(1, min(STRETCHES, readings.size // LEAST_STRETCH))
    left = np.diff(still_dps(run, axis)) ** 2
    return min(float(np.quantile([p.mean() for p in np.array_split(c, parts)], STILLEST)) for c in (readings, left))


def unit_unsure(session: Session, moved: Set[str | None]) -> list[Warning]:
    """``unit_unsure``: no run turns, and the noise differs from the usual by a factor of 57. The files of ``moved`` show motion
    and no noise.
    """
    still = tuple(r for r in session.runs if r.file not in moved)
    if not still or any(r.rate_is_mean or bool(np.any(r.rate_dps)) for r in session.runs):
        return []
    session = replace(session, runs=still)
    usual_dps = POLICY.usual_density_dps * float(np.sqrt(max(session.sample_rate_hz / 2, POLICY.least_band_hz)))
    unstated = replace(session, lsb_dps=None)  # a stated count would be in the right unit
    found = [sd for sd in (own_sd_dps(unstated, i) for i in range(len(AXES))) if sd]
    if not found:
        return []
    ratio = float(np.median(found)) / usual_dps
    steps = [s for r in session.runs for s in r.step_dps if s > 0]
    fine = min(steps, default=0.0) < POLICY.finest_step_dps
    deg = 180 / np.pi
    low, high = 1 / POLICY.density_factor, POLICY.density_factor
    small, large = low < ratio * deg < high and fine, low < ratio / deg < high
    if not (small or large):
        return []
    text = (
        f"no run turns in this session, so dps and rad/s cannot be distinguished. The noise of {np.median(found):.2g} dps is "
        f"{1 / ratio if small else ratio:.0f} times {'less' if small else 'more'} than usual; the readings may be in "
        f"{'rad/s' if small else 'dps already when they were converted'}. Check the unit of --map, and record a known turn"
    )
    return [Warning("unit_unsure", None, None, text)]
