"""What benchmarks of many seeded sessions have in common: rows that are kept as they are finished, and shares with limits."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

Row = dict[str, Any]
Job = tuple[str, int]
"""Kind and seed of a session."""


def judged(
    judge: Callable[[Job], Row], jobs: Sequence[Job], results: Path | None, progress: Callable[[int, int], None],
    workers: int = 1,
) -> list[Row]:  # fmt: skip
    """The row of each job, with its keys ``kind`` and ``seed``, in the order of the jobs.

    Each new row is a line of ``results``. Jobs that are there already are not judged again.
    """
    known = results.read_text(encoding="utf-8").splitlines() if results is not None and results.is_file() else []
    done = {(row["kind"], row["seed"]): row for row in map(json.loads, known)}
    left = [job for job in jobs if job not in done]
    for count, row in enumerate(_each(judge, left, workers), len(jobs) - len(left) + 1):
        done[row["kind"], row["seed"]] = row
        if results is not None:
            with results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        progress(count, len(jobs))
    return [done[job] for job in jobs]


def _each(judge: Callable[[Job], Row], jobs: Sequence[Job], workers: int) -> Iterator[Row]:
    if workers <= 1:
        yield from map(judge, jobs)
    else:
        with ProcessPoolExecutor(workers) as pool:
            yield from pool.map(judge, jobs)


def bounds(count: int, n: int) -> list[float]:
    """Both ends of the 95 % interval of a rate (Clopper and Pearson)."""
    from scipy.stats import beta

    low = 0.0 if count == 0 else float(beta.ppf(0.025, count, n - count + 1))
    return [low, 1.0 if count == n else float(beta.ppf(0.975, count + 1, n - count))]


def share(count: int, limits: Sequence[float], n: int) -> str:
    """A rate and its limits in words."""
    return f"{count}/{n} ({limits[0]:.0%}-{limits[1]:.0%})"
