"""The port at which a gyrocal device answers: a serial one, or else one that is announced in the network."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from gyrocal.device.address import WITH_TOKEN
from gyrocal.device.port import BAUD, Link, Port, open_port
from gyrocal.errors import DeviceError

AUTO = "auto"
"""The name that stands for whichever port a device answers at."""
SERVICE = "_gyrocal._tcp.local."
"""What a board announces by multicast DNS."""
ANNOUNCED_S = 2.0
"""How long announcements are waited for."""
ZEROCONF = "zeroconf"
"""The package that hears them, which comes with the extra ``wifi``."""


def serial_ports() -> list[str]:
    """The serial devices of this machine that something is plugged into, USB ones first."""
    from serial.tools.list_ports import comports

    found = [port for port in comports() if port.hwid != "n/a"]
    return [port.device for port in sorted(found, key=lambda port: (port.vid is None, port.device))]


def announced_ports(interfaces: Sequence[str] | None = None) -> list[str]:
    """The addresses of devices that are announced in the network of these interfaces, all by default.

    Empty without the package ``zeroconf``.
    """
    if not _hears_announcements():
        return []
    with ThreadPoolExecutor(1) as pool:  # in a thread where an event loop runs, zeroconf would wait for itself
        return pool.submit(_announced, interfaces).result()


def _announced(interfaces: Sequence[str] | None) -> list[str]:
    from zeroconf import InterfaceChoice, IPVersion, ServiceBrowser, Zeroconf

    names: set[str] = set()

    def heard(zeroconf: Zeroconf, service_type: str, name: str, state_change: object) -> None:
        names.add(name)

    with Zeroconf(list(interfaces) if interfaces else InterfaceChoice.All, ip_version=IPVersion.V4Only) as network:
        ServiceBrowser(network, SERVICE, handlers=[heard])
        time.sleep(ANNOUNCED_S)
        infos = [network.get_service_info(SERVICE, name) for name in sorted(names)]
        return [
            f"{WITH_TOKEN}://{address}:{info.port}"
            for info in infos if info is not None for address in info.parsed_addresses(IPVersion.V4Only)
        ]  # fmt: skip


def _hears_announcements() -> bool:
    return importlib.util.find_spec(ZEROCONF) is not None


def find_port(
    name: str,
    *,
    ports: Callable[[], Sequence[str]] = serial_ports,
    network: Callable[[], Sequence[str]] | None = announced_ports,
    opener: Callable[[str, int], Port] = open_port,
    baud: int = BAUD,
) -> str:
    """``name`` itself, or for ``auto`` the first port at which a device answers a hello.

    ``network`` lists devices that are announced there, which are asked last; None for none.

    Raises:
        DeviceError: nothing is there, or no device answers; with what each port said.
    """
    if name != AUTO:
        return name
    refusals = []
    for candidates in (ports, network):
        for candidate in candidates() if candidates is not None else ():
            try:
                with Link(candidate, baud=baud, opener=opener) as link:
                    link.greet()
                return candidate
            except DeviceError as error:
                refusals.append(str(error))
    if refusals:
        raise DeviceError("no gyrocal device answers: " + "; ".join(refusals))
    heard = "; none is announced in this network" if _hears_announcements() else "; by Wi-Fi: pip install 'gyrocal[wifi]'"
    asked = heard if network is not None else ""
    raise DeviceError(f"no serial port: plug the board in by a cable that carries data, or give --port{asked}")
