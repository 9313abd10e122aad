"""Any tool is graded on the benchmarks' cases: one function, whose answers are held against what was planted."""

import importlib
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from answers import check
from edge.drawn import Draw
from gyrocal import benchmark
from gyrocal.cli import main

TOOLS = Path(__file__).resolve().parents[1] / "benchmarks" / "tools"


@pytest.fixture(scope="module")
def any_tool() -> Any:
    return benchmark._tools()


def graded(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    assert main(["benchmark", *words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    check("benchmark", found)
    return found


def tool(folder: Path, text: str) -> str:
    (folder / "tool.py").write_text(text)
    return str(folder / "tool.py")


def test_a_correction_is_held_against_the_planted_error(any_tool: Any) -> None:
    random, n = np.random.default_rng(1), 500
    rates = np.column_stack([np.zeros(n), np.zeros(n), np.repeat([30.0, -30.0, 60.0, -60.0, 0.0], n // 5)])
    added, noise = 1e-3 * rates**2, random.normal(0.0, 0.05, (n, 3))
    readings = 1.01 * rates + 0.3 + added + noise
    runs = [any_tool.Reading("a", 1, readings, rates, added)]
    cases = {"all": readings - added, "nothing": readings, "half": readings - added / 2}
    left = {name: any_tool.left_over(any_tool.Told(corrected={"a": r}), runs) for name, r in cases.items()}
    assert left == pytest.approx({"all": 0.0, "nothing": 1.0, "half": 0.5}, abs=1e-9)
    assert any_tool.left_over(any_tool.Told(), runs) is None


@pytest.mark.wide
def test_names_sizes_and_failures_are_counted_on_the_edge_cases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both tools are given the same cases, each drawn once."""
    monkeypatch.setattr(Draw, "case", cache(Draw.case))
    names = "def answer(session):\n    return {'names': [['bias_jumps', 'x'], ['bias_jumps', 'y']], 'sizes': {'nothing': 1}}\n"
    found = graded(capsys, "edge", "--tool", tool(tmp_path, names), "--stop", "3")
    assert (found["cases"], found["failed"], found["names"]["sure"]) == (3, [], 6)
    assert found["names"]["wrong"] >= 3
    broken = graded(capsys, "edge", "--tool", tool(tmp_path, "def answer(session):\n    return 1 / 0\n"), "--stop", "2")
    assert [one["error"] for one in broken["failed"]] == ["ZeroDivisionError: division by zero"] * 2
    assert broken["names"]["cases"] == 0


@pytest.mark.wide
def test_who_knows_what_was_planted_has_no_error(
    any_tool: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A generator that tells the answer: the figures of a perfect tool on the blind cases."""
    known: dict[str, Any] = {}
    session = importlib.import_module("blind.generator.session")
    made = session.make

    def telling(case: Any, folder: Path) -> Any:
        truth = made(case, folder)
        known.update(case=case, runs=truth.runs)
        return truth

    def answer(folder: Path) -> Any:
        case, opened = known["case"], any_tool.Session.open(folder)
        ids = [e.id for e in case.effects if any_tool.of_sensor(e.id)]
        added = {run.file: sum(run.injected_dps[i] for i in ids) if ids else 0.0 for run in known["runs"]}
        corrected = {Path(run.file).stem: run.gyro_dps - np.transpose(added[run.file]) for run in opened.runs}
        names = [(e.id, e.axes[0]) for e in case.effects if e.id in case.expected and case.kind in ("effect", "pair")]
        return any_tool.Told(tuple(names), any_tool.planted_sizes(case.effects), corrected)

    monkeypatch.setattr(session, "make", telling)
    monkeypatch.setattr(any_tool, "loaded", lambda file: answer)
    found = graded(capsys, "blind", "--tool", tool(tmp_path, ""), "--limit", "2")
    assert (found["false_alarm_rate"], found["top1_rate"], found["misnamed_rate"], found["completed_rate"]) == (0, 1, 0, 1)
    assert found["sizes"]["stated"] > 0
    assert found["sizes"]["median_off"] == 0
    assert found["corrected"]["cases"] > 0
    assert found["corrected"]["median_of_before"] == pytest.approx(0.0, abs=1e-9)


def test_least_squares_is_graded_on_the_papers_windows(capsys: pytest.CaptureFixture[str]) -> None:
    found = graded(capsys, "paper", "--tool", str(TOOLS / "least_squares.py"), "--sample")
    assert found["cases"] == 18
    assert all(line["scale_over_limit"] > 1 and line["bias_over_limit"] > 0.5 for line in found["table2"])
    assert main(["benchmark", "paper", "--tool", str(TOOLS / "least_squares.py"), "--sample"]) == 0
    assert "over the limit's, 6 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["edge", "--tool", "none.py"], "--tool none.py: no Python file"),
        (["edge", "--tool", "empty.py"], "it has no function answer(session)"),
        (["population", "--tool", "empty.py"], "--tool goes with edge, blind, paper, strangers"),
        (["paper", "--tool", "empty.py", "--stop", "3"], "has no part stop"),
    ],
)
def test_a_slip_is_one_line(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.py").write_text("")
    assert main(["benchmark", *words]) == 2
    out, told = capsys.readouterr()
    assert (out, told.count("\n")) == ("", 1)
    assert says in told


@pytest.mark.parametrize(
    "file",
    [pytest.param(f, marks=[pytest.mark.wide] * (f.stem == "gyrocal_explain")) for f in sorted(TOOLS.glob("*.py"))],
    ids=lambda file: file.stem,
)
def test_the_examples_answer(file: Path, tmp_path: Path, any_tool: Any, require_module: Any) -> None:
    if file.stem == "lasso":
        require_module("sklearn")
    words = ["--campaign", "full", "--scenarios", "1", "--seconds", "6", "--seed", "2"]
    assert main(["simulate", str(tmp_path / "s"), *words]) == 0
    told = any_tool.loaded(file)(tmp_path / "s")
    assert told.error is None


@pytest.mark.wide
def test_scale_and_bias_are_held_against_a_strangers_reference(
    any_tool: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recording as EuRoC writes it, with an orientation beside it, and one that is absent."""
    truth = importlib.import_module("benchmarks.strangers_truth")
    folder = tmp_path / "who" / "what" / "rec" / "mav0"
    for name in ("imu0", "gt0"):
        (folder / name).mkdir(parents=True)
    t_s = np.arange(6000) / 100
    rates = 60 * np.column_stack([np.sin(0.7 * t_s), np.sin(0.9 * t_s + 1), np.sin(1.1 * t_s + 2)])
    turned = Rotation.identity()
    quaternions = []
    for rate in rates:
        quaternions.append(np.roll(turned.as_quat(), 1))
        turned = turned * Rotation.from_rotvec(np.radians(rate) / 100)
    stamps = (1_400_000_000_000_000_000 + np.round(t_s * 1e9)).astype(np.int64)
    noise = np.random.default_rng(4).normal(0.0, 0.05, rates.shape)
    scale, bias_dps = np.array([1.02, 0.99, 1.01]), [0.3, -0.4, 0.2]
    readings = rates * scale + bias_dps + noise
    imu = [f"{s},{','.join(f'{v:.9f}' for v in np.radians(row))},0,0,9.81" for s, row in zip(stamps, readings, strict=True)]
    head = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1]"
    accelerations = ",".join(f"a_RS_S_{a} [m s^-2]" for a in "xyz")
    (folder / "imu0" / "data.csv").write_text("\n".join([f"{head},{accelerations}", *imu, ""]))
    seen = [f"{s},0,0,0,{','.join(f'{v:.9f}' for v in q)}" for s, q in zip(stamps, quaternions, strict=True)]
    named = "#timestamp,p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []"
    (folder / "gt0" / "data.csv").write_text("\n".join([named, *seen, ""]))
    monkeypatch.setattr(truth, "STRANGERS", tmp_path)
    made = truth.Recording(
        "made", {"name": "who/what"}, "rec/mav0/imu0/data.csv", (1e-9, np.degrees(1)), at=(0, 1, 2, 3), skip=1, acc=(4, 5, 6),
        reference="rec/mav0/gt0/data.csv",
    )  # fmt: skip
    gone = truth.Recording("made", {"name": "who/what"}, "rec/mav0/none/data.csv", reference="rec/mav0/gt0/data.csv")
    monkeypatch.setattr(truth, "recordings", lambda: [made, gone])
    found = graded(capsys, "strangers", "--tool", str(TOOLS / "gyrocal_explain.py"))
    assert (found["cases"], found["failed"], found["absent"]) == (1, [], [gone.name])
    assert (found["true"], found["of"]) == (6, 6)
