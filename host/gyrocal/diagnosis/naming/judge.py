"""The evidence for one candidate: its gain in sample, its gain on held-out data, and the part of the excess it explains."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.explained import Explained, explained
from gyrocal.diagnosis.naming.gains import held_out_gain, total
from gyrocal.diagnosis.naming.reading_evidence import judge_reading
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.naming.wave_sizes import WaveSizes
from gyrocal.diagnosis.residual.coherence import (
    keeps_its_phase,
    keeps_its_size,
    line_of_reference,
    of_the_reference,
    waves_of,
)
from gyrocal.effects.base import Effect, Mask, Objection
from gyrocal.effects.mistaken import must_be_sure
from gyrocal.effects.optional import CourseWithoutData
from gyrocal.effects.order_tone import OrderTone, swept_turns, turns
from gyrocal.effects.reading_fault import ReadingFault
from gyrocal.effects.timing import TimingEffect
from gyrocal.effects.wave import Tone, Wave
from gyrocal.error_model.model import Term
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.identified import UNIDENTIFIED
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.inference.noise_search import carried, fit_noise
from gyrocal.inference.nonlinear import refine
from gyrocal.inference.reml import Spreads
from gyrocal.inference.same_blocks import on_same_blocks
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.structure import choose_variant
from gyrocal.inference.turns import reweighed
from gyrocal.noise.orders import LEAST_TURNS
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.variables.shapes import Columns


def judge(current: Current, effect: Effect, unless: float = 1.0) -> Candidate:
    """Fit one candidate together with the model and the noise, and measure its gain in sample and on held-out data.

    Runs that lack the effect's data are left out of the judgement, as are turns by a known angle from that of a wave, because
    their course is not known beside which they would show it. Held-out data are not used if noise gains as much in sample
    with a probability above ``unless``.
    """
    lacks = np.array([effect.lacks(run) or (isinstance(effect, Wave) and run.rate_is_mean) for run in current.runs])
    if lacks.any() and not lacks.all():
        part = current.of_runs(~lacks)
        return _over_all_runs(_judge(part, effect, unless), current, part, ~lacks)
    return _judge(current, effect, unless)


def _over_all_runs(of_part: Candidate, whole: Current, part: Current, kept: Mask) -> Candidate:
    """A candidate that was judged on some of the runs, with its signal and gains unknown (NaN) in the others."""
    signal, gains = of_part.signal, of_part.unit_gains
    if signal is not None:
        blocks = whole.fit.design.given
        if signal.size != sum(b.start.size for b, keep in zip(blocks, kept, strict=True) if keep):
            blocks = whole.samples  # on which the candidate was judged
        known = np.repeat(kept, [b.start.size for b in blocks])
        signal, of_kept = np.full(known.size, np.nan), signal
        signal[known] = of_kept
    if gains is not None:
        of_unit = dict(zip(part.units, gains, strict=True))
        gains = np.array([of_unit.get(name, np.nan) for name in whole.units])
    return replace(of_part, signal=signal, unit_gains=gains)


def _judge(current: Current, effect: Effect, unless: float) -> Candidate:
    fault = None if effect.fault is None else effect.fault.detect(current.runs, current.index)
    if fault is not None:
        return judge_reading(current, effect, fault)
    if isinstance(effect, ReadingFault):
        return Candidate(effect, current.axis, "reject")
    peak = current.comparison.spectra[current.axis].peak()
    line_chance = 1.0 if peak is None else peak.chance
    tried_on = effect.tried_on(current.runs, current.index, line_chance)
    if tried_on is None:
        return Candidate(effect, current.axis, "reject")
    # the noise of samples is coloured, so a line of constant frequency is judged against its neighbours in the spectrum
    least_chance = line_chance if effect.is_line else 0.0
    blocks = current
    if tried_on == "samples":
        current = current.of_samples()
    next_one = effect.measure_next_in(current.runs)
    tried = choose_variant(current.fit, Term.of(effect, current.axis))
    if not _measurable(tried):
        return Candidate(effect, current.axis, "not_measurable", next_measurement=next_one)
    fitted = finish(reweighed(refine(tried)))
    term = fitted.terms[-1]
    parameters = added_parameters(current.fit, fitted)
    looks = effect.looks(current.runs, current.index)
    chance = max(least_chance, min(1.0, looks.shapes * likelihood_ratio(current.fit, fitted, max(1, parameters))[1]))
    known = [(t.effect, t.values) for t in fitted.terms[:-1]]
    objections = set(effect.objections(term.values, current.runs, current.index, known))
    another = not objections.isdisjoint((Objection.UNSEEN, Objection.REPEATS))
    if chance > unless or another:
        return Candidate(
            effect, current.axis, "reject", term.values, term.se, chance=chance, parameters=parameters, contradicted=another
        )  # fmt: skip
    parameters += looks.values
    gains = held_out_gain(current.fit, fitted, current.folds)
    gain, gain_se = total(gains)
    signal = _signal(fitted)
    if gain is not None and not np.isfinite(gain):  # one unit alone holds the effect, and the others say nothing of its size
        gain = gain_se = None
    excess = Explained(None, False) if gain is None else explained(current, fitted, signal, chance)
    contradicted = (
        (isinstance(effect, Wave) and _contradicted(fitted, effect)) or (effect.common_mean and without_mean(term))
        or contradicts(objections, excess.part)
        or (effect.is_line and line_of_reference(blocks.comparison.fit, blocks.axis, term.values["f_hz"], term.values["A_dps"]))
        or (chance < POLICY.false_discovery_rate and _outdone(current.fit, fitted, effect))
        or (effect.scope == "session" and _held_at_rest(current.fit, fitted))
        or (chance < POLICY.name_alarm and _wave_over_rate(blocks, current.fit, fitted))
    )  # fmt: skip
    if chance < POLICY.name_alarm:  # it may be named, and is told with its whole error
        term = finish(fitted, reported=True).terms[-1]
    return Candidate(
        effect, current.axis, "reject", term.values, term.se, gain=gain, gain_se=gain_se, chance=chance, parameters=parameters,
        next_measurement=next_one, signal=_over_given(fitted, signal), unit_gains=gains, explained=excess.part,
        excess_drop_dps=excess.drop_dps, excess_drop_se_dps=excess.drop_se_dps, enough=excess.enough and not contradicted,
        gain_noise=_gain_noise(fitted), contradicted=contradicted,
    )  # fmt: skip


def contradicts(objections: Collection[Objection], explained: float | None) -> bool:
    """True if fitted values contradict what the effect is; some do only where it explains less than a main cause."""
    main = explained is not None and explained >= POLICY.main_cause
    return Objection.CONTRADICTED in objections or (Objection.MINOR in objections and not main)


def added_parameters(current: AxisFit, fitted: AxisFit) -> int:
    """The number of parameters that a richer fit adds: coefficients, spreads and nonlinear parameters of its further terms."""
    before, after = current.design, fitted.design
    coefficients = len(after.layout.fixed) - len(before.layout.fixed)
    spreads = after.layout.n_groups - before.layout.n_groups
    return coefficients + spreads + sum(len(t.effect.nonlinear) for t in after.terms[len(before.terms) :])


def _contradicted(fitted: AxisFit, wave: Wave) -> bool:
    """True if a wave changes phase or a tone size within the runs, or it is the reference's, or breaks its law of sizes."""
    layout, mine = fitted.design.layout, len(fitted.design.terms) - 1
    columns = [j for j, (i, _) in enumerate([*layout.fixed, *layout.run]) if i == mine]
    waves = waves_of(fitted, columns)
    if not keeps_its_phase(fitted, waves, POLICY.coherent if wave.wanders else POLICY.coherent_turn):
        return True
    if isinstance(wave, Tone) and not keeps_its_size(fitted, waves):
        return True
    own = [j for j, (i, _) in enumerate(layout.run) if i == mine]
    if not own:
        return False
    free = Spreads(10 * fitted.spreads.run, fitted.spreads.scenario)  # a run's size without shrinkage
    first = 1 + len(layout.fixed)
    parts = [
        fitted.run_coefficients(i, fitted.solution.beta, free)[own] @ fitted.design.columns(i)[[first + j for j in own]]
        for i in range(len(fitted.design.blocks))
    ]
    if of_the_reference(fitted, parts):
        return True
    runs, of_table = [b.run for b in fitted.design.blocks], wave.rate_power is not None
    shown = (part for part, run in zip(parts, runs, strict=True) if turns(run) or not of_table)
    squares = np.array([np.mean(part**2) if part.size else 0.0 for part in shown])
    if isinstance(wave, Tone) and float(np.median(squares)) < POLICY.even**2 * float(np.mean(squares)):
        return True
    if wave.rate_power is None:
        return False
    exact = swept_turns(runs) < LEAST_TURNS
    return WaveSizes.of(fitted, own, wave.rate_power).log_odds(wave.rate_power, exact=exact) < 0


def _outdone(current: AxisFit, fitted: AxisFit, effect: Effect) -> bool:
    """True if what can be mistaken for the effect explains the session better, and the effect hardly adds to it."""
    runs = [b.run for b in current.design.blocks]
    others = effect.passes_for_it(runs, current.design.axis)
    return any(_better(current, fitted, other, POLICY.shape_gain if must_be_sure(other) else 0.0) for other in others)


def _held_at_rest(current: AxisFit, fitted: AxisFit) -> bool:
    """True if a constant of each rest, as a tone of the model holds at an unknown angle, explains as much as an effect."""
    if not any(isinstance(term.effect, OrderTone) for term in current.design.terms):
        return False
    rests = [b.run.file for b in current.design.blocks if OrderTone.holds_unknown(b.run)]

    def held(run: Run) -> Array:
        return np.ones((len(run), 1)) * np.array([file == run.file for file in rests], dtype=float)

    return bool(rests) and _better(current, fitted, Columns(held, len(rests)), -POLICY.shape_gain)


def _wave_over_rate(blocks: Current, current: AxisFit, fitted: AxisFit) -> bool:
    """True if a wave over the rate explains the session better than a fitted effect, which hardly adds to it.

    ``blocks`` is the model fitted to block means, in which the wave is looked for.
    """
    wave, alone = blocks.rate_wave, fitted.loglik - current.loglik
    if wave is None or wave.gain < POLICY.of_finding * alone:
        return False
    return _better(current, fitted, wave.shape, wave.penalty)


def _better(current: AxisFit, fitted: AxisFit, shape: Effect, penalty: float = 0.0) -> bool:
    """True if a shape gains more than a fitted effect by at least ``penalty``, and the effect hardly adds to the shape."""
    current, fitted = on_same_blocks(current, fitted)
    other = Term("mistaken", AXES[current.design.axis], {}, own=shape)
    beside = refine(choose_variant(current, other))
    found = beside.terms[-1]
    both = _with(fitted, replace(other, values=found.values))
    alone = max(fitted.loglik - current.loglik, 0.0)
    return beside.loglik > fitted.loglik + penalty and both.loglik - beside.loglik < POLICY.of_finding * alone


def _with(fit: AxisFit, term: Term) -> AxisFit:
    design = fit.design.changed([*fit.design.terms, term])
    return fit_noise(design, start=carried(fit, design))


def without_mean(term: Term) -> bool:
    """True if an effect that should have a common mean over the runs has none that differs from zero."""
    mean = [(abs(term.values[n]), term.se.get(n, 0.0)) for n in term.effect.coding.used(term.values) if n in term.values]
    return all(size < POLICY.mean_errors * se for size, se in mean)


def not_measurable(current: Current, effect: Effect, lacking: str) -> Candidate:
    """A candidate whose data the session lacks (``lacking``, in words), with what is known of its course nevertheless."""
    known = [effect.unmeasured(run, current.index) if isinstance(effect, CourseWithoutData) else None for run in current.runs]
    signal = None
    if all(column is not None for column in known):
        means = [b.mean(np.asarray(c)[:, None])[:, 0] for b, c in zip(current.fit.design.blocks, known, strict=True)]
        signal = _over_given(current.fit, _beside_model(current.fit, means))
    return Candidate(effect, current.axis, "not_measurable", next_measurement=f"needs {lacking}", signal=signal)


def _over_given(fitted: AxisFit, signal: Array) -> Array:
    """A signal of the blocks that a fit sees over all blocks, so that signals of different candidates compare."""
    return fitted.design.over_given(np.split(signal, np.cumsum(fitted.design.n_blocks)[:-1]))


def _beside_model(fitted: AxisFit, means: Sequence[Array]) -> Array:
    """Block means of each run, weighted as in :func:`_signal`, orthogonal to the model's shared columns, shape [blocks]."""
    design, shared = fitted.design, slice(1, 1 + len(fitted.design.layout.fixed))
    weights = [np.sqrt(b.n) for b in design.blocks]
    part = np.concatenate([m * w for m, w in zip(means, weights, strict=True)])
    rest = np.concatenate([(design.columns(i)[shared] * w).T for i, w in enumerate(weights)])
    left = part - rest @ np.linalg.lstsq(rest, part, rcond=None)[0]
    return np.where(np.linalg.norm(left) > UNIDENTIFIED**0.5 * np.linalg.norm(part), left, 0.0)


def _gain_noise(fitted: AxisFit) -> float:
    """Standard deviation of the log-likelihood over the noise of the candidate's columns: of that noise times the readings'."""
    layout, mine = fitted.design.layout, len(fitted.design.terms) - 1
    own = [j for j, (i, _) in enumerate(layout.fixed) if i == mine]
    of_noise = fitted.design.left_white(fitted.noise) @ fitted.design.column_noise[:, own, 0]
    power = float(of_noise @ fitted.solution.beta[own] ** 2)
    return float(np.sqrt(max(power, 0.0)) / fitted.noise.white_sd_dps)


def _measurable(tried: AxisFit) -> bool:
    """True if the candidate's columns are not a combination of the model's own columns."""
    layout, mine = tried.design.layout, len(tried.design.terms) - 1
    own = [1 + len(layout.fixed) + j for j, (i, _) in enumerate(layout.run) if i == mine]
    shared = [1 + j for j, (i, _) in enumerate(layout.fixed) if i == mine]
    others = [1 + j for j, (i, _) in enumerate(layout.fixed) if i != mine]
    stated = [1 + j for j, (i, _) in enumerate(layout.fixed) if tried.design.terms[i].effect.role is not None]
    gram = tried.grams.sum(axis=0)

    def beyond(c: int, columns: list[int]) -> float:
        """The squared norm of a column that is independent of other columns."""
        rest = gram[np.ix_(columns, columns)]
        return float(gram[c, c] - gram[c, columns] @ np.linalg.lstsq(rest, gram[columns, c], rcond=None)[0])

    for c in own or shared:
        norm = beyond(c, stated) if tried.design.terms[mine].effect.origin_free else float(gram[c, c])
        if norm > UNIDENTIFIED * gram[c, c] and beyond(c, others) > POLICY.measurable * norm:
            return True
    return False


def _signal(fitted: AxisFit) -> Array:
    """The candidate's fitted term at every block, orthogonal to the model's shared columns, shape [blocks].

    Each block is scaled by the square root of its number of samples, so that the sum of squares (dps^2) is that over all
    samples.
    """
    mine = len(fitted.design.terms) - 1
    layout, term = fitted.design.layout, fitted.terms[-1]
    p = len(layout.fixed)
    parts, rests = [], []
    for i, b in enumerate(fitted.design.blocks):
        matrix, n = fitted.design.columns(i), b.n
        u = fitted.run_coefficients(i, fitted.solution.beta, fitted.spreads)
        weight = np.sqrt(n)
        part: Array = sum(
            (fitted.solution.beta[j] * matrix[1 + j] for j, (t, _) in enumerate(layout.fixed) if t == mine),
            np.zeros(n.size),
        )
        part = part + sum(
            (u[j] * matrix[1 + p + j] for j, (t, _) in enumerate(layout.run) if t == mine), np.zeros(n.size)
        )
        if isinstance(term.effect, TimingEffect):  # its column is only a derivative
            part = b.mean(term.effect.term(b.run, fitted.design.axis, term.values)[:, None])[:, 0]
        parts.append(part * weight)
        rests.append((matrix[[1 + j for j, (t, _) in enumerate(layout.fixed) if t != mine]] * weight).T)
    part, rest = np.concatenate(parts), np.concatenate(rests)
    return np.asarray(part - rest @ np.linalg.lstsq(rest, part, rcond=None)[0])
