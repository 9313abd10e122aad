"""How long `diagnose` takes over all effects, and how much memory. python benchmarks/diagnose_speed.py [rows ...]"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROWS = (240_000, 10_000_000)
AIM_S = {240_000: 10.0, 10_000_000: 120.0}
AIM_GB = 4.0
RUNS = 18
RATE_HZ = 145.0


def measure(rows: int) -> tuple[float, float, float, str]:
    """Seconds to read, seconds to diagnose, peak memory in GB and verdict, measured in a separate process."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "session"
        for step in ("make", "diagnose"):
            done = subprocess.run(
                [sys.executable, __file__, step, str(folder), str(rows)], check=True, capture_output=True, text=True
            )
    read_s, took_s, peak_gb, verdict = done.stdout.split()
    return float(read_s), float(took_s), float(peak_gb), verdict


def make(folder: Path, rows: int) -> None:
    """Nine power cycles, each face up and face down, with a ripple of the table."""
    from gyrocal.simulation.simulate import simulate

    simulate(folder, "paper", ["table_ripple"], seed=1, scenarios=RUNS // 2, seconds=rows / RUNS / RATE_HZ, parquet=True)


def diagnose(folder: Path) -> None:
    from gyrocal.diagnosis.diagnose import diagnose as of
    from gyrocal.recording.session import Session

    began = time.perf_counter()
    session = Session.open(folder)
    read = time.perf_counter()
    found = of(session)
    peak_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(read - began, time.perf_counter() - read, peak_kb / 1024**2, found.verdict)


def main() -> int:
    sizes = [int(a) for a in sys.argv[1:]] or list(ROWS)
    print("rows x 3 axes   read s   diagnose s   us a row   peak GB   verdict")
    took: dict[int, float] = {}
    met = True
    for rows in sizes:
        read_s, took_s, peak_gb, verdict = measure(rows)
        took[rows] = read_s + took_s
        met &= took[rows] <= AIM_S.get(rows, float("inf")) and peak_gb <= AIM_GB
        print(f"{rows:13d}   {read_s:6.2f}   {took_s:10.2f}   {took[rows] / rows * 1e6:8.1f}   {peak_gb:7.2f}   {verdict}")
    if len(sizes) > 1:
        first, last = sizes[0], sizes[-1]
        print(f"time over rows, largest against smallest: {took[last] / last / (took[first] / first):.2f} (1 = linear)")
    return 0 if met else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["make"]:
        make(Path(sys.argv[2]), int(sys.argv[3]))
    elif sys.argv[1:2] == ["diagnose"]:
        diagnose(Path(sys.argv[2]))
    else:
        raise SystemExit(main())
