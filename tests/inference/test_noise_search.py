"""The search for drift and for the spread of the scale finds what was planted, whatever the bias and the run's length."""

import numpy as np
import pytest

from gyrocal.diagnosis.comparison import measure
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.noise.drift import ou_noise
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

WHITE_DPS, SD_DPS, TAU_S = 0.007, 0.003, 50.0


def at_rest(seconds: float, bias_dps: float, rate_hz: float = 5.0) -> Session:
    rng = np.random.default_rng(5)
    t_s = np.arange(round(seconds * rate_hz)) / rate_hz
    gyro = rng.normal(bias_dps, WHITE_DPS, (t_s.size, 3)) + ou_noise(t_s.size, 1 / rate_hz, SD_DPS, TAU_S, 3, rng)
    return make_session(make_run(t_s, gyro, table_rate_dps=0.0))


@pytest.mark.parametrize("bias_dps", [0.0, 4.0])
def test_a_drift_much_shorter_than_the_run_is_found_beside_any_bias(bias_dps: float) -> None:
    """A drift that is fitted before the bias takes it for its own size, and ends as a random walk of a hundred times that."""
    session = at_rest(6000.0, bias_dps)
    for axis in fit(session, Model.open(None)).axes.values():
        assert 0.5 * TAU_S < axis.noise.ou_tau_s < 2 * TAU_S
        assert axis.noise.ou_sd_dps == pytest.approx(SD_DPS, rel=0.3)
    for level in measure(session).per_axis.values():
        assert level.rms_dps == pytest.approx(level.floor_dps, rel=0.01)


def swings(cycles: int, scale_sd: float, seed: int) -> Session:
    """One run of a swing in each power cycle, which has an offset and a scale of its own."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(4000) / 50.0
    runs = []
    for k in range(cycles):
        w = 70 * np.sin(2 * np.pi * t_s / rng.uniform(4, 12) + rng.uniform(0, 6))
        gyro = rng.normal(0, 0.03, (t_s.size, 3)) + rng.normal(0, 0.01, 3)
        gyro[:, 2] += (1.004 + rng.normal(0, scale_sd)) * w
        runs.append(make_run(t_s, gyro, scenario=f"s{k}", rate_ref_dps=w))
    return make_session(*runs)


@pytest.mark.parametrize("cycles", [2, 3, 8])
def test_power_cycles_show_their_own_scale_within_one_run(cycles: int) -> None:
    """The scale's error then holds the spread of the power cycles, which white noise alone makes far too small."""
    z = []
    for seed in range(12):
        terms = fit(swings(cycles, 1e-4, seed), Model.open(None), axes="z").axes["z"].terms
        (scale,) = (term for term in terms if term.effect_id == "scale")
        z.append((scale.values["scale"] - 0.004) / scale.se["scale"])
    assert np.median(np.abs(z)) < 1.3
