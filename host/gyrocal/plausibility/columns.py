"""The other columns: time against the stated sample rate, and the units of acceleration and temperature."""

from __future__ import annotations

import itertools
from collections.abc import Set

import numpy as np

from gyrocal.digits import percentage
from gyrocal.effects.quantities import damaged_accelerations
from gyrocal.plausibility.runs import told
from gyrocal.policy import POLICY
from gyrocal.recording.pauses import pauses_of
from gyrocal.recording.scattered_rates import changes_of_rate
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.recording.stamps import course, in_bursts, lost, period_s, regression, step_range_s
from gyrocal.units import number_of
from gyrocal.warning import Warning

STANDARD_GRAVITY = 9.80665


def check(session: Session, moved: Set[str | None] = frozenset()) -> list[Warning]:
    """Of times ``sample_rate`` and ``samples_lost``, of units ``accel_unit`` and ``temp_unit``, and ``line_damaged``.

    The files of ``moved`` are no rests.
    """
    off = _sample_rate(session)
    mistimed = {w.file for w in off}
    timed = [*off, *_changed_rate(session, mistimed), *_lost(session, mistimed)]
    return [*timed, *_acceleration(session, moved), *_damaged(session), *_temperature(session)]


def mistimed_turns(session: Session) -> set[tuple[str | None, str | None]]:
    """(axis, file) of runs whose mean rate comes from their angle and from times in another unit, for every axis."""
    hit = [r for r in session.runs if r.rate_is_mean and (_too_slow(measured_hz(r), r) or _too_fast(measured_hz(r), r))]
    return {(axis, r.file) for axis in AXES for r in hit}


def _acceleration(session: Session, moved: Set[str | None]) -> list[Warning]:
    """``accel_unit``, from the mean acceleration of each run at rest, in which vibration averages out.

    Without one, the size of each sample is taken where the readings are quietest, because the mean over turning gravity is the
    accelerometer's own bias, and motion adds to gravity. Where every rest moved or nothing is quiet, accelerations are no
    gravity, and only another unit is told, or more in most of a rest than any motion makes.
    """
    if session.reference.kind == "gravity":
        return _by_hand(session)
    runs = [(r, r.acc_g) for r in session.runs if r.acc_g is not None]
    said = [(r, a) for r, a in runs if not r.rate_is_mean and not np.any(r.rate_dps) and np.isfinite(a).any(axis=0).all()]
    rests = [a for r, a in said if r.file not in moved]
    at_rest = [np.nanmean(a, axis=0)[None] for a in rests]
    at_rest = at_rest or [a[r.rate_dps == 0.0] for r, a in runs if not r.rate_is_mean and np.any(r.rate_dps == 0.0)]
    quiet, where = [] if at_rest else _quietest(session), "at rest" if at_rest else "where the readings are quietest"
    samples = np.concatenate(at_rest or quiet or [a for _, a in runs] or [np.empty((0, 3))])
    norms = np.linalg.norm(samples, axis=1)
    norms = norms[np.isfinite(norms)]
    if not norms.size:
        return []
    norm = float(np.median(norms))
    if abs(norm - 1) <= POLICY.gravity_off:
        return []
    unit = next((u for u, g in (("m/s2", STANDARD_GRAVITY), ("mg", 1e3)) if abs(norm / g - 1) < POLICY.gravity_off), None)
    if unit is None and ((said and not rests and norm < POLICY.motion_g) or not (at_rest or quiet)):
        return []
    guess = f"it is in {unit}" if unit else "its unit or its scale is wrong"
    text = (
        f"the acceleration {where} is {norm:.4g}, and gravity is 1 g: {guess}. "
        f"Give the unit when importing (--map ax_g=COLUMN:{unit or 'UNIT'})"
    )
    return [Warning("accel_unit", None, None, text)]


def _damaged(session: Session) -> list[Warning]:
    """``line_damaged``: single accelerations that stand alone."""
    out = []
    for run in session.runs:
        strays = [] if run.acc_g is None else damaged_accelerations(run)
        if not any(rows.size for rows, _ in strays):
            continue
        rows = np.unique(np.concatenate([rows for rows, _ in strays]))
        largest_g = max(float(np.abs(apart_g).max(initial=0.0)) for _, apart_g in strays)
        text = (
            f"{number_of(rows.size, 'acceleration')} stand{'s' * (rows.size == 1)} alone out of those beside, by up to "
            f"{largest_g:.3g} g (at {run.t_s[rows[0]]:.6g} s), as in a packet that came damaged, or by a knock. Effects of the "
            "acceleration are fitted without"
        )
        out.append(Warning("line_damaged", None, run.file, text))
    return out


def _pieces(session: Session) -> list[tuple[Array, Array]]:
    """The accelerations of each run in short pieces, [pieces, samples, 3], g, and how much its readings vary in each, deg/s."""
    found = []
    for run in session.runs:
        size = max(2, round(POLICY.still_s * run.sample_rate_hz))
        count = len(run) // size
        if run.acc_g is not None and count:
            acc_g, gyro_dps = (v[: count * size].reshape(count, size, 3) for v in (run.acc_g, run.gyro_dps))
            found.append((acc_g, gyro_dps.std(axis=1).sum(axis=1)))
    return found


def _quietest(session: Session) -> list[Array]:
    """Accelerations, [n, 3] each, g, of the quietest pieces; none where the sensor moves in all of them."""
    pieces = _pieces(session)
    if not pieces:
        return []
    most = min(float(np.quantile(np.concatenate([s for _, s in pieces]), POLICY.still_part)), POLICY.rest_part_dps)
    quiet = [a[s <= most].reshape(-1, 3) for a, s in pieces]
    return [a for a in quiet if a.size]


def _by_hand(session: Session) -> list[Warning]:
    """``accel_unit`` of a sensor that was turned by hand, from the mean accelerations where it turned least."""
    pieces = _pieces(session)
    if not pieces:
        return []
    spread = np.concatenate([s for _, s in pieces])
    norms = np.concatenate([np.linalg.norm(acc_g.mean(axis=1), axis=1) for acc_g, _ in pieces])
    norms = norms[(spread <= np.quantile(spread, POLICY.still_part)) & np.isfinite(norms)]
    if not norms.size:
        return []
    low, middle, high = np.quantile(norms, [0.05, 0.5, 0.95])
    if abs(middle - 1) <= POLICY.gravity_off and high - low <= 4 * POLICY.gravity_off * middle:
        return []
    text = (
        f"the acceleration at rest is {middle:.4g}, from {low:.3g} to {high:.3g} over the poses, and gravity is 1 g: the scale "
        "or the bias of the accelerometer is wrong, or its unit. Gravity's direction rests on what the poses say of them; give "
        "the scale when importing (--map ax_g=COLUMN*FACTOR), and record twelve poses or more"
    )
    return [Warning("accel_unit", None, None, text)]


def _temperature(session: Session) -> list[Warning]:
    low, high = POLICY.temperatures_c
    medians_c = {r.file: float(np.nanmedian(r.temp_c)) for r in session.runs if r.temp_c is not None}
    beyond = {file for file, median_c in medians_c.items() if median_c < low or median_c > high}  # neither without a reading
    hit = [r for r in session.runs if r.file in beyond]

    def text(run: Run | None) -> str:
        return (
            f"temp_c is {medians_c[(run or hit[0]).file]:.4g}, outside {low:g} to {high:g} °C. "
            "Give the unit when importing (--map temp_c=COLUMN:K, or degF), or drop the column"
        )

    return told(session, "temp_unit", None, hit, text, False)


def _sample_rate(session: Session) -> list[Warning]:
    rates = {r.file: measured_hz(r) for r in session.runs}

    def off(run: Run) -> bool:
        hz = rates[run.file]
        return hz < POLICY.slowest_hz or hz > POLICY.fastest_hz or abs(hz / run.sample_rate_hz - 1) > POLICY.sample_rate_off

    hit = [r for r in session.runs if off(r)]

    def text(run: Run | None) -> str:
        one = run or hit[0]
        rate = rates[one.file]
        has, gap = f"has {rate:.4g} samples a second", ""
        if abs(rate / session.sample_rate_hz - 1) > POLICY.sample_rate_off:  # an import states the rate of the times
            has, gap = f"{has}, session.toml says sample_rate_hz = {session.sample_rate_hz:g}", _gap(one)
        if _too_slow(rate, one) and gap:
            return f"Is t_s in {_unit(rate, one)}? It {has}. But {gap}"
        if _too_slow(rate, one):
            unit = _unit(rate, one)
            return f"Is t_s in {unit}? It {has}. Convert it to seconds (--map t_s=COLUMN:{unit} when importing)"
        if _too_fast(rate, one):
            return f"Was t_s taken for ms or us? It {has}. Import it in seconds (--map t_s=COLUMN), or correct sample_rate_hz"
        return f"t_s {has}. Correct sample_rate_hz, or the times"

    return told(session, "sample_rate", None, hit, text, False)


def _changed_rate(session: Session, mistimed: Set[str | None]) -> list[Warning]:
    """``sample_rate`` of a logger that took another rate within a run. Times in the files of ``mistimed`` are wrong."""
    changes = {r.file: () if {None, r.file} & mistimed else changes_of_rate(r.t_s) for r in session.runs}
    hit = [r for r in session.runs if changes[r.file]]

    def text(run: Run | None) -> str:
        (_, first_hz), (at_s, then_hz), *others = changes[(run or hit[0]).file]
        more = f", and changes {len(others)} times more" if others else ""
        return (
            f"the logger took {first_hz:.4g} samples a second up to {at_s:.4g} s, and {then_hz:.4g} after that{more}. "
            "Noise and delays differ between the two: import each part as a session of its own "
            f"(--run first:0s:{at_s:.4g}s, and --run second:{at_s:.4g}s:)"
        )

    return told(session, "sample_rate", None, hit, text, False)


def _lost(session: Session, mistimed: Set[str | None]) -> list[Warning]:
    """``samples_lost``: steps of time that hold several sampling intervals. Times in the files of ``mistimed`` are wrong."""
    timed = [r for r in session.runs if not {None, r.file} & mistimed]
    hit = [(r, missing) for r in timed if (missing := lost(r.t_s, 1 / r.sample_rate_hz) or _lost_between_bursts(r.t_s)) > 0]
    if not hit:
        return []
    missing, there = sum(number for _, number in hit), sum(len(r) for r, _ in hit)
    longest = max((r for r, _ in hit), key=lambda r: step_range_s(r.t_s)[1])
    steps_s = np.diff(longest.t_s)
    at = int(np.argmax(steps_s))
    file, where, of_file = (longest.file, "", "") if len(hit) == 1 else (None, f" in {len(hit)} runs", f" of {longest.file}")
    part = percentage(missing / (missing + there), 2)
    if len(hit) == 1 and (text := _paused(longest, missing, part)):
        return [Warning("samples_lost", None, file, text)]
    text = (
        f"{missing} of {missing + there} samples{where} are missing ({part}), where the times skip sampling intervals, most "
        f"{steps_s[at]:.3g} s after {longest.t_s[at]:.4g} s{of_file}. The samples that are there are used. Read the sensor's "
        "FIFO or its data-ready signal to lose none"
    )
    return [Warning("samples_lost", None, file, text)]


def _lost_between_bursts(t_s: Array) -> int:
    """Samples missing from stamps [n], s, that come in bursts, if there is a gap that no wait for a packet explains."""
    if not _gap_between_bursts(t_s):
        return 0
    found = regression(t_s)
    return found.lost if found.even else 0


def _gap_between_bursts(t_s: Array) -> bool:
    """True if stamps [n], s, come in bursts, and the longest wait between two is far longer than the others."""
    longest_s = step_range_s(t_s)[1]
    if longest_s <= POLICY.pause_s or not in_bursts(t_s):
        return False
    steps_s = np.diff(t_s)
    waits_s = steps_s[steps_s > float(np.mean(steps_s)) / 2]
    return longest_s > POLICY.pause_waits * float(np.median(waits_s))


def _paused(run: Run, missing: int, part: str) -> str:
    """What to do with a run whose missing samples are those of pauses between recordings, in words; empty for any other run."""
    pauses = pauses_of(run.t_s)
    steps_s = np.diff(run.t_s)
    parts = np.split(run.t_s, pauses + 1)
    beside = sum(lost(t_s, 1 / run.sample_rate_hz) for t_s in parts)
    if not pauses.size or beside > POLICY.pause_losses * missing:
        return ""
    middles = [f"{(t_s[-1] + after[0]) / 2:.5g}s" for t_s, after in itertools.pairwise(parts)]
    edges = ["0s", *middles, ""]
    runs = [f"--run {name}:{start}:{end}" for name, start, end in zip("abcd", edges, edges[1:], strict=False)]
    more = " and so on" if len(parts) > len(runs) else ""
    within = f" Within the parts, {beside} samples are missing." if beside else ""
    if pauses.size == 1:
        at = int(pauses[0])
        told = f"For {steps_s[at]:.3g} s after {run.t_s[at]:.4g} s there is no sample, the time of {missing} of "
    else:
        longest = int(np.argmax(steps_s))
        told = (
            f"For {steps_s[pauses].sum():.4g} s in {pauses.size} pauses, most {steps_s[longest]:.3g} s after "
            f"{run.t_s[longest]:.4g} s, there is no sample, the time of {missing} of "
        )
    return (
        f"{told}{missing + len(run)} ({part}). If the logger paused, make a run of each part (when importing: "
        f"{' '.join(runs)}{more}).{within} If samples were lost, read the sensor's FIFO or its data-ready signal"
    )


def _gap(run: Run) -> str:
    """What to do with the longest gap of a run that has its stated rate without gaps, in words; empty for any other run."""
    if in_bursts(run.t_s) or abs(1 / period_s(run.t_s) / run.sample_rate_hz - 1) > POLICY.sample_rate_off:
        return ""
    steps_s = np.diff(run.t_s)
    longest = int(np.argmax(steps_s))
    return (
        f"without gaps, as that of {steps_s[longest]:.4g} s after {run.t_s[longest]:.4g} s, it has "
        f"{1 / period_s(run.t_s):.4g}: then make a run of each part (--run when importing)"
    )


def _too_slow(rate_hz: float, run: Run) -> bool:
    """True if the times of a run with so many samples per second are in milliseconds."""
    return rate_hz < POLICY.slowest_hz or POLICY.milliseconds[0] < run.sample_rate_hz / rate_hz < POLICY.milliseconds[1]


def _unit(rate_hz: float, run: Run) -> str:
    """The unit of times that are too slow: us where the rate is near a millionth of the stated one, or of any sensor's."""
    low, high = POLICY.milliseconds
    return "us" if low < run.sample_rate_hz / rate_hz / 1e3 < high or rate_hz * 1e3 < POLICY.slowest_hz else "ms"


def _too_fast(rate_hz: float, run: Run) -> bool:
    """True if the times are seconds that were divided by 1000 or 10^6."""
    return rate_hz > POLICY.fastest_hz or POLICY.milliseconds[0] < rate_hz / run.sample_rate_hz < POLICY.milliseconds[1]


def measured_hz(run: Run) -> float:
    """Samples per second by regression of time on the sample's number, or their mean where no course is even.

    If samples arrive in bursts, only the first of each burst counts, because a line through a few steps depends on its ends.
    Elsewhere lost samples are counted if that makes the rate the stated one, as when a recording with dropouts is imported.
    """
    bursts, (interval_s, even) = in_bursts(run.t_s), course(run.t_s)
    if not even:
        return 1 / interval_s
    gaps = np.diff(run.t_s)
    first = np.concatenate([[0], np.flatnonzero(gaps > gaps.mean() / 2) + 1])
    number = first - first.mean()
    hz = float(number @ number) / float(number @ (run.t_s[first] - run.t_s[0]))
    if _gap_between_bursts(run.t_s) and abs(1 / interval_s / run.sample_rate_hz - 1) <= POLICY.sample_rate_off:
        return 1 / interval_s  # a gap between bursts makes their mean rate smaller
    if hz < POLICY.slowest_hz or bursts:
        return hz
    missing = lost(run.t_s, 1 / run.sample_rate_hz)
    with_lost_hz = (len(run) - 1 + missing) / float(run.t_s[-1] - run.t_s[0]) if missing else 1 / interval_s
    return hz if abs(with_lost_hz / run.sample_rate_hz - 1) > POLICY.sample_rate_off else with_lost_hz
