"""The odds that the sizes of a wave in the runs follow a law: one size, or one that grows with the rate."""

import numpy as np
import pytest

from gyrocal.diagnosis.naming.wave_sizes import WaveSizes

RATES_DPS = np.repeat([30.0, 78.0, 150.0], 8)


def sizes(true_dps: np.ndarray, error_dps: float, random: np.random.Generator) -> np.ndarray:
    """Amplitudes [runs, 1] as fitted: those of waves with noise of an error in each of two directions."""
    noise = error_dps * random.normal(size=(true_dps.size, 2))
    return np.abs(true_dps + noise[:, 0] + 1j * noise[:, 1])[:, None]


def odds(
    true_dps: np.ndarray, error_dps: float, seed: int, rates_dps: np.ndarray = RATES_DPS, exact: bool = True
) -> tuple[float, float]:
    """The log odds of one size and of a size that grows with the rate."""
    found_dps = sizes(true_dps, error_dps, np.random.default_rng(seed))
    found = WaveSizes(found_dps, np.full_like(found_dps, error_dps), rates_dps)
    return found.log_odds(0.0, exact=exact), found.log_odds(1.0, exact=exact)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("error", [0.02, 0.2])
def test_each_law_is_told_from_the_other_and_from_another_size_in_each_run(error: float, seed: int) -> None:
    one_size, growing = odds(np.ones(24), error, seed)
    assert one_size > 3 > -3 > growing
    one_size, growing = odds(RATES_DPS / 86, error, seed)
    assert growing > 3 > -3 > one_size
    random = np.random.default_rng(100 + seed)
    another_in_each_run = np.abs(random.normal(size=24) + 1j * random.normal(size=24))
    assert max(odds(another_in_each_run, error, seed)) < 0


@pytest.mark.parametrize("seed", range(10))
def test_another_size_in_each_run_is_granted_if_its_mean_square_follows_the_law(seed: int) -> None:
    random = np.random.default_rng(200 + seed)
    another_in_each_run = np.abs(random.normal(size=24) + 1j * random.normal(size=24))
    one_size, growing = odds(another_in_each_run, 0.02, seed, exact=False)
    assert one_size > 0 > growing
    one_size, growing = odds(another_in_each_run * RATES_DPS / 86, 0.02, seed, exact=False)
    assert growing > 0 > one_size


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
def test_the_odds_hang_on_ratios_alone(unit: float) -> None:
    assert odds(unit * np.ones(24), unit * 0.1, 1) == pytest.approx(odds(np.ones(24), 0.1, 1), abs=0.1)


def test_one_run_says_nothing_and_two_of_one_size_little() -> None:
    for ratio in (0.01, 0.2):
        assert odds(np.ones(1), ratio, 2, np.full(1, 78.0))[0] == pytest.approx(0.0, abs=0.3)
        assert 0 < odds(np.ones(2), 0.01, 2, np.full(2, 78.0))[0] < 3
    assert WaveSizes(np.zeros((0, 1)), np.zeros((0, 1)), np.zeros(0)).log_odds(1.0, exact=True) == 0.0


def test_at_one_rate_both_laws_are_one() -> None:
    assert len({round(x, 9) for x in odds(np.ones(8), 0.1, 3, np.full(8, 78.0))}) == 1
    assert odds(np.ones(8), 0.1, 3, np.full(8, 78.0), exact=False) == (0.0, 0.0)
