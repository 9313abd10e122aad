"""Sessions by gravity compared, diagnosed and explained: planted effects are named, and nothing is named where nothing is."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import polars as pl
import pytest

from by_hand import turned_by
from gyrocal.cli import main
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.effects.base import Effect, effect
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.gravity.compare import compare, measure, residual_table
from gyrocal.gravity.diagnose import add, diagnose, explain
from gyrocal.gravity.evidence import Evidence
from gyrocal.gravity.fit import full
from gyrocal.gravity.naming import _decided, candidates
from gyrocal.gravity.scene import Scene
from gyrocal.simulation.simulate import simulate

pytestmark = pytest.mark.usefixtures("known_answers")

TURNS = [(axis, sign * 90.0) for axis in "xyz" for sign in (1, -1)] * 2


def test_explain_finds_the_whole_matrix_and_what_is_left_is_noise() -> None:
    session, truth = simulate(campaign="hands", seed=2, scenarios=20)
    found = explain(session)
    assert found.verdict == "adequate"
    assert {e for step in found.steps for e in step.effects} == {"misalignment"}
    for i, axis in enumerate("xyz"):
        term = found.model.term("misalignment", axis)
        assert term is not None
        for j, other in enumerate("xyz"):
            if j != i:
                assert term.values[f"m_{other}"] == pytest.approx(truth["misalignment"][i][j], abs=5 * term.se[f"m_{other}"])
    before, after = found.steps[0].before.pooled.excess_deg, found.steps[-1].after.pooled.excess_deg
    assert before is not None
    assert after is not None
    assert after < 0.1 * before


def test_an_asymmetry_is_named_beside_the_matrix() -> None:
    session, _ = simulate(campaign="hands", seed=2, scenarios=20, effects=["scale_asymmetry:k=0.003"])
    named = [c for c in diagnose(session, full(Model.open(None))).candidates if c.decision == "add"]
    assert {c.effect.id for c in named} == {"scale_asymmetry"}
    for c in named:
        assert c.values["k"] == pytest.approx(0.003, abs=5 * c.se["k"])


def test_sensitivity_to_gravity_is_found_at_the_rests() -> None:
    session, _ = simulate(
        campaign="hands", seed=3, scenarios=20, effects=["g_sensitivity:gx_dps_per_g=0.05,gy_dps_per_g=0,gz_dps_per_g=0"]
    )
    found = diagnose(session, full(Model.open(None)))
    named = [c for c in found.candidates if c.decision == "add"]
    assert {c.effect.id for c in named} == {"g_sensitivity"}
    for c in named:
        assert c.values["gx_dps_per_g"] == pytest.approx(0.05, abs=5 * c.se["gx_dps_per_g"])


def test_a_complete_model_is_adequate_for_compare_and_diagnose() -> None:
    session, _ = simulate(campaign="hands", seed=11, scenarios=20)
    model = full(Model.open(None))
    compared, found = compare(session, model), diagnose(session, model)
    assert compared.verdict == found.verdict == "adequate"
    assert found.to_json()["alternatives"] == []  # sets of effects are weighed for rates alone
    assert compared.pooled.rms_deg == pytest.approx(compared.pooled.floor_deg, rel=0.25)


def test_without_misalignment_the_model_does_not_fit_and_the_residuals_say_where() -> None:
    session, _ = simulate(campaign="hands", seed=1, scenarios=20)
    found = compare(session)
    assert found.verdict == "misfit"
    assert {w.against for w in found.where} >= {"rate"}
    table = residual_table(found)
    assert table.columns[:5] == ["file", "t_s", "axis", "measured_deg", "modelled_deg"]
    assert table.height == len(found.fit.scene.movements)
    assert float(np.sqrt((table["residual_deg"] ** 2).mean())) == pytest.approx(found.pooled.rms_deg, rel=1e-6)
    assert (np.abs(table["measured_deg"] - table["modelled_deg"]) <= table["residual_deg"] + 2e-3).all()


def test_adding_an_effect_writes_a_model_that_every_verb_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulate(tmp_path / "s", "hands", seed=4, scenarios=16)
    folder, model = str(tmp_path / "s"), str(tmp_path / "m.toml")
    assert main(["add", "misalignment", folder, "--model", model, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["after"]["excess_deg"] < 0.5 * told["before"]["excess_deg"]
    assert "rms_dps" not in told["after"]
    assert main(["compare", folder, "--model", model, "--residuals", str(tmp_path / "r.csv"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["residual"] == "angle"
    assert {"rms_deg", "floor_deg", "excess_deg", "per_axis", "where", "parameters", "warnings", "verdict"} <= told.keys()
    assert pl.read_csv(tmp_path / "r.csv").height == 15
    assert main(["calibrate", folder, "--model", model, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["estimates"][0]["trusted"]
    assert main(["diagnose", folder, "--model", model, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    unseen = {c["effect"]: c for c in told["candidates"] if c["decision"] == "not_measurable"}
    assert {"lag", "clock_error", "table_ripple", "vibration_tone"} <= unseen.keys()
    assert all(c["next_measurement"] for c in unseen.values())


def test_a_missing_effect_is_told_with_all_of_its_axes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulate(tmp_path / "s", campaign="hands", seed=2, scenarios=20)
    assert main(["diagnose", str(tmp_path / "s"), "--json"]) == 0
    named = [c["axis"] for c in json.loads(capsys.readouterr().out)["candidates"] if c["decision"] == "add"]
    assert len(named) > 1
    assert main(["diagnose", str(tmp_path / "s")]) == 0
    assert f"Missing: misalignment of the axes on {', '.join(sorted(named))}." in capsys.readouterr().out


@pytest.mark.wide
def test_explain_says_which_model_it_wrote_where_nothing_was_to_be_added(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session, model = tmp_path / "s", tmp_path / "m.toml"
    simulate(session, campaign="hands", seed=2, scenarios=20)
    for _ in range(2):
        assert main(["explain", str(session), "--model", str(model)]) == 0
        told = capsys.readouterr().out
        assert f"{model}: scale, bias" in told.replace("\n", "")
    assert "Effects added" not in told, "the second time"


def test_an_effect_that_gravity_does_not_show_is_not_added() -> None:
    session, _ = simulate(campaign="hands", seed=4, scenarios=8)
    before, after = add(session, None, "table_ripple")
    assert "table_ripple was not added" in before.note
    assert after.fit.model.ids == before.fit.model.ids
    with pytest.raises(InputError, match="scale: the model has it already"):
        add(session, None, "scale")


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_too_few_rests_end_with_2(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulate(tmp_path / "s", "hands", scenarios=3)
    assert main([verb, str(tmp_path / "s")]) == 2
    assert "3 rests found" in capsys.readouterr().err


@pytest.mark.parametrize(("gain", "decision"), [(10.0, "suggest"), (12.0, "add")])
def test_a_name_must_gain_as_much_as_one_that_the_evidence_of_sets_alone_gives(gain: float, decision: str) -> None:
    """Beside a supply that sags, an asymmetry gained 5 ± 2.5 at a chance that noise hardly has."""

    class Columns:
        def columns(self, _: Any) -> np.ndarray[Any, Any]:
            return np.ones(3)

    seen = Candidate(effect("scale_asymmetry"), "y", "reject", chance=1e-9, q_value=1e-6, gain=gain, gain_se=1.0, enough=True)
    (found,) = _decided([seen], cast(Any, Columns()))
    assert found.decision == decision


@pytest.mark.parametrize(("leak", "decision"), [(0.05, "suggest"), (-1.61, "reject")])
def test_an_effect_larger_than_any_sensor_has_it_is_not_suggested(
    leak: float, decision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Movements that hardly turn gravity leave a misalignment as unsure as this."""

    def judge(_: Evidence, effect: Effect, axis: str) -> Candidate:
        if (effect.id, axis) != ("misalignment", "y"):
            return Candidate(effect, axis, "not_measurable")
        return Candidate(effect, axis, "reject", {"m_x": leak}, {"m_x": 0.02}, chance=1e-6, q_value=1e-5, gain=3.0, gain_se=2.0)

    monkeypatch.setattr(Evidence, "judge", judge)
    (found,) = (c for c in candidates(measure(turned_by(TURNS)).evidence) if c.decision != "not_measurable")
    assert found.decision == decision


def test_the_floor_of_two_power_cycles_is_that_of_their_noise() -> None:
    """The rests of a cycle tell its offset, so that its spread, which two cycles hardly tell, is not in the floor."""
    measured, expected = [], []
    for seed in (1, 2, 4):
        session, _ = simulate(campaign="hands", seed=seed, scenarios=40)
        run, moved = session.runs[0], Scene.of(session).movements
        middle = (moved[19].stop + moved[20].start) // 2
        offset = (pl.col(f"g{axis}_dps") + 0.005 for axis in "xyz")
        second = run.table[middle:].with_columns(pl.col("t_s") - run.table["t_s"][middle], *offset)
        two = [replace(run, frame=run.table[:middle]), replace(run, file="001.csv", scenario="s001", frame=second)]
        found = measure(session.with_runs(two), full(Model.open(None)))
        measured += [level.rms_deg or 0.0 for level in found.per_axis.values()]
        expected += [level.floor_deg or 0.0 for level in found.per_axis.values()]
    assert float(np.sum(np.square(expected)) / np.sum(np.square(measured))) == pytest.approx(1.0, abs=0.3)
