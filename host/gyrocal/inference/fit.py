"""Generalised least squares of any list of effects, jointly with the noise, by restricted maximum likelihood (REML).

Per axis, on block means: ``y = X·beta + Z_run·u + Z_scenario·v + drift + white``. ``beta`` are the parameters that all runs
share; ``u`` coefficients of a run's own (a phase, an onset), random with spreads that are estimated; ``v`` the offset (and
scale) of a power cycle. Nonlinear parameters are found about it: on a grid, then refined, and where runs differ, run by run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gyrocal.effects.base import Role, Values
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.inference.blocks import Blocks, by_sample, reduce_session
from gyrocal.inference.design import LEAST_SCENARIOS, SLOW_S, Design, Mask
from gyrocal.inference.reml import (
    NO_SPREAD,
    Solution,
    Spreads,
    SpreadScale,
    fit_spreads,
    integrate,
    maximise,
    solve,
    solve_with_slopes,
    unknown_spreads,
)
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.threads import each, one_thread

Progress = Callable[[str], None]

LEAST_WHITE_DPS = 1e-5
"""No reading is less noisy than this: a thousandth of a count."""
STEP = 1e-4
"""Of logarithms, for numerical gradients: far above the likelihood's rounding."""
MANY_BLOCKS = 5000
"""Fewer are fitted without haste: drift is not taken to be constant within any time."""
NEGLIGIBLE_DRIFT = 0.01
"""Of the white noise's spectral density: drift that is taken to be constant in a cell of time does less beyond it."""
LONGEST_CELL_S = SLOW_S / 4
APART_GRID, APART_RATIO, APART_ROUNDS = 25, 6.0, 5
"""Values of a parameter that may be each run's own, from a sixth of the common one (in the middle) to six times it."""
APART_SETTLED = 0.1
"""Of its standard error: the common value has moved by less."""
FREE = 1e3
"""Of a spread, or what one power cycle knows of it: wide enough to say nothing."""
ORDER_CHANCE = 0.01
"""Chance that noise gains as much as a richer structure of the same effect does: above it, the simpler one is taken."""
LEAST_CHANCE = 0.05
"""More is no finding, whatever the test."""
APART_GAIN = 5.0
"""Log-likelihood that its spread must gain."""


@dataclass(frozen=True)
class AxisFit:
    """A fitted axis. ``terms`` and ``noise_model`` carry values and standard errors; ``loglik`` is REML's."""

    design: Design
    noise: Noise
    spreads: Spreads
    solution: Solution
    terms: tuple[Term, ...]
    grams: Array = field(repr=False)
    logdet: Array = field(repr=False)
    noise_model: AxisNoise = field(default_factory=AxisNoise)

    @property
    def loglik(self) -> float:
        return self.solution.loglik

    @property
    def turn_on_sd_dps(self) -> float:
        """Spread of the bias over power cycles, deg/s."""
        return self._scenario_sd(self.spreads.scenario, Role.BIAS)

    @property
    def slow_power(self) -> float:
        """Mean square, dps^2, of drift and turn-on bias: the floor's slow part."""
        return self.noise.ou_sd_dps**2 + self.turn_on_sd_dps**2

    @property
    def scale_spread_dps(self) -> float:
        """rms, deg/s, of the scale's own spread from power cycle to power cycle; it is no part of the floor."""
        scale_sd = self._scenario_sd(self.spreads.scenario, Role.SCALE)
        rates = [
            float(np.mean(b.run.rate_dps**2)) if b.run.axis_index == self.design.axis else 0.0 for b in self.design.blocks
        ]
        samples = [len(b.run) for b in self.design.blocks]
        rate_power = float(np.average(rates, weights=samples))
        return scale_sd * float(np.sqrt(rate_power))

    def _scenario_sd(self, of: Array, role: Role) -> float:
        for k, j in enumerate(self.design.layout.scenario):
            if self.design.terms[self.design.layout.fixed[j][0]].effect.role is role:
                return float(np.nan_to_num(of[k]))
        return 0.0

    def subset(self, runs: Mask, spreads: Spreads | None = None) -> Solution:
        """The solution from some of the runs."""
        return solve(
            self.design.layout, self.grams[runs], self.logdet[runs], self.design.scenarios[runs],
            int(self.design.n_blocks[runs].sum()), spreads or self.spreads,
        )  # fmt: skip

    def spreads_without(self, held_out: Mask) -> Spreads:
        """Spreads of what runs have of their own, estimated again from the runs that are not held out.

        The spread of power cycles is noise and stays as fitted, as white noise and drift do: a few cycles that happen to agree
        would have none, and foretell the next with a certainty that nobody has.
        """
        if not self.spreads.run.size:
            return self.spreads
        kept = ~held_out
        again = fit_spreads(
            self.design, self.grams[kept], self.logdet[kept], self.design.scenarios[kept],
            int(self.design.n_blocks[kept].sum()), self.spreads,
        )  # fmt: skip
        return Spreads(again.run, self.spreads.scenario)

    def run_coefficients(self, run: int, beta: Array, spreads: Spreads) -> Array:
        """Posterior mean of a run's own random coefficients [k], given shared ``beta``; its scenario's offset is free too."""
        layout = self.design.layout
        if not layout.run:
            return np.zeros(0)
        random, sd = layout.random, spreads.of(layout)
        residual = np.concatenate([[1.0], -beta, np.zeros(len(layout.run))])
        gram = self.grams[run]
        m = np.eye(random.size) + sd[:, None] * gram[np.ix_(random, random)] * sd
        u = sd * np.linalg.solve(m, sd * (gram[random] @ residual))
        return np.asarray(u[: len(layout.run)])

    def predict(self, run: int, beta: Array, u: Array) -> Array:
        """Modelled minus true rate at every sample of a run, shape [n], deg/s."""
        columns = self.design.sample_columns(self.design.blocks[run])
        out = np.zeros(len(self.design.blocks[run].run))
        for (i, j), b in zip(self.design.layout.fixed, beta, strict=True):
            out += b * columns[i][:, j]
        for (i, j), b in zip(self.design.layout.run, u, strict=True):
            out += b * columns[i][:, j]
        return out


@dataclass(frozen=True)
class Fit:
    """A fitted model: one :class:`AxisFit` for each axis that the model covers."""

    session: Session
    blocks: list[Blocks]
    model: Model
    axes: dict[str, AxisFit]

    @property
    def loglik(self) -> float:
        return sum(a.loglik for a in self.axes.values())

    def on(self, axis: str, fitted: AxisFit | None = None) -> Fit:
        """One axis alone, as it is or ``fitted`` otherwise."""
        return replace(self, axes={axis: fitted or self.axes[axis]})


@one_thread
def fit(
    session: Session, model: Model, *, blocks: list[Blocks] | None = None, axes: Iterable[str] = AXES,
    progress: Progress | None = None,
) -> Fit:  # fmt: skip
    """Fit a model's terms and noise to a session; the model returned carries values and standard errors."""
    reduced = reduce_session(session) if blocks is None else blocks

    def on(axis: str) -> AxisFit:
        if progress is not None:
            progress(f"fitting {axis}")
        return fit_axis(reduced, AXES.index(axis), model.on(axis), model.noise_on(axis))

    covered = [axis for axis in axes if axis in model.axes]
    fitted = dict(zip(covered, each(on, covered, session.rows), strict=True))
    terms = {(t.effect_id, t.axis): t for a in fitted.values() for t in a.terms}
    noise = {**model.noise, **{axis: a.noise_model for axis, a in fitted.items()}}
    result = Model(model.name, tuple(terms.get((t.effect_id, t.axis), t) for t in model.terms), noise)
    return Fit(session, reduced, result, fitted)


def fit_axis(blocks: Sequence[Blocks], axis: int, terms: Sequence[Term], noise_model: AxisNoise) -> AxisFit:
    """Fit one axis: structure and nonlinear parameters by grid and refinement, noise and spreads by REML."""
    terms = [_prepared(t, blocks, axis) for t in terms]
    if any(t.effect.fast for t in terms):
        blocks = by_sample(blocks)
    pending = [i for i, t in enumerate(terms) if _needs_choice(t)]
    settled = [t for i, t in enumerate(terms) if i not in pending]
    current = fit_noise(Design(blocks, axis, settled, noise_model))
    cell_s = _drift_cell_s(current) if current.design.n_blocks.sum() > MANY_BLOCKS else 0.0
    if cell_s:
        design = Design(blocks, axis, settled, noise_model, cell_s, like=current.design)
        current = fit_noise(design, start=with_noise(design, current.noise, current.spreads))
    for i in pending:
        current = choose_variant(current, terms[i])
    order = {t.effect_id: i for i, t in enumerate(terms)}
    current = _in_order(current, order, bool(pending))
    return finish(runs_apart(refine(current)))


def _drift_cell_s(current: AxisFit) -> float:
    """How long drift may be taken to be constant, s: what it does in less is a hundredth of the white noise there; 0 = a block.

    The drift's spectral density at the highest frequency that such cells hold, pi / cell_s, against that of the white noise.
    """
    noise, n = current.noise, float(np.median(np.concatenate([b.n for b in current.design.blocks])))
    block_s = current.design.extent_s[1]
    white = noise.white_sd_dps**2 * block_s / n
    drift = 2 * noise.ou_sd_dps**2 / (np.pi**2 * noise.ou_tau_s)
    cell_s = float(np.sqrt(NEGLIGIBLE_DRIFT * white / drift)) if drift > 0 else LONGEST_CELL_S
    return min(cell_s, LONGEST_CELL_S) if cell_s > 2 * block_s else 0.0


def choose_variant(current: AxisFit, term: Term) -> AxisFit:
    """Add a term whose structure or nonlinear parameters are open: try its variants, keep the best by BIC, fit the noise."""
    noise, chosen = current.noise, None
    for _ in range(3):  # drift swallows what it was fitted without: judge again at the noise fitted with the choice
        values = _likeliest(current, term, noise)
        if values == chosen:
            break
        chosen = values
        terms = [*current.design.terms, replace(term, values=values)]
        design = current.design.changed(terms)
        fitted = fit_noise(design, start=with_noise(design, noise, carry_spreads(current, design)))
        noise = fitted.noise
    return fitted


def _likeliest(current: AxisFit, term: Term, noise: Noise) -> Values:
    """The variant with the best BIC at a given noise; what is independent of one another is runs, not blocks.

    A simpler one that is part of it is taken where noise may well gain what it lacks.
    """
    runs = [b.run for b in current.design.blocks]
    count = len(runs)
    tried: list[tuple[float, int, Values, AxisFit]] = []
    variants = term.effect.variants(runs, current.design.axis)
    if len(variants) == 1:
        return variants[0]
    for values in variants:
        terms = [*current.design.terms, replace(term, values=values)]
        design = current.design.changed(terms)
        trial = with_noise(design, noise, carry_spreads(current, design))
        parameters = len(trial.design.layout.fixed) + trial.design.layout.n_groups + len(term.effect.nonlinear)
        tried.append((profile_loglik(trial) - 0.5 * np.log(count) * parameters, parameters, values, trial))
    if not tried:
        raise InputError(f"effect {term.effect_id}: nothing to try on this session")
    _, most, best, richest = max(tried, key=lambda t: t[0])
    for _, parameters, values, trial in sorted(tried, key=lambda t: t[1]):
        nested = parameters < most and values.keys() < best.keys()
        if nested and likelihood_ratio(trial, richest, most - parameters)[1] > ORDER_CHANCE:
            return values
    return best


def likelihood_ratio(current: AxisFit, fitted: AxisFit, parameters: int) -> tuple[float, float]:
    """Twice the log-likelihood that a richer model's parameters gain, and the chance that noise gains as much.

    Both at their own noise, the poorer one also at the richer one's, whichever suits it. Chi-square takes the spread of power
    cycles for known, and a few cycles say little of it: what differs from cycle to cycle alone has to pass an F test of as many
    values as there are cycles. What shows within them has to pass chi-square with each cycle's own offset left free. The better
    of the two counts, twice, for there were two.
    """
    from scipy.stats import chi2, f

    poorer = [current]
    if fitted.noise != current.noise:
        poorer.append(with_noise(current.design, fitted.noise, current.spreads))
    statistic = max(0.0, 2 * (profile_loglik(fitted) - max(map(profile_loglik, poorer))))
    chance = float(chi2.sf(statistic, parameters))
    layout, cycles = current.design.layout, np.unique(current.design.scenarios).size
    if not layout.scenario or chance > LEAST_CHANCE:
        return statistic, chance
    known = SpreadScale.of(current.design, current.grams).unit[current.spreads.run.size :]
    free = FREE * np.maximum(current.spreads.scenario, known)
    within = 2 * (_of_free_cycles(fitted, free) - max(_of_free_cycles(one, free) for one in poorer))
    left = cycles - len(layout.fixed) - parameters
    ratio = float(np.expm1(min(statistic / cycles, 500.0))) * left / parameters
    between = float(f.sf(ratio, parameters, left)) if left > 0 else 1.0
    return statistic, max(chance, min(1.0, 2 * min(float(chi2.sf(within, parameters)), between)))


def _of_free_cycles(fitted: AxisFit, scenario_sd: Array) -> float:
    """Profile log-likelihood with the offset (and scale) of each power cycle free: what runs say by themselves."""
    everything = np.ones(len(fitted.design.blocks), dtype=bool)
    return profile_loglik(replace(fitted, solution=fitted.subset(everything, Spreads(fitted.spreads.run, scenario_sd))))


def profile_loglik(fitted: AxisFit) -> float:
    """Log-likelihood at the fitted noise, shared parameters at their best: comparable between models (REML's is not)."""
    if not np.isfinite(fitted.loglik):  # nothing that could be solved
        return -np.inf
    chol = np.linalg.slogdet(np.linalg.inv(fitted.solution.cov))[1] if fitted.solution.beta.size else 0.0
    return fitted.loglik + 0.5 * float(chol) - 0.5 * fitted.solution.beta.size * float(np.log(2 * np.pi))


def _prepared(term: Term, blocks: Sequence[Blocks], axis: int) -> Term:
    """A term whose values are open, with those of the fault of the reading that shows; others as they are."""
    if term.values or term.effect.fault is None:
        return term
    found = term.effect.fault.detect([b.run for b in blocks], axis)
    return term if found is None else replace(term, values=found.values, se=found.se)


def _needs_choice(term: Term) -> bool:
    return not term.values and term.fault is None


def carry_spreads(old: AxisFit, design: Design) -> Spreads:
    """Spreads for a design with more terms: the old ones; the new are not known yet."""
    fresh = unknown_spreads(design)
    fresh.run[: old.spreads.run.size] = old.spreads.run
    return Spreads(
        fresh.run, old.spreads.scenario if old.spreads.scenario.size == fresh.scenario.size else fresh.scenario
    )


def _in_order(current: AxisFit, order: dict[str, int], chosen: bool) -> AxisFit:
    """The terms in the model's order; where some were ``chosen`` one by one, the noise is fitted anew beside all of them."""
    terms = sorted(current.design.terms, key=lambda t: order[t.effect_id])
    if list(current.design.terms) == terms and not (chosen and current.design.noise_model.components):
        return current
    design = current.design.changed(terms)
    return fit_noise(design, start=with_noise(design, current.noise, unknown_spreads(design)))


def with_noise(design: Design, noise: Noise, spreads: Spreads) -> AxisFit:
    """A fit at given noise: spreads by REML on the Grams, no filtering again."""
    grams, logdet = design.grams(noise)
    n = int(design.n_blocks.sum())
    spreads = fit_spreads(design, grams, logdet, design.scenarios, n, spreads)
    solution = solve(design.layout, grams, logdet, design.scenarios, n, spreads)
    return AxisFit(design, noise, spreads, solution, design.terms, grams, logdet)


def white_start(design: Design) -> float:
    """One sample's white noise from the scatter within blocks."""
    ss = sum(b.within_ss[design.axis] for b in design.blocks)
    n = sum(b.within_n for b in design.blocks)
    if n >= 10:
        return max(float(np.sqrt(ss / n)), LEAST_WHITE_DPS)
    jumps = np.concatenate([np.diff(b.y_dps[:, design.axis]) for b in design.blocks])
    return float(max(np.sqrt(np.mean(jumps**2) / 2) if jumps.size else 0.0, LEAST_WHITE_DPS))


def _drifts(design: Design) -> bool:
    """Has the model a drift, and are the runs long enough to show one?"""
    longest_s, block_s = design.extent_s
    return design.noise_model.drift is not None and longest_s > 10 * block_s


def _first_noise(design: Design) -> Noise:
    """Where the search for the noise begins."""
    white0 = white_start(design)
    return Noise(white0, white0 / 10, 20.0) if _drifts(design) else Noise(white0)


def fit_noise(design: Design, start: AxisFit | None = None) -> AxisFit:
    """REML of white level, drift and spreads together."""
    white0 = white_start(design)
    n = int(design.n_blocks.sum())
    longest_s, block_s = design.extent_s
    drift = _drifts(design)
    slow_s = max(SLOW_S, 5 * block_s)
    if start is None:
        start = with_noise(design, _first_noise(design), unknown_spreads(design))
    # a drift of this spread moves a mean over SLOW_S as white noise does
    unit = white0 / np.sqrt(SLOW_S / block_s * max(1.0, float(np.median(np.concatenate([b.n for b in design.blocks])))))
    lows, highs = [np.log(white0) - 0.2], [np.log(white0) + 3.0]
    x0 = [np.log(start.noise.white_sd_dps)]
    if drift:
        lows += [NO_SPREAD, np.log(slow_s)]
        highs += [np.log1p((150 * white0 / unit) ** 2), np.log(max(4 * slow_s, 5 * longest_s))]
        size = start.noise.ou_sd_dps / unit * white0 / start.noise.white_sd_dps
        x0 += [np.log1p(size**2), np.log(start.noise.ou_tau_s)]
        x0[1] = max(x0[1], float(np.log(2.0)))  # no drift in the poorer model may be one in the richer
    m, k = len(x0), start.spreads.run.size
    scale = SpreadScale.of(design, start.grams)
    cache: dict[bytes, tuple[Array, Array]] = {}

    def noise_at(x: Array) -> Noise:
        times = float(np.exp(x[0])) / white0  # the drift's size is relative to the white level: one scale for all noise
        if not drift:
            return Noise(times * white0)
        return Noise(times * white0, times * float(unit * np.sqrt(np.expm1(x[1]))), float(np.exp(x[2])))

    def grams_at(x: Array) -> tuple[Array, Array]:
        key = x[1:m].tobytes()
        if key not in cache:
            if len(cache) > 8:
                cache.clear()
            cache[key] = design.grams(noise_at(np.concatenate([[np.log(white0)], x[1:]])))
        grams, logdet = cache[key]
        log_times = float(x[0] - np.log(white0))
        return grams * np.exp(-2 * log_times), logdet + 2 * log_times * design.n_blocks

    def loglik(x: Array) -> tuple[float, Array]:
        sd = scale.spreads(x[m:])
        spreads = Spreads(sd[:k], sd[k:])
        solution, slopes = solve_with_slopes(design.layout, *grams_at(x), design.scenarios, n, spreads)
        of_noise = np.zeros(m)
        for j in range(m):
            step = np.zeros_like(x)
            step[j] = STEP
            moved = solve(design.layout, *grams_at(x + step), design.scenarios, n, spreads)
            of_noise[j] = (moved.loglik - solution.loglik) / STEP
        return solution.loglik, np.concatenate([of_noise, scale.slopes(x[m:], slopes)])

    begin = np.concatenate([
        np.clip(x0, lows, highs), scale.coordinates(np.concatenate([start.spreads.run, start.spreads.scenario]))
    ])  # fmt: skip
    x = maximise(loglik, begin, [*zip(lows, highs, strict=True), *scale.bounds], n)
    noise, sd = noise_at(x), scale.settled(x[m:])
    if drift and x[1] < 10 * NO_SPREAD:
        noise = replace(noise, ou_sd_dps=0.0)
    grams, logdet = design.grams(noise)
    spreads = Spreads(sd[:k], sd[k:])
    solution = solve(design.layout, grams, logdet, design.scenarios, n, spreads)
    return AxisFit(design, noise, spreads, solution, design.terms, grams, logdet)


def refine(current: AxisFit) -> AxisFit:
    """Nonlinear parameters at fixed noise, one term at a time, then the noise again."""
    from scipy.optimize import minimize

    moved = False
    for i, term in enumerate(current.design.terms):
        names = [n for n in term.effect.nonlinear if n in term.values]
        if not names or term.of_run:
            continue
        base = current
        bounds = [np.log(term.effect.parameter(name).search_range) for name in names]
        x0 = np.array([np.clip(np.log(term.values[n]), *b) for n, b in zip(names, bounds, strict=True)])

        def at(x: Array, i: int = i, names: list[str] = names, base: AxisFit = base) -> AxisFit:
            values = dict(zip(names, map(float, np.exp(x)), strict=True))
            return with_noise(_with_values(base, i, values), base.noise, base.spreads)

        runs = [b.run for b in current.design.blocks]
        steps = [term.effect.step(name, term.values, runs) for name in names]
        simplex = np.vstack([x0, *(x0 + np.diag(steps))])

        def cost(x: Array, at: Callable[[Array], AxisFit] = at) -> float:
            return -at(x).loglik

        found = minimize(
            cost, x0, method="Nelder-Mead", bounds=bounds,
            options={"xatol": 3e-3 * min(steps), "fatol": 1e-3, "maxfev": 40 * len(names), "initial_simplex": simplex},
        )  # fmt: skip
        better = at(found.x)
        if better.loglik > current.loglik:
            current, moved = better, True
    return fit_noise(current.design, start=current) if moved else current


def runs_apart(current: AxisFit) -> AxisFit:
    """Let a nonlinear parameter be each run's own, where that is worth it (the time constant of a transient, say).

    Empirical Bayes: the likelihood of each run on a grid of values, all else as fitted; a Gaussian in the logarithm for what
    the runs have in common, by expectation maximisation; each run is then given its posterior mean.
    """
    for i, term in enumerate(current.design.terms):
        name = term.spreadable
        for round_ in range(APART_ROUNDS if name is not None else 0):
            assert name is not None
            middle = current.design.terms[i].values[name]
            values = middle * np.exp(np.log(APART_RATIO) * np.linspace(-1, 1, APART_GRID))
            trials = [_with_values(current, i, {name: float(v)}) for v in values]
            logliks = np.column_stack([_each_run(current, trial) for trial in trials])
            log_mean, log_sd, weight, gain = _common(np.log(values), logliks)
            if not current.design.terms[i].of_run and gain < APART_GAIN:
                break
            mean, count = float(np.exp(log_mean)), len(logliks)
            sd = mean * log_sd
            own = np.exp(weight @ np.log(values))
            of_run = {b.run.index: {name: float(v)} for b, v in zip(current.design.blocks, own, strict=True)}
            terms = list(current.design.terms)
            terms[i] = replace(
                term, values={**term.values, name: mean, f"{name}_sd": sd},
                se={name: sd / count**0.5, f"{name}_sd": sd / (2 * count) ** 0.5}, of_run=of_run,
            )  # fmt: skip
            design = current.design.changed(terms)
            drift = [current.noise, *([_first_noise(design)] if round_ == 0 else [])]  # what was drift may be one no longer
            fits = [fit_noise(design, start=with_noise(design, noise, current.spreads)) for noise in drift]
            current = max(fits, key=lambda f: f.loglik)
            if abs(mean - middle) < APART_SETTLED * sd / count**0.5:
                break
    return current


def _with_values(current: AxisFit, i: int, values: Values) -> Design:
    """The design with other values of one term, the same in all runs."""
    terms = list(current.design.terms)
    terms[i] = replace(terms[i], values={**terms[i].values, **values}, of_run={})
    return current.design.changed(terms)


def _each_run(current: AxisFit, design: Design) -> Array:
    """Log-likelihood of each run [runs] by itself under another design, shared parameters, noise and spreads as fitted."""
    layout, spreads = design.layout, current.spreads
    grams, logdet = design.grams(current.noise)
    integrated = integrate(grams, layout.random, np.arange(1 + len(layout.fixed)), spreads.of(layout))
    residual = np.concatenate([[1.0], -current.solution.beta])
    chi2 = np.einsum("i,rij,j->r", residual, integrated.grams, residual)
    return np.asarray(-0.5 * (logdet + integrated.logdet + chi2))


def _common(log_values: Array, logliks: Array) -> tuple[float, float, Array, float]:
    """Mean and spread of a logarithm over the runs from each run's log-likelihood [runs, grid].

    Also each run's posterior weights, and what the spread gains in log-likelihood over the grid's middle for all.
    """
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
    return log_mean, log_sd, weight, float(evidence.sum() - logliks[:, log_values.size // 2].sum())


def finish(current: AxisFit) -> AxisFit:
    """Name the parameters and their standard errors."""
    layout, design = current.design.layout, current.design
    run_se, scenario_se = _spread_errors(current)
    terms = []
    for i, term in enumerate(design.terms):
        kind = term.effect
        values: Values = {n: v for n, v in kind.structure(term.values).items() if n not in kind.linear}
        se: Values = {}
        if term.of_run:
            values |= {n: v for n, v in term.values.items() if n in term.se}
            se |= term.se
        mine = [j for j, (t, _) in enumerate(layout.fixed) if t == i]
        if term.fault is not None:
            values, se = dict(term.values), dict(term.se)
        if mine:
            shared, shared_se = _named(term, current, mine)
            values.update(shared)
            se.update(shared_se)
        own = [j for j, (t, _) in enumerate(layout.run) if t == i]
        if own:
            groups = [layout.run_group[j] for j in own]
            values.update(kind.named_spread(current.spreads.run[groups], term.values))
            se.update(kind.named_spread(run_se[groups], term.values))
        se.update(_nonlinear_errors(current, i))
        terms.append(replace(term, values=values, se=se))
    return replace(current, terms=tuple(terms), noise_model=_fitted_noise(current, scenario_se))


def _fitted_noise(current: AxisFit, scenario_se: Array) -> AxisNoise:
    """The noise as fitted, with the standard errors of the spreads over power cycles."""
    wanted, fitted = current.design.noise_model, AxisNoise(current.noise.white_sd_dps)
    if wanted.drift is not None:
        fitted = fitted.having(Drift(current.noise.ou_sd_dps, current.noise.ou_tau_s))
    if wanted.turn_on_bias is not None:
        known = np.unique(current.design.scenarios).size >= LEAST_SCENARIOS
        se = {"sd_dps": current._scenario_sd(scenario_se, Role.BIAS)}
        fitted = fitted.having(TurnOnBias(current.turn_on_sd_dps, se=se) if known else TurnOnBias())
    if len(current.design.layout.scenario) > 1:
        sd, sd_se = (current._scenario_sd(of, Role.SCALE) for of in (current.spreads.scenario, scenario_se))
        fitted = replace(fitted, turn_on_scale=TurnOnScale(sd, sd_se))
    return fitted


def _named(term: Term, current: AxisFit, mine: list[int]) -> tuple[Values, Values]:
    """A term's shared parameters by name, and their errors by propagation; those that are not identified are left out."""
    kind, layout = term.effect, current.design.layout
    index = [layout.fixed[j][1] for j in mine]
    beta = np.full(max(len(kind.groups(term.values)), max(index) + 1), np.nan)
    beta[index] = current.solution.beta[mine]
    cov = current.solution.cov[np.ix_(mine, mine)]
    values = {n: v for n, v in kind.named(beta, term.values).items() if np.isfinite(v)}
    slopes = np.zeros((len(values), len(mine)))
    for k, j in enumerate(index):
        moved = beta.copy()
        step = 1e-3 * float(np.sqrt(cov[k, k]))
        moved[j] += step
        changed = kind.named(moved, term.values)
        slopes[:, k] = [(changed[n] - v) / step for n, v in values.items()]
    errors = np.sqrt(np.maximum(np.einsum("ik,kl,il->i", slopes, cov, slopes), 0.0))
    return values, dict(zip(values, map(float, errors), strict=True))


def _spread_errors(current: AxisFit) -> tuple[Array, Array]:
    """Standard errors of the spreads: from the curvature of REML's log-likelihood in their logarithm.

    Of a spread that vanishes, or that has no curvature, the size at which the log-likelihood has fallen by a half.
    """
    sd = np.concatenate([current.spreads.run, current.spreads.scenario])
    k = current.spreads.run.size
    everything = np.ones(len(current.design.blocks), dtype=bool)
    unit = SpreadScale.of(current.design, current.grams).unit

    def loglik(j: int, value: float) -> float:
        trial = sd.copy()
        trial[j] = value
        return current.subset(everything, Spreads(trial[:k], trial[k:])).loglik

    out = np.full(sd.size, np.nan)
    step = 0.1
    for j in np.flatnonzero(unit > 0).tolist():
        lower, upper = (loglik(j, sd[j] * float(np.exp(sign))) for sign in (-step, step))
        curvature = (2 * current.loglik - lower - upper) / step**2
        if sd[j] > 0 and curvature > 0.05:
            out[j] = sd[j] / np.sqrt(curvature)
            continue
        low, high = np.log(1e-3 * unit[j]), np.log(1e3 * unit[j])
        for _ in range(12):
            middle = (low + high) / 2
            fallen = current.loglik - loglik(j, float(np.hypot(sd[j], np.exp(middle)))) > 0.5
            low, high = (low, middle) if fallen else (middle, high)
        out[j] = np.exp(high)
    return out[:k], out[k:]


def _nonlinear_errors(current: AxisFit, i: int) -> Values:
    term = current.design.terms[i]
    errors: Values = {}
    if term.of_run:
        return errors
    runs = [b.run for b in current.design.blocks]
    for name in term.effect.nonlinear:
        if name not in term.values:
            continue
        step = term.effect.step(name, term.values, runs) / 6
        ends = []
        for sign in (-step, step):
            moved = _with_values(current, i, {name: term.values[name] * float(np.exp(sign))})
            ends.append(with_noise(moved, current.noise, current.spreads).loglik)
        curvature = (2 * current.loglik - ends[0] - ends[1]) / step**2
        errors[name] = float(term.values[name] / np.sqrt(curvature)) if curvature > 0 else float("nan")
    return errors
