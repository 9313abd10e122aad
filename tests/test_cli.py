"""The command line as scripts see it: JSON keys, exit codes, one line on stderr."""

import json
from pathlib import Path

import pytest

from gyrocal.cli import command_modules, main

SIM = ["simulate", "--scenarios", "3", "--seconds", "8", "--seed", "2", "--effect", "table_ripple:amplitude_1=0.003"]
pytestmark = pytest.mark.usefixtures("known_answers")
COMPARE = {"model", "rms_dps", "floor_dps", "excess_dps", "per_axis", "verdict", "where"}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("cli") / "s"
    assert main([*SIM, str(path)]) == 0
    return str(path)


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    capsys.readouterr()
    code = main(list(words))
    out, err = capsys.readouterr()
    return code, out, err


def told(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    code, out, _ = run(capsys, *words, "--json")
    assert code == 0
    return json.loads(out)  # one object alone


def test_every_verb_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in command_modules():
        code, out, _ = run(capsys, verb, "--help")
        assert code == 0, verb
        assert "Usage" in out


def test_simulate_writes_the_truth_beside(session: str) -> None:
    truth = json.loads(Path(session + ".truth.json").read_text())
    assert truth["effects"] == ["table_ripple"]
    assert len(truth["runs"]) == 6


def test_calibrate_json(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    estimates = told(capsys, "calibrate", session, "--seconds", "4", "--method", "baseline,cnn")["estimates"]
    assert len(estimates) == 6
    assert set(estimates[0]) == {
        "scenario",
        "method",
        "seconds",
        "axis",
        "scale",
        "scale_se",
        "bias_dps",
        "bias_se_dps",
        "misfit",
        "flags",
        "trusted",
    }
    assert all(e["scale_se"] > 0 and e["bias_se_dps"] > 0 for e in estimates), "baseline and network know how sure they are"


def test_compare_json_and_files(session: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    files = [
        "--html",
        str(tmp_path / "p.html"),
        "--residuals",
        str(tmp_path / "r.csv"),
        "--pictures",
        str(tmp_path / "pictures"),
    ]
    found = told(capsys, "compare", session, *files)
    assert set(found) >= COMPARE
    assert found["verdict"] == "misfit"
    assert set(found["where"][0]) == {"axis", "against", "strength", "note", "times_rate"}
    page = (tmp_path / "p.html").read_text()
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    pictures = {p.name: p.read_bytes() for p in (tmp_path / "pictures").iterdir()}
    assert pictures.keys() == {"levels.png", "where.png", "time.png", "spectrum.png", "allan.png"}
    assert all(content.startswith(b"\x89PNG") and len(content) > 5_000 for content in pictures.values())
    assert (tmp_path / "r.csv").read_text().startswith("file,t_s,axis,measured_dps,modelled_dps\n")


@pytest.mark.wide
def test_diagnose_and_add_json(session: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    found = told(capsys, "diagnose", session)
    assert set(found) >= {"verdict", "candidates", "unknown"}
    assert found["candidates"][0]["effect"] == "table_ripple"
    both = told(capsys, "add", "table_ripple", session, "--model", str(tmp_path / "m.toml"))
    assert set(both["before"]) >= COMPARE
    assert both["after"]["excess_dps"] < both["before"]["excess_dps"]
    assert "table_ripple" in both["after"]["model"]
    assert told(capsys, "compare", session, "--model", str(tmp_path / "m.toml"))["verdict"] == "adequate"


@pytest.mark.parametrize(
    "words",
    [
        ["nothing"],
        ["compare"],
        ["compare", "/no/such/folder"],
        ["compare", "SESSION", "--model", "nothing"],
        ["calibrate", "SESSION", "--method", "guess"],
        ["calibrate", "SESSION", "--seconds", "x"],
        ["calibrate", "SESSION", "--seconds", "100"],
        ["add", "no_effect", "SESSION", "--model", "m.toml"],
        ["add", "table_ripple", "SESSION", "--model", "m.toml", "--heldout-day", "9"],
        ["simulate", "SESSION"],
        ["simulate", "new", "--effect", "table_ripple:amplitude_1=much"],
        ["simulate", "new", "--effect", "nothing"],
        ["simulate", "new", "--campaign", "nothing"],
        ["simulate", "new", "--campaign", "swing", "--seconds", "0.01"],
        ["keep", "SESSION", "--model", "default"],
        ["keep", "SESSION", "--model", "m.toml", "--name", "no name"],
        ["keep", "SESSION", "--model", "m.toml", "--file", "no/such/folder/x.py"],
    ],
)
def test_bad_usage_is_exit_2_and_one_line(
    session: str, capsys: pytest.CaptureFixture[str], words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *[session if w == "SESSION" else w for w in words])
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("gyrocal: ")
    assert list(tmp_path.iterdir()) == []  # nothing half-written


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--seconds", "100"], "too short: the longest lasts 8 s, asked for are the first 100; record longer runs"),
        (["--seconds", "1", "--method", "cnn"], "too short for the network, which takes windows of 2 s"),
    ],
)
def test_runs_that_are_too_short_are_called_so(
    session: str, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    code, _, err = run(capsys, "calibrate", session, *words)
    assert code == 2
    assert says in err


def test_baseline_without_a_pair_is_exit_2_and_model_takes_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = str(tmp_path / "full")
    assert main(["simulate", path, "--campaign", "full", "--scenarios", "1", "--seconds", "8"]) == 0
    assert run(capsys, "calibrate", path, "--method", "baseline")[0] == 2
    assert run(capsys, "calibrate", path, "--method", "cnn")[0] == 2
