"""How long `diagnose` takes over all effects, and how much memory.

python benchmarks/diagnose_speed.py [--static] [rows ...]

The session is of a turning table with a ripple, or with ``--static`` four power cycles at rest with a slow drift.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import polars as pl

ROWS = (240_000, 10_000_000)
AIM_S = {240_000: 10.0, 10_000_000: 120.0}
AIM_GB = 4.0
RUNS = 18
RATE_HZ = 145.0


def measure(rows: int, kind: str) -> tuple[float, float, float, float, str]:
    """Seconds to read and to diagnose, of them on the CPU, peak memory in GB and verdict, measured in a separate process."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "session"
        for step in (kind, "diagnose"):
            done = subprocess.run(
                [sys.executable, __file__, step, str(folder), str(rows)], check=True, capture_output=True, text=True
            )
    read_s, took_s, cpu_s, peak_gb, verdict = done.stdout.split()
    return float(read_s), float(took_s), float(cpu_s), float(peak_gb), verdict


def turning(folder: Path, rows: int) -> None:
    """Nine power cycles, each face up and face down, with a ripple of the table."""
    from gyrocal.simulation.simulate import simulate

    simulate(folder, "paper", ["table_ripple"], seed=1, scenarios=RUNS // 2, seconds=rows / RUNS / RATE_HZ, parquet=True)


def static(folder: Path, rows: int) -> None:
    """Four power cycles at rest: white noise of 50 mdps in counts of 4.4 mdps, drift of 2 mdps over 100 s."""
    from scipy.signal import lfilter

    rng, n, rate_hz = np.random.default_rng(1), rows // 4, 100.0
    folder.mkdir()
    lines = ['format = "gyrocal-session/1"', 'axis = "z"', f"sample_rate_hz = {rate_hz}"]
    keep = np.exp(-1 / (100.0 * rate_hz))
    for i in range(4):
        drift_dps = lfilter([1], [1, -keep], rng.normal(0, 0.002 * np.sqrt(1 - keep**2), (n, 3)), axis=0)
        y_dps = np.round((rng.normal(0, 0.05, (n, 3)) + drift_dps + rng.normal(0, 0.01, 3) + 0.3) / 0.0044) * 0.0044
        columns = {"t_s": np.arange(n) / rate_hz, **{f"g{a}_dps": y_dps[:, k] for k, a in enumerate("xyz")}}
        pl.DataFrame(columns).write_parquet(folder / f"{i}.parquet")
        lines += ["[[run]]", f'file = "{i}.parquet"', f'scenario = "s{i}"', 'face = "up"', "table_rate_dps = 0.0"]
    (folder / "session.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def diagnose(folder: Path) -> None:
    from gyrocal.diagnosis.answer.diagnose import diagnose as of
    from gyrocal.recording.session import Session

    began, began_cpu = time.perf_counter(), time.process_time()
    session = Session.open(folder)
    read = time.perf_counter()
    found = of(session)
    peak_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(read - began, time.perf_counter() - read, time.process_time() - began_cpu, peak_kb / 1024**2, found.verdict)


def main() -> int:
    kind = "static" if "--static" in sys.argv else "turning"
    sizes = [int(a) for a in sys.argv[1:] if a != "--static"] or list(ROWS)
    print("rows x 3 axes   read s   diagnose s    CPU s   us a row   peak GB   verdict")
    took: dict[int, float] = {}
    met = True
    for rows in sizes:
        read_s, took_s, cpu_s, peak_gb, verdict = measure(rows, kind)
        took[rows] = read_s + took_s
        met &= took[rows] <= AIM_S.get(rows, float("inf")) and peak_gb <= AIM_GB
        of_row_us = took[rows] / rows * 1e6
        print(f"{rows:13d}   {read_s:6.2f}   {took_s:10.2f}   {cpu_s:6.1f}   {of_row_us:8.1f}   {peak_gb:7.2f}   {verdict}")
    if len(sizes) > 1:
        first, last = sizes[0], sizes[-1]
        print(f"time over rows, largest against smallest: {took[last] / last / (took[first] / first):.2f} (1 = linear)")
    return 0 if met else 1


if __name__ == "__main__":
    if sys.argv[1:2] in (["turning"], ["static"]):
        {"turning": turning, "static": static}[sys.argv[1]](Path(sys.argv[2]), int(sys.argv[3]))
    elif sys.argv[1:2] == ["diagnose"]:
        diagnose(Path(sys.argv[2]))
    else:
        raise SystemExit(main())
