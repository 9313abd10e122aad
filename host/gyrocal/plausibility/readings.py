"""Checks of the readings by themselves: whether they change when they must, stay within the range, and start regularly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b
from itertools import islice
from math import erf, sqrt

import numpy as np

from gyrocal.effects.base import Mask
from gyrocal.effects.saturation import Saturation
from gyrocal.error_model.model import Model
from gyrocal.plausibility.noise import own_sd_dps, step_dps
from gyrocal.plausibility.noise import still_dps as still
from gyrocal.plausibility.runs import lag_samples, longest_lag, told
from gyrocal.policy import POLICY
from gyrocal.recording.first_readings import FIRST, first_apart, last_apart
from gyrocal.recording.full_scale import at_full_scale, at_largest_code
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.warning import Warning

USUAL_RANGES_DPS = (125.0, 245.0, 250.0, 500.0, 1000.0, 2000.0)

Levels = Sequence[float | None]


def constant(session: Session, levels_dps: Levels) -> list[Warning]:
    """``constant_reading`` and ``axis_absent``: readings that do not change although they should."""
    out: list[Warning] = []
    own = set(AXES) if session.three_axes else {session.axis, *(r.axis for r in session.runs)}
    for i, axis in enumerate(AXES):
        session = session.about(axis)
        still_runs = [r for r in session.runs if np.ptp(r.gyro_dps[:, i]) == 0]
        level = levels_dps[i]
        if len(still_runs) == len(session.runs) and not all(_at(r.gyro_dps[0, i], level) for r in still_runs):
            if axis in own and _should_move(session, i):
                text = f"{axis} reads {still_runs[0].gyro_dps[0, i]:.6g} dps in every sample. Check wiring and driver"
                out.append(Warning("constant_reading", axis, None, text, True))
            elif axis not in own:
                text = f"{axis} reads {still_runs[0].gyro_dps[0, i]:.6g} dps throughout and is left out"
                out.append(Warning("axis_absent", axis, None, text))
            continue
        noise_counts = _noise_counts(session, i)
        stuck = [
            r for r in still_runs
            if not _at(r.gyro_dps[0, i], level)
            and (noise_counts > POLICY.noise_shows_counts or _moves(r, i, 0, len(r), session))
        ]  # fmt: skip
        text = f"{axis} reads one value throughout; the sensor hung or a column was filled. Record the run again"
        out += [Warning("constant_reading", axis, r.file, text, True) for r in stuck]
        out += _standing(session, i, [r for r in session.runs if r not in still_runs], level, noise_counts)
    return out


def repeated(session: Session) -> list[Warning]:
    """``same_readings``: a run with every reading of an earlier one. Noise alone makes two recordings differ."""
    moves = np.array([np.ptp(run.gyro_dps, axis=0) > 0 for run in session.runs])
    alive = moves.any(axis=0)
    first: dict[bytes, Run] = {}
    out = []
    for run, moving in zip(session.runs, moves, strict=True):
        if len(run) < POLICY.copied_readings or not alive.any() or not moving[alive].all():
            continue
        earlier = first.setdefault(blake2b(np.ascontiguousarray(run.gyro_dps).data).digest(), run)
        if earlier is not run:
            text = (
                f"its {len(run)} readings are those of {earlier.file}, one by one: the same recording counts twice, and "
                "predicts itself where one of the two is held out. Remove one of them"
            )
            out.append(Warning("same_readings", None, run.file, text, True))
    return out


def _should_move(session: Session, axis: int) -> bool:
    """True if the rates, the noise of the other axes or the usual noise contradict a constant reading of an axis."""
    rates = [r.rate_dps if r.axis_index == axis else np.zeros(1) for r in session.runs]
    if max(float(r.max()) for r in rates) - min(float(r.min()) for r in rates) > 1.0 or any(
        r.rate_is_mean for r in session.runs
    ):
        return True
    others = [sd for sd in (own_sd_dps(session, i) for i in range(len(AXES)) if i != axis) if sd is not None]
    usual = POLICY.quiet_density_dps * float(np.sqrt(session.sample_rate_hz / 2))
    count = session.lsb_dps or max((step_dps(session, i) for i in range(len(AXES))), default=0.0)
    return (float(np.median(others)) if others else usual) > POLICY.noise_shows_counts * count


def _noise_counts(session: Session, axis: int) -> float:
    sd, step = own_sd_dps(session, axis), step_dps(session, axis)
    return 0.0 if sd is None or step <= 0 else sd / step


def _moves(run: Run, axis: int, start: int, stop: int, session: Session) -> bool:
    """True if the true rate about this axis changes between two rows by far more than one count and the noise."""
    if run.axis_index != axis or run.rate_is_mean:
        return False
    least = max(POLICY.moves_counts * step_dps(session, axis), POLICY.moves_counts * (own_sd_dps(session, axis) or 0.0), 0.1)
    rate = run.rate_dps[start:stop]
    jitter = POLICY.reference_spreads * float(np.std(np.diff(rate, 2))) if rate.size > 3 else 0.0
    return rate.size > 1 and float(np.ptp(rate)) > max(least, jitter)


def _standing(session: Session, axis: int, runs: list[Run], level: float | None, noise_counts: float) -> list[Warning]:
    """Stretches of half a second and more in which a reading is constant although the rate changes or the noise must show.

    The longest one of each run is told.
    """
    out = []
    samples, count_dps = sum(map(len, runs)), step_dps(session, axis)

    def noise_must_show(y: Array, start: int, length: int) -> bool:
        rest = np.delete(y, slice(start, start + length))
        equal = float(np.mean(np.diff(rest) == 0)) if rest.size > 2 else 0.0
        noise = min(noise_counts, _quiet_counts(rest, length, count_dps))
        rare = samples * max(equal, _chance_of_equal(noise)) ** (length - 1) < POLICY.standing_chance
        return noise > POLICY.noise_shows_counts and rare

    for run in runs:
        y = run.gyro_dps[:, axis]
        constant = _constant(y, level, max(POLICY.least_standing, POLICY.standing_s * run.sample_rate_hz))
        hung = (
            (start, length) for k, (start, length) in enumerate(constant)
            if (k == 0 and noise_must_show(y, start, length)) or _misses_the_rate(run, axis, start, start + length, session)
        )  # fmt: skip
        for start, length in islice(hung, 1):
            text = (
                f"{AXES[axis]} stands still at {y[start]:.6g} dps for {length / run.sample_rate_hz:.2g} s from "
                f"{run.t_s[start]:.4g} s on. The sensor or its driver hung: cut the stretch out, or record the run again"
            )
            out.append(Warning("constant_reading", AXES[axis], run.file, text, True))
    return out


def _quiet_counts(y: Array, length: int, count_dps: float) -> float:
    """Noise of one sample in the quietest tenth of the stretches of some length, counts: elsewhere the part may be moving."""
    parts = y[: y.size // length * length].reshape(-1, length)
    if length < 3 or not len(parts) or count_dps <= 0:
        return np.inf
    return float(np.quantile(np.std(np.diff(parts, 2), axis=1), 0.1)) / 6**0.5 / count_dps


def _chance_of_equal(noise_counts: float) -> float:
    """Largest probability that noise leaves a reading unchanged, which is that for a mean in the middle of a count."""
    return erf(0.5 / (POLICY.noise_share * noise_counts * sqrt(2))) if noise_counts > 0 else 1.0


def _misses_the_rate(run: Run, axis: int, start: int, stop: int, session: Session) -> bool:
    """True if a reading that follows the rate elsewhere is constant between two rows while the rate changes, despite delays."""
    late = longest_lag(run)
    if not _moves(run, axis, start + late, stop - late, session) or stop - start <= 2 * late:
        return False
    rest = np.ones(len(run), dtype=bool)
    rest[start:stop] = False
    y, rate = run.gyro_dps[rest, axis], run.rate_dps[rest]
    about = rate - rate.mean() if rate.size else rate
    return float(about @ about) > 0 and abs(float(about @ y) / float(about @ about)) > POLICY.follows_at_all


def _constant(y: Array, level: float | None, least: float) -> list[tuple[int, int]]:
    """First row and length of each sequence of at least so many equal readings that are not at the limit, longest first."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(y)) + 1, [y.size]])
    lengths = np.diff(edges)
    if level is not None:
        lengths = np.where(np.abs(y[edges[:-1]]) > level - 1e-6, 0, lengths)
    order = np.argsort(-lengths, kind="stable")
    return [(int(edges[k]), int(lengths[k])) for k in order[: np.count_nonzero(lengths >= least)]]


def _at(value: float, level: float | None) -> bool:
    return level is not None and abs(value) > level - 1e-6


def clip_levels_dps(session: Session) -> Levels:
    """The reading at which each axis is clipped, deg/s; None for one that is not.

    Of a session by gravity no rate is known, and the readings alone say it, as those of rests do.
    """
    if session.reference.kind == "gravity":
        session = session.with_runs([replace(run, table_rate_dps=0.0) for run in session.runs])
    return [clip_level_dps(session, i) for i in range(len(AXES))]


def clip_level_dps(session: Session, axis: int) -> float | None:
    """The size of the readings from which on an axis is clipped, deg/s; None if it is not clipped.

    A word with a sign has one code more below zero than above. If readings accumulate at both ends, the level is the nearer
    one.
    """
    level = _largest_clipped_dps(session, axis)
    if level is None:
        return None
    readings = np.concatenate([r.gyro_dps[:, axis] for r in session.runs])
    nearer = min(float(readings.max()), -float(readings.min()))
    both = 0 < level - nearer < 1.5 * step_dps(session, axis)
    return nearer if both and np.count_nonzero(np.abs(np.abs(readings) - nearer) < 1e-6) >= FIRST else level


def _largest_clipped_dps(session: Session, axis: int) -> float | None:
    """The largest reading of an axis if it is clipped, deg/s, or the end that a fault states; None if it is not clipped.

    Readings at the stated full scale or beyond are clipped, as a calibration's flag has it; the level is the largest reading if
    several have it, because chips read a little more than their nominal range. Else readings accumulate at the largest value
    that occurs, and this value is the end of a range. It is that of the code or a usual one, or noise or the true rate would
    exceed it, or runs of several power cycles read nothing else, or a hand came to it in either sense. Below the stated full
    scale this must be beyond doubt. A single run that is constant there is not clipped unless the value is one of these ends.
    """
    session = session.about(AXES[axis])
    readings = [r.gyro_dps[:, axis] for r in session.runs]
    limit = max(float(np.abs(y).max()) for y in readings)
    if limit <= 0:
        return None
    fault = Saturation()
    detected = fault.detect(session.runs, axis)
    if detected is not None and detected.values["full_scale_dps"] < limit - 1e-6:  # the end is no single value
        return detected.values["full_scale_dps"]
    at = [np.abs(y) > limit - 1e-6 for y in readings]
    stuck = sum(bool(a.any()) for a in at) == 1 and any(bool(a.all()) for a in at)
    heap = sum(int(np.count_nonzero(a)) for a in at) >= FIRST
    if session.full_scale_dps is not None:
        beyond = np.concatenate([r.gyro_dps[at_full_scale(r, axis, session.full_scale_dps), axis] for r in session.runs])
        if beyond.size:
            return limit if heap else float(np.abs(beyond).min())
    one_dps = step_dps(session, axis)
    if heap and at_largest_code(limit, session.lsb_dps or one_dps or None):
        return limit
    by_hand = session.reference.kind == "gravity"
    heaped = by_hand and (_at_both_ends(readings, limit, one_dps) or _heaps(readings, limit, one_dps))
    by_noise = detected is not None or heaped
    if any(abs(limit / one - 1) < 1e-3 for one in USUAL_RANGES_DPS):
        return limit if by_noise or stuck or _rates_differ(session, axis, at, limit) else None
    if stuck or not heap:
        return None
    if _rates_differ(session, axis, at, limit) or _recurs(session, axis, at):
        return limit
    most = POLICY.shown_by_codes if session.full_scale_dps else 1.0
    if detected is None or limit < POLICY.least_range_dps or detected.chance > most:
        return None
    if _noise_counts(session, axis) > POLICY.noise_shows_counts or fault.constant(session.runs, axis) is not None:
        return limit
    return None


def _at_both_ends(readings: list[Array], limit: float, one_dps: float) -> bool:
    """True if many readings have the largest size in either sense, as no hand turns a sensor.

    A word with a sign has one code, ``one_dps``, more below zero than above.
    """
    every = np.concatenate(readings)
    ends = [float((sign * every).max()) for sign in (1.0, -1.0)]
    heaps = [int(np.count_nonzero(sign * every > end - 1e-6)) for sign, end in zip((1.0, -1.0), ends, strict=True)]
    return min(heaps) >= POLICY.least_heap and limit - min(ends) < 1.5 * one_dps


def _heaps(readings: list[Array], limit: float, one_dps: float) -> bool:
    """True if more readings have the largest size than come near it: a hand that turns back at a rate spreads them below it."""
    sizes = np.abs(np.concatenate(readings))
    at, near = (int(np.count_nonzero(sizes > limit - apart)) for apart in (1e-6, POLICY.near_counts * one_dps))
    return at >= POLICY.least_heap and at > near - at


def _recurs(session: Session, axis: int, at: list[Mask]) -> bool:
    """True if runs of several power cycles read nothing but the limit, on the side of the true rate, and noise must show.

    A sensor that hangs keeps its value in one power cycle, and a wrong rate does not make two readings equal.
    """
    whole = [
        r for r, mask in zip(session.runs, at, strict=True)
        if mask.all() and np.ptp(r.gyro_dps[:, axis]) == 0 and r.axis_index == axis and not r.rate_is_mean
    ]  # fmt: skip
    follow = all(float(np.mean(r.rate_dps)) * float(r.gyro_dps[0, axis]) > 0 for r in whole)
    one_side = len({float(np.sign(r.gyro_dps[0, axis])) for r in whole}) < 2
    if len({r.scenario for r in whole}) < 2 or not follow or (one_side and len(whole) == len(session.runs)):
        return False
    return float(np.median([_noise_counts(session, i) for i in range(len(AXES))])) > POLICY.noise_shows_counts


def _rates_differ(session: Session, axis: int, at: list[Mask], limit: float) -> bool:
    """True if readings at the limit, deg/s, belong to true rates that counts and noise cannot turn into one reading.

    A reading that is constant while the true rate is far below it is not at the end of a range.
    """
    limits: dict[float, list[Array]] = {-1.0: [], 1.0: []}
    for run, mask in zip(session.runs, at, strict=True):
        if run.axis_index == axis and not run.rate_is_mean:
            for sign, rates in limits.items():
                rates.append(np.abs(run.rate_dps[mask & (np.sign(run.gyro_dps[:, axis]) == sign)]))
    least = max(POLICY.moves_counts * step_dps(session, axis), POLICY.moves_counts * (own_sd_dps(session, axis) or 0.0))
    for stated in (np.concatenate(parts) for parts in limits.values() if parts):
        if stated.size < POLICY.least_heap:
            continue
        low, high = np.quantile(stated, (0.05, 0.95))
        if low > POLICY.far_below * limit and high - low > max(least, POLICY.rates_differ * float(stated.max())):
            return True
    return False


def cut_off(session: Session, levels_dps: Levels) -> set[tuple[str | None, str | None]]:
    """(axis, file) of runs whose mean is unreliable, because too many of their readings are clipped."""
    out: set[tuple[str | None, str | None]] = set()
    for i, (axis, level) in enumerate(zip(AXES, levels_dps, strict=True)):
        if level is not None:
            parts = {r.file: np.mean(np.abs(r.gyro_dps[:, i]) > level - 1e-6) for r in session.runs}
            out |= {(axis, file) for file, part in parts.items() if part > POLICY.clipped_part}
    return out


def clipped(session: Session, model: Model, levels_dps: Levels) -> list[Warning]:
    """``clipped``: readings at full scale, unless the model contains a fault that excludes such readings."""
    out = []
    for i, (axis, level) in enumerate(zip(AXES, levels_dps, strict=True)):
        known = any(term.fault is not None and term.fault.clips for term in model.on(axis))
        if level is None or known:
            continue
        count = sum(int(np.count_nonzero(np.abs(r.gyro_dps[:, i]) > level - 1e-6)) for r in session.runs)
        remedy = "leave the runs out, or put the limit into the model (gyrocal add saturation)"
        if session.reference.kind == "gravity":
            remedy = "or turn more slowly: a turn of which a part is cut off makes the scale seem too small"
        text = (
            f"{count} readings of {axis} are at {level:.6g} dps or beyond, the end of the range: the rate was at least that. "
            f"Record with the next larger range, {remedy}"
        )
        out.append(Warning("clipped", axis, None, text))
    return out


def first_off(session: Session, levels_dps: Levels) -> dict[str, int]:
    """How many first readings of each run stand off what follows on any axis, by the run's file; see :func:`first_sample`."""
    off: dict[str, int] = {}
    for i, level in enumerate(levels_dps):
        for file, apart_dps in _first_apart(session, i, level).items():
            off[file] = max(off.get(file, 0), _last_apart(apart_dps))
    return off


def first_sample(session: Session, levels_dps: Levels) -> list[Warning]:
    """``first_sample``: the first readings of a run deviate from the line through the following readings.

    Readings at the end of the range (``clipped``) deviate by what the range cut off.
    """
    out = []
    for i, (axis, level) in enumerate(zip(AXES, levels_dps, strict=True)):
        off = _first_apart(session, i, level)

        def text(run: Run | None, off: dict[str, Array] = off, axis: str = axis) -> str:
            apart = np.concatenate(list(off.values())) if run is None else off[run.file]
            count = max(map(_last_apart, off.values())) if run is None else _last_apart(off[run.file])
            drop = "sample" if count == 1 else f"{count} samples"
            largest = apart[np.argmax(np.abs(apart))]
            return f"{axis} begins {largest:+.3g} dps off what follows. Drop the first {drop}, or start recording later"

        out += told(session, "first_sample", axis, [r for r in session.runs if r.file in off], text, False)
    return out


def last_sample(session: Session, levels_dps: Levels) -> list[Warning]:
    """``last_sample``: the last readings of a run deviate from the line through the preceding ones, as of a hand that stops it.

    Readings at the end of the range (``clipped``) deviate by what the range cut off.
    """
    out = []
    for i, (axis, level) in enumerate(zip(AXES, levels_dps, strict=True)):
        whole = [r for r in session.runs if not any(_at(value, level) for value in r.gyro_dps[-FIRST:, i])]
        off = {r.file: apart for r in whole if (apart := _end_apart_dps(r, i)).any()}

        def text(run: Run | None, off: dict[str, Array] = off, axis: str = axis) -> str:
            ends = list(off.values()) if run is None else [off[run.file]]
            count = max(_last_apart(apart[::-1]) for apart in ends)
            drop = "sample" if count == 1 else f"{count} samples"
            largest = max(np.concatenate(ends), key=abs)
            return (
                f"{axis} ends {largest:+.3g} dps off what precedes. Drop the last {drop} (--run when importing), or stop "
                "recording before the sensor is touched"
            )

        out += told(session, "last_sample", axis, [r for r in session.runs if r.file in off], text, False)
    return out


def _end_apart_dps(run: Run, axis: int) -> Array:
    """How far each of the last readings of a run stands off, deg/s; zeros where none does, or where the rate is not known."""
    if run.rate_is_mean:
        return np.zeros(FIRST)
    run = run.about(AXES[axis])
    own = axis == run.axis_index
    if own and not run.reached[-FIRST - 2 :].all():
        return np.zeros(FIRST)
    moves_dps = 2 * float(np.ptp(run.rate_dps[-FIRST - 2 - longest_lag(run) :])) if own else 0.0
    return last_apart(still(run, axis), float(run.step_dps[axis]), moves_dps)


def _first_apart(session: Session, axis: int, level: float | None) -> dict[str, Array]:
    """How far the first readings of the runs stand off, deg/s, by file; runs in which none does are left out."""
    whole = [r for r in session.runs if not any(_at(value, level) for value in r.gyro_dps[:FIRST, axis])]
    return {r.file: apart for r in whole if (apart := _first_apart_dps(r, axis)) is not None}


def _first_apart_dps(run: Run, axis: int) -> Array | None:
    """How far each of the first readings of a run stands off, deg/s; None if none does."""
    if run.rate_is_mean:
        return None
    run, begins = run.about(AXES[axis]), 0.0
    if axis == run.axis_index and not run.reached[: FIRST + 2].all():  # beside the start of an angle there is no rate
        return None
    if axis == run.axis_index and np.ptp(run.rate_dps) > 0:  # a filter starts without the lag that it has later
        lag = abs(lag_samples(run.gyro_dps[:, axis], run.rate_dps, longest_lag(run)))
        begins = float(np.ptp(run.rate_dps[: lag + 2]))
    apart_dps = first_apart(still(run, axis), float(run.step_dps[axis]), begins)
    return apart_dps if apart_dps.any() else None


def _last_apart(apart_dps: Array) -> int:
    """The number of first readings up to the last one that stands off."""
    return int(np.flatnonzero(apart_dps)[-1]) + 1
