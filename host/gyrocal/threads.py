"""Threads: one for each axis of a large session, and none within linear algebra.

The matrices here are small. Libraries that distribute them over threads are several times slower than one thread.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

MANY_ROWS = 1_000_000
"""The smallest number of rows for threads. With fewer, the time is mostly Python's own, and its threads wait for each other."""


def one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Run a function with BLAS held to one thread.

    Each package brings a BLAS of its own, and a limit holds for those that are loaded. SciPy's is therefore loaded here: one
    that the function loads later would spread the smallest products over all processors, and double the processor time.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        import scipy.linalg  # noqa: F401
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, "blas"):
            return function(*args, **kwargs)

    return limited


def each(work: Callable[[T], R], items: Collection[T], rows: int) -> list[R]:
    """The results of ``work`` on each item, in order. The items run in parallel if there are many ``rows``."""
    if rows < MANY_ROWS or not items:
        return [work(item) for item in items]
    with ThreadPoolExecutor(len(items)) as pool:
        return list(pool.map(work, items))
