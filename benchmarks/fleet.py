"""`gyrocal benchmark fleet`: what it costs to fit many boards as one population.

As a script it writes a simulated fleet: ``python benchmarks/fleet.py OUT --boards 200 [--plant scale_asymmetry.k=2e-6]``.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gyrocal.error_model.model import Model
from gyrocal.fleet.board import plain_fit, work
from gyrocal.fleet.engine import OnDask, engine
from gyrocal.fleet.fit import Fleet, fit_fleet
from gyrocal.fleet.listing import sessions
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import Session
from gyrocal.simulation.production import Planted, Production

BOARDS, SAMPLE_BOARDS = 200, 16
TIMED = 24
"""Boards whose plain fit and whole task are timed, in processor time of this process."""


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Return what ``gyrocal benchmark fleet --json`` prints: boards/s a core, memory in MB, and 2 workers against 1."""
    boards = SAMPLE_BOARDS if sample else BOARDS
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        Production().write(root / "boards", range(boards))
        progress(1, 4)
        plain_s, task_s = _seconds_a_board(root)
        progress(2, 4)
        found = {workers: _timed(root, workers) for workers in (1, 2)}
        progress(4, 4)
    one, two = found[1], found[2]
    return {
        "boards": boards, "plain_boards_per_s": 1 / plain_s, "task_boards_per_s": 1 / task_s, "cost_ratio": task_s / plain_s,
        "speedup_of_2_workers": one["seconds"] / two["seconds"], "max_abs_diff": _apart(one["fleet"], two["fleet"]),
        "client_mb": two["client_mb"], "worker_mb": two["worker_mb"], "summary_kb": two["summary_kb"],
    }  # fmt: skip


def _seconds_a_board(root: Path) -> tuple[float, float]:
    """Processor time of a board's plain fit, reading included, and of its whole task, s."""
    paths, model = sessions(str(root / "boards"))[:TIMED], Model.open()
    (root / "alone").mkdir()
    plain_fit(Session.open(paths[0]), model)
    began = time.process_time()
    for path in paths:
        plain_fit(Session.open(path), model)
    plain = time.process_time() - began
    began = time.process_time()
    for path in paths:
        work(path, model, {}, str(root / "alone"))
    return plain / len(paths), (time.process_time() - began) / len(paths)


def _timed(root: Path, workers: int) -> dict[str, Any]:
    out = root / f"workers{workers}"
    with engine(workers) as cluster:
        fleet = fit_fleet(str(root / "boards"), Model.open(), cluster, out)
        assert isinstance(cluster, OnDask)
        worker_mb = max(cluster.client.run(peak_mb).values())
    kept = [path.stat().st_size for path in (out / "results").glob("*.npz")]
    return {
        "seconds": fleet.seconds, "fleet": fleet, "client_mb": peak_mb(), "worker_mb": worker_mb,
        "summary_kb": sum(kept) / len(kept) / 1e3,
    }  # fmt: skip


def peak_mb() -> float:
    """The largest resident size of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _apart(one: Fleet, other: Fleet) -> float:
    """The largest difference of a number of the population, in standard errors."""
    return max(
        abs(getattr(one.population[name], what) - getattr(other.population[name], what)) / found.se
        for name, found in one.population.items() for what in ("mean", "se", "sd", "sd_se")
    )  # fmt: skip


def show(found: dict[str, Any]) -> None:
    """Print the table on the terminal."""
    rows = [[name, f"{value:.4g}"] for name, value in found.items()]
    table("Boards of 12 runs of 6 s each", ["figure:", "value"], rows)
    stdout.print("boards/s are per core, in processor time; a fleet's wall time also holds what else runs on the machine")


def _planted(text: str) -> Planted:
    """``EFFECT.PARAMETER=MEAN[+-SD]``."""
    name, _, size = text.partition("=")
    effect_id, _, parameter = name.partition(".")
    mean, _, sd = size.partition("+-")
    return Planted(effect_id, parameter, float(mean), float(sd or 0.0))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--boards", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first board")
    parser.add_argument("--rigs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=6.0, help="length of a run")
    parser.add_argument("--plant", type=_planted, action="append", default=[], metavar="EFFECT.PARAMETER=MEAN[+-SD]")
    given = parser.parse_args()
    made = Production(given.plant, rigs=given.rigs, seed=given.seed, seconds=given.seconds)
    made.write(given.out, range(given.first, given.first + given.boards))
