"""The library is whole: every effect of the table, with units, sizes, words, and columns that fit together."""

import numpy as np
import pytest

from gyrocal.effects.base import effect, effects
from gyrocal.errors import InputError
from gyrocal.recording.session import Run
from gyrocal.simulation.planted import parse

from .checks import showing
from .conftest import MakeRun

# id and parameter names, as people's scripts and model files know them
TABLE = {
    "scale": ["scale"],
    "bias": ["bias_dps"],
    "bias_temperature": ["k1_dps_per_c", "k2_dps_per_c2", "k3_dps_per_c3"],
    "scale_temperature": ["k_per_c"],
    "thermal_lag": ["k_dps_s_per_c"],
    "warmup": ["A_dps", "tau_s"],
    "drift": ["k_dps_per_s"],
    "table_ripple": ["amplitude_1", "phase_1_deg", "amplitude_2", "phase_2_deg"],
    "vibration_tone": ["f_hz", "A_dps"],
    "spin_up": ["A", "tau_s"],
    "g_sensitivity": ["gx_dps_per_g", "gy_dps_per_g", "gz_dps_per_g"],
    "misalignment": ["m"],
    "scale_nonlinearity": ["k3"],
    "scale_asymmetry": ["k"],
    "centripetal": ["k"],
    "lag": ["tau_s"],
    "quantization": ["lsb_dps"],
    "saturation": ["full_scale_dps"],
    "sampling_fault": ["fraction"],
    "clock_error": ["e"],
    "earth_rate": [],
    "bias_jumps": ["n", "size_dps"],
    "thermal_hysteresis": ["amplitude_dps", "width_c"],
    "dead_band": ["width_dps"],
    "order_tone": ["order", "A_dps", "phase_deg"],
    "g2_sensitivity": ["k_dps_per_g2"],
    "byte_fault": ["bit", "step_dps", "fraction"],
}
EVERY = sorted(effects())


def test_every_effect_of_the_table_is_there_with_its_parameters() -> None:
    for effect_id, names in TABLE.items():
        known = [p.name for p in effect(effect_id).parameters]
        assert set(names) <= set(known), effect_id
        assert effect(effect_id).id == effect_id


@pytest.mark.parametrize("effect_id", EVERY)
def test_every_effect_explains_itself(effect_id: str) -> None:
    kind = effect(effect_id)
    assert kind.title
    assert kind.equation
    assert 2 <= kind.cause.count(". ") + 1 <= 5
    for text in (kind.looks_like, kind.measure_next):
        assert text
        assert not text.endswith(".")  # pages and messages put the stop


@pytest.mark.parametrize("effect_id", EVERY)
def test_every_parameter_has_unit_range_source_and_a_default_within_it(effect_id: str) -> None:
    kind = effect(effect_id)
    for p in kind.parameters:
        assert p.unit
        assert len(p.source) > 5
        assert p.typical[0] < p.typical[1]
        if p.default:
            assert p.typical[0] <= abs(p.default) <= p.typical[1], f"{effect_id}.{p.name}"
        for suffix, unit in (("_dps", "dps"), ("_s", "s"), ("_hz", "Hz"), ("_deg", "deg"), ("_per_c", "/degC")):
            if p.name.endswith(suffix):
                assert unit in p.unit, p.name
    assert set(kind.linear) | set(kind.nonlinear) <= {p.name for p in kind.parameters}


@pytest.mark.parametrize("effect_id", EVERY)
def test_columns_coefficients_and_groups_fit_together(effect_id: str, rich_run: Run) -> None:
    kind = effect(effect_id)
    rng = np.random.default_rng(1)
    for axis in range(3):
        for variant in kind.variants([rich_run], axis):
            values = kind.draw({}, rng)
            chosen = {n: v for n, v in values.items() if n in variant or n not in kind.linear}
            columns = kind.columns(rich_run, axis, chosen)
            assert columns.shape == (len(rich_run), len(kind.coding.groups(chosen)))
            assert np.all(np.isfinite(columns))
            c = kind.coding.coefficients(chosen)
            assert c.shape == (columns.shape[1],)
            again = {**chosen, **kind.coding.named(c, chosen)}
            np.testing.assert_allclose(kind.coding.coefficients(again), c, atol=1e-15)
            assert kind.coding.spread(chosen).shape == c.shape


@pytest.mark.parametrize("effect_id", EVERY)
def test_a_run_without_optional_columns_is_no_error(effect_id: str, make_run: MakeRun) -> None:
    """What an effect needs and a run lacks makes it not measurable: it says so in words, and its columns are zero."""
    kind = effect(effect_id)
    bare = make_run(np.arange(50) / 10, table_rate_dps=0.0)
    values = kind.draw({}, np.random.default_rng(1))
    for axis in range(3):
        term = kind.term(bare, axis, values)
        assert term.shape == (50,)
        assert np.all(np.isfinite(term))
        needed = kind.missing([bare], axis)
        if needed is not None:
            assert len(needed) > 20
            assert not needed.endswith(".")
            assert not np.any(kind.columns(bare, axis, values)), needed


def test_effects_that_need_a_column_say_which(make_run: MakeRun) -> None:
    bare = make_run(np.arange(300) / 10)
    for effect_id, word in {
        "bias_temperature": "temp_c",
        "scale_temperature": "temp_c",
        "thermal_lag": "temp_c",
        "warmup": "power_on_s",
        "g_sensitivity": "az_g",
        "lag": "rate_ref_dps",
        "clock_error": "rate_ref_dps",
        "earth_rate": "latitude_deg",
    }.items():
        assert word in (effect(effect_id).missing([bare], 2) or ""), effect_id
    assert "another axis" in (effect("misalignment").missing([bare], 2) or "")
    assert effect("misalignment").missing([bare], 0) is None
    still = make_run(np.arange(300) / 10, table_rate_dps=0.0)
    for effect_id in ("scale_nonlinearity", "scale_asymmetry", "scale_temperature"):
        assert "turns about this axis" in (effect(effect_id).missing([still], 2) or "")
    assert "table turns at a known rate" in (effect("centripetal").missing([still], 2) or "")
    turning = make_run(np.arange(300) / 10, table_rate_dps=78.0, axis="x")
    assert effect("centripetal").missing([turning], 2) is None


def test_what_is_needed_is_enough(rich_run: Run) -> None:
    """A run with every column shows every effect that has anything to be fitted, on the axes where it acts.

    An error of the stated rate is shown by a run without a measured one.
    """
    for kind in effects().values():
        if kind.linear or kind.fault:
            run = showing(kind, rich_run)
            assert all(kind.missing([run], axis) is None for axis in kind.axes(run)), kind.id


def test_a_measured_rate_holds_what_the_table_does(rich_run: Run) -> None:
    kind = effect("spin_up")
    assert "rate_ref_dps" in (kind.missing([rich_run], 2) or "")
    assert not np.any(kind.term(rich_run, 2, {"A": 0.01, "tau_s": 2.0}))
    assert np.any(kind.term(showing(kind, rich_run), 2, {"A": 0.01, "tau_s": 2.0}))


def test_one_run_without_the_column_is_not_missed_but_all_are(rich_run: Run, make_run: MakeRun) -> None:
    bare = make_run(np.arange(300) / 10)
    for effect_id in ("bias_temperature", "scale_temperature", "thermal_lag", "warmup", "g_sensitivity"):
        kind = effect(effect_id)
        assert kind.missing([rich_run, bare], 2) == kind.missing([rich_run], 2)
        assert kind.missing([bare, bare], 2) is not None
        assert (kind.lacks(rich_run), kind.lacks(bare)) == (False, True)


def test_thresholds_of_a_moving_column(make_run: MakeRun) -> None:
    t_s = np.arange(400) / 10
    flat, warming = (make_run(t_s, temp_c=30 + span * t_s / 40) for span in (0.1, 3.0))
    short = make_run(t_s[:60], temp_c=np.linspace(20, 30, 60))
    assert effect("bias_temperature").missing([flat], 2) is not None
    assert effect("bias_temperature").missing([warming], 2) is None
    assert effect("thermal_lag").missing([flat], 2) is not None
    assert effect("thermal_lag").missing([short], 2) is not None
    assert effect("thermal_lag").missing([warming], 2) is None
    encoder = make_run(t_s, rate_ref_dps=78 + np.random.default_rng(0).normal(0, 0.02, t_s.size))
    assert effect("lag").missing([encoder], 2) is not None


def test_the_command_line_knows_every_parameter() -> None:
    assert parse("g_sensitivity:gz_dps_per_g=0.03") == ("g_sensitivity", {"gz_dps_per_g": 0.03})
    assert parse("earth_rate:latitude_deg=32.8") == ("earth_rate", {"latitude_deg": 32.8})


@pytest.mark.parametrize("effect_id", sorted(effects()))
def test_the_command_line_refuses_what_no_parameter_can_be(effect_id: str) -> None:
    """A nonlinear parameter is a time, a frequency or a width, so it is positive; every bound holds for a planted value too."""
    kind = effect(effect_id)
    for p in kind.parameters:
        assert p.name not in kind.nonlinear or p.bounds[0] > 0
        if np.isfinite(p.bounds[0]):
            with pytest.raises(InputError, match=f"{p.name} is -91, must be"):
                parse(f"{effect_id}:{p.name}=-91")
