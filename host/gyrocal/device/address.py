"""Addresses of devices without a cable: ``tcp://HOST:PORT`` and ``ble://NAME``, which want a token, and ``socket://HOST:PORT``.

The token is ``?token=...`` behind the address, or the environment variable ``GYROCAL_TOKEN``, so that it does not stand in the
shell's history.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from gyrocal.errors import DeviceError

TOKEN_VARIABLE = "GYROCAL_TOKEN"
TCP_PORT = 4242
"""The port of a board, if the address names none (GC_WIFI_PORT)."""
TOKEN_LENGTHS = range(16, 65)
"""Characters of a token (GC_TOKEN_MIN, GC_TOKEN_MAX)."""
WITH_TOKEN, WITHOUT_TOKEN, BLE = "tcp", "socket", "ble"


@dataclass(frozen=True)
class Address:
    """Where a device listens in a network. ``token`` is empty where it wants none."""

    host: str
    port: int
    token: str = ""

    @classmethod
    def parse(cls, name: str) -> Address:
        """Read a port's name. Raises DeviceError that says how it is written, or that its token is missing."""
        shown = without_token(name)
        try:
            url = urlsplit(name)
            host, port = url.hostname, url.port
        except ValueError:
            raise _unwritten(shown) from None
        if url.scheme == WITHOUT_TOKEN:
            if not host or not port or url.query:
                raise _unwritten(shown)
            return cls(host, port)
        if not host or port == 0:
            raise _unwritten(shown)
        return cls(host, port or TCP_PORT, token_of(name))


def is_address(name: str) -> bool:
    """True for the name of a port without a cable."""
    return wants_token(name) or name.startswith(f"{WITHOUT_TOKEN}://")


def wants_token(name: str) -> bool:
    """True for the name of a port by Wi-Fi or Bluetooth."""
    return name.startswith((f"{WITH_TOKEN}://", f"{BLE}://"))


def without_token(name: str) -> str:
    """A port's name as it may be shown."""
    return name.partition("?")[0] if is_address(name) else name


def token_of(name: str) -> str:
    """The token in a port's name, or that of the environment. Raises DeviceError if there is none that a device takes."""
    shown, query = without_token(name), name.partition("?")[2]
    try:
        given = parse_qs(query, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError:
        given = {"": [""]}
    if set(given) - {"token"} or len(given.get("token", [])) > 1:
        raise _unwritten(shown)
    token = given["token"][0] if given else os.environ.get(TOKEN_VARIABLE, "")
    if not token:
        how = f"export {TOKEN_VARIABLE}=... first, or write '{shown}?token=...'"
        raise DeviceError(f"{shown}: this device wants its token: {how}")
    if not is_token(token):
        least, most = TOKEN_LENGTHS[0], TOKEN_LENGTHS[-1]
        raise DeviceError(f"{shown}: a token has {least} to {most} characters and no spaces; `gyrocal wifi` makes one")
    return token


def keep_token(name: str) -> str:
    """A port's name without its token, which ports that this process and its own ones open later are given all the same."""
    if name != without_token(name):
        os.environ[TOKEN_VARIABLE] = token_of(name)
    return without_token(name)


def is_token(text: str) -> bool:
    """True for a text that a device takes as its token."""
    return len(text) in TOKEN_LENGTHS and text.isascii() and text.isprintable() and " " not in text


def _unwritten(shown: str) -> DeviceError:
    scheme = shown.partition(":")[0]
    form, example = {
        WITHOUT_TOKEN: ("socket://HOST:PORT", "socket://127.0.0.1:5000"), BLE: ("ble://NAME", "ble://gyrocal-1a2b3c")
    }.get(scheme, ("tcp://HOST:PORT", f"tcp://192.168.1.7:{TCP_PORT}"))  # fmt: skip
    return DeviceError(f"{shown}: write {form}, for example {example}")
