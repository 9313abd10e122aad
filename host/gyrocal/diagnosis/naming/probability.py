"""The probability of each candidate, by the evidence of sets of effects, and the names that it does not support.

The tests of the other files ask whether an effect explains the session better than nothing does. The evidence asks whether it
explains the session better than other sets, and than a disturbance without a name. A name that only the first are sure of is
suggested.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from math import hypot
from typing import Any

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate, best_first
from gyrocal.diagnosis.naming.decision import evident_gain, in_range
from gyrocal.diagnosis.naming.rivals import cosine
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.rounding import is_of_reference
from gyrocal.digits import percentage
from gyrocal.evidence import hypotheses
from gyrocal.evidence.answer import TOLD, Alternative, Evidence, weigh
from gyrocal.evidence.curve import beyond, of_noise, of_set
from gyrocal.policy import POLICY
from gyrocal.threads import each
from gyrocal.variables.time import Time

Progress = Callable[[str], None]


@dataclass(frozen=True)
class OnAxis:
    """A set of effects that explains one axis, with its probability."""

    axis: str
    found: Alternative
    probability: float
    """As it is stated."""

    @staticmethod
    def of(axis: str, found: Alternative) -> OnAxis:
        """With the probability that the curve gives the set by itself."""
        return OnAxis(axis, found, of_noise(found.log_odds) if found.noise_alone else of_set(found.log_odds))

    def to_json(self) -> dict[str, Any]:
        found = self.found
        return {
            "axis": self.axis, "effects": list(found.effects), "unnamed": list(found.unnamed), "probability": self.probability,
        }  # fmt: skip


def with_probabilities(
    candidates: Sequence[Candidate], comparison: Comparison, progress: Progress | None = None
) -> tuple[list[Candidate], list[OnAxis]]:
    """The candidates with their probabilities and checks, as far as they can be judged, and the sets that explain each axis.

    Nothing can be judged where only the net angle of each run is known.
    """
    if all(run.rate_is_mean for run in comparison.fit.session.runs):
        return list(candidates), []

    def on(axis: str) -> Evidence | None:
        if progress is not None:
            progress(f"weighing sets of effects on {axis}")
        return _on_axis([c for c in candidates if c.axis == axis], Current.of(comparison, axis))

    axes = comparison.judged
    evidence = dict(zip(axes, each(on, axes, comparison.fit.session.rows), strict=True))
    out = []
    for c in candidates:
        found = evidence.get(c.axis)
        if found is not None and c.decision != "not_measurable" and c.effect.id in found.log_odds:
            log_odds, checks = found.log_odds[c.effect.id], found.checks.get(c.effect.id)
            of_group = found.of_any(c.group) if len(c.group) > 1 else None
            c = replace(c, log_odds=log_odds, checks=checks, group_log_odds=of_group)
        out.append(c)
    sets = [OnAxis.of(axis, a) for axis, found in evidence.items() if found is not None for a in found.alternatives]
    return out, sets


def told_sets(sets: Sequence[OnAxis], candidates: Sequence[Candidate]) -> list[OnAxis]:
    """The sets that have a probability worth telling beside the stated ones of the ``candidates``, best first.

    The sets that hold an effect are together no more probable than the effect is said to be, and all sets with something in
    them no more than what noise alone leaves.
    """
    stated = {(c.effect.id, c.axis): c.probability for c in candidates if c.probability is not None}
    sums: dict[tuple[str, str], float] = {}
    for one in sets:
        for key in ((effect, one.axis) for effect in one.found.effects):
            sums[key] = sums.get(key, 0.0) + one.probability

    def part(one: OnAxis) -> float:
        keys = ((effect, one.axis) for effect in one.found.effects)
        return min((min(1.0, stated[key] / sums[key]) for key in keys if key in stated), default=1.0)

    told = _beside_noise([replace(one, probability=one.probability * part(one)) for one in sets])
    axes = list(dict.fromkeys(one.axis for one in sets))
    return sorted((one for one in told if one.probability >= TOLD), key=lambda one: (axes.index(one.axis), -one.probability))


def _beside_noise(sets: Sequence[OnAxis]) -> list[OnAxis]:
    """The sets of each axis, those with something in them with no more than noise alone leaves together."""
    noise = {one.axis: one.probability for one in sets if one.found.noise_alone}
    others: dict[str, float] = {}
    for one in sets:
        if not one.found.noise_alone:
            others[one.axis] = others.get(one.axis, 0.0) + one.probability

    def left(one: OnAxis) -> OnAxis:
        room = 1 - noise.get(one.axis, 0.0)
        too_much = not one.found.noise_alone and others[one.axis] > room
        return replace(one, probability=one.probability * room / others[one.axis]) if too_much else one

    return [left(one) for one in sets]


def improbable_noise(sets: Sequence[OnAxis], comparison: Comparison) -> list[Finding]:
    """A finding on each axis where more than noise acts: noise alone is improbable and the excess is of practical size.

    Where the excess is smaller, the evidence must be as sure as it can be: smaller odds may be those of a drift that the states
    of the noise do not describe. The finding is against what the likeliest set has without a name, or against the variable that
    fits best; what follows the rate must be larger than rounding of the reference makes it. ``sets`` are those of
    :func:`with_probabilities`.
    """
    out = []
    for axis, noise, told in ((one.axis, one.found, one.probability) for one in sets if one.found.noise_alone):
        matters = told < POLICY.adequate_noise and comparison.excess_share(axis) > POLICY.practical_excess
        if axis in comparison.unsure or not (matters or beyond(-noise.log_odds)):
            continue
        something = (one.found for one in sets if one.axis == axis and not one.found.noise_alone)
        best, nearest = next(something, noise), comparison.nearest.get(axis)
        against = best.unnamed[0] if best.unnamed else Time.name if nearest is None else nearest.against
        amplitude_dps = 0.0 if nearest is None else nearest.amplitude_dps
        same = nearest is not None and nearest.against == against
        if same and is_of_reference(against, amplitude_dps, comparison.fit.axes[axis]):
            continue
        words = " and ".join([*best.effects, *(f"something that follows {left.replace('_', ' ')}" for left in best.unnamed)])
        probability = f"of {percentage(told)}" if told >= TOLD else f"below {percentage(TOLD)}"
        likeliest = f"; the likeliest of what may be there is {words}" if words else ""
        note = f"noise alone has a probability {probability}{likeliest}"
        strength = float(np.sqrt(-2 * noise.log_odds))
        out.append(Finding(axis, against, strength, noise.probability, amplitude_dps, note, of_sets=True))
    return sorted(out, key=lambda f: -f.strength)


Beside = Callable[[Sequence[Candidate], Sequence[Candidate]], list[Candidate]]
"""Those of the second candidates that gain beside the first ones, as :func:`gyrocal.diagnosis.naming.beside.beside_sure`."""


def decided(candidates: Sequence[Candidate], failing: Set[str], beside: Beside) -> list[Candidate]:
    """The candidates, best first, with the decisions on which tests and evidence agree.

    A sure name of the tests that the evidence can judge and does not support is suggested, and so are rivals of which it is not
    sure that any acts, or one of which fails a check. On an axis that is known to fail (``failing``) and has no other name, an
    effect that the tests suggest, or cannot tell from its rivals, is named if the evidence is sure of it, has weighed all these
    rivals, none of them has the same shape, and no effect that it is not sure of gains more on held-out data: a shape without
    a name may have supplied what the one lacks. Beside a sure name, every such effect is named that gains beside it, whatever
    the tests make of it alone, and none is suggested that is improbable. What is about as probable as not is suggested.
    """
    weighed = {(c.effect.id, c.axis): c for c in candidates if c.log_odds is not None}

    def told_apart(c: Candidate, rival: Candidate | None) -> bool:
        return rival is not None and (rival is c or cosine(c.signal, rival.signal) <= POLICY.same_shape)

    def alone(c: Candidate) -> bool:
        return all(told_apart(c, weighed.get((id_, c.axis))) for id_ in c.group)

    def unlike(c: Candidate) -> bool:
        return c.doubted or (c.checks is not None and c.log_odds is not None and not c.checks.passed(c.log_odds))

    sure = {c.axis for c in candidates if c.named and not c.doubted}

    def named(c: Candidate) -> bool:
        told = c.decision in ("add", "suggest") and not c.contradicted and evident_gain(c)
        return told and alone(c) and c.axis in failing - sure and in_range(c) and c.sure

    likely = [c for c in candidates if not c.named and named(c)]
    found = {(c.effect.id, c.axis): c for c in likely if not any(_outdoes(o, c) for o in candidates if o not in likely)}
    settled = {(id_, c.axis) for c in found.values() for id_ in c.group}
    settled |= {(id_, c.axis) for c in candidates if c.decision == "add" and len(c.group) > 1 and unlike(c) for id_ in c.group}
    out = []
    for c in candidates:
        key = c.effect.id, c.axis
        if key in found:
            c = replace(c, decision="add", group=())
        elif c.decision == "add" and (c.doubted or key in settled):
            c = replace(c, decision="suggest", group=())
        out.append(c)
    joined: dict[tuple[str, str], Candidate] = {}
    for axis in sorted({c.axis for c in out if c.named}):
        joined |= {(c.effect.id, c.axis): c for c in _joined(out, axis, alone, beside)}

    def left(c: Candidate) -> Candidate:
        beaten = c.decision == "add" and len(c.group) > 1 and any((id_, c.axis) in joined for id_ in c.group)
        return replace(c, decision="suggest", group=()) if beaten else c

    told = [joined.get((c.effect.id, c.axis)) or left(c) for c in out]
    hints = {(c.effect.id, c.axis) for c in candidates if c.decision == "suggest"}
    return sorted((_likely(c) for c in _without_echoes(told, hints)), key=best_first)


def _without_echoes(candidates: Sequence[Candidate], hints: Set[tuple[str, str]]) -> list[Candidate]:
    """The candidates without ``hints`` of the tests that a sure name of their axis leaves improbable: they resemble it."""
    named = {c.axis for c in candidates if c.named}

    def echo(c: Candidate) -> bool:
        improbable = c.probability is not None and c.probability < POLICY.least_hint
        return c.decision == "suggest" and (c.effect.id, c.axis) in hints and c.axis in named and improbable

    return [replace(c, decision="reject", group=()) if echo(c) else c for c in candidates]


def _likely(c: Candidate) -> Candidate:
    """The candidate, suggested if it is about as probable as not, passes its checks and predicts held-out data no worse."""
    likely = c.probability is not None and c.probability >= POLICY.likely_hint and c.checks is not None
    possible = not c.contradicted and in_range(c) and (c.gain is None or c.gain > 0.0)
    return replace(c, decision="suggest") if c.decision == "reject" and likely and possible else c


def _outdoes(other: Candidate, c: Candidate) -> bool:
    """True if another effect on the axis gains more on held-out data, beyond the errors of both gains."""
    if other.axis != c.axis or other.gain is None or c.gain is None:
        return False
    return other.gain - c.gain > hypot(other.gain_se or 0.0, c.gain_se or 0.0)


def _joined(candidates: Sequence[Candidate], axis: str, alone: Callable[[Candidate], bool], beside: Beside) -> list[Candidate]:
    """The effects that are named beside the sure ones of an axis."""
    mine = [c for c in candidates if c.axis == axis and c.decision != "not_measurable"]
    waiting = [c for c in mine if not c.named and c.sure and c.checks is not None and not c.contradicted and alone(c)]
    waiting.sort(key=lambda c: -(c.log_odds or 0.0))
    return beside([c for c in mine if c.named], waiting) if waiting else []


def _on_axis(candidates: Sequence[Candidate], current: Current) -> Evidence | None:
    """The evidence on one axis, beside what is named there and has no probability, such as a wave or a fault of the reading."""
    runs = [b.run for b in current.fit.design.blocks]
    for c in candidates:
        if c.decision == "add" and not hypotheses.judged(c.effect, runs, current.index):
            current = current.with_effect(c.effect, c.values)
    return weigh(current.fit, [t.effect_id for t in current.fit.terms])
