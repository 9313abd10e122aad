"""Which physical effect is the model missing, with evidence on data the fit never saw.

Two tiers. *suggest*: the effect improves the fit beyond chance, false-discovery rate below 5 % over all candidates
(Benjamini-Hochberg). *add*: also its predictions of held-out runs are better by more than two standard errors, its parameters
are in physical range, and it explains at least a tenth of the excess error. Candidates whose signal is the same on this session
form a group; the measurement that parts them is named instead of a cause.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gyrocal.diagnosis.compare import SHEPPARD, Comparison, compare
from gyrocal.effects import base
from gyrocal.effects.base import Effect, Values
from gyrocal.effects.reading_fault import Detected, ReadingFault
from gyrocal.effects.wave import Wave
from gyrocal.error_model.formula import effect_or_formula
from gyrocal.error_model.model import Model, Term
from gyrocal.inference import heldout
from gyrocal.inference.blocks import BLOCK_S, by_sample
from gyrocal.inference.fit import (
    AxisFit,
    carry_spreads,
    choose_variant,
    finish,
    fit_noise,
    likelihood_ratio,
    refine,
    with_noise,
)
from gyrocal.inference.reml import Spreads
from gyrocal.noise.axis import COMPONENTS
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.threads import each, one_thread

FDR = 0.05
FAMILY_ALARM = 0.01
"""Chance that any candidate of a session without effects is named (the contract allows 0.02 for all tests together)."""
SMALLEST_PART = 0.01
"""A candidate with less than this left of its norm beside the model cannot be measured with the session."""
SIMILAR_SHAPE = 0.7
SAME_SHAPE = 0.97
PARAMETER_GAIN = 2.0
"""Held-out log-likelihood that one more parameter must gain where the shapes are the same."""
LEAST_MEAN = 2.0
"""Standard errors that the mean over the runs must be, where an effect has one."""
UNEVEN = 0.5
"""Median over rms of a wave's size in each run: noise alone has 0.83, a wave in half of the runs and fewer next to nothing."""
NOISY_COLUMNS = 0.01
"""Of a large gain, what measured columns (an accelerometer's) lose by their own noise against computed ones."""
LEAST_EXPLAINED = 0.10
MOST_EXPLAINED = 0.5
"""An effect that explains more than this of the excess is what is most wrong, whatever shows it best."""
LEAST_OF_FINDING = 0.25
"""Of the log-likelihood that the strongest probe gains: a cause gains about as much, its shadows less."""
RANGE_FACTOR = 10.0

Decision = Literal["add", "suggest", "reject", "not_measurable"]
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Candidate:
    """One effect on one axis, judged."""

    effect: Effect
    axis: str
    decision: Decision
    values: Values = field(default_factory=dict)
    se: Values = field(default_factory=dict)
    explained: float | None = None
    gain: float | None = None
    gain_se: float | None = None
    chance: float = 1.0
    q_value: float | None = None
    group: tuple[str, ...] = ()
    next_measurement: str = ""
    parameters: int = 0
    signal: Array | None = field(default=None, repr=False)
    unit_gains: Array | None = field(default=None, repr=False)
    enough: bool = False
    """Explains at least a tenth of the excess error, as far as that is known."""

    def to_json(self) -> dict[str, Any]:
        units = {p.name: p.unit for p in self.effect.parameters}
        return {
            "effect": self.effect.id,
            "axis": self.axis,
            "parameters": {
                name: {
                    "value": value,
                    "se": _finite(self.se.get(name)),
                    "unit": units.get(name, units.get(name.removesuffix("_sd"), "")),
                }
                for name, value in self.values.items()
            },
            "explained": self.explained,
            "heldout_gain": self.gain,
            "heldout_gain_se": self.gain_se,
            "q_value": self.q_value,
            "group": list(self.group),
            "decision": self.decision,
            "next_measurement": self.next_measurement,
        }


@dataclass(frozen=True)
class Diagnosis:
    """Candidates best first, and the verdict: add, ambiguous, unknown, adequate or implausible."""

    verdict: str
    candidates: list[Candidate]
    unknown: dict[str, Any] | None
    comparison: Comparison = field(repr=False)

    @property
    def best(self) -> Candidate | None:
        return next((c for c in self.candidates if c.decision == "add"), None)

    def to_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict, "candidates": [c.to_json() for c in self.candidates], "unknown": self.unknown,
            "warnings": [w.to_json() for w in self.comparison.warnings],
        }  # fmt: skip


@one_thread
def diagnose(
    session: Session,
    model: Model | str | Path | None = None,
    *,
    formulas: Sequence[str] = (),
    progress: Progress | None = None,
) -> Diagnosis:
    """Rank every effect of the library, and the ``formulas`` given, on every axis as the one that the model lacks."""
    own = [effect_or_formula(text) for text in formulas]
    comparison = compare(session, model, progress=progress)

    def on(axis: str) -> list[Candidate]:
        return _candidates_on(session, comparison, axis, own, progress)

    judged = list(chain.from_iterable(each(on, comparison.judged, session.rows)))
    judged = _decide(_q_values(judged), comparison)
    order = {"add": 0, "suggest": 1, "reject": 2, "not_measurable": 3}
    judged = _groups(judged)
    judged.sort(key=lambda c: (order[c.decision], -(c.gain if c.gain is not None else -np.inf)))
    verdict = "adequate"
    best = next((c for c in judged if c.decision == "add"), None)
    unknown = None
    if comparison.implausible:
        verdict = "implausible"
    elif best is not None:
        verdict = "ambiguous" if len(best.group) > 1 else "add"
    elif comparison.where:
        verdict = "unknown"
        finding = comparison.where[0]
        unknown = {
            "axis": finding.axis, "against": finding.against, "shape": finding.note, "amplitude_dps": finding.amplitude_dps,
        }  # fmt: skip
    return Diagnosis(verdict, judged, unknown, comparison)


def _candidates_on(
    session: Session, comparison: Comparison, axis: str, own: list[Effect], progress: Progress | None
) -> list[Candidate]:
    current = comparison.fit.axes[axis]
    present = {t.effect_id for t in current.terms}
    folds = heldout.folds(comparison.fit)
    before = _mean_squares(comparison, axis, current, folds)[0] if folds else None
    out = []
    for kind in [*base.effects().values(), *own]:
        if kind.id in present or kind.role is not None:
            continue
        if progress is not None:
            progress(f"trying {kind.id} on {axis}")
        lacking = kind.missing(session.runs, AXES.index(axis))
        if lacking is not None:
            out.append(Candidate(kind, axis, "not_measurable", next_measurement=f"needs {lacking}"))
        else:
            out.append(_judge(comparison, current, axis, kind, before))
    return out


def _judge(
    comparison: Comparison, current: AxisFit, axis: str, kind: Effect, before: float | None = None
) -> Candidate:  # fmt: skip
    """Fit one candidate beside the model, noise and all; measure what it gains in and out of sample.

    ``before``: mean square of the model's own held-out residuals, dps^2, where it is known already.
    """
    found = None if kind.fault is None else kind.fault.detect([b.run for b in current.design.blocks], current.design.axis)
    if found is not None:
        return _judge_reading(comparison, current, axis, kind, found)
    if isinstance(kind, ReadingFault):
        return Candidate(kind, axis, "reject")
    if kind.fast:
        peak = comparison.spectra[axis].peak()
        if peak is None or peak[2] > FDR:
            return Candidate(kind, axis, "reject")
        cell_s = current.design.cell_s or BLOCK_S
        design = current.design.over(by_sample(comparison.fit.blocks), cell_s=cell_s)
        current, before = fit_noise(design, start=current), None
    tried = choose_variant(current, Term.of(kind, axis))
    if not _measurable(current, tried):
        return Candidate(kind, axis, "not_measurable", next_measurement=kind.measure_next)
    fitted = finish(refine(tried))
    term = fitted.terms[-1]
    count = len(fitted.design.layout.fixed) - len(current.design.layout.fixed)
    spreads = fitted.design.layout.n_groups - current.design.layout.n_groups
    nonlinear = len(kind.nonlinear)
    looks = kind.looks([b.run for b in current.design.blocks], current.design.axis)
    chance = min(1.0, looks * likelihood_ratio(current, fitted, max(1, count + spreads + nonlinear))[1])
    folds = heldout.folds(comparison.fit)
    gains = held_out_gain(current, fitted, folds)
    signal = _signal(fitted)
    explained, enough = _explained(comparison, axis, current, fitted, folds, signal, before)
    partial = (isinstance(kind, Wave) and kind.same_size and _uneven(fitted)) or (kind.common_mean and _without_mean(term))
    total = float(np.sum(gains)) if gains.size else None
    se = float(np.sqrt(gains.size) * np.std(gains, ddof=1)) if gains.size > 1 else None
    return Candidate(
        kind, axis, "reject", term.values, term.se, gain=total, gain_se=se, chance=chance,
        parameters=count + spreads + nonlinear, next_measurement=kind.measure_next,
        signal=signal, unit_gains=gains, explained=explained,
        enough=enough and not partial,
    )  # fmt: skip


def _uneven(fitted: AxisFit) -> bool:
    """Is a wave that should have one size in all runs only in some of them?"""
    layout, mine = fitted.design.layout, len(fitted.design.terms) - 1
    own = [j for j, (i, _) in enumerate(layout.run) if i == mine]
    if not own:
        return False
    free = Spreads(10 * fitted.spreads.run, fitted.spreads.scenario)  # of a run's own size, not drawn to that of all
    runs = range(len(fitted.design.blocks))
    square = [float(np.sum(fitted.run_coefficients(i, fitted.solution.beta, free)[own] ** 2)) for i in runs]
    return float(np.median(square)) < UNEVEN**2 * float(np.mean(square))


def _without_mean(term: Term) -> bool:
    """Is nothing left of what an effect should do alike in all runs?"""
    mean = [(abs(term.values[n]), term.se.get(n, 0.0)) for n in term.effect.used(term.values) if n in term.values]
    return all(size < LEAST_MEAN * se for size, se in mean)


def _judge_reading(
    comparison: Comparison, current: AxisFit, axis: str, kind: Effect, found: Detected
) -> Candidate:
    """A fault of the reading: found in the readings' own values, judged by how much better held-out readings are met."""
    values, se, chance = found.values, found.se, found.chance
    term = Term(kind.id, axis, values, se)
    design = current.design.over(comparison.fit.blocks, [*current.design.terms, term])
    fitted = fit_noise(design, start=with_noise(design, current.noise, carry_spreads(current, design)))
    folds = heldout.folds(comparison.fit)
    before, after = (_run_powers(comparison, axis, f, folds) for f in (current, fitted))
    power = max(comparison.white_power[axis], _rounding_power(comparison, axis))
    gains = np.array([_power_gain(*before[file], after[file][0], power) for file in before])
    total = float(np.sum(gains)) if gains.size else None
    spread = float(np.sqrt(gains.size) * np.std(gains, ddof=1)) if gains.size > 1 else None
    return Candidate(
        kind, axis, "reject", values, se, gain=total, gain_se=spread, chance=chance, parameters=1,
        next_measurement=kind.measure_next, unit_gains=gains,
        explained=_explained(comparison, axis, current, fitted, folds, np.zeros(0))[0],
        enough=True,  # seen in the codes themselves; it need not leave an error over the floor
    )  # fmt: skip


def _rounding_power(comparison: Comparison, axis: str) -> float:
    """Mean square, dps^2, that rounding to the readings' own steps leaves: no prediction is better."""
    steps = [run.step_dps[AXES.index(axis)] for run in comparison.fit.session.runs]
    return float(min((s for s in steps if s > 0), default=0.0)) ** 2 * SHEPPARD


def _power_gain(before: float, samples: int, after: float, power: float) -> float:
    """Gain in log-likelihood as a sum of squares falls, dps^2, over noise of mean square ``power``.

    The excess counts as noise of its own: ``samples/2·log(1 + change/power)``, which for small changes is the Gaussian gain at
    known noise, and never exceeds what so many readings of a finite range and step can tell.
    """
    change = (before - after) / (samples * power)
    return 0.5 * samples * float(np.copysign(np.log1p(abs(change)), change))


def _run_powers(
    comparison: Comparison, axis: str, fitted: AxisFit, folds: list[heldout.Fold]
) -> dict[str, tuple[float, int]]:
    """Each run's held-out residuals: sum of squares, dps^2, and how many; in sample where nothing can be held out."""
    alone = comparison.fit.on(axis, fitted)
    powers: dict[str, tuple[float, int]] = {}
    for p in heldout.predictions(alone, folds) if folds else heldout.fitted(alone):
        total, count = powers.get(p.run.file, (0.0, 0))
        powers[p.run.file] = total + float(np.sum(p.residual_dps**2)), count + p.residual_dps.size
    return powers


def held_out_gain(current: AxisFit, fitted: AxisFit, folds: list[heldout.Fold]) -> Array:
    """Gain in predictive log-likelihood of each held-out scenario (run, time block), shape [units]."""
    gains: list[float] = []
    for before, after in zip(heldout.steps(current, folds), heldout.steps(fitted, folds), strict=True):
        gains += [after.gain[name] - before.gain[name] for name in before.gain]
    return np.array(gains)


def _measurable(current: AxisFit, tried: AxisFit) -> bool:
    """Does anything of the candidate's columns stand out of the model's own?"""
    mine = len(tried.design.terms) - 1
    layout = tried.design.layout
    own = [1 + len(layout.fixed) + j for j, (i, _) in enumerate(layout.run) if i == mine]
    shared = [1 + j for j, (i, _) in enumerate(layout.fixed) if i == mine]
    if not own and not shared:
        return False
    columns = own or shared
    others = [1 + j for j, (i, _) in enumerate(layout.fixed) if i != mine]
    total = tried.grams.sum(axis=0)
    for c in columns:
        norm = total[c, c]
        if norm <= 0:
            continue
        left = (
            norm - total[c, others] @ np.linalg.lstsq(total[np.ix_(others, others)], total[others, c], rcond=None)[0]
            if others
            else norm
        )
        if left > SMALLEST_PART * norm:
            return True
    return False


def _signal(fitted: AxisFit) -> Array:
    """The candidate's fitted part at every block, shared model columns projected out, shape [blocks].

    Each block is weighted by its number of samples, so that the sum of squares is that over all samples.
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


def _explained(
    comparison: Comparison, axis: str, current: AxisFit, fitted: AxisFit, folds: list[heldout.Fold], signal: Array,
    before: float | None = None,
) -> tuple[float | None, bool]:  # fmt: skip
    """1 - (excess after / excess before)^2 on this axis, held out, the floor the richer model's in both; and is it a tenth?

    A few power cycles say little of the spread of their offsets, so the floor has an error of its own, and the offset of a
    held-out cycle moves its excess by more than a small effect does. The second answer grants both: it asks whether the
    candidate's own power, or the fall of the excess, is a tenth of what is left beyond two standard errors of the floor; or
    whether its power is a tenth of that within power cycles, their offsets left out of both.
    """
    if not folds:
        return None, False
    before = _mean_squares(comparison, axis, current, folds)[0] if before is None else before
    after, after_within = _mean_squares(comparison, axis, fitted, folds)
    white, drift = comparison.white_power[axis], fitted.noise.ou_sd_dps**2
    floor = white + fitted.slow_power
    samples = sum(len(b.run) for b in fitted.design.blocks)
    of_cycles, of_drift = _floor_errors(fitted)
    sure = floor + 2 * float(np.hypot(of_cycles, of_drift))
    sure_within = white + drift + 2 * float(np.hypot(white * np.sqrt(2 / samples), of_drift))
    enough = before - after >= LEAST_EXPLAINED * max(before - sure, 0.0) and before > after
    for power, left in (
        (float(signal @ signal), after - sure),
        (_within_cycles(fitted, signal), after_within - sure_within),
    ):
        power /= samples
        enough = enough or (power >= LEAST_EXPLAINED * (power + max(left, 0.0)) and power > 0)
    if before <= floor:
        return None, enough
    return float(1 - max(0.0, after - floor) / (before - floor)), enough


def _within_cycles(fitted: AxisFit, signal: Array) -> float:
    """Sum of squares of a signal [blocks], as :func:`_signal` gives it, about its mean in each power cycle."""
    if not signal.size:  # a fault of the reading has none
        return 0.0
    weight = np.sqrt(np.concatenate([b.n for b in fitted.design.blocks]))
    cycle = np.repeat(np.unique(fitted.design.scenarios, return_inverse=True)[1], fitted.design.n_blocks)
    mean = np.bincount(cycle, signal * weight) / np.bincount(cycle, weight**2)
    return float(np.sum((signal - mean[cycle] * weight) ** 2))


def _floor_errors(fitted: AxisFit) -> tuple[float, float]:
    """Standard errors of the floor's squares, dps^2: so many power cycles, so much time for drift to turn over."""
    cycles = len(np.unique(fitted.design.scenarios))
    seconds = sum(b.run.duration_s for b in fitted.design.blocks)
    turns = len(fitted.design.blocks) + seconds / (2 * fitted.noise.ou_tau_s)
    drift = fitted.noise.ou_sd_dps**2
    return float((fitted.slow_power - drift) * np.sqrt(2 / cycles)), float(drift * np.sqrt(2 / turns))


def _mean_squares(comparison: Comparison, axis: str, fitted: AxisFit, folds: list[heldout.Fold]) -> tuple[float, float]:
    """Mean square of held-out residuals, dps^2, and of what is left of them about the mean of each power cycle."""
    sums: dict[str, Array] = {}
    for p in heldout.predictions(comparison.fit.on(axis, fitted), folds):
        residual = p.residual_dps
        of = np.array([residual @ residual, residual.sum(), residual.size])
        sums[p.run.scenario] = sums.get(p.run.scenario, np.zeros(3)) + of
    squares, totals, counts = np.array(list(sums.values())).reshape(-1, 3).T
    samples = max(float(counts.sum()), 1.0)
    return float(squares.sum()) / samples, float((squares - totals**2 / counts).sum()) / samples


def _q_values(candidates: list[Candidate]) -> list[Candidate]:
    """Benjamini-Hochberg q-values over everything that could be measured."""
    tested = [i for i, c in enumerate(candidates) if c.decision != "not_measurable"]
    order = sorted(tested, key=lambda i: candidates[i].chance)
    q, smallest = {}, 1.0
    for rank in range(len(order), 0, -1):
        i = order[rank - 1]
        smallest = min(smallest, candidates[i].chance * len(order) / rank)
        q[i] = smallest
    return [replace(c, q_value=q[i]) if i in q else c for i, c in enumerate(candidates)]


def _decide(candidates: list[Candidate], comparison: Comparison) -> list[Candidate]:
    tested = sum(c.decision != "not_measurable" for c in candidates)
    out = []
    for c in candidates:
        if c.decision != "not_measurable" and c.q_value is not None and c.q_value < FDR:
            named = _proven(c, tested) and in_range(c) and c.enough and _meets(c, comparison)
            c = replace(c, decision="add" if named else "suggest")
        out.append(c)
    return out


def _meets(c: Candidate, comparison: Comparison) -> bool:
    """Does the candidate go at what is most wrong with the axis? One that picks crumbs beside it is not what is missing."""
    if c.effect.fault_of(c.values) or (c.explained or 0.0) > MOST_EXPLAINED:
        return True
    found = [f.strength**2 / 2 for f in comparison.where if f.axis == c.axis and f.against != "reading"]
    return (c.gain or 0.0) >= LEAST_OF_FINDING * max(found, default=0.0)


def _proven(c: Candidate, tested: int) -> bool:
    """Beyond chance among so many, and better on what the fit never saw."""
    held = c.gain is not None and c.gain_se is not None and c.gain > 2 * c.gain_se
    if c.effect.fault_of(c.values):
        held = held or (c.gain is not None and c.gain >= -1.0)
    return held and c.chance * tested < FAMILY_ALARM


def in_range(candidate: Candidate) -> bool:
    """Every linear parameter at most ten times its typical size; a fault of the reading has no size of its own."""
    if candidate.effect.fault_of(candidate.values):
        return True
    for parameter in candidate.effect.parameters:
        value = candidate.values.get(parameter.name)
        if (
            value is not None
            and parameter.sized
            and abs(value) > RANGE_FACTOR * parameter.typical[1]
        ):
            return False
    return True


def _groups(candidates: list[Candidate]) -> list[Candidate]:
    """Who cannot be told from whom: shapes that overlap, and held-out gains that do not differ by two standard errors.

    Of two with the very same shape the one with more parameters yields, unless it pays for them; a candidate that only just
    failed to pass still counts as a rival of one that passed.
    """
    rivals = [c for c in candidates if c.decision in ("add", "suggest")]
    out = []
    for c in candidates:
        if c.decision != "add":
            out.append(c)
            continue
        same = [c]
        for other in rivals:
            if other is c or other.axis != c.axis:
                continue
            cosine = _cosine(c.signal, other.signal)
            if cosine <= SIMILAR_SHAPE or not _as_good(c, other, _price(c, other) if cosine > SAME_SHAPE else 0.0):
                continue
            if cosine > SAME_SHAPE and c.parameters != other.parameters:
                if other.parameters < c.parameters and other.decision == "add":
                    c = replace(c, decision="suggest")  # the simpler one says the same
                continue
            same.append(other)
        same.sort(key=lambda x: -(x.gain or 0.0))
        ids = tuple(dict.fromkeys(x.effect.id for x in same))
        out.append(replace(c, group=ids if c.decision == "add" else ()))
    return out


def _price(c: Candidate, other: Candidate) -> float:
    """Held-out log-likelihood by which a candidate must beat another of the same shape."""
    if c.parameters == other.parameters:
        return NOISY_COLUMNS * (c.gain or 0.0)
    return PARAMETER_GAIN * max(0, c.parameters - other.parameters)


def _cosine(a: Array | None, b: Array | None) -> float:
    if a is None or b is None or a.shape != b.shape:
        return 0.0
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / norm if norm > 0 else 0.0


def _as_good(c: Candidate, other: Candidate, price: float) -> bool:
    """Is the other's held-out gain at least as large, within two standard errors of the difference or the ``price``?"""
    if c.unit_gains is None or other.unit_gains is None or c.unit_gains.shape != other.unit_gains.shape:
        return False
    difference = c.unit_gains - other.unit_gains
    se = float(np.sqrt(difference.size) * np.std(difference, ddof=1)) if difference.size > 1 else 0.0
    return float(difference.sum()) < max(2 * se, price)


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


@one_thread
def add(
    session: Session, model: Model | str | Path | None, effect_id: str, *, only_day: int | None = None,
    progress: Progress | None = None,
) -> tuple[Comparison, Comparison, Model]:  # fmt: skip
    """Add an effect on every axis where it can be measured and improves the fit; both comparisons held out, one floor.

    A noise that is named instead is added on every axis of the model.
    Returns (before, after, the model with parameters fitted on all data).
    """
    start = Model.open(model)
    before = compare(session, start, only_day=only_day, progress=progress)
    if effect_id in COMPONENTS:
        noisier = reduce(lambda grown, axis: grown.add(effect_id, axis), start.axes, start)
        after = compare(session, noisier, only_day=only_day, progress=progress)
        return compare_again(before, after), after, after.fit.model
    kind = effect_or_formula(effect_id)
    axes = [
        a
        for a in before.fit.axes
        if start.term(kind.id, a) is None and kind.missing(session.runs, AXES.index(a)) is None
    ]

    def on(axis: str) -> Candidate:
        return _judge(before, before.fit.axes[axis], axis, kind)

    judged = dict(zip(axes, each(on, axes, session.rows), strict=True))
    looks = len(base.effects()) * len(judged)  # it was asked for by name, but on which axis it is has to be as sure
    chosen = [a for a, c in judged.items() if c.decision != "not_measurable" and _proven(c, looks)]
    if not chosen:  # nothing proven: on the axis that gains most, so that the person sees whether it helps
        measurable = [a for a, c in judged.items() if c.decision != "not_measurable" and c.values]
        chosen = sorted(measurable, key=lambda a: judged[a].chance)[:1]
    if not chosen:
        lacking = next((kind.missing(session.runs, AXES.index(a)) for a in before.fit.axes), None)
        if all(start.term(kind.id, a) is not None for a in before.fit.axes):
            reason = "the model has it on every axis already"
        elif lacking is not None:
            reason = f"the session lacks {lacking}"
        else:
            reason = f"nothing of it can be seen in this session; {kind.measure_next}"
        before = replace(before, note=f"{kind.id} was not added: {reason}")
    richer = start
    for axis in chosen:
        richer = richer.with_term(Term.of(kind, axis, kind.structure(judged[axis].values)))
    after = compare(session, richer, only_day=only_day, progress=progress)
    before = compare_again(before, after)
    return before, after, after.fit.model


def compare_again(before: Comparison, after: Comparison) -> Comparison:
    """The poorer model's comparison with the richer one's floor."""

    def level(old: Any, floor: float) -> Any:
        if old.rms_dps is None:
            return replace(old, floor_dps=floor)
        return replace(old, floor_dps=floor, excess_dps=float(np.sqrt(max(0.0, old.rms_dps**2 - floor**2))))

    per_axis = {a: level(v, after.per_axis[a].floor_dps) for a, v in before.per_axis.items()}
    return replace(before, pooled=level(before.pooled, after.pooled.floor_dps), per_axis=per_axis)
