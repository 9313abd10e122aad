"""A wave over the table's angle is one of the runs that turn, beside their own means."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.recording.session import Session
from gyrocal.variables.shapes import Waves
from gyrocal.variables.table_angle import TableAngle
from make_runs import make_run, make_session

RATE_HZ, WHITE_DPS = 50.0, 0.01


def session(wave_dps: float) -> Session:
    """Rests at five angles with offsets, and turns with a wave of the table of one phase, on three days."""
    rng, t_s, made = np.random.default_rng(12), np.arange(1500) / RATE_HZ, []
    for cycle in range(3):
        offset_dps = rng.normal(0, 0.1, 3)
        for k, rate_dps in enumerate((0.0, 60.0, 0.0, -60.0, 0.0, 90.0)):
            start_deg = 67.0 * k + 31.0 * cycle
            angle_deg = start_deg + rate_dps * t_s
            gyro_dps = rng.normal(0, WHITE_DPS, (t_s.size, 3)) + offset_dps + rng.normal(0, 0.03, 3)
            gyro_dps[:, 2] += rate_dps + wave_dps * np.cos(np.deg2rad(angle_deg)) * (rate_dps != 0)
            made.append(make_run(
                t_s, gyro_dps, table_rate_dps=rate_dps, scenario=f"s{cycle}", day=cycle, table_angle_deg=angle_deg
            ))  # fmt: skip
    return make_session(*made)


def test_runs_that_stand_have_no_wave_and_the_others_none_in_their_means() -> None:
    runs = session(0.0).runs
    (shape,) = TableAngle(runs).shapes(2)
    assert isinstance(shape, Waves)
    for run in runs:
        columns = shape.columns(run, 2, {})
        assert np.abs(columns.mean(axis=0)).max() < 1e-9
        assert np.any(columns) == np.any(run.rate_dps)


@pytest.mark.parametrize("wave_dps", [0.0, 0.012])
def test_the_wave_that_is_told_is_that_of_least_squares_in_the_runs_that_turn(wave_dps: float) -> None:
    """Waves through the angles of standing runs described their offsets: 45 mdps six times per turn, where 0.7 were."""
    told = [f for f in compare(session(wave_dps)).where if f.against == "table_angle"]
    assert [f.axis for f in told] == ["z"] * (wave_dps > 0)  # and once
    assert all("once per turn, of the same phase in each run" in f.note for f in told)
    assert all(f.amplitude_dps == pytest.approx(wave_dps, rel=0.1) for f in told)
