"""The simulated device: every row once, at its own time, in raw counts; the same through pipe, pty and TCP."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.device import rows, wire
from gyrocal.device import simulated as device
from gyrocal.device.port import Link, PortGone, SerialPort
from gyrocal.device.wire import Sentence
from gyrocal.errors import InputError
from gyrocal.recording.session import Session

from .conftest import LSB_DPS, two_faces


def listen(port: str) -> tuple[list[Sentence], wire.Reader]:
    """Everything that the device says, to its end."""
    with Link(port) as link:
        heard: list[Sentence] = []
        try:
            while True:
                heard += link.receive()
        except PortGone:
            return heard, link.reader


def told(sentences: list[Sentence], tag: str) -> list[str]:
    return [s.text for s in sentences if s.tag == tag]


def check_rows(session: Session, sentences: list[Sentence]) -> None:
    raw = wire.raw_table(s for s in sentences if s.tag == "RAW" and not s.text.startswith("-1"))
    ends = np.flatnonzero(raw.number == 0)
    assert len(ends) == len(session.runs)
    for run, start, stop in zip(session.runs, ends, [*ends[1:], len(raw)], strict=True):
        assert np.array_equal(raw.number[start:stop], np.arange(len(run)))
        assert np.array_equal(raw.t_us[start:stop] - raw.t_us[start], run.t_us)
        assert np.array_equal(raw.counts[start:stop, :3], np.rint(run.gyro_dps / LSB_DPS))
        assert run.acc_g is not None
        assert np.array_equal(raw.counts[start:stop, 3:6], np.rint(run.acc_g / 6.1e-5))
        assert run.temp_c is not None
        assert np.array_equal(raw.counts[start:stop, 6], (run.temp_c - 25.0) * 256.0)


def test_every_row_is_served_once_at_its_own_time(session: Session) -> None:
    sentences = device.replay(session)
    check_rows(session, sentences)
    assert [s.fields["face"] for s in sentences if s.tag == "RUN"] == ["up", "up", "down", "down"] * 2
    assert [s.fields["name"] for s in sentences if s.tag == "ERR"] == ["net_gap"] * 2  # the runs have a gap after 2 s
    assert [s.fields["seconds"] for s in sentences if s.tag == "CAL" and s.fields["method"] == "cnn"] == ["2"] * 2
    assert {s.fields["missed"] for s in sentences if s.tag == "RUN" and s.fields["state"] == "end"} == {"4"}


def test_through_the_fifo_every_row_comes_too() -> None:
    session = two_faces(seconds=3.0, rate_hz=104.0, scenarios=1)
    raw = wire.raw_table(s for s in device.replay(session, fifo=20) if s.tag == "RAW" and not s.text.startswith("-1"))
    ends = np.flatnonzero(raw.number == 0)
    for run, start, stop in zip(session.runs, ends, [*ends[1:], len(raw)], strict=True):
        assert np.array_equal(raw.number[start:stop], np.arange(len(run)))
        assert np.array_equal(raw.counts[start:stop, :3], np.rint(run.gyro_dps / LSB_DPS))


def test_baseline_is_the_closed_form_on_the_rows(session: Session) -> None:
    answers = [s for s in device.replay(session, stream="off") if s.tag == "CAL" and s.fields["method"] == "baseline"]
    expected = []
    for _, (up, down) in session.by_scenario():
        for seconds in (2, 4, 6):
            mean_up, mean_down = (r.gyro_dps[r.t_us < seconds * 1e6, 2].mean() for r in (up, down))
            scale = (mean_up - mean_down) / 156.0 - 1.0
            expected.append((seconds, scale, mean_up - (1.0 + scale) * 78.0))
    got = [tuple(s.real(k) for k in ("seconds", "scale", "bias_dps")) for s in answers]
    assert np.allclose(np.array(got, float), expected, rtol=2e-8, atol=1e-9)


def test_answers_say_what_speaks_against_them(session: Session) -> None:
    answers = [s.fields for s in device.replay(session, stream="off") if s.tag == "CAL"]
    told = {(a["seconds"], a["flags"], a["trusted"]) for a in answers}
    assert told == {("2", "", "1"), ("4", "missed", "0"), ("6", "missed", "0")}  # each run has a gap after 2.3 s
    swapped = Session(
        session.sample_rate_hz,
        tuple(replace(run, table_rate_dps=100.0) for run in session.runs),
        full_scale_dps=session.full_scale_dps,
        lsb_dps=session.lsb_dps,
    )
    answers = [s.fields for s in device.replay(swapped, stream="off") if s.tag == "CAL"]
    assert {a["flags"] for a in answers} == {"implausible", "implausible+missed"}


@pytest.mark.parametrize("tcp", [None, "127.0.0.1:0"], ids=["pty", "tcp"])
def test_a_port_carries_what_the_device_says(session: Session, tcp: str | None) -> None:
    with device.SimulatedDevice(session, tcp=tcp) as simulated:
        heard, reader = listen(simulated.port)
        assert simulated.wait(5)
    assert (reader.lost, reader.bad, reader.overlong) == (0, 0, 0)
    check_rows(session, heard)
    assert told(heard, "CAL") == told(device.replay(session), "CAL")


@pytest.mark.parametrize("tcp", [None, "127.0.0.1:0"], ids=["pty", "tcp"])
def test_the_device_outlives_its_readers(session: Session, tcp: str | None) -> None:
    with device.SimulatedDevice(session, speed=50, tcp=tcp) as simulated:  # at max, a socket's buffer takes it all
        first: list[Sentence] = []
        with Link(simulated.port) as link:
            while len(first) < 200:
                first += link.receive()
        second, reader = listen(simulated.port)
        assert simulated.wait(5)
    assert reader.lost == 0
    assert told(second, "RUN")[-1].startswith("state=end,face=down")
    assert len(told(second, "CAL")) >= 6
    assert first[-1].seq < second[0].seq


@pytest.mark.parametrize("tcp", [None, "127.0.0.1:0"], ids=["pty", "tcp"])
def test_a_reader_who_comes_back_at_once_is_told_that_the_device_replays(session: Session, tcp: str | None) -> None:
    """The reader is back before the port has told that it was gone: the note does not hang on that."""
    with device.SimulatedDevice(session, hold=True, tcp=tcp) as simulated:
        for _ in range(30):
            with Link(simulated.port) as link:
                link.greet()
                assert link.replays


def test_whatever_a_reader_loses_at_first_an_answered_hello_came_with_the_note(session: Session) -> None:
    """The bytes that lay in the port when a reader opened it are lost, and the end of an earlier reader's answer may follow."""

    class Said(SerialPort):
        def __init__(self, rest: bytes) -> None:
            self.rest = rest

        def read(self) -> bytes:
            return self.rest

        def close(self) -> None:
            pass

    with device.SimulatedDevice(session, hold=True, stream="off") as simulated:
        port = SerialPort(simulated.port)
        answer = b""
        port.write(b"hello\n")
        while b"$HEL" not in answer[answer.find(b",cmd=hello") :] or not answer.endswith(b"\n"):
            answer += port.read()
        port.close()
    for lost in range(len(answer)):
        with Link("cut", opener=lambda *_, rest=answer[lost:]: Said(rest)) as link:
            link.receive()
            assert link.replays or not link.answered, answer[lost:]


def test_commands_reach_the_core_through_the_port(session: Session) -> None:
    with device.SimulatedDevice(session, hold=True) as simulated, Link(simulated.port) as link:
        hello = link.greet()
        assert (hello.real("lsb_dps"), hello.real("rate_hz"), hello.fields["sensor"]) == (LSB_DPS, 145.0, "LSM6DSO")
        assert link.replays
        link.command("stream off")
        state = ""
        while state != "done":
            link.command("status")
            state = next((s.fields["state"] for s in reversed(link.receive()) if s.tag == "STA"), "")
        link.command("set turn_deg 360")
        assert link.command("get turn_deg").real("turn_deg") == 360.0


def test_speed_is_kept() -> None:
    """A device waits for no time of its own but for that of its speed: the faster one of two ends first."""

    def ended_s(speed: float) -> float:
        with device.SimulatedDevice(session, speed=speed) as simulated:
            began_s = time.monotonic()
            heard, _ = listen(simulated.port)
            end_s = time.monotonic()
        assert 1e-6 * (heard[-1].t_us - heard[0].t_us) / speed <= end_s - began_s + 0.1
        return end_s

    session = two_faces(seconds=3.0, scenarios=1)
    with ThreadPoolExecutor() as both:
        fast, slow = both.map(ended_s, (20, 5))
    assert fast < slow


def test_full_scale_follows_the_session_and_the_data(session: Session) -> None:
    assert rows.full_scale_for(session) == 250.0
    fast = two_faces(seconds=2.0, scenarios=1)
    frame = fast.runs[0].table
    for peak, expected in ((286.0, 250.0), (287.0, 500.0), (560.0, 500.0), (1200.0, 2000.0)):
        run = fast.runs[0].part(0, len(fast.runs[0]))
        object.__setattr__(run, "frame", frame.with_columns(gx_dps=frame["gx_dps"] * 0 + peak))
        one = fast.with_runs([run])
        assert rows.full_scale_for(one) == expected
        mean = next(s.real("mean_x_dps") for s in device.replay(one, stream="off") if "state=end" in s.text)
        assert mean is not None
        assert abs(mean - peak) <= rows.LSB_DPS[expected] / 2


def test_rates_off_the_parts_grid_keep_their_mean_and_stay_within_a_count() -> None:
    session = two_faces(seconds=2.0, scenarios=1)
    frame = session.runs[0].table
    rates = np.round(np.random.default_rng(8).normal(-0.6, 0.05, (len(frame), 3)) / 0.061) * 0.061
    run = session.runs[0].part(0, len(frame))
    object.__setattr__(run, "frame", frame.with_columns(**{f"g{a}_dps": rates[:, k] for k, a in enumerate("xyz")}))
    raw = wire.raw_table(s for s in device.replay(session.with_runs([run])) if s.tag == "RAW")
    counts = rates / LSB_DPS
    assert np.abs(raw.counts[:, :3] - counts).max() <= 1.0
    assert np.abs((raw.counts[:, :3] - counts).sum(axis=0)).max() <= 0.5


def test_what_a_session_lacks_is_made_up_as_documented() -> None:
    bare = two_faces(seconds=2.0, scenarios=1)
    runs = []
    for run in bare.runs:
        part = run.part(0, len(run))
        object.__setattr__(part, "frame", run.table.select("t_s", "gx_dps", "gy_dps", "gz_dps"))
        runs.append(part)
    raw = wire.raw_table(s for s in device.replay(bare.with_runs(runs)) if s.tag == "RAW")
    half = len(bare.runs[0])
    assert (raw.counts[:half, 3:] == [0, 0, 16393, 0]).all()
    assert (raw.counts[half:, 3:] == [0, 0, -16393, 0]).all()


@pytest.mark.parametrize(
    ("fault", "name"),
    [
        ("nack", "bus_nack"),
        ("wrong_id", "wrong_id"),
        ("stale", "stale"),
        ("brownout", "config_lost"),
        ("reset_timeout", "reset_timeout"),
    ],
)
def test_the_device_reports_its_sensors_faults(session: Session, fault: str, name: str) -> None:
    assert f"name={name}" in ",".join(told(device.replay(session, faults=[fault]), "ERR"))


def test_bad_options_are_refused(session: Session, tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("")
    faults = [{"faults": [text]} for text in ("oops", "nack@", "bad_tags")]
    for options in (*faults, {"speed": "fast"}, {"speed": -1}, {"tcp": "nowhere"}, {"symlink": taken}):
        with pytest.raises(InputError):
            device.SimulatedDevice(session, **options)
    assert taken.read_text() == ""


def test_the_command_prints_its_port_and_ends_when_all_is_read(session: Session, tmp_path: Path) -> None:
    session.save(tmp_path / "session")
    link = tmp_path / "port"
    command = [sys.executable, "-m", "gyrocal", "device", "--session", str(tmp_path / "session"), "--speed", "max"]
    with subprocess.Popen([*command, "--link", str(link)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == str(link)
        assert os.path.islink(link)
        heard, _ = listen(str(link))
        assert process.wait(10) == 0
    check_rows(session, heard)
    assert not link.exists()


def test_the_command_refuses_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (
        ["--session", str(tmp_path / "none")],
        ["--session", str(tmp_path), "--effect", "table_ripple"],
        ["--stream", "loud"],
        ["--effect", "no_such_effect"],
        ["--fault", "nack@x"],
        ["--fault", "nack", "--fault", "smoke"],
        ["--fault", "bad_tags"],
        ["--faults", "random:x"],
        ["--faults", "nack"],
    ):
        assert main(["device", *arguments]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
