"""The simulated device serves the rows of a file as samples: each once and at its time, at full speed or in real time."""

import fcntl
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal_firmware import SIM

from .conftest import Build, make_pair, make_run, sentences, ticks, write_rows

Sim = Callable[..., str]


def check_served(text: str, runs: list[dict]) -> None:
    """Each row exactly once, at its own time, with its own counts."""
    said = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    assert len(said) == sum(len(r["t_us"]) for r in runs)
    at = 0
    for r in runs:
        n = len(r["t_us"])
        mine = said[at : at + n]
        at += n
        assert [int(s["0"]) for s in mine] == list(range(n))
        got = np.array([s.t_us for s in mine])
        np.testing.assert_array_equal(got - got[0], r["t_us"] - r["t_us"][0])
        counts = np.array([[int(s[str(k)]) for k in (7, 1, 2, 3, 4, 5, 6)] for s in mine])
        np.testing.assert_array_equal(counts, r["counts"])


@pytest.mark.parametrize("rate_hz", [145.0, 104.0, 416.0, 102.4, 12.5])
def test_each_row_is_served_once_at_its_time(sim: Sim, tmp_path: Path, rate_hz: float) -> None:
    rng = np.random.default_rng(1)
    runs = []
    for axis in range(3):
        period = int(1e6 / rate_hz)
        gaps = rng.choice([40, 300, period, period + 700, 400_000], 500, p=[0.1, 0.1, 0.4, 0.38, 0.02])
        t_us = 7_000_000 + np.cumsum(gaps)
        runs.append(make_run(rng, rng.uniform(-100, 100, 500), t_us, axis=axis, power_cycle=axis // 2, power_on_s=3.0))
    text = sim(write_rows(tmp_path / "a.rows", runs, rate_hz), "--stream", "raw")
    check_served(text, runs)
    first = [s for s in sentences(text, "RAW") if s["0"] == "0"]
    assert first[0].t_us == first[2].t_us == 3_000_000
    seqs = np.array([s.seq for s in sentences(text)])
    assert set(np.diff(seqs)) <= {1, -seqs[: len(seqs)].max()}


def test_ten_minutes_at_416_hz_lose_nothing(sim: Sim, tmp_path: Path) -> None:
    n = 416 * 600
    t = ticks(n, 416.0)
    counts = np.zeros((n, 7), np.int16)
    counts[:, 3] = 8000 + np.arange(n) % 1000
    text = sim(write_rows(tmp_path / "a.rows", [{"t_us": t, "counts": counts}], 416.0), "--stream", "raw")
    lines = [line.split(",") for line in text.splitlines() if line.startswith("$RAW")]
    np.testing.assert_array_equal(np.array([int(x[4]) for x in lines]), np.arange(n))
    np.testing.assert_array_equal(np.array([int(x[7]) for x in lines]), counts[:, 3])
    np.testing.assert_array_equal(np.diff([int(x[1]) for x in lines]), 1)


@pytest.mark.parametrize("rate_hz", [52.0, 104.0, 416.0])
def test_through_the_fifo_each_row_comes_once(sim: Sim, tmp_path: Path, rate_hz: float) -> None:
    rng = np.random.default_rng(23)
    n = int(6.5 * rate_hz)
    runs = [make_run(rng, np.full(n, 1.004 * f * 78.0 - 0.05), ticks(n, rate_hz), f) for f in (1, -1)]
    rows = write_rows(tmp_path / "a.rows", runs, rate_hz)
    text, single = (sim(rows, "--stream", "raw", *option) for option in (["--fifo", "12"], []))
    said = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    assert len(said) == 2 * n
    for r, mine in zip(runs, (said[:n], said[n:]), strict=True):
        assert [int(s["0"]) for s in mine] == list(range(n))
        np.testing.assert_array_equal([[int(s[str(k)]) for k in range(1, 7)] for s in mine], r["counts"][:, 1:])
        t_us = np.array([s.t_us for s in mine])
        assert np.ptp(t_us - r["t_us"]) <= 1.1e6 / rate_hz
    assert {s["missed"] for s in sentences(text, "RUN") if s["state"] == "end"} == {"0"}
    for a, b in zip(sentences(text, "CAL"), sentences(single, "CAL"), strict=True):
        assert (a["method"], a["seconds"]) == (b["method"], b["seconds"])
        assert a.number("scale") == pytest.approx(b.number("scale"), abs=a.number("scale_se"))
        assert a.number("bias_dps") == pytest.approx(b.number("bias_dps"), abs=a.number("bias_se_dps"))


def test_the_fifo_keeps_the_sensors_own_rates_only(sim: Sim, tmp_path: Path) -> None:
    text = sim(write_rows(tmp_path / "a.rows", make_pair(np.random.default_rng(24))), "--fifo", "12")
    assert [s["name"] for s in sentences(text, "ERR")] == ["fifo_rate"]
    assert sum(s["method"] == "baseline" for s in sentences(text, "CAL")) == 3


def test_a_power_cycle_starts_afresh_and_pairs_do_not_cross_it(sim: Sim, tmp_path: Path) -> None:
    runs = make_pair(np.random.default_rng(6))
    runs[1]["power_cycle"] = 1
    said = sentences(sim(write_rows(tmp_path / "a.rows", runs)))
    assert not [s for s in said if s.tag == "CAL"]
    hellos = [s for s in said if s.tag == "HEL"]  # at boot, and again with the recording's settings
    assert [s.seq == 0 for s in hellos] == [True, False, True, False]
    told = [s["state"] + " " + s["face"] for s in said if s.tag == "RUN"]
    assert told == ["start up", "end up", "start down", "end down"]


def test_a_clock_and_numbers_that_start_late_pass_2_to_the_32(sim: Sim, tmp_path: Path) -> None:
    rows = write_rows(tmp_path / "a.rows", make_pair(np.random.default_rng(6)))
    late_us, late = 2**32 - 3_000_000, 2**32 - 400
    text, plain = (sim(rows, "--stream", "raw", *o) for o in (["--clock", str(late_us), "--seq", str(late)], []))
    said, usual = (sentences(t) for t in (text, plain))
    assert [(s.tag, dict(s)) for s in said] == [(s.tag, dict(s)) for s in usual]
    assert [s.t_us - late_us for s in said] == [s.t_us for s in usual]
    assert [s.seq for s in said] == [0, *((late + k) % 2**32 for k in range(len(usual) - 1))]
    assert any(s.t_us < 2**32 for s in said if s.tag == "RAW")


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b[:20],
        lambda b: b"XCSIM01\0" + b[8:],
        lambda b: b[:-1],
        lambda b: b + b"\0",
        lambda b: b[:8] + b"\xff\xff\xff\xff" + b[12:],
        lambda b: b[:16] + np.float32(np.nan).tobytes() + b[20:],
        lambda b: b[:20] + np.float32(300).tobytes() + b[24:],
        lambda b: b[:32] + b"\xff\xff\xff\xff" + b[36:],
        lambda b: b[:40] + b"\x02\0\0\0" + b[44:],
        lambda b: b[:44] + b"\x03\0\0\0" + b[48:],
        lambda b: b[:48] + np.float32(np.inf).tobytes() + b[52:],
        lambda b: b[:64] + b[64 + 24 : 64 + 48] + b[64 : 64 + 24] + b[64 + 48 :],
        lambda b: b[:71] + b"\xff" + b[72:],
        lambda b: b"",
    ],
)
def test_a_malformed_file_is_one_line_and_exit_2(
    build: Build, tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    path = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(13), np.zeros(50), ticks(50))])
    path.write_bytes(damage(path.read_bytes()))
    done = subprocess.run([build(SIM / "main.c"), path], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("gyrocal-sim: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "arguments",
    [
        "", "no/such.rows", "--speed 0 a", "--imu 256 a", "--fault x a", "--clock x a", "--seq 4294967296 a", "--x a", "a b",
    ],
)  # fmt: skip
def test_bad_usage_is_one_line_and_exit_2(build: Build, arguments: str) -> None:
    done = subprocess.run([build(SIM / "main.c"), *arguments.split()], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_in_real_time_whole_sentences_are_dropped_and_counted(build: Build, tmp_path: Path) -> None:
    n = 145 * 4
    rows = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(14), np.full(n, 78.0), ticks(n))])
    command = [build(SIM / "main.c"), rows, "--speed", "1", "--stream", "raw", "--hold", "--imu", "3"]
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)  # full after some sixty samples
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=writing) as process, open(reading, "rb") as stdout:
        os.close(writing)
        assert process.stdin is not None
        time.sleep(3.0)
        text = b""
        process.stdin.write(b"stream off\nstatus\n")
        process.stdin.flush()
        while b"$STA" not in text or not text.endswith(b"\n"):
            text += stdout.read1(65536)
        process.stdin.close()
        assert process.wait(timeout=20) == 0
    said = sentences(text.decode())
    assert {s.imu for s in said} == {3}
    seqs = np.array([s.seq for s in said])
    lost = int(seqs[-1] + 1 - len(seqs))
    assert lost > 200
    assert int(next(s for s in said if s.tag == "STA")["lost"]) <= lost
    assert int(said[-1].seq) + 1 == len(said) + lost


def test_faster_than_real_time_waits_for_its_reader(build: Build, tmp_path: Path) -> None:
    n = 145 * 4
    rows = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(14), np.full(n, 78.0), ticks(n))])
    command = [build(SIM / "main.c"), rows, "--speed", "50", "--stream", "raw"]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        time.sleep(0.5)  # the pipe is full long since
        said = sentences(process.stdout.read().decode())
    assert [s.seq for s in said] == list(range(len(said)))
    assert sum(s.tag == "RAW" for s in said) >= n


def test_real_time_is_real(build: Build, tmp_path: Path) -> None:
    rows = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(15), np.full(290, 78.0), ticks(290))])
    """Two seconds at twice the speed take one, and end before those at the speed itself, which begin at the same time."""
    start = time.monotonic()
    slow, fast = (
        subprocess.Popen([build(SIM / "main.c"), rows, "--speed", speed], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        for speed in ("1", "2")
    )
    assert fast.wait() == 0
    assert time.monotonic() - start > 0.9
    assert slow.poll() is None
    assert slow.wait() == 0
    assert time.monotonic() - start > 1.8
