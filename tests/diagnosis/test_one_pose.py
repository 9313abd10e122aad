"""In one pose, an accelerometer shows its own drift: a misfit is not told against the acceleration, nor called its effect."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.api import compare, diagnose
from gyrocal.effects.base import effect
from gyrocal.effects.quantities import means_of_tenths, pose_changes
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from make_runs import make_run

pytestmark = pytest.mark.usefixtures("tests_alone")


def in_a_chamber(seed: int, tilted_rad: float = 0.0) -> Session:
    """A run at rest while the part warms by 80 °C and cools again; its bias and its accelerometer follow a curve each."""
    session, _ = simulate(None, "full", (), seed, scenarios=1, seconds=40.0)
    run = next(r for r in session.runs if r.table_rate_dps == 0)
    n, rng = len(run), np.random.default_rng(seed)
    part = np.linspace(0, 1, n)
    temp_c = -15 + 80 * np.sin(np.pi * part) ** 2 + rng.normal(0, 0.02, n)
    warm = (temp_c - 25) / 40
    curve = warm + 0.4 * warm**2
    columns = {f"g{a}_dps": run.gyro_dps[:, i] + k * curve for i, (a, k) in enumerate({"x": 0.2, "y": 1.0, "z": 0.4}.items())}
    tilt = tilted_rad * np.sign(np.sin(7 * np.pi * part))
    acc_g = np.column_stack([np.sin(tilt), np.zeros(n), np.cos(tilt) + 0.04 * warm + 0.01 * warm**2])
    acc_g += rng.normal(0, 0.002, acc_g.shape)
    columns |= {f"a{a}_g": acc_g[:, i] for i, a in enumerate("xyz")} | {"temp_c": temp_c}
    table = run.table.with_columns(*(pl.Series(name, values) for name, values in columns.items()))
    return session.with_runs([replace(run, path=None, frame=table)])


@pytest.mark.usefixtures("known_answers")
def test_a_chamber_is_told_against_the_temperature() -> None:
    """The first finding was "in proportion to the acceleration", because three components need fewer columns than steps."""
    session = in_a_chamber(1)
    assert np.ptp(session.runs[0].table["az_g"].to_numpy()) > 0.06
    found = compare(session)
    assert found.verdict == "misfit"
    assert "acceleration" not in {f.against for f in found.where}
    assert found.where[0].against in ("temperature", "time", "power_on_time")
    g = [c for c in diagnose(session).candidates if c.effect.id == "g_sensitivity"]
    assert {c.decision for c in g} == {"not_measurable"}
    assert all("two poses" in c.next_measurement for c in g)


def test_a_pose_that_changes_is_seen() -> None:
    still, tilted = in_a_chamber(1), in_a_chamber(1, tilted_rad=0.1)
    assert not pose_changes(still.runs)
    assert pose_changes(tilted.runs)
    both_faces, _ = simulate(None, "full", (), 1, scenarios=1, seconds=2.0)
    assert pose_changes(both_faces.runs)


def test_a_hand_that_turns_the_part_over_within_seconds_shows_every_component() -> None:
    """As means over a tenth of the run, all poses are the same one."""
    t_s = np.arange(30000) / 100
    tilt, roll = np.sin(2 * np.pi * 0.31 * t_s), np.sin(2 * np.pi * 0.23 * t_s)
    acc = {"ax_g": np.sin(tilt), "ay_g": np.cos(tilt) * np.sin(roll), "az_g": np.cos(tilt) * np.cos(roll)}
    run = make_run(t_s, table_rate_dps=0.0, **acc)
    assert all(np.ptp(means_of_tenths(column[:, None])) < 0.05 for column in acc.values())
    assert effect("g_sensitivity").missing([run], 2) is None
    assert max(effect("g_sensitivity").variants([run], 2), key=len).keys() == {f"g{a}_dps_per_g" for a in "xyz"}
