"""Generalised least squares of any list of effects, jointly with the noise, by restricted maximum likelihood (REML).

Per axis, on block means: ``y = X·beta + Z_run·u + Z_scenario·v + drift + white``. ``beta`` are the parameters that all runs
share; ``u`` coefficients of a run's own (a phase, an onset), random with spreads that are estimated; ``v`` the offset (and
scale) of a power cycle. Whitened normal equations ("Grams") of each run are computed once for a noise level; all the rest,
spreads, held-out runs, competing models, is algebra on these small matrices.

Reference: Harville, J. Am. Stat. Assoc. 72 (1977) 320, for REML in mixed linear models.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gyrocal.blocks import Blocks, reduce_run, reduce_session
from gyrocal.effects.base import Values
from gyrocal.errors import InputError
from gyrocal.model import Model, Term
from gyrocal.noise import Noise, normal_equations
from gyrocal.session import AXES, Array, Session
from gyrocal.threads import one_thread

Progress = Callable[[str], None]
Mask = np.ndarray[Any, np.dtype[np.bool_]]
Index = np.ndarray[Any, np.dtype[np.signedinteger[Any]]]

UNIDENTIFIED = 1e-7
"""A column with less of its (whitened, squared) norm left after the others cannot be told from them."""

SLOW_S = 4.0
"""Drift is slower than this: a bias wanders over many seconds. Anything faster is a signal for the tests of whiteness."""

TOLERANCE = 1e-3
"""Log-likelihood to which noise and spreads are found, about: the optimiser stops at this over the number of blocks."""
LEAST_WHITE_DPS = 1e-5
"""No reading is less noisy than this: a thousandth of a count."""
STEP = 1e-4
"""Of logarithms, for numerical gradients: far above the likelihood's rounding."""
LEAST_SCENARIOS = 3
"""Fewer power cycles say nothing of their spread."""


@dataclass(frozen=True)
class Layout:
    """Which column belongs to which term: ``fixed`` and ``run`` hold (term index, column within the term)."""

    fixed: tuple[tuple[int, int], ...]
    run: tuple[tuple[int, int], ...]
    run_group: tuple[int, ...]
    scenario: tuple[int, ...]
    """Fixed columns that also vary, at random, from scenario to scenario."""

    @property
    def n_groups(self) -> int:
        return max(self.run_group, default=-1) + 1


class Design:
    """Block-mean regressors of one axis for a list of terms: ``[y | fixed | run]`` for each run."""

    def __init__(self, blocks: Sequence[Blocks], axis: int, terms: Sequence[Term]) -> None:
        self.axis = axis
        self.terms = tuple(terms)
        self.blocks = [self._usable(b) for b in blocks]
        runs = [b.run for b in blocks]
        self.scopes = [term.effect.scope_in(runs) for term in terms]
        self.layout, self.stacks = self._build()

    def _usable(self, b: Blocks) -> Blocks:
        """The blocks of a run without samples that a fault of the reading has emptied of meaning."""
        for term in self.terms:
            fault = term.effect.reading_fault and term.values
            usable = term.effect.usable(b.run, self.axis, term.values) if fault else None
            if usable is not None and b.t_s.size:
                whole = b.mean(usable[:, None].astype(float))[:, 0] == 1.0
                b = b.select(whole) if not whole.all() else b
        return b

    def _build(self) -> tuple[Layout, list[tuple[list[int], Array, Array, Array]]]:
        fixed: list[tuple[int, int]] = []
        run: list[tuple[int, int]] = []
        group: list[int] = []
        n_groups = 0
        random_ids = {t.effect_id for t in self.terms}
        for i, term in enumerate(self.terms):
            kind = term.effect
            k = len(kind.groups(term.values)) if term.values or kind.nonlinear else len(kind.linear)
            scope = self.scopes[i]
            if scope == "scenario" or kind.reading_fault:
                continue
            if scope == "session" or kind.common_mean:
                fixed += [(i, j) for j in range(k)]
            if scope == "run" and k:
                run += [(i, j) for j in range(k)]
                group += [n_groups + g for g in kind.groups(term.values)]
                n_groups = max(group) + 1
        matrices = [self._matrix(b, fixed, run) for b in self.blocks]
        kept = self._identified(matrices, fixed)
        fixed = [f for f, keep in zip(fixed, kept, strict=True) if keep]
        columns = [0, *(1 + j for j, keep in enumerate(kept) if keep), *range(1 + kept.size, 1 + kept.size + len(run))]
        matrices = [m[:, columns] for m in matrices]
        scenario = [j for j, (i, _) in enumerate(fixed) if self._varies(self.terms[i].effect_id, random_ids)]
        layout = Layout(tuple(fixed), tuple(run), tuple(group), tuple(scenario))
        return layout, self._stack(matrices)

    def _varies(self, effect_id: str, ids: set[str]) -> bool:
        if "turn_on_bias" not in ids:
            return False
        return effect_id == "bias" or (effect_id == "scale" and self._scale_within_scenarios)

    @cached_property
    def _scale_within_scenarios(self) -> bool:
        """Two or more scenarios that each hold two true rates: their scales can be told apart one by one."""
        rates: dict[int, set[float]] = {}
        for b in self.blocks:
            on_axis = b.run.axis_index == self.axis
            rates.setdefault(b.scenario, set()).add(round(float(np.mean(b.run.rate_dps)), 3) if on_axis else 0.0)
        return len(rates) >= LEAST_SCENARIOS and all(len(r) > 1 for r in rates.values())

    def _matrix(self, b: Blocks, fixed: Sequence[tuple[int, int]], run: Sequence[tuple[int, int]]) -> Array:
        per_term = self.sample_columns(b)
        means = {i: b.mean(c) for i, c in per_term.items() if c.shape[1]}
        columns = [b.y_dps[:, self.axis]] + [means[i][:, j] for i, j in (*fixed, *run)]
        return np.column_stack(columns)

    def sample_columns(self, b: Blocks) -> dict[int, Array]:
        """Each term's columns at every sample of a run, by the term's index."""
        return {
            i: term.effect.columns(b.run, self.axis, term.values or dict.fromkeys(term.effect.linear, 0.0))
            for i, term in enumerate(self.terms)
            if term.effect_id != "colored_noise"
        }

    def _identified(self, matrices: Sequence[Array], fixed: Sequence[tuple[int, int]]) -> Mask:
        """Keep a column only if something of it is left when the ones before it are taken out."""
        p = len(fixed)
        gram = sum(
            m[:, 1 : 1 + p].T @ (m[:, 1 : 1 + p] * b.n[:, None]) for m, b in zip(matrices, self.blocks, strict=True)
        )
        gram = np.atleast_2d(np.asarray(gram))
        keep = np.zeros(p, dtype=bool)
        for j in range(p):
            norm = gram[j, j]
            if norm <= 0:
                continue
            rest = norm
            if keep.any():
                others = np.flatnonzero(keep)
                solved = np.linalg.lstsq(gram[np.ix_(others, others)], gram[others, j], rcond=None)[0]
                rest = norm - gram[others, j] @ solved
            keep[j] = rest > UNIDENTIFIED * norm
        return keep

    def _stack(self, matrices: Sequence[Array]) -> list[tuple[list[int], Array, Array, Array]]:
        """Runs that share their blocks' times are filtered side by side: (run indices, [r, q, m], t_s, n)."""
        stacks: dict[Any, list[int]] = {}
        for i, b in enumerate(self.blocks):
            if not b.t_s.size:
                continue
            steps = np.diff(b.t_s)
            even = b.t_s.size > 2 and np.ptp(b.n) == 0 and np.ptp(steps) <= 1e-3 * steps.mean()
            key = (b.t_s.size, float(b.n[0]), round(float(b.t_s[-1] - b.t_s[0]), 3)) if even else i
            stacks.setdefault(key, []).append(i)
        out = []
        for index in stacks.values():
            first = self.blocks[index[0]]
            out.append((index, np.stack([np.ascontiguousarray(matrices[i].T) for i in index]), first.t_s, first.n))
        return out

    def grams(self, noise: Noise) -> tuple[Array, Array]:
        """Whitened normal equations of each run, shape [runs, q, q], and log-determinants [runs]."""
        q = 1 + len(self.layout.fixed) + len(self.layout.run)
        grams = np.zeros((len(self.blocks), q, q))
        logdet = np.zeros(len(self.blocks))
        for index, stack, t_s, n in self.stacks:
            grams[index], logdet[index] = normal_equations(stack, t_s, n, noise)
        return grams, logdet

    @property
    def scenarios(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        return np.array([b.scenario for b in self.blocks], dtype=np.intp)

    @property
    def n_blocks(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        return np.array([b.t_s.size for b in self.blocks], dtype=np.intp)

    def column_rms(self) -> Array:
        """Root mean square of each column [q] over all blocks: the natural scale of its coefficient."""
        total = np.zeros(1 + len(self.layout.fixed) + len(self.layout.run))
        for _, stack, _, _ in self.stacks:
            total += (stack**2).sum(axis=(0, 2))
        return np.sqrt(total / max(1, int(self.n_blocks.sum()))) + 1e-300


@dataclass(frozen=True)
class Spreads:
    """Standard deviations of random coefficients: of each run group, and of each scenario-random column."""

    run: Array
    scenario: Array


@dataclass(frozen=True)
class Solution:
    """What the Grams say under given spreads: REML log-likelihood, ``beta`` [p], its covariance [p, p], chi-square."""

    loglik: float
    beta: Array
    cov: Array
    chi2: float


def eliminate(gram: Array, index: Index, keep: Index, sd: Array) -> tuple[Array, Array]:
    """Integrate out coefficients ``~ N(0, sd^2)`` of columns ``index``; Grams of columns ``keep`` and log-determinants."""
    b = sd[:, None] * gram[..., index, :][..., keep]
    m = np.eye(index.size) + sd[:, None] * gram[..., index, :][..., index] * sd
    chol = np.linalg.cholesky(m)
    half = np.linalg.solve(chol, b)
    logdet = 2 * np.log(np.diagonal(chol, axis1=-2, axis2=-1)).sum(axis=-1)
    return gram[..., keep, :][..., keep] - half.swapaxes(-1, -2) @ half, logdet


def solve(layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int, spreads: Spreads) -> Solution:
    """Integrate out the random coefficients, solve for the shared ones."""
    p = len(layout.fixed)
    total_logdet = float(logdet.sum())
    keep = np.arange(1 + p)
    if layout.run:
        index = np.arange(1 + p, grams.shape[-1])
        grams, ld = eliminate(grams, index, keep, spreads.run[list(layout.run_group)])
        total_logdet += float(ld.sum())
    if layout.scenario:
        names, inverse = np.unique(scenarios, return_inverse=True)
        summed = np.zeros((names.size, 1 + p, 1 + p))
        np.add.at(summed, inverse, grams)
        index = np.array(layout.scenario) + 1
        grams, ld = eliminate(summed, index, keep, spreads.scenario)
        total_logdet += float(ld.sum())
    total = grams.sum(axis=0)
    if p == 0:
        return Solution(
            -0.5 * (total_logdet + total[0, 0] + n * np.log(2 * np.pi)), np.zeros(0), np.zeros((0, 0)), total[0, 0]
        )
    h, g = total[1:, 1:], total[1:, 0]
    scale = np.sqrt(np.maximum(np.diag(h), 1e-300))
    try:
        chol = np.linalg.cholesky(h / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return Solution(-np.inf, np.full(p, np.nan), np.full((p, p), np.nan), np.nan)
    half = np.linalg.solve(chol, g / scale)
    inverse_chol = np.linalg.inv(chol)
    cov = (inverse_chol.T @ inverse_chol) / np.outer(scale, scale)
    beta = inverse_chol.T @ half / scale
    chi2 = float(total[0, 0] - half @ half)
    logdet_h = 2 * float(np.log(np.diag(chol)).sum() + np.log(scale).sum())
    loglik = -0.5 * (total_logdet + logdet_h + chi2 + (n - p) * np.log(2 * np.pi))
    return Solution(loglik, beta, cov, chi2)


@dataclass(frozen=True)
class AxisFit:
    """A fitted axis. ``terms`` carry values and standard errors; ``loglik`` is REML's."""

    design: Design
    noise: Noise
    spreads: Spreads
    solution: Solution
    terms: tuple[Term, ...]
    grams: Array = field(repr=False)
    logdet: Array = field(repr=False)

    @property
    def loglik(self) -> float:
        return self.solution.loglik

    @property
    def turn_on_sd_dps(self) -> float:
        """Spread of the bias over power cycles, deg/s."""
        return self._scenario_sd(self.spreads.scenario, "bias")

    @property
    def slow_power(self) -> float:
        """Mean square, dps^2, of drift and turn-on bias: the floor's slow part."""
        return self.noise.ou_sd_dps**2 + self.turn_on_sd_dps**2

    @property
    def scale_spread_dps(self) -> float:
        """rms, deg/s, of the scale's own spread from power cycle to power cycle; it is no part of the floor."""
        scale_sd = self._scenario_sd(self.spreads.scenario, "scale")
        rates = [
            float(np.mean(b.run.rate_dps**2)) if b.run.axis_index == self.design.axis else 0.0 for b in self.design.blocks
        ]
        samples = [len(b.run) for b in self.design.blocks]
        rate_power = float(np.average(rates, weights=samples))
        return scale_sd * float(np.sqrt(rate_power))

    def _scenario_sd(self, of: Array, effect_id: str) -> float:
        for k, j in enumerate(self.design.layout.scenario):
            if self.design.terms[self.design.layout.fixed[j][0]].effect_id == effect_id:
                return float(np.nan_to_num(of[k]))
        return 0.0

    def subset(self, runs: Mask, spreads: Spreads | None = None) -> Solution:
        """The solution from some of the runs."""
        return solve(
            self.design.layout, self.grams[runs], self.logdet[runs], self.design.scenarios[runs],
            int(self.design.n_blocks[runs].sum()), spreads or self.spreads,
        )  # fmt: skip

    def spreads_without(self, held_out: Mask) -> Spreads:
        """Spreads estimated again from the runs that are not held out."""
        kept = ~held_out
        return fit_spreads(
            self.design, self.grams[kept], self.logdet[kept], self.design.scenarios[kept],
            int(self.design.n_blocks[kept].sum()), self.spreads,
        )  # fmt: skip

    def run_coefficients(self, run: int, beta: Array, spreads: Spreads) -> Array:
        """Posterior mean of a run's own random coefficients [k], given shared ``beta``; its scenario's offset is free too."""
        layout = self.design.layout
        if not layout.run:
            return np.zeros(0)
        p = len(layout.fixed)
        extra = np.array(layout.scenario, dtype=np.intp) + 1
        random = np.concatenate([np.arange(1 + p, self.grams.shape[-1]), extra]).astype(np.intp)
        sd = np.concatenate([spreads.run[list(layout.run_group)], spreads.scenario])
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


@one_thread
def fit(
    session: Session, model: Model, *, blocks: list[Blocks] | None = None, axes: Iterable[str] = AXES,
    progress: Progress | None = None,
) -> Fit:  # fmt: skip
    """Fit a model's terms and noise to a session; the model returned carries values and standard errors."""
    reduced = reduce_session(session) if blocks is None else blocks
    fitted: dict[str, AxisFit] = {}
    for axis in axes:
        if not model.on(axis):
            continue
        if progress is not None:
            progress(f"fitting {axis}")
        fitted[axis] = fit_axis(reduced, AXES.index(axis), model.on(axis), white_sd_dps=model.white_sd_dps.get(axis))
    terms = {(t.effect_id, t.axis): t for a in fitted.values() for t in a.terms}
    white = {axis: a.noise.white_sd_dps for axis, a in fitted.items()}
    result = Model(model.name, tuple(terms.get((t.effect_id, t.axis), t) for t in model.terms), white)
    return Fit(session, reduced, result, fitted)


def fit_axis(
    blocks: Sequence[Blocks], axis: int, terms: Sequence[Term], *, white_sd_dps: float | None = None
) -> AxisFit:
    """Fit one axis: structure and nonlinear parameters by grid and refinement, noise and spreads by REML."""
    terms = [_prepared(t, blocks, axis) for t in terms]
    if any(t.effect.fast for t in terms):
        blocks = by_sample(blocks)
    pending = [i for i, t in enumerate(terms) if _needs_choice(t)]
    settled = [t for i, t in enumerate(terms) if i not in pending]
    current = fit_noise(Design(blocks, axis, settled))
    for i in pending:
        current = choose_variant(current, terms[i])
    order = {t.effect_id: i for i, t in enumerate(terms)}
    current = _reordered(current, order)
    return finish(refine(current))


def choose_variant(current: AxisFit, term: Term) -> AxisFit:
    """Add a term whose structure or nonlinear parameters are open: try its variants, keep the best by BIC, fit the noise."""
    noise, chosen = current.noise, None
    for _ in range(3):  # drift swallows what it was fitted without: judge again at the noise fitted with the choice
        values = _likeliest(current, term, noise)
        if values == chosen:
            break
        chosen = values
        terms = [*current.design.terms, replace(term, values=values)]
        design = Design(current.design.blocks, current.design.axis, terms)
        fitted = fit_noise(design, start=with_noise(design, noise, carry_spreads(current, design)))
        noise = fitted.noise
    return fitted


def _likeliest(current: AxisFit, term: Term, noise: Noise) -> Values:
    """The variant with the best BIC at a given noise."""
    runs = [b.run for b in current.design.blocks]
    count = int(current.design.n_blocks.sum())
    best: tuple[float, Values] | None = None
    for values in term.effect.variants(runs, current.design.axis):
        terms = [*current.design.terms, replace(term, values=values)]
        design = Design(current.design.blocks, current.design.axis, terms)
        trial = with_noise(design, noise, carry_spreads(current, design))
        parameters = len(trial.design.layout.fixed) + trial.design.layout.n_groups + len(term.effect.nonlinear)
        score = profile_loglik(trial) - 0.5 * np.log(count) * parameters
        if best is None or score > best[0]:
            best = (score, values)
    if best is None:
        raise InputError(f"effect {term.effect_id}: nothing to try on this session")
    return best[1]


def null_loglik(current: AxisFit, fitted: AxisFit) -> float:
    """Profile log-likelihood without the candidate: at the model's own noise or the candidate's, whichever suits it."""
    return max(profile_loglik(current), profile_loglik(with_noise(current.design, fitted.noise, current.spreads)))


def profile_loglik(fitted: AxisFit) -> float:
    """Log-likelihood at the fitted noise, shared parameters at their best: comparable between models (REML's is not)."""
    chol = np.linalg.slogdet(np.linalg.inv(fitted.solution.cov))[1] if fitted.solution.beta.size else 0.0
    return fitted.loglik + 0.5 * float(chol) - 0.5 * fitted.solution.beta.size * float(np.log(2 * np.pi))


def by_sample(blocks: Sequence[Blocks]) -> list[Blocks]:
    """The same runs with each sample a block of its own: for what varies from sample to sample."""
    return [b if b.run.rate_is_mean else reduce_run(b.run, b.scenario, 0.0) for b in blocks]


def _prepared(term: Term, blocks: Sequence[Blocks], axis: int) -> Term:
    kind = term.effect
    if kind.reading_fault and not term.values:
        found = kind.detect([b.run for b in blocks], axis)
        return term if found is None else replace(term, values=found[0], se=found[1])
    if kind.scope == "session" and not kind.nonlinear and not term.values and len(kind.variants([], 0)) == 1:
        return replace(term, values=dict.fromkeys(kind.linear, 0.0))
    return term


def _needs_choice(term: Term) -> bool:
    kind = term.effect
    open_terms = not term.values and kind.scope != "scenario" and not kind.reading_fault
    return open_terms and term.effect_id != "colored_noise"


def carry_spreads(old: AxisFit, design: Design) -> Spreads:
    """Spreads for a design with one more term: the old ones, and a starting value for the new."""
    fresh = _start_spreads(design, old.noise)
    fresh.run[: old.spreads.run.size] = old.spreads.run
    return Spreads(
        fresh.run, old.spreads.scenario if old.spreads.scenario.size == fresh.scenario.size else fresh.scenario
    )


def _reordered(current: AxisFit, order: dict[str, int]) -> AxisFit:
    terms = sorted(current.design.terms, key=lambda t: order[t.effect_id])
    if list(current.design.terms) == terms:
        return current
    design = Design(current.design.blocks, current.design.axis, terms)
    return fit_noise(design, start=with_noise(design, current.noise, _start_spreads(design, current.noise)))


def _random_rms(design: Design) -> tuple[Array, Array]:
    rms = design.column_rms()
    p = len(design.layout.fixed)
    run = np.array([
        np.mean([rms[1 + p + j] for j, g in enumerate(design.layout.run_group) if g == group])
        for group in range(design.layout.n_groups)
    ])  # fmt: skip
    return run, rms[np.array(design.layout.scenario, dtype=np.intp) + 1]


def _start_spreads(design: Design, noise: Noise) -> Spreads:
    run, scenario = _random_rms(design)
    size = max(noise.white_sd_dps / 5, 1e-6)
    return Spreads(size / run, size / scenario)


def with_noise(design: Design, noise: Noise, spreads: Spreads) -> AxisFit:
    """A fit at given noise: spreads by REML on the Grams, no filtering again."""
    grams, logdet = design.grams(noise)
    n = int(design.n_blocks.sum())
    spreads = fit_spreads(design, grams, logdet, design.scenarios, n, spreads)
    solution = solve(design.layout, grams, logdet, design.scenarios, n, spreads)
    return AxisFit(design, noise, spreads, solution, design.terms, grams, logdet)


def fit_spreads(design: Design, grams: Array, logdet: Array, scenarios: Index, n: int, start: Spreads) -> Spreads:
    """REML of the spreads alone."""
    from scipy.optimize import minimize

    k = start.run.size
    if k + start.scenario.size == 0:
        return start
    rms = np.concatenate(_random_rms(design))
    low, high = np.log(1e-6 / rms), np.log(_largest_dps(design) / rms)
    x0 = np.clip(np.log(np.maximum(np.concatenate([start.run, start.scenario]), 1e-300)), low + 3.0, high)

    def objective(x: Array) -> float:
        sd = np.exp(x)
        value = -solve(design.layout, grams, logdet, scenarios, n, Spreads(sd[:k], sd[k:])).loglik
        return value if np.isfinite(value) else 1e300

    found = minimize(
        objective,
        x0,
        method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)),
        options={"maxiter": 60, "ftol": TOLERANCE / max(n, 1), "eps": STEP},
    )
    sd = np.exp(np.minimum(found.x, high))
    sd[found.x < low + 1.0] = 0.0
    return Spreads(sd[:k], sd[k:])


def _largest_dps(design: Design) -> float:
    """Ten times what the readings themselves stray: no random term is larger."""
    return 10 * float(design.column_rms()[0]) + 1e-3


def white_start(design: Design) -> float:
    """One sample's white noise from the scatter within blocks."""
    ss = sum(b.within_ss[design.axis] for b in design.blocks)
    n = sum(b.within_n for b in design.blocks)
    if n >= 10:
        return max(float(np.sqrt(ss / n)), LEAST_WHITE_DPS)
    jumps = np.concatenate([np.diff(b.y_dps[:, design.axis]) for b in design.blocks])
    return float(max(np.sqrt(np.mean(jumps**2) / 2) if jumps.size else 0.0, LEAST_WHITE_DPS))


def fit_noise(design: Design, start: AxisFit | None = None) -> AxisFit:
    """REML of white level, drift and spreads together."""
    from scipy.optimize import minimize

    white0 = white_start(design)
    given = next((t for t in design.terms if t.effect_id == "colored_noise"), None)
    spreads0 = start.spreads if start is not None else _start_spreads(design, Noise(white0))
    rms = np.concatenate(_random_rms(design)) if spreads0.run.size + spreads0.scenario.size else np.zeros(0)
    n = int(design.n_blocks.sum())
    longest_s = max(float(b.t_s[-1] - b.t_s[0]) for b in design.blocks if b.t_s.size)
    block_s = min((float(np.median(np.diff(b.t_s))) for b in design.blocks if b.t_s.size > 1), default=1.0)
    drift = given is not None and longest_s > 10 * block_s
    k = spreads0.run.size
    slow_s = max(SLOW_S, 5 * block_s)
    lows = [np.log(white0) - 0.2] + ([np.log(white0) - 9.0, np.log(slow_s)] if drift else [])
    highs = [np.log(white0) + 3.0] + ([np.log(white0) + 5.0, np.log(max(4 * slow_s, 5 * longest_s))] if drift else [])
    begin = start.noise if start is not None else Noise(white0, white0 / 10, 20.0)
    x0 = [np.log(begin.white_sd_dps)]
    if drift:
        x0 += [np.log(max(begin.ou_sd_dps, white0 / 50)), np.log(begin.ou_tau_s)]
    lows += list(np.log(1e-6 / rms))
    highs += list(np.log(_largest_dps(design) / rms))
    x0 += list(np.log(np.maximum(np.concatenate([spreads0.run, spreads0.scenario]), 1e-4 / np.maximum(rms, 1e-300))))
    m = 3 if drift else 1
    cache: dict[bytes, tuple[Array, Array]] = {}

    def unpack(x: Array) -> tuple[Noise, Spreads]:
        noise = (
            Noise(float(np.exp(x[0])), float(np.exp(x[1])), float(np.exp(x[2])))
            if drift
            else Noise(float(np.exp(x[0])))
        )
        sd = np.exp(x[m:])
        return noise, Spreads(sd[:k], sd[k:])

    def objective(x: Array) -> float:
        noise, spreads = unpack(x)
        key = x[:m].tobytes()
        if key not in cache:
            if len(cache) > 8:
                cache.clear()
            cache[key] = design.grams(noise)
        grams, logdet = cache[key]
        value = -solve(design.layout, grams, logdet, design.scenarios, n, spreads).loglik
        return value if np.isfinite(value) else 1e300

    begin_at = np.clip(x0, lows, highs)
    found = minimize(
        objective,
        begin_at,
        method="L-BFGS-B",
        bounds=list(zip(lows, highs, strict=True)),
        options={"maxiter": 60, "ftol": TOLERANCE / max(n, 1), "eps": STEP},
    )
    x = found.x
    noise, spreads = unpack(x)
    if drift and x[1] < lows[1] + 1.0:
        noise = replace(noise, ou_sd_dps=0.0)
    sd = np.concatenate([spreads.run, spreads.scenario])
    sd[x[m:] < np.array(lows[m:]) + 1.0] = 0.0
    grams, logdet = design.grams(noise)
    spreads = fit_spreads(design, grams, logdet, design.scenarios, n, Spreads(sd[:k], sd[k:]))
    solution = solve(design.layout, grams, logdet, design.scenarios, n, spreads)
    return AxisFit(design, noise, spreads, solution, design.terms, grams, logdet)


def refine(current: AxisFit) -> AxisFit:
    """Nonlinear parameters at fixed noise, one term at a time, then the noise again."""
    from scipy.optimize import minimize

    moved = False
    for i, term in enumerate(current.design.terms):
        names = [n for n in term.effect.nonlinear if n in term.values and term.effect_id != "colored_noise"]
        if not names:
            continue
        base = current
        bounds = [np.log(term.effect.bounds(name)) for name in names]
        x0 = np.array([np.clip(np.log(term.values[n]), *b) for n, b in zip(names, bounds, strict=True)])

        def at(x: Array, i: int = i, names: list[str] = names, term: Term = term, base: AxisFit = base) -> AxisFit:
            values = {**term.values, **dict(zip(names, map(float, np.exp(x)), strict=True))}
            terms = list(base.design.terms)
            terms[i] = replace(term, values=values)
            return with_noise(Design(base.design.blocks, base.design.axis, terms), base.noise, base.spreads)

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


def finish(current: AxisFit) -> AxisFit:
    """Name the parameters and their standard errors."""
    layout, design = current.design.layout, current.design
    run_se, scenario_se = _spread_errors(current)
    terms = []
    for i, term in enumerate(design.terms):
        kind = term.effect
        if term.effect_id == "colored_noise":
            terms.append(replace(term, values={"sd_dps": current.noise.ou_sd_dps, "tau_s": current.noise.ou_tau_s}))
            continue
        values: Values = {n: term.values[n] for n in kind.nonlinear if n in term.values}
        se: Values = {}
        mine = [j for j, (t, _) in enumerate(layout.fixed) if t == i]
        if kind.reading_fault:
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
        if term.effect_id == "turn_on_bias" and np.unique(design.scenarios).size >= LEAST_SCENARIOS:
            values["sd_dps"], se["sd_dps"] = current.turn_on_sd_dps, current._scenario_sd(scenario_se, "bias")
        if term.effect_id == "scale" and len(layout.scenario) > 1:
            sd = current._scenario_sd(current.spreads.scenario, "scale")
            values["scale_sd"], se["scale_sd"] = sd, current._scenario_sd(scenario_se, "scale")
        se.update(_nonlinear_errors(current, i))
        terms.append(replace(term, values=values, se=se))
    return replace(current, terms=tuple(terms))


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
    """Standard errors of the spreads from the curvature of REML's log-likelihood in their logarithm."""
    sd = np.concatenate([current.spreads.run, current.spreads.scenario])
    k = current.spreads.run.size
    out = np.full(sd.size, np.nan)
    step = 0.1
    everything = np.ones(len(current.design.blocks), dtype=bool)
    for j in np.flatnonzero(sd > 0):
        ends = []
        for sign in (-step, step):
            trial = sd.copy()
            trial[j] *= np.exp(sign)
            ends.append(current.subset(everything, Spreads(trial[:k], trial[k:])).loglik)
        curvature = (2 * current.loglik - ends[0] - ends[1]) / step**2
        out[j] = sd[j] / np.sqrt(curvature) if curvature > 0 else np.nan
    return out[:k], out[k:]


def _nonlinear_errors(current: AxisFit, i: int) -> Values:
    term = current.design.terms[i]
    errors: Values = {}
    runs = [b.run for b in current.design.blocks]
    for name in term.effect.nonlinear:
        if name not in term.values:
            continue
        step = term.effect.step(name, term.values, runs) / 6
        ends = []
        for sign in (-step, step):
            terms = list(current.design.terms)
            terms[i] = replace(term, values={**term.values, name: term.values[name] * float(np.exp(sign))})
            ends.append(
                with_noise(
                    Design(current.design.blocks, current.design.axis, terms), current.noise, current.spreads
                ).loglik
            )
        curvature = (2 * current.loglik - ends[0] - ends[1]) / step**2
        errors[name] = float(term.values[name] / np.sqrt(curvature)) if curvature > 0 else float("nan")
    return errors
