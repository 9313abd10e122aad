"""`gyrocal wifi`: a board is told its network through the cable; nothing secret is shown but the token that was made."""

import io
import json
from collections.abc import Callable

import jsonschema
import pytest

from gyrocal.cli import main
from gyrocal.device import wifi
from gyrocal.device.address import is_token
from gyrocal.device.simulated import SimulatedDevice
from gyrocal.json_schemas import schema
from gyrocal.recording.session import Session

from .wifi_board import WifiBoard

NAME, PASSWORD = "my home net", " correct horse "
TOKEN = "m5Qb0Xw2r_K7-tYz"
Type = Callable[[str], None]


@pytest.fixture
def types(monkeypatch: pytest.MonkeyPatch) -> Type:
    """What comes on stdin."""
    monkeypatch.delenv("GYROCAL_TOKEN", raising=False)
    return lambda text: monkeypatch.setattr("sys.stdin", io.StringIO(text))


def test_a_board_joins_and_its_port_and_new_token_are_told(types: Type, capsys: pytest.CaptureFixture[str]) -> None:
    types(PASSWORD + "\n")
    with WifiBoard((NAME, PASSWORD), asks=2) as board:
        assert main(["wifi", "--port", board.port, "--join", NAME]) == 0
    told = capsys.readouterr()
    joined, token, monitor = told.out.splitlines()
    assert joined == (
        "joined: tcp://192.168.1.7:4242, gyrocal-1a2b3c.local; 2 connections without the token since power-on"
    )
    assert token == f"export GYROCAL_TOKEN={board.told['token']}"
    assert monitor == "gyrocal monitor --port tcp://192.168.1.7:4242"
    assert is_token(board.told["token"])
    assert len(board.told["token"]) == 32
    assert (board.told["name"], board.told["password"]) == (NAME, PASSWORD)
    assert PASSWORD.strip() not in told.out + told.err


def test_two_tokens_are_never_the_same() -> None:
    assert len({wifi.new_token() for _ in range(100)}) == 100
    assert all(is_token(wifi.new_token()) for _ in range(100))


def test_a_token_of_the_environment_is_used_and_not_shown(
    types: Type, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types("")
    monkeypatch.setenv("GYROCAL_TOKEN", TOKEN)
    with WifiBoard() as board:
        assert main(["wifi", "--port", board.port, "--join", "lab"]) == 0
        assert board.told["token"] == TOKEN
    told = capsys.readouterr()
    assert TOKEN not in told.out + told.err


def test_the_state_is_told_and_left_and_forgotten(types: Type, capsys: pytest.CaptureFixture[str]) -> None:
    types("")

    def answer(*words: str) -> dict:
        assert main(["wifi", "--port", board.port, *words, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        jsonschema.validate(found, schema("wifi"))
        return found

    off = {
        "state": "off", "host": "", "address": "", "port": 4242, "reader": False, "refused": 2, "url": "", "token": ""
    }  # fmt: skip
    with WifiBoard() as board:
        assert answer() == off
        joined = answer("--join", "lab")
        assert (joined["state"], joined["url"], joined["token"]) == ("joined", "tcp://192.168.1.7:4242", board.told["token"])
        assert answer()["url"] == joined["url"]
        assert answer("--off") == off
        assert board.told["name"] == "lab"
        assert answer("--forget") == off
        assert board.told == {"name": "", "password": "", "token": ""}


def test_a_network_that_is_not_joined_is_told_without_the_password(
    types: Type, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types("a wrong one\n")
    monkeypatch.setattr(wifi.join, "__defaults__", (1.0,))
    with WifiBoard(("lab", "the right one")) as board:
        assert main(["wifi", "--port", board.port, "--join", "lab"]) == 3
    error = capsys.readouterr().err
    assert "has not joined 'lab' within 1 s; check name and password, and that it is a 2.4 GHz network" in error
    assert "a wrong one" not in error


def test_a_refusal_shows_no_secret(types: Type, capsys: pytest.CaptureFixture[str]) -> None:
    class Refusing(WifiBoard):
        def _obey(self, text: str) -> None:
            if text.startswith("wifi password"):
                self.say("ERR", {"code": -21, "name": "bad_argument", "advice": "see_PROTOCOL.md"})
            else:
                super()._obey(text)

    types("correct horse\n")
    with Refusing() as board:
        assert main(["wifi", "--port", board.port, "--join", "lab"]) == 3
    error = capsys.readouterr().err
    assert "`wifi password` refused: bad_argument" in error
    assert "horse" not in error


def test_what_no_network_has_is_refused_before_the_board_is_asked(
    types: Type, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, password, token, says in (
        ("", "", "", "1 to 32 bytes"), ("x" * 33, "", "", "1 to 32 bytes"), ("ä" * 17, "", "", "1 to 32 bytes"),
        (" lab", "", "", "no space at its ends"), ("lab", "short", "", "8 to 63 bytes"), ("lab", "x" * 64, "", "8 to 63 bytes"),
        ("lab", "with a\ttab", "", "control character"), ("lab", "", "short", "GYROCAL_TOKEN"),
    ):  # fmt: skip
        types(password)
        monkeypatch.setenv("GYROCAL_TOKEN", token)
        assert main(["wifi", "--port", "socket://127.0.0.1:1", "--join", name]) == 2
        assert says in capsys.readouterr().err
    assert main(["wifi", "--port", "socket://127.0.0.1:1", "--off", "--forget"]) == 2
    assert "give one of --join, --off and --forget" in capsys.readouterr().err
    for words in (["--join", "lab"], ["--off"], ["--forget"]):
        assert main(["wifi", "--port", f"tcp://127.0.0.1:1?token={TOKEN}", *words]) == 2
        error = capsys.readouterr().err
        assert "--port tcp://127.0.0.1:1: the board would cut this connection; give its serial port" in error
        assert TOKEN not in error


def test_a_device_without_wifi_says_so(session: Session, types: Type, capsys: pytest.CaptureFixture[str]) -> None:
    types("")
    with SimulatedDevice(session, speed=1, bench=True) as device:
        for words in ([], ["--join", "lab"], ["--off"]):
            assert main(["wifi", "--port", device.port, *words]) == 3
            assert "this device has no Wi-Fi; an ESP32 has it with today's firmware" in capsys.readouterr().err
