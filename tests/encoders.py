"""Sessions beside an encoder that is eccentric, coarse, or slower than the sensor and held until its next reading."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrocal.recording.session import Session
from make_runs import make_run, make_session

Array = NDArray[np.float64]
SCALE, BIAS_DPS, WHITE_DPS = 0.006, -0.4, 0.03
FIXED_DPS = (60.0, -60.0, 90.0, -90.0)


def encoder_session(
    seed: int, rate_hz: float = 100.0, *, step_deg: float = 0.02, eccentric_deg: float = 0.0, swing_dps: float = 0.0,
    wobble: float = 0.0, encoder_hz: float = 0.0, seconds: float = 40.0, as_rate: bool = False,
) -> Session:  # fmt: skip
    """Four power cycles of one run each: at fixed rates, or a swing of ``swing_dps`` (rms) below 0.8 Hz.

    The encoder reads the angle with steps and once per turn an error of ``eccentric_deg``. The rate really wobbles by
    the fraction ``wobble``. With ``encoder_hz`` each reading is held in the sensor's rows until the next one.
    ``as_rate``: the reference is the exact slope of the eccentric angle.
    """
    rng = np.random.default_rng(seed)

    def run(cycle: int) -> Any:
        t_s = np.arange(round(seconds * rate_hz)) / rate_hz
        f_hz, phase = rng.uniform(0.05, 0.8, 6), rng.uniform(0, 6.28, 6)
        fixed_dps, start_deg = (0.0 if swing_dps else FIXED_DPS[cycle]), rng.uniform(0, 360)
        size_deg = swing_dps * 2**0.5 * rng.dirichlet(np.ones(6)) ** 0.5 / (2 * np.pi * f_hz)
        slow = wobble * 2**0.5 * fixed_dps

        def angle_deg(at_s: Array) -> Array:
            waves = np.sum(size_deg * np.sin(2 * np.pi * f_hz * at_s[:, None] + phase), axis=1)
            true = start_deg + fixed_dps * at_s + waves - slow / 1.7 * np.cos(1.7 * at_s)
            return np.asarray(true)

        def read_deg(at_s: Array) -> Array:
            true = angle_deg(at_s)
            return np.asarray(true + eccentric_deg * np.sin(np.deg2rad(true) + 0.5))

        def slope_dps(of: Any) -> Array:
            return np.asarray((of(t_s + 1e-4) - of(t_s - 1e-4)) / 2e-4)

        gyro = rng.normal(0, WHITE_DPS, (t_s.size, 3))
        gyro[:, 2] += (1 + SCALE) * slope_dps(angle_deg) + BIAS_DPS + rng.normal(0, 0.02)
        if as_rate:
            columns = {"rate_ref_dps": slope_dps(read_deg)}
        else:
            at_s = t_s
            if encoder_hz:
                first_s = rng.uniform(0, 1 / encoder_hz)
                at_s = np.maximum(np.floor((t_s - first_s) * encoder_hz) / encoder_hz + first_s, 0.0)
            columns = {"ref_angle_deg": np.round(read_deg(at_s) / step_deg) * step_deg}
        return make_run(t_s, gyro, table_rate_dps=None, scenario=f"s{cycle}", rate_hz=rate_hz, **columns)

    return make_session(*(run(k) for k in range(4)))


def session_of_moves(seed: int, step_deg: float, white_dps: float, rate_hz: float = 100.0, seconds: float = 18.0) -> Session:
    """Five power cycles of one run each: moves of one to three seconds with pauses between, by an encoder with steps."""
    rng = np.random.default_rng(seed)

    def run(cycle: int) -> Any:
        t_s = np.arange(round(seconds * rate_hz)) / rate_hz
        rate_dps, begin_s = np.zeros(t_s.size), 1.0
        while begin_s < seconds - 3.0:
            length_s, speed_dps = rng.uniform(1.0, 3.0), rng.uniform(18.0, 60.0) * rng.choice([-1.0, 1.0])
            moves = (t_s >= begin_s) & (t_s < begin_s + length_s)
            rate_dps[moves] = speed_dps * np.sin(np.pi * (t_s[moves] - begin_s) / length_s) ** 2
            begin_s += length_s + rng.uniform(0.5, 1.5)
        angle_deg = (np.cumsum(rate_dps) - rate_dps / 2) / rate_hz
        gyro = rng.normal(0.0, white_dps, (t_s.size, 3))
        gyro[:, 2] += (1 + SCALE) * rate_dps + BIAS_DPS
        columns = {"ref_angle_deg": np.round(angle_deg / step_deg) * step_deg}
        return make_run(t_s, gyro, table_rate_dps=None, scenario=f"s{cycle}", rate_hz=rate_hz, **columns)

    return make_session(*(run(k) for k in range(5)))
