"""What a wire carries, from the lengths of what the device really sends: the table of docs/wire.md."""

import subprocess
from pathlib import Path

import numpy as np

from gyrocal.device.port import BAUD, TEXT_MOST_HZ
from gyrocal.device.wire import Reader
from gyrocal_firmware import SIM

from .conftest import Build, make_run, write_rows

PAGE = Path(__file__).resolve().parents[2] / "docs" / "wire.md"
BITS_A_BYTE = 10  # with start and stop
BAUDS = (115200, 230400, 460800, 921600, 2000000)
DAY_S = 86400


def bytes_a_sample(build: Build, folder: Path, rate_hz: float, *options: str) -> float:
    """Of what is sent in a run of 2 s on the table, all axes near full scale."""
    t_us = np.round(np.arange(int(2.0 * rate_hz)) / rate_hz * 1e6).astype(np.int64)
    rng = np.random.default_rng(0)
    run = make_run(rng, np.full(len(t_us), 200.0), t_us)
    run["counts"][:, 1:3] = -run["counts"][:, 3:4]
    run["counts"][:, 4:7] = np.rint(np.array([8000, -8000, 14000]) + rng.normal(0, 20, (len(t_us), 3)))
    rows = write_rows(folder / "a.rows", [run], rate_hz)
    done = subprocess.run([build(SIM / "main.c"), str(rows), "--speed", "max", *options], capture_output=True, timeout=300)
    before, _, during = done.stdout.partition(b"state=start")
    during = during.partition(b"$RUN")[0]
    samples = [s for s in Reader().feed(during) if s.tag == "RAW"]
    assert len(samples) > 1.9 * rate_hz
    assert before.startswith(b"$HEL")
    return len(during) / len(samples)


def test_the_table_of_what_the_wire_carries(build: Build, tmp_path: Path) -> None:
    batch = ["--fifo", "32"]
    later = ["--clock", str(DAY_S * 10**6), "--seq", str(833 * DAY_S)]
    lengths = [
        bytes_a_sample(build, tmp_path, 833.0, *batch, "--stream", "raw"),
        bytes_a_sample(build, tmp_path, 833.0, *batch, *later, "--stream", "raw"),
        bytes_a_sample(build, tmp_path, 833.0, *batch, *later, "--stream", "packed"),
        bytes_a_sample(build, tmp_path, 3333.0, "--bus", "spi", *batch, *later, "--stream", "packed"),
    ]
    table = ["| bytes a sample | " + " | ".join(f"{length:.0f}" for length in lengths) + " |"]
    for baud in BAUDS:
        carried = " | ".join(f"{baud / BITS_A_BYTE / length:.0f}" for length in lengths)
        table.append(f"| {baud} baud | {carried} |")
    rows = "\n".join(table)
    assert rows in PAGE.read_text(encoding="utf-8"), rows
    assert BAUD / BITS_A_BYTE / lengths[1] >= TEXT_MOST_HZ
    assert BAUD / BITS_A_BYTE / lengths[3] > 6667.0
