"""A line that the reference alone holds, such as the beat of an encoder's steps with the sampling, is no tone of the sensor."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")
RATE_HZ, TONE_HZ, TONE_DPS = 100.0, 17.3, 0.15
T_S = np.arange(3000) / RATE_HZ


def session(in_sensor: float, in_reference: float) -> Session:
    """A slow swing in four power cycles with a line in the readings, in the measured rate or in both, deg/s."""
    rng = np.random.default_rng(3)

    def run(cycle: int) -> object:
        true_dps = 60 * np.sin(2 * np.pi * 0.05 * T_S + cycle)
        line = np.sin(2 * np.pi * TONE_HZ * T_S + rng.uniform(0, 6.28))
        gyro = rng.normal(0, 0.05, (T_S.size, 3))
        gyro[:, 2] += 1.002 * true_dps + 0.3 + in_sensor * line
        measured = true_dps + in_reference * line
        return make_run(T_S, gyro, table_rate_dps=None, scenario=f"s{cycle}", rate_hz=RATE_HZ, rate_ref_dps=measured)

    return make_session(*(run(k) for k in range(4)))


@pytest.mark.parametrize(
    ("in_sensor", "in_reference", "named"),
    [
        (TONE_DPS, 0.0, True),
        pytest.param(0.0, TONE_DPS, False, marks=pytest.mark.wide),
        pytest.param(TONE_DPS, 2 * TONE_DPS, False, marks=pytest.mark.wide),
    ],
)
def test_a_tone_is_named_where_the_sensor_alone_has_it(in_sensor: float, in_reference: float, named: bool) -> None:
    sure = {c.effect.id for c in diagnose(session(in_sensor, in_reference), ON_Z).candidates if c.decision == "add"}
    assert ("vibration_tone" in sure) is named


def test_a_motion_that_is_large_is_not_taken_for_the_wave() -> None:
    """A table that goes to a hundred rates has some overlap with any wave, which is more than a small wave's own power."""
    rng = np.random.default_rng(5)
    runs = []
    for cycle in range(3):
        rate_dps = np.repeat(rng.uniform(-200, 200, 12), T_S.size // 12)
        turned_deg = np.cumsum(rate_dps) / RATE_HZ
        gyro = rng.normal(0, 0.02, (T_S.size, 3))
        gyro[:, 2] += rate_dps * (1.002 + 0.0018 * np.sin(np.deg2rad(3 * turned_deg))) + 0.3
        runs.append(make_run(T_S, gyro, table_rate_dps=None, scenario=f"s{cycle}", rate_hz=RATE_HZ, rate_ref_dps=rate_dps))
    found = diagnose(make_session(*runs), ON_Z).best
    assert found is not None
    assert (found.effect.id, found.axis) == ("table_ripple", "z")


@pytest.mark.wide
def test_the_beat_of_an_encoder_is_found_beneath_a_motion_a_thousand_times_as_large() -> None:
    """At 150 deg/s and 104 Hz, steps of 0.01 deg make a line of 0.2 deg/s at 24 Hz in the rate between two angles."""
    rng, runs = np.random.default_rng(8), []
    levels = np.repeat(np.tile([0.0, 150.0, 0.0, -150.0], 5), 10 * 104)
    rate_dps = np.convolve(levels, np.ones(104) / 104, mode="same")
    t_s = np.arange(rate_dps.size) / 104.0
    for cycle in range(2):
        angle_deg = np.round((np.cumsum(rate_dps) - rate_dps / 2) / 104.0, 2)
        gyro = rng.normal(0, 0.08, (t_s.size, 3))
        gyro[:, 2] += 1.002 * rate_dps + 0.3
        runs.append(make_run(t_s, gyro, table_rate_dps=None, scenario=f"s{cycle}", rate_hz=104.0, ref_angle_deg=angle_deg))
    assert [c.effect.id for c in diagnose(make_session(*runs), ON_Z).candidates if c.decision == "add"] == []
