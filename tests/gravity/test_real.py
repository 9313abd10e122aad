"""Recordings by hand of others against the parameters that their makers published, in a common frame.

They lie in `shared/realdata` beside the repository (`GYROCAL_REALDATA` names another place); where not, this skips. A published
matrix is of a frame of its own. The rotation Q of ``A = L Q`` (A the published matrix of the accelerometer's readings, L lower
triangular) takes it to the frame whose x axis the accelerometer keeps, so a gyroscope's matrix G becomes ``G Q^T``.
"""


import numpy as np
import polars as pl
import pytest

from by_hand import lower_triangular, matrix_of, session_of
from gyrocal.gravity.calibrate import calibrate
from gyrocal.recording.session import AXES, Session
from real_recordings import recording


def by_hand(t_s: np.ndarray, gyro_dps: np.ndarray, acc_g: np.ndarray) -> Session:
    return session_of(pl.DataFrame({
        "t_s": t_s, **{f"g{n}_dps": gyro_dps[:, i] for i, n in enumerate(AXES)},
        **{f"a{n}_g": acc_g[:, i] for i, n in enumerate(AXES)},
    }))  # fmt: skip


def test_the_mti_of_imu_tk_has_the_matrix_of_its_factory() -> None:
    """The factory gives two decimals of each alignment, so the product of both is sure to about 0.01."""
    frame = pl.read_csv(recording("xsens_mti_multipose_imutk", "xsens_raw.csv.gz"))
    gyro, acc = (np.column_stack([frame[f"{name}_{a}_cnt"].to_numpy() for a in AXES]).astype(float) for name in ("gyr", "acc"))
    gyro_dps, acc_g = np.rad2deg((gyro - [32768, 32466, 32485]) / 4767), (acc - [33123, 33276, 32360]) / (415 * 9.80665)
    session = by_hand(frame["t_s"].to_numpy(), gyro_dps, acc_g)
    found = calibrate(session)
    matrix, se = matrix_of(found)
    gyro_axes = np.array([[1, -0.01, -0.02], [0, 1, 0.04], [-0.01, 0.01, 1]])
    acc_axes = np.array([[1, 0, -0.01], [0.01, 1, 0.01], [0.02, 0.01, 1]])
    _, turn = lower_triangular(acc_axes)
    published = np.diag([4778, 4758, 4766]) / 4767 @ gyro_axes @ turn.T
    assert np.abs(np.diag(matrix - published)).max() < 0.003
    assert np.abs(matrix - published).max() < 0.01
    assert se.max() < 0.002
    assert len(next(iter(found.fits.values())).scene.rests) > 30


def test_the_mpu6050_held_in_a_hand_agrees_with_its_authors_within_the_errors() -> None:
    """Nine short rests in a hand: errors of a percent, which the standard errors must say.

    Its authors give imu_tk's matrix, but not the accelerometer's, whose frame is therefore unsure by about 0.01.
    """
    rows = np.loadtxt(
        recording("mpu6050_multipose_tedaldi", "example_data_calibration.csv"), delimiter=",", skiprows=5, dtype=np.float64
    )
    session = by_hand(np.arange(len(rows)) / 100, rows[:, 3:] / 131, rows[:, :3] / 16384)
    found = calibrate(session)
    matrix, se = matrix_of(found)
    a, b, c, d, e, f, *scales_and_bias = np.loadtxt(recording("mpu6050_multipose_tedaldi", "params_gyro.csv"))
    scales, bias = np.array(scales_and_bias[:3]), np.array(scales_and_bias[3:])
    correct = np.array([[1, -a, b], [c, 1, -d], [-e, f, 1]]) @ np.diag(scales) * 131 * 180 / np.pi
    apart = np.abs(matrix - np.linalg.inv(correct))
    assert (np.diag(apart) < 3 * np.diag(se)).all()
    assert (apart < 3 * np.hypot(se, 0.01)).all()
    assert np.diag(se).min() > 0.003
    assert np.diag(se).max() < 0.02
    for estimate, published in zip(found.estimates, bias / 131, strict=True):
        assert estimate.bias_dps == pytest.approx(published, abs=3 * (estimate.bias_se_dps or 0))
