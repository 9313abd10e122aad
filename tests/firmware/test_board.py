"""The port itself runs: its tasks, buses, interrupts, flash and light on a board in virtual time (the folder board)."""

from pathlib import Path

import numpy as np
import pytest

from gyrocal.device.wire import raw_table

from .conftest import CHIPS, DOWN, UP, WIRED, Play, pair, sentences, turn, values


@pytest.mark.wide
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


@pytest.mark.wide
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


@pytest.mark.wide
def test_the_interrupt_line_belongs_to_its_sensor(play: Play) -> None:
    """The pin is wired to the first sensor; the second, alone, is asked as if there were no pin."""
    text = play(["0 chip 1", *turn(0, UP), "1 > set rate_hz 104", "2 > stream raw"], 4, None, WIRED)
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


def test_a_command_arrives_although_one_sensor_fills_the_wire(play: Play) -> None:
    """1666 samples a second are more than the wire carries."""
    long = "0 world 0 -2000 -12345 -12345 8950 -12345 -12345 16393"
    script = [CHIPS[0], long, "0.3 > set rate_hz 416", "0.5 > set fifo 16", "0.8 > set rate_hz 1666"]
    text = play([*script, "1 > stream raw", "4 > stream off", "5 > status"], 6)
    assert values(text, "ACK", "cmd") == ["set", "set", "set", "stream", "stream", "status"]
    assert int(values(text, "STA", "lost")[0]) > 500
    assert max(s.t_us for s in sentences(text, "ACK") if s.fields["cmd"] == "stream") < 4.3e6
    assert max(s.t_us for s in sentences(text, "RAW")) < 4.3e6


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("task", "no memory for its task"),
        ("flash", "its flash cannot be opened"),
        ("flash", "no partition gyrocal"),
        ("wire", "bus 0 cannot be started"),
    ],
)
def test_what_the_board_refuses_is_told(play: Play, what: str, says: str) -> None:
    text = play([f"0 fail {what}", *CHIPS[:1], *turn(0, UP), "1 > status"], 2)
    assert text.count(says) == 1
    assert bool(sentences(text, "STA")) == (what != "task")


def test_flash_without_free_pages_is_erased_and_used(play: Play, tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    text = play(["0 fail nvs", *pair(1)], 16, flash)
    assert "the flash for results is erased (ESP_ERR_NVS_NO_FREE_PAGES)" in text
    assert "partition" not in text
    again = play([CHIPS[0], *turn(0, UP), "1 > dump"], 4, flash)
    assert [s.text for s in sentences(again, "OLD")] == [s.text for s in sentences(text, "CAL")]


def test_the_first_sentence_is_behind_the_reason_of_the_reset(play: Play) -> None:
    """The log of the ROM is noise at this speed and has no newline."""
    for reason, name in ((1, "power-on"), (9, "brown-out"), (6, "watchdog of a task"), (77, "unknown")):
        text = play([f"0 reset {reason}", CHIPS[0]], 0.5)
        _, line, *rest = text.split("\n")
        assert line.startswith("# gyrocal ")
        assert f", reset reason {reason}, {name}" in line
        assert next(said for said in rest if not said.startswith("# light")).startswith("$HEL,0,")


def test_a_board_without_a_sensor_says_so_and_finds_it_later(play: Play) -> None:
    text = play(["3 chip 0", *turn(0, UP), "6 > status", "6 > stream raw"], 7)
    assert text.count("# no sensor answers at SDA 21, SCL 22") == 1
    assert set(values(text, "ERR", "name")) == {"bus_nack"}
    assert int(values(text, "STA", "resets")[0]) >= 3
    assert len(sentences(text, "RAW")) == pytest.approx(145, abs=3)


def test_the_pins_of_another_board_are_recognised(play: Play) -> None:
    """The two Thing Plus look alike: this one has the firmware of the other."""
    text = play(["0 pins 23 22", "0 chip 1"], 2)
    assert "# no sensor answers at SDA 21, SCL 22, but one does at SDA 23, SCL 22: flash -e thing_plus_micro_b\n" in text
    assert set(values(text, "ERR", "name")) == {"bus_nack"}


def test_a_sensor_that_comes_later_is_taken_up(play: Play) -> None:
    text = play([CHIPS[0], "3 chip 1", "4 chip 3", *turn(0, UP), "6 > status"], 7)
    assert {s.imu for s in sentences(text, "STA")} == {0, 1, 3}
    assert not sentences(text, "ERR")
    text = play([CHIPS[0], *turn(0, UP), "1 > start up", "3 chip 1", "5 > status", "6 > stop", "8 > status"], 9)
    assert [s.imu for s in sentences(text, "STA") if s.t_us < 6e6] == [0]  # a run is not disturbed
    assert {s.imu for s in sentences(text, "STA") if s.t_us > 6e6} == {0, 1}


def test_the_only_sensor_may_come_later_at_the_other_address(play: Play) -> None:
    """The board has stood in for the sensor at 0x6B meanwhile, which is not there: it starts anew."""
    text = play(["2 chip 1"], 6)
    assert text.count("# sensor 1 answers now: the board restarts\n") == 1
    assert text.endswith("# restart\n")


def test_buses_that_are_held_low_are_told_soon_and_used_later(play: Play) -> None:
    """A sensor without power holds both lines low; a transfer would wait a second for an event that never comes."""
    text = play([*CHIPS, "0 low 0", "0 low 1", "3 free 0", "3 free 1", *turn(0, UP), "1 > hello", "6 > status"], 7)
    said = sentences(text)
    assert [(s.tag, s.imu) for s in said[:2]] == [("ERR", 0), ("HEL", 0)]
    assert said[1].t_us < 500_000
    assert min(s.t_us for s in sentences(text, "ACK")) < 1_100_000
    assert text.count("# bus 0: SDA 21 stays low: ") == text.count("# bus 1: SDA 17 stays low: ") == 1
    assert {s.imu for s in sentences(text, "STA")} == {0, 1, 2, 3}
    assert not [s for s in sentences(text, "ERR") if s.t_us > 4_200_000]


def test_a_part_that_waits_with_int1_high_survives_a_restart(play: Play) -> None:
    """The set-up of a part resets it; new settings set it up again while data wait."""
    again = [f"{t} > set full_scale_dps 500" for t in (1, 1.3, 1.7)]
    text = play([CHIPS[0], *turn(0, UP), *again, "3 > status"], 4, None, WIRED)
    assert not sentences(text, "ERR")
    assert values(text, "STA", "resets") == ["0"]


def test_a_bus_that_is_held_low_is_clocked_free(play: Play) -> None:
    text = play([*CHIPS, *turn(0, UP), "1 > stream raw", "2 hold 2", "4 > status"], 5)
    errors = {(s.imu, s.fields["name"]) for s in sentences(text, "ERR")}
    assert errors
    assert errors <= {(2, "bus_nack"), (3, "bus_nack")}
    assert values(text, "STA", "resets") == ["0"] * 4
    assert max(map(int, values(text, "STA", "missed"))) < 3


def test_the_interrupt_line_times_samples_and_batches(play: Play) -> None:
    script = ["0 chip 0", *turn(0, UP), "1 > set rate_hz 104", "2 > stream raw", "4 > status"]
    text = play(script, 5, None, WIRED)
    t_us = raw_table(sentences(text)).t_us
    assert np.abs(np.diff(t_us) - 64e6 / 6667).max() < 60  # found by asking, it would be 100 and more
    assert (values(text, "STA", "stale"), values(text, "STA", "missed")) == (["0"], ["0"])

    text = play([*script, "1.5 > set fifo 16"], 5, None, WIRED)
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


def test_the_results_of_one_sensor_are_stored_when_no_run_of_another_would_lose_samples(play: Play, tmp_path: Path) -> None:
    """The first sensor's table stops at 5 s, the second's goes on without the FIFO."""
    flash = tmp_path / "flash"
    still = [f"{t} world {i} 0 0 0 0 0 0 16393" for t, i in ((0, 0), (0, 1), (5, 0), (9, 1))]
    script = [*CHIPS[:2], *still, "0.5 > auto on", *turn(1.5, UP[:2])]
    text = play(script, 10, flash)
    ends = [s for s in sentences(text, "RUN") if s.fields["state"] == "end"]
    assert [s.imu for s in ends] == [0, 1]
    assert [s.fields["missed"] for s in ends] == ["0", "0"]
    content = flash.read_bytes()
    assert content.count(b"bus0_6B/windows") == 1
    assert content.count(b"bus0_6A/windows") == 1


def test_the_bus_is_as_slow_as_it_was_asked_to_be(play: Play) -> None:
    """A sample takes a quarter of a millisecond for each hundred bits of its transfers."""
    slowest = []
    for flags in ((), ("-DGYROCAL_I2C_HZ=100000",)):
        text = play([CHIPS[0], *turn(0, UP), "1 > status", "2 > start up", "5 > stop"], 6, None, *flags)
        assert [s.fields["missed"] for s in sentences(text, "RUN") if s.fields["state"] == "end"] == ["0"]
        assert not sentences(text, "ERR")
        slowest.append(int(values(text, "STA", "slowest_us")[0]))
    assert 400 < slowest[0] < 1200
    assert slowest[1] == pytest.approx(4 * slowest[0], rel=0.3)


def test_status_tells_how_near_the_board_is_to_its_limits(play: Play) -> None:
    text = play([CHIPS[0], *turn(0, UP), "1 > status"], 2)
    assert (values(text, "STA", "heap_bytes"), values(text, "STA", "stack_bytes")) == (["150000"], ["8192"])


def test_an_edge_is_dated_as_it_is_seen_while_another_sensor_holds_the_bus(play: Play) -> None:
    """The second sensor, which has no interrupt line, asks for its data all the time."""
    text = play(["0 chip 0", "0 chip 1", *turn(0, UP), "1 > set rate_hz 104", "2 > stream raw"], 4, None, WIRED)
    steps = np.diff(raw_table(sentences(text, "RAW", 0)).t_us)
    assert len(steps) > 190
    assert np.abs(steps - 64e6 / 6667).max() < 10


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
