"""`gyrocal benchmark fleet`: what it costs to fit many boards as one population.

    gyrocal benchmark fleet --limit 1000 --results boards-study --workers 2

The boards are simulated by the workers (:mod:`benchmarks.fleet_boards`). Finished ones are kept in the results folder, so that
an interrupted run goes on, and a later one with more boards adds only those. benchmarks/fleet_effects.py reads the same folder.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.fleet_boards import Simulating, listed, noted, peak_mb

from gyrocal.error_model.model import Model
from gyrocal.fleet.board import of_fleet, plain_fit, work
from gyrocal.fleet.drift import FleetDrift
from gyrocal.fleet.engine import OnDask, engine
from gyrocal.fleet.fit import Fleet, fit_fleet
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import Session
from gyrocal.simulation.production import Production
from gyrocal.simulation.simulate import OU_SD_DPS, OU_TAU_S, WHITE_SD_DPS

BOARDS, SAMPLE_BOARDS = 10_000, 16
STAGES = (100, 1000, 10_000)
"""Sizes of fleets after which the memory is noted."""
TIMED = 24
"""Boards whose fits and whole task are timed, in processor time of this process."""
COMPARED = 100
"""Boards that one worker and two workers fit."""
SEED = 20


def run(
    sample: bool, progress: Callable[[int, int], None], limit: int | None = None, workers: int | None = None,
    scheduler: str | None = None, results: Path | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return what ``gyrocal benchmark fleet --json`` prints: boards/s a core, memory in MB, and 2 workers against 1."""
    boards = limit or (SAMPLE_BOARDS if sample else BOARDS)
    with tempfile.TemporaryDirectory() as scratch, _folder(results) as folder:
        found: dict[str, Any] = {"boards": boards, **_speeds(Path(scratch) / "timed"), "memory": []}
        with engine(workers, scheduler) as cluster:
            for size in sorted({*(s for s in STAGES if s < boards), boards}):
                began = time.process_time()
                fleet = _fitted(folder, size, Simulating(cluster, Production(seed=SEED)), progress)
                here = time.process_time() - began
                found["memory"].append({"boards": size, **_memory(cluster, folder), "client_ms_a_board": 1e3 * here / size})
            found |= {"failed": len(fleet.failed), "named": [f"{m.effect}.{m.axis}" for m in fleet.missing]}
        return found | _compared(Path(scratch), min(COMPARED, boards))


@contextmanager
def _folder(results: Path | None) -> Iterator[Path]:
    if results is not None:
        yield results
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def _fitted(folder: Path, boards: int, where: Simulating, progress: Callable[[int, int], None] | None = None) -> Fleet:
    return fit_fleet(listed(folder, range(boards)), Model.open(), where, folder, progress)


def _speeds(folder: Path) -> dict[str, float]:
    """Boards/s of one core, by processor time: a fit that searches for the drift, one with the fleet's, and the whole task."""
    Production(seed=SEED).write(folder, range(TIMED))
    paths = sorted(str(path) for path in folder.iterdir())
    drifts = {axis: FleetDrift(OU_SD_DPS / WHITE_SD_DPS, OU_TAU_S) for axis in "xyz"}
    model, results = Model.open(), folder / "results"
    results.mkdir()
    tasks: dict[str, Callable[[str], object]] = {
        "with_search_for_drift": lambda path: plain_fit(Session.open(path), model),
        "plain": lambda path: plain_fit(Session.open(path), of_fleet(model, drifts)),
        "task": lambda path: work(path, model, drifts, str(results)),
    }
    for task in tasks.values():
        task(paths[0])
    spent: dict[str, list[float]] = {name: [] for name in tasks}
    for path in paths[1:]:  # in turns, so that what else runs on the machine disturbs all alike
        for name, task in tasks.items():
            began = time.process_time()
            task(path)
            spent[name].append(time.process_time() - began)
    seconds = {name: float(np.median(of)) for name, of in spent.items()}
    return {f"{name}_boards_per_s": 1 / s for name, s in seconds.items()} | {"cost_ratio": seconds["task"] / seconds["plain"]}


def _memory(cluster: Any, folder: Path) -> dict[str, float]:
    kept = [path.stat().st_size for path in (folder / "results").glob("*.npz")]
    found = {"client_mb": peak_mb(), "summary_kb": sum(kept) / len(kept) / 1e3}
    if isinstance(cluster, OnDask):
        found |= {"worker_mb": max(cluster.client.run(peak_mb).values())}
        found |= {"scheduler_mb": cluster.client.run_on_scheduler(peak_mb)}
    return found


def _compared(scratch: Path, boards: int) -> dict[str, float]:
    """Wall time of one worker over that of two, once they have started, and the largest difference of their populations."""
    seconds, fleets = [], []
    for workers in (1, 2):
        with engine(workers) as cluster:
            assert isinstance(cluster, OnDask)
            cluster.client.run(_warm)
            began = time.perf_counter()
            fleets.append(_fitted(scratch / f"workers{workers}", boards, Simulating(cluster, Production(seed=SEED))))
            seconds.append(time.perf_counter() - began)
    task_s = sum(row["seconds"] for row in noted(scratch / "workers2", "work"))
    return {
        "speedup_of_2_workers": seconds[0] / seconds[1], "load": os.getloadavg()[0],
        "task_s": task_s, "max_abs_diff": _apart(fleets),
    }  # fmt: skip


def _warm() -> None:
    """Fit a board in this process, so that its imports are not counted: they take as long as tens of boards."""
    with tempfile.TemporaryDirectory() as folder:
        Production(seed=SEED, seconds=1.0).write(Path(folder), range(1))
        work(str(Path(folder) / "board000000"), Model.open(), {}, folder)


def _apart(fleets: Sequence[Fleet]) -> float:
    """The largest difference of a number of the population, in standard errors."""
    one, other = fleets
    return max(
        abs(getattr(one.population[name], what) - getattr(other.population[name], what)) / found.se
        for name, found in one.population.items() for what in ("mean", "se", "sd", "sd_se")
    )  # fmt: skip


def show(found: dict[str, Any]) -> None:
    """Print the tables on the terminal."""
    rows = [[name, f"{value:.4g}"] for name, value in found.items() if isinstance(value, (int, float))]
    table("Boards of 12 runs of 6 s each", ["figure:", "value"], rows)
    columns = list(found["memory"][0])
    table("Memory", columns, [[f"{row[name]:.4g}" for name in columns] for row in found["memory"]])
    stdout.print("boards/s are per core, in processor time; the speedup is in wall time, at the load of the machine beside it")
