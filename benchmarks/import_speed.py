"""How long an import takes against the reader of the format alone, in processor time. python benchmarks/import_speed.py [rows]

Each figure is the median over ``ROUNDS`` of both in turn, so that their ratio holds on a machine that others use too.
"""

from __future__ import annotations

import resource
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl

from gyrocal.recording.importer import Imported, Options, read_recording

ROWS, ROUNDS, RATE_HZ = 1_000_000, 5, 200.0
AIM = 2.0
"""Time of an import over that of the reader alone."""
OPTIONS = Options(maps=("t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z", "temp_c=temp"), defaults={"table_rate_dps": 78.0})


def write(folder: Path, rows: int) -> None:
    """The same recording in each format."""
    rng = np.random.default_rng(0)
    columns = {"t": np.arange(rows) / RATE_HZ, **{a: np.round(rng.normal(0, 0.1, rows), 5) for a in "xyz"}}
    columns["temp"] = np.round(25 + np.cumsum(rng.normal(0, 1e-4, rows)), 3)
    frame = pl.DataFrame(columns)
    frame.write_csv(folder / "a.csv")
    frame.write_parquet(folder / "a.parquet")
    np.savez(folder / "a.npz", **columns)  # type: ignore[arg-type]


def numpy_alone(path: Path) -> Any:
    with np.load(path) as archive:
        return {name: archive[name] for name in archive.files}


READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "a.csv": ("pandas", pd.read_csv), "a.parquet": ("polars", pl.read_parquet), "a.npz": ("numpy", numpy_alone),
}  # fmt: skip


def cpu_s(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time of some work, all threads, user and system, s; and its result."""
    before = resource.getrusage(resource.RUSAGE_SELF)
    result = work()
    after = resource.getrusage(resource.RUSAGE_SELF)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, result


def main() -> int:
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else ROWS
    met = True
    print("format     reader    reader s   import s   ratio   with the session's files s")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write(folder, rows)
        for name, (reader, alone) in READERS.items():
            path, times = folder / name, []
            for turn in range(ROUNDS):
                reader_s, _ = cpu_s(lambda path=path, alone=alone: alone(path))
                import_s, found = cpu_s(lambda path=path: read_recording(path, OPTIONS))
                assert isinstance(found, Imported)
                save_s, _ = cpu_s(lambda found=found, to=folder / f"{name}_{turn}": found.save(to))
                times.append((reader_s, import_s, import_s + save_s))
            reader_s, import_s, whole_s = (statistics.median(t) for t in zip(*times, strict=True))
            ratio = statistics.median(i / r for r, i, _ in times)
            met &= ratio <= AIM
            print(f"{path.suffix:10s} {reader:8s}  {reader_s:9.3f}  {import_s:9.3f}   {ratio:5.2f}   {whole_s:9.3f}")
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main())
