"""Angles, by which a session is judged if an angle is known instead of the rate at each moment.

A run with ``turn_deg`` has only a net angle, the integral of its rate. In a session with such a run, every run counts by its
net angle on each axis, so that rests and turns add up in one unit. Where an angle is measured (``ref_angle_deg``), the
integrated readings are held against it at each sample, since the slope of an encoder's angle is far noisier than the angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import polars as pl

from gyrocal import tails
from gyrocal.diagnosis.residual.levels import excess_of
from gyrocal.effects.base import Role
from gyrocal.effects.quantities import grid_dps
from gyrocal.inference import heldout
from gyrocal.inference.excess_error import angles_of_samples, end_noise_deg, net_angles, of_skewed
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.heldout import Fold, Prediction
from gyrocal.inference.reml import Equations, Spreads
from gyrocal.recording.measured_rates import ANGLE
from gyrocal.recording.session import AXES, Array, Run, Session

FREE = {Role.BIAS: 1e3, Role.SCALE: 1.0}
"""Spreads over power cycles, deg/s and a ratio, at which each has its own bias and scale. With larger ones, the information
about what the cycles share is lost in rounding."""


@dataclass(frozen=True)
class Level:
    """rms of held-out angles, noise floor and excess, deg; rms and excess are None if nothing can be held out."""

    rms_deg: float | None
    floor_deg: float | None
    excess_deg: float | None = None
    excess_se_deg: float | None = None

    @staticmethod
    def of(squares: float, floor: float, error: float, noise: float, count: int) -> Level:
        """The level from mean squares of angles, their expectation with standard error, and the noise of an angle, deg^2."""
        if not count:
            return Level(None, None)
        excess, se = excess_of(squares - floor, error, noise / count)
        return Level(float(np.sqrt(squares)), float(np.sqrt(floor)), excess, se)

    def to_json(self) -> dict[str, Any]:
        return {
            "rms_deg": self.rms_deg, "floor_deg": self.floor_deg, "excess_deg": self.excess_deg,
            "excess_se_deg": self.excess_se_deg,
        }  # fmt: skip


def by_angle(session: Session) -> bool:
    """True if the session has a run of which only the net angle is known, or one whose angle is measured."""
    return any(run.rate_is_mean or _measured(run) for run in session.runs)


def _measured(run: Run) -> bool:
    """True if the angle about the run's axis is measured at each sample."""
    return run.measured_rates is not None and run.measured_rates.left_deg is not None


@dataclass(frozen=True)
class Angles:
    """Angles held out where that is possible, and the covariance of their noise by axis, deg^2.

    They are the net angles of all runs, or the angles of all samples where an angle is measured. The squares of the diagonal of
    ``noise`` [k, k] are summed over the rows of an axis.
    """

    table: pl.DataFrame = field(repr=False)
    """Columns file, t_s (of a net angle: the end of the run), axis, measured_deg and modelled_deg."""
    held_out: bool
    noise: dict[str, Array] = field(repr=False)
    of_samples: bool = False
    """True for a row a sample, False for a row a run."""
    freedom: dict[str, int] = field(default_factory=dict, repr=False)
    """Net angles of each axis less the fitted coefficients: the noise of net angles is estimated from as few of them."""
    within: dict[str, WithinCycles] = field(default_factory=dict, repr=False)
    """What net angles leave within power cycles, by axis."""

    @staticmethod
    def of(fitted: Fit, folds: Sequence[Fold], of_model: Mapping[str, Array] | None = None) -> Angles:
        """The angles that a model leaves of held-out runs, in sample without ``folds``.

        ``of_model`` holds the covariances [p, p] of parameters that come from another session, by axis.
        """
        errors = of_model or {}
        net = any(run.rate_is_mean for run in fitted.session.runs)
        held = heldout.predictions(fitted, list(folds), net=net) if folds else heldout.fitted(fitted, net=net)
        if net:
            table = pl.DataFrame([_net_angle(p) for p in held])
            noise = {name: net_angles(axis, folds, errors.get(name)) for name, axis in fitted.axes.items()}
            freedom = {a: max(1, len(f.design.blocks) - len(f.design.layout.fixed)) for a, f in fitted.axes.items()}
            within = {a: WithinCycles.of(f) for a, f in fitted.axes.items()}
            return Angles(table, bool(folds), noise, freedom=freedom, within=within)
        table = pl.concat([_of_samples(p) for p in held])
        noise = {}
        for name, axis in fitted.axes.items():
            of_gyroscope = angles_of_samples(axis, folds, errors.get(name))
            samples = table.filter(pl.col("axis") == name).height
            # the noise of the ends of blocks is in it already, half of it at the middle of a cell
            power = max(measured_angle_noise_deg(fitted.session, name) ** 2 - end_noise_deg(axis) ** 2 / 2, 0.0)
            noise[name] = of_gyroscope + samples / max(len(of_gyroscope), 1) * power * np.eye(len(of_gyroscope))
        return Angles(table, bool(folds), noise, of_samples=True)

    def on(self, axis: str) -> Angles:
        """The angles about one axis alone."""
        return replace(self, table=self.table.filter(pl.col("axis") == axis), noise={axis: self.noise[axis]})

    def level(self, *axes: str) -> Level:
        """The level of these axes together; all axes if none is given."""
        names = axes or tuple(self.noise)
        mine = self.table.filter(pl.col("axis").is_in(names))
        count = mine.height if self.held_out else 0
        n = max(mine.height, 1)
        power = sum(float(np.trace(self.noise[a])) for a in names) / n
        if not count:
            return Level(None, float(np.sqrt(power)))
        freedom = [self.freedom.get(a, np.inf) for a in names]
        error = _error([self.noise[a] for a in names], freedom) / n
        squares = float(((mine["measured_deg"] - mine["modelled_deg"]) ** 2).sum()) / n
        return Level.of(squares, power, error, power / n, count)


def _error(noise: Sequence[Array], freedom: Sequence[float]) -> float:
    """The standard error of a sum of squares with these covariances [k, k], each estimated from so many squares."""
    variance = 2 * sum(float(np.sum(of**2)) for of in noise)
    estimated = 2 * sum(float(np.trace(of)) ** 2 / count for of, count in zip(noise, freedom, strict=True))
    third = 8 * sum(float(np.sum(of @ of * of.T)) for of in noise)
    return float(np.sqrt(variance + estimated)) * of_skewed(variance, third)


@dataclass(frozen=True)
class WithinCycles:
    """What the net angles of an axis leave in sample if each power cycle has a bias and a scale of its own.

    ``ratio`` is the mean square of what is left over that of noise, and ``chance`` the probability that noise leaves as much. A
    spread of the bias over a few power cycles is hardly known, and hides what a single turn has in excess.
    """

    ratio: float
    chance: float

    @staticmethod
    def of(axis: AxisFit) -> WithinCycles:
        """The chi-square of one axis at its fitted noise; a ratio of 1 if no freedom is left."""
        layout, n = axis.design.layout, int(axis.design.n_blocks.sum())
        equations = Equations(layout, axis.grams, axis.logdet, axis.design.scenarios, n)
        roles = [axis.design.terms[layout.fixed[j][0]].effect.role for j in layout.scenario]
        apart = Spreads(axis.spreads.run, np.array([FREE[role] for role in roles if role is not None]))
        freedom = n - len(layout.fixed) - (axis.design.cycles - 1) * len(layout.scenario)
        if freedom < 1:
            return WithinCycles(1.0, 1.0)
        left = equations.solve(apart).chi2
        return WithinCycles(left / freedom, float(tails.chi_square(left, freedom)))


def _of_samples(p: Prediction) -> pl.DataFrame:
    """The angle at each sample with a reference: integrated from the readings, and as the model has it of the measured angle.

    The start of the integration is free: the mean of both is the same.
    """
    run, rows = p.run, p.rows
    t_s = run.sample_s[rows]
    measured, modelled = (_integrated(rate, t_s) for rate in (p.measured_dps, p.modelled_dps))
    if run.axis_index == p.axis and run.measured_rates is not None and run.measured_rates.left_deg is not None:
        modelled += np.nan_to_num(run.measured_rates.left_deg[rows])
    seen = run.reached[rows]
    measured, modelled = measured[seen], modelled[seen]
    shift = float(np.mean(measured - modelled)) if measured.size else 0.0
    return pl.DataFrame({
        "file": pl.repeat(run.file, measured.size, eager=True), "t_s": run.t_s[rows][seen],
        "axis": pl.repeat(AXES[p.axis], measured.size, eager=True), "measured_deg": measured - shift, "modelled_deg": modelled,
    })  # fmt: skip


def _integrated(rate_dps: Array, t_s: Array) -> Array:
    """The integral [n] of a rate [n] by trapezia from the first sample on, deg."""
    return np.concatenate([[0.0], np.cumsum((rate_dps[1:] + rate_dps[:-1]) / 2 * np.diff(t_s))])


def measured_angle_noise_deg(session: Session, axis: str) -> float:
    """The noise of a measured angle about an axis, rms, deg: at least that of its steps; 0 where none is measured."""
    powers = []
    for run in session.runs:
        if run.axis != axis or run.measured_rates is None or run.measured_rates.left_deg is None:
            continue
        angle = run.column(ANGLE)
        assert angle is not None
        left_deg = run.measured_rates.left_deg
        step_deg = grid_dps([angle[np.isfinite(angle)]])
        step_deg = step_deg if np.isfinite(step_deg) else 0.0
        powers.append(max(float(np.nanmean(left_deg**2)), step_deg**2 / 12))
    return float(np.sqrt(np.mean(powers))) if powers else 0.0


def _net_angle(p: Prediction) -> dict[str, str | float]:
    weights = p.run.weights[p.rows] * p.run.duration_s / len(p.run)
    return {
        "file": p.run.file, "t_s": float(p.run.t_s[p.rows][-1]), "axis": AXES[p.axis],
        "measured_deg": float(weights @ p.measured_dps), "modelled_deg": float(weights @ p.modelled_dps),
    }  # fmt: skip
