"""docs/references.md and docs/hands.md: the commands for each kind of reference, and the results that the pages state.

The truths are others': the makers of a recording, or a least-squares fit that was made apart from the library.
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from page_commands import beside, preparation, run, sections

REFERENCES = sections("references.md")
HANDS = sections("hands.md")
pytestmark = pytest.mark.usefixtures("known_answers")
Terminal = pytest.CaptureFixture[str]


def carried_out(lines: list[list[str]], screen: Terminal) -> str:
    """What the commands print, all of which succeed."""
    for words in lines:
        assert run(words) == 0, screen.readouterr().err
    return screen.readouterr().out


def compared(words: list[str], screen: Terminal) -> dict[tuple[str, str | None, str], tuple[float, float]]:
    """The parameters of a comparison with their standard errors, by effect, axis and name."""
    assert run([*words, "--json"]) == 0
    rows: list[dict[str, Any]] = json.loads(screen.readouterr().out)["parameters"]
    return {(p["effect"], p["axis"], p["name"]): (p["value"], p["se"]) for p in rows}


def estimates(words: list[str], screen: Terminal) -> list[dict[str, Any]]:
    """The estimates that ``calibrate`` gives."""
    assert run([*words, "--json"]) == 0
    return list(json.loads(screen.readouterr().out)["estimates"])


def near(found: tuple[float, float], truth: float, also: float = 0.0) -> bool:
    """True within three standard errors and ``also``, what the truth itself is unsure by."""
    return abs(found[0] - truth) < 3 * found[1] + also


@pytest.mark.wide
def test_motion_capture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Terminal) -> None:
    lines = REFERENCES["Motion capture"]
    beside(lines[0][1], tmp_path, monkeypatch)
    carried_out(lines[:-1], capfd)
    found = compared(lines[-1], capfd)
    assert 0.0035 < found["time_offset", None, "offset_s"][0] < 0.0045
    for axis, scale in zip("xyz", (-0.0064, -0.0028, -0.0015), strict=True):
        value, se = found["scale", axis, "scale"]
        assert abs(value - scale) < se < 0.0012
    for axis, angle_deg in zip("xyz", (0.29, 0.25, 0.13), strict=True):
        assert found["alignment", None, f"r{axis}_deg"][0] == pytest.approx(angle_deg, abs=0.02)


def test_an_encoders_angle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Terminal) -> None:
    lines = REFERENCES["An encoder's angle"]
    beside(lines[0][1], tmp_path, monkeypatch)
    carried_out(lines[:-1], capfd)
    (found,) = estimates(lines[-1], capfd)
    assert near((found["scale"], found["scale_se"]), -0.0148)
    assert found["scale_se"] < 0.001
    assert found["trusted"]
    model = Path("stepper.toml").read_text()
    assert float(re.findall(r"tau_s = ([0-9.e+-]+)", model)[-1]) == pytest.approx(0.012, abs=0.001)


@pytest.mark.wide
def test_turns_of_a_known_angle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Terminal) -> None:
    lines = REFERENCES["Turns of a known angle"]
    beside(lines[0][1], tmp_path, monkeypatch)
    assert "in turns about" in carried_out(lines, capfd)
    found = estimates(lines[1], capfd)
    for estimate, scale in zip(found, (0.0279, -0.0176, -0.0018), strict=True):
        assert estimate["scale"] == pytest.approx(scale, abs=2e-4)
        assert estimate["flags"] == ["misfit"]


@pytest.mark.wide
def test_a_reference_in_a_second_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Terminal) -> None:
    title = "A reference in a second file"
    pytest.importorskip("scipy")
    beside("mpu6050_encoder_stepper/raw_pitch_slow.mat", tmp_path, monkeypatch)
    exec(preparation("references.md", title), {})
    lines = REFERENCES[title]
    assert "reference: time_offset offset_s 0.71193 ± 0.00029, clock_drift e " in carried_out(lines[:2], capfd)
    found = compared(lines[1], capfd)
    assert near(found["time_offset", None, "offset_s"], 0.712, also=0.001)
    assert near(found["clock_drift", None, "e"], 0.0)
    assert near(found["scale", "y", "scale"], -0.0148)
    (estimate,) = estimates(lines[2], capfd)
    assert near((estimate["scale"], estimate["scale_se"]), -0.0148)


def test_movements_by_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Terminal) -> None:
    lines = HANDS["A real recording"]
    beside(lines[0][1], tmp_path, monkeypatch)
    printed = carried_out(lines, capfd)
    assert "9 rests" in printed
    assert "movements scatter by 1.90 times the noise" in printed
    for estimate, scale, se in zip(estimates(lines[1], capfd), (-0.0213, -0.020, -0.0040), (0.007, 0.016, 0.0066), strict=True):
        assert estimate["scale"] == pytest.approx(scale, abs=2e-3)
        assert estimate["scale_se"] == pytest.approx(se, rel=0.1)
