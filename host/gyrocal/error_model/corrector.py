"""Correct single samples with a model, as they come: the twin in Python of ``gc_correct`` in the device's core.

The model says ``reading = M w + e(w)``: M holds scale and misalignment, and e the bias and all other effects. It is solved by
``w <- M^-1 (reading - e(w))``, which is exact at once where no effect but those in M depends on the rate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from gyrocal.effects.base import AtSample, Role
from gyrocal.error_model.correction import CONVERGED_DPS, MOST_ITERATIONS, RATES, run_of, turning_about
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.recording.session import AXES, Array

Vector = tuple[float, float, float]
UNKNOWN = math.nan
NO_ACCELERATION = (math.nan, math.nan, math.nan)
ONE_TERM = "it needs more than one sample"
Placed = tuple[int, int, AtSample]
"""The axis that a term acts on, the axis whose rate it takes, and the term."""


class Corrector:
    """Removes a model's effects from samples of three axes.

    An effect whose input a sample lacks (NaN) is left in it, and a temperature beyond those that the model was fitted on counts
    as the nearest of these. Effects that need more than one sample are left in, as by ``gc_correct``. A reading that is not a
    number gives rates that are none.

    Attributes:
        applied: ids of the effects that are removed.
        left: ids of the others, each with the reason.
    """

    def __init__(self, model: Model, bias_dps: Mapping[str, float] | None = None) -> None:
        if not any(term.values for term in model.terms):
            raise InputError(f"the model {model.name!r} has no fitted values; make one with `gyrocal explain` or `gyrocal add`")
        strange = [axis for axis in bias_dps or {} if axis not in AXES]
        if strange:
            raise InputError(f"bias_dps has the axis {strange[0]!r}; give it by x, y and z")
        self.left = {term.effect_id: why for term in model.terms if (why := _why_left(term))}
        used = [term for term in model.terms if not _why_left(term)]
        self._left_on = [
            f"{id_} on {', '.join(t.axis for t in model.terms if t.effect_id == id_ and _why_left(t))}" for id_ in self.left
        ]
        self.applied = list(dict.fromkeys(term.effect_id for term in used))
        self._accelerometer = model.accelerometer
        self._temp_c = model.fitted_on.temp_c or (-math.inf, math.inf)
        about = [axis for axis in AXES if any(t.axis == axis and t.effect.role is Role.SCALE for t in used)] or list(AXES)
        inverse = np.linalg.inv(np.eye(3) + sum((_gain(t, about) for t in used if t.effect.is_gain), np.zeros((3, 3))))
        self._inverse = tuple(map(float, inverse.ravel()))
        own = dict(bias_dps or {})
        self._constant = tuple(float(own.get(axis, 0.0)) for axis in AXES)
        self._fixed: list[Placed] = []
        self._of_rate: list[Placed] = []
        for t in used:
            term = t.effect.at_sample(t.values)
            if term is None or (t.effect.role is Role.BIAS and t.axis in own):
                continue
            of_rate = math.isnan(term(math.nan, 0.0, 1.0, (0.0, 0.0, 0.0)))  # NaN where the rate enters
            turned = AXES.index(t.axis if t.axis in about else about[0])
            (self._of_rate if of_rate else self._fixed).append((AXES.index(t.axis), turned, term))

    def __call__(
        self, reading_dps: Sequence[float], temp_c: float = UNKNOWN, power_on_s: float = UNKNOWN,
        acc_g: Sequence[float] = NO_ACCELERATION,
    ) -> Vector:  # fmt: skip
        """The true rates about x, y and z of one sample, deg/s.

        Args:
            reading_dps: the readings of the three axes, deg/s.
            temp_c: the temperature, degC.
            power_on_s: the time since power-on, s.
            acc_g: the accelerations along the three axes, g.

        Raises:
            InputError: no rate explains the readings by this model.
        """
        low, high = self._temp_c
        if temp_c < low:
            temp_c = low
        elif temp_c > high:
            temp_c = high
        error = list(self._constant)
        for axis, _, term in self._fixed:
            size = term(0.0, temp_c, power_on_s, acc_g)
            if size == size:  # not NaN
                error[axis] += size
        try:
            x, y, z = reading_dps
        except (TypeError, ValueError):
            raise InputError("reading_dps is one sample: three rates, about x, y and z; batch() takes many") from None
        x, y, z = x - error[0], y - error[1], z - error[2]
        a, b, c, d, e, f, g, h, i = self._inverse
        w = (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        if not self._of_rate:
            return w
        for _ in range(MOST_ITERATIONS):
            error[:] = 0.0, 0.0, 0.0
            for axis, about, term in self._of_rate:
                size = term(w[about], temp_c, power_on_s, acc_g)
                if size == size or w[about] != w[about]:  # an iteration that fails must not look like a missing input
                    error[axis] += size
            p, q, r = x - error[0], y - error[1], z - error[2]
            following = (a * p + b * q + c * r, d * p + e * q + f * r, g * p + h * q + i * r)
            change = abs(following[0] - w[0]) + abs(following[1] - w[1]) + abs(following[2] - w[2])
            w = following
            if change < CONVERGED_DPS:
                return w
        if math.isfinite(x + y + z):
            raise InputError(_too_large(reading_dps))
        return w

    def acceleration(self, reading_g: ArrayLike) -> Array:
        """True accelerations [3] or [n, 3], g, in the frame of the corrected rates. Raises InputError if the model has none."""
        if self._accelerometer is None:
            raise InputError(
                "the model has no accelerometer; fit one to a session by hand (`gyrocal record --hands` or `import --gravity`)"
            )
        return self._accelerometer.correct(reading_g)

    def batch(
        self, readings_dps: ArrayLike, temp_c: ArrayLike = UNKNOWN, power_on_s: ArrayLike = UNKNOWN,
        acc_g: ArrayLike = NO_ACCELERATION,
    ) -> Array:  # fmt: skip
        """The true rates [n, 3] of many samples, deg/s: the numbers of single calls.

        Args:
            readings_dps: [n, 3], deg/s.
            temp_c, power_on_s: [n] or one number, degC and s.
            acc_g: [n, 3] or [3], g.

        Raises:
            InputError: another shape, or no rate explains a reading by this model.
        """
        reading = np.asarray(readings_dps, float)
        if reading.ndim != 2 or reading.shape[1] != 3:
            raise InputError(f"readings_dps has the shape {reading.shape}; give [n, 3]: the rates about x, y and z")
        n = len(reading)
        temp, power_on = (_column(name, x, n) for name, x in (("temp_c", temp_c), ("power_on_s", power_on_s)))
        acc = _column("acc_g", acc_g, n, 3).T
        inputs = (np.clip(temp, *self._temp_c), power_on, acc)
        rest = reading - self._constant - _sum(self._fixed, np.zeros((n, 3)), inputs)
        inverse = np.reshape(self._inverse, (3, 3)).T
        rate_dps = rest @ inverse
        if not self._of_rate:
            return rate_dps
        finite = np.isfinite(rest).all(axis=1)
        with np.errstate(over="ignore", invalid="ignore"):  # of readings that no rate explains
            for _ in range(MOST_ITERATIONS):
                following = (rest - _sum(self._of_rate, rate_dps, inputs)) @ inverse
                moving = finite & ~(np.abs(following - rate_dps).sum(axis=1) < CONVERGED_DPS)
                rate_dps = following
                if not moving.any():
                    return rate_dps
        raise InputError(_too_large(reading[moving][0]))

    def __repr__(self) -> str:
        left = f"; leaves {', '.join(self._left_on)}" if self.left else ""
        return f"<Corrector: removes {', '.join(self.applied)}{left}>"


def _why_left(term: Term) -> str:
    """The reason why a term stays in the readings; empty if it is removed."""
    if not term.values:
        return f"the model has no value of it on {term.axis}"
    if term.effect.uncorrected or term.fault is not None:
        return term.effect.uncorrected or "a damaged reading cannot be undone"
    return "" if term.effect.is_gain or term.effect.at_sample(term.values) is not None else ONE_TERM


def _gain(term: Term, about: Sequence[str]) -> Array:
    """The parts [3, 3] of the true rates about x, y and z in the readings of x, y and z that a term adds."""
    unit = pl.DataFrame({"t_s": [0.0, 1.0, 2.0], **{name: np.eye(3)[i] for i, name in enumerate(RATES)}})
    turning = {AXES.index(axis): turning_about(run_of(unit, "unit rates"), axis, np.eye(3)) for axis in about}
    axis = AXES.index(term.axis)
    gain = np.zeros((3, 3))
    gain[axis] = term.effect.error_dps(turning, axis, term.values)
    return gain


def _column(name: str, values: ArrayLike, n: int, width: int = 0) -> Array:
    """The values of an argument for n samples, [n] or [n, width]."""
    shape = (n, width) if width else (n,)
    try:
        return np.broadcast_to(np.asarray(values, float), shape)
    except ValueError:
        raise InputError(f"{name} has the shape {np.shape(values)}; give {list(shape)}, as many as readings_dps") from None


def _sum(terms: Sequence[Placed], rate_dps: Array, inputs: tuple[Any, Any, Any]) -> Array:
    """The sum [n, 3] of terms at the true rates [n, 3], without those whose input is NaN."""
    total = np.zeros_like(rate_dps)
    for axis, about, term in terms:
        size = np.asarray(term(rate_dps[:, about], *inputs))
        total[:, axis] += np.where(np.isnan(size) & ~np.isnan(rate_dps[:, about]), 0.0, size)
    return total


def _too_large(reading_dps: Sequence[float] | Array) -> str:
    shown = ", ".join(f"{float(value):g}" for value in reading_dps)
    return f"the reading {shown} dps: the model's errors are too large to be undone; check the model's values"
