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
NO_SPREAD = 1e-6
"""Of a variance, against what one run knows of it: less is none."""
APART_GRID, APART_RATIO, APART_ROUNDS = 25, 6.0, 5
"""Values of a parameter that may be each run's own, from a sixth of the common one (in the middle) to six times it."""
APART_SETTLED = 0.1
"""Of its standard error: the common value has moved by less."""
APART_GAIN = 5.0
"""Log-likelihood that its spread must gain."""
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

    def __init__(
        self, blocks: Sequence[Blocks], axis: int, terms: Sequence[Term], like: Design | None = None
    ) -> None:  # fmt: skip
        self.axis = axis
        self.terms = tuple(terms)
        self.blocks = [self._usable(b) for b in blocks]
        runs = [b.run for b in blocks]
        self.scopes = [term.effect.scope_in(runs) for term in terms]
        self.means = [self._means(i, like) for i in range(len(self.blocks))]
        self.layout, self.stacks = self._build()

    def changed(self, terms: Sequence[Term]) -> Design:
        """The same runs with other terms; what stays the same is not computed again."""
        return Design(self.blocks, self.axis, terms, like=self)

    def _means(self, i: int, like: Design | None) -> list[Array | None]:
        """Block means of each term's columns in one run, [m, k]; None for a term without columns."""
        known = []
        if like is not None and like.axis == self.axis and like.blocks[i] is self.blocks[i]:
            known = [(t, m) for t, m in zip(like.terms, like.means[i], strict=True)]
        out: list[Array | None] = []
        for term in self.terms:
            same = next((m for t, m in known if t == term and t.effect is term.effect and t.of_run is term.of_run), None)
            if same is None and term.effect_id != "colored_noise":
                columns = self._columns(term, self.blocks[i])
                same = self.blocks[i].mean(columns) if columns.shape[1] else None
            out.append(same)
        return out

    def _usable(self, b: Blocks) -> Blocks:
        """The blocks of a run without samples that a fault of the reading has emptied of meaning."""
        for term in self.terms:
            fault = term.values and term.effect.at_reading(term.values)
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
            if scope == "scenario" or kind.at_reading(term.values):
                continue
            if scope == "session" or kind.common_mean:
                fixed += [(i, j) for j in range(k)]
            if scope == "run" and k:
                run += [(i, j) for j in range(k)]
                group += [n_groups + g for g in kind.groups(term.values)]
                n_groups = max(group) + 1
        matrices = [self._matrix(i, fixed, run) for i in range(len(self.blocks))]
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

    def _matrix(self, i: int, fixed: Sequence[tuple[int, int]], run: Sequence[tuple[int, int]]) -> Array:
        means = self.means[i]
        columns = [self.blocks[i].y_dps[:, self.axis]]
        for term, j in (*fixed, *run):
            found = means[term]
            assert found is not None
            columns.append(found[:, j])
        return np.column_stack(columns)

    def sample_columns(self, b: Blocks) -> dict[int, Array]:
        """Each term's columns at every sample of a run, by the term's index."""
        return {
            i: self._columns(term, b) for i, term in enumerate(self.terms) if term.effect_id != "colored_noise"
        }

    def _columns(self, term: Term, b: Blocks) -> Array:
        return term.effect.columns(b.run, self.axis, term.values_in(b.run) or dict.fromkeys(term.effect.linear, 0.0))

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
            even = b.t_s.size > 2 and np.ptp(b.n) == 0 and _off_grid_s(b.t_s) <= 1e-3 * SLOW_S
            key = (b.t_s.size, float(b.n[0]), round(float(b.t_s[-1] - b.t_s[0]), 2)) if even else i
            stacks.setdefault(key, []).append(i)
        out = []
        for index in stacks.values():
            first = self.blocks[index[0]]
            out.append((index, np.stack([np.ascontiguousarray(matrices[i].T) for i in index]), first.t_s, first.n))
        return out

    def block(self, i: int) -> tuple[Array, Array]:
        """``[y | fixed | run]`` of one run, shape [q, m], and the samples in each block [m]."""
        for index, stack, _, n in self.stacks:
            if i in index:
                return stack[index.index(i)], n
        return np.zeros((1 + len(self.layout.fixed) + len(self.layout.run), 0)), np.zeros(0)

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

    @cached_property
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


@dataclass(frozen=True)
class _Integrated:
    """Grams with random coefficients integrated out, and what is known of these: standardised, ``v = weights (y, -X)``.

    ``inverse`` is the covariance of v given the rest; one of each for every Gram.
    """

    grams: Array
    logdet: Array
    weights: Array
    inverse: Array


def _integrate(gram: Array, index: Index, keep: Index, sd: Array) -> _Integrated:
    """Integrate out coefficients ``~ N(0, sd^2)`` of columns ``index``; Grams of columns ``keep`` are left."""
    b = sd[:, None] * gram[..., index, :][..., keep]
    m = np.eye(index.size) + sd[:, None] * gram[..., index, :][..., index] * sd
    chol = np.linalg.cholesky(m)
    root = np.linalg.inv(chol)
    half = root @ b
    logdet = 2 * np.log(np.diagonal(chol, axis1=-2, axis2=-1)).sum(axis=-1)
    transposed = root.swapaxes(-1, -2)
    kept = gram[..., keep, :][..., keep] - half.swapaxes(-1, -2) @ half
    return _Integrated(kept, logdet, transposed @ half, transposed @ root)


def solve(layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int, spreads: Spreads) -> Solution:
    """Integrate out the random coefficients, solve for the shared ones."""
    return _solve(layout, grams, logdet, scenarios, n, spreads)[0]


def _solve(
    layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int, spreads: Spreads, slopes: bool = False
) -> tuple[Solution, Array]:
    """The solution; and, if asked for, the slopes of its log-likelihood in the logarithm of each spread, run's first.

    By Fisher's identity the slope is the sum, over the coefficients that share a spread, of E[v^2 | y] - 1, v the coefficient
    over its spread.
    """
    p = len(layout.fixed)
    total_logdet = float(logdet.sum())
    keep = np.arange(1 + p)
    of_runs = of_scenarios = None
    if layout.run:
        of_runs = _integrate(grams, np.arange(1 + p, grams.shape[-1]), keep, spreads.run[list(layout.run_group)])
        grams = of_runs.grams
        total_logdet += float(of_runs.logdet.sum())
    if layout.scenario:
        member = (np.unique(scenarios)[:, None] == scenarios).astype(float)
        summed = (member @ grams.reshape(grams.shape[0], -1)).reshape(-1, 1 + p, 1 + p)
        of_scenarios = _integrate(summed, np.array(layout.scenario) + 1, keep, spreads.scenario)
        grams = of_scenarios.grams
        total_logdet += float(of_scenarios.logdet.sum())
    total = grams.sum(axis=0)
    none = np.zeros(spreads.run.size + spreads.scenario.size)
    h, g = total[1:, 1:], total[1:, 0]
    scale = np.sqrt(np.maximum(np.diag(h), 1e-300))
    try:
        chol = np.linalg.cholesky(h / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return Solution(-np.inf, np.full(p, np.nan), np.full((p, p), np.nan), np.nan), none
    inverse_chol = np.linalg.inv(chol)
    half = inverse_chol @ (g / scale)
    cov = (inverse_chol.T @ inverse_chol) / np.outer(scale, scale)
    beta = inverse_chol.T @ half / scale
    chi2 = float(total[0, 0] - half @ half)
    logdet_h = 2 * float(np.log(np.diag(chol)).sum() + np.log(scale).sum())
    loglik = -0.5 * (total_logdet + logdet_h + chi2 + (n - p) * np.log(2 * np.pi))
    solution = Solution(loglik, beta, cov, chi2)
    if not slopes or none.size == 0:
        return solution, none
    center, spread = np.broadcast_to(beta, (1, p)), cov[None]
    slope_scenario = np.zeros(spreads.scenario.size)
    if of_scenarios is not None:
        slope_scenario = _slopes(of_scenarios, center, spread).sum(axis=0)
        pull = np.zeros((grams.shape[0], p, 1 + p))  # a power cycle's own coefficients: beta plus what is random of them
        pull[:, layout.scenario] = spreads.scenario[:, None] * of_scenarios.weights
        own = np.eye(p) - pull[:, :, 1:]
        random = np.zeros((grams.shape[0], p, p))
        rows = np.ix_(range(grams.shape[0]), layout.scenario, layout.scenario)
        random[rows] = spreads.scenario[:, None] * of_scenarios.inverse * spreads.scenario
        which = member.argmax(axis=0)
        center = (own @ beta + pull[:, :, 0])[which]
        spread = (own @ cov @ own.swapaxes(-1, -2) + random)[which]
    slope_run = np.zeros(spreads.run.size)
    if of_runs is not None:
        np.add.at(slope_run, list(layout.run_group), _slopes(of_runs, center, spread).sum(axis=0))
    return solution, np.concatenate([slope_run, slope_scenario])


def _slopes(of: _Integrated, center: Array, spread: Array) -> Array:
    """E[v^2 | y] - 1 for the coefficients that were integrated out, shape [grams, k]."""
    b = of.weights[..., 1:]
    v = of.weights[..., 0] - (b @ center[..., None])[..., 0]
    variance = np.diagonal(of.inverse, axis1=-2, axis2=-1) + np.einsum("...ij,...jk,...ik->...i", b, spread, b)
    return np.asarray(v**2 + variance - 1)


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
    return finish(runs_apart(refine(current)))


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
    """The variant with the best BIC at a given noise; what is independent of one another is runs, not blocks."""
    runs = [b.run for b in current.design.blocks]
    count = len(runs)
    best: tuple[float, Values] | None = None
    variants = term.effect.variants(runs, current.design.axis)
    if len(variants) == 1:
        return variants[0]
    for values in variants:
        terms = [*current.design.terms, replace(term, values=values)]
        design = current.design.changed(terms)
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
    if not term.values:
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
    """Spreads for a design with more terms: the old ones; the new are not known yet."""
    fresh = _unknown_spreads(design)
    fresh.run[: old.spreads.run.size] = old.spreads.run
    return Spreads(
        fresh.run, old.spreads.scenario if old.spreads.scenario.size == fresh.scenario.size else fresh.scenario
    )


def _reordered(current: AxisFit, order: dict[str, int]) -> AxisFit:
    terms = sorted(current.design.terms, key=lambda t: order[t.effect_id])
    if list(current.design.terms) == terms:
        return current
    design = current.design.changed(terms)
    return fit_noise(design, start=with_noise(design, current.noise, _unknown_spreads(design)))


def _random_rms(design: Design) -> tuple[Array, Array]:
    rms = design.column_rms
    p = len(design.layout.fixed)
    run = np.array([
        np.mean([rms[1 + p + j] for j, g in enumerate(design.layout.run_group) if g == group])
        for group in range(design.layout.n_groups)
    ])  # fmt: skip
    return run, rms[np.array(design.layout.scenario, dtype=np.intp) + 1]


def _unknown_spreads(design: Design) -> Spreads:
    layout = design.layout
    return Spreads(np.full(layout.n_groups, np.nan), np.full(len(layout.scenario), np.nan))


def with_noise(design: Design, noise: Noise, spreads: Spreads) -> AxisFit:
    """A fit at given noise: spreads by REML on the Grams, no filtering again."""
    grams, logdet = design.grams(noise)
    n = int(design.n_blocks.sum())
    spreads = fit_spreads(design, grams, logdet, design.scenarios, n, spreads)
    solution = solve(design.layout, grams, logdet, design.scenarios, n, spreads)
    return AxisFit(design, noise, spreads, solution, design.terms, grams, logdet)


@dataclass(frozen=True)
class _Scale:
    """Spreads as coordinates of a search, ``log(1 + (sd / unit)^2)``: the variance where it is small, else its logarithm.

    ``unit`` [k]: what one run (power cycle) by itself knows of its coefficient. A spread far below that is none, and there the
    likelihood is straight in the variance, where in the logarithm it is flat and a search would be lost.
    """

    unit: Array
    high: Array

    @staticmethod
    def of(design: Design, grams: Array) -> _Scale:
        layout = design.layout
        information = np.zeros(layout.n_groups + len(layout.scenario))
        diagonal = np.diagonal(grams, axis1=-2, axis2=-1)
        per_run = diagonal[:, 1 + len(layout.fixed) :].mean(axis=0)
        for group in range(layout.n_groups):
            information[group] = np.mean([per_run[j] for j, g in enumerate(layout.run_group) if g == group])
        cycles = np.unique(design.scenarios).size
        information[layout.n_groups :] = diagonal[:, np.array(layout.scenario, dtype=np.intp) + 1].sum(axis=0) / cycles
        unit = np.where(information > 0, 1 / np.sqrt(np.maximum(information, 1e-300)), 0.0)
        largest = np.where(unit > 0, _largest_dps(design) / np.concatenate(_random_rms(design)), 0.0)
        return _Scale(unit, np.log1p((largest / np.maximum(unit, 1e-300)) ** 2))

    def coordinates(self, sd: Array) -> Array:
        """Of spreads [k]; what is not known yet (NaN) starts at its unit."""
        given = np.where(np.isnan(sd), self.unit, sd)
        ratio = np.divide(given, self.unit, out=np.zeros_like(given), where=self.unit > 0)
        return np.clip(np.log1p(ratio**2), NO_SPREAD, np.maximum(self.high, NO_SPREAD))

    def spreads(self, x: Array) -> Array:
        return self.unit * np.sqrt(np.expm1(x))

    def slopes(self, x: Array, of_log_sd: Array) -> Array:
        """Slopes in the coordinates from those in log sd."""
        return of_log_sd / (-2 * np.expm1(-x))

    def settled(self, x: Array) -> Array:
        """The spreads at the end of a search: a vanishing one is none."""
        return np.where(x > 10 * NO_SPREAD, self.spreads(x), 0.0)

    @property
    def bounds(self) -> list[tuple[float, float]]:
        return [(NO_SPREAD, max(float(h), NO_SPREAD)) for h in self.high]


def _maximise(loglik: Callable[[Array], tuple[float, Array]], x0: Array, bounds: list[tuple[float, float]], n: int) -> Array:
    """Where a log-likelihood, given with its slopes, is largest."""
    from scipy.optimize import minimize

    def cost(x: Array) -> tuple[float, Array]:
        value, slope = loglik(x)
        return (-value, -slope) if np.isfinite(value) else (1e300, np.zeros_like(x))

    found = minimize(
        cost, x0, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60, "ftol": TOLERANCE / max(n, 1)}
    )
    return np.asarray(found.x)


def fit_spreads(design: Design, grams: Array, logdet: Array, scenarios: Index, n: int, start: Spreads) -> Spreads:
    """REML of the spreads alone; those of ``start`` that are NaN are not known yet."""
    k = start.run.size
    if k + start.scenario.size == 0:
        return start
    scale = _Scale.of(design, grams)

    def loglik(x: Array) -> tuple[float, Array]:
        sd = scale.spreads(x)
        solution, slopes = _solve(
            design.layout, grams, logdet, scenarios, n, Spreads(sd[:k], sd[k:]), slopes=True
        )  # fmt: skip
        return solution.loglik, scale.slopes(x, slopes)

    x = _maximise(loglik, scale.coordinates(np.concatenate([start.run, start.scenario])), scale.bounds, n)
    sd = scale.settled(x)
    return Spreads(sd[:k], sd[k:])


def _off_grid_s(t_s: Array) -> float:
    """How far times [n] stray from an even grid, s."""
    return float(np.max(np.abs(t_s - np.linspace(t_s[0], t_s[-1], t_s.size))))


def _largest_dps(design: Design) -> float:
    """Ten times what the readings themselves stray: no random term is larger."""
    return 10 * float(design.column_rms[0]) + 1e-3


def white_start(design: Design) -> float:
    """One sample's white noise from the scatter within blocks."""
    ss = sum(b.within_ss[design.axis] for b in design.blocks)
    n = sum(b.within_n for b in design.blocks)
    if n >= 10:
        return max(float(np.sqrt(ss / n)), LEAST_WHITE_DPS)
    jumps = np.concatenate([np.diff(b.y_dps[:, design.axis]) for b in design.blocks])
    return float(max(np.sqrt(np.mean(jumps**2) / 2) if jumps.size else 0.0, LEAST_WHITE_DPS))


def _extent_s(design: Design) -> tuple[float, float]:
    """Longest run and shortest step from block to block, s."""
    longest_s = max(float(b.t_s[-1] - b.t_s[0]) for b in design.blocks if b.t_s.size)
    return longest_s, min((float(np.median(np.diff(b.t_s))) for b in design.blocks if b.t_s.size > 1), default=1.0)


def _drifts(design: Design) -> bool:
    """Has the model a drift, and are the runs long enough to show one?"""
    longest_s, block_s = _extent_s(design)
    return any(t.effect_id == "colored_noise" for t in design.terms) and longest_s > 10 * block_s


def _first_noise(design: Design) -> Noise:
    """Where the search for the noise begins."""
    white0 = white_start(design)
    return Noise(white0, white0 / 10, 20.0) if _drifts(design) else Noise(white0)


def fit_noise(design: Design, start: AxisFit | None = None) -> AxisFit:
    """REML of white level, drift and spreads together."""
    white0 = white_start(design)
    n = int(design.n_blocks.sum())
    longest_s, block_s = _extent_s(design)
    drift = _drifts(design)
    slow_s = max(SLOW_S, 5 * block_s)
    if start is None:
        start = with_noise(design, _first_noise(design), _unknown_spreads(design))
    # a drift of this spread moves a mean over SLOW_S as white noise does
    unit = white0 / np.sqrt(SLOW_S / block_s * max(1.0, float(np.median(np.concatenate([b.n for b in design.blocks])))))
    lows, highs = [np.log(white0) - 0.2], [np.log(white0) + 3.0]
    x0 = [np.log(start.noise.white_sd_dps)]
    if drift:
        lows += [NO_SPREAD, np.log(slow_s)]
        highs += [np.log1p((150 * white0 / unit) ** 2), np.log(max(4 * slow_s, 5 * longest_s))]
        x0 += [np.log1p((start.noise.ou_sd_dps / unit) ** 2), np.log(start.noise.ou_tau_s)]
        x0[1] = max(x0[1], np.log(2.0))  # no drift in the poorer model may be one in the richer
    m, k = len(x0), start.spreads.run.size
    scale = _Scale.of(design, start.grams)
    cache: dict[bytes, tuple[Array, Array]] = {}

    def noise_at(x: Array) -> Noise:
        white = float(np.exp(x[0]))
        return Noise(white, unit * float(np.sqrt(np.expm1(x[1]))), float(np.exp(x[2]))) if drift else Noise(white)

    def grams_at(x: Array) -> tuple[Array, Array]:
        key = x[:m].tobytes()
        if key not in cache:
            if len(cache) > 8:
                cache.clear()
            cache[key] = design.grams(noise_at(x))
        return cache[key]

    def loglik(x: Array) -> tuple[float, Array]:
        sd = scale.spreads(x[m:])
        spreads = Spreads(sd[:k], sd[k:])
        solution, slopes = _solve(design.layout, *grams_at(x), design.scenarios, n, spreads, slopes=True)
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
    x = _maximise(loglik, begin, [*zip(lows, highs, strict=True), *scale.bounds], n)
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
        names = [n for n in term.effect.nonlinear if n in term.values and term.effect_id != "colored_noise"]
        if not names or term.of_run:
            continue
        base = current
        bounds = [np.log(term.effect.bounds(name)) for name in names]
        x0 = np.array([np.clip(np.log(term.values[n]), *b) for n, b in zip(names, bounds, strict=True)])

        def at(x: Array, i: int = i, names: list[str] = names, term: Term = term, base: AxisFit = base) -> AxisFit:
            values = {**term.values, **dict(zip(names, map(float, np.exp(x)), strict=True))}
            terms = list(base.design.terms)
            terms[i] = replace(term, values=values)
            return with_noise(base.design.changed(terms), base.noise, base.spreads)

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
    p = len(layout.fixed)
    random = np.concatenate([np.arange(1 + p, grams.shape[-1]), np.array(layout.scenario, dtype=np.intp) + 1]).astype(np.intp)
    sd = np.concatenate([spreads.run[list(layout.run_group)], spreads.scenario])
    integrated = _integrate(grams, random, np.arange(1 + p), sd)
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
        if term.effect_id == "colored_noise":
            terms.append(replace(term, values={"sd_dps": current.noise.ou_sd_dps, "tau_s": current.noise.ou_tau_s}))
            continue
        values: Values = {n: term.values[n] for n in kind.nonlinear if n in term.values}
        se: Values = {}
        if term.of_run:
            values |= {n: v for n, v in term.values.items() if n in term.se}
            se |= term.se
        mine = [j for j, (t, _) in enumerate(layout.fixed) if t == i]
        if kind.at_reading(term.values):
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
    """Standard errors of the spreads: from the curvature of REML's log-likelihood in their logarithm.

    Of a spread that vanishes, or that has no curvature, the size at which the log-likelihood has fallen by a half.
    """
    sd = np.concatenate([current.spreads.run, current.spreads.scenario])
    k = current.spreads.run.size
    everything = np.ones(len(current.design.blocks), dtype=bool)
    unit = _Scale.of(current.design, current.grams).unit

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
            terms = list(current.design.terms)
            terms[i] = replace(term, values={**term.values, name: term.values[name] * float(np.exp(sign))})
            ends.append(
                with_noise(current.design.changed(terms), current.noise, current.spreads).loglik
            )
        curvature = (2 * current.loglik - ends[0] - ends[1]) / step**2
        errors[name] = float(term.values[name] / np.sqrt(curvature)) if curvature > 0 else float("nan")
    return errors
