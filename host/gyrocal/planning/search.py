"""The search for a plan: the best of all plans of one kind of power cycle, then exchanges (Fedorov 1972) of single cycles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gyrocal.planning.contest import Chosen, Contest
from gyrocal.planning.precision import Precision
from gyrocal.recording.session import Array

SLOTS = 12
"""Parts of a plan that are exchanged as one, so that long plans take no longer than short ones."""
SWEEPS = 3
ENOUGH = 5.0
"""Standard deviations beyond which a contest is won, and others are looked after."""


class Criterion(Protocol):
    """What a plan is judged by."""

    def scores(self, chosen: Chosen, candidates: Chosen) -> Array:
        """How good the plan with each candidate added is, [candidates]: it grows with the power, also where that is flat."""

    def power(self, chosen: Chosen) -> float:
        """Probability that the session with these power cycles added answers the question."""


@dataclass(frozen=True)
class ToTellApart(Criterion):
    """The contests of each effect in question, true in turn, against the others and against none: [truths][rivals]."""

    contests: Sequence[Sequence[Contest]]

    def scores(self, chosen: Chosen, candidates: Chosen) -> Array:
        worst = []
        for against in self.contests:
            found = [contest.strengths(chosen, candidates) for contest in against]
            margins = [np.minimum(c.margin(*f), ENOUGH) + 1e-3 * np.log1p(f[1]) for c, f in zip(against, found, strict=True)]
            worst.append(np.min(margins, axis=0))
        return np.asarray(np.mean(worst, axis=0))

    def power(self, chosen: Chosen) -> float:
        powers = []
        for against in self.contests:
            spread = against[0].relative_error
            powers.append(min(contest.power(chosen, spread) for contest in against))
        return float(np.mean(powers))


@dataclass(frozen=True)
class ToMeasure(Criterion):
    """The precision of one parameter."""

    precision: Precision

    def scores(self, chosen: Chosen, candidates: Chosen) -> Array:
        return -np.log(self.precision.errors(chosen, candidates))

    def power(self, chosen: Chosen) -> float:
        return self.precision.power(chosen)


def search(criterion: Criterion, runs: Sequence[int], most_runs: int) -> dict[int, int]:
    """The numbers of the best plan's power cycles by kind. ``runs`` [kinds] are the runs of each."""
    kinds = [k for k, n in enumerate(runs) if n <= most_runs]
    if not kinds:
        return {}
    whole = [(k, float(most_runs // runs[k])) for k in kinds]
    best = kinds[int(np.argmax(criterion.scores((), whole)))]
    number = most_runs // runs[best]
    slots = [(best, float(len(part))) for part in np.array_split(np.arange(number), min(SLOTS, number))]
    score = float(criterion.scores(slots, ((0, 0.0),))[0])
    for _ in range(SWEEPS):
        before = score
        for i, (kind, times) in enumerate(slots):
            others = slots[:i] + slots[i + 1 :]
            length = times * runs[kind]
            fitting = [(k, length // runs[k]) for k in kinds if runs[k] <= length]
            found = criterion.scores(others, fitting)
            if found.max() > score + 1e-6:
                score, slots[i] = float(found.max()), fitting[int(np.argmax(found))]
        if score <= before + 1e-6:
            break
    left = most_runs - round(sum(n * runs[k] for k, n in slots))
    single = [(k, float(left)) for k in kinds if runs[k] == 1]
    if left and single:
        slots.append(single[int(np.argmax(criterion.scores(slots, single)))])
    out: dict[int, int] = {}
    for kind, times in slots:
        out[kind] = out.get(kind, 0) + round(times)
    return {kind: n for kind, n in out.items() if n}
