"""Recording: what was received is on disk, gaps stay gaps, and what goes wrong is said."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.device import simulated as device
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder, Report, Wanted
from gyrocal.errors import DeviceError, InputError
from gyrocal.recording.session import Session

from .conftest import two_faces
from .fake import FakeDevice

UP = Wanted("up", 0.5, table_rate_dps=78.0)


def record(fake: FakeDevice, out: Path, wanted: Wanted | None = UP, **options: object) -> Report:
    with Link(fake.port) as link:
        return Recorder(link, out, wanted=wanted, **options).record()


def stream(numbers: list[int]):
    def run(fake: FakeDevice) -> None:
        for n in numbers:
            fake.sample(n)

    return run


def test_a_replayed_session_comes_back_whole(session: Session, tmp_path: Path) -> None:
    with device.SimulatedDevice(session) as simulated, Link(simulated.port) as link:
        report = Recorder(link, tmp_path / "out", wanted=None).record()
    assert (report.lost_sentences, report.bad_sentences) == (0, 0)
    assert [e.split()[0] for e in report.errors] == ["net_gap"] * 2  # each run has a gap of four samples
    assert [(r.lost, r.missed) for r in report.runs] == [(0, 4)] * 4
    recorded = Session.open(tmp_path / "out")
    assert (recorded.sample_rate_hz, recorded.full_scale_dps, recorded.lsb_dps) == (145.0, 250.0, 0.00875)
    for a, b in zip(session.runs, recorded.runs, strict=True):
        for name in ("scenario", "face", "axis", "table_rate_dps", "turn_deg", "power_on_s"):
            assert getattr(a, name) == getattr(b, name)
        assert np.array_equal(a.t_us, b.t_us)
        assert np.abs(a.gyro_dps - b.gyro_dps).max() < 1e-7
        assert a.acc_g is not None
        assert b.acc_g is not None
        assert np.abs(a.acc_g - b.acc_g).max() < 1e-9
        assert np.abs(a.temp_c - b.temp_c).max() < 1e-7
    assert [r["seconds"] for r in report.results if r["method"] == "baseline"] == [2, 4, 6] * 2


def test_two_commands_make_a_calibration(
    tmp_path: Path, require_tool: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    """What lies in the port's buffers when a reader leaves is gone, so each run is longer than what is wanted of it."""
    require_tool("cc")
    session, out = two_faces(seconds=20.0, scenarios=1), tmp_path / "out"
    with device.SimulatedDevice(session) as simulated:
        for face in ("up", "down"):
            options = ["--port", simulated.port, "--face", face, "--rate", "78", "--seconds", "5", "--json"]
            assert main(["record", str(out), *options]) == 0
            assert json.loads(capsys.readouterr().out)["runs"][0]["lost"] == 0
    for run, original in zip(Session.open(out).runs, session.runs, strict=True):
        n = len(run)
        assert run.face == original.face
        assert abs(n - 725) <= 5
        offset = np.flatnonzero(np.all(np.isclose(original.gyro_dps, run.gyro_dps[0]), axis=1))[0]
        assert np.allclose(run.gyro_dps, original.gyro_dps[offset : offset + n], atol=1e-7)


def test_settings_go_to_the_device_and_into_the_session(tmp_path: Path) -> None:
    wanted = Wanted("down", 0.3, table_rate_dps=-30.5, axis="x")
    with FakeDevice(stream(list(range(100)))) as fake:
        report = record(fake, tmp_path / "out", wanted, scenario="s007", day=2)
        assert fake.settings == {"axis": "x", "table_dps": "-30.5", "turn_deg": "0"}
        assert [c.split()[0] for c in fake.commands] == ["hello", "set", "set", "set", "stream", "start", "stop"]
    assert (report.runs[0].samples, report.runs[0].lost) == (30, 0)
    run = Session.open(tmp_path / "out").runs[0]
    assert (run.face, run.axis, run.table_rate_dps, run.scenario, run.day) == ("down", "x", -30.5, "s007", 2)
    assert run.power_on_s == 2.0
    assert np.allclose(run.t_s, np.arange(30) * 0.01)
    assert np.allclose(run.gyro_dps[0], np.array([1, -2, 8914]) * 0.00875)
    assert run.temp_c is not None
    assert run.temp_c[0] == 26.0


def test_a_turn_is_recorded_by_its_angle(tmp_path: Path) -> None:
    with FakeDevice(stream(list(range(100)))) as fake:
        record(fake, tmp_path / "out", Wanted("up", 0.3, turn_deg=-360.0))
        assert fake.settings == {"table_dps": "none", "turn_deg": "-360"}
    run = Session.open(tmp_path / "out").runs[0]
    assert (run.table_rate_dps, run.turn_deg) == (None, -360.0)


def test_gaps_stay_gaps_and_are_counted(tmp_path: Path) -> None:
    kept = [n for n in range(100) if n not in (10, 11, 12, 30)]
    with FakeDevice(stream(kept)) as fake:
        report = record(fake, tmp_path / "out")
    assert (report.runs[0].samples, report.runs[0].lost) == (46, 4)
    t_s = Session.open(tmp_path / "out").runs[0].t_s
    assert np.allclose(t_s, np.array(kept[:46]) * 0.01)


def test_what_the_sensor_missed_is_told_apart_from_what_the_wire_lost(tmp_path: Path) -> None:
    """Five samples that were never taken, in two gaps; four that did not arrive; both at once are the wire's."""

    def run(fake: FakeDevice) -> None:
        for n in range(100):
            if n not in (10, 11, 30, 31):
                fake.sample(n, missed=0 if n < 20 else 3 if n < 40 else 5)

    with FakeDevice(run) as fake:
        report = record(fake, tmp_path / "out", Wanted("up", 0.6, table_rate_dps=78.0))
    (recorded,) = report.runs
    assert (recorded.samples, recorded.lost, recorded.missed) == (60 - 4 - 5, 4, 5)
    assert report.to_json()["runs"][0]["missed"] == 5


def test_runs_are_added_and_what_is_there_is_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with FakeDevice(stream(list(range(100)))) as fake:
        record(fake, out)
        toml = out / "session.toml"
        toml.write_text('lab = "cellar"\n' + toml.read_text())
        record(fake, out, Wanted("down", 0.5, table_rate_dps=78.0))
    assert [run.file for run in Session.open(out).runs] == ["000_up.csv", "001_down.csv"]
    assert 'lab = "cellar"' in toml.read_text()


def test_a_session_of_another_rate_or_no_session_is_left_alone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with FakeDevice(stream(list(range(100)))) as fake:
        record(fake, out)
    before = sorted((p.name, p.read_bytes()) for p in out.iterdir())
    with FakeDevice(stream(list(range(100))), hello={"rate_hz": 200.0}) as fake:
        with pytest.raises(InputError, match="200 Hz"):
            record(fake, out)
        other = tmp_path / "other"
        other.mkdir()
        (other / "notes.txt").write_text("mine")
        with pytest.raises(InputError, match="no session"):
            record(fake, other)
    assert sorted((p.name, p.read_bytes()) for p in out.iterdir()) == before


@pytest.mark.parametrize(
    ("after", "says"),
    [
        (lambda fake: None, "no sample for"),
        (lambda fake: fake.unplug(), "gone during the run"),
        (lambda fake: fake.say("HEL", {"proto": 1}, seq=0), "restarted"),
        (lambda fake: fake.run_sentence("end", "up"), "ended the run early"),
    ],
    ids=["silence", "unplugged", "restart", "early end"],
)
def test_a_device_that_fails_leaves_what_came(
    after, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gyrocal.device.record.SILENCE_S", 0.5)

    def run(fake: FakeDevice) -> None:
        stream(list(range(20)))(fake)
        after(fake)

    with FakeDevice(run) as fake:
        options = ["--port", fake.port, "--face", "up", "--rate", "78", "--seconds", "0.5"]
        assert main(["record", str(tmp_path / "out"), *options]) == 3
    error = capsys.readouterr().err.strip()
    assert says in error
    assert "20 samples" in error
    assert len(error.splitlines()) == 1
    assert len(Session.open(tmp_path / "out").runs[0]) == 20


def test_a_refused_command_leaves_nothing(tmp_path: Path) -> None:
    error = {"code": -21, "name": "bad_argument", "advice": ""}
    with FakeDevice(refuses={"start": error}) as fake, pytest.raises(DeviceError, match="bad_argument"):
        record(fake, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("samples", [0, 5])
def test_a_run_that_another_host_began_is_not_the_wanted_one(samples: int, tmp_path: Path) -> None:
    with FakeDevice(stream(list(range(100)))) as fake, Link(fake.port) as link:
        link.greet()
        fake.say("STA", {"state": "recording", "face": "up", "n": samples})
        for n in range(samples):
            fake.sample(n, -8914)
        fake.seq += 1  # and the end of that run did not arrive
        Recorder(link, tmp_path / "out", wanted=UP).record()
    run = Session.open(tmp_path / "out").runs[0]
    assert len(run) == 50
    assert np.all(run.gyro_dps[:, 2] > 0)


def test_one_sample_is_no_run(tmp_path: Path) -> None:
    def run(fake: FakeDevice) -> None:
        fake.sample(0)
        fake.unplug()

    with FakeDevice(run) as fake, pytest.raises(DeviceError, match="nothing is kept"):
        record(fake, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))


def test_what_was_received_survives_a_kill(tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ["--port", "", "--face", "up", "--rate", "78", "--seconds", "60"]
    with FakeDevice(stream(list(range(30)))) as fake:
        options[1] = fake.port
        with subprocess.Popen([sys.executable, "-m", "gyrocal", "record", str(out), *options]) as process:
            deadline = time.monotonic() + 20
            while time.monotonic() < deadline:
                if (out / "session.toml").exists() and len((out / "000_up.csv").read_text().splitlines()) == 31:
                    break
                time.sleep(0.02)
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
    assert len(Session.open(out).runs[0]) == 30


def test_a_replay_without_the_wanted_run_says_so(session: Session, tmp_path: Path) -> None:
    with (
        device.SimulatedDevice(session) as simulated,
        Link(simulated.port) as link,
        pytest.raises(DeviceError, match="no such run"),
    ):
        Recorder(link, tmp_path / "out", wanted=Wanted("up", 1.0, table_rate_dps=55.0)).record()


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--face", "left", "--rate", "78", "--seconds", "1"],
        ["--face", "up", "--seconds", "1"],
        ["--face", "up", "--rate", "78", "--turn-deg", "360", "--seconds", "1"],
        ["--face", "up", "--rate", "nan", "--seconds", "1"],
        ["--face", "up", "--rate", "78", "--seconds", "0"],
        ["--face", "up", "--rate", "78"],
        ["--face", "up", "--rate", "78", "--seconds", "1", "--axis", "w"],
        ["--face", "up", "--turn-deg", "0", "--seconds", "1"],
    ],
)
def test_bad_usage_is_told_before_a_port_is_opened(options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "out", "--port", "/dev/none", *options]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
