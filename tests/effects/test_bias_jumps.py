"""Jumps of the bias happen at any time: those that repeat in each run are of what the run does."""

import numpy as np
import pytest

from gyrocal.effects.bias_jumps import jumps, repeat_in_runs
from gyrocal.recording.session import Run
from make_runs import make_run

T_S = np.arange(6000) / 100.0


def run_with(at_s: list[float], rng: np.random.Generator, cycle: int) -> Run:
    gyro = rng.normal(0, 0.02, (T_S.size, 3))
    for k, t_s in enumerate(at_s):
        gyro[t_s <= T_S, 1] += (-1) ** k * 0.05
    return make_run(T_S, gyro, scenario=f"s{cycle}", rate_hz=100.0)


@pytest.mark.parametrize("together", [True, False])
def test_jumps_at_one_time_in_several_runs_repeat(together: bool) -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        first_s, runs = float(rng.uniform(8, 38)), []
        for cycle in range(4):
            at_s = first_s + rng.normal(0, 0.1) if together else float(rng.uniform(8, 38))
            runs.append(run_with([at_s, at_s + (14.0 if together else rng.uniform(12, 52 - at_s))], rng, cycle))
        assert all(len(jumps(run, 1)) == 2 for run in runs)
        assert repeat_in_runs(runs, 1) is together


@pytest.mark.parametrize("slope_dps_per_s", [0.0, 0.02])
def test_a_bias_that_drifts_steadily_or_slowly_back_and_forth_has_no_jumps_beside_those_it_has(slope_dps_per_s: float) -> None:
    drift_dps = slope_dps_per_s * T_S if slope_dps_per_s else 0.2 * np.sin(2 * np.pi * T_S / 60)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        at_s = float(rng.uniform(8, 50))
        sound, jumping = run_with([], rng, 0), run_with([at_s], rng, 0)
        assert jumps(make_run(T_S, sound.gyro_dps + drift_dps[:, None], rate_hz=100.0), 1) == []
        found = jumps(make_run(T_S, jumping.gyro_dps + drift_dps[:, None], rate_hz=100.0), 1)
        assert [T_S[row] for row in found] == pytest.approx([at_s], abs=0.5)
