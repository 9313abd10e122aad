"""Plans: laws of their power, the question that a session leaves open, and what the rig allows."""

import json
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.errors import InputError
from gyrocal.planning.plan import Plan, plan
from gyrocal.planning.question import ask, check_one_question
from gyrocal.planning.rig import Rig
from gyrocal.recording.plan_file import PlannedRuns
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

from .conftest import EFFECT

PAIR = ("bias_temperature", "drift")


def seconds_of(found: Plan) -> float:
    return sum(run.seconds for run in found.runs)


@pytest.mark.wide
def test_the_question_is_the_one_that_the_session_leaves_open(of_four_minutes: Plan, diagnosis: Diagnosis) -> None:
    assert diagnosis.best is not None
    found = of_four_minutes
    assert found.question.kind == "tell_apart"
    assert found.question.effects == diagnosis.best.group
    assert found.question.axis == "z"
    assert "cannot tell" in found.question.why


@pytest.mark.wide
@pytest.mark.usefixtures("diagnosed_once")
def test_power_grows_with_the_minutes_towards_one_and_never_falls_below_the_same_again(
    ambiguous: Session, of_four_minutes: Plan
) -> None:
    found = [of_four_minutes, *(plan(ambiguous, minutes=minutes) for minutes in (10.0, 40.0))]
    powers = [p.power for p in found]
    assert powers == sorted(powers)
    assert powers[0] < 0.9
    assert powers[-1] > 0.97
    for p, minutes in zip(found, (4.0, 10.0, 40.0), strict=True):
        assert p.power >= p.power_same_again
        assert seconds_of(p) <= 60 * minutes + 1e-6
        assert p.minutes == pytest.approx(seconds_of(p) / 60, abs=1e-3)
    assert [p.power_same_again for p in found] == sorted(p.power_same_again for p in found)


@pytest.mark.usefixtures("diagnosed_once")
def test_a_question_is_symmetric(ambiguous: Session) -> None:
    one, other = (plan(ambiguous, between=pair, minutes=4.0) for pair in (PAIR, PAIR[::-1]))
    assert one.power == pytest.approx(other.power, abs=1e-3)
    assert one.power_same_again == pytest.approx(other.power_same_again, abs=1e-6)


@pytest.mark.usefixtures("diagnosed_once")
def test_a_chamber_separates_temperature_from_what_goes_with_time(ambiguous: Session, of_four_minutes: Plan) -> None:
    without = of_four_minutes
    chamber = plan(ambiguous, minutes=4.0, chamber_c=(5.0, 45.0))
    assert chamber.power > without.power + 0.2
    assert {run.temp_c for run in without.runs} == {None}
    assert {run.temp_c for run in chamber.runs} & {5.0, 45.0}
    assert "--chamber" in without.advice


@pytest.mark.usefixtures("diagnosed_once")
def test_what_no_run_of_the_rig_shows_has_no_power(ambiguous: Session) -> None:
    """The centripetal term of one rate is a bias, and a table that stands still shows none."""
    found = plan(ambiguous, measure="centripetal", minutes=10.0, table_dps=0.0)
    assert found.power == found.power_same_again < 0.05
    assert {run.table_rate_dps for run in plan(ambiguous, measure="centripetal", minutes=10.0).runs} != {0.0}


@pytest.mark.usefixtures("diagnosed_once")
def test_the_shortest_good_plan_is_taken_without_minutes(ambiguous: Session) -> None:
    found = plan(ambiguous, chamber_c=(5.0, 45.0))
    assert found.power >= 0.9
    assert found.minutes <= 20.0
    assert found.advice == ""


@pytest.mark.wide
@pytest.mark.usefixtures("diagnosed_once")
def test_runs_are_of_new_power_cycles_and_of_the_rig(ambiguous: Session) -> None:
    found = plan(ambiguous, minutes=6.0, table_dps=30.0)
    assert {run.table_rate_dps for run in found.runs} <= {0.0, 15.0, -15.0, 30.0, -30.0}
    assert {run.axis for run in found.runs} == {"z"}
    assert not {run.scenario for run in found.runs} & set(ambiguous.scenarios)
    assert found.day == max(ambiguous.days) + 1


def test_an_adequate_session_is_asked_for_what_it_knows_worst() -> None:
    session, _ = simulate(None, "paper", seed=1, scenarios=4, seconds=20.0)
    found = plan(session, minutes=4.0)
    assert found.question.kind == "measure"
    assert found.power >= found.power_same_again


def test_what_cannot_be_asked_says_why(diagnosis: Diagnosis) -> None:
    with pytest.raises(InputError, match="two different effects"):
        check_one_question(("drift", "drift"), None)
    with pytest.raises(InputError, match="give one of them"):
        check_one_question(PAIR, "drift")
    with pytest.raises(InputError, match="is in the model"):
        ask(diagnosis, ("scale", "drift"))
    with pytest.raises(InputError, match="single readings"):
        ask(diagnosis, measure="byte_fault")
    with pytest.raises(InputError, match="no effect"):
        ask(diagnosis, measure="drfit")


def test_a_rig_needs_a_table(ambiguous: Session) -> None:
    swing, _ = simulate(None, "swing", seed=1, scenarios=1, seconds=5.0)
    with pytest.raises(InputError, match="constant rates"):
        Rig.of(swing)
    with pytest.raises(InputError, match="--chamber"):
        Rig.of(ambiguous, chamber_c=(40.0, 10.0))
    with pytest.raises(InputError, match="--table"):
        Rig.of(ambiguous, table_dps=-3.0)


@pytest.fixture
def folder(ambiguous: Session, tmp_path: Path) -> Path:
    ambiguous.save(tmp_path / "session")
    return tmp_path / "session"


@pytest.mark.usefixtures("diagnosed_once")
def test_the_command_has_the_pinned_keys_and_writes_the_plan(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder.parent / "plan.toml"
    assert main(["plan", str(folder), "--minutes", "4", "--chamber", "5:45", "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert {"question", "runs", "minutes", "power", "power_same_again"} <= said.keys()
    assert said["question"].keys() == {"kind", "effects", "axis"}
    for run in said["runs"]:
        assert run.keys() == {"axis", "face", "table_rate_dps", "seconds", "temp_c", "scenario"}
    written = PlannedRuns.open(out)
    assert [vars(run) for run in written.runs] == said["runs"]
    assert main(["plan", str(folder), "--minutes", "4"]) == 0
    text = capsys.readouterr().out
    assert "probability" in text
    assert "cannot tell" in text


@pytest.mark.parametrize("options", [["--chamber", "warm"], ["--minutes", "0"], ["--between", "drift"]])
@pytest.mark.usefixtures("diagnosed_once")
def test_wrong_options_are_refused(options: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(folder), *options]) == 2
    assert options[0] in capsys.readouterr().err


def test_simulate_carries_a_plan_out_to_the_letter(folder: Path, ambiguous: Session) -> None:
    file, out = folder.parent / "plan.toml", folder.parent / "more"
    file.write_text(
        'format = "gyrocal-plan/1"\nday = 7\n'
        '[[run]]\naxis = "z"\nface = "down"\ntable_rate_dps = -39.0\nseconds = 12.5\ntemp_c = 40.0\nscenario = "s004"\n'
        '[[run]]\naxis = "z"\nface = "up"\ntable_rate_dps = 0.0\nseconds = 8.0\nscenario = "s004"\n'
        '[[run]]\naxis = "z"\nface = "up"\ntable_rate_dps = 78.0\nseconds = 5.0\nscenario = "s005"\n'
    )
    assert main(["simulate", str(out), "--plan", str(file), "--effect", EFFECT, "--seed", "4", "--add-to", str(folder)]) == 0
    session = Session.open(out)
    assert len(session.runs) == len(ambiguous.runs) + 3
    new = session.runs[-3:]
    planned = PlannedRuns.open(file)
    for run, wanted in zip(new, planned.runs, strict=True):
        assert (run.axis, run.face, run.scenario) == (wanted.axis, wanted.face, wanted.scenario)
        assert run.table_rate_dps == wanted.table_rate_dps
        assert run.duration_s == pytest.approx(wanted.seconds, abs=0.01)
        assert run.day == 7
    assert new[0].temp_c is not None
    assert np.all((new[0].temp_c > 39.5) & (new[0].temp_c < 44.5)), "the chamber's air and the part's own heat"
    assert new[1].power_on_s > new[0].power_on_s + 12.5
    assert new[2].power_on_s < new[1].power_on_s
    assert planned.missing_in(session.runs) == []
    assert planned.missing_in(session.runs[:-1]) == [planned.runs[2]]
    truth, more = (json.loads(Path(f"{p}.truth.json").read_text()) for p in (_truth(folder), out))
    assert more["runs"][0]["scale"] == truth["runs"][0]["scale"], "the same part"


def _truth(folder: Path) -> Path:
    """The same session simulated again, with its truth beside it."""
    again = folder.parent / "again"
    simulate(again, "paper", [EFFECT], seed=4, scenarios=4, seconds=40.0)
    return again


def test_a_wrong_plan_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "plan.toml"
    run = '[[run]]\naxis = "z"\nface = "up"\ntable_rate_dps = 0.0\nseconds = 8.0\nscenario = "{}"\n'
    for text, why in (
        ('format = "x"\n', "format is 'x'"),
        ('format = "gyrocal-plan/1"\nrun = []\n', "run"),
        ('format = "gyrocal-plan/1"\n' + run.format("a") + run.format("b") + run.format("a"), "scenario a begins again"),
        ('format = "gyrocal-plan/1"\n' + run.format("a").replace("8.0", "-1.0"), "seconds"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=why):
            PlannedRuns.open(file)
    with pytest.raises(InputError, match="gyrocal plan"):
        PlannedRuns.open(tmp_path / "none.toml")
