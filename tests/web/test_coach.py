"""What the coach tells the person at the table, which answer stands large, and how the live chart obeys."""

from __future__ import annotations

import csv
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gyrocal.device.outlet import TcpOutlet
from gyrocal.device.wire import PROTOCOL, encode
from gyrocal.web.device.coach import ANSWER_HZ, FLIP_HZ, advice, aim, answer, words
from gyrocal.web.panels.live import sample_rate

from .test_charts import CHART, able, downloaded

HELLO = {"table_dps": "78"}


def sensor(state: str, **more: Any) -> dict[str, Any]:
    return {"state": state, "face": "", "waits": "", "run_s": 0.0, "hello": HELLO} | more


@pytest.mark.parametrize(
    ("status", "stage", "said"),
    [
        (sensor("idle", waits="sensor"), "wait", "The sensor does not answer."),
        (sensor("idle", waits="start"), "wait", "face up and turn the table at 78 dps"),
        (sensor("idle", waits="unsteady"), "wait", "Stop the table for a moment."),
        (sensor("recording", run_s=3.0, face="up"), "turn", "Keep the table turning."),
        (sensor("recording", run_s=6.0, face="up", waits="unsteady"), "flip", "Flip now"),
        (sensor("flip", waits="flip", second=True), "flip", "Flip now"),
        (sensor("recording", run_s=5.9, face="down", second=True), "turn", "Keep the table turning."),
        (sensor("recording", run_s=6.1, face="down", second=True), "done", "the answer is complete"),
        (sensor("done"), "done", "Both faces are measured."),
    ],
)
def test_it_says_what_to_do_now(status: dict[str, Any], stage: str, said: str) -> None:
    found = advice(status, replays=False, ended=False)
    assert (found.stage, said in found.tell) == (stage, True), found


def test_what_is_beyond_its_aim_is_not_a_part_of_it() -> None:
    """The ring said "65.1 s of 6 s"."""
    assert [aim(run_s, 6.0, "s") for run_s in (0.0, 6.0, 65.1)] == ["of 6 s", "of 6 s", "6 s needed"]
    assert aim(18, 15, "rests") == "15 rests needed"


def test_nobody_is_told_to_flip_a_simulated_sensor() -> None:
    for status in (sensor("flip"), sensor("recording", run_s=9.0), sensor("idle")):
        assert advice(status, replays=True, ended=False).stage in ("wait", "turn")


def test_a_run_of_the_device_is_not_called_a_recording() -> None:
    assert words(sensor("recording", face="up")) == "measuring up"


def test_the_large_answer_is_the_latest_of_the_richest_method() -> None:
    results = [
        {"method": "baseline", "seconds": 6.0, "scale": 0.1}, {"method": "cnn", "seconds": 4.0, "scale": 0.2},
        {"method": "cnn", "seconds": 6.0, "scale": 0.3}, {"method": "model", "seconds": 6.0, "scale": None},
    ]  # fmt: skip
    assert answer(results) == results[2]
    assert answer([]) is None


class Board:
    """A board at a socket whose every sentence the test says. It samples at 100 Hz; z reads 78 deg/s up and -78 down."""

    RATE_HZ = 100

    def __init__(self) -> None:
        self.outlet = TcpOutlet("127.0.0.1:0")
        self._seq = self._n = 0

    def meet(self) -> None:
        while not self.outlet.connected():
            time.sleep(0.02)
        self.say("ACK", {"cmd": "hello"})
        scale = {"lsb_dps": 0.01, "lsb_g": 0.001, "lsb_c": 0.1, "zero_c": 0, "full_scale_dps": 250}
        self.say("HEL", {"proto": PROTOCOL, "sensor": "part", "rate_hz": self.RATE_HZ, "axis": "z", "table_dps": 78, **scale})

    def say(self, tag: str, fields: Any) -> None:
        data = encode(tag, self._seq, round(1e6 * self._n / self.RATE_HZ), 0, fields)
        self._seq += 1
        while data:
            data = data[self.outlet.write(data) :]
            if data:
                time.sleep(0.01)

    def turn(self, face: str, seconds: float, first_s: float = 0.0) -> None:
        """Samples of a run that goes on from ``first_s``."""
        z = 7800 if face == "up" else -7800
        for n in range(round(first_s * self.RATE_HZ), round((first_s + seconds) * self.RATE_HZ)):
            self._n += 1
            self.say("RAW", [n, 10, -20, z + (n % 5 - 2), 0, 0, 1000 if face == "up" else -1000, 251])


@pytest.fixture
def board() -> Iterator[Board]:
    found = Board()
    yield found
    found.outlet.close()


TONES = """window.tones = []; window.AudioContext = class { currentTime = 0; destination = {};
    createOscillator() { const f = {}; return {frequency: f, connect() {}, start() { tones.push(f.value); }, stop() {}}; } }"""


@pytest.mark.wide
def test_at_a_table_it_counts_to_six_says_flip_and_beeps(
    board: Board, serve: Callable[..., Any], look: Callable[..., Any], chromium: Any, tmp_path: Path
) -> None:
    served = serve(tmp_path, "--port", board.outlet.name)
    page = look(f"{served.url}start")
    page.get_by_text(f"{board.outlet.name} (given by --port)").wait_for()  # ports say what they are
    page.add_init_script(TONES)
    page.goto(served.url)
    coach = page.locator("[aria-label='what to do']")
    assert not coach.is_visible()  # there is nothing to do at a table before a device has spoken
    board.meet()
    coach.get_by_role("checkbox", name="beep").click()
    board.say("RUN", {"state": "start", "face": "up"})
    board.turn("up", 3.0)
    coach.get_by_text("Keep the table turning.").wait_for()
    coach.locator("[aria-label='3.0 s of 6 s']").wait_for()
    assert page.evaluate("tones") == []
    board.turn("up", 3.0, 3.0)
    coach.get_by_text("Flip now").wait_for()
    coach.locator("[aria-label='6.0 s of 6 s']").wait_for()
    page.wait_for_function("() => tones.length === 1")
    board.say("RUN", {"state": "end", "face": "up"})
    board.say("STA", {"state": "flip", "face": "up", "waits": "flip"})
    coach.get_by_text("turn the sensor over, then turn the table at 78 dps").wait_for()
    board.say("RUN", {"state": "start", "face": "down"})
    board.turn("down", 6.1)
    coach.get_by_text("Enough: the answer is complete.").wait_for()
    page.wait_for_function("() => tones.length === 2")
    assert page.evaluate("tones") == [FLIP_HZ, ANSWER_HZ]
    obeys(page, board)


def becomes(page: Any, value: str, wanted: str) -> None:
    """Wait until an expression of the page has the wanted value; tell what the page shows if it never does."""
    try:
        page.wait_for_function(f"() => {value} === '{wanted}'")
    except Exception as error:
        shown = "[...document.querySelectorAll('.strips input, .q-notification')].map(e => e.value ?? e.innerText)"
        pytest.fail(f"{value} is {page.evaluate(value)!r} beside {page.evaluate(shown)}: {error}")


def obeys(page: Any, board: Board) -> None:
    """The live chart: its tools, pause, window length, statistics, and a vertical range by hand."""
    chart = CHART % ".strips"
    able(page, 1)
    ends = f"[{chart}.getOption().xAxis[0].min, {chart}.getOption().xAxis[0].max]"
    page.wait_for_function(f"() => {{ const e = {ends}; return Math.abs(e[1] - e[0] - 10) < 0.01 && e[1] > 12; }}")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Go on").wait_for()  # the server has heard of it, and the frames before it have come
    paused = page.evaluate(ends)
    board.turn("down", 1.0, 6.1)
    page.wait_for_timeout(600)
    assert page.evaluate(ends) == paused
    rows = list(csv.DictReader(downloaded(page, page, "save as CSV").decode().splitlines()))
    assert len(rows) == pytest.approx(10 * Board.RATE_HZ, abs=1)  # what the chart shows, not what came since
    assert float(rows[-1]["t_s"]) == pytest.approx(paused[1], abs=0.02)
    assert float(rows[-1]["gz_dps"]) == pytest.approx(-78, abs=0.03)
    page.get_by_role("button", name="Go on").click()
    page.wait_for_function(f"end => {ends}[1] > end + 0.9", arg=paused[1])
    page.get_by_role("combobox", name="window").click()
    page.get_by_role("option", name="5 s", exact=True).click()
    page.wait_for_function(f"() => {{ const e = {ends}; return Math.abs(e[1] - e[0] - 5) < 0.01; }}")
    page.get_by_role("checkbox", name="mean and scatter of the window").click()
    page.locator(".reading", has_text="z, dps").get_by_text(re.compile(r"scatter 0\.014\d")).wait_for()
    assert page.locator(".reading b").nth(2).inner_text() == "-78.000"
    page.get_by_text("vertical range").click()
    page.get_by_role("spinbutton", name="from").fill("-90")
    page.get_by_role("spinbutton", name="to").fill("-70")
    page.get_by_role("button", name="Set", exact=True).click()
    y = f"[{chart}.getOption().yAxis[2].min, {chart}.getOption().yAxis[2].max]"
    becomes(page, f"{y}.join()", "-90,-70")
    page.get_by_role("button", name="Automatic").click()
    becomes(page, f"{y}.join()", ",")


def test_a_fast_replay_tells_the_rate_of_its_own_time() -> None:
    """At speed 4 a sensor of 145 Hz had "580 samples a second"."""
    sensor = {"rate_hz": 580.4, "hello": {"rate_hz": "145"}}
    assert sample_rate(sensor, replays=True) == "145 samples a second of its own time, which runs 4.0 times as fast"
    assert sample_rate(sensor, replays=False) == "580 samples a second"
    assert sample_rate({"rate_hz": 144.6, "hello": {"rate_hz": "145"}}, replays=True) == "145 samples a second"
    assert sample_rate({}, replays=True) == "0 samples a second"
