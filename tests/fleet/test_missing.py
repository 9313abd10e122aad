"""Pooled diagnosis on planted scores: what is there is named, what is not there is not, and it is said whose it is."""

import numpy as np
import pytest

from gyrocal.fleet.missing import Evidence, Share, find

NAMES = ["centripetal.z.k", "drift.z.k_dps_per_s", "scale_asymmetry.z.k", "warmup.z.A_dps;tau_s=10", "warmup.z.A_dps;tau_s=40"]
ALONE = 3.9
"""Standard errors at which one board passes the limit of a family of about five candidates with two tests each."""


def evidence(boards: int, sizes: np.ndarray, seed: int, rigs: int = 1, offsets: np.ndarray | None = None) -> Evidence:
    """Boards that know each size to one; drift and the warm-ups look alike. ``sizes`` [boards] are those of the first."""
    rng = np.random.default_rng(seed)
    one = np.eye(5)
    for (i, j), r in {(1, 3): 0.8, (1, 4): 0.9, (3, 4): 0.95}.items():
        one[i, j] = one[j, i] = r
    information = np.broadcast_to(one, (boards, 5, 5)).copy()
    rig = np.arange(boards) % rigs
    true = np.zeros((boards, 5))
    true[:, 0] = sizes + (0.0 if offsets is None else offsets[rig])
    score = np.einsum("bij,bj->bi", information, true) + rng.normal(size=(boards, 5)) @ np.linalg.cholesky(one).T
    return Evidence("z", NAMES, score, information, np.arange(boards), rig, rigs if rigs > 1 else 0)


@pytest.mark.wide
def test_a_tenth_of_one_boards_threshold_is_named_from_some_hundreds_of_boards() -> None:
    named = [find([evidence(400, np.full(400, ALONE / 10), seed)]) for seed in range(10)]
    assert [[m.effect for m in found] for found in named] == [["centripetal"]] * 10
    found = named[0][0]
    assert found.mean == pytest.approx(ALONE / 10, abs=4 * found.mean_se)
    assert found.heldout_gain > 0
    assert found.named_alone_by <= 2
    assert found.belongs_to.startswith("boards or rig")


def test_an_effect_of_zero_mean_is_named_from_a_thousand_boards() -> None:
    sizes = np.random.default_rng(1).normal(0.0, 0.6, 1000)
    found = find([evidence(1000, sizes, 2)])
    assert [m.effect for m in found] == ["centripetal"]
    assert found[0].belongs_to.startswith("boards: it differs")
    assert found[0].share * found[0].sd ** 2 == pytest.approx(0.36, abs=0.15)


def test_a_share_of_the_boards_may_have_it() -> None:
    sizes = np.where(np.arange(400) % 10 == 0, 3.0, 0.0)
    found = find([evidence(400, sizes, 3)])
    assert [m.effect for m in found] == ["centripetal"]
    assert 0.05 < found[0].share < 0.25


@pytest.mark.wide
def test_fleets_without_an_effect_raise_no_alarm() -> None:
    alarms = sum(bool(find([evidence(200, np.zeros(200), seed)])) for seed in range(60))
    assert alarms <= 4  # more has a probability of 1 % where the rate is 2 %


def test_standard_errors_that_are_three_percent_small_raise_no_alarm() -> None:
    null = evidence(1000, np.zeros(1000), 7)
    small = Evidence("z", NAMES, null.score * 1.03, null.information, null.board, null.rig, 0)
    assert find([small]) == []


def test_what_the_rigs_do_is_said_to_be_theirs() -> None:
    offsets = np.array([1.0, -0.9, 1.1, -1.0, 0.2, -0.1, 0.9, -0.8])
    found = find([evidence(400, np.zeros(400), 4, rigs=8, offsets=offsets)])
    assert [m.effect for m in found] == ["centripetal"]
    assert found[0].belongs_to.startswith("rig")
    same = find([evidence(400, np.full(400, 0.5), 5, rigs=8)])
    assert same[0].belongs_to.startswith("boards: it is the same on every rig")


def test_twins_are_not_named_twice() -> None:
    boards = 400
    plain = evidence(boards, np.zeros(boards), 6)
    score = plain.score + np.einsum("bij,j->bi", plain.information, np.array([0, 0, 0, 0.6, 0]))
    found = find([Evidence("z", NAMES, score, plain.information, plain.board, plain.rig, 0)])
    assert [m.effect for m in found] == ["warmup"]
    assert found[0].nonlinear == {"tau_s": 10.0}


def test_a_share_is_found_again() -> None:
    rng = np.random.default_rng(8)
    has = rng.random(4000) < 0.3
    variance = rng.uniform(0.5, 1.5, 4000)
    found = Share.of(np.where(has, rng.normal(4.0, 0.5, 4000), 0.0) + rng.normal(0, np.sqrt(variance)), variance)
    assert (found.share, found.mean, found.sd) == pytest.approx((0.3, 4.0, 0.5), abs=0.15)
