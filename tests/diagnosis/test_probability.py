"""Names on which the tests and the evidence of sets must agree."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from scipy.special import expit

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.probability import OnAxis, decided, improbable_noise, told_sets
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.base import effect
from gyrocal.evidence.answer import Alternative
from gyrocal.evidence.checked import Checks
from gyrocal.evidence.curve import KNOTS, of_noise

PASSED, FAILED = Checks(0.9, 0.4), Checks(0.9, 1e-6)
WAVE, OTHER = np.sin(np.linspace(0, 9, 40)), np.cos(np.linspace(0, 9, 40))


def candidate(id_: str, decision: Any, log_odds: float | None, checks: Checks | None = PASSED, **more: Any) -> Candidate:
    known: dict[str, Any] = {"axis": "z", "gain": 20.0, "gain_se": 3.0, "signal": WAVE} | more
    return Candidate(effect(id_), decision=decision, log_odds=log_odds, checks=checks, **known)


def gaining(sure: Sequence[Candidate], others: Sequence[Candidate]) -> list[Candidate]:
    """Every other effect gains beside the sure ones."""
    return [replace(c, decision="add", group=(), together=tuple(s.effect.id for s in sure)) for c in others]


def decisions(*candidates: Candidate, failing: str = "z", beside: Any = gaining) -> dict[str, tuple[str, tuple[str, ...]]]:
    return {c.effect.id: (c.decision, c.group) for c in decided(candidates, set(failing), beside)}


def test_a_name_without_support_is_suggested() -> None:
    for log_odds, checks, gain in ((2.5, PASSED, 11.0), (1.0, PASSED, 90.0), (30.0, FAILED, 90.0), (-5.0, None, 90.0)):
        one = candidate("drift", "add", log_odds, checks, gain=gain)
        assert decisions(one) == {"drift": ("suggest", ())}


def test_beside_a_sure_name_no_improbable_effect_of_its_axis_is_suggested() -> None:
    sure, echo = candidate("drift", "add", 6.0), candidate("warmup", "suggest", -4.0, None)
    likely = candidate("spin_up", "suggest", -1.0, None, signal=OTHER)
    unjudged = candidate("thermal_lag", "suggest", None, None)
    other = candidate("warmup", "suggest", -4.0, None, axis="x")
    assert decisions(sure, echo, likely, unjudged) == {
        "drift": ("add", ()), "warmup": ("reject", ()), "spin_up": ("suggest", ()), "thermal_lag": ("suggest", ()),
    }  # fmt: skip
    assert decisions(sure, other)["warmup"] == ("suggest", ())
    assert decisions(echo) == {"warmup": ("suggest", ())}


def test_an_effect_that_is_about_as_probable_as_not_is_suggested() -> None:
    likely, failing = candidate("drift", "reject", 1.5), candidate("warmup", "reject", 1.5, FAILED, signal=OTHER)
    unlikely = candidate("spin_up", "reject", -0.5, signal=OTHER)
    worse = candidate("thermal_lag", "reject", 1.5, gain=-0.5, signal=OTHER)
    assert decisions(likely, failing, unlikely, worse) == {
        "drift": ("suggest", ()), "warmup": ("reject", ()), "spin_up": ("reject", ()), "thermal_lag": ("reject", ()),
    }  # fmt: skip


def test_a_name_with_support_stays_and_so_does_one_that_the_evidence_cannot_judge() -> None:
    assert decisions(candidate("drift", "add", 6.0, gain=7.0)) == {"drift": ("add", ())}
    assert decisions(candidate("drift", "add", 2.0, gain=13.0)) == {"drift": ("add", ())}
    assert decisions(candidate("drift", "add", None, None, gain=7.0)) == {"drift": ("add", ())}


@pytest.mark.parametrize("id_", ["vibration_tone", "order_tone", "table_ripple", "bias_jumps", "dead_band"])
def test_waves_and_jumps_that_the_evidence_cannot_weigh_need_a_large_gain(id_: str) -> None:
    values = {"f_hz": 9.0, "A_dps": 0.5, "n": 1.0, "size_dps": 0.5, "amplitude_1": 0.05, "order": 1.0, "width_dps": 0.5}
    one = candidate(id_, "add", None, None, values=values)
    assert decisions(replace(one, gain=49.0)) == {id_: ("suggest", ())}
    assert decisions(replace(one, gain=51.0)) == {id_: ("add", ())}


def test_faults_of_the_reading_are_known_by_their_codes() -> None:
    for id_, values in (("quantization", {"step_dps": 0.06}), ("bias_jumps", {"outliers": 1e-3, "size_dps": 0.5})):
        assert decisions(candidate(id_, "add", None, None, values=values, gain=2.0)) == {id_: ("add", ())}


def test_the_evidence_decides_between_rivals_of_different_shape() -> None:
    group = ("lag", "clock_error")
    sure = candidate("lag", "add", 6.0, group=group)
    rival = candidate("clock_error", "add", -3.0, None, group=group, signal=OTHER)
    assert decisions(sure, rival) == {"lag": ("add", ()), "clock_error": ("suggest", ())}
    assert decisions(replace(sure, log_odds=2.5), rival) == {"lag": ("add", group), "clock_error": ("add", group)}


def test_rivals_of_one_shape_and_those_that_were_not_weighed_stay_a_group() -> None:
    """A measured column has noise, a computed one of the same shape has none: the better fit is not the right name."""
    group = ("drift", "bias_temperature")
    sure = candidate("drift", "add", 6.0, group=group)
    weighed = candidate("bias_temperature", "add", -3.0, None, group=group)
    for rival in (weighed, replace(weighed, log_odds=None, signal=OTHER)):
        assert decisions(sure, rival)["drift"] == ("add", group)


def test_a_suggestion_is_named_only_where_the_model_is_known_to_fail() -> None:
    suggested = candidate("scale_nonlinearity", "suggest", 6.0)
    assert decisions(suggested) == {"scale_nonlinearity": ("add", ())}
    assert decisions(suggested, failing="x") == {"scale_nonlinearity": ("suggest", ())}
    assert decisions(replace(suggested, contradicted=True)) == {"scale_nonlinearity": ("suggest", ())}
    assert decisions(replace(suggested, gain=None)) == {"scale_nonlinearity": ("suggest", ())}
    hardly = replace(suggested, gain=10.9, gain_se=1.0)
    assert decisions(hardly) == {"scale_nonlinearity": ("suggest", ())}
    assert decisions(replace(hardly, gain=11.1)) == {"scale_nonlinearity": ("add", ())}


@pytest.mark.parametrize("decision", ["suggest", "reject"])
def test_beside_a_sure_name_the_evidence_names_what_gains_beside_it(decision: str) -> None:
    """Alone it may gain nothing, because the error of the sure one is larger."""
    known = candidate("drift", "add", 9.0), candidate("scale_nonlinearity", decision, 6.0, gain=-0.4)
    assert decisions(*known) == {"drift": ("add", ()), "scale_nonlinearity": ("add", ())}
    assert decisions(*known, beside=lambda sure, others: []) == {"drift": ("add", ()), "scale_nonlinearity": (decision, ())}
    assert decisions(known[0], replace(known[1], checks=FAILED))["scale_nonlinearity"] == (decision, ())


def test_alone_what_the_tests_reject_is_not_named() -> None:
    assert decisions(candidate("scale_nonlinearity", "reject", 6.0)) == {"scale_nonlinearity": ("suggest", ())}


def test_rivals_of_which_none_may_act_are_suggested() -> None:
    """The tests see a disturbance that both resemble, the evidence that neither explains it."""
    group = ("lag", "clock_error")
    for odds, checks in ((-2.0, None), (5.0, FAILED)):
        rivals = [candidate(i, "add", 1.0, checks, group=group, group_log_odds=odds) for i in group]
        assert decisions(*rivals) == dict.fromkeys(group, ("suggest", ()))
    rivals = [candidate(i, "add", 1.0, None, group=group, group_log_odds=5.0) for i in group]
    assert decisions(*rivals) == dict.fromkeys(group, ("add", group))


def test_a_doubted_name_is_not_in_the_way_of_a_sure_one() -> None:
    told = decisions(candidate("drift", "add", 0.5), candidate("scale_nonlinearity", "suggest", 6.0))
    assert told == {"drift": ("suggest", ()), "scale_nonlinearity": ("add", ())}


def test_a_sure_name_stands_before_rivals_that_cannot_be_told_apart() -> None:
    group = ("lag", "clock_error")
    rivals = [candidate(id_, "add", 1.0, group=group, gain=90.0, axis="x") for id_ in group]
    order = decided([*rivals, candidate("drift", "add", 6.0, gain=4.0)], {"z"}, gaining)
    assert [c.effect.id for c in order] == ["drift", *group[::-1]]


def test_what_another_effect_explains_better_is_not_named_for_its_evidence() -> None:
    """Beside a wave over the rate, an asymmetry gained 91 and its square 74: the wave supplied what the square lacked."""
    square = candidate("centripetal", "suggest", 6.0, gain=74.0)
    for gain, decision in ((91.0, "suggest"), (77.0, "add")):
        told = decisions(square, candidate("scale_asymmetry", "suggest", -3.0, gain=gain))
        beside = "reject" if decision == "add" else "suggest"  # improbable beside a sure name
        assert told == {"centripetal": (decision, ()), "scale_asymmetry": (beside, ())}
    assert decisions(square, candidate("drift", "suggest", -3.0, gain=91.0, axis="x"))["centripetal"] == ("add", ())


def test_names_stand_before_suggestions() -> None:
    known = candidate("drift", "suggest", 1.0, gain=15.0), candidate("warmup", "suggest", 6.0, gain=12.0)
    order = decided(known, {"z"}, gaining)
    assert [c.effect.id for c in order] == ["warmup", "drift"]


def test_sets_are_together_no_more_probable_than_an_effect_that_they_hold() -> None:
    """The alternatives are weighed in one form of what is left over, an effect in the less favourable one of two."""
    doubtful, likely = candidate("drift", "reject", -4.0, None), candidate("scale_asymmetry", "add", 6.0)
    sets = [
        OnAxis("z", Alternative(effects, (), 0.0), probability)
        for effects, probability in ((("drift",), 0.5), (("drift", "scale_asymmetry"), 0.3), (("scale_asymmetry",), 0.15))
    ]
    told = told_sets([*sets, OnAxis("x", sets[0].found, 0.4)], [doubtful, likely])
    assert [(one.axis, one.found.effects) for one in told] == [("z", ("scale_asymmetry",)), ("x", ("drift",))]
    assert told[0].probability == 0.15
    assert told[1].probability == 0.4  # on x nothing is stated of it
    assert doubtful.probability is not None
    rather = replace(doubtful, log_odds=1.0)
    with_it = [one.probability for one in told_sets(sets, [rather, likely]) if "drift" in one.found.effects]
    assert rather.probability is not None
    assert sum(with_it) == pytest.approx(rather.probability)


def test_sets_with_something_in_them_have_what_noise_alone_leaves() -> None:
    sets = [OnAxis.of("z", Alternative((), (), 0.6)), OnAxis.of("z", Alternative((), ("time",), 0.35))]
    noise, something, drift = told_sets([*sets, OnAxis("z", Alternative(("drift",), (), 0.05), 0.2)], [])
    assert noise.probability == of_noise(noise.found.log_odds) > 0.8
    assert noise.probability + something.probability + drift.probability == pytest.approx(1.0)
    assert something.probability < sets[1].probability


class _Compared:
    """What is asked of a comparison here: where no name is sure, the probe that fits best on each axis, and its excess."""

    unsure: frozenset[str] = frozenset()
    nearest: Mapping[str, Finding] = {}

    def __init__(self, share: float) -> None:
        self.share = share

    def excess_share(self, axis: str) -> float:
        return self.share if axis == "z" else 0.0


@pytest.mark.parametrize("log_odds", [KNOTS[-1][0] + 0.1, 50.0, 500.0, KNOTS[-1][0] - 0.1, 5.0, -2.0])
def test_a_model_is_not_adequate_where_the_evidence_is_sure_that_there_is_more_than_noise(log_odds: float) -> None:
    pair, noise = Alternative(("centripetal", "drift"), ("temperature",), 0.6), Alternative((), (), float(expit(-log_odds)))
    sets = [OnAxis.of("z", pair), OnAxis.of("z", noise), OnAxis.of("x", replace(noise, probability=0.9))]
    found = improbable_noise(sets, cast(Comparison, _Compared(0.05)))
    assert [(f.axis, f.against, f.of_sets) for f in found] == [("z", "temperature", True)] * (log_odds > KNOTS[-1][0])
    assert all("centripetal and drift and something that follows temperature" in f.note for f in found)


@pytest.mark.parametrize(("told", "share"), [(0.004, 0.29), (0.15, 0.12), (0.3, 0.29), (0.004, 0.06)])
def test_an_excess_of_practical_size_is_not_adequate_where_noise_alone_is_improbable(told: float, share: float) -> None:
    """With 0.29 of the floor and noise alone below 1 %, a supply that sagged as the table turned was called adequate."""
    sag = Alternative(("warmup",), ("acceleration",), 0.3)
    noise = OnAxis("z", Alternative((), (), 0.01), told)
    found = improbable_noise([OnAxis.of("z", sag), noise], cast(Comparison, _Compared(share)))
    assert len(found) == (told < 0.2 and share > 0.1)
    for one in found:
        assert one.against == "acceleration"
        assert ("below 1%" if told < 0.01 else "of 15%") in one.note
        assert "warmup and something that follows acceleration" in one.note
