"""What is said of a session with one power cycle, and of suggestions that no sensor can have."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import without_unphysical
from gyrocal.effects.base import effect
from gyrocal.present.report import verdict_text
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

SLOPE_DPS_PER_S = 1e-3


def drifting(cycles: int) -> Session:
    """Three minutes at rest in each power cycle, with a drift of 1 mdps/s on z."""
    rng = np.random.default_rng(11)
    t_s = np.arange(180 * 25) / 25.0
    made = []
    for i in range(cycles):
        gyro = rng.normal(0, 0.02, (t_s.size, 3))
        gyro[:, 2] += SLOPE_DPS_PER_S * t_s
        made.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{i}", power_on_s=3.0))
    return make_session(*made)


def test_one_power_cycle_is_not_said_to_show_each_of_them() -> None:
    """A drift was said to happen "in the same way in each power cycle" where one had been recorded."""
    found = diagnose(drifting(1))
    drift = next(c for c in found.candidates if c.effect.id == "drift" and c.axis == "z")
    assert drift.values["k_dps_per_s"] == pytest.approx(SLOPE_DPS_PER_S, rel=0.05)
    assert "second power cycle" in drift.next_measurement
    said = verdict_text(found)
    assert "same way in each power cycle" not in said
    if found.verdict == "add":
        assert "only power cycle" in said


def test_several_power_cycles_show_that_a_drift_repeats() -> None:
    found = diagnose(drifting(4))
    assert found.best is not None
    assert (found.verdict, found.best.effect.id) == ("add", "drift")
    assert "in the same way in each power cycle" in verdict_text(found)
    assert "second power cycle" not in found.best.next_measurement


@pytest.mark.parametrize("effect_id", ["drift", "warmup"])
def test_what_needs_power_cycles_to_be_seen_says_so(effect_id: str) -> None:
    kind = effect(effect_id)
    one, several = drifting(1).runs, drifting(2).runs
    assert "second power cycle" in kind.measure_next_in(one)
    assert kind.measure_next_in(several) == kind.measure_next
    assert kind.cause_in(several) == kind.cause != kind.cause_in(one)


def test_no_effect_of_a_size_that_no_sensor_has_is_suggested() -> None:
    """A thermal lag of 157 deg/s per degC/s stood among the causes that a misfit may have."""
    possible = Candidate(effect("thermal_lag"), "z", "suggest", {"k_dps_s_per_c": 0.4})
    absurd = replace(possible, values={"k_dps_s_per_c": -157.0})
    contradicted = replace(possible, contradicted=True)
    named = replace(possible, decision="add")
    judged = without_unphysical([possible, absurd, contradicted, named])
    assert [c.decision for c in judged] == ["suggest", "reject", "reject", "add"]
