"""A recording by hand: it tells what is missing, ends at its aims, and writes a session whose reference is gravity."""

import json
import select
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.cli import main
from gyrocal.device import simulated as device
from gyrocal.device.port import Link
from gyrocal.device.record_hands import HandsRecorder, HandsReport
from gyrocal.errors import DeviceError, InputError
from gyrocal.gravity.aims import Aim, Progress, Turn
from gyrocal.gravity.calibrate import calibrate
from gyrocal.present.hands import Guide
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

from .fake import PERIOD_US, FakeDevice

LSB_DPS, LSB_G = 1 / 32.8, 1 / 8192
HELLO = {"full_scale_dps": 1000.0, "lsb_dps": LSB_DPS, "lsb_g": LSB_G}


class HeldDevice(FakeDevice):
    """A device in a person's hands: it sends a session's samples, and then rests until it is told to stop."""

    def __init__(self, session: Session, *, pulled: bool = False) -> None:
        super().__init__(HeldDevice.moved, hello=HELLO)
        self._session, self._pulled = session, pulled

    def moved(self) -> None:
        run = self._session.runs[0]
        assert run.acc_g is not None
        gyro, acc = (run.gyro_dps / LSB_DPS).round().astype(int), (run.acc_g / LSB_G).round().astype(int)
        for n in range(len(run)):
            self.reading(n, gyro[n], acc[n])
        if self._pulled:
            self.unplug()
            return
        deadline = time.monotonic() + 30
        while not self.is_told() and time.monotonic() < deadline:
            n += 1
            self.reading(n, gyro[n % 100], acc[n % 100])
            time.sleep(0.01)

    def is_told(self) -> bool:
        """True if a command has come."""
        assert self._client is not None
        return bool(select.select([self._client], [], [], 0)[0])

    def reading(self, n: int, gyro: Any, acc: Any) -> None:
        self.say("RAW", [n, *gyro.tolist(), *acc.tolist(), 256], t_us=2_000_000 + n * PERIOD_US)


def record(port: str, out: Path, told: list[Progress]) -> HandsReport:
    with Link(port) as link:
        recorder = HandsRecorder(link, out, told.append)
        recorder.record()
    return recorder.report


def test_it_ends_at_its_aims_and_stops_the_device(tmp_path: Path) -> None:
    told: list[Progress] = []
    session, _ = simulate(campaign="hands", seed=0, scenarios=17)
    with HeldDevice(session) as fake:
        report = record(fake.port, tmp_path / "out", told)
        assert {"set table_dps none", "start up", "stop"} <= set(fake.commands)
    assert told[-1].met
    assert not any(now.met for now in told[:-2])  # the last one is that of the whole recording
    assert report.rests >= 15
    assert all(aim.met for aim in report.aims)
    recorded = Session.open(tmp_path / "out")
    assert recorded.reference.kind == "gravity"
    assert [(r.table_rate_dps, r.turn_deg) for r in recorded.runs] == [(None, None)]
    for aim, estimate in zip(report.aims, calibrate(recorded).estimates, strict=True):
        assert estimate.scale_se == pytest.approx(aim.scale_se)


def test_the_simulated_device_replays_a_session_by_hand(
    require_tool: Callable[[str], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Too few rests: everything is kept, the aims are not met, and the person is told the next turn after each rest."""
    require_tool("cc")
    out = tmp_path / "out"
    session, _ = simulate(campaign="hands", seed=0, scenarios=5)
    with device.SimulatedDevice(session) as simulated:
        assert main(["record", str(out), "--port", simulated.port, "--hands", "--json"]) == 0
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert answer["rests"] == 5
    assert [(aim["axis"], aim["met"]) for aim in answer["aims"]] == [("x", False), ("y", False), ("z", False)]
    assert [run["samples"] for run in answer["runs"]] == [len(session.runs[0])]
    assert "4 rests; scale" in said.err
    assert said.err.count("next: hold") >= 4
    assert Session.open(out).reference.kind == "gravity"


def test_a_second_recording_goes_on_and_other_kinds_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "out"
    session, _ = simulate(campaign="hands", seed=0, scenarios=3)
    for rests in (3, 6):
        with HeldDevice(session, pulled=True) as fake, Link(fake.port) as link:
            recorder = HandsRecorder(link, out, lambda _: None)
            with pytest.raises(DeviceError, match="gone during the run"):
                recorder.record()
        assert recorder.report.rests == rests
    assert len(Session.open(out).runs) == 2
    with FakeDevice() as fake:
        assert main(["record", str(out), "--port", fake.port, "--face", "up", "--rate", "78", "--seconds", "1"]) == 2
    other = tmp_path / "other"
    with FakeDevice(lambda d: [d.sample(n) for n in range(120)] and None) as fake:
        assert main(["record", str(other), "--port", fake.port, "--face", "up", "--rate", "78", "--seconds", "1"]) == 0
    with FakeDevice() as fake, pytest.raises(InputError, match="a new session"):
        record(fake.port, other, [])


@pytest.mark.parametrize("more", [["--rate", "78"], ["--follow"], ["--plan", "plan.toml"]])
def test_it_takes_no_rate(more: list[str], tmp_path: Path) -> None:
    assert main(["record", str(tmp_path / "out"), "--port", "nowhere", "--hands", *more]) == 2


@pytest.mark.parametrize(("rests", "words"), [(9, "the aims are met; 6 more rests, and the recording ends"), (15, None)])
def test_a_recording_that_goes_on_although_its_aims_are_met_says_why(rests: int, words: str | None) -> None:
    told: list[str] = []
    aims = tuple(Aim(axis, scale_se=0.001, misalignment_se=0.001) for axis in "xyz")
    Guide(told.append, lambda _: None).show(Progress(rests, True, aims, Turn("x", "z", 90.0)))
    assert [line.strip() for line in told if "met" in line] == ([words] if words else [])
