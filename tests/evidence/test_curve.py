"""The stated probability: monotone, never above what was proved, and the share that was true where it was fitted."""

from typing import Any

import numpy as np
import pytest

from gyrocal.evidence import curve as told
from gyrocal.evidence.checked import Checks
from study import study

edge_curve, edge_table = study("edge_curve"), study("edge_table")
PASSED, FAILED = Checks(0.9, 0.4), Checks(0.2, 0.4)


def row(*candidates: tuple[float, bool, Checks | None]) -> dict[str, Any]:
    """A result with candidates of given log odds, some of which are right."""
    named = [
        {"effect": f"e{k}", "axis": "z", "log_odds": p, "checks": None if c is None else vars(c)}
        for k, (p, _, c) in enumerate(candidates)
    ]
    right = [[f"e{k}", "z"] for k, (_, true, _) in enumerate(candidates) if true]
    return {"error": None, "truth": {"right": right}, "candidates": named}


def test_a_stated_probability_rises_with_the_evidence_up_to_what_was_proved() -> None:
    found = [told.of_set(log_odds) for log_odds in np.linspace(-20, 40, 101)]
    assert np.all(np.diff(found) >= 0)
    assert found[-1] == told.KNOTS[-1][1]
    assert all(0 <= p <= 1 for p in found)


def test_what_held_out_data_refuse_is_no_more_probable_for_all_its_odds() -> None:
    assert told.stated(2.9, PASSED) == told.of_set(2.9) > told.UNNAMED
    assert told.stated(30.0, PASSED) == told.stated(3.1, PASSED) == told.UNNAMED
    assert told.stated(3.1, PASSED, named=True) == told.stated(30.0, PASSED, named=True) == told.NAMED


def test_a_failed_check_is_told_no_more_than_such_names_were_right() -> None:
    assert told.stated(30.0, FAILED) <= told.FAILED
    assert told.stated(30.0, Checks(0.9, 1e-6)) <= told.FAILED
    assert Checks(0.9, None).passed(0.0)


def test_a_small_difference_between_parts_says_that_no_model_is_exact_only_with_enough_data() -> None:
    nearly = Checks(0.9, 1e-6, 0.1)
    assert not nearly.passed(10.0)
    assert nearly.passed(30.0)
    assert told.stated(10.0, nearly) <= told.FAILED < told.stated(30.0, nearly)


def test_a_small_difference_is_forgiven_sooner_where_little_else_is_left_over() -> None:
    """On the recording of a shaft with an encoder, a leak of the rate has log odds of 13, a share of .991, differs by 7 %."""
    main = Checks(0.99, 1e-6, 0.07)
    assert main.passed(13.0)
    assert not Checks(0.9, 1e-6, 0.07).passed(13.0)
    assert not main.passed(6.0)
    assert not Checks(0.99, 1e-6, 0.3).passed(13.0)


def test_neighbours_are_pooled_until_the_shares_rise() -> None:
    found = edge_curve.rising([(0.1, 1, 10), (3.0, 6, 10), (7.0, 4, 10), (9.5, 9, 10)])
    assert found == [(0.1, 1, 10), (10.0, 10, 20), (9.5, 9, 10)]


def test_the_curve_of_made_results_is_their_share_and_its_end_the_lower_bound() -> None:
    rows = [row((-3.0, k == 0, None), (0.6, k < 5, PASSED), (30.0, k < 19, PASSED), (5.0, k < 4, FAILED)) for k in range(20)]
    knots, failed = edge_curve.curve(rows)
    assert knots[0] == (-3.0, 0.05)
    assert (0.6, 0.25) in knots
    assert knots[-1][1] == pytest.approx(1 - 0.216, abs=0.002)  # Clopper and Pearson, one of twenty wrong
    assert failed == pytest.approx(0.2)


def test_results_of_an_earlier_version_are_decided_by_today_s_limits() -> None:
    def said(effect: str, **more: Any) -> dict[str, Any]:
        known = {"axis": "z", "decision": "add", "group": [], "log_odds": 9.0, "checks": vars(PASSED), "by_tests": ["add", []]}
        return {"effect": effect, "heldout_gain": 90.0, "heldout_gain_se": 9.0} | known | more

    stays = [said("drift"), said("quantization", log_odds=None, checks=None), said("lag", by_tests=["suggest", []])]
    falls = [
        said("warmup", checks=vars(FAILED)), said("vibration_tone", log_odds=None, checks=None, heldout_gain=49.0),
        said("spin_up", by_tests=["suggest", []], heldout_gain=9.0),
    ]  # fmt: skip
    found = edge_table.decided_today({"candidates": stays + falls})
    assert [name for name, _ in edge_table.sure(found)] == ["drift", "quantization", "lag"]


def test_noise_alone_is_more_probable_than_its_log_odds_and_no_more_than_was_proved() -> None:
    found = [told.of_noise(log_odds) for log_odds in np.linspace(-20, 40, 101)]
    assert np.all(np.diff(found) >= 0)
    assert found[-1] == told.SUREST_NOISE
    assert told.of_noise(-told.NOISE) == pytest.approx(0.5)


def test_the_addition_to_noise_alone_is_found_again_from_draws_with_it() -> None:
    rng, rows = np.random.default_rng(1), []
    for log_odds in rng.normal(0, 2, 4000).tolist():
        acts = rng.random() > 1 / (1 + np.exp(-(log_odds + 0.8)))
        alternative = {"axis": "z", "effects": [], "unnamed": [], "log_odds": log_odds}
        truth = {"right": [["drift", "z"]] if acts else [], "disturbance": None}
        rows.append({"truth": truth, "alternatives": [alternative]})
    added, most = edge_curve.noise_alone(rows)
    assert added == pytest.approx(0.8, abs=0.15)
    assert 0.75 < most < 0.95
