"""Whether the rates are of the size that leads gravity from rest to rest, or of another one by some factor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.gravity.rests import Movement, Rest
from gyrocal.policy import POLICY
from gyrocal.recording.gravity_turns import after_turn
from gyrocal.recording.session import Array, Session
from gyrocal.tails import ROBUST
from gyrocal.warning import Warning

STEP = 1.05
"""Factors are tried in steps of this part, and about the best one in steps of a twelfth of it."""
NEXT_RANGES = (0.25, 0.5, 2.0, 4.0)
NEAR = 0.05
"""A factor is that of another range of the sensor within this part."""


def path_of_turn(session: Session, rests: Sequence[Rest], movements: Sequence[Movement], turned_deg: Array) -> float | None:
    """The path by the gyroscope over the turn of gravity [movements], in the median movement that turns it clearly.

    None where none does.
    """
    parts = []
    for m, turned in zip(movements, turned_deg, strict=True):
        run = session.runs[m.run]
        gyro_dps = run.gyro_dps[m.start : m.stop] - _resting_dps(rests, m)
        path_deg = float(np.linalg.norm(gyro_dps, axis=1) @ run.weights[m.start : m.stop]) * run.duration_s / len(run)
        if turned > POLICY.clear_turn_deg:
            parts.append(path_deg / float(turned))
    return float(np.median(parts)) if parts else None


def wrong_size(
    session: Session, rests: Sequence[Rest], movements: Sequence[Movement], up: Array, turned_deg: Array
) -> list[Warning]:
    """``scale_implausible`` where rates that are larger or smaller by one factor lead gravity from rest to rest.

    ``up`` [rests, 3]: gravity at the rests, which turns by ``turned_deg`` [movements]. The factor is looked for only where the
    rates as they are miss gravity by more than an implausible scale does, and told where the best one does not.
    """
    starts, ends = up[[m.before for m in movements]], up[[m.after for m in movements]]
    allowed_deg = POLICY.largest_scale * float(np.median(turned_deg))
    steps_rad = [_steps_rad(session, rests, m) for m in movements]
    if float(np.median(_missed_deg(steps_rad, starts, ends, np.ones(1)))) <= allowed_deg:
        return []
    count = int(np.ceil(np.log(POLICY.largest_factor * (1 + POLICY.largest_scale)) / np.log(STEP)))
    factors = STEP ** np.arange(-count, count + 1.0)
    missed_deg = _missed_deg(steps_rad, starts, ends, factors)
    factor = float(factors[np.argmin(np.median(missed_deg, axis=1))])
    finer = factor * STEP ** np.linspace(-1, 1, 25)
    median_deg = np.median(_missed_deg(steps_rad, starts, ends, finer), axis=1)
    factor = float(finer[np.argmin(median_deg)])
    if float(median_deg.min()) > allowed_deg or abs(1 / factor - 1) <= POLICY.largest_scale:
        return []
    each = np.log(factors[np.argmin(missed_deg, axis=0)] / factor)[turned_deg > POLICY.clear_turn_deg]
    se = ROBUST * float(np.median(np.abs(each))) / each.size**0.5 if each.size else 0.0
    return [Warning("scale_implausible", None, None, _text(1 / factor, max(se, np.log(STEP) / max(each.size, 1) ** 0.5)), True)]


def _text(part: float, se: float) -> str:
    near = any(abs(np.log(part / size)) < NEAR for size in NEXT_RANGES)
    how = "as where another range of the sensor was set" if near else f"+-{max(part * se, 0.01):.1g}"
    return (
        f"by gravity in the accelerometer, the gyroscope turns by {part:.2g} of the angles by which gravity turns between "
        f"rests ({how}), and gyroscopes are off by a few percent. Check its range, the size of one count (--lsb-dps when "
        "importing), and the samples a second"
    )


def _resting_dps(rests: Sequence[Rest], movement: Movement) -> Array:
    """The mean reading of the rests before and after a movement [3], deg/s."""
    return np.asarray((rests[movement.before].gyro_dps + rests[movement.after].gyro_dps) / 2)


def _steps_rad(session: Session, rests: Sequence[Rest], movement: Movement) -> Array:
    """The turns between the samples of a movement [n, 3], rad."""
    run, rows = session.runs[movement.run], slice(movement.start, movement.stop)
    rate_rad_s = np.radians(run.gyro_dps[rows] - _resting_dps(rests, movement))
    return np.asarray(np.diff(run.sample_s[rows])[:, None] * (rate_rad_s[:-1] + rate_rad_s[1:]) / 2)


def _missed_deg(steps_rad: Sequence[Array], starts: Array, ends: Array, factors: Array) -> Array:
    """The angle by which turns times each factor miss gravity after each movement [factors, movements], deg."""
    order = sorted(range(len(steps_rad)), key=lambda k: -len(steps_rad[k]))
    longest = len(steps_rad[order[0]])
    padded = np.zeros((longest, len(order), 3))
    for place, k in enumerate(order):
        padded[: len(steps_rad[k]), place] = steps_rad[k]
    going = np.sum([len(steps_rad[k]) > np.arange(longest) for k in order], axis=0)
    now = np.broadcast_to(starts[order], (factors.size, len(order), 3)).copy()
    for turns, count in zip(padded, going.tolist(), strict=True):
        now[:, :count] = after_turn(now[:, :count], turns[:count], factors[:, None, None])
    out = np.empty((factors.size, len(order)))
    out[:, order] = np.rad2deg(np.arccos(np.clip(np.sum(now * ends[order], axis=2), -1.0, 1.0)))
    return out
