"""The state of the device for the page: the latest samples, state and results, and the process that reads its port."""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyrocal.errors import InputError

if TYPE_CHECKING:
    from gyrocal.device.record import Wanted
    from gyrocal.web.device.listener import News
    from gyrocal.web.device.samples import Samples

PORTS = re.compile(r"/dev/(tty|cu)[\w.-]+|/dev/pts/\d+|COM\d+|socket://(127\.0\.0\.1|localhost|\[::1\]):\d+")
"""Names of ports that the page may open: serial devices, and sockets of this machine."""


def described(port: Any) -> str:
    """A port of pyserial's list in words: its name, maker, product, USB numbers and serial number, as far as it tells them."""
    parts = [text for text in (port.manufacturer, port.product or port.description) if text and text != "n/a"]
    if port.vid is not None:
        parts.append(f"USB {port.vid:04x}:{port.pid:04x}")
    if port.serial_number:
        parts.append(f"no. {port.serial_number}")
    return f"{port.device}: {', '.join(dict.fromkeys(parts))}" if parts else str(port.device)


class Live:
    """The connection to at most one device. ``changed`` is called in the event loop for all news except samples."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self.port = ""
        self.status: dict[str, Any] = {}
        self.sensors: dict[int, Samples] = {}
        self.newest: tuple[int, float] = (0, 0.0)
        """Device time of the newest sample in us, and its arrival by this machine's clock in s."""
        self.trusted: set[str] = set()
        """Ports named on the command line, and simulated devices."""
        self._changed = changed
        self._page: Connection | None = None
        self._process: Any = None
        self._simulated: subprocess.Popen[str] | None = None

    @property
    def connected(self) -> bool:
        return bool(self.status.get("connected"))

    def sensor(self, imu: int) -> dict[str, Any]:
        """State, face, waits, run_s, hello, rate_hz, missed and results of one sensor; empty before its first sentence."""
        found: dict[str, Any] = self.status.get("sensors", {}).get(imu, {})
        return found

    @property
    def simulated(self) -> bool:
        return self._simulated is not None

    @property
    def ended(self) -> bool:
        """True if a simulated device has played its recording to the end; its process ends some time after its line."""
        if self._simulated is None:
            return False
        hung_up = bool(self.status.get("sensors")) and not self.connected
        return hung_up or self._simulated.poll() is not None

    def ports(self) -> dict[str, str]:
        """The ports named on the command line and the devices that are plugged in, each with what it is."""
        from serial.tools.list_ports import comports

        found = {port.device: described(port) for port in sorted(comports()) if port.hwid != "n/a"}
        return {name: f"{name} (given by --port)" for name in sorted(self.trusted - set(found))} | found

    def check(self, name: str) -> None:
        """Raise InputError if the page may not open a port of that name."""
        from serial.tools.list_ports import comports

        if name not in self.trusted and not PORTS.fullmatch(name) and name not in {p.device for p in comports()}:
            raise InputError(f"{name}: not a serial port; another kind is given as `gyrocal workbench --port`")

    def connect(self, name: str) -> None:
        """Listen at a port from now on. News arrive without further calls."""
        from gyrocal.web.device.listener import listen

        self.check(name)
        self.disconnect(keep_simulated=True)
        context = multiprocessing.get_context("spawn")
        self._page, theirs = context.Pipe()
        self._process = context.Process(target=listen, args=(theirs, name), name="gyrocal listener", daemon=True)
        self._process.start()
        theirs.close()
        self.port, self.status = name, {"connected": False, "problem": ""}
        threading.Thread(target=self._hear, args=(self._page, asyncio.get_running_loop()), daemon=True).start()
        self._changed()

    def disconnect(self, *, keep_simulated: bool = False) -> None:
        if self._page is not None:
            self._page.close()
            self._page = None
            self._process.join(2.0)
            self._process.kill()
        if self._simulated is not None and not keep_simulated:
            self.trusted.discard(self.port)
            self._simulated.terminate()
            self._simulated.wait()
            self._simulated = None
        self.port, self.status, self.sensors = "", {}, {}

    close = disconnect

    async def simulate(self, link: Path, options: list[str]) -> None:
        """Start `gyrocal device` behind ``link`` and listen to it."""
        self.disconnect()
        command = [sys.executable, "-m", "gyrocal", "device", "--link", str(link), *options]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
        )
        self._simulated = process
        assert process.stdout is not None
        assert process.stderr is not None
        port = (await asyncio.to_thread(process.stdout.readline)).strip()
        if self._simulated is not process:  # it was given up while it started
            return
        if not port:
            problem = (await asyncio.to_thread(process.stderr.read)).strip()
            self._simulated = None
            raise InputError(problem.removeprefix("gyrocal: ") or "the simulated device did not start")
        self.trusted.add(port)
        self.connect(port)

    def record(self, out: Path, wanted: Wanted | None, scenario: str, imu: int = 0, *, by_hand: bool = False) -> None:
        """Record the wanted run of a sensor, or for None every run that it announces, until it ends or is stopped.

        ``by_hand`` records one run without a rate until its aims are met.
        """
        self._tell("record", str(out), wanted, scenario, imu, by_hand)

    def stop(self) -> None:
        self._tell("stop")

    def say(self, command: str) -> None:
        """Send a command as text of the protocol."""
        self._tell("say", command)

    def _tell(self, *words: Any) -> None:
        if self._page is not None:
            with contextlib.suppress(OSError):
                self._page.send(words)

    def _hear(self, page: Connection, loop: asyncio.AbstractEventLoop) -> None:
        with contextlib.suppress(EOFError, OSError, RuntimeError, TypeError):  # TypeError: closed while it waits
            while True:
                news: News = page.recv()
                if page is not self._page:
                    return
                if news.samples:
                    self._take(news.samples)
                if news.status is not None:
                    self.status = news.status
                    loop.call_soon_threadsafe(self._changed)

    def _take(self, samples: list[tuple[Any, ...]]) -> None:
        from gyrocal.web.device.samples import Samples

        for imu in {s[0] for s in samples}:
            self.sensors.setdefault(imu, Samples()).extend([[s[1] * 1e-6, *s[2:]] for s in samples if s[0] == imu])
        self.newest = (samples[-1][1], time.monotonic())
