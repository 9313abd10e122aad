"""A nonlinear parameter that differs from run to run: its mean and spread, and each run's own value."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import first_noises, fit_noise, white_start, with_noise
from gyrocal.inference.reml import integrate
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

APART_GRID, APART_RATIO, APART_ROUNDS = 25, 6.0, 5
"""Values of a parameter that may be each run's own, from a sixth of the common one (in the middle) to six times it."""
APART_SETTLED = 0.1
"""Change of the common value, as a fraction of its standard error, below which the search ends."""


def runs_apart(current: AxisFit) -> AxisFit:
    """Fit a nonlinear parameter, for example a time constant, separately in each run if that gains enough.

    Empirical Bayes: the likelihood of each run on a grid of values, all else as fitted; a Gaussian in the logarithm for what
    the runs have in common, by expectation maximisation; each run is then given its posterior mean.
    """
    for i, term in enumerate(current.design.terms):
        name = term.spreadable
        for round_ in range(APART_ROUNDS if name is not None else 0):
            assert name is not None
            middle = current.design.terms[i].values[name]
            values = middle * np.exp(np.log(APART_RATIO) * np.linspace(-1, 1, APART_GRID))
            trials = [current.design.with_values(i, {name: float(v)}) for v in values]
            logliks = np.column_stack([_each_run(current, trial) for trial in trials])
            common = _common(np.log(values), logliks)
            if not current.design.terms[i].of_run and common.gain < POLICY.run_spread_gain:
                break
            mean, count = float(np.exp(common.log_mean)), len(logliks)
            sd = mean * common.log_sd
            own = np.exp(common.weight @ np.log(values))
            of_run = {b.run.index: {name: float(v)} for b, v in zip(current.design.blocks, own, strict=True)}
            terms = list(current.design.terms)
            terms[i] = replace(
                term, values={**term.values, name: mean, f"{name}_sd": sd},
                se={name: sd / count**0.5, f"{name}_sd": sd / (2 * count) ** 0.5}, of_run=of_run,
            )  # fmt: skip
            design = current.design.changed(terms)
            noises = [current.noise]
            if round_ == 0:  # what was drift may be one no longer
                noises += first_noises(design, white_start(design))[:1]
            fits = [fit_noise(design, start=with_noise(design, noise, current.spreads)) for noise in noises]
            current = max(fits, key=lambda f: f.loglik)
            if abs(mean - middle) < APART_SETTLED * sd / count**0.5:
                break
    return current


def _each_run(current: AxisFit, design: Design) -> Array:
    """Log-likelihood of each run [runs] by itself under another design, shared parameters, noise and spreads as fitted."""
    layout, spreads = design.layout, current.spreads
    grams, logdet = design.grams(current.noise)
    integrated = integrate(grams, layout.random, np.arange(1 + len(layout.fixed)), spreads.of(layout))
    residual = np.concatenate([[1.0], -current.solution.beta])
    chi2 = np.einsum("i,rij,j->r", residual, integrated.grams, residual)
    return np.asarray(-0.5 * (logdet + integrated.logdet + chi2))


@dataclass(frozen=True)
class _Common:
    """What the runs have in common: mean and spread of the logarithm of a value over the runs.

    ``weight`` [runs, grid] is each run's posterior; ``gain`` the log-likelihood that the spread gains over the grid's middle
    for all runs.
    """

    log_mean: float
    log_sd: float
    weight: Array
    gain: float


def _common(log_values: Array, logliks: Array) -> _Common:
    """The population from each run's log-likelihood [runs, grid] at the logarithms [grid], by expectation maximisation."""
    step = float(log_values[1] - log_values[0])
    log_mean, log_sd = float(log_values[logliks.sum(axis=0).argmax()]), 0.3
    for _ in range(50):
        prior = -0.5 * ((log_values - log_mean) / log_sd) ** 2
        prior = prior - float(np.log(np.exp(prior).sum()))
        joint = logliks + prior
        top = joint.max(axis=1, keepdims=True)
        weight = np.exp(joint - top)
        evidence = top[:, 0] + np.log(weight.sum(axis=1))
        weight /= weight.sum(axis=1, keepdims=True)
        log_mean = float((weight @ log_values).mean())
        log_sd = max(float(np.sqrt((weight @ (log_values - log_mean) ** 2).mean())), step / 2)
    return _Common(log_mean, log_sd, weight, float(evidence.sum() - logliks[:, log_values.size // 2].sum()))
