"""The structure of a term whose values are open: the choice of its variant by the session."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Term
from gyrocal.errors import InputError
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.inference.noise_search import carry_spreads, fit_noise, with_noise
from gyrocal.inference.timing import with_timing
from gyrocal.noise.whitening import Noise
from gyrocal.policy import POLICY


def choose_variant(current: AxisFit, term: Term) -> AxisFit:
    """Add a term whose structure or nonlinear parameters are open: its best variant by BIC, with the noise fitted beside it.

    Raises:
        InputError: the effect has no variant on this session.
    """
    if isinstance(term.effect, TimingEffect):
        return with_timing(current, term)
    runs, terms = [b.run for b in current.design.blocks], current.design.terms
    variants = term.effect.variants(runs, current.design.axis)
    if not variants:
        raise InputError(f"effect {term.effect_id}: nothing to try on this session")
    designs = [current.design.changed([*terms, replace(term, values=values)]) for values in variants]
    noise, chosen = current.noise, None
    # drift absorbs an effect that the model lacks, so the choice is repeated at the noise fitted with it
    for _ in range(3 if len(designs) > 1 else 1):
        trial = _likeliest(current, designs, noise)
        if trial.design is chosen:
            break
        chosen = trial.design
        fitted = fit_noise(chosen, start=trial)
        noise = fitted.noise
    return fitted


def _likeliest(current: AxisFit, designs: Sequence[Design], noise: Noise) -> AxisFit:
    """The fit at a given noise with the best BIC; what is independent of one another is runs, not blocks.

    A simpler one that is part of it is taken where noise may well gain what it lacks.
    """
    trials = [with_noise(design, noise, carry_spreads(current, design)) for design in designs]
    if len(trials) == 1:
        return trials[0]

    def parameters(trial: AxisFit) -> int:
        layout = trial.design.layout
        return len(layout.fixed) + layout.n_groups + len(trial.design.terms[-1].effect.nonlinear)

    def names(trial: AxisFit) -> Set[str]:
        return trial.design.terms[-1].values.keys()

    penalty = 0.5 * np.log(len(current.design.blocks))
    best = max(trials, key=lambda trial: trial.solution.profile_loglik - penalty * parameters(trial))
    for trial in sorted(trials, key=parameters):
        lacks = parameters(best) - parameters(trial)
        if lacks > 0 and names(trial) < names(best) and likelihood_ratio(trial, best, lacks)[1] > POLICY.structure_chance:
            return trial
    return best
