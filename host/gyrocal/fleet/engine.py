"""Where tasks run: in this process, on processes of this machine, or on a running Dask scheduler.

Only a bounded number of tasks is submitted at a time, and each result makes room for the next task, so that the memory of
client and scheduler does not grow with the fleet. A task whose worker dies is run again on another worker. A task after which
several workers died is given up with a reason. Unfinished tasks are submitted again if the scheduler restarts. Benchmarks and
the draws of a training run on the same engine.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from tempfile import TemporaryDirectory
from typing import Any, Protocol, TypeVar

from gyrocal.errors import GyrocalError, InputError
from gyrocal.extras import want

HERE = "127.0.0.1"
"""The address where the scheduler, its workers and its dashboard listen, which no other machine can reach."""
AHEAD = 4
"""Tasks that are submitted for each worker."""
PATIENCE_S = 60
"""Time to wait for a scheduler or worker that went away, s."""
RESUBMITTED = 5
"""Number of times that a task is submitted again after its scheduler lost it."""

J = TypeVar("J")
T = TypeVar("T")
GivenUp = Callable[[J, str], T]
"""What stands for the result of a job that was given up for a reason."""


def refuse(job: object, reason: str) -> Any:
    """Stop at a job that was given up. Raises GyrocalError."""
    raise GyrocalError(f"{job}: {reason}; run the command again: what is finished is kept")


class Engine(Protocol):
    """Runs a task for each job and yields the results as they arrive."""

    dashboard: str | None

    def run(self, task: Callable[[J], T], jobs: Sequence[J], given_up: GivenUp[J, T] = refuse) -> Iterator[T]:
        """Run ``task`` for each of ``jobs``, and yield the results as they are done."""


class InProcess(Engine):
    """One task after another, in this process."""

    dashboard: str | None = None

    def run(self, task: Callable[[J], T], jobs: Sequence[J], given_up: GivenUp[J, T] = refuse) -> Iterator[T]:
        yield from map(task, jobs)


class OnDask(Engine):
    """Tasks on the workers of a Dask client."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.dashboard: str | None = client.dashboard_link or None

    def run(self, task: Callable[[J], T], jobs: Sequence[J], given_up: GivenUp[J, T] = refuse) -> Iterator[T]:
        from distributed import as_completed

        waiting, running, tries = iter(range(len(jobs))), {}, [0] * len(jobs)
        window = AHEAD * max(1, sum(self.client.nthreads().values()))

        def submit(number: int) -> Any:
            tries[number] += 1
            future = self.client.submit(task, jobs[number], pure=False)
            running[future.key] = number
            return future

        arrived = as_completed([submit(number) for number in islice(waiting, window)])
        for future in arrived:
            number = running.pop(future.key)
            if future.status in ("cancelled", "lost") and tries[number] < RESUBMITTED:
                self._wait(jobs[number])
                arrived.add(submit(number))
                continue
            yield _outcome(future, jobs[number], given_up)
            for following in islice(waiting, 1):
                arrived.add(submit(following))

    def _wait(self, job: object) -> None:
        try:
            self.client.wait_for_workers(1, timeout=PATIENCE_S)
        except Exception as error:
            refuse(job, f"the scheduler went away while it was computed ({error})")


def _outcome(future: Any, job: J, given_up: GivenUp[J, T]) -> T:
    if future.status == "finished":
        done: T = future.result()
        future.release()
        return done
    error = future.exception() if future.status == "error" else "the scheduler lost it"
    return given_up(job, f"its workers died or failed: {' '.join(str(error).split())[:200]}")


@contextmanager
def engine(workers: int | None = None, scheduler: str | None = None) -> Iterator[Engine]:
    """The engine that the options ask for: ``workers`` processes here (None: one a core; 0: this process), or a scheduler.

    Raises InputError if Dask is not installed or the scheduler does not answer.
    """
    if workers is not None and (workers < 0 or scheduler is not None):
        raise InputError("--workers: 0 or more, and not together with --scheduler")
    if workers == 0:
        yield InProcess()
        return
    want("a cluster (other than --workers 0)", "fleet")
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE_S)
        except (OSError, ValueError) as error:
            raise InputError(f"--scheduler {scheduler}: no answer ({error}); is `dask scheduler` running there?") from None
        with client:
            yield OnDask(client)
        return
    count = workers or os.cpu_count() or 1
    options = {"host": HERE, "dashboard_address": f"{HERE}:0", "silence_logs": "CRITICAL"}
    with (
        TemporaryDirectory(prefix="gyrocal-", ignore_cleanup_errors=True) as scratch,
        dask.config.set(
            {
                "distributed.worker.profile.enabled": False,  # whose history is 250 MB of a worker after 1000 s
                "temporary-directory": scratch,  # whose locks Dask would leave behind
            }
        ),
        LocalCluster(n_workers=count, threads_per_worker=1, processes=True, **options) as here,
        Client(here) as client,
    ):
        yield OnDask(client)
