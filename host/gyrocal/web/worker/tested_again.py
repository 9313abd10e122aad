"""An effect that was not proven when it was added, tested again beside what was added since."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import in_range, proven, sure_gain
from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.sets import without
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.effects import base
from gyrocal.policy import POLICY


def proven_now(found: Comparison, doubted: Mapping[str, Sequence[str]]) -> list[str]:
    """The ids of those effects that the model proves by now, on every axis that has them.

    ``doubted`` maps the id of each effect in doubt to the effects that the session could not tell from it.
    """
    out = []
    for effect_id, rivals in doubted.items():
        axes = [axis for axis, fit in found.fit.axes.items() if any(t.effect_id == effect_id for t in fit.terms)]
        if axes and effect_id in base.effects() and all(_proven_on(found, axis, effect_id, rivals) for axis in axes):
            out.append(effect_id)
    return out


def _proven_on(found: Comparison, axis: str, effect_id: str, rivals: Sequence[str]) -> bool:
    library = base.effects()
    current = without(Current.of(found, axis), [effect_id])
    again = judge(current, library[effect_id])
    if not again.values or not proven(again, len(library) * len(found.fit.axes)) or not sure_gain(again):
        return False
    if not in_range(again) or not again.enough or again.contradicted:
        return False
    return all(_excluded(current, again, rival) for rival in rivals if rival in library and rival != effect_id)


def _excluded(current: Current, effect: Candidate, rival_id: str) -> bool:
    """True if the effect is needed beside a rival, and the rival is not needed beside it."""
    rival = judge(current, base.effects()[rival_id])
    if not rival.values:
        return True
    with_rival, with_effect = (current.with_effect(c.effect, c.values) for c in (rival, effect))
    needed = judge(with_rival, effect.effect, unless=0.0).chance < POLICY.needed
    return needed and judge(with_effect, rival.effect, unless=0.0).chance > POLICY.needless
