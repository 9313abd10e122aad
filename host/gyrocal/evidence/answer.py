"""What the evidence says of one axis: how probable each effect is, and which sets explain the axis together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Term
from gyrocal.evidence import discrepancy, hypotheses
from gyrocal.evidence.checked import Checks
from gyrocal.evidence.checks import check
from gyrocal.evidence.hypotheses import GRID, Option
from gyrocal.evidence.matrix import Matrix, runs_of
from gyrocal.evidence.search import NEGLIGIBLE, Search
from gyrocal.evidence.states import States
from gyrocal.evidence.weights import Scales, Weighed
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.structure import choose_variant
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

TOLD = 0.01
"""Sets of at least this probability are told."""
NOISE_ALONE: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
"""No effect and nothing without a name."""
LEFT_BETWEEN = 0.5
"""Log-likelihood that the distance of a nonlinear parameter from the grid may cost before it is refined."""
ROUNDS = 3


@dataclass(frozen=True)
class Alternative:
    """A set of effects that explains an axis, with its probability; ``unnamed`` holds what something without a name follows."""

    effects: tuple[str, ...]
    unnamed: tuple[str, ...]
    probability: float

    @property
    def log_odds(self) -> float:
        """The logarithm of the odds of the set, finite for certain and impossible ones too."""
        from scipy.special import logit

        return float(logit(np.clip(self.probability, 1e-300, 1 - 1e-12)))

    @property
    def noise_alone(self) -> bool:
        """True for the set of no effect, with nothing left over."""
        return (self.effects, self.unnamed) == NOISE_ALONE


@dataclass(frozen=True, eq=False)
class _Weighing:
    """One search with its result: the sets and the logarithms [sets] of their probabilities in the two forms of what is left
    over.
    """

    scales: Scales
    sets: tuple[Weighed, ...]
    forms: tuple[Array, Array]

    @staticmethod
    def of(matrix: Matrix) -> _Weighing | None:
        """The sets of an axis; None if no effect can be measured."""
        scales = Scales(matrix, States.of(matrix))
        if not scales.of_effect:
            return None
        search = Search(scales)
        sets = search.run()
        one = np.array([search.log_posterior(w) for w in sets])
        if not np.isfinite(one).any():
            return None
        all_ = np.array([scales.with_all_left_over(w) + search.log_prior(len(w.effects)) for w in sets])
        return _Weighing(scales, tuple(sets), (one, all_))

    @cached_property
    def log_odds(self) -> dict[str, float]:
        """For each effect, the logarithm of the odds of the sets that hold it: the smaller one of the two forms."""
        return {effect: self.of_any([effect]) for effect in self.scales.of_effect}

    def of_any(self, effects: Sequence[str]) -> float:
        """The logarithm of the odds of the sets that hold at least one of some effects: the smaller one of the two forms."""
        from scipy.special import logsumexp

        held = np.array([not w.effects.isdisjoint(effects) for w in self.sets])
        if not held.any():
            return -NEGLIGIBLE
        if held.all():
            return NEGLIGIBLE
        return min(float(logsumexp(form[held]) - logsumexp(form[~held])) for form in self.forms)

    def leads(self, effect: str) -> bool:
        """True if an effect is probable enough to be looked at more closely."""
        return self.log_odds[effect] >= POLICY.leading_log_odds

    @property
    def best(self) -> Weighed:
        """The likeliest set."""
        return self.sets[0]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence on one axis: that of every effect that could be judged, the checks of those that lead, and the sets that
    explain the axis together.
    """

    log_odds: Mapping[str, float]
    """Logarithm of the probability of the sets that hold an effect over that of the sets without it."""
    checks: Mapping[str, Checks]
    alternatives: tuple[Alternative, ...]
    weighing: _Weighing

    def of_any(self, effects: Sequence[str]) -> float | None:
        """Logarithm of the odds that at least one of these effects acts; None if one of them was not judged."""
        return self.weighing.of_any(effects) if set(effects) <= set(self.log_odds) else None


def weigh(fit: AxisFit, present: Sequence[str]) -> Evidence | None:
    """The evidence of the effects that the model of an axis lacks; ``present`` are the ids of those that it has.

    None where no effect can be judged.
    """
    options = hypotheses.options(runs_of(fit), fit.design.axis, present)
    if not options:
        return None
    found = _Weighing.of(Matrix.of(fit, options, discrepancy.shapes(runs_of(fit))))
    for _ in range(ROUNDS):
        if found is None:
            return None
        finer = _finer(found)
        if finer is None:
            break
        found = _Weighing.of(finer)
    assert found is not None
    leading = [e for e in sorted(found.best.effects) if found.leads(e)]
    return Evidence(found.log_odds, check(found.scales, found.best, leading), _alternatives(found), found)


def _finer(found: _Weighing) -> Matrix | None:
    """The columns about the likeliest set: readings at the times that its effects of time describe, and nonlinear parameters
    where its fit has them. None if nothing would change.
    """
    matrix, best = found.scales.matrix, found.best
    chi2 = found.scales.chi2(best)
    if not chi2 > 0:  # more noise of measured columns was taken out than is there
        return None
    white = matrix.white_sd_dps * float(np.sqrt(chi2 / found.scales.states.degrees))
    leading = {e for e in best.effects if found.leads(e)}
    timing = {e for e in leading if isinstance(matrix.options[best.forms[e][0]].effect, TimingEffect)}
    moved = {e: option for e in leading - timing if (option := _moved(found, e)) is not None}
    if not moved and timing <= matrix.released:
        return None
    fit, options = matrix.fit, list(matrix.options)
    if not timing <= matrix.released:
        fit = _timed(matrix, best, timing)
        known = {t.effect_id: t.values for t in fit.design.terms}
        options = [replace(o, values=known[o.effect.id]) if o.effect.id in timing else o for o in options]
    for effect, option in moved.items():
        at = max(k for k, o in enumerate(options) if o.effect.id == effect)
        options.insert(at + 1, option)
    shapes = discrepancy.shapes(runs_of(fit))
    return Matrix.of(fit, options, shapes, released=matrix.released | timing, white_sd_dps=min(white, matrix.white_sd_dps))


def _timed(matrix: Matrix, best: Weighed, timing: Set[str]) -> AxisFit:
    """The fit of the model with the effects of time, beside the other effects of a set, and then without those others."""
    axis, fit = "xyz"[matrix.design.axis], matrix.fit
    own = [t.effect_id for t in fit.design.terms]
    others = [matrix.options[best.forms[e][0]] for e in sorted(best.effects - timing)]
    terms = [*fit.design.terms, *(Term(o.effect.id, axis, o.values) for o in others if o.effect.id not in own)]
    beside = replace(fit, design=fit.design.changed(terms))
    for effect in sorted(timing - set(own)):
        form = matrix.options[best.forms[effect][0]].effect
        beside = choose_variant(beside, Term.of(form, axis))
    kept = [t for t in beside.design.terms if t.effect_id in own or t.effect_id in timing]
    return replace(fit, design=beside.design.changed(kept))


def _moved(found: _Weighing, effect: str) -> Option | None:
    """The form of an effect with its nonlinear parameter where the fit has it, if the grid is too far from it."""
    number, _ = found.best.forms[effect]
    option = found.scales.matrix.options[number]
    if not option.slope_of:
        return None
    coefficients = found.scales.coefficients(found.best, found.best.state, found.best.rest)[effect]
    half = coefficients.size // 2
    of_column, of_slope = coefficients[:half] * option.unit[:half], coefficients[half:] * option.unit[half:]
    step = float(of_column @ of_slope / max(float(of_column @ of_column), 1e-300))
    step = float(np.clip(step, -np.log(GRID), np.log(GRID)))
    at = found.scales.matrix.at[number]
    products = found.scales.states.products[found.best.state][np.ix_(at, at)]
    power = float(coefficients @ products @ coefficients)
    if 0.5 * power * (step**2 / 2) ** 2 < LEFT_BETWEEN:
        return None
    return option.at(option.values[option.slope_of] * float(np.exp(step)), abs(step) / 4)


def _alternatives(found: _Weighing) -> tuple[Alternative, ...]:
    """The sets, each with and without what is left over, that have a probability worth telling, and noise alone in any case."""
    from scipy.special import logsumexp

    total = float(logsumexp(found.forms[0]))
    by_told: dict[tuple[tuple[str, ...], tuple[str, ...]], float] = {NOISE_ALONE: 0.0}
    for weighed, log in zip(found.sets, found.forms[0].tolist(), strict=True):
        for shape, part in weighed.by_rest.items():
            against = () if shape is None else (found.scales.matrix.shapes[shape].against,)
            key = tuple(sorted(weighed.effects)), against
            by_told[key] = by_told.get(key, 0.0) + float(np.exp(log - weighed.log_evidence + part - total))
    order = sorted(by_told.items(), key=lambda item: -item[1])
    return tuple(Alternative(*key, p) for key, p in order if p >= TOLD or key == NOISE_ALONE)
