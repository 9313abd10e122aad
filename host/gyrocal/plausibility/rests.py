"""Checks of runs at rest: whether their means agree, and whether the direction of gravity is constant."""

from __future__ import annotations

import numpy as np

from gyrocal.plausibility.runs import Mean, Means, spread
from gyrocal.plausibility.slopes import Lines
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Run
from gyrocal.tails import ROBUST
from gyrocal.warning import Warning

WINDOW_S = 1.0


def moved(means: Means, lines: Lines) -> list[Warning]:
    """``not_at_rest``, by the readings' means and by the direction of gravity."""
    out = []
    seen: set[str] = set()
    for run in (r for r in means.session.runs if _said_at_rest(r)):
        angle_deg = _gravity_turns_deg(run)
        if angle_deg > POLICY.rest_turned_deg:
            text = f"gravity turns by {angle_deg:.0f} deg in this run at rest. Cut the movement out of it, or give its turn_deg"
            out.append(Warning("not_at_rest", run.axis, run.file, text, True))
            seen.add(run.file)
            continue
        for axis in AXES:
            low_dps, high_dps = _steady_dps(run, axis)
            if high_dps > low_dps:
                text = (
                    f"the run is said to be at rest, but {axis} reads {low_dps:.3g} dps for a while and {high_dps:.3g} for a "
                    "while, with a step between: the sensor turned steadily. Cut the run there (--run when importing), or give "
                    "the true rate"
                )
                out.append(Warning("not_at_rest", axis, run.file, text, True))
                seen.add(run.file)
                continue
            low_dps, high_dps = _range_dps(run, axis)
            if high_dps - low_dps > POLICY.largest_bias_dps:
                text = (
                    f"the run is said to be at rest, but the means of {axis} over a second go from {low_dps:.3g} to "
                    f"{high_dps:.3g} dps, without the farthest: the sensor turns. Give its true rate, cut the turn out "
                    "(--run when importing), or record the rest again"
                )
                out.append(Warning("not_at_rest", axis, run.file, text, True))
                seen.add(run.file)
                continue
            step_dps = _moves_dps(run, axis)
            if step_dps > 0:
                text = (
                    f"the run is said to be at rest, but the means of {axis} over one second and the next differ by "
                    f"{step_dps:.3g} dps: the sensor moves. Give its true rate, cut the movement out, or record the rest again"
                )
                out.append(Warning("not_at_rest", axis, run.file, text, True))
                seen.add(run.file)
                continue
            largest_dps, moved_s = _swings(run, axis)
            if moved_s > 0:
                text = (
                    f"the run is said to be at rest, but {axis} goes {largest_dps:.3g} dps off and back, for {moved_s:.2g} s "
                    "in all: the sensor was moved. Cut the movement out (--run when importing), or record the rest again"
                )
                out.append(Warning("not_at_rest", axis, run.file, text, True))
                seen.add(run.file)
    for axis in AXES:
        rests = [m for m in means.by_axis[axis] if _said_at_rest(m.run) and m.run.file not in seen]
        turning = [m for m in rests if _beyond_a_bias(m.mean_dps - _bias_dps(means, lines, axis))]
        out += [Warning("not_at_rest", axis, m.run.file, _steady_text(m, axis), True) for m in turning]
        rests = [m for m in rests if m not in turning]
        apart = _apart(rests, _scatter_dps(lines, axis), _bias_dps(means, lines, axis))
        out += [Warning("not_at_rest", axis, m.run.file, _text(m, rests, axis), True) for m in apart]
    return out


def _said_at_rest(run: Run) -> bool:
    return not run.rate_is_mean and bool(np.all(run.rate_dps == 0.0))


def _scatter_dps(lines: Lines, axis: str) -> float:
    """Usual scatter of the runs about an axis, deg/s."""
    line = lines.get((axis, axis))
    return 0.0 if line is None else line.scatter_dps


def _bias_dps(means: Means, lines: Lines, axis: str) -> float:
    """The bias without the rests, deg/s: that of the line, or of runs about another axis; 0 if there are none."""
    line = lines.get((axis, axis))
    if line is not None and line.bias_dps is not None:
        return line.bias_dps
    across = [m.mean_dps for m in means.by_axis[axis] if m.run.axis != axis and not _said_at_rest(m.run)]
    return float(np.median(across)) if across else 0.0


def _apart(rests: list[Mean], scatter_dps: float, bias_dps: float) -> list[Mean]:
    """Rests whose mean deviates from the other rests of their power cycle, or far from those of the other cycles."""
    cycles = {m.run.scenario: [o for o in rests if o.run.scenario == m.run.scenario] for m in rests}
    within = [m for mine in cycles.values() for m in _off_the_others(mine, POLICY.rest_off_dps, scatter_dps, bias_dps)]
    known = {m.run.file for m in within}
    if len(cycles) > 1:  # the bias of each power cycle is its own
        rest = [m for m in rests if m.run.file not in known]
        within += _off_the_others(rest, POLICY.rest_off_cycles_dps, scatter_dps, bias_dps)
    return within


def _off_the_others(rests: list[Mean], least_dps: float, scatter_dps: float, bias_dps: float) -> list[Mean]:
    """Rests whose mean is ``least_dps`` off the others or more. Of two that disagree, the farther from the bias is reported."""
    apart_dps = max(least_dps, POLICY.rest_spreads * scatter_dps)
    if len(rests) == 2 and abs(rests[0].mean_dps - rests[1].mean_dps) > apart_dps:
        return [max(rests, key=lambda m: abs(m.mean_dps - bias_dps))]
    values = np.array([m.mean_dps for m in rests])
    out = []
    for i, m in enumerate(rests if len(rests) > 2 else []):
        others = np.delete(values, i)
        off = abs(m.mean_dps - float(np.median(others)))
        if off > max(least_dps, POLICY.rest_spreads * spread(others)):
            out.append(m)
    return out


def _beyond_a_bias(off_dps: float) -> bool:
    """True if a steady reading is no bias but a turn; one that is larger still is a wrong zero (``bias_implausible``)."""
    return POLICY.rest_alone_dps < abs(off_dps) <= POLICY.largest_bias_dps


def _steady_text(m: Mean, axis: str) -> str:
    return (
        f"the run is said to be at rest, but {axis} reads {m.mean_dps:.4g} dps throughout, and gyroscopes have a bias of a "
        "few: the sensor turned steadily, or an offset of the counts was not taken off. Give its true rate (table_rate_dps), "
        f"map the column less its zero (--map 'g{axis}_dps=(COLUMN-ZERO):counts' when importing), or record the rest with the "
        "sensor still"
    )


def _text(m: Mean, rests: list[Mean], axis: str) -> str:
    others = float(np.median([o.mean_dps for o in rests if o is not m]))
    return (
        f"the run is said to be at rest, but {axis} reads {m.mean_dps:.4g} dps in the mean, {others:.4g} in the other rests. "
        "Give the true table_rate_dps, or record the rest again with the table still"
    )


def _moves_dps(run: Run, axis: str) -> float:
    """The median step between the means of successive seconds, deg/s; 0 where noise or one movement explains it.

    The noise is that of second differences in the usual second: first differences of a sensor in a hand are its motion.
    """
    size = max(10, round(WINDOW_S * run.sample_rate_hz))
    y = run.gyro_dps[: len(run) // size * size, AXES.index(axis)].reshape(-1, size)
    if len(y) < 3:
        return 0.0
    step_dps = float(np.median(np.abs(np.diff(y.mean(axis=1)))))
    noise_dps = float(np.sqrt(np.median(np.mean(np.diff(y, 2, axis=1) ** 2, axis=1)) / 3 / size))
    return step_dps if step_dps > max(POLICY.rest_off_dps, POLICY.rest_spreads * noise_dps) else 0.0


def _range_dps(run: Run, axis: str) -> tuple[float, float]:
    """The lowest and the highest mean of a second, without a twentieth and one at least at either end, deg/s.

    No bias wanders as far as the largest one, but a part does that speeds up slowly.
    """
    size = max(1, round(WINDOW_S * run.sample_rate_hz))
    y = np.sort(run.gyro_dps[: len(run) // size * size, AXES.index(axis)].reshape(-1, size).mean(axis=1))
    end = max(1, len(y) // 20)
    return (float(y[end]), float(y[-1 - end])) if len(y) > 2 * end else (0.0, 0.0)


def _steady_dps(run: Run, axis: str) -> tuple[float, float]:
    """The two readings between which a run steps, deg/s: each is that of a tenth of its seconds at least. Equal ones: none.

    A bias that wanders with temperature goes as far without a step.
    """
    size = max(10, round(WINDOW_S * run.sample_rate_hz))
    y = run.gyro_dps[: len(run) // size * size, AXES.index(axis)].reshape(-1, size).mean(axis=1)
    if len(y) < 10:
        return 0.0, 0.0
    low, high = (float(v) for v in np.quantile(y, [0.1, 0.9]))
    steps = np.abs(y[2:] - y[:-2])
    steady = np.median(steps) < POLICY.rest_off_dps
    return (low, high) if steady and high - low > POLICY.rest_part_dps and steps.max() > POLICY.rest_part_dps else (0.0, 0.0)


def _swings(run: Run, axis: str) -> tuple[float, float]:
    """How far the readings go off those around them as by a movement, deg/s, and for how long in all, s; 0 where they do not.

    Steps of a walk and a push are over within seconds, whose means hide them. Medians over a tenth of a second let no single
    fault of the reading pass for one, and a bias that wanders moves the readings around too. Small ones count in a run that
    is still for most of the time, as before a flight; a table that vibrates throughout is no such run. Nor is one whose
    readings go off by one step, always as far, and come back.
    """
    from scipy.ndimage import median_filter

    size = max(5, round(POLICY.rest_block_s * run.sample_rate_hz))
    y = run.gyro_dps[: len(run) // size * size, AXES.index(axis)].reshape(-1, size)
    around = 2 * round(POLICY.rest_around_s * run.sample_rate_hz / size / 2) + 1
    if len(y) < around:
        return 0.0, 0.0
    middle = np.median(y, axis=1)
    off_dps = np.abs(middle - median_filter(middle, around, mode="nearest"))
    if not off_dps.any():
        return 0.0, 0.0
    noise_dps = float(np.sqrt(np.median(np.mean(np.diff(y, 2, axis=1) ** 2, axis=1)) / 6 / size))
    usual_dps = max(noise_dps, ROBUST * float(np.median(off_dps)))
    by_noise, by_rest = (POLICY.rest_spreads * sd_dps for sd_dps in (noise_dps, usual_dps))
    moved = off_dps > min(max(POLICY.rest_part_dps, by_noise), max(POLICY.rest_off_dps, by_rest))
    farthest = off_dps[3 * off_dps >= 2 * off_dps.max()]
    one_step = float(np.std(farthest)) < ROBUST * noise_dps  # a code that is read wrongly; a movement gains and loses speed
    if one_step or np.mean(moved) < POLICY.rest_moved_part:
        return 0.0, 0.0
    return float(off_dps.max()), float(moved.sum()) * size / run.sample_rate_hz


def _gravity_turns_deg(run: Run) -> float:
    """Largest angle between median accelerations of one second each, less the part that vibration explains, deg.

    A few wrong packets turn no median. It is 0 without an accelerometer.
    """
    if run.acc_g is None or not np.isfinite(run.acc_g).all():
        return 0.0
    size = max(10, round(WINDOW_S * run.sample_rate_hz))
    count = len(run) // size
    if count < 2:
        return 0.0
    seconds = run.acc_g[: count * size].reshape(count, size, 3)
    medians = np.median(seconds, axis=1)
    norms = np.linalg.norm(medians, axis=1)
    if norms.min() < 0.3 * np.median(norms) or norms.min() <= 0:
        return 0.0
    directions = medians / norms[:, None]
    angle_deg = float(np.rad2deg(np.arccos(np.clip(np.min(directions @ directions[0]), -1.0, 1.0))))
    shaken_g = float(np.sqrt(np.mean(seconds.var(axis=1)) / size))
    return max(0.0, angle_deg - POLICY.vibration_errors * float(np.rad2deg(shaken_g / np.median(norms))))
