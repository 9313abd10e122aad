"""Every effect of the library that a model lacks, judged on movements and rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate, best_first, number_tested
from gyrocal.diagnosis.naming.decision import evident_gain, in_range, proven, with_q_values, without_unphysical
from gyrocal.diagnosis.naming.rivals import with_groups
from gyrocal.effects.base import Effect, effects
from gyrocal.error_model.model import Term
from gyrocal.gravity.evidence import Evidence
from gyrocal.gravity.fit import CROSS, visible
from gyrocal.gravity.observations import parameters
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array


def candidates(evidence: Evidence, own: Sequence[Effect] = ()) -> list[Candidate]:
    """Effects of the library and ``own`` that the model lacks, on every axis, judged and decided, best first."""
    fitted = evidence.fitted
    wanted = [
        (effect, axis) for axis in AXES for effect in (*effects().values(), *own)
        if effect.role is None and fitted.model.term(effect.id, axis) is None
    ]  # fmt: skip
    seen = [(e, a) for e, a in wanted if visible(Term.of(e, a), fitted.scene)]
    evidence.prepare([t for e, a in seen for t in evidence.variants(e, a)])
    judged = with_q_values([evidence.judge(effect, axis) for effect, axis in wanted])
    return sorted(without_unphysical(with_groups(_decided(judged, evidence))), key=best_first)


def _decided(judged: Sequence[Candidate], evidence: Evidence) -> list[Candidate]:
    """Add, suggest or reject. Beside a first candidate another is added only if it still gains with the first in the model."""
    tested = number_tested(judged)
    strongest = max((c.gain or 0.0 for c in judged), default=0.0)
    order = sorted(range(len(judged)), key=lambda i: -(judged[i].gain or 0.0))
    out = list(judged)
    taken: list[Array] = []
    for i in order:
        c = judged[i]
        if c.decision == "not_measurable" or c.q_value is None or c.q_value >= POLICY.false_discovery_rate:
            continue
        large = evident_gain(c) and (c.gain or 0.0) >= POLICY.of_finding * strongest
        named = proven(c, tested) and in_range(c) and c.enough and large
        columns = evidence.columns(Term.of(c.effect, c.axis, c.values))
        if named and taken:
            cross = evidence.beside(c.effect.id, c.axis)
            others = np.column_stack([*taken, *([] if cross is None or c.effect.id == CROSS else [cross])])
            again = evidence.gain(columns, [p.prior_sd for p in parameters([Term.of(c.effect, c.axis, c.values)])], others)
            named = again.chance * tested < POLICY.name_alarm
        if named:
            taken.append(columns)
        out[i] = replace(c, decision="add" if named else "suggest")
    return out
