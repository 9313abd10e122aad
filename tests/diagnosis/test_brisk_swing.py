"""A table that swings fast: what lags moves by more than the noise from one sample to the next, and is no single reading."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")
RATE_HZ, LAG_S = 104.0, 0.005


def swing_dps(t_s: np.ndarray, phase: float) -> np.ndarray:
    return 70 * np.sin(2 * np.pi * 0.5 * t_s + phase) + 30 * np.sin(2 * np.pi * 1.15 * t_s + 2 * phase)


def swings(lag_s: float) -> Session:
    rng = np.random.default_rng(6)
    t_s = np.arange(round(30 * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(6):
        phase = rng.uniform(0, 6)
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.03, (t_s.size, 3))
        gyro[:, 2] += 1.004 * swing_dps(t_s - lag_s, phase)
        runs.append(
            make_run(t_s, gyro, scenario=f"s{cycle}", day=1 + cycle % 2, rate_hz=RATE_HZ, rate_ref_dps=swing_dps(t_s, phase))
        )
    return make_session(*runs)


@pytest.mark.wide
def test_a_lag_is_named_though_its_lines_in_the_spectrum_stand_out_more() -> None:
    found = diagnose(swings(LAG_S), ON_Z)
    assert found.verdict == "add"
    assert found.best is not None
    assert (found.best.effect.id, found.best.axis) == ("lag", "z")
    assert found.best.values["tau_s"] == pytest.approx(LAG_S, rel=0.05)


def test_without_one_nothing_is_missing() -> None:
    assert diagnose(swings(0.0), ON_Z).verdict == "adequate"


def test_bursts_shorter_than_the_estimator_s_blocks_are_fitted_all_together() -> None:
    """60 ms of readings every 3 s: no quarter of a second is whole, so no power cycle has an answer by itself."""
    session = simulate(None, "paper", [], 1, scenarios=2, seconds=12)[0]
    bursts = session.with_runs(replace(r, frame=r.table.filter(r.table["t_s"] % 3.0 < 0.06)) for r in session.runs)
    whole = calibrate(session, [6.0], ["model"])[0]
    (found,) = calibrate(bursts, [6.0], ["model"])
    assert found.scenario == "all"
    assert abs(found.scale - whole.scale) < 4 * np.hypot(found.scale_se, whole.scale_se)
