"""The gyroscope's model fitted to movements and rests by Gauss-Newton steps of generalised least squares.

All noise is estimated from the rests: the white levels from the readings, and the drift of the bias from the means by
restricted maximum likelihood. A misfit of the movements is therefore not mistaken for noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gyrocal.effects.base import Role, effects, with_role
from gyrocal.effects.clock_error import CLOCK_SE
from gyrocal.effects.misalignment import Misalignment
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model, Term
from gyrocal.gravity.observations import Observations, Observer, Parameter, Rows, parameters
from gyrocal.gravity.scene import Scene
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.recording.session import AXES, Array

CROSS = Misalignment.id
"""The effect that is the off-diagonal part of the matrix from true rates to readings."""
STEPS = 20
CONVERGED = 1e-2
"""A step below this part of the standard errors ends the iteration."""
LONGEST_STEP = 0.3
"""A scale changes by no more in a step: beside readings that no rates explain, full steps may go on for ever."""
SIZES_DPS = tuple(float(sd) for sd in np.geomspace(3e-4, 0.3, 13))
TAUS_S = (10.0, 30.0, 100.0, 300.0)
"""Sizes and correlation times of the drift over which the likelihood is averaged."""
TYPICAL_DPS, FACTOR = 0.003, 3.0
"""Typical drift of consumer parts, deg/s, and the factor about it that is one standard deviation of its prior."""


@dataclass(frozen=True)
class Wander:
    """The changes of one axis's bias: drift within a run, and an offset for each power cycle, deg/s."""

    drift: Drift
    turn_on_sd_dps: float = 0.0

    def kernel(self, scene: Scene) -> Array:
        """Covariance between all times of the observations (chunks, then movements), shape [times, times], (deg/s)^2."""
        at = _times(scene)
        assert self.drift.sd_dps is not None
        assert self.drift.tau_s is not None
        same_run = at.run[:, None] == at.run
        drift = self.drift.sd_dps**2 * np.exp(-np.abs(at.t_s[:, None] - at.t_s) / self.drift.tau_s) * same_run
        return np.asarray(drift + self.turn_on_sd_dps**2 * (at.cycle[:, None] == at.cycle))


class _Times(NamedTuple):
    """Number of the run, number of the power cycle and time (s) of each chunk, then of each movement, [times] each."""

    run: Array
    cycle: Array
    t_s: Array


def _times(scene: Scene) -> _Times:
    runs = np.array([c.run for c in scene.chunks] + [m.run for m in scene.movements])
    middle = [
        float(scene.session.runs[m.run].sample_s[[m.start, m.stop - 1]].mean()) for m in scene.movements
    ]
    cycle = {name: i for i, name in enumerate(scene.cycles)}
    cycles = np.array([cycle[r.scenario] for r in scene.session.runs])[runs]
    return _Times(runs, cycles, np.array([c.t_s for c in scene.chunks] + middle))


@dataclass(frozen=True)
class GravityFit:
    """A model fitted to a session by gravity.

    ``model`` holds the values with their errors, ``theta`` and ``covariance`` those of ``parameters``, and ``noise``
    [rows, rows] the covariance of all noise of ``observations``.
    """

    scene: Scene = field(repr=False)
    model: Model
    parameters: list[Parameter]
    theta: Array
    covariance: Array
    observations: Observations = field(repr=False)
    noise: Array = field(repr=False)
    wander: tuple[Wander, ...]
    left_out: tuple[str, ...] = ()
    """Ids of the model's effects that a session by gravity cannot show. They are not fitted."""

    @property
    def residual(self) -> Array:
        """``y - columns theta``, shape [rows]."""
        return np.asarray(self.observations.y - self.observations.columns @ self.theta)

    @property
    def misfit(self) -> float:
        """Square root of chi-square per degree of freedom of the movements; 1 is adequate."""
        rows = self.observations.movement_rows
        chi2, freedom = self.chi2(np.arange(rows))
        return float(np.sqrt(chi2 / freedom))

    def chi2(self, rows: Rows) -> tuple[float, float]:
        """Chi-square of some rows' residuals, and its expectation for noise alone."""
        x, residual = self.observations.columns[rows], self.residual[rows]
        noise = self.noise[np.ix_(rows, rows)]
        solved = np.linalg.solve(noise, np.column_stack([residual, x]))
        taken = float(np.trace(self.covariance @ x.T @ solved[:, 1:]))
        return float(residual @ solved[:, 0]), max(len(rows) - taken, 1.0)

    def se(self, effect_id: str, axis: str, name: str) -> float:
        """Standard error of a parameter. That of a scale includes the error of the sample clock."""
        k = next(i for i, p in enumerate(self.parameters) if p.key == (effect_id, axis, name))
        se = float(np.sqrt(self.covariance[k, k]))
        return float(np.hypot(se, CLOCK_SE)) if self.parameters[k].term.effect.role is Role.SCALE else se

    def value(self, effect_id: str, axis: str, name: str) -> float:
        """The estimate of one parameter, in the parameter's unit."""
        k = next(i for i, p in enumerate(self.parameters) if p.key == (effect_id, axis, name))
        return float(self.theta[k])


def visible(term: Term, scene: Scene) -> bool:
    """True if gravity can show an effect, because it changes readings at rest or net angles."""
    return why_invisible(term, scene) == ""


def why_invisible(term: Term, scene: Scene) -> str:
    """The reason why a session by hand cannot show an effect; empty if it can."""
    from gyrocal.effects.timing import TimingEffect

    effect = term.effect
    if effect.role is not None:
        return ""
    if isinstance(effect, TimingEffect):
        return "a delay does not change the angle between two rests, and a clock's error looks like scale"
    if effect.fast or effect.fault is not None or effect.fault_of(term.values) is not None:
        return "only the net angle between rests is known here, not the rate at each sample"
    if effect.scope != "session":
        return "it is an effect of a turntable"
    return effect.missing(scene.turning, AXES.index(term.axis)) or ""


def full(model: Model) -> Model:
    """The model with bias, scale and misalignment on every axis, which a calibration determines."""
    cross = effects()[CROSS]
    for axis in AXES:
        for kind in (with_role(Role.SCALE), with_role(Role.BIAS)):
            if model.term(kind.id, axis) is None:
                model = model.with_term(Term.of(kind, axis))
        names = [f"m_{other}" for other in AXES if other != axis]
        model = model.with_term(Term.of(cross, axis, dict.fromkeys(names, 0.0)))
    return model


def fit(scene: Scene, model: Model, observer: Observer | None = None) -> GravityFit:
    """Fit the linear parameters of the model's terms. Nonlinear ones keep the values of the model."""
    observer = observer or Observer(scene)
    left = tuple(dict.fromkeys(t.effect_id for t in model.terms if not visible(t, scene)))
    terms = [_started(t, scene) for t in model.terms if t.effect_id not in left]
    wanted = parameters(terms)
    rates: dict[int, Array] = {}
    wander: tuple[Wander, ...] = ()
    for _ in range(STEPS):
        seen = observer.observe(replace(model, terms=tuple(terms)), wanted, rates)
        rates = seen.rates_dps
        wander = wander or tuple(_wander(seen, i) for i in range(3))  # the rests' rows do not depend on the values
        noise = total_noise(seen, wander)
        theta, covariance = least_squares(seen.y, seen.columns, noise, [p.prior_sd for p in wanted])
        before = np.array([p.term.values.get(p.name, 0.0) for p in wanted])
        moved = max((abs(theta[k] - before[k]) for k, p in enumerate(wanted) if p.term.effect.role is Role.SCALE), default=0.0)
        theta = before + (theta - before) * min(1.0, LONGEST_STEP / max(moved, LONGEST_STEP))
        terms = _with_values(terms, wanted, theta, covariance)
        wanted = parameters(terms)
        if np.max(np.abs(theta - before) / np.sqrt(np.diag(covariance)), initial=0.0) < CONVERGED:
            break
    fitted = _noisy(replace(model, terms=_merged(model, terms)), scene, wander)
    fitted = replace(fitted, fitted_on=FittedOn.of(scene.session, fitted.bias_dps), accelerometer=scene.accelerometer_model)
    return GravityFit(scene, fitted, wanted, theta, covariance, seen, noise, wander, left)


def total_noise(seen: Observations, wander: Sequence[Wander]) -> Array:
    """The covariance of all noise, shape [rows, rows]."""
    noise = seen.covariance.copy()
    for i, w in enumerate(wander):
        noise += seen.bias[i] @ w.kernel(seen.scene) @ seen.bias[i].T
    return noise


def least_squares(y: Array, x: Array, noise: Array, prior_sd: Sequence[float]) -> tuple[Array, Array]:
    """Generalised least squares: estimate [p] and covariance [p, p], with a prior about zero."""
    solved = np.linalg.solve(noise, np.column_stack([x, y]))
    information = x.T @ solved[:, :-1] + np.diag(1 / np.square(prior_sd))
    covariance = np.linalg.inv(information)
    return covariance @ (x.T @ solved[:, -1]), (covariance + covariance.T) / 2


def _started(term: Term, scene: Scene) -> Term:
    """A term with start values: the bias at the median of the rests, everything else at zero."""
    i = AXES.index(term.axis)
    structure = term.values or term.effect.variants([], i)[0]
    if term.effect.role is Role.BIAS and not term.values:
        start = float(np.median([r.gyro_dps[i] for r in scene.rests]))
        return replace(term, values=dict.fromkeys(structure, start))
    return replace(term, values=dict(structure))


def _with_values(terms: Sequence[Term], wanted: Sequence[Parameter], theta: Array, covariance: Array) -> list[Term]:
    out = []
    for term in terms:
        mine = [(k, p) for k, p in enumerate(wanted) if p.key[:2] == (term.effect_id, term.axis)]
        values = {**term.values, **{p.name: float(theta[k]) for k, p in mine}}
        se = {p.name: float(np.sqrt(covariance[k, k])) for k, p in mine}
        if term.effect.role is Role.SCALE:
            se = {name: float(np.hypot(x, CLOCK_SE)) for name, x in se.items()}
        out.append(replace(term, values=values, se=se))
    return out


def _merged(model: Model, terms: Sequence[Term]) -> tuple[Term, ...]:
    fitted = {(t.effect_id, t.axis): t for t in terms}
    return tuple(fitted.get((t.effect_id, t.axis), t) for t in model.terms)


def _noisy(model: Model, scene: Scene, wander: Sequence[Wander]) -> Model:
    """The model with the noise of the rests in the components that it has."""
    noise: dict[str, AxisNoise] = {}
    one_cycle = len(scene.cycles) == 1
    for i, axis in enumerate(AXES):
        had = model.noise_on(axis)
        turn_on = TurnOnBias() if one_cycle else TurnOnBias(wander[i].turn_on_sd_dps)
        noise[axis] = replace(
            had, white_sd_dps=float(scene.white_dps[i]),
            drift=None if had.drift is None else wander[i].drift,
            turn_on_bias=None if had.turn_on_bias is None else turn_on,
        )  # fmt: skip
    return replace(model, noise=noise)


def _wander(seen: Observations, axis: int) -> Wander:
    """Drift and turn-on spread of one axis, from its rows at rest.

    The variance is the mean over sizes and correlation times, weighted by restricted likelihood and by the prior of the size.
    Its most likely value would be zero if the rests are too noisy to show the drift, and the error of the bias too small.
    """
    rows = seen.rest_rows(axis)
    y, x, base = seen.y[rows], seen.columns[rows], seen.covariance[np.ix_(rows, rows)]
    x = x[:, np.any(x != 0, axis=0)]
    several = len(seen.scene.cycles) > 1
    tried = [
        Wander(Drift(sd, tau_s), turn_on) for turn_on in ((0.0, *SIZES_DPS[2::2]) if several else (0.0,)) for tau_s in TAUS_S
        for sd in SIZES_DPS
    ]  # fmt: skip
    log_weight = np.array([
        _restricted(y, x, base + w.kernel(seen.scene)[: len(rows), : len(rows)])
        - (np.log((w.drift.sd_dps or 0.0) / TYPICAL_DPS) / np.log(FACTOR)) ** 2 / 2
        for w in tried
    ])  # fmt: skip
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    power = weight * np.array([(w.drift.sd_dps or 0.0) ** 2 for w in tried])
    tau_s = np.exp(float(power @ np.log([w.drift.tau_s or 1.0 for w in tried])) / power.sum())
    turn_on = float(np.sqrt(weight @ np.array([w.turn_on_sd_dps**2 for w in tried])))
    return Wander(Drift(float(np.sqrt(power.sum())), float(tau_s)), turn_on)


def _restricted(y: Array, x: Array, noise: Array) -> float:
    """Restricted log-likelihood up to a constant."""
    lower = np.linalg.cholesky(noise)
    white = np.linalg.solve(lower, np.column_stack([x, y]))
    q, r = np.linalg.qr(white[:, :-1])
    left = white[:, -1] - q @ (q.T @ white[:, -1])
    sizes = np.abs(np.diag(r))
    determinant = float(np.sum(np.log(sizes[sizes > 1e-12 * max(float(sizes.max(initial=0.0)), 1e-300)])))
    return float(-np.sum(np.log(np.diag(lower))) - determinant - left @ left / 2)
