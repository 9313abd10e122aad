"""Evidence for one more term: its gain in the fit and on held-out movements.

Effects that the model lacks are in the residual of every candidate. The noise is therefore widened, separately for movements
and rests, until chi-square beside the candidate is that of noise, and the gain is judged by the F distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.effects.base import Effect
from gyrocal.error_model.model import Term
from gyrocal.gravity.fit import CROSS, GravityFit, full, least_squares, why_invisible
from gyrocal.gravity.heldout import Folds, HeldOut, explained, folds, held_out
from gyrocal.gravity.observations import Observer, Parameter, parameters
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array


@dataclass(frozen=True)
class Gain:
    """The gain of columns added to a fit: chi-square, its probability, values [k] with covariance, and the whitened signal."""

    drop: float
    chance: float
    values: Array
    covariance: Array
    signal: Array = field(repr=False)
    noise: Array = field(repr=False)


class Evidence:
    """The fit of a model and the columns of further terms, computed together."""

    def __init__(self, fitted: GravityFit) -> None:
        self.fitted = fitted
        self.observer = Observer(fitted.scene)
        self.cut: Folds = folds(fitted.scene, fitted.observations)
        self.prior = [p.prior_sd for p in fitted.parameters]
        self._known: dict[tuple[object, ...], Array] = {}
        seen = fitted.observations
        self.before: HeldOut = held_out(seen.y, seen.columns, fitted.noise, self.prior, self.cut, seen.movement_rows)

    def prepare(self, terms: Sequence[Term]) -> None:
        """Compute the columns of many terms at once."""
        wanted = {_key(p): p for t in terms for p in parameters([t])}
        new = [p for key, p in wanted.items() if key not in self._known]
        if new:
            model, rates = self.fitted.model, self.fitted.observations.rates_dps
            usable = replace(model, terms=tuple(t for t in model.terms if t.effect_id not in self.fitted.left_out))
            found = self.observer.observe(usable, new, rates)
            self._known.update({_key(p): found.columns[:, k] for k, p in enumerate(new)})

    def columns(self, term: Term) -> Array:
        """The columns of a term, shape [rows, k]."""
        self.prepare([term])
        return np.column_stack([self._known[_key(p)] for p in parameters([term])])

    def beside(self, effect_id: str, axis: str) -> Array | None:
        """Columns of the misalignment that the model lacks, [rows, m]. It must not be taken for a candidate.

        The columns of the axis itself are left out if its misalignment is the candidate.
        """
        model = self.fitted.model
        terms = [t for t in full(model).terms if t.effect_id == CROSS and model.term(CROSS, t.axis) is None]
        terms = [t for t in terms if effect_id != CROSS or t.axis != axis]
        self.prepare(terms)
        return np.column_stack([self.columns(t) for t in terms]) if terms else None

    def gain(self, columns: Array, prior_sd: Sequence[float], beside: Array | None = None) -> Gain:
        """The gain of columns [rows, k] beside those of the model and of ``beside`` [rows, m]."""
        seen = self.fitted.observations
        base = seen.columns if beside is None else np.column_stack([seen.columns, beside])
        prior = [*self.prior, *([1e3] * (base.shape[1] - seen.columns.shape[1]))]
        both = np.column_stack([base, columns])
        noise = self.widened(both, [*prior, *prior_sd])
        lower = np.linalg.cholesky(noise)
        white = np.linalg.solve(lower, np.column_stack([both, seen.y]))
        q, _ = np.linalg.qr(white[:, : base.shape[1]])
        rest = white - q @ (q.T @ white)
        extra, y = rest[:, base.shape[1] : -1], rest[:, -1]
        norms = np.linalg.norm(extra, axis=0)
        ok = norms > 1e-6 * np.linalg.norm(white[:, base.shape[1] : -1], axis=0)
        theta, covariance = np.zeros(len(norms)), np.diag(np.square(np.minimum(prior_sd, 1e6)))
        if ok.any():
            theta[ok] = np.linalg.lstsq(extra[:, ok], y, rcond=None)[0]
            covariance[np.ix_(ok, ok)] = np.linalg.pinv(extra[:, ok].T @ extra[:, ok])
        signal = extra @ theta
        drop = float(signal @ signal)
        freedom = max(len(y) - both.shape[1], 1)
        left = float(np.sum((y - signal) ** 2)) / freedom
        count = max(int(ok.sum()), 1)
        return Gain(drop, float(tails.f_ratio(drop / count / max(left, 1.0), count, freedom)), theta, covariance, signal, noise)

    def widened(self, columns: Array, prior_sd: Sequence[float]) -> Array:
        """The noise plus the scatter of movements and rests beyond it, beside these columns, shape [rows, rows]."""
        seen, noise = self.fitted.observations, self.fitted.noise
        theta, covariance = least_squares(seen.y, columns, noise, prior_sd)
        residual = seen.y - columns @ theta
        expected = np.diag(noise) - np.einsum("ij,jk,ik->i", columns, covariance, columns)
        more = np.zeros(len(residual))
        for rows in (np.arange(seen.movement_rows), *(seen.rest_rows(i) for i in range(3))):
            more[rows] = max(float(np.mean(residual[rows] ** 2) - np.mean(expected[rows])), 0.0)
        return np.asarray(noise + np.diag(more))

    def variants(self, effect: Effect, axis: str) -> list[Term]:
        """The terms of an effect that are tried. Hands turn about all axes, so each has a misalignment of its own."""
        runs = list(self.observer.turning(0, self.fitted.observations.rates_dps[0]).values())
        found = effect.variants(runs, AXES.index(axis))
        apart = [v for v in found if any(name.startswith("m_") for name in v)]
        return [Term.of(effect, axis, v) for v in (apart or found)]

    def judge(self, effect: Effect, axis: str) -> Candidate:
        """One effect on one axis with its evidence; the decision is ``reject`` until others are known."""
        lacking = why_invisible(Term.of(effect, axis), self.fitted.scene)
        if lacking:
            return Candidate(effect, axis, "not_measurable", next_measurement=f"{lacking}. To show it: {effect.measure_next}")
        variants = self.variants(effect, axis)
        self.prepare(variants)
        beside = self.beside(effect.id, axis)
        found = [(t, self.gain(self.columns(t), [p.prior_sd for p in parameters([t])], beside)) for t in variants]
        term, best = max(found, key=lambda pair: pair[1].drop - len(pair[1].values) * np.log(len(self.before.residual)))
        chance = min(1.0, best.chance * len(variants))
        names = [p.name for p in parameters([term])]
        values = {**term.values, **dict(zip(names, map(float, best.values), strict=True))}
        se = dict(zip(names, map(float, np.sqrt(np.diag(best.covariance))), strict=True))
        judged = Candidate(
            effect, axis, "reject", values, se, chance=chance, parameters=len(names), signal=best.signal,
            next_measurement=effect.measure_next,
        )  # fmt: skip
        return judged if chance > POLICY.false_discovery_rate else self._with_gains(judged, term, best, beside)

    def _with_gains(self, judged: Candidate, term: Term, best: Gain, beside: Array | None) -> Candidate:
        """The candidate with its gain on held-out movements beside the misalignment, and with its part of the excess."""
        seen = self.fitted.observations
        own, own_prior = self.columns(term), [p.prior_sd for p in parameters([term])]

        def held(columns: Array, prior: Sequence[float], noise: Array) -> HeldOut:
            return held_out(seen.y, columns, noise, prior, self.cut, seen.movement_rows)

        base = seen.columns if beside is None else np.column_stack([seen.columns, beside])
        base_prior = [*self.prior, *([1.0] * (base.shape[1] - seen.columns.shape[1]))]
        with_own = held(np.column_stack([base, own]), [*base_prior, *own_prior], best.noise)
        gains = with_own.likelihood - held(base, base_prior, best.noise).likelihood
        after = held(np.column_stack([seen.columns, own]), [*self.prior, *own_prior], self.fitted.noise)
        everything = np.arange(len(self.fitted.scene.movements))
        before_level, after_level = self.before.level(everything, after), after.level(everything)
        total, total_se = float(gains.sum()), float(np.std(gains, ddof=1) * np.sqrt(gains.size)) if gains.size > 1 else None
        part = explained(before_level, after_level)
        return replace(
            judged, explained=part, excess_drop_dps=(before_level.excess_deg or 0.0) - (after_level.excess_deg or 0.0),
            gain=total, gain_se=total_se, unit_gains=gains, enough=self._enough(best, part),
        )  # fmt: skip

    def _enough(self, best: Gain, part: float | None) -> bool:
        """True if a candidate explains a tenth of the scatter beyond the noise, or if there is no such scatter."""
        fitted = self.fitted
        total, freedom = fitted.chi2(np.arange(len(fitted.residual)))
        if (part or 0.0) >= POLICY.explained or float(tails.chi_square(total, freedom)) > POLICY.misfit_alarm:
            return True
        return best.drop >= POLICY.explained * (total - freedom)


def _key(parameter: Parameter) -> tuple[object, ...]:
    term = parameter.term
    nonlinear = tuple((n, term.values.get(n)) for n in term.effect.nonlinear)
    return (*parameter.key, nonlinear)
