"""Scale and bias of one calibration by the model: the host's twin of ``gc_estimator``.

The same blocks of 0.25 s, the same noise, the same priors as the device (ARCHITECTURE.md): a model fitted to a campaign becomes
a :class:`Calibration`, Gaussian priors and effect columns, and a few seconds of two runs become scale and bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gyrocal.effects.base import Effect, Values
from gyrocal.errors import InputError
from gyrocal.model import Model
from gyrocal.noise import Noise, normal_equations
from gyrocal.session import AXES, Array, Run

BLOCK_US = 250_000
TIGHTEST = 1e-6
"""No prior is tighter than this fraction of a typical size: what a fit cannot spread it has not proven constant."""


@dataclass(frozen=True)
class Column:
    """One effect column: which of the effect's columns, and its prior (sd infinite = flat)."""

    effect: Effect
    values: Values = field(repr=False)
    index: int
    mean: float
    sd: float


@dataclass(frozen=True)
class Calibration:
    """What a device knows before it measures. Parameters in the order [run columns, shared columns, bias, scale]."""

    name: str
    axis: str
    run_columns: tuple[Column, ...]
    shared_columns: tuple[Column, ...]
    bias_dps: tuple[float, float]
    scale: tuple[float, float]
    """(mean, sd) of the priors; sd infinite = flat."""
    noise: Noise

    @property
    def columns(self) -> tuple[Column, ...]:
        return self.run_columns + self.shared_columns

    @property
    def prior_mean(self) -> Array:
        return np.array([*(c.mean for c in self.columns), self.bias_dps[0], self.scale[0]])

    @property
    def prior_information(self) -> Array:
        """1/sd of each parameter; 0 = flat."""
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


def calibration_of(model: Model, axis: str, white_sd_dps: float | None = None) -> Calibration:
    """The priors that a fitted model gives for its axis.

    The spread of a random effect over the campaign is the prior's; to it add the standard errors of mean and spread. A model
    that has not been fitted, or on too few power cycles to know their spread, leaves scale and bias flat.
    """
    run_columns: list[Column] = []
    shared_columns: list[Column] = []
    priors = {"bias": (0.0, np.inf), "scale": (0.0, np.inf)}
    for term in model.on(axis):
        kind = term.effect
        if kind.id in ("turn_on_bias", "colored_noise"):
            continue
        if kind.id in priors:
            priors[kind.id] = _base_prior(model, axis, kind.id)
            continue
        if not all(name in term.values for name in kind.nonlinear) or not kind.used(term.values):
            raise InputError(f"model {model.name}: {kind.id} on {axis} has no values; fit it with `gyrocal add`")
        mean = (
            kind.coefficients(term.values)
            if kind.scope == "session" or kind.common_mean
            else np.zeros(kind.spread(term.values).size)
        )
        spread = kind.spread(term.values)
        se = (
            kind.spread({n: term.se.get(n, 0.0) for n in term.values})
            if kind.scope == "run" and not kind.common_mean
            else _se(kind, term.values, term.se)
        )
        typical = [kind.parameter(n).typical[1] for n in kind.used(term.values)]
        smallest = TIGHTEST * np.repeat(typical, mean.size // len(typical))
        sd = np.sqrt(spread**2 + se**2 + smallest**2)
        columns = [Column(kind, term.values, j, float(mean[j]), float(sd[j])) for j in range(mean.size)]
        (run_columns if kind.scope == "run" else shared_columns).extend(columns)
    white = model.white_sd_dps.get(axis, white_sd_dps)
    if white is None or white <= 0:
        raise InputError(
            f"model {model.name}: no white noise level for {axis}; fit it with `gyrocal add` or give white_sd_dps"
        )
    noise = Noise(
        white, model.value("colored_noise", axis, "sd_dps"), model.value("colored_noise", axis, "tau_s", 30.0)
    )
    return Calibration(
        model.name, axis, tuple(run_columns), tuple(shared_columns), priors["bias"], priors["scale"], noise
    )


def _se(kind: Effect, values: Values, se: Values) -> Array:
    return np.array([np.hypot(se.get(n, 0.0), se.get(f"{n}_sd", 0.0)) for n in kind.used(values)])


def _base_prior(model: Model, axis: str, effect_id: str) -> tuple[float, float]:
    term = model.term(effect_id, axis)
    name = "bias_dps" if effect_id == "bias" else "scale"
    spread_term, spread_name = (
        (model.term("turn_on_bias", axis), "sd_dps") if effect_id == "bias" else (term, "scale_sd")
    )
    if term is None or name not in term.values or spread_term is None or spread_name not in spread_term.values:
        return 0.0, np.inf
    parts = [spread_term.values[spread_name], spread_term.se.get(spread_name, 0.0), term.se.get(name, 0.0)]
    return term.values[name], float(np.sqrt(np.sum(np.square(parts))) + TIGHTEST)


def run_equations(run: Run, calibration: Calibration) -> tuple[Array, int]:
    """Whitened normal equations of one run over [run, shared, bias, scale, y - w], and how many blocks they are from."""
    axis = AXES.index(calibration.axis)
    rate_dps = run.rate_dps if run.axis_index == axis else np.zeros(len(run))
    columns = np.column_stack([
        *(c.effect.columns(run, axis, c.values)[:, c.index] for c in calibration.columns),
        np.ones(len(run)), rate_dps, run.gyro_dps[:, axis] - rate_dps,
    ])  # fmt: skip
    label = np.zeros(len(run), dtype=np.int64) if run.rate_is_mean else run.t_us // BLOCK_US
    blocks, first, count = np.unique(label, return_index=True, return_counts=True)
    means = np.add.reduceat(columns, first, axis=0) / count[:, None]
    full = run.rate_is_mean | (2e6 * count >= run.sample_rate_hz * BLOCK_US)
    gram, _ = normal_equations(
        means[full].T[None], blocks[full] * BLOCK_US * 1e-6, count[full].astype(float), calibration.noise
    )
    return gram[0], int(full.sum())


def estimate(calibration: Calibration, runs: Sequence[Run]) -> Answer | None:
    """Scale and bias from runs that share them; None where the runs do not fix both."""
    k, s = len(calibration.run_columns), len(calibration.shared_columns)
    information, mean = calibration.prior_information, calibration.prior_mean
    n = s + 2
    total = np.zeros((n + 1, n + 1))
    dof = 0
    for run in runs:
        gram, blocks = run_equations(run, calibration)
        if k:
            prior = information[:k, None] * np.column_stack([np.eye(k), np.zeros((k, n)), mean[:k]])
            gram = gram + prior.T @ prior
            norm = np.sqrt(np.maximum(np.diag(gram)[:k], 1e-300))
            inner = gram[:k, :k] / np.outer(norm, norm)
            cross = gram[:k, k:] / norm[:, None]
            gram = gram[k:, k:] - cross.T @ np.linalg.solve(inner, cross)
            dof += int(np.count_nonzero(information[:k])) - k
        else:
            gram = gram[k:, k:]
        total += gram
        dof += blocks
    prior = information[k:, None] * np.column_stack([np.eye(n), mean[k:]])
    total += prior.T @ prior
    dof += int(np.count_nonzero(information[k:])) - n
    h, g = total[:n, :n], total[:n, n]
    norm = np.sqrt(np.diag(h))
    used = norm > 0
    if not used[-2:].all():
        return None
    h, g, norm = h[np.ix_(used, used)], g[used], norm[used]
    scaled = h / np.outer(norm, norm)
    if np.linalg.eigvalsh(scaled)[0] < 1e-12:
        return None
    cov = np.linalg.inv(scaled) / np.outer(norm, norm)
    beta = cov @ g
    chi2 = max(0.0, float(total[n, n] - g @ beta))
    return Answer(
        float(beta[-1]), float(np.sqrt(cov[-1, -1])), float(beta[-2]), float(np.sqrt(cov[-2, -2])),
        float(np.sqrt(chi2 / dof)) if dof > 0 else None,
    )  # fmt: skip
