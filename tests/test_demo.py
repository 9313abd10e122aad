"""The demo's JSON, as a script reads it: its pinned keys alone show that the device's error fell. Its words give the same."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal import demo
from gyrocal.calibration.calibrate import Estimate
from gyrocal.cli import main
from gyrocal.demo import Answers, Story, errors
from gyrocal.present.output import stdout

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def told_twice(tmp_path_factory: pytest.TempPathFactory, require_tool: Callable[[str], str]) -> tuple[dict, Path, Story]:
    require_tool("cc")
    folder = tmp_path_factory.mktemp("demo") / "out"
    capture = folder.with_name("story.json")
    stories = []
    whole = demo.demo
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("builtins.print", lambda text="", **_: capture.write_text(str(text)))
        patch.setattr(demo, "demo", lambda *given: stories.append(whole(*given)) or stories[-1])
        assert main(["demo", "--out", str(folder), "--json"]) == 0
    return json.loads(capture.read_text()), folder, stories[0]


@pytest.fixture(scope="module")
def told(told_twice: tuple[dict, Path, Story]) -> tuple[dict, Path]:
    return told_twice[:2]


def mean_error(story: dict, part: str, method: str, seconds: float) -> tuple[float, float]:
    truth = story["truth"]
    mine = [e for e in story[part]["estimates"] if e["method"] == method and e["seconds"] == seconds]
    assert len(mine) > 10
    scale = np.mean([abs(e["scale"] - truth["scale"]) for e in mine])
    return float(scale), float(np.mean([abs(e["bias_dps"] - truth["bias_dps"]) for e in mine]))


@pytest.mark.parametrize("seconds", [2.0, 4.0, 6.0])
def test_the_device_s_error_falls(told: tuple[dict, Path], seconds: float) -> None:
    story, _ = told
    before, after = mean_error(story, "before", "baseline", seconds), mean_error(story, "after", "model", seconds)
    assert after[0] < 0.5 * before[0]
    assert after[1] < 0.5 * before[1]


def test_the_hidden_effect_is_named_and_its_excess_falls(told: tuple[dict, Path]) -> None:
    story, _ = told
    assert story["diagnosis"]["verdict"] == "add"
    assert story["diagnosis"]["candidates"][0]["effect"] == "table_ripple"
    assert story["before"]["compare"]["verdict"] == "misfit"
    assert story["after"]["compare"]["excess_dps"] < 0.5 * story["before"]["compare"]["excess_dps"]
    assert story["before"]["compare"]["floor_dps"] == story["after"]["compare"]["floor_dps"]


@pytest.mark.parametrize("part", ["before", "after"])
def test_answers_without_the_ripple_are_not_trusted_and_those_with_it_are(told: tuple[dict, Path], part: str) -> None:
    story, _ = told
    trusted = {m: [e["trusted"] for e in story[part]["estimates"] if e["method"] == m] for m in ("baseline", "model")}
    assert not any(trusted["baseline"])
    assert sum(trusted["model"]) >= 0.9 * len(trusted["model"])
    assert len(trusted["model"]) == (72 if part == "after" else 0)


def test_the_words_give_each_figure_once_and_say_how_it_is_counted(told_twice: tuple[dict, Path, Story]) -> None:
    """The excess before is the same in both tables, and the part explained is that of the figures beside it."""
    story, _, spoken = told_twice
    with stdout.capture() as capture:
        demo.show(spoken)
    words = capture.get()
    compared = [row.split("│") for row in words.splitlines() if re.match(r"│ (z|all) ", row)]
    levels, before_after = {r[1].strip(): r for r in compared[:2]}, {r[1].strip(): r for r in compared[2:]}
    for axis in ("z", "all"):
        assert levels[axis][4].strip() == before_after[axis][3].strip()
    explained = re.search(r"([\d.]+)% of the squared excess of all axes explained: 1 - \(([\d.]+) / ([\d.]+)\)²", words)
    assert explained is not None
    part, after, before = map(float, explained.groups())
    assert explained[2] == before_after["all"][4].strip()
    assert explained[3] == before_after["all"][3].strip()
    assert before == pytest.approx(1e3 * story["before"]["compare"]["excess_dps"], abs=0.05)
    assert part == pytest.approx(100 * (1 - (after / before) ** 2), abs=0.1)
    left = re.search(r"([\d.]+)% of the square of the ([\d.]+) mdps that are left there", words)
    if left is not None:
        assert left[2] == before_after["z"][4].strip()
        assert float(left[1]) <= 100


def test_the_page_shows_what_the_demo_prints(told_twice: tuple[dict, Path, Story]) -> None:
    """Words exactly; figures to a twentieth or two of their last digits, because processors round differently."""
    page = (Path(__file__).parents[1] / "docs" / "demo.md").read_text(encoding="utf-8")
    shown = re.search(r"<!-- transcript: gyrocal demo -->\n```\n(.*?)```\n<!-- end of transcript -->", page, re.DOTALL)
    assert shown is not None
    _, folder, spoken = told_twice
    with stdout.capture() as capture:
        demo.show(spoken)
    there, here = shown[1], capture.get().replace(str(folder), "demo-out")
    assert _words(there) == _words(here)
    for page_has, printed in zip(NUMBER.findall(there), NUMBER.findall(here), strict=True):
        last_digit = 10.0 ** -len(page_has.partition("e")[0].partition(".")[2])
        assert float(printed) == pytest.approx(float(page_has), rel=0.05, abs=max(2 * last_digit, 1e-5)), (page_has, printed)


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e-?\d+)?")


def _words(text: str) -> list[str]:
    """The words of a text with its tables, whose columns are as wide as their figures."""
    return re.sub(r"[─━│┃┡┩┏┓┳╇┴└┘╋]+", " ", NUMBER.sub("#", text)).split()


def test_a_network_that_gives_no_answer_is_a_row_without_figures() -> None:
    silent = Estimate("s000", "cnn", 2.0, "z", None, None, None, None, None, ("net_range",))
    heard = Estimate("s000", "cnn", 4.0, "z", 0.004, 0.001, -0.06, 0.01, 1.5)
    truth = {"s000": {"scale": [0, 0, 0.003], "bias_dps": [0, 0, -0.05]}}
    answers = Answers([silent, heard], errors([silent, heard], truth))
    assert answers.methods == ["cnn"]
    assert answers.error("cnn", 2.0) == (None, None)
    assert (answers.misfit("cnn", 2.0), answers.trusted("cnn", 2.0)) == (None, 0)
    assert answers.error("cnn", 4.0) == pytest.approx((0.001, 0.01))
    assert (answers.misfit("cnn", 4.0), answers.trusted("cnn", 4.0)) == (1.5, 1)


def test_c_and_onnxruntime_agree(told: tuple[dict, Path]) -> None:
    assert told[0]["parity"]["ok"] is True
    assert 0 < told[0]["parity"]["max_abs_diff"] < 1e-5


def test_recording_model_headers_and_picture_are_left(told: tuple[dict, Path]) -> None:
    _, folder = told
    assert "table_ripple" in (folder / "include" / "calibration.h").read_text()
    assert (folder / "errors.png").stat().st_size > 10_000
    assert (folder / "model.toml").is_file()
    assert (folder / "recorded" / "session.toml").is_file()


def test_a_folder_that_is_not_the_demo_s_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").write_text("x")
    assert main(["demo", "--out", str(tmp_path / "mine")]) == 2
    assert (tmp_path / "mine" / "file").read_text() == "x"
