"""A board by Bluetooth, over a stand-in for the package bleak that carries packets to a simulated device over loopback."""

import asyncio
import inspect
import sys
import types
from collections.abc import Callable

import pytest

from gyrocal.device.ble import HEARS, TELLS
from gyrocal.device.port import Link, PortGone
from gyrocal.device.simulated import SimulatedDevice
from gyrocal.device.wire import Sentence, raw_table
from gyrocal.errors import DeviceError, InputError
from gyrocal.recording.session import Session

TOKEN = "m5Qb0Xw2r_K7-tYz"
NAME = "gyrocal-1a2b3c"


class BleakError(Exception):
    pass


class Client:
    """A connection of `mtu_size`: what the device says comes in notifications of three bytes less; so must commands."""

    mtu_size = 23
    port = 0
    fails = False
    longest_told = longest_heard = 0

    def __init__(self, device: object, disconnected_callback: Callable[[object], None]) -> None:
        self._left = disconnected_callback

    async def connect(self) -> None:
        if self.fails:
            raise BleakError("Bluetooth device is turned off")
        self._reader, self._writer = await asyncio.open_connection("127.0.0.1", self.port)

    async def start_notify(self, uuid: str, told: Callable[[object, bytearray], None]) -> None:
        assert uuid == TELLS
        self._task = asyncio.ensure_future(self._carry(told))

    async def _carry(self, told: Callable[[object, bytearray], None]) -> None:
        while data := await self._reader.read(self.mtu_size - 3):
            Client.longest_told = max(Client.longest_told, len(data))
            told(None, bytearray(data))
        self._left(self)

    async def write_gatt_char(self, uuid: str, data: bytes, response: bool) -> None:
        assert uuid == HEARS
        assert response
        assert len(data) <= self.mtu_size - 3
        Client.longest_heard = max(Client.longest_heard, len(data))
        if self._writer.is_closing():
            raise BleakError("Not connected")
        self._writer.write(data)
        await self._writer.drain()

    async def disconnect(self) -> None:
        self._writer.close()


class Scanner:
    @staticmethod
    async def find_device_by_filter(wanted: Callable[[object, object], bool], timeout: float) -> object:
        near = [types.SimpleNamespace(name=None, address="00:11:22:33:44:55"),
                types.SimpleNamespace(name=NAME, address="24:0A:C4:1A:2B:3E")]  # fmt: skip
        return next((device for device in near if wanted(device, None)), None)


@pytest.fixture(autouse=True)
def _bleak(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GYROCAL_TOKEN", TOKEN)
    bleak = types.ModuleType("bleak")
    bleak.BleakClient, bleak.BleakScanner = Client, Scanner  # type: ignore[attr-defined]
    bleak.exc = types.SimpleNamespace(BleakError=BleakError)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "bleak", bleak)
    monkeypatch.setattr(Client, "longest_told", 0)
    monkeypatch.setattr(Client, "longest_heard", 0)


def at(monkeypatch: pytest.MonkeyPatch, device: SimulatedDevice, mtu: int = 23) -> None:
    monkeypatch.setattr(Client, "port", int(device.port.rpartition(":")[2]))
    monkeypatch.setattr(Client, "mtu_size", mtu)


@pytest.mark.parametrize("mtu", [23, 64, 247])
def test_sentences_in_pieces_are_whole_again(session: Session, monkeypatch: pytest.MonkeyPatch, mtu: int) -> None:
    with SimulatedDevice(session, tcp="127.0.0.1:0", token=TOKEN) as device:
        at(monkeypatch, device, mtu)
        heard: list[Sentence] = []
        with Link(f"ble://{NAME}") as link, pytest.raises(PortGone, match="out of reach"):
            listen_to_the_end(link, heard)
    assert (link.reader.lost, link.reader.bad, link.reader.skipped) == (0, 0, 0)
    assert len(raw_table(s for s in heard if s.tag == "RAW")) == sum(run.t_s.size for run in session.runs)
    assert Client.longest_told == mtu - 3


def listen_to_the_end(link: Link, heard: list[Sentence]) -> None:
    while True:
        heard += link.receive()


@pytest.mark.parametrize("who", [NAME, NAME.upper(), "24:0a:c4:1a:2b:3e"])
def test_commands_longer_than_a_packet_arrive(session: Session, monkeypatch: pytest.MonkeyPatch, who: str) -> None:
    with SimulatedDevice(session, speed=1, bench=True, tcp="127.0.0.1:0", token=TOKEN) as device:
        at(monkeypatch, device)
        with Link(f"ble://{who}") as link:
            assert link.greet().fields["sensor"] == "LSM6DSO"
            link.command("set full_scale_dps " + "0" * 30 + "500")
            assert link.command("get full_scale_dps").real("full_scale_dps") == 500.0
    assert Client.longest_heard == 20


def test_the_stand_in_is_called_as_the_package_is(
    require_module: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "bleak")
    require_module("bleak")
    import bleak

    def names(function: Callable[..., object]) -> set[str]:
        return set(inspect.signature(function).parameters)

    assert issubclass(bleak.exc.BleakError, Exception)
    assert "timeout" in names(bleak.BleakScanner.find_device_by_filter)
    assert "disconnected_callback" in names(bleak.BleakClient)
    assert "response" in names(bleak.BleakClient.write_gatt_char)
    for name in ("connect", "disconnect", "start_notify", "write_gatt_char"):
        assert inspect.iscoroutinefunction(getattr(bleak.BleakClient, name))


def test_what_bluetooth_refuses_says_what_to_do(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DeviceError, match="no such device within 10 s; is it near and on"):
        Link("ble://somebody")
    monkeypatch.setattr(Client, "fails", True)
    with pytest.raises(DeviceError, match="turned off; is Bluetooth of this computer on"):
        Link(f"ble://{NAME}")
    monkeypatch.setattr(Client, "fails", False)
    with SimulatedDevice(session, speed=1, bench=True, tcp="127.0.0.1:0", token=TOKEN) as device:
        at(monkeypatch, device)
        name = f"ble://{NAME}?token={TOKEN}x"
        with pytest.raises(DeviceError, match="the device has another token") as caught, Link(name) as link:
            link.greet()
        assert TOKEN not in str(caught.value)
    monkeypatch.delenv("GYROCAL_TOKEN")
    with pytest.raises(DeviceError, match="wants its token"):
        Link(f"ble://{NAME}")
    monkeypatch.setitem(sys.modules, "bleak", None)
    with pytest.raises(InputError, match=r"pip install 'gyrocal\[ble\]'"):
        Link(f"ble://{NAME}")
