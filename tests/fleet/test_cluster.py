"""A real cluster of processes on this machine: the same answer as in one process, also if a worker is killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.fleet.board import Done
from gyrocal.fleet.engine import InProcess, engine, refuse
from gyrocal.fleet.fit import fit_fleet
from gyrocal.simulation.production import Production

BOARDS = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("cluster") / "boards"
    Production(seconds=1.0).write(root, range(BOARDS))
    return root


def pid_of_worker() -> int:
    return os.getpid()


def profiled(dask_worker: Any) -> int:
    """Samples of the worker's stack that Dask holds in memory, after it had the time to take a hundred."""
    time.sleep(1.0)
    return int(dask_worker.profile_recent["count"]) + sum(one["count"] for _, one in dask_worker.profile_history)


def slowly(path: str, task: Callable[[str], Done]) -> Done:
    """A task that lasts long enough to be killed in the middle."""
    time.sleep(0.1)
    return task(path)


def slowly_named(job: int) -> int:
    time.sleep(0.3)
    return job


@dataclass
class Killing:
    """A cluster of which one worker is killed after the first result."""

    on: object
    dashboard: str | None = None
    killed: list[int] = field(default_factory=list)

    def run(self, task: Any, jobs: Sequence[Any], given_up: Any = refuse) -> Iterator[Any]:
        for done in self.on.run(partial(slowly, task=task), jobs, given_up):  # type: ignore[attr-defined]
            if not self.killed:
                pids = self.on.client.run(pid_of_worker)  # type: ignore[attr-defined]
                self.killed.append(pids[sorted(pids)[0]])
                os.kill(self.killed[0], signal.SIGKILL)
            yield done


@pytest.mark.wide
def test_a_killed_worker_costs_only_its_unfinished_tasks(
    folder: Path, require_module: Callable[[str], None]
) -> None:  # fmt: skip
    require_module("distributed")
    with engine(2) as cluster:
        killing = Killing(cluster)
        there = fit_fleet(str(folder), Model.open(), killing, folder.parent / "cluster").to_json()
    here = fit_fleet(str(folder), Model.open(), InProcess(), folder.parent / "here").to_json()
    assert len(killing.killed) == 1
    assert there["failed"] == []
    assert there["boards"] == BOARDS
    for name, one in here["population"].items():
        assert there["population"][name] == pytest.approx(one, rel=1e-9, abs=1e-15)
    assert {k: v for k, v in there.items() if k != "sessions_per_s"} == {k: v for k, v in here.items() if k != "sessions_per_s"}


@pytest.mark.wide
def test_a_worker_keeps_no_history_of_what_it_did(require_module: Callable[[str], None]) -> None:
    require_module("distributed")
    with engine(1) as cluster:
        list(cluster.run(slowly_named, range(3)))
        assert set(cluster.client.run(profiled).values()) == {0}  # type: ignore[attr-defined]


@dataclass
class Cluster:
    """A scheduler and a worker, started as a user starts them, at the same address after each restart."""

    address: str
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self) -> None:
        port = self.address.rpartition(":")[2]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        scheduler = ["scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"]
        worker = ["worker", self.address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        self.processes = [
            subprocess.Popen([sys.executable, "-m", "dask", *role], env=env, stderr=subprocess.DEVNULL)
            for role in (scheduler, worker)
        ]

    def kill(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.mark.wide
def test_a_scheduler_that_restarts_costs_only_unfinished_tasks(require_module: Callable[[str], None]) -> None:
    require_module("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        there = Cluster(f"tcp://127.0.0.1:{free.getsockname()[1]}")
    with ExitStack() as stack:
        stack.callback(there.kill)
        there.start()
        cluster = stack.enter_context(engine(scheduler=there.address))
        done = []
        for job in cluster.run(slowly_named, range(6)):
            done.append(job)
            if len(done) == 2:
                there.kill()
                there.start()
    assert sorted(done) == list(range(6))


def test_options_that_exclude_each_other() -> None:
    with pytest.raises(InputError, match="not together"), engine(2, "tcp://127.0.0.1:1"):
        pass
    with pytest.raises(InputError, match="0 or more"), engine(-1):
        pass
