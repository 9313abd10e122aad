"""The sets of effects that count: from none, adding, dropping and exchanging effects, from several starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import comb

import numpy as np

from gyrocal.evidence.weights import Scales, Weighed

LARGEST_SET = 6
STARTS = 3
"""Number of the likeliest sets of each size from which the search goes on."""
TRIED = 6
"""Number of effects that are added to or exchanged in one set at most."""
HOPELESS = 6.0
"""A set that promises to be less probable than the best one by more than this in the logarithm is not weighed."""
NEGLIGIBLE = 14.0
"""A set whose probability is below that of the best by this many units of the logarithm counts for nothing."""


@dataclass
class Search:
    """The sets of one axis that were weighed."""

    scales: Scales
    found: dict[frozenset[str], Weighed] = field(default_factory=dict)
    gains: dict[frozenset[str], dict[str, float]] = field(default_factory=dict)

    def run(self) -> list[Weighed]:
        """Every set that counts, the most probable first, and after them what shows how far less probable others are."""
        front = [self._weighed(frozenset(), {})]
        known = len(self.scales.of_effect)
        for size in range(1, min(LARGEST_SET, known) + 1):
            for one in front:
                for effect in self._gaining(one):
                    self._weighed(one.effects | {effect}, one.forms)
            of_size = [w for w in self.found.values() if len(w.effects) == size]
            front = sorted(of_size, key=self.log_posterior, reverse=True)[:STARTS]
            if not front or self.log_posterior(front[0]) < self._best() - NEGLIGIBLE:
                break
        self._exchange()
        return self._counting() + self._without()

    def log_posterior(self, weighed: Weighed) -> float:
        """Logarithm of the probability of a set, but for a constant."""
        return weighed.log_evidence + self.log_prior(len(weighed.effects))

    def log_prior(self, size: int) -> float:
        """Logarithm of the probability of one set of this size: 1/2, 1/4, ... for each size, and sets of one size alike."""
        return float((size + 1) * np.log(0.5) - np.log(comb(len(self.scales.of_effect), size)))

    def _best(self) -> float:
        return max(map(self.log_posterior, self.found.values()))

    def _counting(self) -> list[Weighed]:
        least = self._best() - NEGLIGIBLE
        kept = [w for w in self.found.values() if self.log_posterior(w) > least]
        return sorted(kept, key=self.log_posterior, reverse=True)

    def _without(self) -> list[Weighed]:
        """For each effect that all sets that count hold, the most probable set without it."""
        counting = self._counting()
        held = frozenset.intersection(*(w.effects for w in counting)) if counting else frozenset[str]()
        out: dict[frozenset[str], Weighed] = {}
        for effect in held:
            without = [w for w in self.found.values() if effect not in w.effects and np.isfinite(w.log_evidence)]
            if without:
                best = max(without, key=self.log_posterior)
                out[best.effects] = best
        return list(out.values())

    def _exchange(self) -> None:
        """Drop and exchange effects of the best sets, until none of them is better."""
        done: set[frozenset[str]] = set()
        for _ in range(2 * LARGEST_SET):
            best = next((w for w in self._counting()[:STARTS] if w.effects not in done), None)
            if best is None:
                return
            done.add(best.effects)
            for effect in best.effects:
                less = self._weighed(best.effects - {effect}, best.forms)
                for other in self._gaining(less):
                    self._weighed(less.effects | {other}, less.forms)
            if len(best.effects) < LARGEST_SET:
                for effect in self._gaining(best):
                    self._weighed(best.effects | {effect}, best.forms)

    def _gaining(self, weighed: Weighed) -> list[str]:
        """The effects that gain most beside a set, by their evidence in its likeliest states, as far as they are worth it."""
        if len(weighed.effects) == len(self.scales.of_effect):
            return []
        if weighed.effects not in self.gains:
            self.gains[weighed.effects] = self.scales.gains(weighed)
        gains, size = self.gains[weighed.effects], len(weighed.effects)
        promised = weighed.log_evidence + self.log_prior(size + 1)
        order = sorted(gains, key=lambda e: gains[e], reverse=True)
        return [e for e in order[:TRIED] if promised + gains[e] > self._best() - HOPELESS]

    def _weighed(self, effects: frozenset[str], start: Mapping[str, tuple[int, int]]) -> Weighed:
        if effects not in self.found:
            self.found[effects] = self.scales.weigh(effects, start)
        return self.found[effects]
