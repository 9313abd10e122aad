"""Which quiet stretches of a session by hand are rests."""

from dataclasses import replace

import numpy as np

from by_hand import turned_by
from gyrocal.gravity.rests import check, look

ROUND = [("y", 90.0), ("x", 90.0), ("z", 90.0)]
TREMBLES_DPS = 0.04


def test_a_rest_that_is_cut_is_no_reason_to_leave_out_one_that_trembles() -> None:
    """A rest of 10 s in three pieces made ten rests of eight poses, so that the first pose of the file was not taken."""
    session = turned_by([ROUND[0], *[("x", 0.0)] * 4, *ROUND[1:], *ROUND, *ROUND[:2]])
    (run,) = session.runs
    trembles = np.zeros(len(run))
    trembles[:120] = trembles[550:580] = trembles[900:930] = TREMBLES_DPS
    noise_dps = np.random.default_rng(1).normal(0, 1, (len(run), 3)) * trembles[:, None]
    columns = [run.table[f"g{a}_dps"] + noise_dps[:, i] for i, a in enumerate("xyz")]
    found = look(session.with_runs([replace(run, frame=run.table.with_columns(columns))]))
    assert found.rests[0].t_s < 1.0
    assert len(found.rests) == len(found.movements) + 1 == 9
    assert max(rest.seconds for rest in found.rests) > 8.0


def test_a_rest_that_a_knock_cuts_is_one_and_a_turn_that_leads_back_is_none() -> None:
    """Three pieces of one rest made movements that turn gravity by 0 deg."""
    session = turned_by([ROUND[0], ("x", 0.0), *ROUND[1:], *ROUND, *ROUND])
    (run,) = session.runs
    knocked = run.gyro_dps.copy()
    knocked[380:386, 1] += [2.0, -2.0, 4.0, -4.0, 2.0, -2.0]
    columns = [run.table[f"g{a}_dps"] * 0 + knocked[:, i] for i, a in enumerate("xyz")]
    found = look(session.with_runs([replace(run, frame=run.table.with_columns(columns))]))
    assert len(found.rests) == len(found.movements) + 1 == 10
    back = turned_by([*ROUND, ("x", 90.0), ("x", -90.0), ("z", 360.0), *ROUND])
    assert len(look(back).rests) == 10


def test_a_sensor_that_is_worn_has_no_rests() -> None:
    """Ninety-eight quiet stretches of a walk were taken for rests, and their means for a trusted bias."""
    session = turned_by([*ROUND, *ROUND, *ROUND])
    (run,) = session.runs
    t_s = run.sample_s
    walk = 40.0 * np.sin(2 * np.pi * np.outer(t_s, [0.9, 1.1, 0.7]) + 3 * np.sin(0.35 * t_s)[:, None])
    columns = [run.table[f"g{a}_dps"] + walk[:, i] for i, a in enumerate("xyz")]
    walked = session.with_runs([replace(run, frame=run.table.with_columns(columns))])
    found = look(walked)
    assert not found.rests
    assert not found.movements
    (lacking,) = check(walked)
    assert f"0 rests found ({found.moved} more moved and are left out: their mean rates scatter by" in lacking.text


def test_readings_at_rest_that_are_far_from_zero_are_told_and_what_they_may_be() -> None:
    """An offset of -529 counts read -32 dps at rest without a word."""
    session = turned_by([*ROUND, *ROUND])
    (run,) = session.runs
    assert check(session) == []
    far = session.with_runs([replace(run, frame=run.table.with_columns(run.table["gz_dps"] - 32.0))])
    (told,) = check(far)
    assert (told.code, told.axis, told.blocking) == ("bias_implausible", "z", False)
    assert "far from zero (z -32 dps)" in told.text
    assert told in look(far).warnings
