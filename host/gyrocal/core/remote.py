"""The core's remote reader (gc_remote.h): what a board's radio takes, refuses, keeps waiting and drops."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

from gyrocal.core.library import SHARED, build
from gyrocal_firmware import CORE

SHIM = Path(__file__).with_name("remote_shim.c")
SOURCES = ("gc_remote.c", "gc_wire.c", "gc_format.c")
MOST = 4096
"""The largest number of bytes that are heard or sent at once."""
LINE = 128
"""More than a command is long."""


class CoreRemote:
    """A reader at a connection that the caller accepts, reads and writes. ``is_reader`` is False until the token came."""

    def __init__(self, token: str) -> None:
        sources = [*(CORE / name for name in SOURCES), SHIM]
        library = ctypes.CDLL(str(build("remote", sources, [CORE], SHARED)))
        pointer, size, us = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint64
        for name, result, arguments in (
            ("bytes", size, ()),
            ("init", None, (pointer, ctypes.c_char_p)),
            ("connect", ctypes.c_bool, (pointer, us)),
            ("disconnect", None, (pointer,)),
            ("hear", ctypes.c_int, (pointer, ctypes.c_char_p, size, us, ctypes.c_char_p)),
            ("is_reader", ctypes.c_bool, (pointer,)),
            ("is_over", ctypes.c_bool, (pointer, us)),
            ("tell", ctypes.c_int, (pointer, ctypes.c_char_p, size)),
            ("waiting", size, (pointer, size, ctypes.POINTER(pointer), us)),
            ("took", None, (pointer, size, us)),
            ("refused", ctypes.c_uint32, (pointer,)),
        ):
            function = library[f"gyrocal_remote_{name}"]
            function.restype, function.argtypes = result, arguments
        self._call = library
        self._shim = ctypes.create_string_buffer(library.gyrocal_remote_bytes() + 8)
        self._call.gyrocal_remote_init(self._shim, token.encode("ascii"))

    @property
    def is_reader(self) -> bool:
        """True while somebody is connected who gave the token."""
        return bool(self._call.gyrocal_remote_is_reader(self._shim))

    @property
    def is_over(self) -> bool:
        """True if the connection must be closed."""
        return bool(self._call.gyrocal_remote_is_over(self._shim, _now_us()))

    @property
    def refused(self) -> int:
        """The number of connections without the right token."""
        return int(self._call.gyrocal_remote_refused(self._shim))

    def connect(self) -> bool:
        """Somebody has connected. False if another one is there."""
        return bool(self._call.gyrocal_remote_connect(self._shim, _now_us()))

    def disconnect(self) -> None:
        """Nobody is connected any more."""
        self._call.gyrocal_remote_disconnect(self._shim)

    def hear(self, data: bytes) -> bytes | None:
        """Take bytes that came, and return the whole commands; None if they were to be the token and are not."""
        commands = ctypes.create_string_buffer(len(data) + LINE)
        n = self._call.gyrocal_remote_hear(self._shim, data, len(data), _now_us(), commands)
        return None if n < 0 else commands.raw[:n]

    def tell(self, line: bytes) -> bool:
        """Let a line wait. False if there is no room, or nobody to send it to."""
        return bool(self._call.gyrocal_remote_tell(self._shim, line, len(line)))

    def waiting(self, most: int = MOST) -> bytes:
        """The bytes to send next."""
        data = ctypes.c_void_p()
        n = self._call.gyrocal_remote_waiting(self._shim, most, ctypes.byref(data), _now_us())
        return ctypes.string_at(data, n) if n and data.value is not None else b""

    def took(self, n: int) -> None:
        """So many of them were sent."""
        self._call.gyrocal_remote_took(self._shim, n, _now_us())


def _now_us() -> int:
    return time.monotonic_ns() // 1000
