"""The monitor: a line an event, samples in units, counts of what was lost; a screen that holds it all."""

import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.device import simulated as device
from gyrocal.device.monitor import Event, Monitor, Sensor
from gyrocal.device.port import Link
from gyrocal.device.wire import encode
from gyrocal.recording.session import Session

from .conftest import two_faces
from .fake import FakeDevice


def test_events_of_a_replay(session: Session, capsys: pytest.CaptureFixture[str]) -> None:
    with device.SimulatedDevice(session) as simulated:
        assert main(["monitor", "--port", simulated.port, "--json"]) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    samples = [e for e in events if e["event"] == "sample"]
    expected = np.concatenate([run.gyro_dps for run in session.runs])
    assert np.allclose([[e[f"g{a}_dps"] for a in "xyz"] for e in samples], expected, atol=1e-8)
    assert np.allclose([e["temp_c"] for e in samples], np.concatenate([run.temp_c for run in session.runs]))
    assert {e["event"] for e in events} >= {"hello", "run", "result", "state", "sample", "end"}
    results = [e for e in events if e["event"] == "result" and e["method"] == "baseline"]
    assert [e["seconds"] for e in results] == [2, 4, 6] * 2
    assert all(isinstance(e["scale"], float) and isinstance(e["last"], int) for e in results)
    assert events[-1]["event"] == "end"
    assert (events[-1]["lost"], events[-1]["bad"], events[-1]["restarts"]) == (0, 0, 1)


def test_a_replay_misses_what_its_runs_lack_and_no_more(session: Session, capsys: pytest.CaptureFixture[str]) -> None:
    """Each run lacks four samples. The time between two runs, which the simulator skips at full speed, is no loss."""
    for speed in ("max", "20"):
        with device.SimulatedDevice(session, speed=speed) as simulated:
            assert main(["monitor", "--port", simulated.port, "--json"]) == 0
        events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        missed = [e["missed"] for e in events if e["event"] == "state"]
        assert missed
        assert set(missed) <= {0, 4, 8}


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_the_rate_is_that_of_the_device_however_fast_it_plays(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    """A device of 145 Hz that played four times faster had "580 samples a second"."""
    sensor, now = Sensor(), [0.0]
    monkeypatch.setattr("gyrocal.device.monitor.time.monotonic", lambda: now[0])
    for first in range(0, 1450, 10):
        sensor.take([{"t_us": round(1e6 * n / 145), "n": n} for n in range(first, first + 10)])
        now[0] = (first + 10) / 145 / speed
    assert sensor.rate_hz() == pytest.approx(145.0, rel=0.01)
    sensor.take([{"t_us": 100, "n": 0}])  # it has started again
    assert sensor.rate_hz() == 0.0
    now[0] += 10.0
    assert sensor.rate_hz() == 0.0


def test_it_ends_with_its_time(session: Session, capsys: pytest.CaptureFixture[str]) -> None:
    with device.SimulatedDevice(session, speed=1) as simulated:
        assert main(["monitor", "--port", simulated.port, "--seconds", "0.6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["reason"] == "the time is over"


def test_the_screen_shows_state_results_and_losses() -> None:
    from rich.console import Console

    with FakeDevice() as fake, Link(fake.port) as link:
        monitor = Monitor(link)
        pictures = []

        def heard(events: list[Event]) -> None:
            if fake.answered < 3:
                return  # it still numbers the sentences of its answers
            if not pictures:
                fake.run_sentence("start", "down")
                fake.sample(0)
                fake.seq += 3
                fake.say("CAL", {"method": "baseline", "seconds": 2.0, "axis": "z", "scale": 0.00412, "scale_se": 2e-5,
                                 "bias_dps": -0.0567, "bias_se_dps": 0.001, "temp_c": 24.5, "misfit": 7.5})  # fmt: skip
                fake.say("STA", {"state": "recording", "face": "down", "n": 1, "missed": 5})
                fake.say("ERR", {"code": -9, "name": "clipped", "advice": "set_full_scale_dps_higher"})
            console = Console(file=io.StringIO(), width=120)
            console.print(monitor.screen())
            pictures.append(console.file.getvalue())  # type: ignore[attr-defined]

        monitor.run(heard, seconds=3.0)
    numbers = ("77.998", "0.4120 ± 0.0020", "-0.0567 ± 0.0010", "7.50", "3 lost", "5 missed")
    for part in ("recording down", *numbers, "clipped (-9)"):
        assert part in pictures[-1]


def test_a_run_that_begins_does_not_have_the_length_of_the_last() -> None:
    with FakeDevice() as fake, Link(fake.port) as link:
        monitor, seen = Monitor(link), list[tuple[str, float]]()

        def heard(events: list[Event]) -> None:
            if fake.answered < 3:
                return
            if not seen:
                fake.run_sentence("start", "up")
                fake.sample(870)
                fake.run_sentence("end", "up")
                fake.run_sentence("start", "down")
            sensor = monitor.sensors.get(0)
            seen.append(("", -1.0) if sensor is None else (sensor.state, sensor.run_s()))

        monitor.run(heard, seconds=2.0)
    assert seen[-1] == ("recording", 0.0)


class Deaf:
    """A port to which nobody is connected."""

    def read(self) -> bytes:
        return b""

    def write(self, data: bytes) -> None:
        pass

    def close(self) -> None:
        pass


RESULT = {"method": "baseline", "axis": "z", "scale": 0.004, "scale_se": 2e-5, "bias_dps": -0.05, "bias_se_dps": 1e-3,
          "temp_c": 24.5, "misfit": 1.0, "flags": "misfit+constant_reading", "trusted": 0}  # fmt: skip
TABLE_RATE = {"code": -37, "name": "table_rate", "advice": "check_the_table_or_set_table_dps"}


def test_the_screen_tells_what_was_before_a_restart() -> None:
    """Errors have the device's time and a count, and settings their names; what came before a restart is marked so."""
    from rich.console import Console

    monitor = Monitor(Link("none", opener=lambda name, baud: Deaf()))

    def lines(*sentences: tuple[int, int, str, dict[str, Any]]) -> list[str]:
        text = b"".join(encode(tag, seq, t_us, 0, fields) for seq, t_us, tag, fields in sentences)
        monitor._digest(monitor.link.reader.feed(text))
        console = Console(file=io.StringIO(), width=110)
        console.print(monitor.screen())
        return console.file.getvalue().splitlines()  # type: ignore[attr-defined]

    hello = {"proto": 1, "fw": "1", "sensor": "LSM6DSO", "rate_hz": 145, "full_scale_dps": 250}
    first = lines(
        (0, 1000, "HEL", hello), (1, 2_000_000, "CAL", {**RESULT, "seconds": 2.0}),
        (2, 3_000_000, "CAL", {**RESULT, "seconds": 4.0}),
        (3, 4_000_000, "ERR", TABLE_RATE), (4, 5_500_000, "ERR", TABLE_RATE),
    )  # fmt: skip
    assert "    5.500 s  table_rate (-37): check the table or set table_dps (2 times)" in first
    assert sum("misfit constant_reading" in line for line in first) == 2, "flags are neither cut nor wrapped"
    again = lines((0, 1000, "HEL", hello), (1, 2_000_000, "CAL", {**RESULT, "seconds": 2.0, "flags": ""}))
    assert "1 restart" in again[0]
    assert "before restart: table_rate (-37): check the table or set table_dps (2 times)" in again
    rows = "".join(again).partition("before restart: ")[0].split("baseline")[1:]
    assert ["before restart" in row for row in rows] == [False, True]


def test_unplugging_heals_where_asked() -> None:
    with FakeDevice() as fake, Link(fake.port, reconnect=True) as link:
        seen: list[Event] = []

        def heard(events: list[Event]) -> None:
            seen.extend(events)
            if len(fake.commands) == 3 and fake.connections == 1:
                fake.unplug()

        Monitor(link).run(heard, seconds=2.0)
        assert fake.connections == 2
        assert fake.commands == ["hello", "stream raw", "status"] * 2
    assert [e["event"] for e in seen].count("hello") == 2


def test_each_sensor_of_a_board_has_its_own(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    parts = [two_faces(7.0, scenarios=1, seed=seed) for seed in (5, 6)]
    samples: list[Event] = []
    with device.SimulatedDevice(parts) as simulated, Link(simulated.port) as link:
        monitor = Monitor(link)
        monitor.run(lambda events: samples.extend(e for e in events if e["event"] == "sample"))
        assert (link.reader.lost, link.reader.bad) == (0, 0)
    assert sorted(monitor.sensors) == [0, 1]
    for imu, part in enumerate(parts):
        mine = [[e[f"g{a}_dps"] for a in "xyz"] for e in samples if e["imu"] == imu]
        assert np.allclose(mine, np.concatenate([run.gyro_dps for run in part.runs]), atol=1e-8)
        sensor = monitor.sensors[imu]
        assert (sensor.samples, sensor.face, sensor.hello["sensor"]) == (len(mine), "down", "LSM6DSO")
        alone = [s.real("scale") for s in device.replay(part) if s.tag == "CAL" and s.fields["method"] == "baseline"]
        assert [sensor.results["z", "baseline", seconds]["scale"] for seconds in (2, 4, 6)] == alone
