"""The guide of a recording by hand: what it says at each stage, and on the live page."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.policy import POLICY
from gyrocal.recording.session import Session
from gyrocal.web.device.guide import errors, guidance

TURN = "hold x level, z up or down; turn it about x by about 180 deg, either way; keep it still for two seconds"


def hands(rests: int, scale_se: float | None = 0.001, cross_se: float | None = 0.001, met: bool = False) -> dict[str, Any]:
    aims = [
        {"axis": a, "scale_se": scale_se, "misalignment_se": cross_se, "scale_aim": 0.0015, "misalignment_aim": 0.002}
        for a in "xyz"
    ]
    return {"rests": rests, "at_rest": True, "aims": aims, "turn": TURN, "met": met}


@pytest.mark.parametrize(
    ("now", "going", "stage", "tell", "why"),
    [
        (None, True, "wait", "leave it still for ten seconds", "pose to pose"),
        (None, False, "wait", "ended without a rest", "Record again"),
        (hands(2, None, None), True, "turn", "Hold x level", f"known from {POLICY.fewest_rests} rests on"),
        (hands(9, 0.004), True, "turn", "turn it about x", "Not yet known well enough: scale of x, y, z. This turn"),
        (hands(9, 0.004, 0.003), True, "turn", "Hold", "scale of x, y, z; misalignment of x, y, z"),
        (hands(14), True, "turn", "Hold", "1 more rest in other poses"),
        (hands(9, 0.004), False, "wait", "ended before its aims were met", "in the same folder adds to it"),
        (hands(15, met=True), False, "done", "Done", "calibration will state"),
    ],
)
def test_it_says_what_to_do_and_what_is_missing(now: Any, going: bool, stage: str, tell: str, why: str) -> None:
    found = guidance({"by_hand": True, "going": going, "hands": now})
    assert found.stage == stage
    assert tell in found.tell
    assert why in found.why


def test_a_bar_is_full_where_the_aim_is_met() -> None:
    drawn = errors(hands(9, 0.003)["aims"])
    assert "0.300 %, aim 0.15 %" in drawn
    assert drawn.count("50% of the way to the aim") == 3
    assert drawn.count("reached good") == 3
    assert errors(hands(2, None, None)["aims"]).count("not known yet") == 6


@pytest.mark.wide
def test_the_page_guides_a_simulated_hand_to_the_aims(
    serve: Callable[..., Any], look: Callable[..., Any], chromium: Any, tmp_path: Path, require_tool: Callable[[str], str]
) -> None:
    require_tool("cc")
    page = look(f"{serve(tmp_path).url}live")
    page.get_by_label("speed").click()
    page.get_by_role("option", name="20 times faster").click()
    page.get_by_role("button", name="Start one held in a hand").click()
    page.get_by_role("button", name="Record by hand").wait_for()
    page.wait_for_timeout(3000)  # who presses it a minute of the device late still meets the aims
    page.get_by_role("button", name="Record by hand").click()
    guide = page.locator("[aria-label='what to do by hand']")
    guide.get_by_text(re.compile("^(Lay|Hold|Done)")).wait_for()
    page.get_by_text(re.compile("^Writing .*, 0 lost$")).wait_for()  # what was sent before is not lost
    guide.get_by_text("Done: every axis is known well enough.").wait_for()
    page.get_by_text(re.compile("1 recording, .* is in recorded")).wait_for()
    assert page.locator("[aria-label='errors by hand'] .reached.good").count() == 6
    assert not page.locator("[aria-label='what to do']").is_visible()
    assert Session.open(tmp_path / "recorded").reference.kind == "gravity"
