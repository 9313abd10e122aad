"""A network between a reader and a device that delays, cuts and chops what it carries."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections import deque


class Proxy:
    """Carries bytes between its own port and a device's, one connection at a time.

    Args:
        to: the device's port, ``SCHEME://HOST:PORT``.
        delay_s: how much later everything arrives, each way.
        piece: the most bytes that are passed on at once; 0 for all.
        cuts: after so many bytes to the reader each connection in turn is cut; later ones are not.
    """

    def __init__(self, to: str, *, delay_s: float = 0.0, piece: int = 0, cuts: tuple[int, ...] = ()) -> None:
        self.connections = 0
        self._scheme, _, address = to.partition("://")
        host, _, port = address.rpartition(":")
        self._device = (host, int(port))
        self._delay_s, self._piece, self._cuts = delay_s, piece, deque(cuts)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = f"{self._scheme}://127.0.0.1:{self._server.getsockname()[1]}"
        self._closed = False
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Proxy:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closed = True
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._thread.join(5)

    def _serve(self) -> None:
        while not self._closed:
            try:
                reader, _ = self._server.accept()
            except OSError:
                return
            self.connections += 1
            with contextlib.suppress(OSError), reader, socket.create_connection(self._device) as device:
                self._carry(reader, device, self._cuts.popleft() if self._cuts else None)

    def _carry(self, reader: socket.socket, device: socket.socket, left: int | None) -> None:
        underway: deque[tuple[float, socket.socket, bytes]] = deque()
        open_ends = [reader, device]
        while not self._closed and (device in open_ends or underway):
            ready, _, _ = select.select(open_ends, [], [], 0.002)
            for source in ready:
                data = source.recv(65536)
                if not data and source is reader:
                    return
                if not data:
                    open_ends.remove(device)
                    continue
                underway.append((time.monotonic() + self._delay_s, device if source is reader else reader, data))
            left = self._deliver(underway, reader, left)
            if left == 0:
                return

    def _deliver(
        self, underway: deque[tuple[float, socket.socket, bytes]], reader: socket.socket, left: int | None
    ) -> int | None:
        while underway and underway[0][0] <= time.monotonic():
            _, to, data = underway.popleft()
            if to is reader and left is not None:
                data = data[:left]
                left -= len(data)
            step = self._piece or len(data) or 1
            for at in range(0, len(data), step):
                to.sendall(data[at : at + step])
            if left == 0:
                return 0
        return left
