"""Simulated boards for the fleet's benchmarks, each made by the worker that fits it, so that ten thousand need no disk.

As a script it writes a fleet: ``python benchmarks/fleet_boards.py OUT --boards 200 [--plant scale_asymmetry.k=2e-6]``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gyrocal.files import replace_text
from gyrocal.fleet.board import Done, code_digest
from gyrocal.fleet.engine import Engine, refuse
from gyrocal.simulation.production import Planted, Production

DONE = "done"


def listed(folder: Path, boards: range) -> str:
    """A list of the paths of boards that :class:`Simulating` makes."""
    (folder / DONE).mkdir(parents=True, exist_ok=True)
    path = folder / f"boards{len(boards)}.json"
    path.write_text(json.dumps([f"board{number:06d}" for number in boards]))
    return str(path)


@dataclass
class Simulating(Engine):
    """An engine whose workers simulate each session before they work on it, and remove it afterwards.

    Beside each session's outcome, ``done`` holds the task's processor time and the peak memory of its worker.
    """

    on: Engine
    production: Production
    dashboard: str | None = None

    def run(self, task: Any, jobs: Sequence[Any], given_up: Any = refuse) -> Iterator[Any]:
        yield from self.on.run(partial(_simulated, task=task, production=self.production), jobs, given_up)


def _simulated(path: str, task: partial[Done], production: Production) -> Done:
    folder = Path(path)
    told = {name: given.toml() if name == "model" else repr(given) for name, given in task.keywords.items()}
    state = f"{task.func.__name__} {production} {sorted(told.items())} {code_digest().hex()}"
    note = folder.parent / DONE / f"{folder.name}.{hashlib.blake2b(state.encode(), digest_size=8).hexdigest()}.json"
    if note.is_file():
        row = json.loads(note.read_text())
        return Done(path, row["key"], row["reason"])
    number = int(folder.name.removeprefix("board"))
    production.write(folder.parent, range(number, number + 1))
    began = time.process_time()
    done = task(path)
    seconds = time.process_time() - began
    shutil.rmtree(folder)
    row = {"task": task.func.__name__, "key": done.key, "reason": done.reason, "seconds": seconds, "peak_mb": peak_mb()}
    replace_text(note, json.dumps(row), durable=False)
    return done


def noted(folder: Path, task: str) -> list[dict[str, Any]]:
    """What the workers noted of the tasks ``task``."""
    rows = [json.loads(path.read_text()) for path in sorted((folder / DONE).glob("*.json"))]
    return [row for row in rows if row["task"] == task]


def peak_mb() -> float:
    """The largest resident size of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


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
