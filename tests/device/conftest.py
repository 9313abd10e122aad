"""Sessions for the simulated device."""

from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.recording.session import Session
from make_runs import make_run, make_session

LSB_DPS = 0.00875


@pytest.fixture
def session(require_tool: Callable[[str], str]) -> Session:
    """Two scenarios of an up and a down run, 7 s at 145 Hz with jitter and a gap; whole counts throughout."""
    require_tool("cc")
    return two_faces(seconds=7.0)


def two_faces(seconds: float, rate_hz: float = 145.0, scenarios: int = 2, seed: int = 5) -> Session:
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(2 * scenarios):
        face = "up" if i % 2 == 0 else "down"
        n = round(seconds * rate_hz)
        t_us = np.rint(np.arange(n) * 1e6 / rate_hz + rng.integers(-200, 200, n)).astype(np.int64)
        keep = np.ones(n, bool)
        keep[n // 3 : n // 3 + 4] = False
        t_us = (t_us - t_us[0])[keep]
        sign = 1 if face == "up" else -1
        counts = np.array([3, -5, round(sign * 78.3 / LSB_DPS)]) + rng.integers(-40, 40, (len(t_us), 3))
        acc = np.array([0, 0, sign * 16393]) + rng.integers(-30, 30, (len(t_us), 3))
        runs.append(
            make_run(
                t_us * 1e-6, counts * LSB_DPS, face=face, scenario=f"s{i // 2:03d}", rate_hz=rate_hz,
                power_on_s=3.0 if face == "up" else 20.0, temp_c=25.0 + rng.integers(-300, 300, len(t_us)) / 256.0,
                **{f"a{a}_g": acc[:, k] * 6.1e-5 for k, a in enumerate("xyz")},
            )
        )  # fmt: skip
    return make_session(*runs, full_scale_dps=250.0, lsb_dps=LSB_DPS)
