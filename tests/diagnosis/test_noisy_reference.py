"""An encoder's noise makes no false name and hides no true one."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects import base
from gyrocal.noise.drift import ou_noise
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

RATE_HZ = 100.0
LEVELS_DPS = (0.0, 30.0, -30.0, 60.0, -60.0)


def staircases(seed, sd_dps, count_dps=0.0, levels=LEVELS_DPS, asymmetry=0.0, runs=4, seconds=50, white_dps=0.044):
    """Runs whose true rate goes over plateaus, with an encoder's noise and counts in the reference."""
    rng = np.random.default_rng(seed)
    made = []
    for i in range(runs):
        rate = np.repeat(rng.permutation(levels), round(seconds * RATE_HZ) // len(levels))
        t_s = np.arange(rate.size) / RATE_HZ
        gyro = rng.normal(0, white_dps, (rate.size, 3)) + ou_noise(rate.size, 1 / RATE_HZ, 0.002, 30.0, 3, rng)
        gyro += rng.normal(-0.05, 0.005, 3)
        gyro[:, 2] += 1.004 * rate + asymmetry * np.abs(rate)
        reference = rate + rng.normal(0, sd_dps, rate.size)
        if count_dps:
            reference = np.round(reference / count_dps) * count_dps
        made.append(make_run(t_s, gyro, rate_ref_dps=reference, scenario=f"s{i}", rate_hz=RATE_HZ, power_on_s=5.0))
    return make_session(*made)


@pytest.mark.parametrize(
    ("seed", "sd_dps", "count_dps"),
    [pytest.param(0, 0.03, 0.0, marks=pytest.mark.wide), pytest.param(1, 0.05, 0.01, marks=pytest.mark.wide), (2, 0.02, 0.05)],
)
def test_plateaus_with_a_noisy_encoder_hold_no_effect(seed, sd_dps, count_dps):
    found = diagnose(staircases(seed, sd_dps, count_dps), ON_Z)
    assert found.verdict == "adequate", found.comparison.where


def test_rests_with_an_encoder_noisier_than_the_sensor_show_no_dead_band():
    """A reading that loses the encoder's noise at rest is right, and not a reading that loses small rates."""
    found = diagnose(staircases(4, 0.03, 0.05, (0.0, 25.0, 0.0, -25.0), runs=3, seconds=60, white_dps=0.01), ON_Z)
    assert found.verdict == "adequate", found.comparison.where


def test_the_noise_of_a_rate_is_no_lost_rate_and_a_lost_rate_is():
    """A count of the encoder is larger than its noise, so that most rates at rest are exactly 0 and the others one count."""
    kind, plateaus = base.effect("dead_band"), (0.0, 0.8, 1.6, 0.0, -0.8, -1.6)
    at_rest = staircases(5, 0.024, 0.05, plateaus, runs=3, seconds=60, white_dps=0.03)
    assert kind.tried_on(at_rest.runs, 2, 0.01) is None
    lost = [
        make_run(r.t_s, r.gyro_dps - np.where(np.abs(r.rate_dps) < 1.0, r.rate_dps, 0.0)[:, None] * [0, 0, 1],
                 rate_ref_dps=r.rate_dps, scenario=r.scenario, rate_hz=RATE_HZ) for r in at_rest.runs
    ]  # fmt: skip
    assert kind.tried_on(lost, 2, 0.01) == "samples"


def test_a_planted_asymmetry_is_named_with_its_size():
    found = diagnose(staircases(3, 0.05, 0.01, asymmetry=1e-3), ON_Z)
    assert found.verdict == "add"
    assert found.best.effect.id == "scale_asymmetry"
    assert abs(found.best.values["k"] - 1e-3) < 3 * found.best.se["k"]


def test_a_dead_band_has_its_depth_beside_a_reference_with_noise() -> None:
    """The jump of its column at the edge was taken for a slope by the rate, so that its noise exceeded the column itself."""
    rng, t_s, runs = np.random.default_rng(5), np.arange(6000) / 100, []
    for k in range(4):
        rate = sum(25 * np.sin(2 * np.pi * f * t_s + rng.uniform(0, 6)) for f in (0.07, 0.11))
        gyro = rng.normal(0.2, 0.04, (t_s.size, 3))
        gyro[:, 2] += np.where(np.abs(rate) < 0.25, 0.0, rate)
        measured = rate + rng.normal(0, 0.02, t_s.size)
        runs.append(make_run(t_s, gyro, scenario=f"s{k}", rate_hz=100.0, rate_ref_dps=measured))
    best = diagnose(make_session(*runs), ON_Z).best
    assert best is not None
    assert best.effect.id == "dead_band"
    assert best.values["depth"] == pytest.approx(1.0, abs=0.2)
    assert best.values["width_dps"] == pytest.approx(0.25, abs=3 * best.se["width_dps"])
