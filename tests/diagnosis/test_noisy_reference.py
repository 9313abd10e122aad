"""An encoder's noise makes no false name and hides no true one."""

import numpy as np
import pytest

from gyrocal.diagnosis.diagnose import diagnose
from gyrocal.noise.drift import ou_noise
from make_runs import make_run, make_session

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


@pytest.mark.parametrize(("seed", "sd_dps", "count_dps"), [(0, 0.03, 0.0), (1, 0.05, 0.01), (2, 0.02, 0.05)])
def test_plateaus_with_a_noisy_encoder_hold_no_effect(seed, sd_dps, count_dps):
    found = diagnose(staircases(seed, sd_dps, count_dps))
    assert found.verdict == "adequate", found.comparison.where


def test_rests_with_an_encoder_noisier_than_the_sensor_show_no_dead_band():
    """A reading that loses the encoder's noise at rest is right, and not a reading that loses small rates."""
    found = diagnose(staircases(4, 0.03, 0.05, (0.0, 25.0, 0.0, -25.0), runs=3, seconds=60, white_dps=0.01))
    assert found.verdict == "adequate", found.comparison.where


def test_a_planted_asymmetry_is_named_with_its_size():
    found = diagnose(staircases(3, 0.05, 0.01, asymmetry=1e-3))
    assert found.verdict == "add"
    assert found.best.effect.id == "scale_asymmetry"
    assert abs(found.best.values["k"] - 1e-3) < 3 * found.best.se["k"]
