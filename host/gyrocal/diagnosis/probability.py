"""The probability of each candidate, by the evidence of sets of effects. It changes no decision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.comparison import Comparison
from gyrocal.diagnosis.current import Current
from gyrocal.evidence import hypotheses
from gyrocal.evidence.answer import Alternative, Evidence, weigh
from gyrocal.evidence.curve import stated
from gyrocal.threads import each

Progress = Callable[[str], None]


@dataclass(frozen=True)
class OnAxis:
    """A set of effects that explains one axis, with its probability."""

    axis: str
    found: Alternative

    def to_json(self) -> dict[str, Any]:
        from scipy.special import logit

        found = self.found
        return {
            "axis": self.axis, "effects": list(found.effects), "unnamed": list(found.unnamed),
            "probability": stated(float(logit(min(found.probability, 1 - 1e-12)))),
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
        if found is not None and c.effect.id in found.log_odds:
            log_odds, checks = found.log_odds[c.effect.id], found.checks.get(c.effect.id)
            c = replace(c, log_odds=log_odds, probability=stated(log_odds, checks, c.named), checks=checks)
        out.append(c)
    alternatives = [OnAxis(axis, a) for axis, found in evidence.items() if found is not None for a in found.alternatives]
    return out, alternatives


def _on_axis(candidates: Sequence[Candidate], current: Current) -> Evidence | None:
    """The evidence on one axis, beside what is named there and has no probability, such as a wave or a fault of the reading."""
    runs = [b.run for b in current.fit.design.blocks]
    for c in candidates:
        if c.decision == "add" and not hypotheses.judged(c.effect, runs, current.index):
            current = current.with_effect(c.effect, c.values)
    return weigh(current.fit, [t.effect_id for t in current.fit.terms])
