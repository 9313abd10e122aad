"""The evidence for one candidate: its gain in sample, its gain on held-out data, and the part of the excess it explains."""

from __future__ import annotations

import numpy as np

from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.current import Current
from gyrocal.diagnosis.explained import explained
from gyrocal.diagnosis.gains import held_out_gain, total
from gyrocal.diagnosis.reading_evidence import judge_reading
from gyrocal.effects.base import Effect
from gyrocal.effects.reading_fault import ReadingFault
from gyrocal.effects.wave import Wave
from gyrocal.error_model.model import Term
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.inference.nonlinear import refine
from gyrocal.inference.reml import Spreads
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.structure import choose_variant
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


def judge(current: Current, effect: Effect) -> Candidate:
    """Fit one candidate together with the model and the noise, and measure its gain in sample and on held-out data."""
    fault = None if effect.fault is None else effect.fault.detect(current.runs, current.index)
    if fault is not None:
        return judge_reading(current, effect, fault)
    if isinstance(effect, ReadingFault):
        return Candidate(effect, current.axis, "reject")
    least_chance = 0.0
    if effect.fast:
        peak = current.comparison.spectra[current.axis].peak()
        if peak is None or peak.chance > POLICY.false_discovery_rate:
            return Candidate(effect, current.axis, "reject")
        least_chance = peak.chance  # the noise of samples is coloured, so the line is judged against its neighbours
        current = current.of_samples()
    tried = choose_variant(current.fit, Term.of(effect, current.axis))
    if not _measurable(tried):
        return Candidate(effect, current.axis, "not_measurable", next_measurement=effect.measure_next)
    fitted = finish(refine(tried))
    term = fitted.terms[-1]
    parameters = _parameters(current.fit, fitted, effect)
    looks = effect.looks(current.runs, current.index)
    chance = max(least_chance, min(1.0, looks * likelihood_ratio(current.fit, fitted, max(1, parameters))[1]))
    gains = held_out_gain(current.fit, fitted, current.folds)
    gain, gain_se = total(gains)
    signal = _signal(fitted)
    excess = explained(current, fitted, signal)
    one_size = isinstance(effect, Wave) and effect.same_size
    partial = (one_size and _uneven(fitted)) or (effect.common_mean and _without_mean(term))
    return Candidate(
        effect, current.axis, "reject", term.values, term.se, gain=gain, gain_se=gain_se, chance=chance, parameters=parameters,
        next_measurement=effect.measure_next, signal=signal, unit_gains=gains, explained=excess.part,
        enough=excess.enough and not partial,
    )  # fmt: skip


def _parameters(current: AxisFit, fitted: AxisFit, effect: Effect) -> int:
    """The number of parameters of the candidate: coefficients, spreads and nonlinear parameters."""
    coefficients = len(fitted.design.layout.fixed) - len(current.design.layout.fixed)
    spreads = fitted.design.layout.n_groups - current.design.layout.n_groups
    return coefficients + spreads + len(effect.nonlinear)


def _uneven(fitted: AxisFit) -> bool:
    """True if a wave that should have the same size in all runs appears only in some of them."""
    layout, mine = fitted.design.layout, len(fitted.design.terms) - 1
    own = [j for j, (i, _) in enumerate(layout.run) if i == mine]
    if not own:
        return False
    free = Spreads(10 * fitted.spreads.run, fitted.spreads.scenario)  # a run's size without shrinkage
    runs = range(len(fitted.design.blocks))
    square = [float(np.sum(fitted.run_coefficients(i, fitted.solution.beta, free)[own] ** 2)) for i in runs]
    return float(np.median(square)) < POLICY.even**2 * float(np.mean(square))


def _without_mean(term: Term) -> bool:
    """True if an effect that should have a common mean over the runs has none that differs from zero."""
    mean = [(abs(term.values[n]), term.se.get(n, 0.0)) for n in term.effect.used(term.values) if n in term.values]
    return all(size < POLICY.mean_errors * se for size, se in mean)


def _measurable(tried: AxisFit) -> bool:
    """True if the candidate's columns are not a combination of the model's own columns."""
    layout, mine = tried.design.layout, len(tried.design.terms) - 1
    own = [1 + len(layout.fixed) + j for j, (i, _) in enumerate(layout.run) if i == mine]
    shared = [1 + j for j, (i, _) in enumerate(layout.fixed) if i == mine]
    others = [1 + j for j, (i, _) in enumerate(layout.fixed) if i != mine]
    gram = tried.grams.sum(axis=0)
    rest = gram[np.ix_(others, others)]
    for c in own or shared:
        norm = gram[c, c]
        inside = gram[c, others] @ np.linalg.lstsq(rest, gram[others, c], rcond=None)[0] if others else 0.0
        if norm > 0 and norm - inside > POLICY.measurable * norm:
            return True
    return False


def _signal(fitted: AxisFit) -> Array:
    """The candidate's fitted term at every block, orthogonal to the model's shared columns, shape [blocks].

    Each block is scaled by the square root of its number of samples, so that the sum of squares (dps^2) is that over all
    samples.
    """
    mine = len(fitted.design.terms) - 1
    layout = fitted.design.layout
    p = len(layout.fixed)
    parts, rests = [], []
    for i, b in enumerate(fitted.design.blocks):
        matrix, n = fitted.design.columns(i), b.n
        u = fitted.run_coefficients(i, fitted.solution.beta, fitted.spreads)
        weight = np.sqrt(n)
        part = sum(
            (fitted.solution.beta[j] * matrix[1 + j] for j, (t, _) in enumerate(layout.fixed) if t == mine),
            np.zeros(n.size),
        )
        part = part + sum(
            (u[j] * matrix[1 + p + j] for j, (t, _) in enumerate(layout.run) if t == mine), np.zeros(n.size)
        )
        parts.append(part * weight)
        rests.append((matrix[[1 + j for j, (t, _) in enumerate(layout.fixed) if t != mine]] * weight).T)
    part, rest = np.concatenate(parts), np.concatenate(rests)
    return np.asarray(part - rest @ np.linalg.lstsq(rest, part, rcond=None)[0])
