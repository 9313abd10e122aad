"""Samples that no sentence announced are counted all the same, if the device says how long its run was."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder, Report, Wanted
from gyrocal.device.rows import rows_file
from gyrocal.device.simulator import sim_command
from gyrocal.errors import DeviceError
from gyrocal.recording.session import Session

from .conftest import two_faces
from .damage import Lines
from .fake import FakeDevice

LOST = 40


def said(session: Session, *faults: str) -> list[bytes]:
    """What a device says that stays on for 4 s after the last run of a power cycle."""
    with rows_file(session) as rows:
        command = [*sim_command(rows, faults=faults), "--idle", "4"]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=True)
    return done.stdout.splitlines()


def record(lines: list[bytes], out: Path) -> Report:
    with Link("lines", opener=lambda name, baud: Lines(lines)) as link:
        recorder = Recorder(link, out, wanted=None)
        with contextlib.suppress(DeviceError):  # the last run's end did not come
            recorder.record()
    return recorder.report


@pytest.mark.parametrize("which", range(4))
@pytest.mark.parametrize("reminders_lost", [0, 2])
def test_samples_behind_the_last_one_of_a_run_whose_end_did_not_come_are_counted(
    which: int, reminders_lost: int, tmp_path: Path, require_tool: Callable[[str], str]
) -> None:
    require_tool("cc")
    session = two_faces(seconds=2.0)
    lines = said(session)
    end = [i for i, line in enumerate(lines) if line.startswith(b"$RUN") and b"state=end" in line][which]
    reminders = [i for i, line in enumerate(lines) if i > end and line.startswith(b"$STA")][:reminders_lost]
    heard = [line for i, line in enumerate(lines) if not end - LOST <= i <= end and i not in reminders]
    report = record(heard, tmp_path / "out")
    assert [r.samples + r.lost for r in report.runs] == [len(run) for run in session.runs]
    assert [r.lost > 0 for r in report.runs] == [k == which for k in range(4)]
    told = [w for w in report.warnings if w.code == "run_unannounced"]
    assert [(w.file, "end of a run" in w.text) for w in told] == [(report.runs[which].file, True)]


def test_a_sensor_that_is_turned_over_unheard_loses_no_sample_of_the_count(
    tmp_path: Path, require_tool: Callable[[str], str]
) -> None:
    """The errors that the device sends meanwhile are lost too, and they are no samples."""
    require_tool("cc")
    session = two_faces(seconds=4.0, scenarios=1)
    lines = said(session, "early_flip@2", "nack@2.02:0.05")
    turned = next(i for i, line in enumerate(lines) if line.startswith(b"$ERR"))
    assert any(line.startswith(b"$ERR") for line in lines[turned : turned + 30])
    report = record([*lines[: turned - 10], *lines[turned + 30 :]], tmp_path / "out")
    samples = sum(line.startswith(b"$RAW") and line.split(b",")[4] != b"-1" for line in lines)
    assert len(report.runs) == 3
    assert sum(r.samples + r.lost for r in report.runs) == samples


@pytest.mark.parametrize("joined_at", [0, 137])
@pytest.mark.parametrize("end_comes", [True, False])
def test_a_run_that_is_joined_says_what_it_lacks_and_what_is_unknown(
    joined_at: int, end_comes: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`record --follow` meets a run in progress; the device goes away at its end or before it is told."""
    settings = {"face": "up", "axis": "z", "table_dps": 78.0, "turn_deg": 0.0}

    class Going(FakeDevice):
        def _obey(self, text: str) -> None:
            super()._obey(text)
            if text == "status" and self.commands.count("status") == 1:
                for n in range(joined_at, 300):
                    self.sample(n)
                    if n == joined_at:
                        self.say("STA", {"state": "recording", "n": n + 1, **settings})
                if end_comes:
                    self.say("RUN", {"state": "end", **settings, "n": 310})
                self.unplug()

    with Going() as fake:
        code = main(["record", str(tmp_path / "out"), "--port", fake.port, "--follow"])
    told = capsys.readouterr().out
    assert code == (0 if end_comes else 3)
    lost = "10 lost on the way" if end_comes else "at least 0 lost on the way (how many at its end is unknown)"
    before = f", {joined_at} before the recording joined it" if joined_at else ""
    assert f" {300 - joined_at} samples, {lost}{before}, 0 missed" in told, told.splitlines()[0][-200:]
    assert "(run_unannounced)" in told


def test_a_wanted_run_whose_end_never_comes_does_not_wait_for_ever(tmp_path: Path) -> None:
    def run(fake: FakeDevice) -> None:
        for n in range(100):
            fake.sample(n)
        fake.seq += 1  # the end of the run
        for n in range(100, 520):
            fake.say("RAW", [-1, 1, -2, 3, 0, 0, 16393, 256], t_us=2_000_000 + n * 10_000)

    with FakeDevice(run) as fake, Link(fake.port) as link:
        recorder = Recorder(link, tmp_path / "out", wanted=Wanted("up", 3.0, table_rate_dps=78.0))
        with pytest.raises(DeviceError, match="ended the run early"):
            recorder.record()
    assert [r.samples for r in recorder.report.runs] == [100]
