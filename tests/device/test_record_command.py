"""`gyrocal record` as a program: one reader a port, signals that end it, a report at exit 3 too."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.device import simulated as device
from gyrocal.recording.session import Session

from .conftest import two_faces
from .fake import FakeDevice

RUN = ["--face", "up", "--rate", "78", "--seconds", "60"]


def slow_samples(fake: FakeDevice) -> None:
    for n in range(40):
        fake.sample(n)


def wait_for(file: Path, rows: int) -> None:
    deadline = time.monotonic() + 20
    while not file.exists() or len(file.read_text().splitlines()) < rows + 1:
        assert time.monotonic() < deadline, f"{file} did not grow"
        time.sleep(0.02)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_signal_ends_the_recording_with_its_report(name: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with FakeDevice(slow_samples) as fake:
        command = [sys.executable, "-m", "gyrocal", "record", str(out), "--port", fake.port, *RUN, "--json"]
        number = getattr(signal, name)

        def heard() -> None:
            signal.signal(number, signal.SIG_DFL)  # under nohup the signal is ignored, and the recorder leaves it so

        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=heard) as process:
            wait_for(out / "000_up.csv", 40)
            os.kill(process.pid, number)
            report = json.loads(process.communicate(timeout=20)[0])
        assert process.returncode == 0
        assert fake.commands[-1] == "stop"
    assert [(r["file"], r["face"], r["samples"], r["lost"]) for r in report["runs"]] == [("000_up.csv", "up", 40, 0)]
    told = {warning["code"] for warning in report["warnings"]}  # of what the fake device reads, others are true
    assert not told & {"line_damaged", "samples_lost", "run_unannounced", "device_gone"}


@pytest.mark.parametrize("tcp", [None, pytest.param("127.0.0.1:0", marks=pytest.mark.wide)], ids=["pty", "tcp"])
def test_a_second_recorder_is_turned_away_at_once(tcp: str | None, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    session = two_faces(seconds=12.0, scenarios=1)
    with device.SimulatedDevice(session, speed=8, tcp=tcp) as simulated:
        command = [sys.executable, "-m", "gyrocal", "record", str(tmp_path / "first"), "--port", simulated.port, "--follow"]
        with subprocess.Popen([*command, "--json"], stdout=subprocess.PIPE, text=True) as process:
            wait_for(tmp_path / "first" / "000_up.csv", 100)
            assert main(["record", str(tmp_path / "second"), "--port", simulated.port, "--follow"]) == 3
            report = json.loads(process.communicate(timeout=30)[0])
        assert process.returncode == 0
    error = capfd.readouterr().err.strip()
    assert "another program has it open; close that one first" in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "second").exists()
    assert [(r["samples"], r["lost"]) for r in report["runs"]] == [(len(run), 0) for run in session.runs]


@pytest.mark.parametrize("room", [30, 1_000, 20_000, 60_000])
def test_a_full_disk_leaves_whole_rows_and_a_report(room: int, tmp_path: Path, require_tool: Callable[[str], str]) -> None:
    """No file may grow beyond `room` bytes: the write that goes beyond comes back short, and the next one fails."""
    require_tool("cc")
    out = tmp_path / "out"
    command = [sys.executable, "-m", "gyrocal", "record", str(out), "--follow", "--json"]
    with device.SimulatedDevice(two_faces(seconds=7.0)) as simulated:
        done = subprocess.run(
            [*command, "--port", simulated.port], capture_output=True, text=True, check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)),
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "File too large" in done.stderr
    assert "make room" in done.stderr
    assert "device_gone" not in done.stdout
    report = json.loads(done.stdout)
    kept = Session.open(out).runs if (out / "session.toml").exists() else []
    assert [len(run) for run in kept] == [run["samples"] for run in report["runs"]]
    assert kept or room < 60_000  # what came in one piece with the row that found no room is left out
    for file in out.glob("*.csv"):
        assert file.read_text().endswith("\n")


def test_the_object_is_printed_at_exit_3_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(fake: FakeDevice) -> None:
        slow_samples(fake)
        fake.unplug()

    with FakeDevice(run) as fake:
        assert main(["record", str(tmp_path / "out"), "--port", fake.port, *RUN, "--json"]) == 3
    report = json.loads(capsys.readouterr().out)
    assert [(r["file"], r["samples"]) for r in report["runs"]] == [("000_up.csv", 40)]
    gone = next(w for w in report["warnings"] if w["code"] == "device_gone")
    assert set(gone) == {"code", "axis", "file", "text", "blocking"}
    assert not gone["blocking"]
    assert "40 samples" in gone["text"]
    assert len(Session.open(tmp_path / "out").runs[0]) == 40
    assert main(["record", str(tmp_path / "other"), "--port", "/dev/no_such_port", *RUN, "--json"]) == 3
    assert [w["code"] for w in json.loads(capsys.readouterr().out)["warnings"]] == ["device_gone"]


def test_reasons_are_printed_as_text_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(fake: FakeDevice) -> None:
        for n in [*range(20), *range(30, 70)]:
            fake.sample(n)

    with FakeDevice(run) as fake:
        options = ["--face", "up", "--rate", "78", "--seconds", "0.5"]
        assert main(["record", str(tmp_path / "out"), "--port", fake.port, *options]) == 0
    text = capsys.readouterr().out
    assert "40 samples, 10 lost on the way" in text
    assert "warning: 000_up.csv: 10 of 50 samples that were sent did not arrive (samples_lost)" in text


def test_a_table_that_stands_still_is_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with FakeDevice(slow_samples) as fake:  # one reading, of nothing, while --rate says 78
        options = ["--face", "up", "--rate", "78", "--seconds", "0.3", "--json"]
        assert main(["record", str(tmp_path / "out"), "--port", fake.port, *options]) == 0
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert [w["blocking"] for w in warnings if w["axis"] == "z"] == [True]


def test_a_sensor_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gyrocal.device.record.SILENCE_S", 0.3)
    with FakeDevice() as fake:
        assert main(["record", str(tmp_path / "out"), "--port", fake.port, *RUN, "--imu", "2"]) == 3
    assert "there is no sensor 2; want --imu 0" in capsys.readouterr().err
