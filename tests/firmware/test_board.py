"""The port itself runs: its tasks, buses, interrupts, flash and light on a board in virtual time (the folder board)."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.device.wire import Reader, Sentence, raw_table
from gyrocal_firmware import CORE, INCLUDE, SIM, SRC

HERE = Path(__file__).parent
SANITIZE = ["-g", "-O1", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
PINS = ["-DGYROCAL_SDA=21", "-DGYROCAL_SCL=22", "-DGYROCAL_SDA2=17", "-DGYROCAL_SCL2=16", "-DGYROCAL_LED=13"]
CHIPS = [f"0 chip {i}" for i in range(4)]
UP = [8950 + 10 * i for i in range(4)]
DOWN = [-8960 - 10 * i for i in range(4)]

Play = Callable[..., str]


def compile_board(folder: Path, gxx: str, gcc: str, *more: str) -> Path:
    folders = [f"-I{f}" for f in (SRC, CORE, INCLUDE, SIM, HERE / "arduino")]
    common = [*SANITIZE, *PINS, *more, *folders, "-c"]
    core = [*CORE.rglob("*.c"), SIM / "emul_lsm6dso.c", SRC / "headers.c"]
    subprocess.run([gcc, "-std=gnu99", *common, *map(str, core)], cwd=folder, check=True)
    sources = [*SRC.glob("*.cpp"), *(HERE / "board").glob("*.cpp")]
    subprocess.run([gxx, "-std=gnu++14", *common, *map(str, sources)], cwd=folder, check=True)
    program = folder / "board"
    objects = sorted(map(str, folder.glob("*.o")))
    subprocess.run([gxx, *SANITIZE, *objects, "-pthread", "-lm", "-o", str(program)], check=True)
    return program


@pytest.fixture(scope="module")
def play(require_tool: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory) -> Play:
    """`play(script, seconds, flash, wired)`: what the port writes to its serial port, and its light."""
    gxx, gcc = require_tool("g++"), require_tool("gcc")
    built: dict[bool, Path] = {}

    def run(script: list[str], seconds: float, flash: Path | None = None, wired: bool = False) -> str:
        if wired not in built:
            folder = tmp_path_factory.mktemp("board")
            built[wired] = compile_board(folder, gxx, gcc, *(["-DGYROCAL_INT1=27"] if wired else []))
        flash = flash or tmp_path_factory.mktemp("flash") / "flash"
        text = "\n".join(sorted(script, key=lambda line: float(line.split()[0]))) + "\n"
        done = subprocess.run(
            [built[wired], str(flash), str(seconds)], input=text, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr[-3000:] + done.stdout[-1000:]
        return done.stdout

    return run


def sentences(text: str, tag: str | None = None, imu: int | None = None) -> list[Sentence]:
    """What was said, every line whole."""
    reader = Reader()
    said = reader.feed(text.encode())
    assert (reader.bad, reader.overlong) == (0, 0)
    return [s for s in said if tag in (None, s.tag) and imu in (None, s.imu)]


def values(text: str, tag: str, name: str) -> list[str]:
    return [s.fields[name] for s in sentences(text, tag)]


def turn(at_s: float, counts: list[int]) -> list[str]:
    """All sensors see the table turn from now on, each with a scale of its own."""
    return [f"{at_s} world {i} 0 0 0 {n} 0 0 {16393 if n > 0 else -16393}" for i, n in enumerate(counts)]


def pair(count: int = 4) -> list[str]:
    return [
        *CHIPS[:count], *turn(0, UP), "1 > start up", "7.5 > stop", *turn(8, DOWN), "8.5 > start down", "15 > stop",
    ]  # fmt: skip


def test_four_sensors_on_two_buses_calibrate_each_for_itself(play: Play, tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    text = play([*pair(), "0.8 > stream raw"], 16, flash)
    assert {s.imu for s in sentences(text)} == {0, 1, 2, 3}
    assert not sentences(text, "ERR")
    for imu in range(4):
        assert [s.seq for s in sentences(text, imu=imu)] == list(range(len(sentences(text, imu=imu))))  # none is lost
        answers = sentences(text, "CAL", imu)
        told = [(s.fields["method"], s.real("seconds")) for s in answers]
        assert told == [(m, t) for t in (2, 4, 6) for m in ("baseline", "cnn")]
        scale, scale_se = answers[4].real("scale"), answers[4].real("scale_se")
        assert scale == pytest.approx((UP[imu] - DOWN[imu]) * 0.00875 / 156 - 1, abs=5 * (scale_se or 0))
        table = raw_table(sentences(text, "RAW", imu))
        for from_us, to_us in ((0, 7.4e6), (8e6, 14.9e6)):  # until the first of them writes its results
            steps = np.diff(table.t_us[(table.number >= 0) & (table.t_us > from_us) & (table.t_us < to_us)])
            assert len(steps) > 900
            assert np.abs(steps - 1e6 / 145).max() < 1500  # two sensors wait for one bus

    again = play([*CHIPS, *turn(0, UP), "1 > dump", "4 > stream corrected"], 4.5, flash)
    for imu in range(4):
        assert [s.text for s in sentences(again, "OLD", imu)] == [s.text for s in sentences(text, "CAL", imu)]
        rates = [float(s.text.split(",")[3]) for s in sentences(again, "GYR", imu)]
        assert np.mean(rates) == pytest.approx(78.0, abs=0.05)


def test_a_sensor_keeps_its_number_by_bus_and_address(play: Play) -> None:
    text = play(["0 chip 1", "0 chip 2", *turn(0, UP), "1 > stream raw"], 2)
    assert {s.imu for s in sentences(text)} == {1, 2}
    for imu in (1, 2):
        table = raw_table(sentences(text, "RAW", imu))
        assert table.counts[:, 2].mean() == pytest.approx(UP[imu], abs=2)


def test_with_a_sensor_missing_the_others_keep_what_is_theirs(play: Play, tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    said = play(pair(2), 16, flash)
    alone = play([CHIPS[1], *turn(0, UP), "1 > dump", "4 > stream corrected"], 5, flash)
    assert {s.imu for s in sentences(alone)} == {1}
    assert [s.text for s in sentences(alone, "OLD")] == [s.text for s in sentences(said, "CAL", 1)]
    rates = [float(s.text.split(",")[3]) for s in sentences(alone, "GYR", 1)]
    assert np.mean(rates) == pytest.approx(78.0, abs=0.05)


def test_the_interrupt_line_belongs_to_its_sensor(play: Play) -> None:
    """The pin is wired to the first sensor; the second, alone, is asked as if there were no pin."""
    text = play(["0 chip 1", *turn(0, UP), "1 > set rate_hz 104", "2 > stream raw"], 4, wired=True)
    steps = np.diff(raw_table(sentences(text, "RAW", 1)).t_us)
    assert len(steps) > 190
    assert np.abs(steps - 1e6 / 104).max() < 300
    assert not sentences(text, "ERR")


def test_records_of_the_order_of_answering_are_used_for_nobody(play: Play, tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    play(pair(2), 16, flash)
    content = flash.read_bytes()
    assert content.count(b"gyrocal/bus0_6B/") > 2
    older = content.replace(b"gyrocal/bus0_6B/", b"gyrocal/imu0/").replace(b"gyrocal/bus0_6A/", b"gyrocal/imu1/")
    flash.write_bytes(older)
    text = play([*CHIPS[:2], *turn(0, UP), "1 > dump", "2 > set table_dps 30"], 3, flash)
    assert values(text, "ACK", "cmd").count("dump") == 2
    assert not sentences(text, "OLD")
    assert b"/imu" not in flash.read_bytes()


def test_a_bus_that_is_held_at_power_on_is_clocked_free_before_the_scan(play: Play) -> None:
    """A board that restarts in the middle of a reading leaves a part that holds SDA."""
    text = play([*CHIPS, "0 hold 0", "0 hold 3", *turn(0, UP), "1 > status"], 2)
    assert {s.imu for s in sentences(text, "STA")} == {0, 1, 2, 3}
    assert not sentences(text, "ERR")


def test_commands_are_heard_while_samples_flood_the_wire(play: Play) -> None:
    """Four sensors at 833 Hz say twice what the wire carries."""
    script = [*CHIPS, *turn(0, UP), "0.5 > set rate_hz 416", "1 > stream raw", "3 > status", "4 > stream off", "5 > status"]
    text = play([*script, "0.6 > set fifo 16", "0.8 > set rate_hz 833"], 6)
    for imu in range(4):
        commands = [s.fields["cmd"] for s in sentences(text, "ACK", imu)]
        assert commands == ["set", "set", "set", "stream", "status", "stream", "status"]
        before, after = (int(s.fields["lost"]) for s in sentences(text, "STA", imu))
        said = sentences(text, imu=imu)
        assert after > before > 0
        assert said[-1].seq + 1 - len(said) == after  # whole sentences were dropped, and counted
        assert max(s.t_us for s in sentences(text, "RAW", imu)) < 4.3e6


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("task", "no memory for its task"),
        ("flash", "its flash cannot be opened"),
        ("wire", "bus 0 cannot be started"),
    ],
)
def test_what_the_board_refuses_is_told(play: Play, what: str, says: str) -> None:
    text = play([f"0 fail {what}", *CHIPS[:1], *turn(0, UP), "1 > status"], 2)
    assert says in text
    assert bool(sentences(text, "STA")) == (what != "task")


def test_a_board_without_a_sensor_says_so_and_finds_it_later(play: Play) -> None:
    text = play(["3 chip 0", *turn(0, UP), "6 > status", "6 > stream raw"], 7)
    assert set(values(text, "ERR", "name")) == {"bus_nack"}
    assert int(values(text, "STA", "resets")[0]) >= 3
    assert len(sentences(text, "RAW")) == pytest.approx(145, abs=3)


def test_a_bus_that_is_held_low_is_clocked_free(play: Play) -> None:
    text = play([*CHIPS, *turn(0, UP), "1 > stream raw", "2 hold 2", "4 > status"], 5)
    errors = {(s.imu, s.fields["name"]) for s in sentences(text, "ERR")}
    assert errors
    assert errors <= {(2, "bus_nack"), (3, "bus_nack")}
    assert values(text, "STA", "resets") == ["0"] * 4
    assert max(map(int, values(text, "STA", "missed"))) < 3


def test_the_interrupt_line_times_samples_and_batches(play: Play) -> None:
    script = ["0 chip 0", *turn(0, UP), "1 > set rate_hz 104", "2 > stream raw", "4 > status"]
    text = play(script, 5, wired=True)
    t_us = raw_table(sentences(text)).t_us
    assert np.abs(np.diff(t_us) - 64e6 / 6667).max() < 60  # found by asking, it would be 100 and more
    assert (values(text, "STA", "stale"), values(text, "STA", "missed")) == (["0"], ["0"])

    text = play([*script, "1.5 > set fifo 16"], 5, wired=True)
    t_us = raw_table(sentences(text)).t_us
    np.testing.assert_allclose(np.diff(t_us), 64e6 / 6667, atol=2.0)
    assert len(t_us) == pytest.approx(3 * 104, abs=20)
    assert values(text, "STA", "missed") == ["0"]
    assert not sentences(text, "ERR")


def test_flash_writes_of_one_sensor_cost_another_nothing_with_the_fifo(play: Play) -> None:
    """The first sensor's results are written at its run's end, 20 ms a write, while the other's samples go on."""
    script = [*CHIPS[:2], *turn(0, UP), "0.5 > set rate_hz 208", "1 > start up", "3 > status", "4 > stop", "5 > status"]

    def missed(text: str) -> list[int]:
        counts = [[int(s.fields["missed"]) for s in sentences(text, "STA", imu)] for imu in (0, 1)]
        return [after - before for before, after in counts]

    assert max(missed(play(script, 6))) > 2
    text = play([*script, "0.8 > set fifo 16"], 6)
    assert missed(text) == [0, 0]
    assert not sentences(text, "ERR")


def test_the_light_shows_the_sensor_that_is_furthest_behind(play: Play) -> None:
    text = play(pair(2), 20)
    changes = [(float(w[2]), w[3] == "1") for w in (line.split() for line in text.splitlines() if line.startswith("# light"))]

    def lit(at_s: float) -> bool:
        return [on for t_s, on in changes if t_s <= at_s][-1]

    assert all(lit(t) for t in np.arange(2, 7, 0.05))  # recording
    flip = "".join("x" if lit(t) else "." for t in np.arange(7.5625, 8.4, 0.125))
    assert flip in "x.x.x.x.x."
    done = np.array([lit(t) for t in np.arange(16.01, 20, 0.05)])  # 1 s on, 1 s off
    assert done.mean() == pytest.approx(0.5, abs=0.05)
    assert np.count_nonzero(np.diff(done.astype(int))) == pytest.approx(4, abs=1)
