"""A case of each kind of the benchmark's sample but sets, and with ``make wide`` all of it.

docs/blind.md has the figures of all cases. Two effects at once are planted and named in ``diagnosis/test_explain.py``.
"""

from __future__ import annotations

from typing import Any

import pytest

from . import benchmark
from .cases import CASES, SAMPLE
from .outcome import Outcome

KINDS = tuple(dict.fromkeys(case.kind for case in SAMPLE))
NULL, EFFECT = "null_paper_drift_turn_on_6", "effect_lag_swing_small_1"
"""With all that a null has; an effect that one protocol alone shows, at its small size."""
OF_SAMPLE = [case.name for case in SAMPLE if case.kind in ("confounded", "unknown")]
PART = [case for case in CASES if case.name in (NULL, EFFECT, *OF_SAMPLE)]


@pytest.fixture(scope="module", params=["of each kind", pytest.param("all", marks=pytest.mark.wide)])
def outcomes(known_answers: None, request: pytest.FixtureRequest) -> list[Outcome]:
    return benchmark.run(PART if request.param == "of each kind" else SAMPLE, workers=0)  # other tests run beside it


@pytest.fixture(scope="module")
def figures(outcomes) -> dict[str, Any]:
    return benchmark.report(outcomes)


def _said(outcomes: list[Outcome]) -> str:
    return "\n".join(outcome.line() for outcome in outcomes if outcome.fault is not None)


@pytest.mark.slow
def test_every_case_is_judged_and_none_is_too_faint(outcomes, figures):
    judged = [outcome.case for outcome in outcomes]
    assert judged in (PART, SAMPLE)
    assert figures["cases"] == {kind: n for kind in KINDS if (n := sum(case.kind == kind for case in judged))}
    assert figures["too_faint"] == []


def test_nothing_is_named_where_nothing_is_missing(outcomes, figures):
    assert figures["false_alarm_rate"] == 0, _said(outcomes)


def test_the_missing_effect_is_named_first(outcomes, figures):
    assert figures["top1_rate"] >= 0.95, _said(outcomes)
    assert figures["set_contains_rate"] >= 0.98, _said(outcomes)


def test_no_wrong_name_is_stated(outcomes, figures):
    assert figures["misnamed_rate"] == 0, _said(outcomes)


def test_what_the_data_cannot_tell_is_said(outcomes, figures):
    assert figures["confounded_declared_rate"] == 1, _said(outcomes)
    assert figures["unknown_flagged_rate"] >= 0.85, _said(outcomes)


def test_the_error_falls_as_far_as_the_oracles(figures):
    assert figures["error_reduction_ratio"] <= 1.1


def test_the_ordinary_f_test_does_worse(figures):
    """On the very same sessions: else there were nothing to prove."""
    assert figures["stepwise_f_test"]["false_alarm_rate"] > 0.2
    assert figures["stepwise_f_test"]["top1_rate"] < figures["top1_rate"]
    assert figures["stepwise_f_test"]["error_reduction_ratio"] > figures["error_reduction_ratio"]
