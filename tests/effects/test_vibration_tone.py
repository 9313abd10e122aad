"""Where the search for a vibration begins: at its own line, not at those of a motion that scale and delay leave."""

import numpy as np
import pytest

from gyrocal.effects.vibration_tone import VibrationTone
from make_runs import make_run


@pytest.mark.parametrize("axis", [0, 2])
def test_the_lines_of_a_measured_motion_are_not_those_of_a_vibration(axis: int) -> None:
    rng, t_s = np.random.default_rng(3), np.arange(6000) / 100
    rate_dps, delayed_dps = (
        80 * np.sin(2 * np.pi * 1.3 * at_s) + 50 * np.sin(2 * np.pi * 4.1 * at_s) for at_s in (t_s, t_s - 0.003)
    )
    gyro = rng.normal(0, 0.03, (t_s.size, 3))
    gyro[:, 2] += 1.004 * delayed_dps
    gyro[:, 0] += 0.002 * rate_dps
    gyro[:, axis] += 0.005 * np.sin(2 * np.pi * 17.5 * t_s)
    runs = [make_run(t_s, gyro, table_rate_dps=None, rate_ref_dps=rate_dps)]
    assert any(abs(start["f_hz"] - 17.5) < 0.02 for start in VibrationTone().variants(runs, axis))
