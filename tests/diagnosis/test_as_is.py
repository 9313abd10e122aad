"""One day's model held against another day's session: it holds where nothing has changed, and what has moved is told."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from gyrocal import api
from gyrocal.cli import app
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.gravity.as_is import compare_as_is
from gyrocal.gravity.calibrate import calibrate
from gyrocal.gravity.compare import compare as compare_gravity
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from make_runs import make_run, make_session

T_S = np.arange(1000) / 50
WHITE_DPS, TURN_ON_DPS = 0.05, 0.01
TRUE = {"bias_dps": 1.2345678, "scale": 0.0045, "k1_dps_per_c": 0.02}


def today(seed: int, cycles: int = 4, base_c: float = 25.0, swing_c: float = 6.0, **changed: float) -> Session:
    """An up and a down run in each power cycle, made by the paper's eq. (4) with a bias that follows the temperature."""
    rng = np.random.default_rng(seed)
    p = {**TRUE, **changed}
    runs = []
    for k in range(cycles):
        turn_on = rng.normal(0, TURN_ON_DPS, 3)
        for face, rate in (("up", 78.0), ("down", -78.0)):
            temp_c = base_c + swing_c * np.sin(T_S / 15 + k + (rate < 0)) + 0.3 * k
            gyro = rng.normal(turn_on, WHITE_DPS, (T_S.size, 3))
            gyro[:, 2] += p["bias_dps"] + (1 + p["scale"]) * rate + p["k1_dps_per_c"] * (temp_c - 25)
            runs.append(make_run(T_S, gyro, face=face, scenario=f"s{k}", temp_c=temp_c))
    return make_session(*runs)


def yesterday(turn_on_dps: float | None = TURN_ON_DPS) -> Model:
    """The model file of a sensor whose parameters are known exactly."""
    terms = (
        Term("scale", "z", {"scale": TRUE["scale"]}, {"scale": 1e-6}), Term("bias", "z", {"bias_dps": TRUE["bias_dps"]}),
        Term("bias_temperature", "z", {"k1_dps_per_c": TRUE["k1_dps_per_c"]}, {"k1_dps_per_c": 1e-5}),
    )  # fmt: skip
    return Model("yesterday", terms, {"z": AxisNoise(turn_on_bias=TurnOnBias(turn_on_dps))})


@pytest.mark.wide
def test_a_session_of_the_model_s_own_parameters_is_adequate_and_its_floor_is_the_rms() -> None:
    found = [compare(today(seed), yesterday(), as_is=True) for seed in range(6)]
    assert [c.verdict for c in found] == ["adequate"] * 6
    z = np.array([m.z for c in found for m in c.moved or ()])
    assert z.size == 18
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.5
    rms, floor = (np.array([getattr(c.pooled, name) for c in found]) for name in ("rms_dps", "floor_dps"))
    assert np.sum(rms**2) == pytest.approx(np.sum(floor**2), rel=0.03)
    assert all((c.pooled.excess_dps or 0) < 3 * (c.pooled.excess_se_dps or 0) for c in found)


def test_the_parameters_stay_those_of_the_file_to_the_last_digit() -> None:
    told = compare(today(1, bias_dps=1.3), yesterday(), as_is=True).to_json()
    assert told["as_is"] is True
    assert {row["name"]: row["value"] for row in told["parameters"] if row["name"] in TRUE} == TRUE


@pytest.mark.parametrize(
    ("name", "by", "against"), [("bias_dps", 0.06, "level"), ("scale", 4e-4, "rate"), ("k1_dps_per_c", 0.01, "temperature")]
)
def test_a_parameter_that_has_moved_is_a_misfit_and_told_within_its_error(name: str, by: float, against: str) -> None:
    found = compare(today(2, **{name: TRUE[name] + by}), yesterday(), as_is=True)
    assert found.verdict == "misfit"
    assert (found.where[0].axis, found.where[0].against) == ("z", against)
    first = (found.moved or [])[0]
    assert first.name == name
    assert first.file == TRUE[name]
    assert first.session is not None
    assert first.se is not None
    assert abs(first.session - first.file - by) < 4 * first.se
    assert abs(first.z or 0) > 5
    assert all(abs(m.z or 0) < 4 for m in (found.moved or [])[1:])
    assert (found.pooled.excess_dps or 0) > 3 * (found.pooled.excess_se_dps or 0)


def test_a_bias_is_compared_at_25_degrees_also_in_a_session_of_one_other_temperature() -> None:
    held = compare(today(3, base_c=45.0, swing_c=0.0), yesterday(), as_is=True)
    assert held.verdict == "adequate"
    moved = compare(today(3, base_c=45.0, swing_c=0.0, bias_dps=TRUE["bias_dps"] + 0.1), yesterday(), as_is=True)
    assert moved.verdict == "misfit"


def test_a_session_that_cannot_tell_which_parameter_moved_is_a_misfit_all_the_same() -> None:
    """At 44 to 46 degC, neither the bias at 25 degC nor its slope is certain, but both together are."""
    changed = today(4, base_c=45.0, swing_c=0.4, bias_dps=TRUE["bias_dps"] + 0.08)
    loose = yesterday()
    found = compare(changed, loose, as_is=True)
    assert found.verdict == "misfit"


def test_what_one_power_cycle_may_differ_by_is_no_change_of_the_bias() -> None:
    one = today(5, cycles=1)
    shifted = today(5, cycles=1, bias_dps=TRUE["bias_dps"] + 2 * TURN_ON_DPS)
    assert compare(one, yesterday(), as_is=True).verdict == "adequate"
    assert compare(shifted, yesterday(), as_is=True).verdict == "adequate"
    assert compare(shifted, yesterday(turn_on_dps=0.001), as_is=True).verdict == "misfit"
    unknown = compare(shifted, yesterday(turn_on_dps=None), as_is=True)
    assert unknown.verdict == "adequate"
    assert "one power cycle" in unknown.note


def test_the_errors_of_the_file_count_too() -> None:
    """A file that knows the bias to 50 mdps does not contradict a session that is 60 mdps off."""
    model = yesterday()
    term = model.term("bias", "z")
    assert term is not None
    unsure = model.with_term(replace(term, se={"bias_dps": 0.05}))
    found = compare(today(6, bias_dps=TRUE["bias_dps"] + 0.06), unsure, as_is=True)
    assert found.verdict == "adequate"
    assert (found.pooled.excess_dps or 0) < 2 * (found.pooled.excess_se_dps or 0)


def test_a_model_without_parameters_is_refused_in_one_helpful_line() -> None:
    with pytest.raises(InputError, match="no parameters yet; give the file that `gyrocal add`"):
        api.compare(today(0, cycles=1), "default", as_is=True)


def test_the_command_prints_what_moved_and_writes_page_and_residuals(tmp_path) -> None:  # type: ignore[no-untyped-def]
    today(2, cycles=2, scale=0.006).save(tmp_path / "s")
    yesterday().save(tmp_path / "m.toml")
    call = ["compare", str(tmp_path / "s"), "--model", str(tmp_path / "m.toml"), "--as-is"]
    page, rows = tmp_path / "page.html", tmp_path / "rows.csv"
    text = CliRunner().invoke(app, [*call, "--html", str(page), "--residuals", str(rows)])
    assert text.exit_code == 0
    assert "What has moved" in text.output
    assert "The model no longer holds: on z, against rate" in text.output
    assert "What has moved" in page.read_text(encoding="utf-8")
    told = json.loads(CliRunner().invoke(app, [*call, "--json"]).output)
    assert {"effect", "axis", "name", "file", "session", "se", "z"} <= set(told["moved"][0])
    assert told["verdict"] == "misfit"
    data = np.genfromtxt(rows, delimiter=",", names=True, usecols=(1, 3, 4))
    # 1.5e-3 of 78 deg/s, of the sign of the rate
    left = (data["measured_dps"] - data["modelled_dps"]) * np.sign(data["measured_dps"])
    assert left.mean() == pytest.approx(1.5e-3 * 78, rel=0.1)


def test_movements_by_hand_hold_yesterday_s_matrix_or_tell_what_moved() -> None:
    session, _ = simulate(None, "hands", [], seed=3, scenarios=20)
    model = next(iter(calibrate(session).fits.values())).model
    same = compare_as_is(session, model)
    assert same.verdict == "adequate"
    assert same.moved is not None
    assert {m.name for m in same.moved} == {"scale", "bias_dps", "m_x", "m_y", "m_z"}
    scale = model.term("scale", "y")
    assert scale is not None
    stated = scale.values["scale"] + 0.003
    wrong = model.with_term(replace(scale, values={"scale": stated}))
    found = compare_as_is(session, wrong)
    assert found.verdict == "misfit"
    assert found.moved is not None
    assert (found.moved[0].name, found.moved[0].axis) == ("scale", "y")
    assert found.moved[0].file == stated
    assert found.moved[0].z == pytest.approx(-0.003 / (found.moved[0].se or 1), rel=0.1)
    assert (found.pooled.excess_deg or 0) > 3 * (found.pooled.excess_se_deg or 0)
    assert compare_gravity(session, wrong).verdict == "adequate"
