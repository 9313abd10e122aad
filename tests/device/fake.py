"""A device made of Python at a TCP port: it can do what a real one does when things go wrong."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from typing import Any

from gyrocal.device import wire

HELLO = {
    "proto": 1, "fw": "fake", "sensor": "LSM6DSO", "rate_hz": 100.0, "full_scale_dps": 250.0, "lsb_dps": 0.00875,
    "lsb_g": 6.1e-05, "lsb_c": 0.00390625, "zero_c": 25.0, "axis": "z", "table_dps": 78.0, "turn_deg": 0.0,
}  # fmt: skip
PERIOD_US = 10000


class FakeDevice:
    """Answers every command; `run` is called in the device's thread when a run starts.

    `refuses` maps a command's first word to the fields of the $ERR that answers it; `hello` replaces fields of $HEL.
    """

    def __init__(
        self,
        run: Callable[[FakeDevice], None] = lambda device: None,
        hello: dict[str, Any] | None = None,
        refuses: dict[str, dict[str, Any]] | None = None,
        silent: bool = False,
    ) -> None:
        self.commands: list[str] = []
        self.connections = self.answered = 0
        self.settings: dict[str, str] = {}
        self.face = ""
        self.seq = 0
        self._run, self._refuses, self._silent = run, refuses or {}, silent
        self._hello = {**HELLO, **(hello or {})}
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._client: socket.socket | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> FakeDevice:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closed = True
        self.unplug()
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._thread.join(5)

    def say(self, tag: str, fields: Any, t_us: int = 0, seq: int | None = None) -> None:
        self.seq = self.seq if seq is None else seq
        line = wire.encode(tag, self.seq, t_us, 0, fields)
        self.seq += 1
        if self._client is not None:
            self._client.sendall(line)

    def sample(self, n: int, rate_counts: int = 8914, missed: int = 0) -> None:
        """The run's sample number `n`, taken when the sensor has already missed so many."""
        self.say("RAW", [n, 1, -2, rate_counts, 0, 0, 16393, 256], t_us=2_000_000 + (n + missed) * PERIOD_US)

    def unplug(self) -> None:
        """The cable is pulled; the next connection is a new one."""
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.shutdown(socket.SHUT_RDWR)

    def _serve(self) -> None:
        while not self._closed:
            try:
                self._client, _ = self._server.accept()
            except OSError:
                return
            self.connections += 1
            with contextlib.suppress(OSError):
                self._converse(self._client)
            self._client.close()
            self._client = None

    def _converse(self, client: socket.socket) -> None:
        buffer = b""
        while data := client.recv(4096):
            buffer += data
            *lines, buffer = buffer.split(b"\n")
            for line in lines:
                self._obey(line.decode())
                self.answered += 1

    def _obey(self, text: str) -> None:
        self.commands.append(text)
        if self._silent:
            return
        words = text.split()
        if words[0] in self._refuses:
            self.say("ERR", self._refuses[words[0]])
            return
        self.say("ACK", {"cmd": words[0]})
        if words[0] == "hello":
            self.say("HEL", self._hello)
        elif words[0] == "status":
            self.say("STA", {"state": "recording" if self.face else "idle", "face": self.face, "n": 0})
        elif words[0] == "set":
            self.settings[words[1]] = words[2]
        elif words[0] == "stop":
            self.run_sentence("end", self.face)
        elif words[0] == "start":
            self.run_sentence("start", words[1])
            self._run(self)

    def run_sentence(self, state: str, face: str) -> None:
        self.face = face if state == "start" else ""
        rate = self.settings.get("table_dps", "78")
        fields = {
            "state": state, "face": face, "axis": self.settings.get("axis", "z"),
            "table_dps": None if rate == "none" else float(rate), "turn_deg": float(self.settings.get("turn_deg", 0)),
        }  # fmt: skip
        self.say("RUN", fields)
