"""The step of readings that a file rounds to a few decimals."""

import numpy as np
import pytest

from gyrocal.effects.quantities import grid_dps


@pytest.mark.parametrize("offset_dps", [0.0, 0.3171])
@pytest.mark.parametrize("decimals", [3, 5, 7])
@pytest.mark.parametrize("count_dps", [1 / 131, 0.00875, 1 / 16.4])
def test_the_rounding_of_a_file_is_not_taken_for_the_count(count_dps: float, decimals: int, offset_dps: float) -> None:
    """An MPU-6050 logged to three decimals had steps of 0.007 dps, and torn bytes of 1.792 in place of 1.954 dps."""
    codes = np.rint(np.random.default_rng(1).normal(0, 40, 2000) / count_dps)
    found = grid_dps([np.round(count_dps * codes - offset_dps, decimals)])
    assert found == pytest.approx(count_dps, rel=5e-6)


@pytest.mark.parametrize("number", [20, 2000])
def test_readings_of_no_count_have_the_step_of_their_rounding(number: int) -> None:
    readings = np.round(np.random.default_rng(2).normal(0, 1, number), 3)
    assert grid_dps([readings]) <= np.diff(np.unique(readings)).min() + 1e-9
