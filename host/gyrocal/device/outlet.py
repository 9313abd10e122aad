"""Where a reader connects to the simulated device: a pseudo terminal or a TCP port."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import time
from pathlib import Path
from typing import Protocol

from gyrocal.device.address import WITH_TOKEN, WITHOUT_TOKEN, is_token
from gyrocal.device.port import BUSY_NOTE, CHUNK, TOKEN_NOTE
from gyrocal.errors import GyrocalError, InputError

PSEUDO_TERMINALS = "/dev/"
"""The folder that a link to a pseudo terminal points into."""
TURN_AWAY_S = 0.2
"""Time that a second reader waits, because the first may have hung up while its last bytes are not yet read."""
UNREAD = 4 * 4096
"""Bytes that a TCP port buffers for a slow reader."""


class Outlet(Protocol):
    """The end to which a reader connects: one reader at a time, any number in succession.

    ``connected`` is True while a reader is connected. ``read`` and ``write`` never block. ``fd`` is the descriptor to wait for.
    """

    name: str

    def connected(self) -> bool:
        """True if a reader has opened the port."""

    def fd(self) -> int:
        """File descriptor to wait on."""

    def read(self) -> bytes:
        """The bytes that have arrived, without waiting."""

    def write(self, data: bytes) -> int:
        """Write as many bytes as there is room for, and return their number."""

    def drained(self) -> bool:
        """True if the reader has taken all bytes."""

    def close(self) -> None:
        """Close the port."""


class PtyOutlet(Outlet):
    """A pseudo terminal. ``symlink`` gives it a fixed name."""

    def __init__(self, symlink: Path | None = None) -> None:
        import tty

        self._master, slave = os.openpty()
        tty.setraw(slave)  # otherwise the terminal would echo sentences to the device as commands
        self._slave_name = self.name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)
        self._symlink = symlink
        if symlink is not None:
            self.name = str(symlink)
            try:
                if symlink.is_symlink() and os.readlink(symlink).startswith(PSEUDO_TERMINALS):
                    symlink.unlink()  # an earlier device's
                symlink.symlink_to(self._slave_name)
            except OSError as error:
                os.close(self._master)
                raise InputError(f"{symlink}: cannot make this link: {error.strerror}") from None

    def connected(self) -> bool:
        return not any(event & select.POLLHUP for _, event in self._poll.poll(0))

    def fd(self) -> int:
        return self._master

    def read(self) -> bytes:
        try:
            return os.read(self._master, CHUNK)
        except OSError:  # there are no bytes, or the reader has just gone
            return b""

    def write(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except OSError:
            return 0

    def drained(self) -> bool:
        """True if the reader has read everything. Unread bytes would be lost with the port."""
        import fcntl
        import termios

        slave = os.open(self._slave_name, os.O_RDWR | os.O_NOCTTY)
        try:
            unread = fcntl.ioctl(slave, termios.FIONREAD, b"\0\0\0\0")
        finally:
            os.close(slave)
        return unread == b"\0\0\0\0"

    def close(self) -> None:
        os.close(self._master)
        if self._symlink is not None and self._symlink.is_symlink() and os.readlink(self._symlink) == self._slave_name:
            self._symlink.unlink()


class TcpOutlet(Outlet):
    """A TCP port for ``socket://host:port``. Port 0 chooses a free one."""

    scheme = WITHOUT_TOKEN

    def __init__(self, address: str) -> None:
        host, _, number = address.rpartition(":")
        try:
            self._server = socket.create_server((host or "127.0.0.1", int(number)))
        except (OSError, ValueError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "write HOST:PORT, for example 127.0.0.1:5000"
            raise InputError(f"--tcp {address}: {reason}") from None
        self._server.setblocking(False)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD)
        self._client: socket.socket | None = None
        self._second: socket.socket | None = None
        self._second_s = 0.0
        self.name = f"{self.scheme}://{host or '127.0.0.1'}:{self._server.getsockname()[1]}"

    def connected(self) -> bool:
        if self._client is None:
            self._client, self._second = self._second or self._accept(), None
        elif self._second is None:
            self._second, self._second_s = self._accept(), time.monotonic()
        elif time.monotonic() - self._second_s > TURN_AWAY_S:
            with contextlib.suppress(OSError):
                self._second.send(f"# {BUSY_NOTE}\n".encode())
            self._second.close()
            self._second = None
        return self._client is not None

    def _accept(self) -> socket.socket | None:
        try:
            client, _ = self._server.accept()
        except BlockingIOError:
            return None
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client

    def fd(self) -> int:
        return self._server.fileno() if self._client is None else self._client.fileno()

    def read(self) -> bytes:
        assert self._client is not None
        try:
            data = self._client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop()
        return data

    def write(self, data: bytes) -> int:
        if self._client is None:
            return 0
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._drop()
            return 0

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def drained(self) -> bool:
        """True if the reader has hung up after the end of the stream. Closing earlier could discard data."""
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.shutdown(socket.SHUT_WR)
            self.read()
        return self._client is None

    def close(self) -> None:
        self._drop()
        if self._second is not None:
            self._second.close()
        self._server.close()


class TokenOutlet(TcpOutlet):
    """A TCP port for ``tcp://host:port``, as a board's Wi-Fi is: the core says who is taken and what waits for a reader."""

    scheme = WITH_TOKEN

    def __init__(self, address: str, token: str) -> None:
        from gyrocal.core.remote import CoreRemote

        if not is_token(token):
            raise InputError("--token: want 16 to 64 characters without spaces")
        super().__init__(address)
        self.remote = CoreRemote(token)
        self._commands = b""

    def connected(self) -> bool:
        before = self._client
        if super().connected() and before is None:
            self.remote.connect()
        self._hear()
        self._send()
        if self.remote.is_over:
            self._drop()
        return self.remote.is_reader

    def _hear(self) -> None:
        if self._client is None:
            return
        commands = self.remote.hear(super().read())
        if commands is not None:
            self._commands += commands
            return
        with contextlib.suppress(OSError):
            self._client.send(f"# {TOKEN_NOTE}\n".encode())
        self._drop()

    def _send(self) -> None:
        while self._client is not None and (waiting := self.remote.waiting()):
            sent = super().write(waiting)
            self.remote.took(sent)
            if sent < len(waiting):
                return

    def read(self) -> bytes:
        self._hear()
        commands, self._commands = self._commands, b""
        return commands

    def write(self, data: bytes) -> int:
        """Let whole lines wait as far as there is room for them."""
        taken = 0
        for line in data.splitlines(keepends=True):
            if not self.remote.tell(line):
                break
            taken += len(line)
        self._send()
        return taken

    def drained(self) -> bool:
        self._send()
        return not self.remote.waiting() and super().drained()

    def _drop(self) -> None:
        super()._drop()
        self.remote.disconnect()


def make_outlet(tcp: str | None = None, symlink: Path | None = None, token: str | None = None) -> Outlet:
    """Create a TCP port if ``tcp`` gives its address, else a pseudo terminal. ``token`` is what a reader must say first."""
    if token is not None and tcp is None:
        raise InputError("--token is for --tcp; a pseudo terminal wants none")
    if tcp is not None and token is not None:
        return TokenOutlet(tcp, token)
    if tcp is not None:
        return TcpOutlet(tcp)
    if not hasattr(os, "openpty"):
        raise GyrocalError("this system has no pseudo terminals; use --tcp 127.0.0.1:5000")
    return PtyOutlet(symlink)
