"""Movements and rests as linear observations of the gyroscope's parameters, with the covariance of their noise.

A movement gives two rows. With R the integrated rotation, ``R·up(after)`` must be ``up(before)``, and the two components of the
difference across ``up(before)`` are observed. An error ``dw(t)`` of the rate turns ``R·up(after)`` by ``J = integral R dw dt``,
so the derivative by a parameter with the regressor x on axis i follows from ``dw = -M^-1 e_i x``. Rotation about gravity leaves
no row. A rest gives a row for each axis, the mean reading, which contains only the bias and effects that act at rest.

The noise of the rows comes from the mean accelerations (which neighbouring movements share), the accelerometer's calibration,
the gyroscope integrated over the movement and averaged over the rest, Earth's rotation, and the drift of the bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gyrocal.effects.base import Mask
from gyrocal.error_model.correction import turning_about
from gyrocal.error_model.model import Model, Term
from gyrocal.gravity.rotation import cross_matrix, cumulative, steps, tangents
from gyrocal.gravity.scene import LEAST_NOISE_DPS, Scene
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run

Rows = np.ndarray[Any, np.dtype[np.intp]]
EARTH_DPS = 0.0041781
CONVERGED_DPS, MOST_ITERATIONS = 1e-6, 20
FLAT = 1.5
"""Prior standard deviation over the largest physical size of a parameter. The prior is practically flat for parameters that
movements determine, and limits those that they do not determine (for a scale it is 0.3)."""


@dataclass(frozen=True)
class Parameter:
    """One linear parameter of one term."""

    term: Term
    name: str
    prior_sd: float

    @property
    def axis(self) -> int:
        """Number of the axis, 0 to 2."""
        return AXES.index(self.term.axis)

    @property
    def key(self) -> tuple[str, str, str]:
        """Effect, axis and name, which identify a parameter."""
        return self.term.effect_id, self.term.axis, self.name


def parameters(terms: Sequence[Term]) -> list[Parameter]:
    """The linear parameters of terms, in order."""
    out = []
    for term in terms:
        sizes = {p.name: p.typical[1] for p in term.effect.parameters}
        structure = term.effect.structure(term.values) or term.effect.variants([], AXES.index(term.axis))[0]
        used = term.effect.coding.used(structure)
        out += [Parameter(term, name, FLAT * POLICY.range_factor * sizes.get(name, 1.0)) for name in used]
    return out


@dataclass(frozen=True)
class Observations:
    """Rows ``y = columns·theta + noise``: two for each movement (rad), then three for each chunk of a rest (deg/s).

    ``covariance`` [rows, rows] is that of the noise without drift of the bias; ``bias`` [3, rows, times] is the response of the
    rows to the drift of an axis at ``times`` (run, scenario, s). ``turned`` [movements, 3] is the integral of the rate, rad.
    """

    scene: Scene = field(repr=False)
    y: Array
    residual_rad: Array
    columns: Array
    covariance: Array
    gyro_covariance: Array
    """The part of ``covariance`` from the gyroscope's white noise in the movements."""
    bias: Array
    rates_dps: dict[int, Array] = field(repr=False)
    turned: Array
    ends: Array
    """The rotation of each movement, [movements, 3, 3], that takes its end to its start."""

    @property
    def movement_rows(self) -> int:
        """Number of the rows of movements, which come first."""
        return 2 * len(self.scene.movements)

    def rest_rows(self, axis: int) -> Rows:
        """Indices of an axis's rows at rest."""
        return self.movement_rows + 3 * np.arange(len(self.scene.chunks)) + axis

    @property
    def movement_of_row(self) -> Rows:
        """Number of the movement of each row of movements, shape [movement_rows]."""
        return np.repeat(np.arange(len(self.scene.movements)), 2)


class Observer:
    """Observations of a scene at given values of a model's terms. Parts that do not depend on the values are computed once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.across = tangents(scene.up)
        self.at_rest = [self._mask(i) for i in range(len(scene.session.runs))]

    def _mask(self, run: int) -> Mask:
        mask = np.zeros(len(self.scene.session.runs[run]), dtype=bool)
        for r in self.scene.rests:
            if r.run == run:
                mask[r.start : r.stop] = True
        return mask

    def turning(self, run: int, rate_dps: Array) -> dict[int, Run]:
        """A run turning about each of its axes at the rates [n, 3], which are zero where it is at rest."""
        true_dps = np.where(self.at_rest[run][:, None], 0.0, rate_dps)
        return {i: turning_about(self.scene.session.runs[run], axis, true_dps) for i, axis in enumerate(AXES)}

    def rates(self, model: Model, start: dict[int, Array]) -> dict[int, Array]:
        """The true rates [n, 3] of each run, deg/s, for which the model gives the readings, by Newton steps from ``start``."""
        out = {}
        inverse = np.linalg.inv(_response(model, self.scene.session.runs[0].part(0, 2)))
        terms = [t for t in model.terms if t.values]
        for number, run in enumerate(self.scene.session.runs):
            rate_dps = start.get(number, run.gyro_dps)
            for _ in range(MOST_ITERATIONS):
                turning = self.turning(number, rate_dps)
                left = run.gyro_dps - rate_dps
                for t in terms:
                    i = AXES.index(t.axis)
                    left[:, i] -= t.effect.error_dps(turning, i, t.values)
                step = left @ inverse.T
                change = float(np.max(np.abs(step)[~self.at_rest[number]], initial=0.0))
                rate_dps = rate_dps + step
                if not CONVERGED_DPS < change < 1e6:
                    break
            out[number] = rate_dps
        return out

    def column(self, parameter: Parameter, turning: dict[int, Run]) -> Array:
        """The regressor of a parameter in one run, shape [n], deg/s for each unit."""
        effect, i = parameter.term.effect, parameter.axis
        values = {**effect.structure(parameter.term.values or dict.fromkeys(effect.linear, 0.0)), parameter.name: 1.0}
        return np.asarray(effect.error_dps(turning, i, values))

    def observe(self, model: Model, wanted: Sequence[Parameter], start: dict[int, Array] | None = None) -> Observations:
        """The observations at the model's values, with a column for each of the ``wanted`` parameters."""
        scene = self.scene
        rates = self.rates(model, start or {})
        inverse = np.linalg.inv(_response(model, scene.session.runs[0].part(0, 2)))
        turning = {n: self.turning(n, rates[n]) for n in rates}
        regressors = {n: np.column_stack([self.column(p, turning[n]) for p in wanted]) for n in rates}
        cut = [(m, slice(m.start, m.stop)) for m in scene.movements]
        rotations = cumulative(
            [steps(np.deg2rad(rates[m.run][s]), scene.session.runs[m.run].sample_s[s]) for m, s in cut]
        )
        movements, chunks, p = len(scene.movements), len(scene.chunks), len(wanted)
        rows, times = 2 * movements + 3 * chunks, chunks + movements
        y, residual = np.zeros(rows), np.zeros(2 * movements)
        columns, bias = np.zeros((rows, p)), np.zeros((3, rows, times))
        by_mean = np.zeros((2 * movements, 3 * len(scene.rests)))
        by_accelerometer = np.zeros((2 * movements, 9))
        noise, gyro_noise = np.zeros((rows, rows)), np.zeros((rows, rows))
        turned = np.zeros((movements, 3))
        axis_of = [w.axis for w in wanted]
        theta = np.array([w.term.values.get(w.name, 0.0) for w in wanted])
        for k, ((m, s), rotation) in enumerate(zip(cut, rotations, strict=True)):
            two = slice(2 * k, 2 * k + 2)
            across, back = self.across[m.before], rotation[-1] @ scene.up[m.after]
            residual[two] = across @ (back - scene.up[m.before])
            h = _weights(scene.session.runs[m.run].sample_s[s])
            unmixed = rotation @ inverse  # [n, 3, 3]
            integral = -np.einsum("n,nip,np->ip", np.deg2rad(h), unmixed[:, :, axis_of], regressors[m.run][s])
            by_rate = -across @ cross_matrix(back)  # what an integrated rotation does to the rows
            columns[two] = by_rate @ integral
            y[two] = columns[two] @ theta - residual[two]
            turned[k] = np.einsum("n,nij,nj->i", np.deg2rad(h), rotation, rates[m.run][s])
            bias[:, two, chunks + k] = -np.einsum("ai,n,nij->ja", by_rate, np.deg2rad(h), unmixed)
            white = np.einsum("n,nij,j,nkj->ik", np.deg2rad(h) ** 2, unmixed, scene.white_dps**2, unmixed)
            gyro_noise[two, two] = by_rate @ white @ by_rate.T
            earth_rad = np.deg2rad(EARTH_DPS) * float(np.sum(h))
            noise[two, two] += np.eye(2) * earth_rad**2 / 3
            for rest, turn, sign in ((m.after, rotation[-1], 1.0), (m.before, np.eye(3), -1.0)):
                level: Array = np.eye(3) - np.outer(scene.up[rest], scene.up[rest])
                direct: Array = sign * across @ turn @ level
                by_mean[two, 3 * rest : 3 * rest + 3] += direct @ scene.accelerometer.inverse
                by_accelerometer[two] += direct @ scene.accelerometer.slopes(scene.rests[rest].acc_g)
        self._rests(regressors, axis_of, y, columns, noise, bias)
        first = slice(0, 2 * movements)
        by_mean += by_accelerometer @ scene.accelerometer.gain
        noise[first, first] += (by_mean * np.repeat(scene.accelerometer.noise_g**2, 3)) @ by_mean.T
        noise[first, first] += by_accelerometer @ scene.accelerometer.prior_cov @ by_accelerometer.T
        ends = np.array([r[-1] for r in rotations])
        return Observations(scene, y, residual, columns, noise + gyro_noise, gyro_noise, bias, rates, turned, ends)

    def _rests(
        self, regressors: dict[int, Array], axis_of: list[int], y: Array, columns: Array, noise: Array, bias: Array
    ) -> None:
        """Fill the rows of the rests."""
        scene = self.scene
        vertical = np.zeros(len(y))
        latitude_deg = scene.session.latitude_deg
        up_dps = 0.0 if latitude_deg is None else EARTH_DPS * np.sin(np.deg2rad(latitude_deg))
        for j, c in enumerate(scene.chunks):
            means = scene.session.runs[c.run].gyro_dps[c.start : c.stop].mean(axis=0)
            x = regressors[c.run][c.start : c.stop].mean(axis=0)
            for i in range(3):
                row = 2 * len(scene.movements) + 3 * j + i
                y[row] = means[i] - up_dps * scene.up[c.rest, i]
                columns[row] = np.where(np.array(axis_of) == i, x, 0.0)
                of_rest = scene.noise.of_means[c.rest, i] ** 2 * scene.rests[c.rest].rows
                noise[row, row] = of_rest / c.rows + LEAST_NOISE_DPS**2 + EARTH_DPS**2 / 3
                bias[i, row, j] = 1.0
                vertical[row] = scene.up[c.rest, i]
        if latitude_deg is None:  # Earth's vertical rate is the same in every pose, and unknown
            noise += np.outer(vertical, vertical) * EARTH_DPS**2 / 2


def _response(model: Model, run: Run) -> Array:
    """The derivative of the readings by the true rate, shape [3, 3], with scale and misalignment."""

    def error_dps(rate_dps: Array) -> Array:
        turning = {i: turning_about(run, axis, np.tile(rate_dps, (len(run), 1))) for i, axis in enumerate(AXES)}
        out = np.zeros(3)
        for t in model.terms:
            if t.values:
                out[AXES.index(t.axis)] += t.effect.error_dps(turning, AXES.index(t.axis), t.values)[0]
        return out

    still = error_dps(np.zeros(3))
    return np.eye(3) + np.column_stack([error_dps(unit) - still for unit in np.eye(3)])


def _weights(t_s: Array) -> Array:
    """Weights [n], s, of an integral over samples by trapezia."""
    h = np.diff(t_s)
    out = np.zeros(t_s.size)
    out[:-1] += h / 2
    out[1:] += h / 2
    return out
