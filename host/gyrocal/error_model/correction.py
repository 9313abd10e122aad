"""Correct readings with a model: the inverse of what the model adds to the true rate.

The model says ``reading = w + error(w, temperature, time, acceleration)`` for each axis. The error depends on the true rate w
itself (scale, nonlinearity, misalignment), so the equation is solved by iteration: ``w <- reading - error(w)``, beginning with
the reading. Errors are a few percent of the rate, so each iteration reduces the remaining error by that factor.

Only effects of the sensor are removed. Effects of the turntable, of the recorder's clock and of a damaged reading stay, as do
effects for which the recording lacks a column. :class:`Corrected` lists them with the reason.

Temperatures beyond those that the model was fitted on count as the nearest of these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import polars as pl

from gyrocal.effects.base import Role
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.recording.measured_rates import THREE_AXES
from gyrocal.recording.registration import Registration
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.recording.table import OPTIONAL, REQUIRED

RATES = tuple(f"g{axis}_dps" for axis in AXES)

CONVERGED_DPS = 1e-9
MOST_ITERATIONS = 100


@dataclass(frozen=True)
class Corrected:
    """Corrected rates [n, 3] in deg/s, the ids of the effects that were removed, and the others with the reason."""

    rate_dps: Array = field(repr=False)
    applied: list[str]
    left: dict[str, str]


def correct(model: Model, run: Run, bias_dps: Mapping[str, float] | None = None) -> Corrected:
    """Remove the model's effects from the readings of a run.

    ``bias_dps`` gives the bias of this power cycle in deg/s by axis; the model's bias is used on the other axes. Raises
    InputError if the model has no fitted values, or if the errors are so large that the iteration does not converge.
    """
    usable, left = _split(model, run)
    about = [axis for axis in AXES if any(t.axis == axis and t.effect.role is Role.SCALE for t in usable)] or list(AXES)
    rate_dps = run.gyro_dps.copy()
    within = model.fitted_on.clamped(run)
    for _ in range(MOST_ITERATIONS):
        turning = {AXES.index(axis): turning_about(within, axis, rate_dps) for axis in about}
        following = run.gyro_dps - _error_dps(usable, turning, bias_dps or {})
        change = float(np.max(np.abs(following - rate_dps), initial=0.0))
        rate_dps = following
        if change < CONVERGED_DPS:
            return Corrected(rate_dps, list(dict.fromkeys(t.effect_id for t in usable)), left)
    raise InputError(f"{run.file}: the model's errors are too large to be undone; check the model's values")


def correct_frame(
    model: Model, frame: Any, bias_dps: Mapping[str, float] | None = None, power_on_s: float | None = None
) -> Any:
    """Remove the model's effects from a table and return one of its kind; accelerations are corrected if it can.

    ``frame`` is a polars or pandas table, or a dict of arrays, with the columns of a session's table (``t_s``, ``gx_dps``,
    ``gy_dps``, ``gz_dps`` and optional ones), or an array [n, 4] of time in s and rates in deg/s. Raises InputError for
    anything else.

    ``power_on_s`` is the time from power-on to the first row, s; without it what depends on that, as a warm-up, stays.
    """
    if isinstance(frame, np.ndarray):
        if frame.ndim != 2 or frame.shape[1] != 4:
            raise InputError(f"the array has the shape {frame.shape}; give [n, 4]: t_s, gx_dps, gy_dps, gz_dps")
        table = pl.DataFrame(frame, schema=["t_s", *RATES])
        return np.column_stack([frame[:, 0], correct(model, run_of(table, "array", power_on_s), bias_dps).rate_dps])
    if isinstance(frame, Mapping):
        given = pl.DataFrame({name: np.asarray(values) for name, values in frame.items()})
        by_name = correct_frame(model, given, bias_dps, power_on_s)
        return {name: by_name[name].to_numpy() for name in by_name.columns}
    if not hasattr(frame, "columns"):
        kinds = "a polars or pandas table, a dict of arrays, or an array [n, 4]"
        raise InputError(f"frame is a {type(frame).__name__}; give {kinds}")
    pandas = not isinstance(frame, pl.DataFrame)
    table = pl.DataFrame({name: np.asarray(frame[name]) for name in frame.columns}) if pandas else frame
    done = correct(model, run_of(table, "table", power_on_s), bias_dps)
    columns = [pl.Series(name, done.rate_dps[:, i]) for i, name in enumerate(RATES)]
    columns += [] if model.accelerometer is None else model.accelerometer.corrected(table)
    if pandas:
        return frame.assign(**{column.name: column.to_numpy() for column in columns})
    return table.with_columns(columns)


def run_of(frame: pl.DataFrame, name: str, power_on_s: float | None = None) -> Run:
    """A table outside a session as a run whose true rate only its own columns know.

    Raises InputError if a column is missing or invalid.
    """
    absent = [column for column in ("t_s", *RATES) if column not in frame.columns]
    if absent:
        raise InputError(f"{name}: no column {absent[0]}; a recording has t_s, {', '.join(RATES)}")
    known = [column for column in frame.columns if column in (*REQUIRED, *OPTIONAL)]
    table = frame.select(pl.col(known).cast(pl.Float64))
    seconds = float(table["t_s"][-1] - table["t_s"][0]) if table.height > 1 else 0.0
    rate_hz = (table.height - 1) / seconds if seconds > 0 else 1.0
    return Run(0, name, "s000", "up", "z", None, None, None, power_on_s, rate_hz, frame=table)


def left_at_rest_dps(model: Model, run: Run) -> Array:
    """Readings [n, 3] of a run at rest less the errors of the model's effects at rest without its bias, deg/s."""
    usable, _ = _split(model, run)
    others = [t for t in usable if t.effect.role is not Role.BIAS]
    within = model.fitted_on.clamped(run)
    at_rest = {i: turning_about(within, axis, np.zeros((len(run), 3))) for i, axis in enumerate(AXES)}
    return np.asarray(run.gyro_dps - _error_dps(others, at_rest, {}))


def _split(model: Model, run: Run) -> tuple[list[Term], dict[str, str]]:
    """The terms that can be removed from this run, and the ids of the other effects with the reason."""
    if not any(term.values for term in model.terms):
        raise InputError(f"the model {model.name!r} has no fitted values; make one with `gyrocal explain` or `gyrocal add`")
    usable: list[Term] = []
    left: dict[str, str] = {}
    for term in model.terms:
        if not term.values:
            axes = [t.axis for t in model.terms if t.effect_id == term.effect_id and not t.values]
            left[term.effect_id] = f"the model has no value of it on {', '.join(axes)}, because its session could not show one"
            continue
        absent = [name for name in term.effect.requires if not run.has(name)]
        if isinstance(term.effect, FormulaEffect) and (lacking := term.effect.missing([run], AXES.index(term.axis))):
            absent = [lacking]
        if term.effect.uncorrected or term.fault is not None:
            left[term.effect_id] = term.effect.uncorrected
        elif absent:
            left[term.effect_id] = f"the recording has no {' and no '.join(absent)}"
        else:
            usable.append(term)
    return usable, left


def turning_about(run: Run, axis: str, rate_dps: Array) -> Run:
    """The run as if a turntable turned it about an axis at the given rates [n, 3], deg/s."""
    frame = run.table.drop(THREE_AXES, strict=False).with_columns(pl.Series("rate_ref_dps", rate_dps[:, AXES.index(axis)]))
    return replace(  # the rates are exact, so they are not smoothed
        run, axis=axis, face="up", table_rate_dps=None, turn_deg=None, path=None, frame=frame, smooth=False,  # type: ignore[arg-type]
        registration=Registration(),
    )  # fmt: skip


def _error_dps(terms: list[Term], turning: Mapping[int, Run], bias_dps: Mapping[str, float]) -> Array:
    """The sum of the terms [n, 3], deg/s."""
    error_dps = np.zeros((len(next(iter(turning.values()))), 3))
    for term in terms:
        i = AXES.index(term.axis)
        if term.effect.role is Role.BIAS and term.axis in bias_dps:
            continue
        error_dps[:, i] += term.effect.error_dps(turning, i, term.values)
    for axis, value in bias_dps.items():
        error_dps[:, AXES.index(axis)] += value
    return error_dps
