"""Results that several steps need of the same runs are computed once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import TypeVar

from gyrocal.recording.session import Run

T = TypeVar("T")


def once(function: Callable[[Sequence[Run], int], T]) -> Callable[[Sequence[Run], int], T]:
    """A function of runs and an axis whose result is kept with the first run, for as long as that run exists.

    Runs count as the same if they are the same objects in the same order. The result must not be changed by its callers.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def kept(runs: Sequence[Run], axis: int) -> T:
        if not runs:
            return function(runs, axis)
        results = runs[0].__dict__.setdefault("_once", {})
        earlier, result = results.get((name, axis), ((), None))
        if len(earlier) != len(runs) or any(a is not b for a, b in zip(earlier, runs, strict=True)):
            result = function(runs, axis)
            results[name, axis] = (tuple(runs), result)
        return result

    return kept


def once_a_run(function: Callable[[Run], T]) -> Callable[[Run], T]:
    """A function of a run whose result is kept with the run. The result must be small, and not be changed by its callers."""
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def kept(run: Run) -> T:
        results: dict[str, T] = run.__dict__.setdefault("_once_a_run", {})
        if name not in results:
            results[name] = function(run)
        return results[name]

    return kept
