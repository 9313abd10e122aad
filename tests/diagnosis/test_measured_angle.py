"""Sessions whose angle is measured by an encoder are judged by angle, however coarse its steps are."""

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.residual_table import residual_table
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.noise.color import Color
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

RATE_HZ, WHITE_DPS, SCALE, BIAS_DPS = 100.0, 0.05, 0.005, 0.5
T_S = np.arange(2000) / RATE_HZ


def session(seed: int, step_deg: float, cycles: int = 4, k1: float = 0.0) -> Session:
    """A swing of up to some 100 deg/s in each power cycle, read by a gyroscope and by an encoder with steps."""
    rng = np.random.default_rng(seed)

    def run(cycle: int) -> object:
        f_hz, size_deg, phase = rng.uniform(0.05, 0.5, 4), rng.normal(0, 30, 4), rng.uniform(0, 6.28, 4)
        turn = 2 * np.pi * f_hz * T_S[:, None] + phase
        temp_c = 25 + 5 * np.sin(T_S / 8 + cycle)
        gyro = rng.normal(0, WHITE_DPS, (T_S.size, 3))
        rate_dps = np.sum(size_deg * 2 * np.pi * f_hz * np.cos(turn), axis=1)
        gyro[:, 2] += (1 + SCALE) * rate_dps + BIAS_DPS + rng.normal(0, 0.01) + k1 * (temp_c - 25)
        angle_deg = np.round(np.sum(size_deg * np.sin(turn), axis=1) / step_deg) * step_deg
        return make_run(
            T_S, gyro, table_rate_dps=None, scenario=f"s{cycle}", rate_hz=RATE_HZ, temp_c=temp_c, ref_angle_deg=angle_deg
        )

    return make_session(*(run(k) for k in range(cycles)))


@pytest.mark.wide
@pytest.mark.parametrize("step_deg", [pytest.param(0.05, marks=pytest.mark.wide), 0.2])
def test_a_coarse_encoder_is_judged_by_the_angle_and_no_misfit(step_deg: float) -> None:
    told = compare(session(1, step_deg), ON_Z).to_json()
    assert told["verdict"] == "adequate"
    assert told["residual"] == "angle"
    assert "rms_dps" not in told
    z = told["per_axis"]["z"]
    assert z["rms_deg"] == pytest.approx(z["floor_deg"], rel=0.35)
    # the white noise of the gyroscope walks by sd·sqrt(T·dt / 6) about its mean, and the encoder has its steps
    assert z["rms_deg"] > np.hypot(WHITE_DPS * np.sqrt(20 / RATE_HZ / 6), step_deg / 12**0.5) / 2


def test_a_swing_that_begins_in_motion_is_not_said_to_begin_apart() -> None:
    """There is no rate beside the start of an angle, and the first readings must not be held against one."""
    for seed in range(4):
        assert [w.code for w in measure(session(seed, 0.1), ON_Z).warnings] == []


def test_scale_and_bias_have_honest_errors_beside_coarse_steps() -> None:
    """The error must not be that of a rate from steps: 0.2 deg in 0.1 s are 0.8 deg/s, 16 times the gyroscope's noise."""
    z = []
    for seed in range(6):
        for term in fit(session(seed, 0.2), Model.builtin("paper"), axes=("z",)).model.terms:
            if term.axis == "z" and term.effect_id == "scale":
                z.append((term.values["scale"] - SCALE) / term.se["scale"])
                assert term.se["scale"] < 2e-4
    assert 0.3 < np.sqrt(np.mean(np.square(z))) < 1.8


def test_residuals_hold_the_integrated_readings_against_the_encoder_s_angle() -> None:
    recorded = session(2, 0.1, cycles=3)
    rows = residual_table(measure(recorded, ON_Z)).filter(pl.col("file") == recorded.runs[1].file)
    assert rows.columns == ["file", "t_s", "axis", "measured_deg", "modelled_deg"]
    assert rows.height > 1900
    run = recorded.runs[1]
    at = np.searchsorted(run.t_s, rows["t_s"].to_numpy())
    gyro_dps = run.gyro_dps[:, 2]
    by_reading = np.concatenate([[0.0], np.cumsum(gyro_dps[1:] + gyro_dps[:-1])])[at] / 2 / RATE_HZ
    assert np.ptp(rows["measured_deg"].to_numpy() - by_reading) < 1e-9
    angle_deg = run.table["ref_angle_deg"].to_numpy()[at]
    assert np.ptp(rows["modelled_deg"].to_numpy() - (1 + SCALE) * angle_deg - BIAS_DPS * run.t_s[at]) < 1.0
    assert np.std(rows["measured_deg"].to_numpy() - rows["modelled_deg"].to_numpy()) < 0.3


@pytest.mark.wide
def test_an_effect_is_named_beside_coarse_steps() -> None:
    found = diagnose(session(3, 0.05, k1=0.05), ON_Z)
    assert found.best is not None
    assert (found.best.effect.id, found.best.axis) == ("bias_temperature", "z")
    assert abs(found.best.values["k1_dps_per_c"] - 0.05) < 4 * found.best.se["k1_dps_per_c"]


def test_the_filter_against_an_angle_s_noise_makes_its_covariance_white() -> None:
    """The inverse of the tridiagonal covariance of differences of noisy ends plus white noise, densely."""
    color, joined = Color(of_angle=3.0), np.ones(29, dtype=bool)
    joined[11] = False
    ends = np.zeros((30, 30))
    for k in range(30):
        ends[k, k] = 1 + 2 * 3.0
        if k and joined[k - 1]:
            ends[k, k - 1] = ends[k - 1, k] = -3.0
    filtered = color.whitened(np.eye(30), joined)
    np.testing.assert_allclose(filtered @ filtered.T, np.linalg.inv(ends), atol=1e-12)
    assert color.log_determinant(joined) == pytest.approx(-np.linalg.slogdet(ends)[1])
