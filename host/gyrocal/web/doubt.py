"""Why an effect is not proven, in words that stand beside it before and after it is added."""

from __future__ import annotations

from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.comparison import Comparison
from gyrocal.diagnosis.decision import in_range, sure_gain
from gyrocal.policy import POLICY


def doubts(c: Candidate, found: Comparison) -> list[str]:
    """The conditions for naming an effect that a candidate does not meet; empty if it is named alone or was rejected."""
    others = [i for i in c.group if i != c.effect.id]
    if c.decision == "add":
        return [f"this session cannot tell it from {', '.join(others)}"] if others else []
    if c.decision != "suggest":
        return []
    out = []
    if c.gain is None or c.gain_se is None:
        out.append("nothing could be held out, so no unseen recording confirms it")
    elif not sure_gain(c):
        out.append(f"unseen recordings do not confirm it by {POLICY.gain_errors:g} standard errors")
    if not in_range(c):
        out.append(f"its size is more than {POLICY.range_factor:g} times what is typical")
    if found.implausible:
        out.append("a warning stands against this axis")
    if not c.enough:
        out.append(_not_enough(c.explained))
    if others:
        out.append(f"this session cannot tell it from {', '.join(others)}")
    return out or ["another effect explains the residual better"]


def _not_enough(part: float | None) -> str:
    """Why the part of the squared excess error that a candidate explains is not enough to name it."""
    if part is None:
        return f"it is not certain to explain {POLICY.explained:.0%} of the squared excess error"
    if part < POLICY.explained:
        return f"it explains less than {POLICY.explained:.0%} of the squared excess error"
    return "its fitted sizes, over the runs, are not those of such an effect"
