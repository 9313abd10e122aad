"""A session that contradicts itself is told so on top of the panels, and is not said to fit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.simulation.simulate import simulate


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    folder: Path = workbench.folder
    session, _ = simulate(None, "full", (), 3, scenarios=1, seconds=6.0)
    wrong = [replace(r, face="up") if r.file == "008_down.csv" else r for r in session.runs]
    session.with_runs(wrong).save(folder / "slip")
    rates = pl.col("gx_dps", "gy_dps", "gz_dps") * (np.pi / 180)
    session.with_runs([replace(r, path=None, frame=r.table.with_columns(rates)) for r in session.runs]).save(folder / "radians")
    return workbench


def test_the_warning_stands_on_top(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=slip")
    page.get_by_text("The session's axis is not judged.").wait_for()
    told = page.locator('[aria-label="warnings"]')
    assert "008_down.csv: " in told.inner_text()
    assert "(face_wrong)" in told.inner_text()
    assert not page.get_by_text("The model is adequate.").is_visible()
    page.get_by_role("button", name="Diagnose").first.click()
    page.get_by_text("own axis is not judged").first.wait_for()
    assert page.locator('[aria-label="what is missing"] [aria-label="warnings"]').is_visible()


def test_the_strip_marks_the_run_that_is_wrong(served: Any, look: Callable[..., Any]) -> None:
    """Its error was left out of the strip, because the axis is not judged, and the strip contradicted the excess above it."""
    page = look(f"{served.url}compare?session=slip")
    page.locator(".figure b").first.wait_for()
    told = page.locator(".strip .cell").evaluate_all("cells => cells.map(c => c.title)")
    excess = {text.split(",")[0]: float(text.split("excess ")[1].split()[0]) for text in told}
    assert max(excess, key=lambda file: excess[file]) == "008_down.csv"
    assert excess["008_down.csv"] > float(page.locator(".figure.excess b").inner_text())


@pytest.mark.wide
def test_a_button_mends_it_once_it_is_confirmed(served: Any, look: Callable[..., Any]) -> None:
    header = served.folder / "slip/session.toml"
    before = header.read_text()
    page = look(f"{served.url}compare?session=slip")
    mend = page.get_by_role("button", name="Change the face of 008_down.csv")
    assert mend.evaluate("e => parseFloat(getComputedStyle(e).fontSize)") >= 14  # it was 10 px
    mend.click()
    page.get_by_text('face = "up" of 008_down.csv becomes face = "down"').wait_for()
    page.get_by_role("button", name="Cancel").click()
    page.get_by_role("button", name="Do it").wait_for(state="hidden")
    assert header.read_text() == before
    page.get_by_role("button", name="Change the face of 008_down.csv").click()
    page.get_by_role("button", name="Do it").click()
    page.get_by_text("The model is adequate.").wait_for()
    assert "face_wrong" not in page.locator("body").inner_text()
    assert (served.folder / "slip/session.toml.before").read_text() == before


@pytest.mark.wide
def test_an_axis_that_is_not_judged_has_no_figure_of_its_own(served: Any, look: Callable[..., Any]) -> None:
    """A session in rad/s showed an excess of some mdps in the colour of a verdict, and one of the axis that was not judged."""
    page = look(f"{served.url}compare?session=radians")
    page.get_by_text("The session's axis is not judged.").wait_for()
    page.get_by_text("Not judged: figures of the readings as they stand").wait_for()
    by_axis = page.locator(".per-axis", has_text="excess by axis").inner_text()
    assert by_axis.endswith("z (not judged)")
    excess = page.locator(".figure.excess b")
    assert excess.evaluate("e => getComputedStyle(e).color") not in ("rgb(184, 74, 0)", "rgb(0, 122, 89)")
