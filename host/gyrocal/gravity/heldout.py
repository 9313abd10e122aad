"""Prediction of held-out movements: errors of the final direction of gravity, and the errors expected from noise alone.

The observations are linear about the fit to all data, so leaving a unit out is one generalised least squares on the other rows.
Rms, floor and excess contain only the angles of movements. The log-likelihood of a unit also contains its rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gyrocal.diagnosis.residual.angles import Level
from gyrocal.gravity.fit import least_squares
from gyrocal.gravity.observations import Observations, Rows
from gyrocal.gravity.scene import Scene
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Folds:
    """The rows of each unit, and the kind of unit: ``day``, ``scenario``, ``run`` or ``time``."""

    unit: str
    rows: list[Rows]


def folds(scene: Scene, seen: Observations) -> Folds:
    """The units are days if there are two, otherwise power cycles or runs if there are enough, otherwise stretches of time."""
    runs = scene.session.runs
    of_movement = np.array([m.run for m in scene.movements])
    of_chunk = np.array([c.run for c in scene.chunks])
    blocks = POLICY.movement_blocks
    order = np.arange(len(scene.movements)) * blocks // len(scene.movements)
    rest_block = {m.after: int(b) for m, b in zip(scene.movements, order, strict=True)}
    choices = (
        ("day", [r.day for r in runs], 2), ("scenario", [r.scenario for r in runs], POLICY.fewest_units),
        ("run", [r.file for r in runs], POLICY.fewest_units),
    )  # fmt: skip
    for unit, labels, fewest in choices:
        names: list[Any] = list(dict.fromkeys(label for label in labels if label is not None))
        if len(names) >= fewest:
            number = np.array([names.index(label) if label in names else -1 for label in labels])
            return Folds(unit, _rows(seen, number[of_movement], number[of_chunk], len(names)))
    return Folds("time", _rows(seen, order, np.array([rest_block.get(c.rest, -1) for c in scene.chunks]), blocks))


def _rows(seen: Observations, movement: Rows, chunk: Rows, units: int) -> list[Rows]:
    label = np.concatenate([np.repeat(movement, 2), np.repeat(chunk, 3)])
    return [found for u in range(units) if (found := np.flatnonzero(label == u)).size and found[0] < seen.movement_rows]


@dataclass(frozen=True)
class HeldOut:
    """Predictions of every row that some unit holds out.

    ``residual`` [rows] and ``variance`` [rows] are in rad or deg/s and their squares, and NaN for rows in no unit. The standard
    error of a sum of squares over movements follows from ``fourth`` [movements]. ``likelihood`` [units] is logarithmic.
    """

    residual: Array
    variance: Array
    fourth: Array
    likelihood: Array
    movement_rows: int = field(default=0)

    def level(self, movements: Rows, floor: HeldOut | None = None) -> Level:
        """The level of some movements, with the floor of ``floor``, or of this prediction if it is None."""
        rows = np.concatenate([2 * movements, 2 * movements + 1]) if movements.size else movements
        rows = rows[np.isfinite(self.residual[rows])]
        of = floor or self
        count = rows.size // 2
        square = np.rad2deg(1.0) ** 2
        total, noise = float(np.sum(self.residual[rows] ** 2)) * square, float(np.sum(of.variance[rows])) * square
        error = float(np.sqrt(2 * np.sum(of.fourth[movements]))) * square
        n = max(count, 1)
        return Level.of(total / n, noise / n, error / n, noise / n, count)


def held_out(y: Array, x: Array, noise: Array, prior_sd: Sequence[float], cut: Folds, movement_rows: int) -> HeldOut:
    """Predict each unit from all others. ``noise`` [rows, rows] is that of the rows, ``prior_sd`` [p] of the parameters.

    The other rows tell the parameters, and by the covariance of the noise also what the unit shares with them: the offset of
    its power cycle, and the errors of the rests before and after (universal kriging).
    """
    residual, variance = np.full(len(y), np.nan), np.full(len(y), np.nan)
    fourth = np.zeros(movement_rows // 2)
    likelihood = []
    for rows in cut.rows:
        left = np.setdiff1d(np.arange(len(y)), rows)
        inner, shared = noise[np.ix_(left, left)], noise[np.ix_(left, rows)]
        theta, covariance = least_squares(y[left], x[left], inner, prior_sd)
        known = np.linalg.solve(inner, shared)
        beside = x[rows] - known.T @ x[left]
        expected = noise[np.ix_(rows, rows)] - known.T @ shared + beside @ covariance @ beside.T
        residual[rows] = y[rows] - known.T @ y[left] - beside @ theta
        variance[rows] = np.diag(expected)
        moving = rows < movement_rows
        np.add.at(fourth, rows[moving] // 2, np.sum(expected[np.ix_(moving, moving)] ** 2, axis=1))
        _, determinant = np.linalg.slogdet(expected)
        likelihood.append(-0.5 * float(residual[rows] @ np.linalg.solve(expected, residual[rows])) - 0.5 * float(determinant))
    return HeldOut(residual, variance, fourth, np.array(likelihood), movement_rows)


def share_of_range(part: float | None, whole: float | None) -> float | None:
    """``1 - (part / whole)^2`` for excesses after and before; None if there was no excess before."""
    return None if part is None or not whole else 1 - (part / whole) ** 2


def explained(before: Level, after: Level) -> float | None:
    """The fraction of the squared excess that is gone; None if the excess before is within its errors."""
    if before.excess_deg is None or before.excess_se_deg is None:
        return None
    if before.excess_deg < POLICY.excess_errors * before.excess_se_deg:
        return None
    return share_of_range(after.excess_deg, before.excess_deg)
