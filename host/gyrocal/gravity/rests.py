"""Rests and the movements between them, found by the variance of gyroscope and accelerometer.

A window at rest shows only noise, whose level is that of the stillest windows of the session itself. A window is at rest if
neither sensor's variance exceeds this level by one of the factors ``POLICY.rest_factors``. The first factor that yields
``POLICY.enough_rests`` is used, because a sensor in a hand trembles more than one on a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.tails import ROBUST
from gyrocal.units import number_of
from gyrocal.warning import Warning

WINDOW_S = 0.4
"""Length of the windows whose variance is judged, s. Hands that settle tremble at several hertz."""
STILLEST = 0.05
"""Quantile of the windows' variances that is the level of noise. At least this part of a recording must be at rest."""
TRIM_S = 0.15
"""Time that is cut off from both ends of a rest, where the part still settles, s."""
CHUNK_S = 10.0
"""Longest time of a mean reading, s. The bias drifts during a longer rest."""


@dataclass(frozen=True)
class Rest:
    """Rows ``start:stop`` of a run at rest. Means are over all rows: acceleration [3], g, and rate [3], deg/s."""

    run: int
    start: int
    stop: int
    t_s: float
    """Time of its middle in the run, s."""
    seconds: float
    acc_g: Array
    gyro_dps: Array

    @property
    def rows(self) -> int:
        """Number of samples."""
        return self.stop - self.start


@dataclass(frozen=True)
class Movement:
    """A movement between two successive rests of one run: rows ``start:stop`` and the indices of both rests."""

    run: int
    start: int
    stop: int
    before: int
    after: int


@dataclass(frozen=True)
class Found:
    """The rests of a session, the movements between them, and warnings about rests and movements that are left out."""

    rests: list[Rest]
    movements: list[Movement]
    warnings: list[Warning]
    moved: int = 0
    """Number of quiet stretches that are left out because the sensor moved."""
    scatter_dps: float = 0.0
    """Scatter of the mean rates of these stretches where it shows that none is a rest, deg/s."""


def look(session: Session) -> Found:
    """Rests and movements of all runs, however few they are."""
    rests: list[Rest] = []
    turning: list[Rest] = []
    for louder in POLICY.rest_factors:
        found = [_rest(r, number, a, b) for number, r in enumerate(session.runs) for a, b in _still(r, louder)]
        if _scatter_dps(found) > POLICY.rest_rate_dps:
            turning = max(turning, found, key=len)
            continue
        rests = max(rests, found, key=_poses)
        if _poses(rests) >= POLICY.enough_rests:
            break
    rests = _joined(session, rests)
    moved = _moved(session, rests)
    kept = [r for i, r in enumerate(rests) if i not in moved]
    if turning and len(kept) < POLICY.fewest_rests:
        return Found([], [], [], len(turning), _scatter_dps(turning))
    warnings = [*_told(session, rests, moved), *_far_from_zero(kept)]
    movements = [
        Movement(a.run, a.stop - 1, b.start + 1, i, i + 1)
        for i, (a, b) in enumerate(pairwise(kept))
        if a.run == b.run and not any(rests[m].run == a.run and a.start < rests[m].start < b.start for m in moved)
    ]
    clipped = [m for m in movements if _clips(session, m)]
    movements = [m for m in movements if m not in clipped]
    if clipped:
        text = (
            f"{len(clipped)} movements reach the end of the range and are left out. Turn more slowly, or record with the next "
            "larger range"
        )
        warnings.append(Warning("clipped", None, None, text))
    return Found(kept, movements, warnings, len(moved))


def _joined(session: Session, pieces: Sequence[Rest]) -> list[Rest]:
    """The rests, of which those are one between which the readings lead nowhere and gravity stays.

    Where few would be left, the pieces remain: each of them tells the bias at its own time.
    """
    out: list[Rest] = []
    for rest in pieces:
        whole = _whole(session.runs[rest.run], out[-1], rest) if out and out[-1].run == rest.run else None
        if whole is None:
            out.append(rest)
        else:
            out[-1] = whole
    return out if len(out) >= POLICY.enough_rests else list(pieces)


def _whole(run: Run, before: Rest, after: Rest) -> Rest | None:
    """The rest of which these two are pieces, cut by a knock or a few noisy samples; None unless the sensor lies in one pose.

    A turn that leads back to the pose, or turns about gravity, is a way of the readings between them.
    """
    between = slice(before.stop - 1, after.start + 1)
    still = np.concatenate([run.gyro_dps[r.start : r.stop] - r.gyro_dps for r in (before, after)])
    bias_dps = (before.gyro_dps * before.rows + after.gyro_dps * after.rows) / len(still)
    steps_s = np.diff(run.sample_s[between])
    way_deg = np.linalg.norm(np.cumsum((run.gyro_dps[between] - bias_dps)[1:] * steps_s[:, None], axis=0), axis=1)
    error_deg = float(np.sqrt(still.var(axis=0).sum() * (np.sum(steps_s**2) + steps_s.sum() ** 2 / len(still))))
    if way_deg.max() > POLICY.same_pose_deg or way_deg[-1] > POLICY.rest_turns_errors * error_deg:
        return None
    whole = _rest(run, before.run, before.start, after.stop)
    return None if _gravity_turns_deg(run, whole) else whole


def _scatter_dps(rests: Sequence[Rest]) -> float:
    """How far the mean rates of rests are apart: the least of their scatter and of that from one to the next, deg/s.

    A bias may wander over a recording, and some rests may have moved, but the most of them read alike or like their neighbour.
    """
    if len(rests) < 3:
        return 0.0
    means = np.array([rest.gyro_dps for rest in rests])
    whole = np.median(np.abs(means - np.median(means, axis=0)), axis=0)
    successive = np.median(np.abs(np.diff(means, axis=0)), axis=0) / 2**0.5
    return ROBUST * float(np.minimum(whole, successive).max())


def _poses(rests: Sequence[Rest]) -> int:
    """The number of rests, of which those that follow one another in one pose count once, as a rest that was cut."""
    least = np.cos(np.deg2rad(POLICY.same_pose_deg))
    up = [rest.acc_g / max(float(np.linalg.norm(rest.acc_g)), 1e-9) for rest in rests]
    pairs = zip(pairwise(rests), pairwise(up), strict=True)
    return len(rests) - sum(a.run == b.run and float(before @ after) > least for (a, b), (before, after) in pairs)


def find(session: Session) -> Found:
    """Rests and movements of all runs. Raises InputError if there are too few rests or no movement."""
    found = look(session)
    if lacking := _lacking(found):
        raise InputError(f"{session.path or 'the session'}: {lacking}")
    return found


def check(session: Session) -> list[Warning]:
    """For every command that needs rests: ``not_at_rest`` where a session has too few, or no movement between them, and
    ``bias_implausible`` where its readings at rest are far from zero.
    """
    found = look(session)
    lacking = _lacking(found)
    far = [warning for warning in found.warnings if warning.code == "bias_implausible"]
    return [*([Warning("not_at_rest", None, None, lacking)] if lacking else []), *far]


def _far_from_zero(rests: Sequence[Rest]) -> list[Warning]:
    """``bias_implausible``: axes that read at rest, in the middle, what is no bias of a gyroscope."""
    middle = np.median([rest.gyro_dps for rest in rests], axis=0) if rests else np.zeros(3)
    far = [i for i in range(3) if abs(middle[i]) > POLICY.rest_alone_dps]
    if not far:
        return []
    reads = ", ".join(f"{AXES[i]} {middle[i]:.4g} dps" for i in far)
    text = (
        f"the readings at rest are far from zero ({reads}), and gyroscopes have a bias of a few dps. An offset of the counts "
        "was not taken off (--map 'gx_dps=(COLUMN-ZERO):counts' when importing), their unit or the size of one count is wrong, "
        "or the sensor turned steadily"
    )
    return [Warning("bias_implausible", AXES[far[0]] if len(far) == 1 else None, None, text)]


def _lacking(found: Found) -> str:
    """What a calibration by gravity lacks, in words; empty if there are rests and movements enough."""
    few = len(found.rests) < POLICY.fewest_rests
    if not few and found.movements:
        return ""
    apart = found.scatter_dps
    worn = f": their mean rates scatter by {apart:.2g} dps, as of a sensor that is worn" if apart else ""
    also = f" ({found.moved} more moved and are left out{worn})" if found.moved else ""
    lacking = f"and {POLICY.fewest_rests} are needed at least" if few else "but no movement that leads from one to the next"
    return (
        f"{number_of(len(found.rests), 'rest')} found{also}, {lacking}. "
        "Leave the sensor still for two seconds in each pose, in ten poses or more, and turn it by about 90 deg in between"
    )


def _still(run: Run, louder: float) -> list[tuple[int, int]]:
    """First and last row (exclusive) of each rest of a run, trimmed."""
    assert run.acc_g is not None
    rate_hz = (len(run) - 1) / float(run.sample_s[-1] - run.sample_s[0])
    size = max(5, round(WINDOW_S * rate_hz))
    if len(run) < 2 * size:
        return []
    still = np.ones(len(run) - size + 1, dtype=bool)
    for values in (run.gyro_dps, filled_acc_g(run)):
        variance = _window_variance(values, size)
        quantum = np.sum(_step(values) ** 2) / 12
        still &= variance <= louder * max(float(np.quantile(variance, STILLEST)), float(quantum))
    covered = np.zeros(len(run) + 1)
    covered[:-size][still] += 1  # each still window covers its rows
    np.subtract.at(covered, np.flatnonzero(still) + size, 1)
    at_rest = np.concatenate([[False], np.cumsum(covered[:-1]) > 0, [False]])
    edges = np.flatnonzero(np.diff(at_rest.astype(int)))
    trim = max(1, round(TRIM_S * rate_hz))
    pairs = [(int(a) + trim, int(b) - trim) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in pairs if b - a >= POLICY.shortest_rest_s * rate_hz]


def _window_variance(values: Array, size: int) -> Array:
    """Variance within each window of ``size`` rows, summed over the three columns of ``values`` [n, 3]."""
    centred = values - values.mean(axis=0)
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(centred, axis=0)])
    squares = np.concatenate([np.zeros((1, 3)), np.cumsum(centred**2, axis=0)])
    mean, square = ((s[size:] - s[:-size]) / size for s in (sums, squares))
    return np.asarray(np.maximum(square - mean**2, 0.0).sum(axis=1))


def _step(values: Array) -> Array:
    """The smallest step of each column of ``values`` [n, 3], shape [3]."""
    steps = np.abs(np.diff(values, axis=0))
    least = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
    return np.where(np.isfinite(least), least, 0.0)


def filled_acc_g(run: Run) -> Array:
    """The acceleration with missing cells interpolated, shape [n, 3], g."""
    acc_g = run.acc_g
    assert acc_g is not None
    if np.isfinite(acc_g).all():
        return acc_g
    known = [np.isfinite(acc_g[:, i]) for i in range(3)]
    return np.column_stack([np.interp(run.t_s, run.t_s[k], acc_g[k, i]) for i, k in enumerate(known)])


def _rest(run: Run, number: int, start: int, stop: int) -> Rest:
    t_s = run.sample_s[start:stop]
    return Rest(
        number, start, stop, float(t_s.mean()), float(t_s[-1] - t_s[0]) * (stop - start) / max(stop - start - 1, 1),
        filled_acc_g(run)[start:stop].mean(axis=0), run.gyro_dps[start:stop].mean(axis=0),
    )  # fmt: skip


def _moved(session: Session, rests: Sequence[Rest]) -> dict[int, str]:
    """Rests in which the sensor turned slowly, by their index, with the evidence in words."""
    out: dict[int, str] = {}
    for i, rest in enumerate(rests):
        if turned_deg := _gravity_turns_deg(session.runs[rest.run], rest):
            out[i] = f"gravity turns by {turned_deg:.1f} deg"
    for run in {r.run for r in rests}:
        mine = [i for i, r in enumerate(rests) if r.run == run and i not in out]
        if len(mine) < 3:
            continue
        means = np.array([rests[i].gyro_dps for i in mine])
        apart = np.abs(means - np.median(means, axis=0))
        limit = np.maximum(POLICY.rest_rate_dps, POLICY.rest_rate_spreads * ROBUST * np.median(apart, axis=0))
        for i, off in zip(mine, apart, strict=True):
            if np.any(off > limit):
                out[i] = f"the mean rate is {off.max():.1f} dps off that of the other rests"
    return out


def _gravity_turns_deg(run: Run, rest: Rest) -> float:
    """The angle by which gravity turns within a rest, deg; 0 where this may be noise."""
    acc_g = filled_acc_g(run)[rest.start : rest.stop]
    half = rest.rows // 2
    first, last = acc_g[:half].mean(axis=0), acc_g[-half:].mean(axis=0)
    error = float(np.sqrt(np.diff(acc_g, axis=0).var(axis=0).max() / half))
    turned = float(np.linalg.norm(first - last)) / max(float(np.linalg.norm(first + last)) / 2, 1e-9)
    clear = turned > max(np.deg2rad(POLICY.rest_turns_deg), POLICY.rest_turns_errors * error)
    return float(np.rad2deg(2 * turned)) if clear else 0.0


def _clips(session: Session, movement: Movement) -> bool:
    """True if a reading of a movement is at full scale."""
    if session.full_scale_dps is None:
        return False
    run = session.runs[movement.run]
    largest = float(np.abs(run.gyro_dps[movement.start : movement.stop]).max())
    return largest > session.full_scale_dps - 1.5 * max(session.lsb_dps or 0.0, 1e-6)


def _told(session: Session, rests: Sequence[Rest], moved: dict[int, str]) -> list[Warning]:
    """``not_at_rest``: one warning for each run with stretches that are quiet but not at rest."""
    out = []
    for number, run in enumerate(session.runs):
        mine = [i for i in moved if rests[i].run == number]
        if mine:
            first = rests[mine[0]]
            text = (
                f"{len(mine)} quiet stretch{'' if len(mine) == 1 else 'es'} moved and {'is' if len(mine) == 1 else 'are'} left "
                f"out; in that at {first.t_s:.1f} s {moved[mine[0]]}. Lay the sensor down, and keep still for two seconds"
            )
            out.append(Warning("not_at_rest", None, run.file, text))
    return out
