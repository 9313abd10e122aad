"""A session whose reference is gravity opens with its rests and its comparison by angle."""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.digits import UNKNOWN
from gyrocal.gravity.compare import compare, residual_table
from gyrocal.present.output import plus_minus
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

LISTS = ("Rests", "Movements between them")


@pytest.mark.wide
def test_rests_and_comparison_are_those_of_the_command_line(
    workbench: Any, look: Callable[..., Any], chromium: Any
) -> None:
    folder: Path = workbench.folder
    simulate(folder / "hand", "hands", [], 3)
    simulate(folder / "turned", "paper", [], 3, scenarios=1, seconds=2)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["compare", str(folder / "hand"), "--json"]) == 0
    compared = json.loads(out.getvalue())
    page = look(f"{workbench.url}compare?session=hand")
    page.locator(".figure b").first.wait_for()
    assert page.locator(".session-name").inner_text() == "hand"
    shown = page.locator(".figure b").all_inner_texts()
    told = [plus_minus(compared[name], compared["excess_se_deg"]) for name in ("rms_deg", "floor_deg", "excess_deg")]
    assert shown == [text.split(" ± ")[0] for text in told]
    for title, counted in zip(LISTS, (compared["rests"], compared["movements"]), strict=True):
        listed = page.locator(f"[aria-label='{title}']")
        assert listed.locator("tbody tr").count() == counted
        assert page.get_by_role("heading", name=f"{title} ({counted})").is_visible()
        assert listed.evaluate("e => e.scrollHeight <= e.clientHeight")  # all of them are on the page
    moved = page.locator("[aria-label='Movements between them']")
    told = [" ".join(name.split()) for name in moved.locator("th").all_inner_texts()]
    rows = residual_table(compare(Session.open(folder / "hand"))).rows(named=True)
    columns = {
        "until, s": "t_s", "turned by accelerometer, deg": "measured_deg", "by gyroscope with model, deg": "modelled_deg",
        "angle between both, deg": "residual_deg",
    }  # fmt: skip
    first = moved.locator("tbody tr").first.locator("td").all_inner_texts()
    for title, name in columns.items():
        assert float(first[told.index(title)]) == pytest.approx(rows[0][name], abs=0.06 if name == "t_s" else 6e-4)
    budgets = page.locator("[aria-label='error budget'] table")
    assert budgets.count() == 3
    assert "sample clock" in budgets.first.inner_text()
    answers = page.locator("table.plain", has_text="trusted").inner_text()
    assert re.findall("bias[^,]*, (m?dps)", answers + budgets.first.inner_text()) == ["dps", "dps"]  # biases of several dps
    assert "one stretch of time after another is left out of the fit" in page.locator("[aria-label=verdict]").inner_text()
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280

    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_function("innerWidth === 390")
    assert all(page.locator(f"[aria-label='{title}']").bounding_box()["height"] < 0.62 * 844 for title in LISTS)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390

    page.goto(f"{workbench.url}compare?session=turned")
    page.locator(".session-name", has_text="turned").wait_for()
    page.get_by_text("not known: nothing could be left out of the fit").wait_for()
    assert "±" not in page.locator("[aria-label=verdict]").inner_text()  # nothing is known, with no error of it either
    assert page.locator(".figure b").all_inner_texts()[0] == UNKNOWN
    page.locator(".per-axis").evaluate("e => { e.textContent = 'x 333.88 ± 13.06 · '.repeat(4); }")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_session_of_turns_of_known_angle_is_shown_whole(
    workbench: Any, look: Callable[..., Any], chromium: Any
) -> None:
    """The page ended after the findings: figures, strip and chart of a session that is judged by angle were absent."""
    folder: Path = workbench.folder
    rng = np.random.default_rng(5)
    t_s = np.arange(600) / 100
    (folder / "turns").mkdir()
    runs = []
    for i in range(24):
        axis, turn_deg = "zx"[i // 2 % 2], 90.0 * (1 if i % 2 else -1)
        rate_dps = 1.01 * turn_deg / 4.0 * ((t_s >= 1) & (t_s < 5)) + 0.3
        part = {"x": float(axis == "x"), "y": 0.0, "z": 1.0 if axis == "z" else 0.05}  # z sees a part of turns about x
        table = {f"g{a}_dps": rng.normal(0, 0.05, t_s.size) + part[a] * rate_dps for a in "xyz"}
        pl.DataFrame({"t_s": t_s} | table).write_csv(folder / "turns" / f"{i:02d}.csv")
        known = f'scenario = "s{i // 8}", face = "up", axis = "{axis}", turn_deg = {turn_deg}'
        runs.append(f'    {{ file = "{i:02d}.csv", {known} }},')
    head = 'format = "gyrocal-session/1"\naxis = "z"\nsample_rate_hz = 100.0\nrun = [\n'
    (folder / "turns" / "session.toml").write_text(head + "\n".join(runs) + "\n]\n")
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        main(["compare", str(folder / "turns"), "--json"])
    compared = json.loads(out.getvalue())
    assert compared["residual"] == "angle"
    assert compared["where"], "without a finding the fault does not show"
    page = look(f"{workbench.url}compare?session=turns")
    page.locator(".figure b").first.wait_for()
    told = plus_minus(compared["rms_deg"], compared["excess_se_deg"]).split(" ± ")[0]
    assert page.locator(".figure b").first.inner_text() == told
    assert page.locator(".cells .cell").count() == 24
    page.locator("[role=img] canvas").first.wait_for()
