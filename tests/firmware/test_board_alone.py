"""The board with nobody at its USB connector, with a task that hangs, and after its supply broke down."""

from pathlib import Path

import pytest

from .conftest import CHIPS, DOWN, UP, Play, pair, sentences, turn, values

HELD_BYTES = 16384 + 4096
"""Of output.cpp and its driver."""


@pytest.mark.parametrize(("off_s", "on_s"), [pytest.param(0.0, 10.0, marks=pytest.mark.wide), (0.0, 2.0), (3.0, 12.0)])
def test_with_nobody_at_the_connector_nothing_but_sentences_is_lost(
    play: Play, tmp_path: Path, off_s: float, on_s: float
) -> None:
    """From power-on into the second run of a pair or into the first one, and from the first one into the second one."""
    flash = tmp_path / "flash"
    script = [*pair(1), "0.9 > stream raw", f"{off_s} listen off", f"{on_s} listen on", f"{on_s} > status", "16 > dump"]
    text = play(script, 20, flash)
    said = sentences(text)
    numbers = [s.seq for s in said]
    assert numbers == sorted(set(numbers))
    lost = numbers[-1] + 1 - len(numbers)
    assert (lost > 100) == (on_s > 2.0)
    assert int(values(text, "STA", "lost")[-1]) == lost

    end = [s for s in sentences(text, "RUN") if s.fields["state"] == "end"][-1]
    assert (end.fields["missed"], end.fields["face"]) == ("0", "down")
    assert end.real("duration_s") == pytest.approx(6.5, abs=0.05)
    last = sentences(text, "CAL")[-2:]
    assert [(s.fields["method"], s.fields["seconds"]) for s in last] == [("baseline", "6"), ("cnn", "6")]
    assert len(sentences(text, "OLD")) == 6  # also those that nobody heard
    assert flash.read_bytes().count(b"gyrocal/bus0_6B/results") >= 1

    (status,) = [s for s in sentences(text, "ACK") if s.fields["cmd"] == "status"]
    assert status.t_us < 1e6 * on_s + 20_000  # it was obeyed at once, and came behind what the board had held
    behind = text.encode("latin-1").split(status.text.encode())[0]
    held = sum(len(line) + 1 for line in behind.split(b"\n") if line.startswith(b"$"))
    assert held <= HELD_BYTES + 10_000 * off_s


def test_a_task_that_hangs_is_ended_by_the_watchdog_and_leaves_what_was_kept(play: Play, tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    text = play([*pair(), "18 > stream raw", "19 hang 0"], 40, flash)
    (line,) = (line for line in text.splitlines() if line.startswith("# watchdog"))
    assert float(line.split()[2]) == pytest.approx(29, abs=0.05)
    for imu, until_s in ((0, 19), (1, 19), (2, 29), (3, 29)):  # the other bus goes on meanwhile
        assert sentences(text, "RAW", imu)[-1].t_us == pytest.approx(1e6 * until_s, abs=3e4)

    again = play([*CHIPS, "0 reset 6", *turn(0, UP), "1 > dump"], 5, flash)
    assert ", reset reason 6, watchdog of a task" in again
    for imu in range(4):
        assert [s.text for s in sentences(again, "OLD", imu)] == [s.text for s in sentences(text, "CAL", imu)]


@pytest.mark.parametrize("at_s", [4.0, 7.51, 12.0])
def test_a_board_whose_supply_broke_down_calibrates_afterwards(play: Play, tmp_path: Path, at_s: float) -> None:
    """In the first run of a pair, while its end is stored, and in the second run."""
    flash = tmp_path / "flash"
    play(["0.5 > set table_dps 77", *pair(1)], at_s, flash)
    text = play(["0 reset 9", *pair(1)], 16, flash)
    assert ", reset reason 9, brown-out" in text
    assert {s.fields["table_dps"] for s in sentences(text, "HEL")} == {"77"}
    assert not sentences(text, "ERR")
    baseline = [s for s in sentences(text, "CAL") if s.fields["method"] == "baseline"]
    assert [s.fields["seconds"] for s in baseline] == ["2", "4", "6"]
    scale, scale_se = baseline[-1].real("scale"), baseline[-1].real("scale_se")
    assert scale == pytest.approx((UP[0] - DOWN[0]) * 0.00875 / (2 * 77) - 1, abs=5 * (scale_se or 0))
