"""Results that several steps need of the same runs are computed once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

if TYPE_CHECKING:
    from gyrocal.recording.run import Run

P = ParamSpec("P")
T = TypeVar("T")


def once(function: Callable[Concatenate[Sequence[Run], int, P], T]) -> Callable[Concatenate[Sequence[Run], int, P], T]:
    """A function of runs and an axis whose result is kept with the first run, for as long as that run exists.

    Runs count as the same if they are the same objects in the same order. Further arguments must be hashable; a result is
    kept for each. The result must not be changed by its callers.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def kept(runs: Sequence[Run], axis: int, *args: P.args, **kwargs: P.kwargs) -> T:
        if not runs:
            return function(runs, axis, *args, **kwargs)
        results = runs[0].__dict__.setdefault("_once", {})
        key = name, axis, args, *kwargs.items()
        earlier, result = results.get(key, ((), None))
        if len(earlier) != len(runs) or any(a is not b for a, b in zip(earlier, runs, strict=True)):
            result = function(runs, axis, *args, **kwargs)
            results[key] = (tuple(runs), result)
        return result

    return kept


def once_a_run(function: Callable[Concatenate[Run, P], T]) -> Callable[Concatenate[Run, P], T]:
    """A function of a run whose result is kept with the run, for each of its further arguments.

    The result must be small, or a view of what the run holds anyway, and not be changed by its callers.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def kept(run: Run, *args: P.args, **kwargs: P.kwargs) -> T:
        results: dict[Any, T] = run.__dict__.setdefault("_once_a_run", {})
        key = name, args, *kwargs.items()
        if key not in results:
            results[key] = function(run, *args, **kwargs)
        return results[key]

    return kept
