"""Every chart of every page has a crosshair with values and units, box zoom, reset, a legend, plain ticks, CSV and PNG."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate

ABILITIES = """e => { const o = getElement(Number(e.id.slice(1))).chart.getOption(), near = e.closest('section, .drawn, .face');
    return {told: !!o.tooltip?.[0]?.formatter, box: o.toolbox?.length === 1, ticks: o.yAxis.length + o.xAxis.length,
        named: o.legend?.some(l => l.data.length) ?? false, bars: o.series.every(s => s.type === 'bar'),
        linked: o.xAxis.length === 1 || o.axisPointer[0].link?.length === 1,
        buttons: [...near.querySelectorAll('button')].map(b => b.ariaLabel)}; }"""
BUTTONS = {"box zoom", "reset zoom", "save as CSV", "save as PNG"}
CHART = "getElement(Number(document.querySelector('%s .nicegui-echart').id.slice(1))).chart"


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    simulate(workbench.folder / "charts", "paper", ["table_ripple"], 3, scenarios=3, seconds=10)
    simulate(workbench.folder / "charts-by-hand", "hands", [], 3)
    return workbench


def able(page: Any, least: int) -> None:
    """All charts of the page have everything."""
    page.wait_for_function(
        "least => { const all = [...document.querySelectorAll('.nicegui-echart')]; return all.length >= least &&"
        " all.every(e => getElement(Number(e.id.slice(1)))?.chart?.getOption()?.series?.length); }", arg=least
    )  # fmt: skip
    for chart in page.locator(".nicegui-echart").all():
        found = chart.evaluate(ABILITIES)
        assert set(found["buttons"]) >= BUTTONS, found
        assert all(found[what] for what in ("told", "box", "linked")), found
        assert found["named"] or found["bars"], found  # bars are labelled by their own names


def downloaded(place: Any, page: Any, name: str) -> bytes:
    with page.expect_download() as download:
        place.get_by_role("button", name=name).click()
    return Path(download.value.path()).read_bytes()


@pytest.mark.wide
def test_every_chart_of_a_session_has_all_its_tools(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=charts")
    page.locator(".figure b").first.wait_for()
    able(page, 1)
    page.goto(f"{served.url}diagnose")
    page.get_by_role("button", name="Find what is missing").click()
    page.locator("article.add").first.wait_for()
    able(page, 3)
    page.set_viewport_size({"width": 1280, "height": 800})
    box = page.locator('[aria-label^="excess error, mdps:"]').bounding_box()
    assert box["y"] + box["height"] <= 500  # beside the picture; with another line of effects above it, still in sight
    for place, unit, least in ((".hero-picture", "mdps", 20), (".drawn:nth-of-type(3)", "mdps", 1)):
        rows = list(csv.DictReader(downloaded(page.locator(place), page, "save as CSV").decode().splitlines()))
        assert len(rows) >= least
        assert {row["unit"] for row in rows} == {unit}
        assert downloaded(page.locator(place), page, "save as PNG").startswith(b"\x89PNG")
    page.get_by_role("button", name="Calibrate & export").click()
    page.locator("table.plain", has_text="misfit").first.wait_for()
    able(page, 1)
    place = page.locator("section[aria-label='scale and bias']")
    rows = list(csv.DictReader(downloaded(place, page, "save as CSV").decode().splitlines()))
    assert {row["x"] for row in rows} == {"s000", "s001", "s002"}
    box = place.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.wait_for_function("() => /s001[^]* ± [^]* m?dps/.test(document.querySelector('.scattered').innerText)")


@pytest.mark.wide
def test_a_session_by_gravity_is_drawn_with_its_rests_and_zooms_as_one(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=charts-by-hand")
    page.locator(".figure b").first.wait_for()
    able(page, 1)
    strips = CHART % ".content"
    rests = page.locator("[aria-label='Rests'] tbody tr").count()
    assert page.evaluate(f"{strips}.getOption().series[0].markArea.data.length") == rests
    canvas = page.locator(".nicegui-echart canvas").first.bounding_box()
    x, y = canvas["x"] + 0.3 * canvas["width"], canvas["y"] + 60
    page.mouse.move(x, y)
    page.wait_for_function("() => /gz_dps[^]*dps[^]*az_g[^]* g/.test(document.querySelector('.nicegui-echart').innerText)")
    zooms = f"{strips}.getOption().dataZoom.filter(z => z.xAxisIndex !== undefined).map(z => z.end - z.start)"
    page.get_by_role("button", name="box zoom").click()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.2 * canvas["width"], y + 20, steps=5)
    page.mouse.up()
    page.wait_for_function(f"() => Math.max(...{zooms}) < 50")  # the strips below as well
    page.get_by_role("button", name="reset zoom").click()
    page.wait_for_function(f"() => Math.min(...{zooms}) === 100")
    rows = list(csv.DictReader(downloaded(page, page, "save as CSV").decode().splitlines()))
    assert {row["unit"] for row in rows} == {"dps", "g", "°C"}


@pytest.mark.wide
def test_ticks_are_plain_numbers(served: Any, look: Callable[..., Any]) -> None:
    """No tick shows the digits that a division has produced."""
    page = look(f"{served.url}compare?session=charts")
    page.locator(".figure b").first.wait_for()
    words = "getModel().getComponent('%s', 0).axis.getViewLabels().map(l => l.formattedLabel)"
    for view in ("Timeline", "Table angle", "Spectrum", "Orders", "Allan"):
        page.get_by_role("button", name=view, exact=True).click()
        page.locator(f'[role=img][aria-label="{view}"] canvas').wait_for()
        for axis in ("xAxis", "yAxis"):
            told = page.evaluate(f"{CHART % '.over'}.{words % axis}")
            assert all(len(re.sub(r"[-.,]", "", text)) <= 5 for text in told), (view, told)
