"""The last run in the fits cannot be left out: neither a warning nor the strip of runs offers it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from gyrocal.recording.run import Run
from gyrocal.simulation.simulate import simulate


def begins_apart(run: Run) -> Run:
    """The run with a first reading far from what follows, of which a warning speaks."""
    apart = pl.col("gx_dps") + pl.when(pl.int_range(pl.len()) == 0).then(1.0).otherwise(0.0)
    table = run.table.with_columns(apart)
    return replace(run, path=None, frame=table)


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    folder: Path = workbench.folder
    session, _ = simulate(None, "full", ["vibration_tone:f_hz=11.83,A_dps=0.05"], 3, scenarios=1, seconds=8.0)
    first, second = session.runs[:2]
    session.with_runs([begins_apart(first)]).save(folder / "single")
    session.with_runs([first, begins_apart(second)]).save(folder / "pair")
    return workbench


def test_a_session_of_one_run_keeps_it(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=single")
    page.locator(".figure b").first.wait_for()
    page.get_by_text("(first_sample)").wait_for()
    assert page.get_by_role("button", name="Leave", exact=False).count() == 0
    page.get_by_text("It cannot be left out of the fit, because there is no other.").wait_for()
    cell = page.locator(".strip .cell")
    assert cell.get_attribute("aria-disabled") == "true"
    cell.click(force=True)  # Playwright waits for a button that is disabled
    assert "left out" not in cell.get_attribute("title")


@pytest.mark.wide
def test_the_last_of_two_keeps_it_until_the_other_is_back(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=pair")
    page.get_by_role("button", name="Leave", exact=False).first.wait_for()
    assert page.get_by_role("button", name="Leave", exact=False).count() == 1
    assert page.locator(".cell[aria-disabled=true]").count() == 0
    first, second = (page.locator(".strip .cell").nth(k) for k in range(2))
    name = second.get_attribute("title").split(",")[0]
    first.click()
    page.get_by_text(f"1 left out. ▲ face up, ▼ face down. {name} is the only one in the fit, and stays.").wait_for()
    page.locator(".figure b").first.wait_for()
    page.locator(".job").wait_for(state="hidden")  # when it ends, the strip is drawn anew, and a press in that moment is lost
    assert page.get_by_role("button", name="Leave", exact=False).count() == 0
    assert second.get_attribute("aria-disabled") == "true"
    first.click()
    page.get_by_text("Press one to leave it out of the fit.").wait_for()
