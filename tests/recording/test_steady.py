"""One file with several rates is cut where the table changes its rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from gyrocal.recording.run import Run
from gyrocal.recording.steady import stretches
from make_runs import make_run

HZ = 100.0


def turned(plan: Sequence[tuple[float, float]], ramp_s: float = 1.0, ripple: float = 0.0, seed: int = 1) -> Run:
    """A run whose table goes through rates (dps, s), with ramps between them, a bias and noise."""
    times, rates, at = [0.0], [plan[0][0]], 0.0
    for k, (rate, seconds) in enumerate(plan):
        times += [at + 1e-6, at + seconds]
        rates += [rate, rate]
        at += seconds + (ramp_s if k < len(plan) - 1 else 0.0)
    t_s = np.arange(0.0, at, 1 / HZ)
    rate = np.interp(t_s, times, rates)
    rng = np.random.default_rng(seed)
    reading = rate * (1 + ripple * np.sin(np.deg2rad(np.cumsum(rate) / HZ))) + 1.5 + rng.normal(0, 0.05, t_s.size)
    gyro = np.stack([rng.normal(0, 0.05, t_s.size), rng.normal(0, 0.05, t_s.size), reading], axis=1)
    return make_run(t_s=t_s, gyro_dps=gyro)


@pytest.mark.parametrize("ripple", [0.0, 0.005])
def test_four_plateaus_are_four_runs_without_their_ramps(ripple: float) -> None:
    plan = [(0.0, 6.0), (78.0, 8.0), (-78.0, 8.0), (30.0, 5.0)]
    found = stretches(turned(plan, ripple=ripple))
    assert [round(s.mean_dps - 1.5) for s in found] == [0, 78, -78, 30]
    begin = 0.0
    for stretch, (_, seconds) in zip(found, plan, strict=True):
        assert begin <= stretch.start_s <= begin + 0.76
        assert begin + seconds - 0.76 <= stretch.end_s <= begin + seconds + 1e-9
        begin += seconds + 1.0
    assert len({s.name for s in found}) == 4
    cut = found[1].cut("down", 78.0)
    assert cut.start is not None
    assert (cut.meta, cut.start.value) == ({"face": "down", "table_rate_dps": 78.0}, found[1].start_s)


def test_one_rate_and_a_swing_are_not_cut() -> None:
    assert stretches(turned([(78.0, 20.0)])) == []
    t_s = np.arange(0, 40, 1 / HZ)
    swing = 90 * np.sin(2 * np.pi * 0.5 * t_s)
    assert stretches(make_run(t_s=t_s, gyro_dps=np.stack([0 * t_s, 0 * t_s, swing], axis=1))) == []
