"""Repeated readings are late on average, and no lag is named for what they delay."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import Array, make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")


def swings(repeated: float, lag_s: float = 0.0) -> Session:
    """Four swings by 100 deg/s, of whose samples a part repeats the one before on all axes."""
    rng, made = np.random.default_rng(1), []
    t_s = np.arange(2500) / 100

    def rate_dps(at_s: Array, phase: float) -> Array:
        return np.asarray(60 * np.sin(2 * np.pi * 1.1 * at_s + phase) + 40 * np.sin(2 * np.pi * 0.4 * at_s + 2 * phase))

    for i in range(4):
        y = rng.normal([0.3, -0.2, 0.4], 0.05, (t_s.size, 3))
        y[:, 2] += 1.004 * rate_dps(t_s - lag_s, i)
        stale = rng.random(t_s.size) < repeated
        stale[0] = False
        fresh = np.maximum.accumulate(np.where(stale, 0, np.arange(t_s.size)))
        gyro = np.rint(y / 0.00875)[fresh] * 0.00875
        made.append(make_run(t_s, gyro, scenario=f"s{i // 2}", day=1 + i // 2, rate_ref_dps=rate_dps(t_s, i), lsb_dps=0.00875))
    return make_session(*made, lsb_dps=0.00875)


@pytest.mark.parametrize(
    ("repeated", "lag_s"),
    [
        (0.3, 0.0),
        pytest.param(0.1, 0.012, marks=pytest.mark.wide),
        pytest.param(0.1, 0.0, marks=pytest.mark.wide),
        pytest.param(0.3, 0.012, marks=pytest.mark.wide),
    ],
)
def test_what_repeated_readings_delay_is_no_lag(repeated: float, lag_s: float) -> None:
    """A lag of 0.9 ms and of 3.8 ms was named beside the repeated readings. A delay beyond theirs is one."""
    named = {c.effect.id for c in diagnose(swings(repeated, lag_s), ON_Z).candidates if c.decision == "add"}
    assert "sampling_fault" in named
    assert ("lag" in named) == (lag_s > 0)
