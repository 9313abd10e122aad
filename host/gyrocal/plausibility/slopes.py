"""Checks of the slope of each axis: unit, axes, signs, rates, and the sizes of scale, bias and their spread.

The slope of a run is the regression of its readings on the true rate or, at one rate, (mean - bias) / rate. The bias is that of
the line on which most runs agree. A run that disagrees does not change it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.inference.reml import LARGEST_SPREAD
from gyrocal.plausibility.runs import Mean, Means, spread, told
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.warning import Warning

DEG = 180.0 / np.pi
UNIT_WITHIN, SIGN_WITHIN = 0.1, 0.15
FOLLOWS_NOT, FOLLOWS = 0.1, (0.9, 1.1)
RATE_OFF, RATE_ERRORS = 0.02, 10.0
SCALE_LIMIT, BIAS_LIMIT_DPS = 0.15, 50.0
TURN_ON_LIMIT_DPS, TURN_ON_LIMIT_SCALE = LARGEST_SPREAD[Role.BIAS], LARGEST_SPREAD[Role.SCALE]
TURN_ON_DPS = 0.05
"""Assumed spread over fewer than FEW power cycles: the upper end of the values in datasheets."""
FEW = 4
UNKNOWN_BIAS_DPS = 10.0
"""Standard error of a bias that no run determines."""
STANDS_STILL = 5.0
"""A slope of fewer standard errors than this may come from a table that does not turn."""
INFORMATIVE = 0.05
"""Largest standard error of a slope that is used."""
AGREE_DPS, AGREE = 0.3, 0.02
"""Runs agree on a line if they differ by less than this (and this fraction of their rate)."""
MOST_POINTS = 80
POINTS_ALONG = 0.7
"""Part of gravity that must lie along an axis for the accelerometer to say which way it points."""


@dataclass(frozen=True)
class Slope:
    """The slope of one run. ``raw`` is the slope without subtraction of the bias, which has the unit of the other runs."""

    run: Run
    value: float
    se: float
    raw: float


@dataclass(frozen=True)
class Line:
    """The line on which the runs about an axis agree. ``bias_dps`` is None if they do not determine it.

    ``slopes`` are those of turning runs. ``scatter_dps`` is the spread of the bulk of the runs about the line.
    """

    bias_dps: float | None
    slopes: list[Slope]
    scatter_dps: float = 0.0

    def of(self, run: Run) -> Slope | None:
        return next((s for s in self.slopes if s.run is run), None)


Lines = dict[tuple[str, str], Line]


def lines(means: Means) -> Lines:
    """Lines by (the table's axis, the readings' axis)."""
    return {(about, axis): _line(means.about(about, axis)) for about in means.turned for axis in AXES}


def _line(points: list[Mean]) -> Line:
    steady = [m for m in points if m.slope is None]
    swings = [m for m in points if m.slope is not None]
    rates, values = np.array([m.rate_dps for m in steady]), np.array([m.mean_dps for m in steady])
    bias, slope = _agreed(rates, values)
    if bias is None and swings:
        bias = float(np.median([m.offset_dps for m in swings]))
    scatter = 0.0
    if bias is not None and steady:
        signed = values - bias - slope * rates
        scatter = float(np.median(np.abs(signed))) * 1.4826
    if len({m.run.scenario for m in steady}) < FEW:
        scatter = max(scatter, TURN_ON_DPS * min(1.0, abs(slope)))
    unknown = UNKNOWN_BIAS_DPS if bias is None else 0.0
    found = [Slope(m.run, float(m.slope), m.slope_se, float(m.slope)) for m in swings if m.slope is not None]
    for m in steady:
        if not m.rests:
            error = float(np.hypot(np.hypot(m.se_dps, scatter), unknown)) / abs(m.rate_dps)
            value, raw = (m.mean_dps - (bias or 0.0)) / m.rate_dps, m.mean_dps / m.rate_dps
            found.append(Slope(m.run, value, error, raw))
    return Line(bias, found, scatter)


def _agreed(rates: Array, values: Array) -> tuple[float | None, float]:
    """Bias and slope of the line through two runs with which the others agree best (Cauchy's loss); None at a single rate.

    If several lines agree with equally many runs, the slope nearest to 1 is chosen.
    """
    if rates.size == 0:
        return None, 1.0
    if np.all(np.abs(rates) < 1e-9):
        return float(np.median(values)), 1.0
    least = 0.1 * float(np.max(np.abs(rates)))
    every = np.unique(np.linspace(0, rates.size - 1, min(rates.size, MOST_POINTS)).astype(np.intp))
    pairs = np.array([(i, j) for i, j in combinations(every, 2) if abs(rates[i] - rates[j]) > least])
    if not pairs.size:
        return None, 1.0
    i, j = pairs.T
    slope = (values[i] - values[j]) / (rates[i] - rates[j])
    bias = values[i] - slope * rates[i]
    tolerance = AGREE_DPS + AGREE * np.abs(rates)
    apart = (values - bias[:, None] - slope[:, None] * rates) / tolerance
    cost = np.log1p(apart**2).sum(axis=1) + 0.5 * np.log1p(((slope - 1) / 0.05) ** 2)
    best = int(np.argmin(cost))
    weight = 1 / (1 + apart[best] ** 2) / tolerance**2
    design = np.column_stack([np.ones(rates.size), rates]) * np.sqrt(weight)[:, None]
    settled = np.linalg.lstsq(design, values * np.sqrt(weight), rcond=None)[0]
    return float(settled[0]), float(settled[1])


def contradictions(means: Means, found: Lines) -> list[Warning]:
    """The first matching slope code for each axis about which the table turns, and faces that gravity contradicts."""
    out: list[Warning] = []
    for axis in means.turned:
        told_of = _of_axis(means, axis, found)
        out += told_of
        if not any(w.code in ("sign_flipped", "axes_swapped", "face_wrong") for w in told_of):
            out += _against_gravity(means, axis, found[axis, axis])
    for axis in {r.axis for r in means.session.runs} - set(means.turned):
        out += _against_gravity(means, axis, None)
    return out


def _of_axis(means: Means, axis: str, found: Lines) -> list[Warning]:
    line = found[axis, axis]
    # the window about pi/180 is narrow, and a bias that no run shows would be in rad/s too
    informed = [s for s in line.slopes if s.se < INFORMATIVE or line.bias_dps is None]
    if not informed:
        return []

    def where(fits: Callable[[Slope], bool]) -> list[Slope]:
        return [s for s in informed if fits(s)]

    small = where(_is_in_rad)
    if small:
        return _told(means, "unit_rad_s", axis, small, informed, _rad_readings)
    large = where(lambda s: abs(s.value / DEG - 1) < UNIT_WITHIN)
    if large:
        return _told(means, "unit_rad_s", axis, large, informed, _rad_reference)
    for other in (a for a in AXES if a != axis):
        swapped = [s for s in where(lambda s: abs(s.value) < FOLLOWS_NOT) if _follows(found[axis, other], s.run)]
        if swapped:
            follows = float(np.median([s.value for s in found[axis, other].slopes]))
            return _told(means, "axes_swapped", axis, swapped, informed, partial(_swapped_text, other, follows))
    flipped = where(lambda s: abs(s.value + 1) < SIGN_WITHIN)
    if flipped and len(flipped) == len(informed):
        return _told(means, "sign_flipped", axis, flipped, informed, _flipped_text)
    if flipped:
        return [Warning("face_wrong", axis, s.run.file, _face_text(s, axis), True) for s in flipped]
    sure = [s for s in informed if s.se < INFORMATIVE]
    if not sure:
        return []
    values = np.array([s.value for s in sure])
    middle = _middle(values)
    own = spread(values) if values.size >= FEW else 0.0
    off = [s for s in sure if abs(s.value - middle) > max(RATE_OFF * abs(middle), RATE_ERRORS * float(np.hypot(s.se, own)))]
    if off:
        return [Warning("rate_wrong", axis, s.run.file, _rate_text(s, middle, axis), True) for s in off]
    if abs(middle - 1) > SCALE_LIMIT and line.bias_dps is not None:
        text = (
            f"{axis} reads {middle:.3g} of the true rate, a scale error of {middle - 1:+.0%}; gyroscopes have a few percent. "
            "Check table_rate_dps of all runs, the sensor's range and the size of one count (--lsb-dps when importing)"
        )
        return [Warning("scale_implausible", axis, None, text, True)]
    return []


def _is_in_rad(s: Slope) -> bool:
    by_itself = abs(s.raw * DEG - 1) < UNIT_WITHIN and abs(s.value) > STANDS_STILL * s.se
    return by_itself or abs(s.value * DEG - 1) < UNIT_WITHIN


def _follows(line: Line, run: Run) -> bool:
    slope = line.of(run)
    return slope is not None and FOLLOWS[0] <= abs(slope.value) <= FOLLOWS[1]


def _middle(values: Array) -> float:
    """The median, or of two middle values the one nearer to 1."""
    ordered = np.sort(values)
    low, high = float(ordered[(values.size - 1) // 2]), float(ordered[values.size // 2])
    return min((low, high), key=lambda v: abs(v - 1))


def _told(
    means: Means, code: str, axis: str, hit: list[Slope], informed: list[Slope], text: Callable[[Slope, str], str]
) -> list[Warning]:
    if len(hit) == len(informed):
        middle = replace(hit[0], value=float(np.median([s.value for s in hit])))
        return [Warning(code, axis, None, text(middle, axis), True)]
    return [Warning(code, axis, s.run.file, text(s, axis), True) for s in hit]


def _rad_readings(s: Slope, axis: str) -> str:
    return (
        f"{axis} reads {s.value:.4g} of the true rate, and pi/180 is 0.01745: the readings are in rad/s. "
        f"Give the unit when importing (--map g{axis}_dps=COLUMN:rad/s), or multiply the column by 57.2958"
    )


def _rad_reference(s: Slope, axis: str) -> str:
    return (
        f"{axis} reads {s.value:.4g} times the true rate, and 180/pi is 57.3: the reference is in rad/s. "
        "Give table_rate_dps, turn_deg or rate_ref_dps in degrees (--map rate_ref_dps=COLUMN:rad/s when importing)"
    )


def _swapped_text(other: str, follows: float, s: Slope, axis: str) -> str:
    return (
        f"the table turns about {axis}, but {axis} follows its rate with {s.value:.3f} and {other} with {follows:.3f}. "
        f'Set axis = "{other}" in session.toml, or exchange the columns when importing'
    )


def _flipped_text(s: Slope, axis: str) -> str:
    return (
        f"{axis} reads {s.value:.3f} of the true rate in every turning run: sensor or reference is mounted the other way. "
        "Exchange up and down, change the sign of the rates, or negate the column when importing (*-1)"
    )


def _face_text(s: Slope, axis: str) -> str:
    return (
        f"{axis} reads {s.value:.3f} of the true rate here and follows it in the other runs: face is {s.run.face!r}, "
        f"the readings say {'down' if s.run.face == 'up' else 'up'!s}. Correct face, or the sign of table_rate_dps"
    )


def _rate_text(s: Slope, middle: float, axis: str) -> str:
    run, ratio = s.run, s.value / middle
    what, stated = ("turn_deg", run.turn_deg) if run.rate_is_mean else ("table_rate_dps", run.table_rate_dps)
    if run.column("rate_ref_dps") is not None:
        what, stated = "rate_ref_dps", None
    seems = "" if stated is None else f": it seems to be {stated * ratio:.4g}, not {stated:g}"
    return (
        f"{axis} reads {s.value:.4f} of the stated rate here and {middle:.4f} in the other runs, {ratio - 1:+.1%} "
        f"({abs(s.value - middle) / max(s.se, 1e-12):.0f} standard errors). Check {what}{seems}"
    )


def _against_gravity(means: Means, axis: str, line: Line | None) -> list[Warning]:
    """Faces that the accelerometer contradicts.

    If it contradicts all runs and the gyroscope agrees with them, the sign of the accelerometer is wrong.
    """
    runs = [r for r in means.session.runs if r.axis == axis and r.acc_g is not None]
    up = {r.index: _upwards(r) for r in runs}
    hit = [r for r in runs if up[r.index] * r.face_sign < 0]
    known = [r for r in runs if up[r.index] != 0]
    turned = line is not None and any(abs(s.value - 1) < SIGN_WITHIN for s in line.slopes)
    if not hit or (len(hit) == len(known) and turned):
        return []

    def text(run: Run | None) -> str:
        return (
            f"by the accelerometer {axis} points {'the other way than face says' if run is None else _pole(-run.face_sign)}. "
            "Correct face in session.toml (up: the axis points away from the ground and reads +1 g)"
        )

    return told(means.session, "face_wrong", axis, hit, text, True)


def _pole(sign: float) -> str:
    return f"{'up' if sign > 0 else 'down'}, face says {'down' if sign > 0 else 'up'}"


def _upwards(run: Run) -> float:
    """+1 where the run's axis points up by its accelerometer, -1 down, 0 where neither or gravity turns about it."""
    assert run.acc_g is not None
    along = float(np.nanmean(run.acc_g[:, run.axis_index])) / max(float(np.nanmedian(np.linalg.norm(run.acc_g, axis=1))), 1e-12)
    return float(np.sign(along)) if abs(along) > POINTS_ALONG else 0.0


def sizes(means: Means, found: Lines, moved: list[Warning]) -> list[Warning]:
    """Biases and spreads over power cycles that no gyroscope has, without runs that another warning explains."""
    accused = contradictions(means, found)
    whole = {w.axis for w in accused if w.file is None}
    if any(w.code == "axes_swapped" for w in accused):
        return []
    out = []
    for axis in AXES:
        bad = {w.file for w in (*accused, *moved) if w.axis == axis}
        line = found.get((axis, axis))
        points = means.about(axis) if line is not None else means.by_axis[axis]
        points = [m for m in points if m.run.file not in bad]
        if not points:
            continue
        bias = line.bias_dps if line is not None else float(np.median([m.mean_dps for m in points]))
        if bias is None:
            continue
        if abs(bias) > BIAS_LIMIT_DPS:
            text = (
                f"the bias of {axis} is {bias:.4g} dps; gyroscopes have a few. Check the zero of the counts "
                "(an offset that was not subtracted), the unit, and that the table stood still in runs at rest"
            )
            out.append(Warning("bias_implausible", axis, None, text, True))
        if axis not in whole:
            slope = _middle(np.array([s.value for s in line.slopes])) if line is not None and line.slopes else 0.0
            out += _turn_on(axis, points, bias, slope)
    return out


def _turn_on(axis: str, points: list[Mean], bias: float, slope: float) -> list[Warning]:
    cycles: dict[str, list[Mean]] = {}
    for m in points:
        cycles.setdefault(m.run.scenario, []).append(m)
    offsets, scales = [], []
    for runs in cycles.values():
        rates = np.array([m.rate_dps for m in runs])
        left = np.array([m.mean_dps - bias - slope * m.rate_dps for m in runs])
        if slope and np.ptp(rates) > 0.1 * np.max(np.abs(rates)):
            offset, scale = np.linalg.lstsq(np.column_stack([np.ones(rates.size), rates]), left, rcond=None)[0]
            scales.append(float(scale))
        else:
            offset = left.mean()
        offsets.append(float(offset))
    bias_sd, scale_sd = (float(np.std(v, ddof=1)) if len(v) > 1 else 0.0 for v in (offsets, scales))
    if bias_sd <= TURN_ON_LIMIT_DPS and scale_sd <= TURN_ON_LIMIT_SCALE:
        return []
    how = f"bias by {bias_sd:.3g} dps" if bias_sd > TURN_ON_LIMIT_DPS else f"scale by {scale_sd:.0%}"
    text = (
        f"on {axis}, {len(cycles)} power cycles scatter in their {how} (one sigma); a sound part has hundredths of that. "
        "Check faces and rates of the runs, and which of them share a scenario (a power cycle)"
    )
    return [Warning("turn_on_implausible", axis, None, text, True)]
