"""A port between the recorder and a device that damages, drops, repeats or holds back its lines."""

from __future__ import annotations

from collections.abc import Callable

from gyrocal.device.port import Port, PortGone, open_port

Harm = Callable[[int, bytes], list[bytes]]
"""A line and its number -> the lines that come instead."""


def spoilt(line: bytes) -> bytes:
    """The line with one byte changed."""
    middle = len(line) // 2
    return line[:middle] + bytes([line[middle] ^ 1]) + line[middle + 1 :]


class DamagedPort:
    """The real port, each whole line of the device through ``harm``; what the host says goes on as it is."""

    def __init__(self, port: Port, harm: Harm) -> None:
        self._port, self._harm = port, harm
        self._rest = b""
        self._lines = 0

    def read(self) -> bytes:
        *lines, self._rest = (self._rest + self._port.read()).split(b"\n")
        said = b""
        for line in lines:
            said += b"".join(part + b"\n" for part in self._harm(self._lines, line))
            self._lines += 1
        return said

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def close(self) -> None:
        self._port.close()


def opener(harm: Harm) -> Callable[[str, int], Port]:
    return lambda name, baud: DamagedPort(open_port(name, baud), harm)


class Lines:
    """A device that has said all this, hears nothing and is gone."""

    def __init__(self, said: list[bytes], at_once: int = 200) -> None:
        self._said = [b"".join(line + b"\n" for line in said[i : i + at_once]) for i in range(0, len(said), at_once)]

    def read(self) -> bytes:
        if not self._said:
            raise PortGone("the device is gone")
        return self._said.pop(0)

    def write(self, data: bytes) -> None:
        pass

    def close(self) -> None:
        pass
