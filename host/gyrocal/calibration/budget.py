"""The error budget of a calibration on a table: what each source contributes, and what would lower it.

The squares of the sources that the standard error contains add up to its square. The other sources are bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from gyrocal.calibration.estimator import Answer, Calibration, RunBlocks, run_blocks
from gyrocal.calibration.trust import Evidence
from gyrocal.calibration.uncertainty import Combined
from gyrocal.effects.bias_temperature import BiasTemperature
from gyrocal.effects.clock_error import CLOCK_SE
from gyrocal.effects.earth_rate import EARTH_DPS, EarthRate
from gyrocal.effects.scale_temperature import ScaleTemperature
from gyrocal.noise.whitening import Noise, normal_equations
from gyrocal.recording.session import Array, Run, Session

TILT_DEG = 2.0
"""Tilt of the sensor's axis against the table's that is assumed without an accelerometer: a sensor mounted by eye."""
OFFSET_DEG = float(np.rad2deg(0.02))
"""Tilt that an accelerometer's own offset of 20 mg can hide (LSM6DSO datasheet, table 2)."""
VERTICAL_DEG = 30.0
"""Largest angle between the sensed axis and gravity at which the table's axis counts as vertical."""
LOG_STEP = 0.02
"""Step of the logarithm of the drift's variance for the derivative of the information."""
ROUNDING = 1e-9
"""A smaller part of the variance is a rounding error."""

WHITE, DRIFT, STEPS, SCATTER = "white noise", "drift", "resolution", "scatter beyond the noise"
EFFECTS, NETWORK, PRIOR, FIT = "effects not excluded", "network", "prior", "fit of all power cycles"
TABLE, REFERENCE, TILT, EARTH = "table rate", "reference", "tilt", "Earth's rate"
TURN, CLOCK, TEMPERATURE = "turn angle", "sample clock", "temperature"

ADVICE = {
    WHITE: "record longer runs",
    DRIFT: "repeat the calibration in several power cycles and average the answers",
    STEPS: "select a smaller full scale, which has smaller steps",
    SCATTER: "diagnose the session, because the block means differ by more than the noise",
    EFFECTS: "record longer runs, or give the model of a campaign on this table with --model",
    NETWORK: "give the model of a campaign on this table with --model, or train a network for it",
    PRIOR: "record longer runs, or fit the model to more power cycles",
    FIT: "record longer runs in more power cycles",
    TABLE: "measure the table's rate over many turns, and state table_rate_se_dps in session.toml",
    REFERENCE: "compare the reference with a known turn, because its own scale error is that of the answer",
    TURN: "measure the angle of the turn, and state its error as turn_se_deg in session.toml",
    TILT: "align the sensor's axis with the axis of rotation, and record the accelerometer, which shows the tilt",
    EARTH: "state latitude_deg in session.toml, which corrects a known rate or turn, or turn in both directions on each face",
    CLOCK: "compare t_s with a better clock over an hour",
    TEMPERATURE: "calibrate at the temperature of use, or record temp_c, which shows how far the temperature moves",
}
ALIGN = "align the sensor's axis with the axis of rotation; the accelerometer's own offset hides the last degree"
BOTH_WAYS, STATE_LATITUDE = "turn in both directions on each face", "state latitude_deg in session.toml"
LONGER = "record longer runs"
OTHER_NETWORK = "train a network for this model, or take the model's answer if its error is smaller"
NO_EARTH = "nothing: the runs turn in both directions on each face"
NO_CLOCK = "nothing: the rate is known without the sensor's clock"
NO_TEMPERATURE = "nothing: the model holds what the temperature changes"
MORE_ANGLE = "turn through a larger angle or more often, and state the smaller turn_se_deg"
MORE_TURNS = "measure the table's rate over more turns, and state the smaller table_rate_se_dps"


@dataclass(frozen=True)
class BudgetRow:
    """A source of error of scale (fraction) and bias (deg/s); None if the session does not show it.

    ``in_se`` is true if the standard error contains it, and false if it is a bound of what the standard error leaves out.
    """

    source: str
    scale: float | None
    bias_dps: float | None
    in_se: bool = True
    remedy: str = ""

    @property
    def advice(self) -> str:
        """What would lower it: ``remedy`` if what was recorded allows another one than usual."""
        return self.remedy or ADVICE[self.source]

    def to_json(self) -> dict[str, Any]:
        return {
            "source": self.source, "scale": self.scale, "bias_dps": self.bias_dps, "in_se": self.in_se, "advice": self.advice
        }  # fmt: skip


def by_evidence(evidence: Evidence, answer: Answer, *, of_network: bool = False) -> list[BudgetRow]:
    """The sources of an answer whose errors allow for typical effects: each is what the variance gains by it.

    ``of_network`` is true for a network's answer, which adds its distance from the fit.
    """
    faces, w_dps = evidence.faces, np.array(evidence.w_dps)
    white, noise, standing = (
        np.array([float(x[0]) for x in of])
        for of in ([f.white for f in faces], [f.variance[:, 0] - f.standing for f in faces], [f.standing for f in faces])
    )
    excess = np.array([float(f.excess()[0]) for f in faces])
    fit = Combined.of(faces, evidence.w_dps)
    names = [WHITE, DRIFT, STEPS, SCATTER]
    sums = [_line(w_dps, v) for v in (white, noise, noise + standing, (noise + standing) * excess * fit.scatter[0])]
    if of_network:
        names.append(EFFECTS)
        sums.append(np.array([fit.scale_variance[0], fit.bias_variance[0]]))
    names.append(NETWORK if of_network else EFFECTS)
    sums.append(variances(answer, evidence.runs))
    return _rows(names, np.diff(sums, axis=0, prepend=np.zeros((1, 2))))


def by_network(answer: Answer, runs: Sequence[Run]) -> list[BudgetRow]:
    """The one source of a network's answer with a model's prior: what it states itself."""
    return _rows([NETWORK], variances(answer, runs)[None], {NETWORK: OTHER_NETWORK})


def by_fit(answer: Answer, runs: Sequence[Run]) -> list[BudgetRow]:
    """The one source of an answer by the fit of a whole session."""
    return _rows([FIT], variances(answer, runs)[None])


def by_posterior(calibration: Calibration, runs: Sequence[Run], answer: Answer, *, fitted: bool = False) -> list[BudgetRow]:
    """The sources of an answer by the model, whose covariance is linear in those of noise, drift and priors.

    ``fitted`` is true for the model of a campaign.

    Of alternatives that exclude each other, the middle one is taken. What the average over them adds belongs to the effects.
    """
    calibration = _without_alternatives(calibration)
    told = [(run, b) for run, b in ((run, run_blocks(run, calibration)) for run in runs) if b.samples.size]
    blocks = [b for _, b in told]
    k, known = len(calibration.run_columns), calibration.prior_information**2
    prior = np.concatenate([np.tile(known[:k], len(blocks)), known[k:]])
    noise, half = calibration.noise, 0.25 * LOG_STEP
    data, low, high = (
        _information(calibration, blocks, replace(noise, ou_sd_dps=noise.ou_sd_dps * np.exp(x))) for x in (0.0, -half, half)
    )
    information = data + np.diag(prior)
    size = np.sqrt(np.diag(information))
    inverse = np.divide(1.0, size, where=size > 0, out=np.zeros(size.size))  # a column that is zero in these runs tells nothing
    cov = inverse[:, None] * np.linalg.pinv(inverse[:, None] * information * inverse, hermitian=True) * inverse
    gain = cov[[-1, -2]]  # scale, bias
    by_drift = np.maximum(_quadratic(gain, (low - high) / LOG_STEP), 0.0)
    by_turn = np.zeros(2)
    for i, (run, _) in enumerate(told):
        if run.rate_is_mean and run.axis == calibration.axis and run.turn_se_deg:
            one = _information(calibration, blocks, noise, only=i)
            by_turn += _quadratic(gain, one) * one[-2, -2] * (run.turn_se_deg / run.duration_s) ** 2
    by_white = np.maximum(_quadratic(gain, data) - by_drift - by_turn, 0.0)
    by_prior = gain**2 * prior
    parts = np.array([by_white, by_drift, by_turn, by_prior[:, -2:].sum(1), by_prior[:, :-2].sum(1)])
    total, stated = parts.sum(0), variances(answer, runs)
    parts *= np.minimum(1.0, stated / total)
    parts[-1] += np.maximum(stated - total, 0.0)
    remedies = {TURN: MORE_ANGLE} | ({EFFECTS: LONGER} if fitted else {})
    return _rows([WHITE, DRIFT, TURN, PRIOR, EFFECTS], parts, remedies)


def variances(answer: Answer, runs: Sequence[Run]) -> Array:
    """Squares [2] of the standard errors of scale and bias, without that of the table's rate."""
    table = max(run.relative_rate_se for run in runs)
    return np.array([answer.scale_se**2 - table**2, answer.bias_se_dps**2])


def beside(
    runs: Sequence[Run], axis: str, spread_c: float | None, modelled: Sequence[str] = (), *, weighed: bool = False
) -> list[BudgetRow]:
    """The true rate, and bounds of the sources that no standard error contains, for an answer from ``runs``.

    ``spread_c`` is the spread of the session's temperatures in degC. ``modelled`` are ids of effects that the method's model
    corrects. ``weighed`` is true if the standard error contains that of the turns' angles, as far as it is known.
    """
    views = [run.about(axis) for run in runs]
    turns = [run for run in runs if run.axis == axis and run.rate_is_mean and run.turn_deg]
    rows = _of_turns(turns, weighed=weighed)
    if not turns or any(run.table_rate_dps for run in views):
        rows.append(_of_table(views))
    if not any(run.three_axes for run in views):
        remedy = "" if any(run.acc_g is None for run in views) else ALIGN
        rows.append(BudgetRow(TILT, float(1 - np.cos(np.deg2rad(tilt_deg(views)))), 0.0, in_se=False, remedy=remedy))
    in_rate = all(run.latitude_deg is not None and run.reference_dps is None for run in views)  # by in_known_rate
    if EarthRate.id not in modelled and not in_rate:
        rows.append(BudgetRow(EARTH, *earth_share(views), in_se=False, remedy=_of_earth(views)))
    by_angle = any(r.rate_is_mean or (r.measured_rates is not None and r.measured_rates.derived) for r in views)
    rows.append(BudgetRow(CLOCK, *((CLOCK_SE, 0.0, False) if by_angle else (0.0, 0.0, False, NO_CLOCK))))
    return [*rows, _of_temperature(spread_c, modelled)]


def _of_temperature(spread_c: float | None, modelled: Sequence[str]) -> BudgetRow:
    """The bound of what the temperature changes: typical slopes, of the effects that are not modelled, times the spread."""
    if spread_c is None:
        return BudgetRow(TEMPERATURE, None, None, in_se=False)
    both = ScaleTemperature(), BiasTemperature()
    scale, bias_dps = (0.0 if e.id in modelled else spread_c * (e.parameters[0].default or 0.0) for e in both)
    missing = " and ".join(e.title.lower() for e in both if e.id not in modelled)
    remedy = (
        f"calibrate at the temperature of use, or by a model with {missing}: without it, typical slopes are assumed over the "
        f"{spread_c:.2g} °C by which the session's temperature moves"
    )
    return BudgetRow(TEMPERATURE, scale, bias_dps, in_se=False, remedy=remedy if missing else NO_TEMPERATURE)


def _of_earth(runs: Sequence[Run]) -> str:
    """What lowers the share of the Earth's rate and was not done yet: its sign goes with the face, not with the rate."""
    stated = runs[0].latitude_deg is not None
    if all(any(s * r.rate_dps.mean() > 0 for r in runs if r.face == f) for f in {r.face for r in runs} for s in (-1, 1)):
        return NO_EARTH if stated else STATE_LATITUDE
    return BOTH_WAYS if stated else ""


def largest(rows: Sequence[BudgetRow]) -> BudgetRow | None:
    """The source with the largest part of the scale's error; None if no row has a value."""
    return max((r for r in rows if r.scale), key=lambda r: r.scale or 0.0, default=None)


def tilt_deg(runs: Sequence[Run]) -> float:
    """Bound of the angle between the sensed axis and gravity: the largest by the accelerometer in any run, and its offset's.

    It is ``TILT_DEG`` without an accelerometer, and if the table's axis is not vertical.
    """
    found = []
    for run in runs:
        if run.acc_g is None:
            return TILT_DEG
        mean = np.nanmean(run.acc_g, axis=0)
        size = float(np.linalg.norm(mean))
        found.append(np.rad2deg(np.arccos(abs(mean[run.axis_index]) / size)) if size > 0 else np.inf)
    return float(max(found)) + OFFSET_DEG if max(found) < VERTICAL_DEG else TILT_DEG


def earth_share(runs: Sequence[Run]) -> tuple[float, float]:
    """Errors of scale (fraction) and bias (deg/s) by the Earth's rate about a vertical axis, which least squares fits.

    Without the latitude the rate is that at the pole, which no place exceeds.
    """
    latitude_deg = runs[0].latitude_deg
    vertical_dps = EARTH_DPS * (1.0 if latitude_deg is None else abs(np.sin(np.deg2rad(latitude_deg))))
    rate_dps = np.concatenate([run.rate_dps for run in runs])
    earth_dps = np.concatenate([np.full(len(run), vertical_dps * run.face_sign) for run in runs])
    columns = np.stack([rate_dps, np.ones(rate_dps.size)])
    scale, bias_dps = (abs(float(v)) for v in np.linalg.lstsq(columns @ columns.T, columns @ earth_dps, rcond=None)[0])
    largest_dps = float(np.abs(rate_dps).max(initial=0.0))
    least = ROUNDING * vertical_dps
    return scale if scale * largest_dps > least else 0.0, bias_dps if bias_dps > least else 0.0


def temperature_spread_c(session: Session) -> float | None:
    """Largest less smallest temperature of a session, degC; None without a thermometer."""
    temps = [run.temp_c for run in session.runs if run.temp_c is not None]
    return float(max(np.nanmax(t) for t in temps) - min(np.nanmin(t) for t in temps)) if temps else None


def _of_turns(turns: Sequence[Run], *, weighed: bool) -> list[BudgetRow]:
    """The error of turns of which the angle is known, where it is unknown: a stated one is in the standard error."""
    unknown = [r for r in turns if r.turn_se_deg is None]
    return [] if not unknown or (weighed and len(turns) > 1) else [BudgetRow(TURN, None, 0.0, in_se=False)]


def _of_table(runs: Sequence[Run]) -> BudgetRow:
    """The error of the true rate, which is in the standard error only if the session states it."""
    relative = max(run.relative_rate_se for run in runs)
    if relative > 0:
        return BudgetRow(TABLE, relative, 0.0, remedy=MORE_TURNS)
    measured = any(run.reference_dps is not None for run in runs)
    return BudgetRow(REFERENCE if measured else TABLE, None, 0.0, in_se=False)


def _rows(names: Sequence[str], parts: Array, remedies: Mapping[str, str] = MappingProxyType({})) -> list[BudgetRow]:
    """Rows of variances [rows, 2] with other ``remedies``; sources without a part beyond rounding errors are left out."""
    matters = (parts > ROUNDING * parts.sum(0)).any(1)
    roots = np.sqrt(np.maximum(parts, 0.0))
    given = zip(names, roots, matters, strict=True)
    return [BudgetRow(n, float(s), float(b), remedy=remedies.get(n, "")) for n, (s, b), kept in given if kept]


def _line(w_dps: Array, variance: Array) -> Array:
    """Variances [2] of slope and intercept of a line through points at ``w_dps`` [F] with these variances [F]."""
    s0, s1, s2 = (float(np.sum(w_dps**power / variance)) if np.all(variance > 0) else 0.0 for power in range(3))
    det = s0 * s2 - s1**2
    return np.array([s0, s2]) / det if det > 0 else np.zeros(2)


def _without_alternatives(calibration: Calibration) -> Calibration:
    a = calibration.alternatives
    if not a:
        return calibration
    columns = calibration.run_columns
    return replace(calibration, run_columns=(*columns[:-a], columns[a // 2 - a]), alternatives=0)


def _information(calibration: Calibration, blocks: Sequence[RunBlocks], noise: Noise, only: int | None = None) -> Array:
    """The information of all data, or of ``only`` one run's, [p, p] on [each run's columns, shared columns, bias, scale]."""
    k = len(calibration.run_columns)
    own = k * len(blocks)
    size = own + len(calibration.shared_columns) + 2
    out = np.zeros((size, size))
    for i, (means, t_s, samples) in enumerate(blocks):
        if only not in (None, i):
            continue
        rows = np.r_[k * i : k * (i + 1), own:size]
        out[np.ix_(rows, rows)] += normal_equations(means[None], t_s, samples, noise)[0][0][:-1, :-1]
    return out


def _quadratic(gain: Array, matrix: Array) -> Array:
    """``g' M g`` of each row g of ``gain``."""
    return np.asarray(np.einsum("kp,pq,kq->k", gain, matrix, gain))
