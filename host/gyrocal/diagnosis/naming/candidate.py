"""One effect on one axis, with the evidence for it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gyrocal.effects.base import Effect, Values
from gyrocal.evidence import curve
from gyrocal.evidence.checked import Checks
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array

Decision = Literal["add", "suggest", "reject", "not_measurable"]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect on one axis, with its evidence and the decision.

    ``values`` and ``se`` are in the units of the effect's parameters. ``gain`` and ``gain_se`` are the held-out gain in
    log-likelihood and its standard error; they are None where nothing can be held out. ``excess_drop_dps`` is the excess on
    this axis without the effect minus that with it, deg/s, with its standard error. ``chance`` is the probability that noise
    alone gains as much. ``signal`` [blocks] is the fitted term without the part that the model already explains, NaN in blocks
    that the effect does not see, and ``unit_gains`` [units] are the gains of the held-out units.
    """

    effect: Effect
    axis: str
    decision: Decision
    values: Values = field(default_factory=dict)
    se: Values = field(default_factory=dict)
    explained: float | None = None
    excess_drop_dps: float | None = None
    excess_drop_se_dps: float | None = None
    gain: float | None = None
    gain_se: float | None = None
    chance: float = 1.0
    q_value: float | None = None
    group: tuple[str, ...] = ()
    together: tuple[str, ...] = ()
    """The effects of the set beside which this one was judged; empty if its evidence is that of the effect alone."""
    next_measurement: str = ""
    parameters: int = 0
    signal: Array | None = field(default=None, repr=False)
    unit_gains: Array | None = field(default=None, repr=False)
    gain_noise: float = 0.0
    """Standard deviation of the gain over the noise of measured columns, which a computed column of the same shape lacks."""
    enough: bool = False
    """True if the candidate explains at least ``Policy.explained`` of the excess error, as far as this is known."""
    gain_beside: float | None = None
    """Its held-out gain with the better names of its axis in the model; None if it is the best one."""
    log_odds: float | None = None
    """Logarithm of the odds of the sets that hold the effect, as if the world outside them had one of the rests' shapes."""
    group_log_odds: float | None = None
    """The same of the sets that hold at least one effect of ``group``; None if it has no rivals or one cannot be judged."""
    checks: Checks | None = None
    """Its two checks; None if it does not lead."""
    contradicted: bool = False
    """True if the fit contradicts what the effect is, or if something else that is no effect of the library fits better."""

    @property
    def named(self) -> bool:
        """True if it is sure: it is to be added, and no other effect explains the session as well."""
        return self.decision == "add" and len(self.group) <= 1

    @property
    def probability(self) -> float | None:
        """The probability that the effect acts on the axis, given the session and all sets of effects that were compared.

        None where it cannot be judged.
        """
        return None if self.log_odds is None else curve.stated(self.log_odds, self.checks, self.named)

    @property
    def sure(self) -> bool:
        """True if the evidence of sets is sure of the effect."""
        return self.log_odds is not None and curve.sure(self.log_odds, self.checks)

    @property
    def supported(self) -> bool:
        """True if the evidence of sets supports a name of the other tests.

        Where it cannot judge it, the size must be usual, and the held-out gain of a wave, jumps or a dead band large: what no
        effect describes has some part at their frequencies.
        """
        if self.log_odds is None:
            large = max(self.gain or 0.0, self.gain_beside or 0.0) >= POLICY.unweighed_gain
            return not self.tiny and (large or not self._is_never_weighed)
        return curve.supported(self.log_odds, self.checks, self.gain, self.gain_se)

    @property
    def _is_never_weighed(self) -> bool:
        """True for what the evidence can weigh in no session, and the codes of the readings do not show either."""
        effect = self.effect
        own_sizes = effect.scope == "run" and not effect.common_mean
        return effect.fault_of(self.values) is None and (effect.fast or own_sizes or effect.fault is not None)

    @property
    def tiny(self) -> bool:
        """True if the effect is smaller than any size that the evidence expects of its kind. Anything resembles that little."""
        from gyrocal.evidence.hypotheses import SMALLEST

        known = [p for p in self.effect.parameters if p.sized and p.name in self.values and p.name in self.effect.linear]
        return bool(known) and all(abs(self.values[p.name]) < SMALLEST * p.typical[0] for p in known)

    @property
    def doubted(self) -> bool:
        """True if the evidence of sets does not support the effect, or that one of its group acts, as far as it can judge."""
        if len(self.group) > 1:
            return self.group_log_odds is not None and not curve.sure(self.group_log_odds, None)
        return not self.supported

    def __repr__(self) -> str:
        gain = "" if self.gain is None else f", held-out gain {self.gain:.3g}"
        return f"<Candidate: {self.effect.id} on {self.axis}, {self.decision}{gain}>"

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
            "excess_drop_dps": self.excess_drop_dps,
            "excess_drop_se_dps": self.excess_drop_se_dps,
            "heldout_gain": self.gain,
            "heldout_gain_se": self.gain_se,
            "q_value": self.q_value,
            "group": list(self.group),
            "together": list(self.together),
            "decision": self.decision,
            "next_measurement": self.next_measurement,
            "probability": self.probability,
            "checks": None if self.checks is None or self.log_odds is None else {
                "share": self.checks.share, "same_in_parts_p": self.checks.same_in_parts_p,
                "difference": self.checks.difference, "parts": list(self.checks.parts),
                "passed": self.checks.passed(self.log_odds),
            },
        }  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def number_tested(candidates: Iterable[Candidate]) -> int:
    """How many of the candidates were tested: among so many may one seem significant by chance."""
    return sum(c.decision != "not_measurable" for c in candidates)


BEST_FIRST = ("add", "suggest", "reject", "not_measurable")


def best_first(candidate: Candidate) -> tuple[int, bool, bool, float, int, str]:
    """The key of the order in which candidates are given; among equals it does not depend on the order of the library.

    A sure name comes before effects that cannot be told from each other, and one that is sure alone before those that are sure
    beside others.
    """
    gain = -np.inf if candidate.gain is None else candidate.gain
    rivals = candidate.decision == "add" and not candidate.named
    beside = candidate.decision == "add" and bool(candidate.together)
    return BEST_FIRST.index(candidate.decision), rivals, beside, -gain, AXES.index(candidate.axis), candidate.effect.id
