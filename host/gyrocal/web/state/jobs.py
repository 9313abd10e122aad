"""Long jobs in a separate process, one at a time, with progress. A job can be stopped at any time."""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from gyrocal.errors import GyrocalError

SEARCHES = ("diagnose", "add", "explain", "keep", "without", "hold")
"""The jobs that diagnose or change the model."""
NICE = 10
"""Niceness of the worker, so that the page and the serial port have priority."""


class Cancelled(GyrocalError):
    """The user stopped the job."""


@dataclass
class Job:
    """The current job, for the page."""

    title: str
    method: str
    """The name of a method of :class:`~gyrocal.web.worker.bench.Bench`."""
    text: str = ""
    began: float = field(default_factory=time.monotonic)


class Jobs:
    """One worker process, which starts with the first job and stays.

    ``changed`` is called in the event loop whenever ``current`` changes.
    """

    def __init__(self, scratch: Path, changed: Callable[[], None]) -> None:
        self.current: Job | None = None
        self._scratch, self._changed = scratch, changed
        self._lock = asyncio.Lock()
        self._cancelled = False
        self._generation = 0
        self._process: Any = None
        self._ahead: tuple[str, tuple[Any, ...]] | None = None
        """The job that was sent before it was asked for."""

    def prepare(self, method: str = "", *args: Any) -> None:
        """Start the worker before its first job, because its imports take time, with that job if it is known."""
        if self._process is None:
            self._start()
            if method:
                self._link.send((method, args))
                self._ahead = (method, args)

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._link, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(theirs, self._scratch), name="gyrocal worker", daemon=True)
        self._process.start()
        theirs.close()

    async def run(self, title: str, method: str, *args: Any) -> Any:
        """Call a method of :class:`~gyrocal.web.worker.bench.Bench` in the worker, and return its result.

        Raises:
            Cancelled: :meth:`cancel` or :meth:`drop` was called.
            GyrocalError: the method raised it, or the worker died.
        """
        generation = self._generation
        async with self._lock:
            if generation != self._generation:
                raise Cancelled  # what runs says that it was stopped; what waits says nothing
            self.current, self._cancelled = Job(title, method), False
            self._changed()
            answer = None
            try:
                self.prepare()
                answer = await self._converse(method, args)
            except (EOFError, OSError):
                if not self._cancelled:
                    self._end()
                    raise GyrocalError(f"{title}: the worker process ended; check that there is enough memory") from None
            finally:
                if self._cancelled:  # it was killed, whether or not its answer was on its way
                    self._end()
                self.current = None
                self._changed()
            if self._cancelled:
                raise Cancelled(f"{title}: stopped")
            return answer

    async def _converse(self, method: str, args: tuple[Any, ...]) -> Any:
        ahead, self._ahead = self._ahead, None
        if ahead != (method, args):
            if ahead is not None:  # another job came first
                self._end()
                self.prepare()
            self._link.send((method, args))
        while True:
            kind, value = await _in_thread(self._link.recv)
            if kind == "progress":
                if self.current is not None:
                    self.current.text = value
                self._changed()
            elif kind == "error":
                raise GyrocalError(value)
            else:
                return value

    def cancel(self) -> None:
        """Stop the current job and all jobs that wait."""
        self._generation += 1
        if self.current is not None and self._process is not None:
            self._cancelled = True
            self._process.kill()

    def close(self) -> None:
        self.cancel()
        self._end()

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = self._ahead = None


async def _in_thread(function: Callable[[], Any]) -> Any:
    """Run a function in a daemon thread, so that a function that never returns does not delay the end of the program."""
    loop = asyncio.get_running_loop()
    future: asyncio.Future[Any] = loop.create_future()

    def settle(value: Any, error: BaseException | None) -> None:
        if not future.done():
            future.set_result(value) if error is None else future.set_exception(error)

    def call() -> None:
        value, failed = None, None
        try:
            value = function()
        except BaseException as error:
            failed = error
        with contextlib.suppress(RuntimeError):  # the loop has been closed meanwhile
            loop.call_soon_threadsafe(settle, value, failed)

    threading.Thread(target=call, daemon=True).start()
    return await future


def work(link: Connection, scratch: Path) -> None:
    """The loop of the worker: take a method's name and arguments, answer with progress and a result, until the page ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(NICE)
    from gyrocal.web.worker.opened import Opened

    opened = Opened(scratch)
    bench: Any = None
    said, saying = 0.0, threading.Lock()

    def progress(text: str) -> None:
        nonlocal said
        with saying:  # a large session's axes are worked on side by side
            if time.monotonic() - said > 0.05:
                said = time.monotonic()
                link.send(("progress", text))

    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            if bench is None and not link.poll():  # the engine is imported while there is nothing else to do
                bench = _bench(opened)
            method, args = link.recv()
            try:
                if bench is None and method != "open":
                    bench = _bench(opened)
                answer = ("result", getattr(opened if method == "open" else bench, method)(*args, progress=progress))
            except GyrocalError as error:
                answer = ("error", " ".join(str(error).split()))
            except MemoryError:
                answer = ("error", "not enough memory for this session")
            except Exception as error:
                traceback.print_exc(file=sys.stderr)
                answer = ("error", f"{type(error).__name__}: {error}")
            link.send(answer)


def _bench(opened: Any) -> Any:
    from gyrocal.web.worker.bench import Bench

    return Bench(opened)
