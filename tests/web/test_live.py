"""The live page against the simulated device: the firmware's own core behind a virtual port."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal.device.outlet import Outlet, TcpOutlet
from gyrocal.device.simulated import SimulatedDevice, replay, simulated_scenario
from gyrocal.device.wire import PROTOCOL, encode
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.words import method


@pytest.fixture(scope="module")
def scenario() -> Session:
    session, _ = simulate(None, "paper", ["table_ripple"], 5, scenarios=1, seconds=12)
    return session


def means_dps(session: Session) -> list[float]:
    """Mean reading of the table's axis in each run, deg/s: sensors differ in scale and bias."""
    return [float(run.gyro_dps[:, run.axis_index].mean()) for run in session.runs]


def rates(page: Any) -> list[float]:
    return [float(text) for text in page.locator(".reading b").all_inner_texts()]


@pytest.fixture(scope="module")
def served(
    serve: Callable[..., Any], chromium: Any, tmp_path_factory: pytest.TempPathFactory, require_tool: Callable[[str], str]
) -> Any:
    require_tool("cc")
    folder = tmp_path_factory.mktemp("live")
    return serve(folder, "--port", str(folder / "board"))


CHART = "getElement(Number(document.querySelector('.nicegui-echart').id.slice(1))).chart"


@pytest.mark.wide
def test_a_port_opens_live_and_the_chart_begins_with_the_first_sample(
    served: Any, look: Callable[..., Any], scenario: Session
) -> None:
    """No zeros and no negative time before the device has spoken; every axis of the chart says what it is."""
    link = served.folder / "board"
    with SimulatedDevice(scenario, 1.0, symlink=link):
        page = look(served.url)
        page.locator("nav button[aria-current=page]", has_text="Live").wait_for()
        page.get_by_text(f"Connected to {link}").wait_for()
        page.wait_for_function(f"() => {CHART}.getOption().series[2].data.length > 10")
        drawn = page.evaluate(f"() => {{ const o = {CHART}.getOption(); return [o.xAxis[0].min, o.series[2].data]; }}")
        from_s, points = drawn
        assert from_s >= 0
        assert all(t_s >= from_s - 0.1 and min(abs(value - mean) for mean in means_dps(scenario)) < 2 for t_s, value in points)
        words = f"const o = {CHART}.getOption(); return [o.xAxis[4].name, o.legend[0].data.map(e => e.name)];"
        told = page.evaluate(f"() => {{ {words} }}")
        assert told[0].startswith("time of the device, s")
        assert told[1] == ["a x", "a y", "a z"]


def test_all_strips_are_in_sight_beside_an_answer(served: Any, look: Callable[..., Any], scenario: Session) -> None:
    """At 1280 x 720 the temperature lay below the edge as soon as there was an answer."""
    link = served.folder / "board"
    with SimulatedDevice(scenario, 20.0, symlink=link):
        page = look(f"{served.url}live")
        page.locator(".results .figure").first.wait_for()
        page.wait_for_timeout(500)
        bottom = "e => e.getBoundingClientRect().bottom"
        assert page.locator(".strips canvas").evaluate(bottom) <= 720
        assert page.locator(".strips canvas").bounding_box()["height"] > 250


def test_unplugged_and_plugged_in_again(served: Any, look: Callable[..., Any], scenario: Session) -> None:
    link = served.folder / "board"
    with SimulatedDevice(scenario, 1.0, symlink=link):
        page = look(f"{served.url}live")
        page.get_by_text(f"Connected to {link}").wait_for()
        page.wait_for_function(
            "(means) => means.some(m => Math.abs(parseFloat(document.querySelectorAll('.reading b')[2].innerText) - m) < 1)",
            arg=means_dps(scenario),
        )
    page.get_by_text("Unplugged: waiting for it to come back").wait_for()
    with SimulatedDevice(scenario, 1.0, symlink=link):
        page.get_by_text(f"Connected to {link}").wait_for()
        state = page.locator("[aria-label='what to do']")
        state.get_by_text(re.compile("measuring (up|down)")).wait_for()
        first = page.locator(".reading b").first.inner_text()
        page.wait_for_function("(first) => document.querySelector('.reading b').innerText !== first", arg=first)
    page.get_by_text("Unplugged: waiting for it to come back").wait_for()
    page.get_by_role("button", name="Disconnect").click()
    page.get_by_role("button", name="Connect", exact=True).wait_for()


@pytest.mark.slow
def test_a_simulated_device_from_the_page(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}live")
    page.get_by_label("speed").click()
    page.get_by_role("option", name="5 times faster").click()  # at 20 its 140 s end before a busy machine shows the button
    page.get_by_role("button", name="Start a simulated device").click()
    page.get_by_role("button", name="Record", exact=True).click()
    page.get_by_role("button", name="Stop recording").wait_for()
    page.get_by_text("The simulated device has played its recording to the end.").wait_for()
    page.get_by_text(re.compile(r"\d recordings?, \d+ s, (is|are) in recorded")).wait_for()
    down_dps = means_dps(simulated_scenario([], seed=0))[1]
    assert abs(rates(page)[2] - down_dps) < 1.0
    assert "0 lost, 0 damaged, 0 restarts" in page.locator("[aria-label=connection]").inner_text()

    page.reload()  # the device has stopped: nothing comes any more, and what came stays
    page.wait_for_function(f"() => {CHART}.getOption().series[2].data.length > 10")
    assert abs(rates(page)[2] - down_dps) < 1.0
    page.get_by_role("button", name="light or dark").click()
    page.wait_for_function("() => document.body.classList.contains('body--dark')")
    page.wait_for_function(f"() => {CHART}.getOption().title[0].textStyle.color === '{charts.DARK.dim}'")
    page.wait_for_function(f"() => {CHART}.getOption().series[2].data.length > 10")

    fold, around = (page.locator(f"[aria-label=results]{of}").bounding_box() for of in (" summary", ""))
    assert fold["y"] + fold["height"] <= around["y"] + around["height"]  # the answer and its fold are not cut off
    page.get_by_text("All answers").click()
    results = page.locator("[aria-label=results] tbody tr")
    methods = {row.split("\t")[1] for row in results.all_inner_texts()}
    assert {method("baseline"), method("cnn")} <= methods
    assert page.locator("[aria-label=results] .light.bad").is_visible()  # the table ripples, which nobody told the device
    assert page.locator("[aria-label=results]").get_by_text("record a session and diagnose it").is_visible()

    recorded = Session.open(served.folder / "recorded")
    assert recorded.runs[-1].face == "down"
    assert abs(means_dps(recorded)[-1] - down_dps) < 1.0
    page.get_by_role("button", name="Does the model fit it?").click()
    page.locator(".session-name", has_text="recorded").wait_for()
    page.locator(".figure b").first.wait_for()
    page.get_by_role("button", name="Live").click()
    page.get_by_role("button", name="Disconnect").click()
    page.get_by_role("button", name="Connect", exact=True).wait_for()
    # the readings of one device did not stay for the next one
    page.wait_for_function("() => [...document.querySelectorAll('.reading b')].every(b => b.innerText === '-')")


class Gate:
    """An outlet that takes no more once both sensors' first runs have begun, until it is opened: the device waits so long."""

    def __init__(self, outlet: Outlet) -> None:
        self._outlet, self._starts, self.is_open = outlet, 0, False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._outlet, name)

    def write(self, data: bytes) -> int:
        if self._starts >= 2 and not self.is_open:
            return 0
        line = data[: data.find(b"\n") + 1]
        written = self._outlet.write(line)
        self._starts += written == len(line) and b"state=start" in line
        return written


@pytest.mark.wide
def test_each_sensor_of_a_board_has_its_own(
    serve: Callable[..., Any], look: Callable[..., Any], tmp_path: Path, require_tool: Callable[[str], str]
) -> None:
    require_tool("cc")
    parts = [simulate(None, "paper", [], seed, scenarios=1, seconds=12)[0] for seed in (7, 8)]
    link = tmp_path / "board"
    page = look(f"{serve(tmp_path, '--port', str(link)).url}live")
    board, second = page.locator("[aria-label='sensors of the board']"), re.compile("sensor 1: ")
    device = SimulatedDevice(parts, 4.0, symlink=link)
    device._outlet = gate = Gate(device._outlet)
    with device:
        board.get_by_role("button", name=re.compile("sensor 0: "), pressed=True).wait_for()
        board.get_by_role("button", name=re.compile("sensor 1: measuring up")).wait_for()
        board.get_by_role("button", name=second).click()
        board.get_by_role("button", name=second, pressed=True).wait_for()
        page.get_by_role("button", name="Record", exact=True).click()
        page.get_by_text("Nothing is written until the next run of the device begins.").wait_for()
        gate.is_open = True
        page.get_by_text("Unplugged: waiting for it to come back").wait_for()
        page.get_by_text(re.compile(r"\d recordings, \d+ s, are in recorded")).wait_for()  # the recorder is done
        page.get_by_text("All answers").click()
        shown = [row.split("\t") for row in page.locator("[aria-label=results] tbody tr").all_inner_texts()]
    said = [s for s in replay(parts[1]) if s.tag == "CAL" and s.fields["method"] == "baseline"]
    assert [row[3] for row in shown if row[1] == method("baseline")] == [f"{100 * (s.real('scale') or 0):.4f}" for s in said]
    recorded = Session.open(tmp_path / "recorded")
    theirs = [np.abs(recorded.runs[-1].gyro_dps[-100:] - part.runs[-1].gyro_dps[-100:]).max() for part in parts]
    assert theirs[1] < 0.00876 < theirs[0]


@pytest.mark.wide
def test_the_first_sensor_is_shown_whichever_speaks_first(
    serve: Callable[..., Any], look: Callable[..., Any], tmp_path: Path
) -> None:
    board = TcpOutlet("127.0.0.1:0")
    page = look(f"{serve(tmp_path, '--port', board.name).url}live")
    while not board.connected():
        time.sleep(0.05)
    for imu in (1, 0):
        hello = encode("ACK", 0, 0, imu, {"cmd": "hello"}) + encode(
            "HEL", 1, 0, imu, {"proto": PROTOCOL, "sensor": f"part {imu}"}
        )
        assert board.write(hello) == len(hello)
        page.locator("[aria-label=connection]").get_by_text(f"part {imu}").wait_for()
    sensors = page.locator("[aria-label='sensors of the board']")
    sensors.get_by_role("button", name=re.compile("sensor 0: "), pressed=True).wait_for()
    second = re.compile("sensor 1: ")
    sensors.get_by_role("button", name=second).click()
    sensors.get_by_role("button", name=second, pressed=True).wait_for()
    board.close()


@pytest.mark.wide
def test_a_port_that_is_none(served: Any, look: Callable[..., Any], tmp_path: Path) -> None:
    secret = served.folder / "secret"
    secret.write_text("nothing to see")
    page = look(f"{served.url}live")
    for name, words in (
        (str(secret), "not a serial port"),
        (f"spy:///dev/ttyS0?file={tmp_path}/spied", "not a serial port"),
        ("/dev/ttyNOWHERE", "no such port; plug the device in"),
    ):
        field = page.get_by_label("serial port")
        field.fill(name)
        field.press("Enter")
        page.get_by_role("button", name="Connect", exact=True).click()
        page.get_by_text(words).first.wait_for()
    assert not (tmp_path / "spied").exists()
