"""A device in a network: its token, a network that cuts, delays and chops, one reader, and how a device is found."""

import contextlib
import json
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.device import find
from gyrocal.device.address import Address, keep_token, without_token
from gyrocal.device.find import announced_ports, find_port
from gyrocal.device.port import Link, PortGone
from gyrocal.device.simulated import SimulatedDevice
from gyrocal.device.wire import Sentence, raw_table
from gyrocal.errors import DeviceError, InputError
from gyrocal.recording.session import Session

from .fake import FakeDevice
from .proxy import Proxy

TOKEN = "m5Qb0Xw2r_K7-tYz"
OTHER = "another-one-of-24-letters"


@pytest.fixture(autouse=True)
def _no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GYROCAL_TOKEN", raising=False)


@pytest.fixture
def board(session: Session) -> Iterator[SimulatedDevice]:
    """A board at rest, in real time."""
    with SimulatedDevice(session, speed=1, bench=True, tcp="127.0.0.1:0", token=TOKEN) as device:
        yield device


def refused(device: SimulatedDevice) -> int:
    return device._outlet.remote.refused  # type: ignore[attr-defined]


def with_token(port: str, token: str = TOKEN) -> str:
    return f"{port}?token={token}"


def listen(link: Link, seconds: float) -> list[Sentence]:
    heard, deadline = [], time.monotonic() + seconds
    while time.monotonic() < deadline:
        heard += link.receive()
    return heard


def test_the_token_stands_in_the_address_or_in_the_environment(
    board: SimulatedDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert board.port.startswith("tcp://127.0.0.1:")
    with Link(with_token(board.port)) as link:
        assert link.greet().fields["sensor"] == "LSM6DSO"
    monkeypatch.setenv("GYROCAL_TOKEN", OTHER)
    with Link(with_token(board.port)) as link:  # the address goes first
        link.greet()
    monkeypatch.setenv("GYROCAL_TOKEN", TOKEN)
    with Link(board.port) as link:
        link.greet()
    assert refused(board) == 0


def test_a_wrong_token_is_told_in_one_line_that_does_not_hold_it(
    board: SimulatedDevice, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    verbs = (["monitor"], ["doctor", "--seconds", "2"], ["record", str(out), "--face", "up", "--rate", "78", "--seconds", "1"])
    for n, verb in enumerate(verbs):
        assert main([*verb, "--port", with_token(board.port, OTHER)]) == 3
        told = capsys.readouterr()
        assert told.err.strip() == (
            f"gyrocal: {board.port}: the device has another token; set GYROCAL_TOKEN to its own, or give it a new one by "
            "`gyrocal wifi` through the cable"
        )
        assert OTHER not in told.out + told.err
        assert refused(board) == n + 1
    assert not out.exists()
    with Link(with_token(board.port)) as link:
        link.greet()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("tcp://127.0.0.1:1", r"wants its token: export GYROCAL_TOKEN=... first, or write 'tcp://127.0.0.1:1\?token="),
        ("tcp://127.0.0.1:1?token=", "wants its token"),
        ("tcp://127.0.0.1:1?token=short", "16 to 64 characters"),
        ("tcp://127.0.0.1:1?token=with%20a%20space%20in%20it", "16 to 64 characters"),
        (f"tcp://127.0.0.1:1?tokn={TOKEN}", r"write tcp://HOST:PORT, for example tcp://192.168.1.7:4242"),
        (f"tcp://127.0.0.1:1?token={TOKEN}&token={TOKEN}", "write tcp://HOST:PORT"),
        (f"tcp://127.0.0.1:1?{TOKEN}", "write tcp://HOST:PORT"),
        (f"tcp://?token={TOKEN}", "write tcp://HOST:PORT"),
        (f"tcp://host:x?token={TOKEN}", "write tcp://HOST:PORT"),
        (f"tcp://host:0?token={TOKEN}", "write tcp://HOST:PORT"),
        (f"socket://127.0.0.1:1?token={TOKEN}", "write socket://HOST:PORT"),
        (f"tcp://127.0.0.1:1?token={TOKEN}", "is the board on, and in this network"),
    ],
)
def test_an_address_that_cannot_be_used_says_what_to_do_and_no_token(name: str, says: str) -> None:
    with pytest.raises(DeviceError, match=says) as caught:
        Link(name)
    assert TOKEN not in str(caught.value)


def test_names_and_tokens_of_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Address.parse(f"tcp://gyrocal-1a2b3c.local?token={TOKEN}") == Address("gyrocal-1a2b3c.local", 4242, TOKEN)
    assert Address.parse(f"tcp://[::1]:7?token={TOKEN}") == Address("::1", 7, TOKEN)
    assert Address.parse("socket://127.0.0.1:5000") == Address("127.0.0.1", 5000)
    assert without_token("/dev/odd?name") == "/dev/odd?name"
    monkeypatch.setenv("GYROCAL_TOKEN", OTHER)
    assert keep_token("tcp://a:1") == "tcp://a:1"
    assert Address.parse("tcp://a:1").token == OTHER
    assert keep_token(with_token("tcp://a:1")) == "tcp://a:1"
    assert Address.parse("tcp://a:1").token == TOKEN


def test_the_page_never_sees_the_token(monkeypatch: pytest.MonkeyPatch, require_module: Callable[[str], None]) -> None:
    require_module("nicegui")
    served: list[object] = []
    monkeypatch.setattr("gyrocal.web.server.serve", lambda *words, **more: served.extend(words))
    monkeypatch.setenv("GYROCAL_TOKEN", OTHER)
    assert main(["workbench", "--port", with_token("tcp://127.0.0.1:1"), "--no-browser"]) == 0
    assert served[1] == "tcp://127.0.0.1:1"
    assert Address.parse("tcp://127.0.0.1:1").token == TOKEN  # which the process that listens is given


def test_a_second_reader_is_told_that_there_is_one(board: SimulatedDevice) -> None:
    with Link(with_token(board.port)) as first:
        first.greet()
        with pytest.raises(DeviceError, match="another program has it open"), Link(with_token(board.port)) as second:
            second.greet()
        first.command("status")


def test_a_stranger_that_says_nothing_makes_room(board: SimulatedDevice) -> None:
    address = Address.parse(with_token(board.port))
    with socket.create_connection((address.host, address.port)) as stranger:
        stranger.settimeout(10)
        assert stranger.recv(100) == b""
    assert refused(board) == 1
    with Link(with_token(board.port)) as link:
        link.greet()


def test_nothing_is_lost_in_pieces_of_any_size_and_late(session: Session) -> None:
    for piece, delay_s in ((1, 0.0), (7, 0.1), (319, 0.4)):
        with (
            SimulatedDevice(session, tcp="127.0.0.1:0", token=TOKEN) as device,
            Proxy(device.port, piece=piece, delay_s=delay_s) as proxy,
            Link(with_token(proxy.port)) as link,
        ):
            heard: list[Sentence] = []
            with contextlib.suppress(PortGone):
                while True:
                    heard += link.receive()
        assert (link.reader.lost, link.reader.bad, link.reader.skipped, link.reader.overlong) == (0, 0, 0, 0)
        counts = raw_table(s for s in heard if s.tag == "RAW")
        assert len(counts) == sum(run.t_s.size for run in session.runs)


def test_a_connection_that_is_cut_is_made_again_and_every_loss_is_counted(board: SimulatedDevice) -> None:
    cuts = (5, 401, 1003, 2999)
    with Proxy(board.port, cuts=cuts) as proxy, Link(with_token(proxy.port), reconnect=True) as link:
        heard: list[Sentence] = []
        while proxy.connections <= len(cuts):
            link.send("stream raw")  # what falls into a cut is lost
            heard += listen(link, 0.2)
        heard += listen(link, 1.0)
        link.command("stream off")
        heard += listen(link, 0.3)
        assert proxy.connections == len(cuts) + 1
    reader = link.reader
    assert reader.restarts == 0
    assert 1 <= reader.bad <= len(cuts)  # a cut in the middle of a sentence damages that one alone
    assert reader.skipped == 0
    numbers = [s.seq for s in heard]
    assert numbers == sorted(set(numbers))
    assert reader.good == len(numbers)
    assert reader.lost == numbers[-1] - numbers[0] + 1 - len(numbers)
    assert reader.lost > 0


def test_a_recording_over_a_cut_connection_keeps_what_came(
    board: SimulatedDevice, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    with Proxy(board.port, cuts=(20_000,)) as proxy:
        line = ["record", str(out), "--port", with_token(proxy.port), "--face", "up", "--rate", "0", "--seconds", "60"]
        assert main([*line, "--json"]) == 3
    told = capsys.readouterr()
    report = json.loads(told.out)
    assert report["runs"][0]["samples"] == Session.open(out).runs[0].t_s.size > 150
    assert "device_gone" in [warning["code"] for warning in report["warnings"]]
    assert TOKEN not in told.out + told.err


def test_a_recording_by_wifi_is_that_of_the_cable(session: Session, tmp_path: Path) -> None:
    by_cable, by_wifi = tmp_path / "cable", tmp_path / "wifi"
    with SimulatedDevice(session) as device:
        assert main(["record", str(by_cable), "--port", device.port, "--follow"]) in (0, 3)
    with SimulatedDevice(session, tcp="127.0.0.1:0", token=TOKEN) as device, Proxy(device.port, piece=100) as proxy:
        assert main(["record", str(by_wifi), "--port", with_token(proxy.port), "--follow"]) in (0, 3)
    files = sorted(path.name for path in by_cable.iterdir())
    assert files == sorted(path.name for path in by_wifi.iterdir())
    assert len(files) == 5
    for name in files:
        assert (by_cable / name).read_bytes() == (by_wifi / name).read_bytes()


def test_last_words_are_heard_when_a_command_finds_the_port_closed() -> None:
    """A device that closes the port at once may do so before the first command is sent."""

    class Refusing:
        said = iter([b"# token: this device was not given its token\n"])

        def read(self) -> bytes:
            for chunk in self.said:
                return chunk
            raise PortGone("x: the device is gone")

        def write(self, data: bytes) -> None:
            raise PortGone("x: the device is gone")

        def close(self) -> None:
            pass

    with Link("x", opener=lambda *_: Refusing()) as link, pytest.raises(DeviceError, match="the device has another token"):
        link.greet()


def test_half_a_line_does_not_swallow_the_first_line_of_the_next_connection() -> None:
    chunks = iter([b"$RAW,1,2,0,3", None, b"# token: this device was not given its token\n", None])

    class Chunks:
        def read(self) -> bytes:
            chunk = next(chunks)
            if chunk is None:
                raise PortGone("x: gone")
            return chunk

        def write(self, data: bytes) -> None:
            pass

        def close(self) -> None:
            pass

    with Link("x", reconnect=True, opener=lambda *_: Chunks()) as link:
        with pytest.raises(DeviceError, match="another token"):
            listen(link, 5.0)
        assert link.reader.bad == 1


def test_the_simulated_device_refuses_a_token_that_none_can_be(session: Session) -> None:
    for options in ({"tcp": "127.0.0.1:0", "token": "short"}, {"token": TOKEN}):
        with pytest.raises(InputError, match="--token"):
            SimulatedDevice(session, **options)


def test_the_network_is_asked_last() -> None:
    with FakeDevice() as serial, FakeDevice() as wifi:
        asked: list[str] = []

        def network() -> list[str]:
            asked.append("network")
            return [wifi.port]

        assert find_port("auto", ports=lambda: [serial.port], network=network) == serial.port
        assert asked == []
        assert find_port("auto", ports=lambda: ["socket://127.0.0.1:1"], network=network) == wifi.port
    with pytest.raises(DeviceError, match=r"socket://127\.0\.0\.1:1: .*; socket://127\.0\.0\.1:2: "):
        find_port("auto", ports=lambda: ["socket://127.0.0.1:1"], network=lambda: ["socket://127.0.0.1:2"])


def test_without_the_package_the_advice_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(find, "ZEROCONF", "no_such_package")
    assert announced_ports() == []
    with pytest.raises(DeviceError, match=r"pip install 'gyrocal\[wifi\]'"):
        find_port("auto", ports=list)


@pytest.mark.wide
def test_an_announced_device_is_found(
    board: SimulatedDevice, require_module: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    require_module("zeroconf")
    from zeroconf import IPVersion, ServiceInfo, Zeroconf

    port = Address.parse(with_token(board.port)).port
    info = ServiceInfo(
        find.SERVICE, f"gyrocal-1a2b3c.{find.SERVICE}", port, addresses=[socket.inet_aton("127.0.0.1")],
        server="gyrocal-1a2b3c.local.",
    )  # fmt: skip

    def on_loopback() -> list[str]:
        return announced_ports(["127.0.0.1"])

    with ThreadPoolExecutor(1) as pool:  # no event loop runs there, whatever ran in this thread before
        made = pool.submit(Zeroconf, ["127.0.0.1"], ip_version=IPVersion.V4Only).result()
    with made as announcer:
        announcer.register_service(info)
        assert on_loopback() == [board.port]
        with pytest.raises(DeviceError, match="wants its token"):
            find_port("auto", ports=list, network=on_loopback)
        monkeypatch.setenv("GYROCAL_TOKEN", TOKEN)
        assert find_port("auto", ports=list, network=on_loopback) == board.port
        announcer.unregister_service(info)
    assert on_loopback() == []
