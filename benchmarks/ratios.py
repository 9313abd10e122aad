"""Processor time and peak memory over those of the least that a script would do with the same session, all in one run.

    python benchmarks/ratios.py            # small and large sessions, a motion capture, the import
    python benchmarks/ratios.py --large    # ten million rows too
    python benchmarks/ratios.py small still    # these rows

The script reads the same files with Polars and calls ``numpy.linalg.lstsq`` with 30 columns once an axis, with one thread. The
commands run as a user runs them. A ratio holds on a busy or slow machine where seconds do not; each is of whole processes,
imports included.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

COLUMNS = 30
ROUNDS = 3
"""Of the short processes, of which the fastest counts."""
COMMANDS = ("compare", "diagnose", "explain")


@dataclass(frozen=True)
class Row:
    """A session: how it is made, how many rows it has, and the largest ratio that ``diagnose`` should have."""

    words: str
    make: Callable[[Path, int], None]
    rows: int
    aim: float | None = None
    aim_gb: float | None = None
    commands: tuple[str, ...] = ("diagnose",)


def turning(folder: Path, rows: int) -> None:
    """Nine power cycles of a turning table with a ripple."""
    from diagnose_speed import turning as write

    write(folder, rows)


def static(folder: Path, rows: int) -> None:
    """Four power cycles at rest with a slow drift."""
    from diagnose_speed import static as write

    write(folder, rows)


def small(folder: Path, rows: int) -> None:
    """A turning table with a ripple and a bias that follows temperature, in runs of 15 s."""
    from gyrocal.simulation.simulate import simulate

    effects = ["table_ripple", "bias_temperature:k1_dps_per_c=0.02"]
    simulate(folder, "paper", effects, seed=11, scenarios=round(rows / 145 / 30), seconds=15.0)


def paper(folder: Path, rows: int) -> None:
    """The paper's campaign."""
    from gyrocal.simulation.simulate import simulate

    simulate(folder, "paper", [], seed=1)


def full(folder: Path, rows: int) -> None:
    """The campaign ``full``."""
    from gyrocal.simulation.simulate import simulate

    simulate(folder, "full", [], seed=1)


def motion(folder: Path, rows: int) -> None:
    """A body moved by hand between two rests, with orientations of a motion capture that now and then loses it."""
    from benchmarks import reference_sessions as sessions

    rng = np.random.default_rng(1)
    rate_hz, turn, deg = 2000 / 7, np.array([3.0, -5.0, 2.0]), 0.02
    t_s = np.arange(rows) / rate_hz
    waves = sessions.waves(rng, 60.0, 3)

    def body(at_s: np.ndarray) -> np.ndarray:
        moving = np.clip((at_s - 35) / 2, 0, 1) * np.clip((t_s[-1] - 35 - at_s) / 2, 0, 1)
        return waves(at_s) * (moving**2 * (3 - 2 * moving))[:, None]

    noise = sessions.exponential(np.deg2rad(rng.normal(0, deg, (rows, 3))))
    q = sessions.product(sessions.orientations(body, t_s), noise)
    lost = np.zeros(rows, dtype=bool)
    for first in rng.integers(0, rows, 12):
        lost[first : first + 40] = True
    q[lost] = np.nan
    gyro = sessions.turned(turn, body(t_s - 0.004)) * [0.998, 1.002, 1.001] + [-0.07, -0.07, 0.47]
    gyro += rng.normal(0, 0.05, gyro.shape)
    reference = sessions.Reference(clock="own")
    run = sessions.run_of(t_s, gyro, reference=reference, **{f"ref_q{a}": q[:, i] for i, a in enumerate("wxyz")})
    sessions.of_runs([replace(run, frame=run.frame.fill_nan(None))]).save(folder)


ROWS = {
    "small": Row("20 thousand rows, turning", small, 20_000, commands=COMMANDS),
    "turning": Row("240 thousand rows, turning", turning, 240_000, aim=3.0, commands=COMMANDS),
    "static": Row("a million rows, at rest", static, 1_000_000, aim=3.0, aim_gb=0.7),
    "motion": Row("motion capture", motion, 57_000, aim=12.0),
    "paper": Row("campaign paper", paper, 974_000),
    "full": Row("campaign full", full, 0),
}
LARGE = {"large": Row("ten million rows, at rest", static, 10_000_000, aim_gb=2.0)}
EXPLAIN_AIM = 3.0
"""Of ``explain`` over ``diagnose``, where all that is missing is one effect."""
IMPORTS = {"import gyrocal.api": 4.0, "from gyrocal.api import Session, compare, diagnose": None}
"""Over the import of numpy and scipy."""


def least_squares(folder: Path) -> None:
    """What a script would do: read the files, and fit 30 columns to each axis."""
    import polars as pl

    files = sorted(f for f in folder.iterdir() if f.suffix in (".csv", ".parquet"))
    table = pl.concat([pl.read_csv(f) if f.suffix == ".csv" else pl.read_parquet(f) for f in files], how="diagonal")
    y = table.select("gx_dps", "gy_dps", "gz_dps").to_numpy()
    t = np.linspace(-1.0, 1.0, len(y))
    columns = np.empty((len(y), COLUMNS))
    for k in range(COLUMNS):
        columns[:, k] = np.cos(k * t)
    for axis in range(3):
        np.linalg.lstsq(columns, y[:, axis], rcond=None)


def measured(*arguments: str, environment: Mapping[str, str] | None = None) -> tuple[float, float]:
    """Processor seconds and peak memory in GB of a process."""
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, env=environment)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(arguments)} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024**2


def fastest(*arguments: str) -> float:
    """The least processor seconds of a few runs of a process with one thread."""
    one = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1"}
    return min(measured(*arguments, environment=one)[0] for _ in range(ROUNDS))


def within(value: float, aim: float | None) -> str:
    """A figure with its aim, and whether it is met."""
    return f"{value:.1f}" if aim is None else f"{value:.1f} ({'at' if value <= aim else 'over'} most {aim:g})"


def show(row: Row) -> None:
    """Make a session, measure the commands on it and print a line for each."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "session"
        subprocess.run([sys.executable, __file__, f"make:{row.make.__name__}", str(folder), str(row.rows)], check=True)
        script_s = fastest(__file__, "lstsq", str(folder))
        took: dict[str, float] = {}
        for command in row.commands:
            more = ["--model", str(Path(scratch) / "model.toml")] if command == "explain" else []
            took[command], peak_gb = measured("-m", "gyrocal", command, str(folder), "--json", *more)
            over = within(took[command] / script_s, row.aim if command == "diagnose" else None)
            peak = within(peak_gb, row.aim_gb) if row.aim_gb else f"{peak_gb:.2f}"
            of_diagnose = f", {took[command] / took['diagnose']:.1f} times diagnose" if command == "explain" else ""
            print(f"{row.words:28s} {command:9s} {took[command]:7.2f} {script_s:7.2f}   {over:18s} {peak}{of_diagnose}")


def show_imports() -> None:
    """The imports over that of numpy and scipy."""
    least_s = fastest("-c", "import numpy, scipy")
    for statement, aim in IMPORTS.items():
        took_s = fastest("-c", statement)
        print(f"{statement:28s} {took_s:.2f} {least_s:.2f}   {within(took_s / least_s, aim)}")


def main(names: list[str]) -> int:
    rows = ROWS | LARGE
    chosen = [n for n in names if n in rows] or [*ROWS, *(LARGE if "--large" in names else ())]
    print(f"{'session':28s} {'command':9s} {'CPU s':>7s} {'script':>7s}   {'ratio':18s} peak GB")
    for name in chosen:
        show(rows[name])
    show_imports()
    return 0


if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]
    step, *rest = sys.argv[1:] or [""]
    if step == "lstsq":
        least_squares(Path(rest[0]))
    elif step.startswith("make:"):
        globals()[step.removeprefix("make:")](Path(rest[0]), int(rest[1]))
    else:
        raise SystemExit(main(sys.argv[1:]))
