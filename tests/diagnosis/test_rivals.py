"""Which candidates stay in a group with the first one."""

import numpy as np

from gyrocal.diagnosis.candidate import Candidate, Decision
from gyrocal.diagnosis.rivals import with_groups
from gyrocal.effects.base import effect

SIGNAL = np.sin(np.arange(200) / 9)


def candidate(effect_id: str, decision: Decision, gains: list[float], parameters: int) -> Candidate:
    return Candidate(
        effect(effect_id), "z", decision, gain=sum(gains), gain_se=1.0, parameters=parameters, signal=SIGNAL,
        unit_gains=np.array(gains),
    )  # fmt: skip


def test_a_simpler_rival_of_the_same_shape_stays_in_the_group_though_it_only_reached_suggest() -> None:
    """It was dropped, and the truth was not in the group."""
    curve = candidate("bias_temperature", "add", [5.0, 6.0, 5.5], 2)
    line = candidate("drift", "suggest", [4.9, 6.1, 5.3], 1)
    assert with_groups([curve, line])[0].group == ("bias_temperature", "drift")


def test_a_simpler_rival_that_passes_is_preferred() -> None:
    curve = candidate("bias_temperature", "add", [5.0, 6.0, 5.5], 2)
    line = candidate("drift", "add", [4.9, 6.1, 5.3], 1)
    judged = with_groups([curve, line])
    assert [c.decision for c in judged] == ["suggest", "add"]


def test_a_richer_rival_of_the_same_shape_is_not_shown() -> None:
    line = candidate("drift", "add", [5.0, 6.0, 5.5], 1)
    curve = candidate("bias_temperature", "suggest", [5.1, 6.1, 5.6], 3)
    assert with_groups([line, curve])[0].group == ("drift",)
