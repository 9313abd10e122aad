"""Runs known by their net angle alone (the sensor turned by hand, once about), among runs at rest."""

import numpy as np
import pytest

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

RATE_HZ, WHITE_DPS, TURN_DEG = 104.0, 0.04, 360.0
SCALE, BIAS_DPS = -0.0088, 0.07


@pytest.fixture(scope="module")
def by_hand() -> Session:
    """Six power cycles: a turn, a turn back, some seconds at rest; the drift of each is 5 mdps."""
    rng = np.random.default_rng(8)
    t_s = np.arange(2080) / RATE_HZ
    runs = []
    for cycle in range(6):
        bias = BIAS_DPS + rng.normal(0, 0.01)
        for turn_deg in (TURN_DEG, -TURN_DEG, 0.0):
            profile = np.sin(np.pi * np.clip(t_s * rng.uniform(0.06, 0.09), 0, 1)) ** 2 * rng.uniform(0.9, 1.1, t_s.size)
            rate = turn_deg * profile / np.trapezoid(profile, t_s)
            wander = 0.005 * np.sin(2 * np.pi * (t_s / 20 + rng.random()))
            gyro = rng.normal(0, WHITE_DPS, (t_s.size, 3))
            gyro[:, 2] += (1 + SCALE) * rate + bias + wander
            runs.append(
                make_run(t_s, gyro, table_rate_dps=0.0, turn_deg=turn_deg or None, scenario=f"s{cycle}", rate_hz=RATE_HZ)
            )
    return make_session(*runs)


def test_the_scale_is_found_from_angles_alone(by_hand: Session) -> None:
    scale = next(t for t in fit(by_hand, Model.open("default")).model.terms if (t.effect_id, t.axis) == ("scale", "z"))
    assert abs(scale.values["scale"] - SCALE) < 4 * scale.se["scale"] < 4e-4


def test_nothing_is_missing_and_what_cannot_be_measured_says_why(by_hand: Session) -> None:
    found = diagnose(by_hand)
    assert found.verdict == "adequate"
    assert all(np.isfinite(level.rms_dps or np.nan) for level in found.comparison.per_axis.values())
    told = {c.effect.id: c.next_measurement for c in found.candidates if c.axis == "z" and c.decision == "not_measurable"}
    assert "known rate" in told["table_ripple"]


def test_each_power_cycle_is_calibrated(by_hand: Session) -> None:
    estimates = calibrate(by_hand, [20.0], ["model"], model=Model.open("default"))
    assert len(estimates) == 6
    for e in estimates:
        assert abs(e.scale - SCALE) < 4 * e.scale_se
