"""How a model's parameters differ from run to run and from power cycle to power cycle, learned from a campaign.

A fit takes a nonlinear parameter (the time constant of a transient) to be the same in all runs, and calls drift what it is not.
Here it has a spread: the campaign's runs say, by empirical Bayes, how it, the coefficients, scale, bias and the drift vary.
Expectation maximisation, with each run's own coefficients integrated out in closed form and the nonlinear parameter on a grid;
the drift by the evidence. What results are priors, for the calibration of the next few seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyrocal.effects.base import Values
from gyrocal.estimator import Calibration, calibration_of, posterior, run_blocks, spreadable
from gyrocal.model import Model, Term
from gyrocal.noise import Noise, normal_equations
from gyrocal.session import AXES, Array, Run, Session

Index = np.ndarray[Any, np.dtype[np.signedinteger[Any]]]

LEARN_S = 30.0
"""Of each run: transients are over by then."""
LEAST_SCENARIOS = 3
GRID, GRID_RATIO = 24, 6.0
"""Values of the nonlinear parameter, from a sixth of the fitted one to six times it."""
FINEST = 2 * np.log(GRID_RATIO) / (GRID - 1) / np.sqrt(12)
"""Spread of the logarithm that the grid hardly tells from none; less than twice it is taken for none."""
ROUNDS, SETTLED = 12, 3e-3
"""Rounds of expectation maximisation at most; all spreads and means settled to this part of a spread."""
FIRST_SPREAD = 0.7
"""Of the logarithm of a nonlinear parameter that was taken for constant so far."""


@dataclass(frozen=True)
class _Learned:
    """Means and spreads: of each plain run column, of the alternative's coefficient, and of the grid parameter's logarithm."""

    plain_sd: Array
    own_mean: float
    own_sd: float
    log_mean: float
    log_sd: float
    bias_dps: tuple[float, float]
    scale: tuple[float, float]
    noise: Noise

    def moved(self, old: _Learned) -> float:
        """The largest step from ``old``, in spreads."""
        steps = [*np.log(self.plain_sd / old.plain_sd)] if self.plain_sd.size else [0.0]
        steps += [np.log(self.own_sd / old.own_sd), np.log(self.log_sd / old.log_sd)]
        for new, was in ((self.bias_dps, old.bias_dps), (self.scale, old.scale)):
            steps += [(new[0] - was[0]) / was[1], np.log(new[1] / was[1])]
        return float(np.abs(steps).max())


def learn(session: Session, model: Model) -> Model:
    """The fitted model with the spreads of its runs' nonlinear parameters (``NAME_sd``), and all priors learned with them.

    A model without such a parameter, or a session of fewer than three power cycles with two faces, is left as it is.
    """
    for axis in AXES:
        term = next((t for t in model.on(axis) if spreadable(t) is not None), None)
        runs = [_runs(r, axis) for _, r in session.by_scenario()]
        scenarios = [r for r in runs if len({float(np.sign(run.rate_dps.mean())) for run in r}) == 2]
        if term is None or len(scenarios) < LEAST_SCENARIOS:
            continue
        without = _without_spread(model, term)
        start = calibration_of(without, axis)
        if not np.isfinite([start.bias_dps[1], start.scale[1]]).all():
            continue
        model = _written(without, term, start, _learn(start, term, scenarios), scenarios)
    return model


def _runs(runs: Sequence[Run], axis: str) -> list[Run]:
    own = [r for r in runs if r.axis == axis and not r.rate_is_mean and np.any(r.rate_dps)]
    return [r.part(0, int(np.searchsorted(r.t_us, LEARN_S * 1e6))) for r in own]


def _without_spread(model: Model, term: Term) -> Model:
    name = spreadable(term)
    return model.with_term(replace(term, values={n: v for n, v in term.values.items() if n != f"{name}_sd"}))


def _learn(start: Calibration, term: Term, scenarios: list[list[Run]]) -> _Learned:
    from scipy.optimize import minimize

    name = spreadable(term)
    assert name is not None
    order = [i for i, c in enumerate(start.run_columns) if c.effect is not term.effect]
    own = next(c for c in start.run_columns if c.effect is term.effect)
    values = term.values[name] * np.exp(np.log(GRID_RATIO) * np.linspace(-1, 1, GRID))
    plain = [start.run_columns[i] for i in order]
    columns = (*plain, *(replace(own, values={**term.values, name: float(v)}) for v in values))
    grid = replace(start, run_columns=columns, alternatives=GRID)
    k_common = len(start.shared_columns) + 2
    groups = _groups(grid, len(plain))
    runs = [run for scenario in scenarios for run in scenario]
    scenario_of = np.repeat(np.arange(len(scenarios)), [len(s) for s in scenarios])

    blocks = [run_blocks(run, grid) for run in runs]
    alike: dict[tuple[bytes, bytes], list[int]] = {}
    for i, (_, t_s, count) in enumerate(blocks):
        alike.setdefault((t_s.tobytes(), count.tobytes()), []).append(i)

    def equations(noise: Noise) -> tuple[Array, float]:
        """Of all runs; those with the same blocks together."""
        grams, logdet = np.empty((len(runs), len(columns) + k_common + 1, len(columns) + k_common + 1)), 0.0
        for rows in alike.values():
            _, t_s, count = blocks[rows[0]]
            grams[rows], of_one = normal_equations(np.array([blocks[i][0] for i in rows]), t_s, count, noise)
            logdet += len(rows) * of_one
        return grams, logdet

    now = _Learned(
        np.array([c.sd for c in plain]), own.mean, own.sd, float(np.log(term.values[name])), FIRST_SPREAD,
        start.bias_dps, start.scale, start.noise,
    )  # fmt: skip
    grams, _ = equations(now.noise)
    for round_ in range(ROUNDS):
        before = now
        now = _step(grid, now, values, grams, scenario_of, groups)
        if round_ in (0, 2, 5):  # the drift again, with what is no drift taken from it

            def cost(x: Array, now: _Learned = now) -> float:
                noise = replace(now.noise, ou_sd_dps=float(np.exp(x[0])), ou_tau_s=float(np.exp(x[1])))
                trial, logdet = equations(noise)
                return 0.5 * logdet - float(_each_run(grid, replace(now, noise=noise), values, trial)[0].sum())

            x0: Array = np.log([np.clip(now.noise.ou_sd_dps, 1e-4, 0.02), np.clip(now.noise.ou_tau_s, 2.0, 100.0)])
            found = minimize(
                cost, x0, method="Nelder-Mead", bounds=[np.log([1e-5, 0.1]), np.log([1.0, 1000.0])],
                options={"maxfev": 30, "xatol": 0.05, "fatol": 0.05, "initial_simplex": x0 + 0.7 * np.eye(3, 2, -1)},
            )  # fmt: skip
            noise = replace(now.noise, ou_sd_dps=float(np.exp(found.x[0])), ou_tau_s=float(np.exp(found.x[1])))
            now = replace(now, noise=noise)
            grams, _ = equations(noise)
        elif now.moved(before) < SETTLED:
            break
    return now


def _groups(grid: Calibration, plain: int) -> list[list[int]]:
    """Plain run columns that share a spread: a cosine and its sine."""
    groups: dict[tuple[str, int], list[int]] = {}
    for i, column in enumerate(grid.run_columns[:plain]):
        group = column.effect.groups(column.values)[column.index]
        groups.setdefault((column.effect.id, group), []).append(i)
    return list(groups.values())


def _weights(learned: _Learned, values: Array) -> Array:
    """Prior weight of each grid value: a Gaussian in the logarithm, whose tails let the spread grow as well as shrink."""
    weight = np.exp(-0.5 * ((np.log(values) - learned.log_mean) / learned.log_sd) ** 2)
    return np.asarray(weight / weight.sum())


def _prior(grid: Calibration, learned: _Learned) -> tuple[Array, Array]:
    """Mean and information (1/variance) of [plain, the alternative's coefficient, shared, bias, scale]."""
    shared_sd = [c.sd for c in grid.shared_columns]
    mean = [
        *np.zeros(learned.plain_sd.size), learned.own_mean, *(c.mean for c in grid.shared_columns),
        learned.bias_dps[0], learned.scale[0],
    ]  # fmt: skip
    sd = [*learned.plain_sd, learned.own_sd, *shared_sd, learned.bias_dps[1], learned.scale[1]]
    return np.array(mean), np.where(np.isfinite(sd), 1 / np.square(sd), 0.0)


def _each_run(grid: Calibration, learned: _Learned, values: Array, grams: Array) -> tuple[Array, Array, Array, Array]:
    """Each run by itself: log-evidence [n], probability of each grid value [n, K], mean [n, K, p], variance [n, K, p]."""
    plain = learned.plain_sd.size
    mean, information = _prior(grid, learned)
    tail = [*range(plain + GRID, grams.shape[1])]
    index = np.array([[*range(plain), plain + k, *tail] for k in range(GRID)])
    equations = grams[:, index[:, :, None], index[:, None, :]]
    h = equations[..., :-1, :-1] + np.diag(information)
    g = equations[..., :-1, -1] + information * mean
    cov = np.linalg.inv(h)
    beta = np.einsum("nkij,nkj->nki", cov, g)
    chi2 = equations[..., -1, -1] + information @ mean**2 - np.einsum("nki,nki->nk", g, beta)
    log = -0.5 * (chi2 + np.linalg.slogdet(h)[1]) + 0.5 * np.log(information[information > 0]).sum()
    log += np.log(_weights(learned, values))
    top = log.max(axis=1, keepdims=True)
    weight = np.exp(log - top)
    total = weight.sum(axis=1, keepdims=True)
    return (top + np.log(total))[:, 0], weight / total, beta, np.einsum("nkii->nki", cov)


def _step(
    grid: Calibration, learned: _Learned, values: Array, grams: Array, scenario_of: Index, groups: list[list[int]]
) -> _Learned:
    """One round: what each run and scenario says under the present priors, and the priors that fit what they say."""
    plain = learned.plain_sd.size
    _, weight, beta, variance = _each_run(grid, learned, values, grams)
    square = np.einsum("nk,nki->i", weight, beta**2 + variance) / len(weight)
    first = np.einsum("nk,nki->i", weight, beta) / len(weight)
    plain_sd = learned.plain_sd.copy()
    for group in groups:
        plain_sd[group] = np.sqrt(square[group].mean())
    own_mean = float(first[plain]) if grid.run_columns[plain].effect.common_mean else 0.0
    own_sd = float(np.sqrt(square[plain] - 2 * own_mean * first[plain] + own_mean**2))
    # The logarithm is known where the transient is large; elsewhere its weights are the prior's and teach nothing.
    log = np.log(values)
    log_mean = float((weight @ log).mean())
    log_sd = max(float(np.sqrt((weight @ (log - log_mean) ** 2).mean())), float(FINEST))
    bias, scale = _scenarios(grid, learned, values, grams, scenario_of)
    return replace(
        learned, plain_sd=plain_sd, own_mean=own_mean, own_sd=own_sd, log_mean=log_mean, log_sd=log_sd, bias_dps=bias,
        scale=scale,
    )  # fmt: skip


def _scenarios(
    grid: Calibration, learned: _Learned, values: Array, grams: Array, scenario_of: Index
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Mean and spread of bias and scale over the power cycles."""
    plain = [replace(c, mean=0.0, sd=sd) for c, sd in zip(grid.run_columns, learned.plain_sd, strict=False)]
    inside = np.flatnonzero(_weights(learned, values) > 1e-6)
    own = [replace(grid.run_columns[len(plain) + i], mean=learned.own_mean, sd=learned.own_sd) for i in inside]
    known = replace(grid, run_columns=(*plain, *own), alternatives=len(own), bias_dps=learned.bias_dps, scale=learned.scale)
    kept = np.array([*range(len(plain)), *(len(plain) + inside), *range(len(plain) + GRID, grams.shape[1])])
    grams = grams[:, kept][:, :, kept]
    numbers, sizes = np.unique(scenario_of, return_counts=True)
    found = []
    for size in np.unique(sizes):
        rows = np.array([np.flatnonzero(scenario_of == s) for s in numbers[sizes == size]])
        found += [posterior(known, [grams[r] for r in part.T]) for part in np.array_split(rows, 1 + len(rows) // 16)]
    out = []
    for mean, se in (("bias_dps", "bias_se_dps"), ("scale", "scale_se")):
        value = np.concatenate([getattr(p, mean) for p in found])
        square = np.concatenate([getattr(p, se) for p in found]) ** 2
        out.append((float(value.mean()), float(np.sqrt(value.var() + square.mean()))))
    return out[0], out[1]


def _written(model: Model, term: Term, start: Calibration, learned: _Learned, scenarios: list[list[Run]]) -> Model:
    """The model with what was learned. Errors as if each run's and scenario's value were known: they nearly are."""
    axis, n, n_runs = start.axis, len(scenarios), sum(map(len, scenarios))
    name = spreadable(term)
    assert name is not None
    mean, sd = float(np.exp(learned.log_mean)), learned.log_sd
    coefficient = term.effect.used(term.values)[0]
    plain = [c for c in start.run_columns if c.effect is not term.effect]

    def update(effect_id: str, means: Values, spreads: Values, spread: float, count: int) -> None:
        nonlocal model
        old = model.term(effect_id, axis)
        if old is not None:
            se = {k: spread / float(np.sqrt(count)) for k in means} | {
                k: v / float(np.sqrt(2 * count)) for k, v in spreads.items()
            }
            model = model.with_term(replace(old, values={**old.values, **means, **spreads}, se={**old.se, **se}))

    spread = {f"{name}_sd": mean * sd} if sd > 2 * FINEST else {}
    update(term.effect_id, {name: mean}, spread, mean * sd, n_runs)
    own_mean = {coefficient: learned.own_mean} if term.effect.common_mean else {}
    update(term.effect_id, own_mean, {f"{coefficient}_sd": learned.own_sd}, learned.own_sd, n_runs)
    for kind in dict.fromkeys(c.effect for c in plain):
        own = np.array([sd for sd, c in zip(learned.plain_sd, plain, strict=True) if c.effect is kind])
        known = next(c.values for c in plain if c.effect is kind)
        update(kind.id, {}, kind.named_spread(own, known), 0.0, n_runs)
    update("bias", {"bias_dps": learned.bias_dps[0]}, {}, learned.bias_dps[1], n)
    update("turn_on_bias", {}, {"sd_dps": learned.bias_dps[1]}, 0.0, n)
    update("scale", {"scale": learned.scale[0]}, {"scale_sd": learned.scale[1]}, learned.scale[1], n)
    update("colored_noise", {"sd_dps": learned.noise.ou_sd_dps, "tau_s": learned.noise.ou_tau_s}, {}, 0.0, n)
    drift = model.term("colored_noise", axis)
    return model if drift is None else model.with_term(replace(drift, se={}))
