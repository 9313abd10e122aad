"""Opening ports, the hello, commands and their refusals, unplugging."""

import os
import socket
import time
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.device.port import Link, PortGone, SerialPort, open_port
from gyrocal.errors import DeviceError

from .fake import FakeDevice


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def listen_forever(link: Link) -> None:
    while True:
        link.receive()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("/dev/no_such_port", "no such port"),
        ("socket://nowhere", "socket://HOST:PORT"),
        ("socket://:5000", "socket://HOST:PORT"),
        ("socket://127.0.0.1:99999", "socket://HOST:PORT"),
        ("socket://127.0.0.1:{free}", "is `gyrocal device"),
        ("{file}", "a file and no port; give a serial device"),
        ("{file}/sub", "cannot be opened|no such port"),
        ("nonsense://x", "cannot be opened"),
        ("", "no such port|cannot be opened"),
    ],
)
def test_a_port_that_cannot_be_opened_says_what_to_do(
    name: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    name = name.format(free=free_port(), file=file)
    with pytest.raises(DeviceError, match=says):
        open_port(name)
    for verb in (["monitor"], ["record", str(tmp_path / "out"), "--face", "up", "--rate", "78", "--seconds", "1"]):
        assert main([*verb, "--port", name]) == 3
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_permission_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(13, "could not open port /dev/ttyUSB0: Permission denied")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceError, match="dialout"):
        open_port("/dev/ttyUSB0")


def test_closing_lets_go_of_rts_before_dtr(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the other order a board's reset line is pulled between the two."""
    import serial

    done: list[str] = []

    class Board:
        def __setattr__(self, name: str, value: bool) -> None:
            done.append(f"{name} {value}")

        def close(self) -> None:
            done.append("close")

    monkeypatch.setattr(serial, "serial_for_url", lambda *_, **__: Board())
    open_port("COM3").close()
    assert done == ["rts False", "dtr False", "close"]


def test_a_port_of_another_speed_is_told_by_what_came(monkeypatch: pytest.MonkeyPatch) -> None:
    class Noise:
        def read(self) -> bytes:
            return b"\x80\xf8" * 8

        def write(self, data: bytes) -> None:
            pass

        def close(self) -> None:
            pass

    with Link("COM3", opener=lambda *_: Noise()) as link, pytest.raises(DeviceError, match=r"[1-9]\d* bytes that are no text"):
        link.greet(timeout_s=0.05)


def test_hello_and_commands() -> None:
    with FakeDevice() as fake, Link(fake.port) as link:
        assert link.greet().fields["fw"] == "fake"
        assert link.command("set table_dps 30").tag == "ACK"
        assert fake.commands == ["hello", "set table_dps 30"]


def test_a_board_that_boots_when_opened_is_greeted_again() -> None:
    """The first hello falls into the boot; the $HEL of the boot itself answers nothing."""

    class Booting(FakeDevice):
        def _obey(self, text: str) -> None:
            if self.commands.count("hello") == 0:
                self.commands.append(text)
                self.say("HEL", {**self._hello, "lsb_dps": 0.07}, seq=0)
                return
            super()._obey(text)

    with Booting() as fake, Link(fake.port) as link:
        assert link.greet().real("lsb_dps") == 0.00875
        assert fake.commands == ["hello", "hello"]


def test_a_silent_port_and_another_protocol_are_told() -> None:
    with FakeDevice(silent=True) as fake, Link(fake.port) as link, pytest.raises(DeviceError, match="no hello"):
        link.greet(timeout_s=0.7)
    with (
        FakeDevice(hello={"proto": 2}) as fake,
        Link(fake.port) as link,
        pytest.raises(DeviceError, match="protocol 2"),
    ):
        link.greet()


def test_a_refusal_carries_the_devices_advice() -> None:
    error = {"code": -23, "name": "recording", "advice": "send_stop_first"}
    with FakeDevice(refuses={"set": error}) as fake, Link(fake.port) as link:
        link.greet()
        with pytest.raises(DeviceError, match=r"recording \(-23\): send stop first"):
            link.command("set axis x")


def test_an_error_of_the_sensor_is_no_refusal() -> None:
    with FakeDevice() as fake, Link(fake.port) as link:
        link.greet()
        fake.say("ERR", {"code": -7, "name": "stale", "advice": ""})
        assert link.command("set axis x").tag == "ACK"
        assert [s.tag for s in link.receive()].count("ERR") == 1


def test_unplugging_is_an_error_or_healed() -> None:
    with FakeDevice() as fake:
        with Link(fake.port) as link:
            link.greet()
            fake.unplug()
            with pytest.raises(PortGone):
                listen_forever(link)
        with Link(fake.port, reconnect=True) as link:
            link.greet()
            fake.unplug()
            deadline = time.monotonic() + 5
            while link.connected and time.monotonic() < deadline:
                link.receive()
            while not link.connected and time.monotonic() < deadline:
                link.receive()
            assert link.greet().fields["fw"] == "fake"
        assert fake.connections == 3


def test_a_pseudo_terminal_whose_owner_left_is_gone() -> None:
    master, slave = os.openpty()
    port = SerialPort(os.ttyname(slave))
    os.close(slave)
    os.close(master)
    with pytest.raises(PortGone):
        port.read()
    with pytest.raises(PortGone):
        port.write(b"hello\n")
    port.close()
