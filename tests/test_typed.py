"""The command line as people type it: -o, -q, -v and --json everywhere, a model that is kept only where it is asked for."""

import json
import time
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from gyrocal.cli import command_modules, main

pytestmark = pytest.mark.usefixtures("known_answers")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("typed") / "s"
    words = ["--scenarios", "3", "--seconds", "6", "--effect", "table_ripple:amplitude_1=0.003"]
    assert main(["simulate", "-o", str(path), *words]) == 0
    return str(path)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_quiet_prints_errors_and_json_alone(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["calibrate", session, "--method", "baseline", "--seconds", "4"]
    assert main(["-q", *words]) == 0
    assert capsys.readouterr() == ("", "")
    assert main([*words, "--quiet", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["estimates"]
    assert err == ""
    assert main(["-q", "compare", "none"]) == 2
    assert capsys.readouterr().err.startswith("gyrocal: none")


def test_verbose_says_each_step_on_stderr(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", session, "-v", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["verdict"]
    assert err.startswith("[   0.00 s] gyrocal ")
    assert main(["compare", session, "--json"]) == 0
    assert capsys.readouterr().err == "", "it says nothing of the call before"


def test_out_may_be_an_option(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", session, "-o", "s.png"]) == 0
    assert main(["plot", "--out", "s.svg", session]) == 0
    assert {p.name for p in tmp_path.iterdir()} == {"s.png", "s.svg"}
    assert main(["plot", session, "-o"]) == 2
    assert "gyrocal plot --help" in capsys.readouterr().err


@pytest.mark.wide
def test_explain_and_add_keep_a_model_only_where_it_is_asked_for(
    session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", session]) == 0
    assert "not kept (-o model.toml keeps it): scale, bias" in capsys.readouterr().out
    assert main(["add", "table_ripple", session, "--axis", "z"]) == 0
    assert "not kept (-o model.toml keeps it): scale, bias" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []
    assert main(["add", "table_ripple", session, "--axis", "x", "--model", "m.toml"]) == 2
    assert "--axis x: the effect can be added on z" in capsys.readouterr().err
    assert main(["add", "turn_on_bias", session, "--model", "m.toml"]) == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("measured_adds")
def test_out_leaves_the_model_that_is_started_from(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", session, "-o", "first.toml"]) == 0
    first = Path("first.toml").read_text()
    assert "table_ripple" in first
    assert main(["add", session, "misalignment", "--axis", "y", "--model", "first.toml", "-o", "second.toml"]) == 0
    assert "second.toml: scale, bias" in capsys.readouterr().out
    assert Path("first.toml").read_text() == first
    assert "misalignment" in Path("second.toml").read_text()
    assert main(["add", session, "table_ripple", "--model", "paper", "-o", "third.toml"]) == 0
    assert "colored_noise" not in Path("third.toml").read_text()
    for words in (["--model", "paper"], ["-o", "default"], ["--model", "none.toml", "-o", "fourth.toml"]):
        assert main(["explain", session, *words]) == 2
    assert "none.toml: no such model" in capsys.readouterr().err
    assert {p.name for p in tmp_path.iterdir()} == {"first.toml", "second.toml", "third.toml"}


def test_compare_of_an_axis_alone(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def asked(*words: str) -> Any:
        capsys.readouterr()
        assert main(["compare", session, "--json", *words]) == 0
        return json.loads(capsys.readouterr().out)

    whole, x, z = asked(), asked("--axis", "x"), asked("--axis", "z", "--residuals", "r.csv")
    assert (whole["verdict"], x["verdict"], z["verdict"]) == ("misfit", "adequate", "misfit")
    for one, axis in ((x, "x"), (z, "z")):
        assert one["per_axis"] == {axis: whole["per_axis"][axis]}
        assert one["excess_dps"] == whole["per_axis"][axis]["excess_dps"]
        assert one["where"] == [f for f in whole["where"] if f["axis"] == axis]
        assert one["parameters"] == [p for p in whole["parameters"] if p["axis"] == axis]
    assert {line.split(",")[2] for line in Path("r.csv").read_text().splitlines()[1:]} == {"z"}
    assert main(["compare", session, "--axis", "z"]) == 0
    assert "all" not in capsys.readouterr().out.split("model:")[0]
    assert main(["compare", session, "--axis", "q"]) == 2
    assert "--axis q: want x, y or z" in capsys.readouterr().err


def test_diagnose_of_an_axis_alone(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    def asked(*words: str) -> Any:
        capsys.readouterr()
        assert main(["diagnose", session, "--json", *words]) == 0
        return json.loads(capsys.readouterr().out)

    whole, x, z = asked(), asked("--axis", "x"), asked("--axis", "z")
    assert (whole["verdict"], x["verdict"], z["verdict"]) == ("add", "adequate", "add")
    for one, axis in ((x, "x"), (z, "z")):
        assert one["candidates"] == [c for c in whole["candidates"] if c["axis"] == axis]
        assert {a["axis"] for a in one["alternatives"]} <= {axis}
    assert main(["diagnose", session, "--axis", "x"]) == 0
    assert "Nothing found of" in capsys.readouterr().out


def test_compare_of_an_axis_by_hand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "held", "--campaign", "hands", "--scenarios", "16"]) == 0
    capsys.readouterr()
    assert main(["compare", "held", "--axis", "y", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["per_axis"]) == ["y"]
    assert found["excess_deg"] == found["per_axis"]["y"]["excess_deg"]
    assert {p["axis"] for p in found["parameters"]} == {"y"}
    assert main(["diagnose", "held", "--axis", "y", "--json"]) == 0
    assert {c["axis"] for c in json.loads(capsys.readouterr().out)["candidates"]} == {"y"}


def test_whole_runs_are_asked_for_by_all(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    def asked(seconds: str) -> Any:
        capsys.readouterr()
        assert main(["calibrate", session, "--method", "baseline,model", "--seconds", seconds, "--json"]) == 0
        return json.loads(capsys.readouterr().out)["estimates"]

    found = asked("2,all")
    assert {round(e["seconds"], 3) for e in found} == {2.0, 6.0}
    assert [e for e in found if e["seconds"] == 2.0] == asked("2")
    assert {e["method"] for e in found if e["seconds"] > 2.0} == {"baseline", "model"}
    assert main(["calibrate", session, "--seconds", "9"]) == 2
    assert "asked for are the first 9; record longer runs, ask for less, or for --seconds all" in capsys.readouterr().err


def test_an_axis_alone(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", session, "--method", "baseline", "--axis", "z", "--json"]) == 0
    assert {e["axis"] for e in json.loads(capsys.readouterr().out)["estimates"]} == {"z"}
    assert main(["calibrate", session, "--axis", "w"]) == 2
    assert "--axis w: want x, y or z" in capsys.readouterr().err


def test_every_verb_has_json(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in command_modules():
        assert main([verb, "--help"]) == 0
        assert ("--json" in capsys.readouterr().out) is (verb != "workbench"), f"{verb}; workbench is a page"


def test_small_verbs_answer_in_json(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words, keys in (
        (["version"], {"gyrocal", "python", "system", "answers"}), (["plot", session, "s.png"], {"file"}),
        (["simulate", "new", "--scenarios", "1", "--seconds", "4"], {"session", "truth", "effects", "runs"}),
        (["firmware", "project"], {"folder", "kind"}),
    ):  # fmt: skip
        capsys.readouterr()
        assert main([*words, "--json"]) == 0, words
        assert set(json.loads(capsys.readouterr().out)) == keys


def test_record_waits_for_a_port_that_is_not_there_yet(session: str, tmp_path: Path) -> None:
    from gyrocal.device.simulated import SimulatedDevice
    from gyrocal.recording.session import Session

    link = tmp_path / "port"
    assert main(["record", "out", "--port", str(link), "--follow"]) == 3
    def plug_in() -> None:
        time.sleep(1.0)
        with SimulatedDevice([Session.open(session)], "max", symlink=link) as device:
            device.wait()

    later = Thread(target=plug_in, daemon=True)
    later.start()
    assert main(["record", "out", "--port", str(link), "--follow", "--wait"]) == 0
    later.join(10)
    assert len(Session.open("out").runs) == 6


def test_a_session_at_one_rate_is_told_that_it_has_no_scale(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import numpy as np
    import polars as pl

    from gyrocal.recording.session import Session

    rng = np.random.default_rng(1)
    rates = {"gx_dps": 0.2, "gy_dps": -0.1, "gz_dps": 61.5}
    frames = [
        pl.DataFrame({"t_s": np.arange(1500) / 100, **{n: m + rng.normal(0, 0.06, 1500) for n, m in rates.items()}})
        for _ in range(2)
    ]
    Session.from_frames(frames, [{"face": "up", "table_rate_dps": 60.0}] * 2, sample_rate_hz=100.0).save(tmp_path / "lab")
    assert main(["explain", "lab"]) == 0
    assert "No scale on z: all runs turn at one rate" in capsys.readouterr().out
