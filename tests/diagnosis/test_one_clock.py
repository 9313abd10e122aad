"""One clock serves all axes: an axis that moves and shows no error of the clock contradicts one that another axis resembles."""

from dataclasses import replace

import pytest

from gyrocal.diagnosis.naming.candidate import Candidate, Decision
from gyrocal.diagnosis.naming.one_clock import refuted
from gyrocal.effects.base import effect


def judged(axis: str, value: float, se: float, decision: Decision, effect_id: str = "clock_error") -> Candidate:
    name = effect(effect_id).linear[0]
    return Candidate(effect(effect_id), axis, decision, values={name: value}, se={name: se})


@pytest.mark.parametrize("decision", ["add", "suggest"])
def test_axes_that_move_exclude_an_error_of_the_clock(decision: Decision) -> None:
    named = judged("z", 2e-3, 1e-5, decision)
    others = [judged("x", 1e-5, 1e-5, "reject"), judged("y", -2e-5, 3e-5, "reject")]
    assert refuted([named, *others]) == {("clock_error", "z")}


def test_axes_that_agree_or_know_nothing_of_it_exclude_nothing() -> None:
    named = judged("z", 2e-3, 1e-5, "add")
    agreeing = judged("x", 1.9e-3, 4e-6, "add")  # ten errors away, and the same clock all the same
    unknowing = judged("y", -5e-3, 2e-3, "reject")
    still = replace(judged("y", 0.0, 0.0, "not_measurable"), values={}, se={})
    assert refuted([named, agreeing, unknowing, still]) == set()


def test_each_axis_may_have_a_lag_of_its_own() -> None:
    assert refuted([judged("z", 5e-3, 1e-5, "add", "lag"), judged("x", 0.0, 1e-5, "reject", "lag")]) == set()
