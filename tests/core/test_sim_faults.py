"""Faults of the simulated sensor and board: each is reported by its own code, and the answers are flagged."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal_firmware import SIM

from .conftest import Build, make_pair, make_run, run, sentences, ticks, write_rows

Sim = Callable[..., str]


def test_a_busy_board_misses_samples_and_with_the_fifo_only_those_it_cannot_hold(sim: Sim, tmp_path: Path) -> None:
    rng = np.random.default_rng(25)
    n = int(6.5 * 104)
    rows = write_rows(tmp_path / "a.rows", [make_run(rng, np.full(n, 78.0), ticks(n, 104.0))], 104.0)
    for option, low, high in ((["--fifo", "12"], 80, 130), ([], 305, 320)):
        text = sim(rows, "--fault", "busy", *option)
        end = sentences(text, "RUN")[1]
        assert low < int(end["missed"]) < high
        assert int(end["n"]) + int(end["missed"]) == pytest.approx(n, abs=1)
        assert [s["name"] for s in sentences(text, "ERR")] == ["fifo_overrun"] * bool(option)


def test_clipped_samples_are_counted(sim: Sim, tmp_path: Path) -> None:
    runs = [make_run(np.random.default_rng(10), np.full(300, 100.0), ticks(300), table_dps=np.nan)]
    runs[0]["counts"][50:60, 3] = 28571
    runs[0]["counts"][60:63, 3] = -32768
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert [s["name"] for s in sentences(text, "ERR")] == ["clipped"]
    assert sentences(text, "RUN")[1]["clipped"] == "13"


FAULTS = {
    "nack": "bus_nack",
    "wrong_id": "wrong_id",
    "stale": "stale",
    "brownout": "config_lost",
    "stuck_bit": "stuck_bit",
    "reset_timeout": "reset_timeout",
    "bad_tags": "fifo_tag",
    "busy": "net_gap",
}


def test_each_fault_is_reported_by_its_own_code(sim: Sim, build: Build, tmp_path: Path) -> None:
    rows = write_rows(tmp_path / "a.rows", make_pair(np.random.default_rng(11)))
    listed = run(build(SIM / "main.c"), "", "--fault", "list").splitlines()
    assert [line.split("\t")[0] for line in listed][: len(FAULTS)] == list(FAULTS)  # the others: test_faults.py
    assert not sentences(sim(rows), "ERR")
    for fault, name in FAULTS.items():
        if fault == "bad_tags":  # of the FIFO, which keeps to the sensor's own rates
            half = [make_run(np.random.default_rng(11), np.full(700, f * 78.0), ticks(700, 104.0), f) for f in (1, -1)]
            text = sim(write_rows(tmp_path / "fifo.rows", half, 104.0), "--fault", fault, "--fifo", "8")
            assert {s["name"] for s in sentences(text, "ERR")} == {name, "net_sample_rate"}
            continue
        text = sim(rows, "--fault", fault)
        told = {s["name"] for s in sentences(text, "ERR")}
        assert name in told, fault
        passes = fault in ("nack", "stale", "brownout")  # and the device goes on
        assert told - {name} == ({"net_gap"} if passes else told & {"not_ready", "no_run"}), fault
        if passes:
            assert sum(s["method"] == "baseline" for s in sentences(text, "CAL")) == 3
            assert 800 < int(sentences(text, "RUN")[1]["n"]) < 900


def test_a_device_that_is_set_up_again_reads_right_values(sim: Sim, tmp_path: Path) -> None:
    runs = make_pair(np.random.default_rng(12))
    text = sim(write_rows(tmp_path / "a.rows", runs), "--fault", "brownout", "--stream", "raw")
    origin = next(s.t_us for s in sentences(text, "RAW") if s["0"] == "0")
    by_time = dict(zip(runs[0]["t_us"], runs[0]["counts"][:, 3], strict=True))
    read = [s for s in sentences(text, "RAW") if s.t_us - origin in by_time and s["0"] != "-1"]
    assert len(read) > 850
    assert all(int(s["3"]) == by_time[s.t_us - origin] for s in read)


@pytest.mark.parametrize(
    ("fault", "flag"), [("stuck_bit", "misfit"), ("stale", "missed"), ("nack", "missed"), ("busy", "missed")]
)
def test_a_fault_of_the_sensor_is_flagged(sim: Sim, tmp_path: Path, fault: str, flag: str) -> None:
    rows = write_rows(tmp_path / "a.rows", make_pair(np.random.default_rng(41)))
    said = sentences(sim(rows, "--fault", fault), "CAL")
    assert said
    assert all(flag in s["flags"].split("+") and s["trusted"] == "0" for s in said), [s["flags"] for s in said]
    sound = [s for s in sentences(sim(rows), "CAL") if s["seconds"] == "6"]
    assert {s["flags"] for s in sound} == {""}
