"""docs/recordings.md: each recording goes from the file as published to a diagnosis and a corrected recording."""

from pathlib import Path

import numpy as np
import pytest

from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES, Session
from page_commands import beside, run, sections

SECTIONS = sections("recordings.md")
AGAIN = {
    "The swinging shaft, faster", "In the hand before optical motion capture",
    "Faster in the hand before optical motion capture",
    "Raw counts of another rest", "A thermal chamber", "Counts with an offset, turned by hand",
}  # fmt: skip
"""Further recordings of the same rig or by hand, and the rest in the chamber, which recording/test_real.py explains."""
assert SECTIONS.keys() > AGAIN


@pytest.mark.usefixtures("known_answers", "tests_alone")
@pytest.mark.parametrize("title", [pytest.param(title, marks=[pytest.mark.wide] * (title in AGAIN)) for title in SECTIONS])
def test_a_recording_is_imported_diagnosed_and_corrected(
    title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    lines = SECTIONS[title]
    beside(lines[0][1], tmp_path, monkeypatch)
    for words in lines:
        assert run(words) == 0, capfd.readouterr().err
    assert {words[0] for words in lines} >= {"import", "apply"}
    assert {"diagnose", "explain"} & {words[0] for words in lines}
    name = lines[0][2]
    before, after = Session.open(name), Session.open(f"{name}_corrected")
    model = Model.open(f"{name}.toml")
    assert after.rows == before.rows
    for axis, (raw, corrected) in enumerate(zip(at_rest_dps(before), at_rest_dps(after), strict=True)):
        if model.value("bias", AXES[axis], "bias_dps"):
            assert abs(corrected) < 0.5 * abs(raw) + 0.05


def at_rest_dps(session: Session) -> list[float]:
    """The mean reading of each axis over the runs at rest, deg/s; nothing if there are none."""
    runs = [run for run in session.runs if run.table_rate_dps == 0]
    return [float(np.mean([run.gyro_dps[:, i].mean() for run in runs])) for i in range(3)] if runs else []
