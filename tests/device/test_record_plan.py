"""A plan carried out at a device: each planned run once, in order, and the rest when it goes on."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.device import simulated as device
from gyrocal.device.port import Link
from gyrocal.device.record_plan import PlanRecorder, instruction
from gyrocal.errors import DeviceError
from gyrocal.recording.plan_file import PlannedRun, PlannedRuns
from gyrocal.recording.session import Session

from .conftest import two_faces
from .fake import FakeDevice

FACES = ("up", "down")


class PressedDevice(FakeDevice):
    """Somebody presses its button once it has its settings and streams: it begins a run by itself."""

    def _obey(self, text: str) -> None:
        super()._obey(text)
        if text == "stream raw" and "table_dps" in self.settings and not self.face:
            self.run_sentence("start", "up")
            for n in range(100):
                self.sample(n)


def plan_of(cycles: int, seconds: float = 4.0, *, temp_c: float | None = None) -> PlannedRuns:
    """Power cycles of an up and a down run at 78 deg/s."""
    runs = [PlannedRun("z", face, 78.0, seconds, temp_c, f"s{k:03d}") for k in range(cycles) for face in FACES]  # type: ignore[arg-type]
    return PlannedRuns(tuple(runs), day=2)


def carry_out(port: str, out: Path, plan: PlannedRuns, told: list[str]) -> list[PlannedRun]:
    with Link(port, reconnect=True) as link:
        recorder = PlanRecorder(link, out, plan, told.append)
        recorder.record()
    return recorder.left


def test_the_simulated_device_carries_a_plan_out(session: Session, tmp_path: Path) -> None:
    plan, told = plan_of(2), []
    with device.SimulatedDevice(session) as simulated:
        assert carry_out(simulated.port, tmp_path / "out", plan, told) == []
    recorded = Session.open(tmp_path / "out")
    assert plan.missing_in(recorded.runs) == []
    assert [(r.scenario, r.face, r.day) for r in recorded.runs] == [(p.scenario, p.face, 2) for p in plan.runs]
    for run in recorded.runs:
        assert run.duration_s == pytest.approx(4.0, abs=0.02)
    assert [line.split(":")[0] for line in told] == [f"run {k} of 4" for k in range(1, 5)]
    assert ["new power cycle" in line for line in told] == [True, False, True, False]


def test_an_interrupted_plan_goes_on(require_tool: Callable[[str], str], tmp_path: Path) -> None:
    """The first device has one power cycle of the plan's two; nothing is recorded twice."""
    require_tool("cc")
    out, plan = tmp_path / "out", plan_of(2)
    one = two_faces(seconds=7.0, scenarios=1)
    with device.SimulatedDevice(one) as simulated, pytest.raises(DeviceError, match="2 planned"):
        carry_out(simulated.port, out, plan, [])
    assert plan.missing_in(Session.open(out).runs) == list(plan.runs[2:])
    told: list[str] = []
    with device.SimulatedDevice(two_faces(seconds=7.0, scenarios=1, seed=6)) as simulated:
        assert carry_out(simulated.port, out, plan, told) == []
    assert told[0].startswith("run 3 of 4: new power cycle s001")
    assert [r.scenario for r in Session.open(out).runs] == ["s000", "s000", "s001", "s001"]


def test_runs_that_are_not_planned_are_passed_over(session: Session, tmp_path: Path) -> None:
    down = PlannedRuns((PlannedRun("z", "down", 78.0, 3.0, None, "s000"),))
    told: list[str] = []
    with device.SimulatedDevice(session) as simulated:
        assert carry_out(simulated.port, tmp_path / "out", down, told) == []
    assert [r.face for r in Session.open(tmp_path / "out").runs] == ["down"]
    assert any("another run than planned" in line for line in told)


def test_a_device_that_waits_is_given_the_settings_of_each_run(tmp_path: Path) -> None:
    plan = PlannedRuns((PlannedRun("x", "up", -30.5, 0.3, 40.0, "s007"),))
    told: list[str] = []

    with PressedDevice() as fake:
        assert carry_out(fake.port, tmp_path / "out", plan, told) == []
        assert fake.settings == {"axis": "x", "table_dps": "-30.5", "turn_deg": "0"}
        assert not any(command.startswith("start") for command in fake.commands)
    run = Session.open(tmp_path / "out").runs[0]
    assert (run.face, run.axis, run.table_rate_dps, run.scenario) == ("up", "x", -30.5, "s007")
    assert "chamber at 40 °C" in told[0]


def test_the_command_says_what_it_recorded(session: Session, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "plan.toml", tmp_path / "out"
    plan_of(1).save(file)
    with device.SimulatedDevice(session) as simulated:
        assert main(["record", str(out), "--port", simulated.port, "--plan", str(file), "--json"]) == 0
    said = capsys.readouterr()
    assert [run["face"] for run in json.loads(said.out)["runs"]] == list(FACES)
    assert "run 1 of 2" in said.err
    assert main(["record", str(out), "--port", "nowhere", "--plan", str(file), "--face", "up"]) == 2


def test_the_instruction_is_complete() -> None:
    words = instruction(PlannedRun("y", "down", 0.0, 20.0, -5.0, "s009"), new_cycle=True)
    for part in ("s009", "off and on", "axis y", "face down", "at rest", "-5 °C", "20 s"):
        assert part in words
