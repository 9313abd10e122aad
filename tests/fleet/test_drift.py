"""The fleet's drift from the sum of its boards' likelihoods."""

import numpy as np
import pytest

from gyrocal.error_model.model import Model
from gyrocal.fleet.board import of_fleet, plain_fit
from gyrocal.fleet.candidates import cycle_equations
from gyrocal.fleet.drift import PILOT, SIZES, TIMES_S, FleetDrift, fleet_drifts, pilot
from gyrocal.simulation.production import Production


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


def test_all_boards_refine_what_the_pilot_found() -> None:
    """Means of runs as above: from a drift that is 15 % off, one step leads to the true size."""
    true, white, runs = 0.045, 0.048, 36_000
    first = FleetDrift(0.045 / 1.15, 30.0)
    variance = np.array([near.size for near in first.near]) ** 2 + white**2
    found, _ = first.refined(-runs / 2 * (np.log(variance) + (true**2 + white**2) / variance))
    assert found.size == pytest.approx(true, rel=0.02)
    assert found.tau_s == 30.0


def test_equations_between_the_drifts_are_those_of_the_drift_there() -> None:
    """z values by the interpolated equations differ from those that are whitened anew by far less than a percent."""
    first = FleetDrift(0.045, 30.0)
    fitted = plain_fit(Production(seconds=3.0).board(1), of_fleet(Model.open(), dict.fromkeys("xyz", first)))["z"]
    three = cycle_equations(fitted, [near.noise(fitted.noise) for near in first.near])[1]
    moved, weights = first.refined(np.array([-4.0, -1.0, -0.5]))
    exact = cycle_equations(fitted, [moved.noise(fitted.noise)])[1][0]
    assert moved.size > first.size
    between = np.tensordot(weights, three, 1)
    unit = np.sqrt(np.einsum("cii->ci", exact))
    assert np.abs(between - exact).max() / (unit[:, :, None] * unit[:, None, :]).max() < 1e-3
    assert np.einsum("cii->ci", between) == pytest.approx(np.einsum("cii->ci", exact), rel=5e-3)
