"""Faults between the simulated device and its host: what the recorder makes of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.device.faults import LASTING, OF_BOARD, OF_FIFO, check_faults, fault_names, random_faults
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder, Report
from gyrocal.device.simulated import SimulatedDevice
from gyrocal.errors import InputError
from gyrocal.recording.session import Session

from .conftest import two_faces


def record(session: Session, out: Path, *faults: str) -> Report:
    with SimulatedDevice(session, faults=faults) as simulated, Link(simulated.port) as link:
        return Recorder(link, out, wanted=None).record()


@pytest.mark.parametrize(("fault", "codes"), [("garbled", {"line_damaged", "samples_lost"}), ("buffer_full", {"samples_lost"})])
def test_what_the_wire_loses_is_counted_and_what_comes_is_right(
    fault: str, codes: set[str], session: Session, tmp_path: Path
) -> None:
    report = record(session, tmp_path / "out", fault)
    assert {w.code for w in report.warnings} == codes
    assert [r.samples + r.lost for r in report.runs] == [len(run) for run in session.runs]
    assert report.runs[0].lost > 10
    assert [r.lost for r in report.runs[1:]] == [0, 0, 0]
    for sent, kept in zip(session.runs, Session.open(tmp_path / "out").runs, strict=True):
        at = np.searchsorted(sent.t_us - sent.t_us[0], kept.t_us - kept.t_us[0])
        assert np.abs(sent.gyro_dps[at] - kept.gyro_dps).max() < 1e-7


def test_a_loss_of_power_leaves_what_came_and_begins_a_new_scenario(session: Session, tmp_path: Path) -> None:
    report = record(session, tmp_path / "out", "power_loss@1")  # at the end of the first run
    assert [r.face for r in report.runs] == ["up", "down", "up", "down"]
    assert [r.scenario for r in report.runs] == ["s000", "s001", "s002", "s002"]
    assert len(Session.open(tmp_path / "out").runs[0]) == len(session.runs[0])


def test_a_reader_sees_that_the_power_was_lost_within_a_pair(
    session: Session, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with SimulatedDevice(session, faults=["power_loss@1"]) as simulated:
        assert main(["record", str(tmp_path / "out"), "--port", simulated.port, "--follow"]) == 0
    lines = capsys.readouterr().out.splitlines()
    told = [line.split(": ")[1].split(", ")[:2] for line in lines if ".csv: power cycle" in line]
    cycles = ["s000", "s001", "s002", "s002"]
    assert told == [[f"power cycle {c}", f"face {f}"] for c, f in zip(cycles, ["up", "down"] * 2, strict=True)]


def test_an_error_that_comes_again_is_one_line_with_a_count(
    session: Session, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with SimulatedDevice(session, faults=["nack@1:0.2*3"]) as simulated:
        assert main(["record", str(tmp_path / "out"), "--port", simulated.port, "--follow"]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if "bus_nack (" in line]
    assert told == ["device: bus_nack (-1): the sensor does not answer: check wiring and power and address (3 times)"]


@pytest.mark.parametrize("seed", range(4))
def test_random_faults_leave_a_session_that_can_be_read(seed: int, tmp_path: Path, require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    faults = random_faults(f"random:{seed}")
    report = record(two_faces(seconds=7.0, seed=seed), tmp_path / "out", *faults)
    kept = Session.open(tmp_path / "out")
    assert [run.file for run in kept.runs] == [r.file for r in report.runs]
    assert [len(run) for run in kept.runs] == [r.samples for r in report.runs]


def test_a_seed_gives_the_same_passing_faults_each_time(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    drawn = [random_faults(f"random:{seed}") for seed in range(40)]
    assert drawn == [random_faults(f"random:{seed}") for seed in range(40)]
    for faults in drawn:
        check_faults(faults)
    names = {fault.split("@")[0] for faults in drawn for fault in faults}
    assert names == set(fault_names()) - {*LASTING, *OF_BOARD, OF_FIFO}
    assert OF_FIFO in {fault.split("@")[0] for seed in range(40) for fault in random_faults(f"random:{seed}", fifo=12)}
    with pytest.raises(InputError, match="random:SEED"):
        random_faults("random:-1")


def test_the_command_lists_the_faults(capsys: pytest.CaptureFixture[str], require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    assert main(["device", "--fault", "list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split("\t")[0] for line in listed] == fault_names()
