"""The best possible answer: probabilities of effects for one who knows the true noise, the shapes and the disturbance.

The sizes are integrated: each is normal with a standard deviation log-uniform from the low end of the typical range to ten
times its high end. Nonlinear parameters of rivals are equally probable on a grid, those of the planted effects are known.
A set of effects has the prior odds ``PRIOR_ODDS`` to the power of its size. The disturbance, scale and bias are of free size.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from .library import MOST_TYPICAL, TYPICAL
from .recording import Array

PRIOR_ODDS = 0.05
SIZES = 8
SHOWN = 12
LEAST_SEEN = 0.3
"""Standard errors of the largest plausible size, below which an effect is left out of the comparison."""
Set = frozenset[str]


@dataclass(frozen=True)
class Variant:
    """Columns of the gram matrix that are one shape of an effect, and the typical range of the coefficient of each."""

    index: tuple[int, ...]
    typical: tuple[tuple[float, float], ...]


def scales(variant: Variant) -> Array:
    """Standard deviations [SIZES, k] of the coefficients."""
    low = np.array([t[0] for t in variant.typical])
    high = np.array([t[1] for t in variant.typical]) * MOST_TYPICAL
    return np.asarray(low * (high / low) ** np.linspace(0, 1, SIZES)[:, None])


def typical_of(id_: str, columns: int) -> tuple[tuple[float, float], ...]:
    """The typical range of each of an effect's columns; columns beyond those listed are as the last."""
    listed = TYPICAL[id_]
    return tuple(listed[min(k % max(len(listed), 1), len(listed) - 1)] for k in range(columns))


class Oracle:
    """Posterior probabilities of sets of effects on one axis."""

    def __init__(self, gram: Array, reading: int, free: list[int], variants: dict[str, list[Variant]], planted: Set) -> None:
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        size[size < 1e-12] = 1.0
        scaled = gram / np.outer(size, size)
        inner = scaled[np.ix_(free, free)]
        projected = scaled - scaled[:, free] @ np.linalg.pinv(inner, rcond=1e-9, hermitian=True) @ scaled[free]
        self.gram = projected * np.outer(size, size)
        self.reading, self.planted = reading, frozenset(id_ for id_ in planted if id_ in variants)
        visible = {id_: [v for v in each if id_ in planted or self._seen(v)] for id_, each in variants.items()}
        self.variants = {id_: each for id_, each in visible.items() if each}
        self._known: dict[Set, float] = {}

    def _seen(self, variant: Variant) -> bool:
        """Could an effect of the largest size be seen at all? Of what cannot, the recording says nothing."""
        return bool(np.any(np.diag(self.gram)[list(variant.index)] * scales(variant)[-1] ** 2 > LEAST_SEEN**2))

    def _evidence(self, chosen: dict[str, tuple[int, int]]) -> float:
        """Log evidence of effects with given variants and scales of their sizes, over that of noise alone."""
        index: list[int] = []
        sd: list[float] = []
        for id_, (variant, scale) in chosen.items():
            one = self.variants[id_][variant]
            index += one.index
            sd += scales(one)[scale].tolist()
        s = np.array(sd)
        inner = np.eye(s.size) + s[:, None] * self.gram[np.ix_(index, index)] * s
        outer = s * self.gram[index, self.reading]
        try:
            factor = np.linalg.cholesky(inner)
        except np.linalg.LinAlgError:
            factor = np.linalg.cholesky(inner + 1e-6 * np.diag(np.diag(inner)))
        solved = np.linalg.solve(factor, outer)
        return float(0.5 * solved @ solved - np.log(np.diag(factor)).sum())

    def log_posterior(self, names: Iterable[str]) -> float:
        """Log of prior times evidence of a set of effects, without the norm that all sets share; nan for an unknown effect.

        Of more than one effect, variants and scales are integrated one effect at a time about their best.
        """
        key = frozenset(names)
        if not key <= self.variants.keys():
            return float("nan")
        if key not in self._known:
            self._known[key] = len(key) * np.log(PRIOR_ODDS) + (self._integrated(sorted(key)) if key else 0.0)
        return self._known[key]

    def _integrated(self, ids: list[str]) -> float:
        chosen = dict.fromkeys(ids, (0, SIZES // 2))
        tables: dict[str, Array] = {}
        for _ in range(1 if len(ids) == 1 else 3):
            before = dict(chosen)
            for id_ in ids:
                table = np.array([
                    [self._evidence(chosen | {id_: (v, s)}) for s in range(SIZES)] for v in range(len(self.variants[id_]))
                ])  # fmt: skip
                tables[id_] = table
                v, s = np.unravel_index(int(np.argmax(table)), table.shape)
                chosen[id_] = (int(v), int(s))
            if chosen == before:
                break
        best = self._evidence(chosen)
        return best + sum(float(logsumexp(table) - np.log(table.size)) - best for table in tables.values())

    def sets(self) -> list[Set]:
        """Noise alone, each effect alone, the planted set, and it with one effect more, fewer or another."""
        every = list(self.variants)
        found: dict[Set, None] = dict.fromkeys([frozenset(), *(frozenset([id_]) for id_ in every), self.planted])
        for gone in (None, *self.planted):
            kept = self.planted - {gone} if gone else self.planted
            found |= dict.fromkeys([kept, *(kept | {id_} for id_ in every)])
        return list(found)

    def report(self) -> dict[str, object]:
        """Probability of each effect, of noise alone and of the planted set, and the most probable sets."""
        sets = self.sets()
        logs = np.array([self.log_posterior(each) for each in sets])
        p = np.exp(logs - logsumexp(logs))
        order = np.argsort(-p)
        return {
            "effects": {id_: float(sum(p[i] for i, each in enumerate(sets) if id_ in each)) for id_ in self.variants},
            "none": float(p[sets.index(frozenset())]),
            "planted": float(p[sets.index(self.planted)]),
            "best": sorted(sets[order[0]]),
            "sets": [[sorted(sets[i]), float(p[i])] for i in order[:SHOWN]],
        }

    def behind(self, names: Iterable[str]) -> float:
        """Log posterior of the best set less that of the named one."""
        return max(self.log_posterior(each) for each in self.sets()) - self.log_posterior(names)
