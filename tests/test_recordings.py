"""docs/recordings.md: each recording goes from the file as published to a diagnosis and a corrected recording.

``GYROCAL_PYTHON`` names the Python of another environment, in which the commands then run: ``make wheel`` sets it.
"""

import os
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES, Session
from real_recordings import REALDATA

PAGE = Path(__file__).resolve().parents[1] / "docs" / "recordings.md"
OTHER = os.environ.get("GYROCAL_PYTHON")
SECTIONS = {
    title: block.splitlines() for title, block in re.findall(r"^## (.+?)$.*?^```sh\n(.*?)^```", PAGE.read_text(), re.M | re.S)
}


def run(words: list[str]) -> int:
    if OTHER is None:
        return main(words)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([OTHER, "-m", "gyrocal", *words], env=environment).returncode


@pytest.mark.parametrize("title", SECTIONS)
def test_a_recording_is_imported_diagnosed_and_corrected(
    title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    lines = [shlex.split(line)[1:] for line in SECTIONS[title]]
    published = REALDATA / lines[0][1]
    if not published.exists():
        pytest.skip(f"{published} is not there; GYROCAL_REALDATA names the folder of real recordings")
    (tmp_path / published.parent.name).symlink_to(published.parent)
    monkeypatch.chdir(tmp_path)
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
