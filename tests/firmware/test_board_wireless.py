"""The port in a wireless network: it joins where it is told to, wants its token, serves one reader, and never waits for one."""

import re
from pathlib import Path

import numpy as np
import pytest

from gyrocal.device.port import BUSY_NOTE, TOKEN_NOTE
from gyrocal.device.wire import Reader, Sentence, raw_table

from .conftest import CHIPS, UP, PlayBoth, pair, sentences, turn, values

TOKEN, PASSWORD = "m5Qb0Xw2r_K7-tYz", "correct horse"


def says(t_s: float, text: str, reader: int = 0) -> str:
    return f"{t_s} reader {reader} says {text}"


def enters(t_s: float, reader: int = 0) -> list[str]:
    return [f"{t_s} reader {reader} comes", says(t_s + 0.1, f"token {TOKEN}", reader)]


GIVEN = ["0.1 > wifi name lab", "0.2 > wifi password " + PASSWORD, f"0.3 > wifi token {TOKEN}", "0.4 > wifi on"]
NETWORK = ["0 network lab " + PASSWORD]
OPEN = ["0.1 > wifi name lab", f"0.2 > wifi token {TOKEN}", "0.3 > wifi on", "0 network lab"]
COMES = enters(1)
BOARD = [CHIPS[0], *turn(0, UP)]


def heard(network: str, reader: int = 0) -> tuple[list[Sentence], Reader]:
    """What a reader was told."""
    text = "".join(line[2:] + "\n" for line in network.split("\n") if line.startswith(f"{reader} "))
    counter = Reader()
    return counter.feed(text.encode("latin-1")), counter


def test_without_the_command_no_network_is_joined(play_both: PlayBoth) -> None:
    text, network = play_both([*BOARD, "0 network lab", "1 > wifi", "2 reader 0 comes", "3 > wifi on"], 4)
    assert network == "0 refused\n"
    assert [(s.fields["state"], s.fields["address"]) for s in sentences(text, "NET")] == [("off", "")]
    assert values(text, "ERR", "name") == ["no_network"]


def test_sentences_and_commands_pass_by_wifi_and_the_cable_has_them_too(play_both: PlayBoth) -> None:
    script = [*OPEN, *COMES, says(1.2, "hello"), says(1.4, "stream raw"), says(3, "stream off"), says(3.5, "wifi")]
    text, network = play_both([*BOARD, *script], 4)
    said, counter = heard(network)
    assert (counter.lost, counter.bad, counter.skipped) == (0, 0, 0)
    assert [s.fields["cmd"] for s in said if s.tag == "ACK"] == ["hello", "stream", "stream", "wifi"]
    assert len([s for s in said if s.tag == "RAW"]) == pytest.approx(1.6 * 145, abs=3)
    assert said == [s for s in sentences(text) if s.seq >= said[0].seq]
    assert "host gyrocal-1a2b3c\nservice _gyrocal._tcp 4242\n" in network
    assert "# wifi: readers come to tcp://192.168.1.7:4242, name gyrocal-1a2b3c.local\n" in text
    state = next(s.fields for s in said if s.tag == "NET")
    assert state == {
        "state": "joined", "host": "gyrocal-1a2b3c", "address": "192.168.1.7", "port": "4242", "reader": "1", "refused": "0",
    }  # fmt: skip


def test_what_was_given_is_kept_over_power_off_and_never_sent_back(play_both: PlayBoth, tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    first = play_both([*BOARD, *GIVEN, *NETWORK, *COMES, says(1.2, "hello")], 2, flash)
    again = play_both([*BOARD, *NETWORK, *COMES, says(1.2, "hello"), "2 > wifi forget"], 3, flash)
    gone = play_both([*BOARD, *NETWORK, "1 reader 0 comes", "1 > wifi", "2 > wifi on"], 3, flash)
    for text, network in (first, again):
        assert [s.tag for s in heard(network)[0]][:2] == ["ACK", "HEL"]
        assert not sentences(text, "ERR")
    assert gone[1] == "0 refused\n"
    assert values(gone[0], "ERR", "name") == ["no_network"]
    for secret in (TOKEN, PASSWORD, "horse"):
        assert secret not in "".join(first + again + gone)
    assert TOKEN.encode() not in flash.read_bytes()
    assert PASSWORD.encode() not in flash.read_bytes()


def test_every_sensor_hears_the_command_and_the_network_is_joined_once(play_both: PlayBoth) -> None:
    text, network = play_both([*CHIPS, *turn(0, UP), *OPEN, "1 > wifi"], 2)
    assert values(text, "ACK", "cmd") == ["wifi"] * 16
    assert text.count("# wifi: joining ") == 1
    assert network.count("service") == 1


@pytest.mark.parametrize("first", ["hello", "token", f"token {TOKEN}x", f"token {TOKEN[:-1]}", "x" * 200])
def test_a_wrong_token_closes_the_connection_and_counts(play_both: PlayBoth, first: str) -> None:
    script = ["1 reader 0 comes", says(1.1, first), says(1.2, "hello"), *enters(1.5, 1)]
    text, network = play_both([*BOARD, *OPEN, *script, says(2, "wifi", 1)], 3)
    assert [line for line in network.splitlines() if line.startswith("0")] == [f"0 # {TOKEN_NOTE}", "0 closed"]
    assert [s.fields["refused"] for s in heard(network, 1)[0] if s.tag == "NET"] == ["1"]
    assert "hello" not in values(text, "ACK", "cmd")


def test_who_says_nothing_holds_the_place_for_five_seconds(play_both: PlayBoth) -> None:
    script = ["1 reader 0 comes", "3 reader 1 comes", *enters(7, 2), says(7.5, "hello", 2)]
    _, network = play_both([*BOARD, *OPEN, *script], 8)
    assert f"1 # {BUSY_NOTE}\n1 closed\n" in network
    assert [line for line in network.splitlines() if line.startswith("0")] == ["0 closed"]
    assert [s.tag for s in heard(network, 2)[0]] == ["ACK", "HEL"]


def test_a_second_reader_is_told_that_there_is_one(play_both: PlayBoth) -> None:
    script = [*COMES, *enters(1.5, 1), says(1.5, "hello", 1), says(1.7, "hello"), "2 reader 0 leaves"]
    later = [*enters(2.5, 2), says(2.7, "hello", 2)]
    _, network = play_both([*BOARD, *OPEN, *script, *later], 3)
    assert f"1 # {BUSY_NOTE}\n1 closed\n" in network
    assert "broken off" not in network
    for reader in (0, 2):
        assert [s.tag for s in heard(network, reader)[0]] == ["ACK", "HEL"]


def test_a_reader_that_stalls_costs_sentences_that_are_counted_and_no_sample(play_both: PlayBoth) -> None:
    """A queue of 16 KB and lwIP's buffer are full after two seconds of raw samples."""
    script = [*COMES, says(1.2, "start up"), says(1.3, "stream raw"), "2 reader 0 stalls", "8 reader 0 goes on"]
    text, network = play_both([*BOARD, *OPEN, *script, says(9, "stop"), says(9.5, "status")], 10)
    said, counter = heard(network)
    end = next(s for s in said if s.tag == "RUN" and s.fields["state"] == "end")
    assert end.fields["missed"] == "0"
    lost = next(int(s.fields["lost"]) for s in said if s.tag == "STA")
    assert lost == counter.lost > 300
    assert counter.bad == 0
    assert int(end.fields["n"]) == int(end.fields["last"]) - int(end.fields["first"]) + 1
    table = raw_table(said)
    assert np.diff(table.t_us).max() > 2e6  # the gap is where the reader was not
    assert not sentences(text, "ERR")


def test_a_reader_that_takes_nothing_any_more_makes_room_for_the_next(play_both: PlayBoth) -> None:
    script = [*COMES, says(1.3, "stream raw"), "2 reader 0 stalls"]
    later = [*enters(14, 1), says(14.2, "status", 1)]
    _, network = play_both([*BOARD, *OPEN, *script, *later], 15)
    assert "\n0 closed\n" in network
    assert [s.tag for s in heard(network, 1)[0] if s.tag != "RAW"] == ["ACK", "STA"]


def test_a_pair_of_runs_by_wifi_is_that_of_the_cable(play_both: PlayBoth) -> None:
    script = [line.replace(" > ", " reader 0 says ") for line in pair(1)]
    text, network = play_both([*script, *enters(0.8), *OPEN], 16)
    answers = [s.text for s in heard(network)[0] if s.tag == "CAL"]
    assert len(answers) == 6
    assert answers == [s.text for s in sentences(text, "CAL")]
    assert not sentences(text, "ERR")


def test_a_network_that_goes_is_joined_again(play_both: PlayBoth) -> None:
    script = [*COMES, "2 network", "2.5 reader 0 leaves", "5 > wifi", "6 network lab", *enters(25, 1)]
    text, network = play_both([*BOARD, *OPEN, *script, says(26, "hello", 1)], 27)
    assert "# wifi: the network is lost, joining it again\n" in text
    assert values(text, "NET", "state") == ["joining"]
    assert [s.tag for s in heard(network, 1)[0]] == ["ACK", "HEL"]


def test_a_wrong_password_is_told_in_words(play_both: PlayBoth) -> None:
    text, network = play_both([*BOARD, *GIVEN, "0 network lab another one"], 20)
    assert "# wifi: not joined yet (status 6): check name and password\n" in text
    assert "service" not in network


def test_the_lines_of_the_cable_and_of_a_reader_do_not_mix(play_both: PlayBoth) -> None:
    script = [*COMES, "1.2 reader 0 types set axi", "1.3 > set rate_hz 104", says(1.4, "s x"), says(1.5, "set turn_deg 90")]
    text, _ = play_both([*BOARD, *OPEN, *script], 2)
    assert values(text, "ACK", "cmd")[-3:] == ["set"] * 3
    assert re.findall(r"(rate_hz|axis|turn_deg)=(\w+)", " ".join(s.text for s in sentences(text, "ACK"))) == [
        ("rate_hz", "104"), ("axis", "x"), ("turn_deg", "90"),
    ]  # fmt: skip


def test_a_command_that_is_too_long_is_refused_by_either_way(play_both: PlayBoth) -> None:
    text, _ = play_both([*BOARD, *OPEN, *COMES, "1.2 > " + "y" * 200, says(1.4, "") + "z" * 200, "1.6 > hello"], 2)
    assert values(text, "ERR", "name") == ["line_too_long"] * 2
    assert values(text, "ACK", "cmd")[-1] == "hello"


def test_wifi_off_closes_the_connection_and_on_joins_again(play_both: PlayBoth) -> None:
    script = [*COMES, "2 > wifi off", "3 reader 1 comes", "4 > wifi on", *enters(6, 2)]
    _, network = play_both([*BOARD, *OPEN, *script, says(6.2, "hello", 2)], 7)
    assert "0 closed\n" in network
    assert "1 refused\n" in network
    assert [s.tag for s in heard(network, 2)[0]] == ["ACK", "HEL"]
