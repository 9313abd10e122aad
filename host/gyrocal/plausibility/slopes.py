"""Checks of how each axis follows the true rate: the unit, the axes, the signs, the rates and the scale.

The slope of a run is the regression of its readings on the true rate or, at one rate, (mean - bias) / rate. The bias is that of
the line on which most runs agree. A run that disagrees does not change it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from gyrocal.plausibility.runs import Mean, Means, told
from gyrocal.policy import POLICY
from gyrocal.recording.measured_rates import ANGLE, QUATERNION, RATES
from gyrocal.recording.run import points_up
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.tails import ROBUST
from gyrocal.warning import Warning

DEG = 180.0 / np.pi
MOST_POINTS = 80


@dataclass(frozen=True)
class Slope:
    """The slope of one run. ``raw`` is the slope without subtraction of the bias, which has the unit of the other runs."""

    run: Run
    value: float
    se: float
    raw: float
    omega_rad_s: float = 0.0
    """Root mean square angular frequency of the true rate, rad/s; 0 if the rate does not vary."""
    explained: float = 1.0
    """The part of the readings' power that the slope explains."""

    @property
    def unrelated(self) -> bool:
        """True if the readings show nothing of what a reference with three axes says of this axis."""
        alike = self.explained >= 1 - POLICY.unrelated_part
        return self.run.three_axes and not alike and abs(self.value) < POLICY.follows_not

    def misses(self, axis: str) -> bool:
        """True if a reference with three axes turns about this axis, and its readings show nothing of that."""
        if not self.run.three_axes or self.explained >= POLICY.unrelated_axis:
            return False
        known = self.run.reached
        true_dps = float(np.std(self.run.about(axis).rate_dps[known]))
        reading_dps = float(np.std(self.run.gyro_dps[known, AXES.index(axis)]))
        return min(true_dps, reading_dps) > POLICY.unrelated_dps and true_dps > POLICY.unrelated_part * reading_dps

    @property
    def informs(self) -> bool:
        """True if its error is small compared with the slope, or with 1 if the axis does not follow."""
        return self.se < POLICY.slope_se * max(1.0, abs(self.value))


@dataclass(frozen=True)
class Line:
    """The line on which the runs about an axis agree. ``bias_dps`` is None if they do not determine it.

    ``slopes`` are those of turning runs. ``scatter_dps`` is the spread of the bulk of the runs about the line.
    """

    bias_dps: float | None
    slopes: list[Slope]
    scatter_dps: float = 0.0

    def of(self, run: Run) -> Slope | None:
        """The slope of one run, or None if it has none."""
        return next((s for s in self.slopes if s.run is run), None)


Lines = dict[tuple[str, str], Line]


def lines(means: Means) -> Lines:
    """Lines by (the table's axis, the readings' axis)."""
    return {(about, axis): _line(means.about(about, axis)) for about in means.turned for axis in AXES}


def _line(points: list[Mean]) -> Line:
    steady = [m for m in points if m.slope is None]
    swings = [m for m in points if m.slope is not None]
    rates, values = np.array([m.rate_dps for m in steady]), np.array([m.mean_dps for m in steady])
    bias, slope = agreed(rates, values)
    if bias is None and swings:
        bias = float(np.median([m.offset_dps for m in swings]))
    scatter = 0.0
    if bias is not None and steady:
        signed = values - bias - slope * rates
        scatter = float(np.median(np.abs(signed))) * ROBUST
    if len({m.run.scenario for m in steady}) < POLICY.few_runs:
        scatter = max(scatter, POLICY.turn_on_dps * min(1.0, abs(slope)))
    unknown = POLICY.unknown_bias_dps if bias is None else 0.0
    own = _of_cycles(steady, bias or 0.0, slope)
    found = [
        Slope(m.run, float(m.slope), m.slope_se, float(m.slope), m.omega_rad_s, m.explained)
        for m in swings if m.slope is not None
    ]  # fmt: skip
    for m in steady:
        if not m.rests:
            error = float(np.hypot(np.hypot(m.se_dps, scatter), unknown)) / abs(m.rate_dps)
            value, raw = (m.mean_dps - (bias or 0.0)) / m.rate_dps, m.mean_dps / m.rate_dps
            value = own.get(m.run.scenario, value)
            found.append(Slope(m.run, value, error, raw))
    return Line(bias, found, scatter)


def _of_cycles(points: list[Mean], bias: float, slope: float) -> dict[str, float]:
    """Slope of each power cycle with an offset of its own, if its runs then agree although the common line does not fit them.

    The runs of a cycle share its offset, unlike a wrong rate or face of one of them.
    """
    slopes = {}
    for scenario in {m.run.scenario for m in points}:
        cycle = [m for m in points if m.run.scenario == scenario]
        rates = np.array([m.rate_dps for m in cycle])
        if np.ptp(rates) <= POLICY.two_rates * float(np.max(np.abs(rates))):
            return {}
        slopes[scenario] = float(np.polyfit(rates, [m.mean_dps for m in cycle], 1)[0])
    if len(slopes) < 2:
        return {}
    apart = float(np.ptp(list(slopes.values())))
    single = max((abs((m.mean_dps - bias) / m.rate_dps - slope) for m in points if not m.rests), default=0.0)
    middle = abs(float(np.median(list(slopes.values()))))
    return slopes if apart < POLICY.rate_off * middle and single > POLICY.cycles_explain * apart else {}


def agreed(rates: Array, values: Array) -> tuple[float | None, float]:
    """Bias and slope of the line through two runs with which the others agree best (Cauchy's loss); None at a single rate.

    If several lines agree with equally many runs, the slope nearest to 1 is chosen.
    """
    if rates.size == 0:
        return None, 1.0
    if np.all(np.abs(rates) < 1e-9):
        return float(np.median(values)), 1.0
    least = POLICY.two_rates * float(np.max(np.abs(rates)))
    every = np.unique(np.linspace(0, rates.size - 1, min(rates.size, MOST_POINTS)).astype(np.intp))
    pairs = np.array([(i, j) for i, j in combinations(every, 2) if abs(rates[i] - rates[j]) > least])
    if not pairs.size:
        return None, 1.0
    i, j = pairs.T
    slope = (values[i] - values[j]) / (rates[i] - rates[j])
    bias = values[i] - slope * rates[i]
    tolerance = POLICY.agree_dps + POLICY.agree * np.abs(rates)
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
    informed = [s for s in line.slopes if s.informs or line.bias_dps is None]
    if not informed:
        missed = bool(line.slopes) and all(s.misses(axis) for s in line.slopes)
        return [_unrelated(axis, line.slopes[0].run)] if missed else []

    def where(fits: Callable[[Slope], bool]) -> list[Slope]:
        return [s for s in informed if fits(s)]

    if all(s.unrelated for s in informed):
        return [_unrelated(axis, informed[0].run)]
    small = where(lambda s: _is_in_rad(s) and not any(_follows(found[axis, a], s.run) for a in AXES if a != axis))
    if small:
        return _told(means, "unit_rad_s", axis, small, informed, _rad_readings)
    large = where(lambda s: abs(s.value / DEG - 1) < POLICY.unit_within)
    if large:
        return _told(means, "unit_rad_s", axis, large, informed, _rad_reference)
    for other in (a for a in AXES if a != axis):
        swapped = [s for s in where(lambda s: abs(s.value) < POLICY.follows_not) if _follows(found[axis, other], s.run)]
        if swapped:
            text = partial(_swapped_text, other, found[axis, other], swapped, len(swapped) == len(informed))
            told_of = _told(means, "axes_swapped", axis, swapped, informed, text)
            return [w if w.file is None else replace(w, axis=None) for w in told_of]  # no column of such a file is sure
    flipped = where(lambda s: abs(s.value + 1) < POLICY.sign_within)
    if flipped and len(flipped) == len(informed):
        return _told(means, "sign_flipped", axis, flipped, informed, _flipped_text)
    if flipped:
        return [Warning("face_wrong", axis, s.run.file, _face_text(s, axis), True) for s in flipped]
    sure = [s for s in informed if s.informs]
    if not sure:
        return _beyond_any_bias(informed, axis)
    values = np.array([s.value for s in sure])
    middle = middle_of(values)
    beyond = abs(values - middle) / [max(s.se, 1e-12) for s in sure]
    errors = POLICY.rate_errors * (max(1.0, ROBUST * float(np.median(beyond))) if values.size >= POLICY.few_runs else 1.0)
    off = [s for s in sure if abs(s.value - middle) > max(POLICY.rate_off * abs(middle), errors * s.se)]
    scaled = abs(middle - 1) > POLICY.largest_scale and line.bias_dps is not None
    turned = _one_face(means.about(axis)) if scaled else None
    if turned is not None:
        return [Warning("face_wrong", axis, turned.run.file, _face_text(turned, axis), True)]
    if off and not _behind_a_filter(sure, errors):
        return _wrong_rates(means.about(axis), axis, off, middle)
    return [_scale(middle, axis, sure[0].run)] if scaled else _beyond_any_bias(sure, axis) if line.bias_dps is None else []


def _behind_a_filter(slopes: list[Slope], errors: float) -> bool:
    """True if the slopes of faster motions are smaller as behind a first-order low-pass with one scale.

    Behind a low-pass of time constant tau, a motion of angular frequency w has the slope s / sqrt(1 + (w tau)^2), so that
    1 / slope^2 is a line in w^2.
    """
    if any(s.omega_rad_s == 0.0 or s.value <= 0.0 for s in slopes) or len(slopes) < 2:
        return False
    squares, values = np.array([s.omega_rad_s**2 for s in slopes]), np.array([s.value for s in slopes])
    if np.ptp(squares) < POLICY.two_rates * float(squares.max()):
        return False
    growth, start = np.polyfit(squares, values**-2, 1)
    if growth <= 0.0 or start <= 0.0:
        return False
    expected = (start + growth * squares) ** -0.5
    allowed = np.maximum(POLICY.rate_off * expected, errors * np.array([s.se for s in slopes]))
    return bool(np.all(np.abs(values - expected) < allowed))


def _unrelated(axis: str, run: Run) -> Warning:
    about, known = run.about(axis), run.reached
    reading_dps, true_dps = float(np.std(run.gyro_dps[known, AXES.index(axis)])), float(np.std(about.rate_dps[known]))
    text = (
        f"the readings about {axis} ({reading_dps:.2g} dps rms) show nothing of what the reference says of this axis "
        f"({true_dps:.2g} dps rms): either {axis} does not work, or the orientations are wrong about it. If the sensor lay "
        "still, import it without the reference (--rate 0); if it turned about the other axes alone, accept this warning and "
        "use their answers"
    )
    return Warning("reference_unrelated", axis, None, text, True)


def _scale(middle: float, axis: str, run: Run) -> Warning:
    measured = "the units of the reference, of the readings and of t_s"
    stated = "table_rate_dps of all runs" if run.measured_rates is None else measured
    text = (
        f"{axis} reads {middle:.3g} of the true rate, a scale error of {middle - 1:+.0%}; gyroscopes have a few percent. "
        f"Check {stated}, the sensor's range and the size of one count (--lsb-dps when importing)"
    )
    return Warning("scale_implausible", axis, None, text, True)


def _beyond_any_bias(slopes: list[Slope], axis: str) -> list[Warning]:
    """``scale_implausible`` at a single rate, which shows no bias: no plausible bias and scale together give these readings."""
    middle = middle_of(np.array([s.value for s in slopes]))
    rate_dps = max(abs(float(s.run.rate_dps.mean())) for s in slopes)
    beyond = abs(middle - 1) > POLICY.largest_scale + POLICY.largest_bias_dps / rate_dps
    return [_scale(middle, axis, slopes[0].run)] if beyond else []


def _one_face(points: list[Mean]) -> Slope | None:
    """The only run whose opposite face turns an implausible line into a plausible one on which all runs agree."""
    found = []
    values = np.array([m.mean_dps for m in points])
    for i, m in enumerate(points):
        rates = np.array([p.rate_dps for p in points])
        rates[i] *= -1
        bias, slope = agreed(rates, values)
        if bias is None:
            bias, slope = 0.0, float(np.median(values / rates))
        left = np.abs(values - bias - slope * rates)
        agrees = bool(np.all(left < POLICY.turning_errors * (POLICY.agree_dps + POLICY.agree * np.abs(rates))))
        plausible = abs(slope - 1) < POLICY.sign_within and abs(bias) < POLICY.largest_bias_dps
        if not m.rests and m.slope is None and agrees and plausible:
            found.append(Slope(m.run, -slope, 0.0, -slope))
    return found[0] if len(found) == 1 else None


def _is_in_rad(s: Slope) -> bool:
    turns = abs(s.value) > POLICY.turning_errors * s.se
    by_itself = abs(s.raw * DEG - 1) < POLICY.unit_within and turns and abs(s.value - 1) > POLICY.sign_within
    return by_itself or (abs(s.value * DEG - 1) < POLICY.unit_within and (turns or s.omega_rad_s == 0.0))


def _follows(line: Line, run: Run) -> bool:
    slope = line.of(run)
    return slope is not None and POLICY.follows[0] <= abs(slope.value) <= POLICY.follows[1]


def middle_of(values: Array) -> float:
    """The median of values [n]; of two middle values the one nearer to 1."""
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
    by_bias = abs(s.value * DEG - 1) < POLICY.unit_within  # else the bias of the other runs is in another unit
    return (
        f"{axis} reads {s.value if by_bias else s.raw:.4g} of the true rate, and pi/180 is 0.01745: the readings are in rad/s. "
        f"Give the unit when importing (--map g{axis}_dps=COLUMN:rad/s), or multiply the column by 57.2958"
    )


def _rad_reference(s: Slope, axis: str) -> str:
    if s.run.column(QUATERNION[0]) is not None:
        return (
            f"{axis} reads {s.value:.4g} times the true rate, and 180/pi is 57.3: orientations have no unit, so the readings "
            f"were in dps already when they were converted. Leave the unit out when importing (--map g{axis}_dps=COLUMN)"
        )
    columns = [name for name in (*RATES, "rate_ref_dps", ANGLE) if s.run.column(name) is not None]
    stated = "turn_deg in degrees" if s.run.rate_is_mean else "table_rate_dps in degrees a second"
    if columns:
        unit = "rad" if columns == [ANGLE] else "rad/s"
        stated = f"{', '.join(columns)} in degrees (--map {columns[0]}=COLUMN:{unit} when importing)"
    return (
        f"{axis} reads {s.value:.4g} times the true rate, and 180/pi is 57.3: the reference is in rad/s, or readings in deg/s "
        f"were converted once more. Give {stated}, or leave the unit of g{axis}_dps out (--map g{axis}_dps=COLUMN)"
    )


def _swapped_text(other: str, line: Line, hit: list[Slope], whole: bool, s: Slope, axis: str) -> str:
    follows = np.median([found.value for one in (hit if whole else [s]) if (found := line.of(one.run)) is not None])
    text = f"the table turns about {axis}, but {axis} follows its rate with {s.value:.3f} and {other} with {follows:.3f}"
    if whole:
        return f'{text}. Set axis = "{other}" in session.toml, or exchange the columns when importing'
    return (
        f"{text} in this file{' only' if len(hit) == 1 else ''}: its columns are in another order than those of other files. "
        f"Give them their order in this file (the readings of {axis} are in g{other}_dps), or leave the run out"
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


def _wrong_rates(points: list[Mean], axis: str, off: list[Slope], middle: float) -> list[Warning]:
    """``rate_wrong`` for the runs that are off, whose slopes come from the line of the other runs where that has a bias."""
    accused = {s.run.file for s in off}
    others = [m for m in points if m.run.file not in accused]
    line = _line(others) if any(not m.rests for m in others) else Line(None, [])
    if line.bias_dps is None:
        return [Warning("rate_wrong", axis, s.run.file, _rate_text(s, middle, axis), True) for s in off]
    middle = middle_of(np.array([s.value for s in line.slopes]))
    anew = {s.run.file: s for s in _line_slopes([m for m in points if m.run.file in accused], line, len(others))}
    told_of = [anew.get(s.run.file, s) for s in off]
    still = [s for s in told_of if abs(s.value - middle) > POLICY.rate_off * abs(middle)]
    return [Warning("rate_wrong", axis, s.run.file, _rate_text(s, middle, axis), True) for s in still or told_of]


def _line_slopes(points: list[Mean], line: Line, runs: int) -> list[Slope]:
    """Slopes of steady runs by the bias of a line of other ``runs``, with the errors of both."""
    scatter_dps = max(line.scatter_dps, POLICY.turn_on_dps)
    out = []
    for m in (m for m in points if m.slope is None and not m.rests):
        error_dps = float(np.hypot(m.se_dps, scatter_dps * (1 + 2 / runs) ** 0.5))
        value = (m.mean_dps - (line.bias_dps or 0.0)) / m.rate_dps
        out.append(Slope(m.run, value, error_dps / abs(m.rate_dps), m.mean_dps / m.rate_dps))
    return out


def _rate_text(s: Slope, middle: float, axis: str) -> str:
    run, ratio = s.run, s.value / middle
    what, unit, stated = "table_rate_dps", "dps", run.table_rate_dps
    if run.rate_is_mean:
        what, unit, stated = "turn_deg", "deg", run.turn_deg
    if run.reference_dps is not None:
        what, stated = "the reference", None
    seems = ""
    if stated is not None:
        likely, se = stated * ratio, abs(stated * s.se / middle)
        seems = f": it seems to be {likely:.4g} +- {se:.1g} {unit}, not {stated:g}"
        if abs(likely) < POLICY.turning_errors * se:
            still = f"({likely:.1g} +- {se:.1g} {unit}, not {stated:g})"
            seems = f": the table seems to have stood still {still}; record the run again if it should turn"
    return (
        f"{axis} reads {s.value:.4f} of the stated rate here and {middle:.4f} in the other runs, {ratio - 1:+.1%} "
        f"({abs(s.value - middle) / max(s.se, 1e-12):.0f} standard errors). Check {what}{seems}"
    )


def _against_gravity(means: Means, axis: str, line: Line | None) -> list[Warning]:
    """Faces that the accelerometer contradicts.

    If it contradicts all runs and the gyroscope agrees with them, the sign of the accelerometer is wrong.
    """
    runs = [r for r in means.session.runs if r.axis == axis and r.acc_g is not None and not r.three_axes]
    up = {r.index: points_up(r.acc_g, r.axis_index) for r in runs if r.acc_g is not None}
    hit = [r for r in runs if up[r.index] * r.face_sign < 0]
    known = [r for r in runs if up[r.index] != 0]
    turned = line is not None and any(abs(s.value - 1) < POLICY.sign_within for s in line.slopes)
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
