"""`stream packed`: its samples are those of `stream raw`, and fit the wire at the fastest rates."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from gyrocal.device.wire import RawTable, Reader, raw_table
from gyrocal_firmware import SIM

from .conftest import Build, make_run, write_rows

BYTES_PER_S = 921600 / 10  # a start and a stop bit


def said(build: Build, rows: Path, *options: str) -> tuple[bytes, Reader, RawTable]:
    command = [build(SIM / "main.c"), str(rows), "--speed", "max", *options]
    done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=300)
    assert done.returncode == 0, done.stderr
    reader = Reader()
    sentences = reader.feed(done.stdout)
    assert (reader.bad, reader.lost, reader.overlong, reader.skipped) == (0, 0, 0, 0)
    return done.stdout, reader, raw_table(sentences)


def rows_at(folder: Path, rate_hz: float, seconds: float) -> Path:
    t_us = np.round(np.arange(int(seconds * rate_hz)) / rate_hz * 1e6).astype(np.int64)
    runs = [make_run(np.random.default_rng(0), np.full(len(t_us), 78.0 * face), t_us, face) for face in (1, -1)]
    return write_rows(folder / "a.rows", runs, rate_hz)


@pytest.mark.parametrize(
    ("rate_hz", "options"), [(145.0, []), (833.0, ["--fifo", "16"]), (145.0, ["--bus", "spi", "--sensor", "BMI088"])]
)
def test_samples_are_those_of_the_text(build: Build, tmp_path: Path, rate_hz: float, options: list[str]) -> None:
    rows = rows_at(tmp_path, rate_hz, 3.0)
    (text, _, raw), (frames, reader, packed) = (said(build, rows, *options, "--stream", stream) for stream in ("raw", "packed"))
    for name in ("t_us", "imu", "number", "counts"):
        assert np.array_equal(getattr(raw, name), getattr(packed, name))
    assert len(raw) > 5.9 * rate_hz
    assert len(frames) < 0.8 * len(text)
    assert reader.good > len(packed)  # the others came as text


@pytest.mark.parametrize("rate_hz", [3333.0, 6667.0])
def test_the_fastest_rates_fit_the_wire(build: Build, tmp_path: Path, rate_hz: float) -> None:
    frames, _, packed = said(build, rows_at(tmp_path, rate_hz, 2.0), "--bus", "spi", "--fifo", "64", "--stream", "packed")
    in_runs = packed.number >= 0
    assert in_runs.sum() == pytest.approx(4.0 * rate_hz, abs=8)  # the ends of runs, by the sensor's own clock
    steps = np.diff(packed.number[in_runs])
    assert np.all(steps[steps != steps.min()] == 1)
    assert len(frames) / len(packed) * rate_hz < BYTES_PER_S


def test_i2c_is_too_slow_for_the_fastest_rate(sim: object, tmp_path: Path) -> None:
    text = sim(rows_at(tmp_path, 6667.0, 0.5), "--fifo", "64")  # type: ignore[operator]
    assert "name=spi_needed" in text
