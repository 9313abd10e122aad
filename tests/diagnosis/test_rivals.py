"""Which candidates stay in a group with the first one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.candidate import Candidate, Decision
from gyrocal.diagnosis.naming.decision import has_size, meets
from gyrocal.diagnosis.naming.gains import total
from gyrocal.diagnosis.naming.rivals import with_groups, with_suggested_groups
from gyrocal.diagnosis.naming.sets import fitted_together
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

SIGNAL = np.sin(np.arange(200) / 9)


def candidate(effect_id: str, decision: Decision, gains: list[float], parameters: int) -> Candidate:
    return Candidate(
        effect(effect_id), "z", decision, gain=sum(gains), gain_se=1.0, parameters=parameters, signal=SIGNAL,
        unit_gains=np.array(gains),
    )  # fmt: skip


def test_a_simpler_rival_of_the_same_shape_stays_in_the_group_though_it_only_reached_suggest() -> None:
    """It was dropped, and the truth was not in the group."""
    curve = candidate("bias_temperature", "add", [5.0, 6.0, 5.5], 2)
    line = candidate("drift", "suggest", [4.9, 6.1, 5.3], 1)
    assert with_groups([curve, line])[0].group == ("bias_temperature", "drift")


def test_a_simpler_rival_that_passes_is_preferred() -> None:
    curve = candidate("bias_temperature", "add", [5.0, 6.0, 5.5], 2)
    line = candidate("drift", "add", [4.9, 6.1, 5.3], 1)
    judged = with_groups([curve, line])
    assert [c.decision for c in judged] == ["suggest", "add"]


def test_a_rival_of_a_size_that_no_sensor_has_is_not_shown() -> None:
    line = candidate("drift", "add", [5.0, 6.0, 5.5], 1)
    for size, group in ((0.4, ("drift", "thermal_lag")), (-157.0, ("drift",))):
        slope = replace(candidate("thermal_lag", "suggest", [4.9, 6.1, 5.3], 1), values={"k_dps_s_per_c": size})
        assert with_groups([line, slope])[0].group == group
        suggested = with_suggested_groups([replace(line, decision="suggest"), slope], ["z"])
        assert any(c.group == group for c in suggested) is (len(group) > 1)


def test_a_richer_rival_of_the_same_shape_is_not_shown() -> None:
    line = candidate("drift", "add", [5.0, 6.0, 5.5], 1)
    curve = candidate("bias_temperature", "suggest", [5.1, 6.1, 5.6], 3)
    assert with_groups([line, curve])[0].group == ("drift",)


def test_a_richer_rival_that_gains_enough_for_its_parameters_is_shown() -> None:
    """A curve with a gain of 11.5 stood beside a line with 8.1, whose drift was named alone; a warm-up had been planted."""
    line = candidate("drift", "add", [2.5, 3.0, 2.6], 1)
    for more, group in ((1.5, ("drift",)), (3.4, ("warmup", "drift"))):
        curve = candidate("warmup", "suggest", [2.5 + more, 3.0, 2.6], 2)
        assert with_groups([line, curve])[0].group == group


def test_beside_an_effect_that_is_itself_larger_than_usual_a_rival_of_any_size_is_shown() -> None:
    """A disturbance made a temperature dependence too large for any sensor, and named a drift that was nine times the usual."""
    slope = replace(candidate("thermal_lag", "suggest", [4.9, 6.1, 5.3], 1), values={"k_dps_s_per_c": -157.0})
    for k_dps_per_s, group in ((5e-4, ("drift",)), (9e-3, ("drift", "thermal_lag"))):
        line = replace(candidate("drift", "add", [5.0, 6.0, 5.5], 1), values={"k_dps_per_s": k_dps_per_s})
        assert with_groups([line, slope])[0].group == group


def test_what_is_named_beside_sure_names_differs_from_zero() -> None:
    """Readings that jumps had spoiled named a drift of -1.8 +- 0.8 mdps/s beside them, with a gain of 20 +- 14."""
    drift = candidate("drift", "suggest", [20.0], 1)
    for se, sized in ((8e-4, False), (6e-4, True), (0.0, True)):
        assert has_size(replace(drift, values={"k_dps_per_s": -1.8e-3}, se={"k_dps_per_s": se})) is sized
    assert has_size(replace(candidate("saturation", "suggest", [20.0], 1), values={"full_scale_dps": 250.0}))


def test_suggestions_of_one_shape_are_shown_together_where_nothing_passes() -> None:
    """One run holds a transient in one part, which no other part predicts: both causes are suggested, and neither is proven."""
    table = candidate("spin_up", "suggest", [9.0, 0.1, 0.0], 2)
    sensor = candidate("warmup", "suggest", [8.0, 0.2, 0.1], 2)
    judged = with_suggested_groups([table, sensor], ["z"])
    assert {c.group for c in judged} >= {("spin_up", "warmup")} or {c.group for c in judged} >= {("warmup", "spin_up")}
    assert all(c.decision == "suggest" for c in judged)
    assert with_suggested_groups([table], ["z"])[0].group == ()


def test_a_unit_that_is_not_predicted_leaves_the_gain_without_an_error() -> None:
    assert total(np.array([1.0, -np.inf]))[1] is None


def test_the_model_alone_is_the_fit_with_an_empty_set() -> None:
    """A set of one effect left its member alone, and explain stopped with an error."""
    current = SimpleNamespace(fit=SimpleNamespace(terms=["scale", "bias"]), axis="z")
    assert fitted_together(current, []) is current.fit  # type: ignore[arg-type]


@pytest.mark.parametrize(("hz", "named"), [(10.9, True), (1.7, False)])
def test_a_line_that_no_slow_effect_can_make_does_not_hide_one(hz: float, named: bool) -> None:
    """A line of 90 standard errors at 11 Hz kept a nonlinearity that gains 900 from being named."""
    line = Finding("z", "frequency", 90.0, 1e-43, 0.055, "a line", band_hz=(hz, hz))
    curve = candidate("scale_nonlinearity", "suggest", [300.0, 290.0, 310.0], 1)
    compared = SimpleNamespace(where=[line], fit=fit(make_session(make_run(np.arange(200) / 20)), Model.builtin("default")))
    assert meets(curve, compared) is named  # type: ignore[arg-type]


def warming(course_c: np.ndarray) -> Candidate:
    """The first candidate of rests whose bias drifts with the time in the run, beside a temperature in the same room."""
    rng = np.random.default_rng(4)
    t_s = np.arange(40 * 50) / 50
    runs = []
    for k in range(6):
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.03, (t_s.size, 3))
        gyro[:, 2] += 0.0014 * t_s
        temp_c = 31.5 + 0.04 * k + course_c + rng.normal(0, 0.005, t_s.size)
        runs.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{k}", rate_hz=50.0, power_on_s=2.0, temp_c=temp_c))
    return diagnose(make_session(*runs)).candidates[0]


@pytest.mark.wide
def test_a_temperature_that_moves_too_little_to_be_measured_is_a_rival_all_the_same() -> None:
    """A drift was named with certainty beside a temperature of the same course, whose effect could not be measured."""
    t_s = np.arange(40 * 50) / 50
    found = warming(0.01 * t_s)
    assert found.decision == "add"
    assert set(found.group) == {"drift", "bias_temperature"}
    apart = warming(0.2 * np.sin(t_s / 3))
    assert apart.effect.id == "drift"
    assert apart.named
