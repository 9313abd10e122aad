"""Rates from noisy orientations: calibration and comparison judge one session by one noise."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

Array = NDArray[np.float64]
RATE_HZ, SECONDS, FINE = 100.0, 60.0, 10
SCALES, BIASES_DPS = np.array([0.01, -0.02, 0.015]), np.array([1.0, -2.0, 3.0])


def tracked(noise_deg: float, seed: int, *, bent: float = 0.0) -> Session:
    """A sensor turned by hand for a minute beside a tracker whose orientations have white noise.

    ``bent`` is what the reading about z has in excess per squared rate, 1/dps.
    """
    rng = np.random.default_rng(seed)
    f, p, a = rng.uniform(0.05, 1.2, (8, 3)), rng.uniform(0, 7, (8, 3)), rng.normal(0, 20, (8, 3))

    def rates_dps(t_s: Array) -> Array:
        return np.asarray(np.sum(a * np.sin(2 * np.pi * f * t_s[:, None, None] + p), axis=1))

    t_s = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    middle_s = (np.arange((t_s.size - 1) * FINE) + 0.5) / (RATE_HZ * FINE)
    steps = Rotation.from_rotvec(np.deg2rad(rates_dps(middle_s)) / (RATE_HZ * FINE))
    at, orientations = Rotation.identity(), [Rotation.identity()]
    for k in range(t_s.size - 1):
        for j in range(FINE):
            at = at * steps[k * FINE + j]
        orientations.append(at)
    noise = Rotation.from_rotvec(np.deg2rad(rng.normal(0, noise_deg, (t_s.size, 3))))
    q = (Rotation.concatenate(orientations) * noise).as_quat()[:, [3, 0, 1, 2]]
    rate_dps = rates_dps(t_s)
    gyro_dps = (1 + SCALES) * rate_dps + BIASES_DPS + rng.normal(0, 0.08, (t_s.size, 3))
    gyro_dps[:, 2] += bent * rate_dps[:, 2] ** 2
    columns = {f"ref_q{name}": q[:, i] for i, name in enumerate("wxyz")}
    return make_session(make_run(t_s, gyro_dps, table_rate_dps=None, **columns))


@pytest.mark.wide
@pytest.mark.parametrize(("noise_deg", "seed"), [pytest.param(0.02, 1, marks=pytest.mark.wide), (0.1, 2), (0.02, 13)])
def test_the_noise_of_orientations_is_no_misfit_of_a_sound_session(noise_deg: float, seed: int) -> None:
    """The misfit held a smooth slope's noise against its small differences from sample to sample, and was 1.2 to 3.2.

    What the spline had taken from the motion at its ends and turning points was against the rate by 13 standard errors.
    """
    session = tracked(noise_deg, seed)
    found = calibrate(session)
    assert [e.axis for e in found] == ["x", "y", "z"]
    for e, scale in zip(found, SCALES, strict=True):
        assert e.misfit is not None
        assert 0.75 < e.misfit < 1.25
        assert e.trusted
        assert e.scale is not None
        assert e.scale_se is not None
        assert abs(e.scale - scale) < 4 * e.scale_se
    found_again = measure(session)
    assert found_again.verdict == "adequate"
    for level in found_again.per_axis.values():
        assert level.rms_dps == pytest.approx(level.floor_dps, rel=0.02)


def test_a_reading_that_bends_is_a_misfit_beside_noisy_orientations() -> None:
    level = measure(tracked(0.05, 3, bent=2e-4)).per_axis["z"]
    assert level.excess_dps is not None
    assert level.excess_se_dps is not None
    assert level.excess_dps > 5 * level.excess_se_dps


@pytest.mark.parametrize(("noise_deg", "seed"), [(0.004, 1), pytest.param(0.02, 4, marks=pytest.mark.wide)])
def test_nor_is_that_of_an_encoder_with_a_model_that_was_fitted_on_the_session(noise_deg: float, seed: int) -> None:
    """The fitted model knows the sensor's noise at low frequencies alone; the misfit was 1.2 beside an adequate comparison."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(12000) / RATE_HZ
    slow, fast = 2 * np.pi * 0.31, 2 * np.pi * 0.77
    angle_deg = 40 * np.sin(slow * t_s) + 15 * np.sin(fast * t_s + 1)
    rate_dps = 40 * slow * np.cos(slow * t_s) + 15 * fast * np.cos(fast * t_s + 1)
    gyro_dps = np.column_stack([0 * t_s, 0 * t_s, 0.989 * rate_dps + 0.9]) + rng.normal(0, 0.06, (t_s.size, 3))
    read_deg = np.round(angle_deg + rng.normal(0, noise_deg, t_s.size), 3)
    session = make_session(make_run(t_s, gyro_dps, table_rate_dps=None, ref_angle_deg=read_deg))
    compared = measure(session)
    (found,) = [e for e in calibrate(session, methods=["model"], model=compared.fit.model) if e.axis == "z"]
    assert found.misfit is not None
    assert 0.75 < found.misfit < 1.08
    assert found.trusted
    assert found.scale == pytest.approx(-0.011, abs=4 * (found.scale_se or 0))
