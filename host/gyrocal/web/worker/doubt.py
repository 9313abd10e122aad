"""Why an effect is not proven, in words that stand beside it before and after it is added."""

from __future__ import annotations

from collections.abc import Sequence

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import meets, sure_gain
from gyrocal.diagnosis.naming.rivals import cosine
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.effects.base import title_of
from gyrocal.policy import POLICY

FASTER = 0.02
"""Part of the squared excess within blocks from which on it is told."""


def doubts(c: Candidate, found: Comparison, others: Sequence[Candidate]) -> list[str]:
    """The conditions for naming an effect that a candidate does not meet; empty if it is named alone or was rejected.

    ``others`` are all candidates of the diagnosis.
    """
    alike = [title_of(i).lower() for i in c.group if i != c.effect.id]
    if c.decision == "add":
        return [f"this session cannot tell it from {', '.join(alike)}"] if alike else []
    if c.decision != "suggest":
        return []
    out = []
    if c.gain is None or c.gain_se is None:
        out.append("nothing could be held out, so no unseen recording confirms it")
    elif not sure_gain(c):
        out.append(f"unseen recordings do not confirm it by {POLICY.gain_errors:g} standard errors")
    if found.implausible:
        out.append("a warning stands against this axis")
    if not c.enough:
        out.append(_not_enough(c.explained, contradicted=c.contradicted))
    if alike:
        out.append(f"this session cannot tell it from {', '.join(alike)}")
    return out or [_beside(c, found, [o for o in others if o.axis == c.axis and o.decision == "add"])]


def faster(found: Comparison, axis: str) -> bool:
    """True if a part of an axis's excess that is no rounding of a percentage lies within blocks of 0.1 s."""
    squares, floor = found.squares.get(axis), found.floors.get(axis)
    if squares is None or floor is None or not squares.samples:
        return False
    return squares.fast - floor.fast > FASTER * max(squares.all - floor.all, 0.0) > 0


def _not_enough(part: float | None, *, contradicted: bool) -> str:
    """Why the part of the squared excess error that a candidate explains is not enough to name it."""
    if contradicted:
        return "its fitted values contradict such an effect, or a course that is no effect of the library fits better"
    if part is None or part >= POLICY.explained:
        return f"it is not certain to explain {POLICY.explained:.0%} of the squared excess error"
    return f"it explains less than {POLICY.explained:.0%} of the squared excess error"


def _beside(c: Candidate, found: Comparison, named: Sequence[Candidate]) -> str:
    """What speaks against a candidate that meets every condition of its own, given those that are ``named`` on its axis."""
    if not meets(c, found):
        return "it leaves most of what the comparison found on this axis unexplained"
    simpler = [o for o in named if o.parameters < c.parameters and cosine(o.signal, c.signal) > POLICY.same_shape]
    if simpler:
        return f"{simpler[0].effect.title.lower()} has the same course over the recordings, with fewer parameters"
    if named:
        return f"with {named[0].effect.title.lower()} in the model, it is no longer certain"
    return "so many effects were tried that noise alone may look like one of them"
