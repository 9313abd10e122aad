"""The structure of a term whose values are open: the choice of its variant by the session."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal.effects.base import Values
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Term
from gyrocal.errors import InputError
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import likelihood_ratio, profile_loglik
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
    noise, chosen = current.noise, None
    for _ in range(3):  # drift absorbs an effect that the model lacks, so the choice is repeated at the noise fitted with it
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
        if nested and likelihood_ratio(trial, richest, most - parameters)[1] > POLICY.structure_chance:
            return values
    return best
