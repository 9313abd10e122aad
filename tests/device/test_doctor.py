"""The doctor on a simulated board that lies still: a sound one passes, and each fault fails its own check with advice."""

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.device.doctor import Check, Doctor, Heard, _clock, _noise
from gyrocal.device.find import find_port
from gyrocal.device.monitor import self_test_words
from gyrocal.device.port import Link
from gyrocal.device.simulated import SimulatedDevice, simulated_scenario
from gyrocal.device.wire import Sentence
from gyrocal.errors import DeviceError
from gyrocal.recording.session import Session

from .fake import FakeDevice

SECONDS = 2.0
ALL = [
    "device", "sensor", "self-test", "losses", "rate", "clock", "noise", "gravity", "temperature", "time",
    "kept over a restart",
]  # fmt: skip


@pytest.fixture(scope="module")
def scenario(require_tool: Callable[[str], str]) -> Session:
    require_tool("cc")
    return simulated_scenario([], 0)


def examine(session: Session, faults: tuple[str, ...] = (), *, restart: bool = True, part: str = "LSM6DSO") -> dict[str, Check]:
    with SimulatedDevice(session, speed=1, bench=True, faults=faults, part=part) as board, Link(board.port) as link:
        checks = Doctor(link, SECONDS, restart=restart).run()
    return {check.name: check for check in checks}


def sound(checks: dict[str, Check]) -> bool:
    """On a busy machine the clocks cannot be compared, which the check says."""
    return all(check.ok is True or (name == "clock" and check.ok is None) for name, check in checks.items())


def wrong(checks: dict[str, Check]) -> set[str]:
    return {name for name, check in checks.items() if check.ok is False}


def test_a_sound_board_passes(scenario: Session) -> None:
    found = examine(scenario)
    assert sound(found), found
    assert list(found) == ALL
    assert "x 400, y 400, z 400 dps" in found["self-test"].found
    assert all(check.advice == "" for check in found.values())


FAULTS = [
    ("nack@0:9999", "sensor", "bus_nack"),
    ("wrong_id", "sensor", "wrong_id"),
    ("stuck_mass", "self-test", "failed: it moved x"),
    ("garbled@0:9999", "losses", "damaged on the wire"),
    ("busy@3:1", "losses", "missed by the board"),
    ("spikes@0:9999", "noise", "dps, usual"),
    ("frozen@0:9999", "noise", "x 0.000"),
]
OF_MAKERS = [
    (
        "ICM-42688-P",
        "it moved x 92, y 88, z 97 dps, the maker wants x 44 or more, y 42 or more, z 46 or more; "
        "at rest x 0.0, y 0.0, z 0.0 dps, at most 20",
    ),
    ("MPU-6050", "it moved x 43, y -54, z 38 dps, the maker wants x 35 to 47, y 44 to 59, z 31 to 41"),
    ("BMI270", "passed"),
]


@pytest.fixture(scope="module")
def examined(scenario: Session) -> dict[str, dict[str, Check]]:
    """The checks of a board by its fault or its part. An examination waits most of its time: three run at once."""
    boards = [(fault, (fault,), "LSM6DSO") for fault, *_ in FAULTS] + [(part, (), part) for part, _ in OF_MAKERS]
    with ThreadPoolExecutor(3) as pool:
        found = pool.map(lambda board: examine(scenario, board[1], restart=False, part=board[2]), boards)
        return {name: checks for (name, *_), checks in zip(boards, found, strict=True)}


@pytest.mark.parametrize(("fault", "check", "said"), FAULTS)
def test_a_fault_fails_its_check_with_advice(
    examined: dict[str, dict[str, Check]], fault: str, check: str, said: str
) -> None:
    found = examined[fault]
    assert check in wrong(found), found
    assert said in found[check].found
    assert found[check].advice


@pytest.mark.parametrize(("jumps_s", "busy_s", "ok"), [(0.0, 0.0, True), (0.5, 0.0, False), (0.0, 0.02, True), (0, 0.2, None)])
def test_the_clocks_are_compared_as_far_as_this_computer_can(jumps_s: float, busy_s: float, ok: bool | None) -> None:
    """Samples of 10 s that come in bundles; the board's clock jumps in the middle, or this machine reads them late."""
    rng, heard, late_s = np.random.default_rng(3), Heard(), 0.0
    for n in range(1450):
        t_s = n / 145 + (jumps_s if n > 700 else 0.0)
        heard.raw.append(Sentence("RAW", n, round(1e6 * t_s), 0, f"{n},0,0,0,0,0,0,0"))
        late_s = 0.001 + busy_s * rng.random() if n % 7 == 0 else late_s
        heard.arrived_s.append((n // 7 * 7 + 6) / 145 + late_s)
    assert _clock(0, heard).ok is ok


@pytest.mark.parametrize(("low_pass", "sd_counts", "ok"), [("0", 5, True), ("0", 1, False), ("8", 1, True), ("8", 20, False)])
def test_less_noise_than_usual_is_what_a_low_pass_is_for(low_pass: str, sd_counts: float, ok: bool) -> None:
    rng = np.random.default_rng(0)
    heard = Heard(hello={"lsb_dps": "0.00875", "noise_dps": "0.0448", "rate_hz": "145", "low_pass": low_pass})
    for n in range(290):
        counts = ",".join(str(round(sd_counts * x)) for x in rng.normal(size=3))
        heard.raw.append(Sentence("RAW", n, 6897 * n, 0, f"{n},{counts},0,0,16393,0"))
    assert _noise(0, heard).ok is ok


@pytest.mark.parametrize(("part", "said"), OF_MAKERS)
def test_the_self_test_of_other_makers(examined: dict[str, dict[str, Check]], part: str, said: str) -> None:
    found = examined[part]
    assert found["self-test"].ok is True
    assert said in found["self-test"].found
    assert wrong(found) == set()


def test_a_missing_code_of_the_factory_is_told() -> None:
    limits: dict[str, object] = {f"least_{axis}_dps": None if axis == "y" else 40.0 for axis in "xyz"}
    words = self_test_words({"passed": 0, "x_dps": 80, "y_dps": 80, "z_dps": 80, **limits, "most_dps": None})
    assert words.startswith("failed: it moved x 80, y 80, z 80 dps, the maker wants x 40 or more, y a code of the factory,")


def test_a_sensor_without_a_self_test_is_no_fault() -> None:
    """A part of one's own, for example."""

    class WithoutOne:
        def command(self, words: str) -> None:
            raise DeviceError(f"{words} refused: this sensor has no self-test that the firmware knows")

    (check,) = Doctor(WithoutOne())._self_test()  # type: ignore[arg-type]
    assert check.ok is None
    assert check.found == "this sensor has no self-test that the firmware knows"


def test_the_setting_is_as_before(scenario: Session) -> None:
    with SimulatedDevice(scenario, speed=1, bench=True) as board, Link(board.port) as link:
        link.greet()
        link.command("set table_dps -12.5")
        checks = Doctor(link, SECONDS).run()
        assert next(check for check in checks if check.name == "kept over a restart").ok is True
        assert link.command("get table_dps").fields["table_dps"] == "-12.5"


def test_the_command_prints_a_line_a_check(scenario: Session, capsys: pytest.CaptureFixture[str]) -> None:
    with SimulatedDevice(scenario, speed=1, bench=True, faults=["stuck_mass"]) as board:
        assert main(["doctor", "--port", board.port, "--seconds", "2", "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["ok"] is False
    assert [check["name"] for check in answer["checks"]] == ALL
    assert [check["name"] for check in answer["checks"] if check["ok"] is False] == ["self-test"]


def test_a_device_is_found_among_the_ports() -> None:
    with FakeDevice() as fake:
        assert find_port("auto", ports=lambda: ["socket://127.0.0.1:1", fake.port]) == fake.port
    assert find_port("/dev/ttyUSB7") == "/dev/ttyUSB7"


def test_no_port_and_no_device_are_told() -> None:
    with pytest.raises(DeviceError, match="no serial port: plug the board in"):
        find_port("auto", ports=list, network=list)
    with pytest.raises(DeviceError, match="no gyrocal device answers: socket:"):
        find_port("auto", ports=lambda: ["socket://127.0.0.1:1"], network=list)


def test_a_run_that_begins_meanwhile_is_told_and_ends_the_examination(scenario: Session) -> None:
    """A simulated device that replays its runs by itself is no fault of a board, and no error of the port."""
    with SimulatedDevice(scenario, speed=8) as board, Link(board.port) as link:
        checks = {check.name: check for check in Doctor(link, SECONDS).run()}
    assert wrong(checks) == {"idle"}
    assert "--bench" in checks["idle"].advice


@pytest.mark.parametrize(
    ("up", "turns", "ok", "said"),
    [
        ((0, 0, 1), (0, 0, 90), True, "+z points up, it turned x +0, y +0, z +90 deg"),
        ((0, -1, 0), (3, -88, -5), True, "-y points up"),
        ((0, 0, 1), (0, 0, -90), False, "a sign is wrong"),
        ((0, 0, 1), (90, 0, 4), False, "axes are exchanged"),
        ((0, 0, 1), (5, 0, 12), None, "nobody turned it"),
    ],
)
def test_a_turn_by_hand_shows_axes_and_signs(
    up: tuple[int, ...], turns: tuple[int, ...], ok: bool | None, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A board with a bias of 2 dps on each axis lies still, then turns by these angles within a second."""
    monkeypatch.setattr("gyrocal.device.doctor.TURN_S", 1.0)
    gravity, bias = [round(each / 6.1e-05) for each in up], round(2 / 0.00875)

    def raw(n: int, rates_dps: tuple[float, ...]) -> None:
        gyro = [bias + round(rate / 0.00875) for rate in rates_dps]
        fake.say("RAW", [-1, *gyro, *gravity, 256], t_us=1_000_000 + 10_000 * n)

    def turned(words: str) -> None:
        assert "left" in words
        for n in range(200, 350):
            raw(n, turns if 220 <= n < 320 else (0, 0, 0))

    with FakeDevice() as fake, Link(fake.port) as link:
        link.greet()
        doctor = Doctor(link, ask=turned)
        doctor._take_for(0.1)
        doctor.sensors = {0: Heard(hello={"lsb_dps": "0.00875"})}
        for n in range(100):
            raw(n, (0, 0, 0))
        doctor._take_for(0.3)
        (check,) = doctor._turned(turned)
    assert check.ok is ok, check
    assert said in check.found + check.advice
