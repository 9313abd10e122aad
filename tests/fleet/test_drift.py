"""The fleet's drift from the sum of its boards' likelihoods."""

import numpy as np
import pytest

from gyrocal.fleet.drift import PILOT, SIZES, TIMES_S, fleet_drifts, pilot


@pytest.mark.parametrize("true", [0.017, 0.045, 0.1])
def test_the_size_is_found_between_the_points_of_the_grid(true: float) -> None:
    """Means of runs with the variance size^2 + white^2, whose likelihood has its maximum at the true size."""
    white, runs = 0.048, 360
    variance = np.array(SIZES) ** 2 + white**2
    loglik = -runs / 2 * (np.log(variance) + (true**2 + white**2) / variance)
    found = fleet_drifts([{"z": [(loglik - off).tolist() for off in (1.0, 0.0, 2.0)]}])["z"]
    assert found.size == pytest.approx(true, rel=0.02)
    assert found.tau_s == TIMES_S[1]


def test_no_drift_is_none() -> None:
    loglik = [(-np.arange(len(SIZES), dtype=float)).tolist() for _ in TIMES_S]
    assert fleet_drifts([{"x": loglik}, {"x": loglik}])["x"].size == 0.0


def test_the_pilot_is_spread_over_the_fleet() -> None:
    paths = [f"{i:05d}" for i in range(1000)]
    assert len(pilot(paths)) == PILOT
    assert pilot(paths)[0] == "00000"
    assert pilot(paths)[-1] == "00999"
    assert pilot(paths[:3]) == paths[:3]
