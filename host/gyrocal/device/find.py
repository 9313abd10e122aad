"""The port at which a gyrocal device answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gyrocal.device.port import BAUD, Link, Port, open_port
from gyrocal.errors import DeviceError

AUTO = "auto"
"""The name that stands for whichever port a device answers at."""


def serial_ports() -> list[str]:
    """The serial devices of this machine that something is plugged into, USB ones first."""
    from serial.tools.list_ports import comports

    found = [port for port in comports() if port.hwid != "n/a"]
    return [port.device for port in sorted(found, key=lambda port: (port.vid is None, port.device))]


def find_port(
    name: str,
    *,
    ports: Callable[[], Sequence[str]] = serial_ports,
    opener: Callable[[str, int], Port] = open_port,
    baud: int = BAUD,
) -> str:
    """``name`` itself, or for ``auto`` the first port at which a device answers a hello.

    Raises:
        DeviceError: nothing is plugged in, or no device answers; with what each port said.
    """
    if name != AUTO:
        return name
    refusals = []
    for candidate in ports():
        try:
            with Link(candidate, baud=baud, opener=opener) as link:
                link.greet()
            return candidate
        except DeviceError as error:
            refusals.append(str(error))
    if not refusals:
        raise DeviceError("no serial port: plug the board in by a cable that carries data, or give --port")
    raise DeviceError("no gyrocal device answers: " + "; ".join(refusals))
