"""The demo's JSON, as a script reads it: its pinned keys alone show that the device's error fell."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory, require_tool: Callable[[str], str]) -> tuple[dict, Path]:
    require_tool("cc")
    folder = tmp_path_factory.mktemp("demo") / "out"
    capture = folder.with_name("story.json")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("builtins.print", lambda text="", **_: capture.write_text(str(text)))
        assert main(["demo", "--out", str(folder), "--json"]) == 0
    return json.loads(capture.read_text()), folder


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
