"""Training of a network: `gyrocal train` and `gyrocal export` as child processes, for torch is no part of the host."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gyrocal.errors import GyrocalError
from gyrocal.web.state.jobs import NICE, Cancelled

NEEDED = ("torch", "onnx", "onnxscript")
LOOK_S = 0.5


def missing() -> list[str]:
    """The packages that the training needs and that are not installed."""
    return [name for name in NEEDED if find_spec(name) is None]


class Training:
    """Network `gyrocal`, trained on scenarios drawn from a fitted model, and exported into its run folder.

    ``changed`` is called in the event loop after every epoch. ``done`` of ``epochs`` are complete; ``loss`` is the last one's.
    """

    def __init__(self, model: Path, axis: str, epochs: int, folder: Path, changed: Callable[[], None]) -> None:
        self.model, self.axis, self.epochs, self.folder = model, axis, epochs, folder
        self.done = 0
        self.loss: float | None = None
        self._changed = changed
        self._ends: list[float] = []
        """The times in s, by this machine's clock, at which epochs ended."""
        self._process: asyncio.subprocess.Process | None = None
        self._cancelled = False

    @property
    def left_s(self) -> float | None:
        """The estimated seconds until the last epoch ends; None before two epochs have ended."""
        if len(self._ends) < 2:
            return None
        pace_s = (self._ends[-1] - self._ends[0]) / (len(self._ends) - 1)
        return max(0.0, self._ends[-1] + pace_s * (self.epochs - self.done) - time.monotonic())

    async def run(self) -> list[dict[str, Any]]:
        """Train and export. Returns the mean absolute errors on drawn scenarios: `errors` of `gyrocal train --json`.

        Raises:
            Cancelled: :meth:`cancel` was called. The run folder is removed.
            GyrocalError: the command failed, with its message.
        """
        options = ["--net", "gyrocal", "--model", str(self.model), "--axis", self.axis, "--epochs", str(self.epochs)]
        try:
            printed = await self._gyrocal("train", *options, "--out", str(self.folder))
            await self._gyrocal("export", "--run", str(self.folder), "--out", str(self.folder))
        except BaseException:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise
        shutil.copyfile(self.model, self.folder / "model.toml")
        errors: list[dict[str, Any]] = printed["errors"]
        return errors

    def cancel(self) -> None:
        self._cancelled = True
        if self._process is not None and self._process.returncode is None:
            self._process.kill()

    def close(self) -> None:
        """Cancel the training at the end of the program, without a message."""
        self.cancel()
        shutil.rmtree(self.folder, ignore_errors=True)

    async def _gyrocal(self, *arguments: str) -> Any:
        """Run a verb and return what it prints with --json."""
        if self._cancelled:
            raise Cancelled("Training: stopped")
        command = [sys.executable, "-m", "gyrocal", *arguments, "--json"]
        pipe = asyncio.subprocess.PIPE
        self._process = await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.DEVNULL, stdout=pipe, stderr=pipe
        )
        if hasattr(os, "setpriority"):
            os.setpriority(os.PRIO_PROCESS, self._process.pid, NICE)
        talk = asyncio.create_task(self._process.communicate())
        while not (await asyncio.wait({talk}, timeout=LOOK_S))[0]:
            self._look()
        out, complaint = talk.result()
        if self._cancelled:
            raise Cancelled("Training: stopped")
        if self._process.returncode:
            last = (complaint.decode(errors="replace").strip().splitlines() or ["it gave no reason"])[-1]
            raise GyrocalError(f"Training: {last.removeprefix('gyrocal: ')}")
        return json.loads(out)

    def _look(self) -> None:
        """Read the progress from the run folder's history, which has one line for each epoch."""
        try:
            rows = (self.folder / "history.csv").read_text().splitlines()[1:]
        except OSError:
            return
        if len(rows) > self.done:
            self.done, self.loss = len(rows), float(rows[-1].split(",")[2])
            self._ends.append(time.monotonic())
            self._changed()
