"""A reader that comes by radio: its token, one at a time, what waits for it, what is dropped; and what `wifi` keeps."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.device.address import TCP_PORT, TOKEN_LENGTHS
from gyrocal.device.port import BUSY_NOTE, TOKEN_NOTE
from gyrocal_firmware import CORE

from .conftest import Build, run

TOKEN = "m5Qb0Xw2r_K7-tYz"
IN = ["connect", f"hear token {TOKEN}"]
STALL_US, TOKEN_US, KEPT_FREE = 10_000_000, 5_000_000, 2048


@pytest.fixture(scope="module")
def remote(build: Build) -> Path:
    return build(Path(__file__).with_name("remote.c"))


def say(remote: Path, jobs: list[str], room: int = 4096, token: str = TOKEN) -> list[str]:
    return run(remote, "\n".join([f"room {room} {token}".strip(), *jobs]) + "\n").splitlines()


def test_nothing_is_sent_before_the_token_and_everything_after_it(remote: Path) -> None:
    jobs = ["connect", "tell # early", "state", f"hear token {TOKEN}", "tell # late", "hear status", "take 99", "state"]
    assert say(remote, jobs) == ["1", "0", "stranger 0 0", "7", "command status", "=# late/", "reader 0 0"]


@pytest.mark.parametrize(
    "line",
    ["", "hello", TOKEN, "token", "token ", f"token {TOKEN[:-1]}", f"token {TOKEN}x", f"token {TOKEN} ", f"token  {TOKEN}",
     f"Token {TOKEN}", f"token {TOKEN.lower()}", "token " + "x" * 64, "token " + "x" * 200],
)  # fmt: skip
def test_any_other_first_line_is_refused_and_counted(remote: Path, line: str) -> None:
    assert say(remote, ["connect", f"hear {line}", "tell # x", "state"]) == ["1", "wrong_token", "0", "stranger 1 0"]
    after = say(remote, ["connect", f"hear {line}", "disconnect", *IN, "state"])
    assert after[-2:] == ["1", "reader 1 0"]


@pytest.mark.parametrize("token", ["", "short", "x" * 65, "with a space in it"])
def test_without_a_sound_token_nobody_is_taken(remote: Path, token: str) -> None:
    for line in ("token ", "token", f"token {token}", "token " + "\0" * 16):
        assert say(remote, ["connect", f"hear {line}", "state"], token=token)[1:] in (
            ["wrong_token", "stranger 1 0"], ["stranger 0 0"],  # a NUL ends the line of the test's own program
        )  # fmt: skip


def test_one_reader_at_a_time(remote: Path) -> None:
    jobs = ["connect", "connect", f"hear token {TOKEN}", "connect", "disconnect", "connect"]
    assert say(remote, jobs) == ["1", "0", "0", "1"]


def test_half_a_command_of_one_reader_is_none_of_the_next(remote: Path) -> None:
    jobs = [*IN, "cut set axi", "tell # old", "disconnect", *IN, "hear status", "take 99"]
    assert say(remote, jobs) == ["1", "6", "1", "command status", "="]


def test_a_command_that_is_too_long_is_passed_on_for_the_device_to_refuse(remote: Path) -> None:
    text = say(remote, [*IN, "hear " + "y" * 200, "hear " + "z" * 80, "hear stop"])
    assert text == ["1", "command " + "y" * 81, "command " + "z" * 80, "command stop"]


def test_who_never_gives_a_token_must_go(remote: Path) -> None:
    jobs = ["at 7", "connect", f"at {TOKEN_US + 7}", "over", f"at {TOKEN_US + 8}", "cut tok", "over", "state"]
    assert say(remote, jobs) == ["1", "0", "1", "stranger 1 0"]


def test_a_reader_that_takes_nothing_must_go_but_a_quiet_one_stays(remote: Path) -> None:
    quiet = [*IN, "at 100000000", "take 9", "over", "tell # x", "at 109000000", "over", "take 2", "at 118000000", "over"]
    assert say(remote, quiet) == ["1", "=", "0", "4", "0", "=# ", "0"]
    assert say(remote, [*IN, "take 9", "tell # x", f"at {STALL_US + 1}", "over", "state"]) == ["1", "=", "4", "1", "reader 0 4"]


def test_samples_leave_room_for_answers(remote: Path) -> None:
    for room, kept in ((16384, KEPT_FREE), (1000, 250)):
        sample, answer = "$RAW" + "9" * 95, "$ACK" + "9" * 95
        said = say(remote, [*IN, *[f"tell {sample}"] * 200, *[f"tell {answer}"] * 200], room)
        assert said[1:201].count("100") == (room - kept) // 100
        assert said[1:].count("100") == room // 100
        assert set(said[1:]) == {"100", "0"}
    for line in ("$GYR,1", ">gx:12"):  # what streams besides
        assert say(remote, [*IN, f"tell {line}", "tell $ACK,1"], 8)[1:] == ["0", "7"]


@settings(max_examples=60, deadline=None)
@given(
    room=st.integers(8, 90),
    mtu=st.integers(23, 60),
    steps=st.lists(st.one_of(st.integers(0, 40).map(lambda n: ("tell", n)), st.just(("take", 0))), max_size=60),
)
def test_pieces_of_any_size_make_the_lines_that_were_taken(
    remote: Path, room: int, mtu: int, steps: list[tuple[str, int]]
) -> None:
    """A notification of Bluetooth holds MTU - 3 bytes: the pieces are these, and in order they are the whole lines."""
    lines = [f"#{i:02d}" + "abcdefghij"[i % 10] * n for i, (_, n) in enumerate(steps)]
    jobs = [f"tell {line}" if word == "tell" else f"take {mtu - 3}" for (word, _), line in zip(steps, lines, strict=True)]
    said = say(remote, [*IN, *jobs, *[f"take {mtu - 3}"] * 10], room)[1:]
    done = zip(steps, lines, said, strict=False)
    taken = "".join(f"{line}/" for (word, _), line, got in done if word == "tell" and got != "0")
    pieces = [text[1:] for text in said if text.startswith("=")]
    assert "".join(pieces) == taken
    assert max(map(len, pieces)) <= mtu - 3
    waiting = 0
    for (word, n), got in zip(steps, said, strict=False):
        if word == "take":
            waiting -= len(got) - 1
        else:
            assert int(got) == (n + 4 if waiting + n + 4 <= room else 0)  # whole or not at all
            waiting += int(got)


def test_wifi_is_off_and_empty_until_it_is_told(remote: Path) -> None:
    assert say(remote, ["power load", "wifi on", "wifi nonsense", "wifi"]) == [
        "off [] [] []", "no_network off 000", "bad_argument off 000", "bad_argument off 000",
    ]  # fmt: skip


def test_what_wifi_takes(remote: Path) -> None:
    for word, sound, unsound in (
        ("name", ["a", "my home net", "x" * 32], ["", "x" * 33]),
        ("password", ["", "x" * 8, " with  spaces ", "x" * 63], ["x" * 7, "x" * 64]),
        ("token", ["x" * 16, "x" * 64], ["", "x" * 15, "x" * 65, "with a space in it"]),
    ):
        for text in sound:
            assert say(remote, [f"wifi {word} {text}"])[0].startswith("ok off"), (word, text)
        for text in unsound:
            assert say(remote, [f"wifi {word} {text}"]) == ["bad_argument off 000"], (word, text)


def test_wifi_is_kept_over_power_off_and_a_write_that_fails_leaves_the_last_one(remote: Path) -> None:
    told = [f"wifi token {TOKEN}", "wifi name my net", "wifi password long enough", "wifi on", "power save"]
    kept = f"on [my net] [long enough] [{TOKEN}]"
    assert say(remote, [*told, "power load"])[-2:] == ["ok", kept]
    cut = [*told, "wifi token " + "x" * 16, "power cut", "power load"]
    assert say(remote, cut)[-3:] == ["ok on 111", "store_failed", kept]
    assert say(remote, [*told, "wifi off", "power save", "power load"])[-1] == "off" + kept[2:]
    assert say(remote, [*told, "wifi forget", "power save", "power load"])[-1] == "off [] [] []"


def test_both_sides_have_the_same_words_and_limits() -> None:
    header, wifi = (CORE / "gc_remote.h").read_text(), (CORE / "gc_wifi.h").read_text()
    assert f'"# {BUSY_NOTE}\\n"' in header
    assert f'"# {TOKEN_NOTE}\\n"' in header
    assert f"#define GC_TOKEN_MIN {TOKEN_LENGTHS[0]} " in header
    assert f"#define GC_TOKEN_MAX {TOKEN_LENGTHS[-1]}\n" in header
    assert f"#define GC_WIFI_PORT {TCP_PORT} " in wifi
