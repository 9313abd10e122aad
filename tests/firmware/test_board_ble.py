"""The port by Bluetooth: the Nordic UART Service, in pieces of what a packet holds, for a reader with the token."""

import re

import pytest

from gyrocal.device.port import BUSY_NOTE, TOKEN_NOTE
from gyrocal.device.wire import Reader, Sentence

from .conftest import CHIPS, UP, PlayBoth, sentences, turn, values

BLE = "-DGYROCAL_BLE"
TOKEN = "m5Qb0Xw2r_K7-tYz"
BOARD = [CHIPS[0], *turn(0, UP), f"0.1 > wifi token {TOKEN}"]


def comes(t_s: float, mtu: int = 247, token: str = TOKEN) -> list[str]:
    return [f"{t_s} ble comes {mtu}", f"{t_s + 0.1} ble says token {token}"]


def pieces(told: str) -> list[str]:
    found = re.findall(r"^ble (\d+) (.*)$", told, re.MULTILINE)
    assert all(int(n) == len(piece) for n, piece in found)
    return [piece for _, piece in found]


def heard(told: str) -> tuple[list[Sentence], Reader]:
    reader = Reader()
    return reader.feed("".join(pieces(told)).replace("/", "\n").encode()), reader


def test_without_a_token_the_board_is_not_on_the_air(play_both: PlayBoth) -> None:
    text, told = play_both([*BOARD[:-1], "1 ble comes"], 2, None, BLE)
    assert told == "ble not on the air\n"
    assert "# ble:" not in text


@pytest.mark.parametrize("mtu", [23, 100, 247, 517])
def test_pieces_fit_the_link_and_make_the_sentences(play_both: PlayBoth, mtu: int) -> None:
    script = [*comes(1, mtu), "1.2 ble says hello", "1.4 ble says stream raw", "2.4 ble says stream off", "2.8 ble says status"]
    text, told = play_both([*BOARD, *script], 3.5, None, BLE)
    said, reader = heard(told)
    assert (reader.bad, reader.lost, reader.skipped) == (0, 0, 0)
    assert max(map(len, pieces(told))) == min(mtu, 247) - 3
    assert [s.tag for s in said if s.tag != "RAW"] == ["ACK", "HEL", "ACK", "ACK", "ACK", "STA"]
    assert len([s for s in said if s.tag == "RAW"]) == pytest.approx(145, abs=2)
    assert said == [s for s in sentences(text) if s.seq >= said[0].seq]
    assert told.startswith(
        "ble name gyrocal-1a2b3c\nble characteristic 6E400003-B5A3-F393-E0A9-E50E24DCCA9E\n"
        "ble characteristic 6E400002-B5A3-F393-E0A9-E50E24DCCA9E\nble service 6E400001-B5A3-F393-E0A9-E50E24DCCA9E\n"
    )


def test_a_wrong_token_closes_the_connection(play_both: PlayBoth) -> None:
    script = [*comes(1, 23, TOKEN + "x"), "1.2 ble says hello", *comes(2), "2.3 ble says hello"]
    text, told = play_both([*BOARD, *script], 3, None, BLE)
    refused, _, after = told.partition("ble closed\n")
    assert "".join(pieces(refused)) == f"# {TOKEN_NOTE}/"
    assert [s.tag for s in heard(after)[0]] == ["ACK", "HEL"]
    assert values(text, "ACK", "cmd") == ["wifi", "hello"]


def test_there_is_one_reader_whichever_way_it_came(play_both: PlayBoth) -> None:
    joined = ["0 network lab", "0.2 > wifi name lab", "0.3 > wifi on", "1 reader 0 comes", f"1.1 reader 0 says token {TOKEN}"]
    script = ["2 ble comes", "3 reader 0 leaves", *comes(4), "4.3 ble says hello", "5 reader 1 comes"]
    _, told = play_both([*BOARD, *joined, *script], 6, None, BLE)
    before, _, after = told.partition("ble closed\n")
    assert "".join(pieces(before)) == f"# {BUSY_NOTE}/"
    assert [s.tag for s in heard(after)[0]] == ["ACK", "HEL"]
    assert f"1 # {BUSY_NOTE}\n1 closed\n" in after


def test_a_congested_link_costs_sentences_that_are_counted_and_no_sample(play_both: PlayBoth) -> None:
    script = [*comes(1), "1.2 ble says start up", "1.3 ble says stream raw", "2 ble stalls", "8 ble goes on", "9 ble says stop"]
    _, told = play_both([*BOARD, *script, "9.5 ble says status"], 10.5, None, BLE)
    said, reader = heard(told)
    end = next(s for s in said if s.tag == "RUN" and s.fields["state"] == "end")
    assert end.fields["missed"] == "0"
    assert next(int(s.fields["lost"]) for s in said if s.tag == "STA") == reader.lost > 300
    assert reader.bad == 0


def test_a_reader_that_left_makes_room(play_both: PlayBoth) -> None:
    script = [*comes(1), "1.3 ble says stream raw", "2 ble leaves", *comes(3), "3.3 ble says status"]
    _, told = play_both([*BOARD, *script], 4, None, BLE)
    said, reader = heard(told.partition("ble closed\n")[2])
    assert reader.bad == 0
    assert {"ACK", "STA"} <= {s.tag for s in said}
