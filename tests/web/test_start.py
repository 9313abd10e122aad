"""The first page: sessions with what they are, a path, a surprise, ports."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace as NS
from typing import Any, cast

import pytest

from gyrocal.effects.base import effects
from gyrocal.simulation.simulate import simulate
from gyrocal.web.device import live
from gyrocal.web.state.places import Places
from gyrocal.web.state.surprise import Hunt, Secret


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any], chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("start")
    simulate(folder / "mine", "paper", ["table_ripple"], 3, scenarios=1, seconds=8)
    for k in range(12):  # more than the list has room for
        shutil.copytree(folder / "mine", folder / f"nameless{k}")
        header = folder / f"nameless{k}/session.toml"
        header.write_text("".join(line for line in header.open() if not line.startswith("sensor")))
    (folder / "broken").mkdir()
    (folder / "broken/session.toml").write_text("format = ")
    return serve(folder)


def test_sessions_are_listed_with_what_they_are(served: Any) -> None:
    listed = {one.name: one for one in Places([served.folder]).listed()}
    mine = listed["mine"]
    assert (mine.sensor, mine.runs, mine.problem) == ("LSM6DSO (simulated)", 2, "")
    assert mine.size_bytes == sum(f.stat().st_size for f in (served.folder / "mine").glob("*.csv"))
    assert re.fullmatch(r"changed \d{4}-\d\d-\d\d", mine.date)  # the session does not say when it was recorded
    assert listed["broken"].problem == "cannot be read"
    assert listed["nameless0"].sensor == "sensor not named"


def test_a_stated_date_is_shown(tmp_path: Path) -> None:
    simulate(tmp_path / "s", scenarios=1, seconds=1)
    header = tmp_path / "s/session.toml"
    header.write_text('made_on = "2024-02-29"\n' + header.read_text())
    assert [one.date for one in Places([tmp_path]).listed()] == ["2024-02-29"]


@pytest.mark.parametrize("width", [390, 1280])
def test_no_line_of_the_list_lies_on_another(served: Any, look: Callable[..., Any], width: int) -> None:
    page = look(f"{served.url}start")
    page.set_viewport_size({"width": width, "height": 844})
    page.locator(".sessions .name").first.wait_for()
    texts = page.locator(".sessions .name, .sessions .dim")
    boxes = [box for box in (one.bounding_box() for one in texts.all()) if box]
    assert len(boxes) > 24
    for k, a in enumerate(boxes):
        for b in boxes[k + 1 :]:
            apart = a["y"] + a["height"] <= b["y"] + 1 or b["y"] + b["height"] <= a["y"] + 1
            assert apart or a["x"] + a["width"] <= b["x"] + 1 or b["x"] + b["width"] <= a["x"] + 1


def test_the_live_page_says_nothing_of_a_table_before_a_device_is_there(served: Any, look: Callable[..., Any]) -> None:
    """Without a device it told to turn the table and to press Record, which is not there, and its state was "None"."""
    page = look(f"{served.url}live")
    page.get_by_role("button", name="Start a simulated device").wait_for()
    page.wait_for_timeout(1500)
    assert not page.locator("[aria-label='what to do']").is_visible()
    assert "None" not in page.locator("body").inner_text().split("\n")


def test_a_path_opens_and_one_outside_says_why(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start")
    page.get_by_role("button", name="mine LSM6DSO (simulated)").wait_for()
    page.get_by_text("No serial device is plugged in.").wait_for()
    field = page.get_by_label("path of a session's folder")
    field.fill("/etc")
    page.get_by_role("button", name="Open", exact=True).click()
    page.get_by_text("/etc: outside").wait_for()
    field.fill(str(served.folder / "mine"))
    field.press("Enter")
    page.locator(".session-name", has_text="mine").wait_for()
    page.locator(".figure b").first.wait_for()


@pytest.mark.wide
def test_the_truth_of_a_surprise_is_told_when_asked_for(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start")
    page.get_by_role("button", name="Surprise me").click()
    line = page.locator("[aria-label='hidden effect']")
    line.get_by_text("An effect is hidden in this session.").wait_for()
    page.locator(".figure b").first.wait_for()
    truth = (served.folder / "simulated.truth.json").read_text()
    line.get_by_role("button", name="Show the truth").click()
    told = line.get_by_role("status")
    told.wait_for()
    hidden = [kind for kind in effects().values() if f'"id": "{kind.id}"' in truth]
    assert len(hidden) == 1
    assert f"Hidden was: {hidden[0].title}" in told.inner_text()
    assert "Your model does not have it." in told.inner_text()


@pytest.mark.parametrize(("has", "said"), [(True, "Your model has it."), (False, "Your model does not have it.")])
def test_the_truth_says_whether_the_model_has_it(tmp_path: Path, has: bool, said: str) -> None:
    simulate(tmp_path / "s", "paper", ["table_ripple:amplitude_1=0.002"], 3, scenarios=1, seconds=1)
    view = NS(effects=[("scale", "Scale error", False), *([("table_ripple", "Ripple", True)] if has else [])])
    hunt = Hunt(cast(Any, NS(session=NS(path=tmp_path / "s"), step=NS(view=view), changed=lambda topic: None)))
    hunt._secrets[tmp_path / "s"] = Secret("table_ripple")
    hunt.tell()
    assert hunt.secret is not None
    assert hunt.secret.told
    truth = hunt.truth()
    assert truth.startswith("Hidden was: Ripple of the table's speed on z (amplitude_1 0.2 %)")
    assert truth.endswith(said)


class Port:
    """A port as pyserial lists it."""

    def __init__(self, **told: Any) -> None:
        self.__dict__.update(
            dict.fromkeys(("manufacturer", "product", "vid", "pid", "serial_number")) | {"description": "n/a"} | told
        )


def test_ports_say_what_they_are() -> None:
    board = Port(
        device="/dev/ttyUSB0", manufacturer="Silicon Labs", product="CP2102", vid=0x10C4, pid=0xEA60, serial_number="0001"
    )
    assert live.described(board) == "/dev/ttyUSB0: Silicon Labs, CP2102, USB 10c4:ea60, no. 0001"
    assert live.described(Port(device="/dev/ttyS0")) == "/dev/ttyS0"
