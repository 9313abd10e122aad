"""Scale and bias of one calibration by the model: the host's twin of ``gc_estimator``.

It uses the blocks of 0.25 s, the noise and the priors of the device (docs/details/device.md). A model that was fitted to a
campaign becomes a :class:`Calibration`, which holds Gaussian priors and effect columns. From it and a few seconds of two runs
follow scale and bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gyrocal.effects.base import Effect, Role, Values
from gyrocal.effects.reading_fault import Fault
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.noise.sample import weight_beside
from gyrocal.noise.whitening import Noise, normal_equations
from gyrocal.recording.session import AXES, Array, Run

BLOCK_US = 250_000
MAX_COLUMNS = 8
"""Largest number of effect columns on the device."""
MOST_ALTERNATIVES = 8
MOST_HYPOTHESES = 4096
"""Largest number of combinations of the runs' alternatives. Above it, the least likely alternatives of each run are dropped."""
TIGHTEST = 1e-6
"""Smallest prior standard deviation, as a fraction of the typical size. A spread of zero in a fit does not prove a constant."""


@dataclass(frozen=True)
class Column:
    """One effect column: its number within the effect, and its prior (flat if the sd is infinite)."""

    effect: Effect
    values: Values = field(repr=False)
    index: int
    mean: float
    sd: float


@dataclass(frozen=True)
class Calibration:
    """The priors of a device. The parameters are in the order [run columns, shared columns, bias, scale].

    The last ``alternatives`` run columns exclude each other: exactly one of them acts in a run, each with the same prior
    probability. They represent a nonlinear parameter that differs from run to run (a time constant) by a few values.
    """

    name: str
    axis: str
    run_columns: tuple[Column, ...]
    shared_columns: tuple[Column, ...]
    bias_dps: tuple[float, float]
    scale: tuple[float, float]
    """(mean, sd) of the priors, flat if the sd is infinite."""
    noise: Noise
    alternatives: int = 0
    faults: tuple[tuple[Fault, Values], ...] = ()
    """Faults of the reading. Blocks with these faults are not used."""
    fitted_on: FittedOn = field(default_factory=FittedOn)
    """What the priors were fitted on. Columns see temperatures beyond its range as the nearest end of the range."""

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of a run, then those that the runs share."""
        return self.run_columns + self.shared_columns

    @property
    def prior_mean(self) -> Array:
        """Prior means [columns + 2] in the order of the parameters, with the bias (dps) and the scale last."""
        return np.array([*(c.mean for c in self.columns), self.bias_dps[0], self.scale[0]])

    @property
    def prior_information(self) -> Array:
        """Reciprocal of the prior standard deviation of each parameter, shape [columns + 2]; 0 if the prior is flat."""
        sd = np.array([*(c.sd for c in self.columns), self.bias_dps[1], self.scale[1]])
        return np.where(np.isfinite(sd), 1.0 / np.maximum(sd, 1e-300), 0.0)


@dataclass(frozen=True)
class Answer:
    """Scale (fraction) and bias (deg/s) with standard errors; ``misfit`` is the root of chi-square per degree of freedom."""

    scale: float
    scale_se: float
    bias_dps: float
    bias_se_dps: float
    misfit: float | None


def calibration_of(
    model: Model, axis: str, white_sd_dps: float | None = None, *, alternatives: int | None = None
) -> Calibration:  # fmt: skip
    """The priors that a fitted model gives for its axis.

    The prior's variance is the sum of the effect's variance over the campaign and of the squared standard errors of its mean
    and spread. Scale and bias have flat priors if the model was not fitted, or on too few power cycles to know their spread.
    A nonlinear parameter that differs from run to run is represented by ``alternatives`` values, by default as many as the
    device can hold.
    """
    run_columns: list[Column] = []
    shared_columns: list[Column] = []
    spread_terms: list[tuple[Term, Column]] = []
    faults: list[tuple[Fault, Values]] = []
    for term in model.on(axis):
        kind = term.effect
        if term.fault is not None:
            faults += [(term.fault, term.values)] if term.values else []
            continue
        if kind.role is not None:
            continue
        if not all(name in term.values for name in kind.nonlinear) or not kind.coding.used(term.values):
            raise InputError(f"model {model.name}: {kind.id} on {axis} has no values; fit it with `gyrocal add`")
        mean = (
            kind.coding.coefficients(term.values)
            if kind.scope == "session" or kind.common_mean
            else np.zeros(kind.coding.spread(term.values).size)
        )
        if isinstance(kind, TimingEffect):  # its column is a derivative about its value
            mean = np.zeros(mean.size)
        spread = kind.coding.spread(term.values)
        se = (
            kind.coding.spread({n: term.se.get(n, 0.0) for n in term.values})
            if kind.scope == "run" and not kind.common_mean
            else _se(kind, term.values, term.se)
        )
        ranges = {n: kind.parameter(n).typical[1] for n in kind.coding.used(term.values)}
        typical = [size if np.isfinite(size) else abs(term.values[n]) for n, size in ranges.items()]  # a formula's has none
        smallest = TIGHTEST * np.repeat(typical, mean.size // len(typical))
        sd = np.sqrt(spread**2 + se**2 + smallest**2)
        columns = [Column(kind, term.values, j, float(mean[j]), float(sd[j])) for j in range(mean.size)]
        if spread_parameter(term) is not None and not spread_terms:  # one effect's alternatives at most
            spread_terms.append((term, columns[0]))
            continue
        (run_columns if kind.scope == "run" else shared_columns).extend(columns)
    each: list[Column] = []
    for term, column in spread_terms:
        count = alternatives or max(2, min(MOST_ALTERNATIVES, MAX_COLUMNS - len(run_columns) - len(shared_columns)))
        each = [replace(column, values=v) for v in alternative_values(term, count)]
    noise_model = model.noise_on(axis)
    white = white_sd_dps if noise_model.white_sd_dps is None else noise_model.white_sd_dps
    if white is None or white <= 0:
        raise InputError(f"model {model.name}: no white noise level for {axis}; fit it with `gyrocal add` or give white_sd_dps")
    drift = noise_model.drift or Drift()
    noise = Noise(white, drift.sd_dps or 0.0, drift.tau_s or 30.0)
    return Calibration(
        model.name, axis, (*run_columns, *each), tuple(shared_columns), _prior_of_bias(model, axis),
        _prior_of_scale(model, axis), noise,
        len(each), tuple(faults), model.fitted_on,
    )  # fmt: skip


def spread_parameter(term: Term) -> str | None:
    """The parameter that differs from run to run, if the model contains its spread (``NAME_sd``)."""
    name = term.spreadable
    return name if name is not None and term.values.get(f"{name}_sd", 0.0) > 0 else None


def alternative_values(term: Term, count: int) -> list[Values]:
    """``count`` values of the spread parameter, equally likely: evenly in its logarithm over mean +- sqrt(3) sd."""
    name = spread_parameter(term)
    assert name is not None
    middle, sd = term.values[name], term.values[f"{name}_sd"]
    steps = np.sqrt(3.0) * sd / middle * (2 * (np.arange(count) + 0.5) / count - 1)
    return [{**term.values, name: float(middle * np.exp(step))} for step in steps]


def _se(kind: Effect, values: Values, se: Values) -> Array:
    return np.array([np.hypot(se.get(n, 0.0), se.get(f"{n}_sd", 0.0)) for n in kind.coding.used(values)])


def _prior_of_bias(model: Model, axis: str) -> tuple[float, float]:
    """Mean and sd of the bias, deg/s, from its spread over power cycles and both standard errors; flat without a spread."""
    turn_on = model.noise_on(axis).turn_on_bias or TurnOnBias()
    return _prior(model, axis, Role.BIAS, turn_on.sd_dps, turn_on.se.get("sd_dps"))


def _prior_of_scale(model: Model, axis: str) -> tuple[float, float]:
    """Mean and sd of the scale, a fraction, in the same way."""
    turn_on = model.noise_on(axis).turn_on_scale
    return (0.0, np.inf) if turn_on is None else _prior(model, axis, Role.SCALE, turn_on.sd, turn_on.se)


def _prior(model: Model, axis: str, role: Role, spread: float | None, spread_se: float | None) -> tuple[float, float]:
    term = next((t for t in model.on(axis) if t.effect.role is role), None)
    name = "" if term is None else term.effect.linear[0]
    if term is None or name not in term.values or spread is None:
        return 0.0, np.inf
    boards = f"{name}_sd"  # the spread over a population exceeds that over the power cycles of one board
    parts = [spread, spread_se or 0.0, term.se.get(name, 0.0), term.values.get(boards, 0.0), term.se.get(boards, 0.0)]
    return term.values[name], float(np.sqrt(np.sum(np.square(parts))) + TIGHTEST)


class RunBlocks(NamedTuple):
    """Block means [q, m] of the columns [run, shared, bias, scale, y - w]; start times [m], s, and numbers of samples [m]."""

    means: Array
    start_s: Array
    samples: Array


def run_blocks(run: Run, calibration: Calibration) -> RunBlocks:
    """The blocks of a run on the calibration's axis. Blocks with fewer than half of their samples are left out."""
    axis = AXES.index(calibration.axis)
    for c in calibration.columns:
        run = run.timed(c.effect.set(run.timing, c.values)) if isinstance(c.effect, TimingEffect) else run
    rate_dps = run.rate_dps if run.axis_index == axis else np.zeros(len(run))
    as_measured = calibration.fitted_on.clamped(run.as_measured())
    columns = np.column_stack([
        *(c.effect.columns(as_measured, axis, c.values)[:, c.index] for c in calibration.columns),
        np.ones(len(run)), rate_dps, run.gyro_dps[:, axis] - rate_dps,
    ])  # fmt: skip
    label = np.zeros(len(run), dtype=np.int64) if run.rate_is_mean else run.t_us // BLOCK_US
    blocks, first, count = np.unique(label, return_index=True, return_counts=True)
    means = np.add.reduceat(columns, first, axis=0) / count[:, None]
    full = np.asarray(run.rate_is_mean | (2e6 * count >= run.sample_rate_hz * BLOCK_US))
    full = full & np.logical_and.reduceat(run.reached, first)
    for kind, values in calibration.faults:
        usable = kind.usable(run, axis, values)
        full = full if usable is None else full & np.logical_and.reduceat(usable, first)
    samples = count[full].astype(float)
    if run.rate_is_mean and run.axis_index == axis and run.turn_se_deg:
        samples *= weight_beside(samples, calibration.noise.white_sd_dps, run.turn_se_deg / run.duration_s)
    return RunBlocks(means[full].T, blocks[full] * BLOCK_US * 1e-6, samples)


@dataclass(frozen=True)
class Posterior:
    """Answers of many calibrations, arrays [n]; NaN where the runs do not determine both scale and bias.

    ``log_evidence`` is the log-likelihood of the data up to a constant that depends on the noise and the flat priors.
    """

    scale: Array
    scale_se: Array
    bias_dps: Array
    bias_se_dps: Array
    chi2: Array
    log_evidence: Array


def _hypotheses(calibration: Calibration, gram: Array) -> tuple[Array, Array]:
    """The normal equations of [shared, bias, scale, y - w] from one run under each of its alternatives.

    ``gram`` [n, q, q] is that of :func:`run_equations`. Returns equations [n, K, r, r] and the log-determinant [n, K] from the
    integration over the run's own coefficients.
    """
    k, a = len(calibration.run_columns), calibration.alternatives
    plain = k - a
    information, mean = calibration.prior_information, calibration.prior_mean
    gram = gram.copy()
    for i in range(k):
        square = information[i] ** 2
        gram[:, i, i] += square
        gram[:, i, -1] += square * mean[i]
        gram[:, -1, i] += square * mean[i]
    own_y2 = information[:k] ** 2 * mean[:k] ** 2
    logdet = np.zeros(len(gram))
    if plain:
        norm = np.sqrt(np.maximum(np.einsum("nii->ni", gram[:, :plain, :plain]), 0.0))
        norm = np.where(norm > 0, norm, 1.0)
        inner = gram[:, :plain, :plain] / (norm[:, :, None] * norm[:, None, :])
        inner += np.eye(plain) * (np.einsum("nii->ni", inner) == 0)[:, :, None]
        cross = gram[:, :plain, plain:] / norm[:, :, None]
        logdet = np.linalg.slogdet(inner)[1] + 2 * np.log(norm).sum(1) - 2 * _log_positive(information[:plain]).sum()
        gram = gram[:, plain:, plain:] - cross.swapaxes(1, 2) @ np.linalg.solve(inner, cross)
    gram[:, -1, -1] += own_y2[:plain].sum()
    if not a:
        return gram[:, None], logdet[:, None]
    pivot = np.einsum("nii->ni", gram[:, :a, :a])
    cross, rest = gram[:, :a, a:], gram[:, a:, a:]
    equations = rest[:, None] - cross[..., :, None] * cross[..., None, :] / pivot[..., None, None]
    equations[..., -1, -1] += own_y2[plain:]
    return equations, logdet[:, None] + np.log(pivot) - 2 * np.log(information[plain:k])


def _log_positive(x: Array) -> Array:
    return np.log(x[x > 0])


def posterior(calibration: Calibration, grams: Sequence[Array]) -> Posterior:
    """The exact posterior of scale and bias, from the equations [n, q, q] of each run that shares them.

    Linear terms are integrated out in closed form. Combinations of the runs' alternatives are weighted by their evidence.
    """
    s = len(calibration.shared_columns)
    n = s + 2
    k = len(calibration.run_columns)
    runs = [_hypotheses(calibration, g) for g in grams]
    most = max(1, int(MOST_HYPOTHESES ** (1 / len(runs)) + 1e-9))
    root = calibration.prior_information[k:, None] * np.column_stack([np.eye(n), calibration.prior_mean[k:]])
    prior = root.T @ root
    equations, logdet = _likeliest(*runs[0], most, prior)
    for other in runs[1:]:
        more, more_logdet = _likeliest(*other, most, prior)
        equations = (equations[:, :, None] + more[:, None]).reshape(len(more), -1, n + 1, n + 1)
        logdet = (logdet[:, :, None] + more_logdet[:, None]).reshape(len(more), -1)
    equations = equations + prior
    h, g = equations[..., :n, :n], equations[..., :n, n]
    norm = np.sqrt(np.maximum(np.einsum("...ii->...i", h), 0.0))
    used = norm.max(axis=(0, 1)) > 0
    if not used[-2:].all():
        return Posterior(*np.full((6, len(h)), np.nan))
    h, g, norm = h[..., used, :][..., used], g[..., used], norm[..., used]
    norm = np.where(norm > 0, norm, 1.0)
    norms: Array = norm[..., :, None] * norm[..., None, :]
    scaled = h / norms
    known = np.linalg.eigvalsh(scaled)[..., 0].min(axis=1) >= 1e-12
    scaled[~known] = np.eye(int(used.sum()))
    cov = np.linalg.inv(scaled) / norms
    beta = np.einsum("...ij,...j->...i", cov, g)
    chi2 = np.maximum(equations[..., n, n] - np.einsum("...i,...i->...", g, beta), 0.0)
    log_weight = (
        -0.5 * (chi2 + logdet + np.linalg.slogdet(scaled)[1] + 2 * np.log(norm).sum(-1))
        + _log_positive(calibration.prior_information[k:]).sum()
    )
    top = log_weight.max(axis=1, keepdims=True)
    weight = np.exp(log_weight - top)
    total = weight.sum(axis=1, keepdims=True)
    weight /= total
    mean = np.einsum("nk,nki->ni", weight, beta)
    variance = np.einsum("nk,nki->ni", weight, np.einsum("nkii->nki", cov) + (beta - mean[:, None]) ** 2)
    sd = np.sqrt(variance)
    alternatives = len(runs) * np.log(max(1, calibration.alternatives))
    found = (mean[:, -1], sd[:, -1], mean[:, -2], sd[:, -2], (weight * chi2).sum(1), (top + np.log(total))[:, 0] - alternatives)
    return Posterior(*(np.where(known, x, np.nan) for x in found))


def _likeliest(equations: Array, logdet: Array, most: int, prior: Array) -> tuple[Array, Array]:
    """At most ``most`` alternatives of a run, by their likelihood at its best values of what runs share."""
    if logdet.shape[1] <= most:
        return equations, logdet
    both = equations + prior
    h, g = both[..., :-1, :-1], both[..., :-1, -1]
    chi2 = both[..., -1, -1] - np.einsum("nki,nkij,nkj->nk", g, np.linalg.pinv(h, hermitian=True), g)
    order = np.argsort(chi2 + logdet, axis=1)[:, :most]
    return np.take_along_axis(equations, order[..., None, None], 1), np.take_along_axis(logdet, order, 1)


def estimate(calibration: Calibration, runs: Sequence[Run]) -> Answer | None:
    """Scale and bias from runs that share them; None if the runs do not determine both."""
    k, a = len(calibration.run_columns), calibration.alternatives
    blocks = [b for b in (run_blocks(run, calibration) for run in runs) if b.samples.size]
    if not blocks:
        return None
    grams = [normal_equations(means[None], t_s, count, calibration.noise)[0] for means, t_s, count in blocks]
    found = posterior(calibration, grams)
    if not np.isfinite(found.scale[0]):
        return None
    flat = calibration.prior_information == 0
    shared_norm = sum(np.diag(gram[0])[k:-1] for gram in grams)
    absent = int(np.count_nonzero((shared_norm == 0) & flat[k:]))
    # each alternative has a prior and is a parameter; of the others, those with a prior count as data
    dof = sum(b.samples.size for b in blocks) - len(blocks) * int(flat[: k - a].sum()) - int(flat[k:].sum()) + absent
    return Answer(
        float(found.scale[0]), float(found.scale_se[0]), float(found.bias_dps[0]), float(found.bias_se_dps[0]),
        float(np.sqrt(found.chi2[0] / dof)) if dof > 0 else None,
    )  # fmt: skip
