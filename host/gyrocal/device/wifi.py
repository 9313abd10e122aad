"""A board's Wi-Fi: the network that it joins is told to it through the cable, and it tells its address there."""

from __future__ import annotations

import secrets
import time
from dataclasses import dataclass

from gyrocal.device.address import TCP_PORT, WITH_TOKEN, is_token
from gyrocal.device.port import ANSWER_S, RETRY_S, Link
from gyrocal.device.wire import Sentence
from gyrocal.errors import DeviceError, InputError

JOIN_S = 30.0
"""The longest time that a board takes to join; a board of ours tries again after 15 s."""
NAME_MOST = 32
"""Bytes of a network's name (IEEE 802.11)."""
PASSWORD_LENGTHS = range(8, 64)
"""Bytes of a password (WPA2); an open network has none."""
TOKEN_BYTES = 24
UNKNOWN = "unknown_command"
"""How a device answers that does not know the command (gc_error.h)."""


@dataclass(frozen=True)
class Network:
    """How a board stands in its network: the fields of ``$NET``."""

    state: str = "off"
    host: str = ""
    address: str = ""
    port: int = TCP_PORT
    reader: bool = False
    refused: int = 0

    @property
    def url(self) -> str:
        """The port for other verbs, empty until the board has joined."""
        return f"{WITH_TOKEN}://{self.address}:{self.port}" if self.address else ""

    @classmethod
    def told_by(cls, sentence: Sentence) -> Network:
        """The network that a ``$NET`` tells."""
        fields = sentence.fields
        return cls(
            fields.get("state", "off"), fields.get("host", ""), fields.get("address", ""),
            int(sentence.real("port") or TCP_PORT), fields.get("reader") == "1", int(sentence.real("refused") or 0),
        )  # fmt: skip


def new_token() -> str:
    """A token of 32 characters, drawn by chance."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def ask(link: Link) -> Network:
    """How the board stands. Raises DeviceError if it does not tell."""
    try:
        link.command("wifi")
    except DeviceError as error:
        if UNKNOWN in str(error):
            raise DeviceError(f"{link.name}: this device has no Wi-Fi; an ESP32 has it with today's firmware") from None
        raise
    deadline = time.monotonic() + ANSWER_S
    while time.monotonic() < deadline:
        for sentence in link.receive():
            if sentence.tag == "NET":
                return Network.told_by(sentence)
    raise DeviceError(f"{link.name}: the device did not tell of its Wi-Fi within {ANSWER_S:g} s; type `gyrocal wifi` again")


def check(name: str, password: str, token: str) -> None:
    """Raise InputError for what no network or device has."""
    size = len(password.encode())
    if not 0 < len(name.encode()) <= NAME_MOST or name != name.strip():
        raise InputError(f"--join: a network's name has 1 to {NAME_MOST} bytes, and no space at its ends")
    if size and size not in PASSWORD_LENGTHS:
        raise InputError(f"a password has {PASSWORD_LENGTHS[0]} to {PASSWORD_LENGTHS[-1]} bytes, or none in an open network")
    if any(not character.isprintable() for character in name + password):
        raise InputError("a name or password with a control character cannot be given")
    if not is_token(token):
        raise InputError("GYROCAL_TOKEN: a token has 16 to 64 characters without spaces; unset it, and one is made")


def leave(link: Link, *, forget: bool) -> Network:
    """Let the board leave its network; with ``forget`` it also deletes what it was told of it."""
    ask(link)
    link.command("wifi forget" if forget else "wifi off")
    time.sleep(RETRY_S)
    return ask(link)


def join(link: Link, name: str, password: str, token: str, timeout_s: float = JOIN_S) -> Network:
    """Let the board join a network, and wait until it has.

    Raises:
        DeviceError: the board refuses, or it has not joined in time; it goes on trying.
    """
    leave(link, forget=False)
    for word, secret in (("name", name), ("password", password), ("token", token)):
        link.command(f"wifi {word}", secret=f" {secret}")
    link.command("wifi on")
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        time.sleep(RETRY_S)
        network = ask(link)
        if network.state == "joined":
            return network
    raise DeviceError(
        f"{link.name}: the board has not joined {name!r} within {timeout_s:g} s; check name and password, and that it is a "
        "2.4 GHz network; the board goes on trying, `gyrocal wifi` asks again"
    )
