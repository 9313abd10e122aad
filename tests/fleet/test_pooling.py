"""The population against closed forms, another program's fit, and planted truth."""

import numpy as np
import pandas as pd
import pytest

from gyrocal.fleet.pooling import Pooled, pool, spread_error
from gyrocal.fleet.prior import _spread


def test_equal_errors_have_the_closed_form() -> None:
    rng = np.random.default_rng(1)
    y, se = rng.normal(0.004, 0.0005, 40), np.full(40, 1e-4)
    found = pool(y, se)
    assert found is not None
    assert found.mean == pytest.approx(y.mean(), rel=1e-9)
    assert found.sd == pytest.approx(np.sqrt(y.var(ddof=1) - 1e-8), rel=1e-5)
    assert found.se == pytest.approx(y.std(ddof=1) / np.sqrt(40), rel=1e-5)
    assert found.sd_se == pytest.approx(found.sd / np.sqrt(2 * 39) * (y.var(ddof=1) / found.sd**2), rel=1e-3)
    assert found.rig_sd is None


def test_several_sessions_of_a_board_agree_with_statsmodels() -> None:
    import statsmodels.api as sm

    rng = np.random.default_rng(2)
    board = np.repeat(np.arange(30), 3)
    y = 5.0 + rng.normal(0, 2.0, 30)[board] + rng.normal(0, 0.7, 90)
    theirs = sm.MixedLM(y, np.ones((90, 1)), groups=board).fit(reml=True)
    ours = pool(y, np.full(90, float(np.sqrt(theirs.scale))), board)
    assert ours is not None
    assert ours.mean == pytest.approx(theirs.fe_params[0], abs=1e-5)
    assert ours.sd == pytest.approx(float(np.sqrt(np.asarray(theirs.cov_re)[0, 0])), rel=2e-3)
    assert ours.se == pytest.approx(theirs.bse_fe[0], rel=2e-3)


def test_crossed_boards_and_rigs_agree_with_statsmodels() -> None:
    import statsmodels.formula.api as smf

    rng = np.random.default_rng(3)
    rig = np.tile(np.arange(8), 60)
    board = np.repeat(np.arange(160), 3)
    y = rng.normal(0, 1.0, 160)[board] + rng.normal(0, 0.5, 8)[rig] + rng.normal(0, 0.3, 480)
    frame = pd.DataFrame({"y": y, "board": board, "rig": rig, "all": 1})
    parts = {"board": "0 + C(board)", "rig": "0 + C(rig)"}
    theirs = smf.mixedlm("y ~ 1", frame, groups="all", vc_formula=parts).fit(reml=True)
    spreads = dict(zip(theirs.model.exog_vc.names, np.sqrt(theirs.vcomp), strict=True))
    ours = pool(y, np.full(480, float(np.sqrt(theirs.scale))), board, rig)
    assert ours is not None
    assert ours.rig_sd is not None
    assert ours.sd == pytest.approx(spreads["board"], rel=5e-3)
    assert ours.rig_sd == pytest.approx(spreads["rig"], rel=5e-3)
    assert ours.se == pytest.approx(theirs.bse_fe.iloc[0], rel=5e-3)


def test_odd_boards_do_not_move_the_population() -> None:
    rng = np.random.default_rng(4)
    y, se = rng.normal(1.0, 0.1, 200), np.full(200, 0.02)
    sound = pool(y, se)
    odd = y.copy()
    odd[:10] = 1.0 + np.array([1.0, -1.0, 5.0, 50.0, 500.0, 1e4, -2.0, 3.0, -7.0, 0.9])
    moved, without = pool(odd, se), pool(y[10:], se[10:])
    assert sound is not None
    assert moved is not None
    assert without is not None
    assert np.flatnonzero(~moved.used).tolist() == list(range(10))
    assert moved.mean == pytest.approx(without.mean, abs=1e-9)
    assert moved.sd == pytest.approx(without.sd, rel=1e-5)
    assert sound.used.all()


def test_mean_and_spread_are_as_uncertain_as_they_say() -> None:
    rng = np.random.default_rng(5)
    off = []
    for _ in range(60):
        se = rng.uniform(0.3, 1.5, 60)
        found = pool(rng.normal(2.0, 1.0, 60) + rng.normal(0, se), se)
        assert found is not None
        off.append([(found.mean - 2.0) / found.se, (found.sd - 1.0) / found.sd_se])
    spread = np.std(off, axis=0)
    assert spread == pytest.approx([1.0, 1.0], abs=0.28)  # 3 standard errors of a spread over 60


def test_no_spread_has_an_error_of_the_size_that_could_hide() -> None:
    assert spread_error(0.0, np.full(100, 2.0)) == pytest.approx(2.0 * (2 / 99) ** 0.25, rel=1e-6)
    found = pool(np.linspace(-0.5, 0.5, 50), np.ones(50))
    assert found is not None
    assert found.sd == 0.0
    assert 0.3 < found.sd_se < 0.6


def test_the_order_does_not_matter_when_sorted_and_few_boards_are_no_population() -> None:
    assert pool(np.array([1.0, 2.0]), np.ones(2)) is None
    assert pool(np.array([1.0, 2.0, 3.0]), np.ones(3), np.array([0, 0, 1])) is None


def test_values_without_errors_on_two_rigs_have_a_population() -> None:
    """The level of the noise is such a quantity. The spread over rigs of two rigs is half of their distance times root two."""
    values = np.random.default_rng(9).normal(0.045, 1e-4, 40) + np.where(np.arange(40) % 2, 0.01, 0.0)
    found = pool(values, np.zeros(40), None, np.arange(40) % 2)
    assert found is not None
    assert found.mean == pytest.approx(0.05, abs=1e-4)
    assert found.sd == pytest.approx(1e-4, rel=0.3)
    assert found.rig_sd == pytest.approx(0.01 / np.sqrt(2), rel=0.02)


@pytest.mark.parametrize("seed", [7, 11, 48, 51])
def test_two_rigs_that_do_not_differ_have_no_spread_beside_values_without_errors(seed: int) -> None:
    found = pool(np.random.default_rng(seed).normal(0.045, 1e-4, 41), np.zeros(41), None, np.arange(41) % 2)
    assert found is not None
    assert found.rig_sd is not None
    assert found.rig_sd < 1e-4


def test_a_new_board_on_a_new_rig_differs_by_both_spreads() -> None:
    pooled = Pooled(0.0, 0.1, 3.0, 0.3, 4.0, 0.5, np.zeros(2), np.zeros(2), np.ones(2, dtype=bool))
    sd, sd_se = _spread(pooled)
    assert sd == pytest.approx(5.0)
    assert sd_se == pytest.approx(np.hypot(3 * 0.3, 4 * 0.5) / 5)  # of the root of the sum of squares
