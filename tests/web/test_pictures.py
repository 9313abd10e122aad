"""Pictures and choices in a real browser: what a chip opens, what Add does to the picture, what a restart keeps."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate
from gyrocal.web.pictures.charts import DARK, ICONS

CHART = "getElement(Number(document.querySelector('%s .nicegui-echart').id.slice(1))).chart"
PLOT, HERO = CHART % ".over:not(.hero-picture)", CHART % ".hero-picture"


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    simulate(workbench.folder / "ripple", "paper", ["table_ripple"], 3, scenarios=2, seconds=15.0)
    simulate(workbench.folder / "tone", "paper", ["vibration_tone:f_hz=11.83,A_dps=0.05"], 3, scenarios=2, seconds=10.0)
    return workbench


def downloaded(page: Any, name: str) -> bytes:
    with page.expect_download() as download:
        page.get_by_role("button", name=name).click()
    return Path(download.value.path()).read_bytes()


@pytest.mark.wide
def test_a_chip_opens_the_picture_at_its_place(served: Any, look: Callable[..., Any]) -> None:
    """The address opens the session; the chip of a tone opens the spectrum about the tone, with the tone marked."""
    page = look(f"{served.url}compare?session=tone")
    page.locator(".finding", has_text="11.8").first.click()
    page.locator('[role=img][aria-label="Spectrum"]').wait_for()
    page.wait_for_function(f"() => {PLOT}.getOption().series[0].markLine?.data?.length === 1")
    shown = page.evaluate(f"{PLOT}.getOption().dataZoom[0]")
    assert shown["startValue"] < 11.83 < shown["endValue"] < 100
    assert page.evaluate(f"{PLOT}.getOption().series[0].markLine.data[0].xAxis") == pytest.approx(11.83, abs=0.1)
    ticks = page.evaluate(f"[{PLOT}.getOption().xAxis[0].min, {PLOT}.getOption().xAxis[0].max]")
    assert ticks == [0.1, 100]  # plain numbers, from one period in ten seconds on
    page.get_by_role("button", name="reset zoom").click()
    page.wait_for_function(f"() => {PLOT}.getOption().dataZoom[0].start === 0")


@pytest.mark.wide
def test_values_box_zoom_and_files_of_a_plot(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=tone")
    page.locator(".finding").first.wait_for()
    page.locator('[role=img][aria-label="Timeline"] canvas').wait_for()
    box = page.locator('[role=img][aria-label="Timeline"]').bounding_box()
    x, y = box["x"] + 0.4 * box["width"], box["y"] + 0.3 * box["height"]
    page.mouse.move(x, y)
    page.wait_for_function("() => /left over.*mdps/s.test(document.querySelector('.over').innerText)")
    told = page.locator(".over").inner_text()
    assert re.search(r"z measured -?[\d.]+ dps", told)
    assert re.search(r"^[\d.]+ s$", told, re.M)
    page.get_by_role("button", name="box zoom").click()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.1 * box["width"], y + 20, steps=5)
    page.mouse.up()
    page.wait_for_function(f"() => {{ const z = {PLOT}.getOption().dataZoom[0]; return z.end - z.start < 30; }}")
    rows = list(csv.DictReader(downloaded(page, "save as CSV").decode().splitlines()))
    assert {row["series"] for row in rows} == {"z measured", "z model", "z left over"}
    assert max(float(row["x"]) for row in rows) < 30.0
    assert downloaded(page, "save as PNG").startswith(b"\x89PNG")


COPIED = """async () => {
    const chart = %s, lines = [0, 1, 2].map(k => 2 * (4 + 17 * k));
    const blob = await (await navigator.clipboard.read())[0].getType("image/png");
    const ink = async picture => {
        const image = await createImageBitmap(picture), canvas = new OffscreenCanvas(image.width, image.height);
        const context = canvas.getContext("2d", {willReadFrequently: true});
        context.drawImage(image, 0, 0);
        const pixels = y => context.getImageData(0, y, image.width, 28).data;
        return lines.map(y => pixels(y).filter((v, i) => i %% 4 === 0 && v < 160).length);
    };
    const copied = await ink(blob), titles = chart.getOption().title;
    chart.setOption({title: titles.map(() => ({show: false}))});
    const bytes = atob(chart.getDataURL({pixelRatio: 2, backgroundColor: "#fff"}).split(",")[1]);
    return [copied, await ink(new Blob([Uint8Array.from(bytes, c => c.charCodeAt(0))], {type: "image/png"}))];
}"""
"""The number of dark pixels in each line of the words, of the picture in the clipboard and of the chart without its words."""


@pytest.mark.slow
def test_add_flattens_the_picture_and_it_can_be_copied(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}diagnose?session=ripple", permissions=["clipboard-read", "clipboard-write"])
    page.get_by_role("button", name="Find what is missing").click()
    card = page.locator("article.add", has_text="Ripple of the table's speed")
    card.wait_for()
    points = f"{HERO}.getOption().series[1].data.map(p => p[1])"
    page.wait_for_function(f"() => {HERO}.getOption().series.length >= 3")
    before = page.evaluate(points)
    assert max(before) - min(before) > 150  # mdps, of the planted 124
    card.get_by_role("button", name="Add to the model").click()
    page.get_by_text("The model is adequate: what is left over is noise.").wait_for()
    page.wait_for_function(f"() => Math.max(...{points}.map(Math.abs)) < 40")
    assert len(page.evaluate(points)) == len(before)
    heading = page.evaluate(f"{HERO}.getOption().title.map(t => t.text)")
    assert heading[0] == "Ripple of the table's speed on z, in the model now"
    assert "LSM6DSO" in heading[1]
    assert "amplitude_k" in heading[1]
    assert re.search(r"excess error within power cycles \d+\.\d\d → \d+\.\d\d mdps rms", heading[2])
    page.get_by_role("button", name="Copy as image").click()
    page.get_by_text("The picture is in the clipboard.").wait_for()
    assert "→" in heading[2]
    drawn, plain = page.evaluate(COPIED % HERO)
    assert min(drawn) > 200  # ink in the line of each of the three
    assert max(plain) < 10


NAMES = ["plain average", "network", "model at first", "model now"]
TEXTS = """chart => {
    const drawn = chart.getZr().storage.getDisplayList().filter(e => e.style && e.style.text && !e.ignore && !e.invisible);
    return drawn.map(e => {
        const box = e.getBoundingRect().clone(), moved = e.getComputedTransform();
        if (moved) box.applyTransform(moved);
        const clip = e.getClipPath && e.getClipPath() || (e.__clipPaths || [])[0];
        return {text: e.style.text, left: box.x, right: box.x + box.width, top: box.y, bottom: box.y + box.height, cut: !!clip};
    });
}"""
ERRORS = "[aria-label='calibration error against seconds']"


def test_a_phone_shows_every_name_of_the_calibration_error(served: Any, look: Callable[..., Any]) -> None:
    """Four names scrolled in one line, and the last could be read only by pressing an arrow."""
    page = look(f"{served.url}diagnose?session=ripple")
    page.set_viewport_size({"width": 390, "height": 844})
    chart = page.locator(ERRORS)
    chart.wait_for()
    page.get_by_text("in the model now").first.wait_for()
    page.locator(".job").wait_for(state="hidden")
    look_up = f"(() => getElement(document.querySelector({ERRORS!r}).id.slice(1)).chart)()"
    page.wait_for_function(f"({TEXTS})({look_up}).some(e => e.text === 'model now')")
    page.wait_for_function(f"{look_up}.getWidth() < 390")
    page.wait_for_timeout(500)
    drawn = page.evaluate(f"({TEXTS})({look_up})")
    width = page.evaluate(f"{look_up}.getWidth()")
    names = [e for e in drawn if e["text"] in NAMES]
    assert sorted(e["text"] for e in names) == sorted(NAMES)
    for name in names:
        assert name["left"] >= 0
        assert name["right"] <= width
        assert not name["cut"]
    others = [e for e in drawn if e["text"] not in NAMES]
    assert all(max(e["bottom"] for e in names) <= e["top"] + 2 for e in others), drawn


@pytest.mark.parametrize(("wanted", "moves"), [("no-preference", True), ("reduce", False)])
def test_without_motion_nothing_moves(served: Any, look: Callable[..., Any], wanted: str, moves: bool) -> None:
    page = look(f"{served.url}diagnose?session=ripple", reduced_motion=wanted)
    page.wait_for_function(f"() => {HERO}.getOption().series.length >= 3")
    assert page.evaluate(f"{HERO}.getOption().animation") is moves


def test_in_the_dark_the_picture_is_drawn_too(served: Any, look: Callable[..., Any]) -> None:
    """The page is built in light and again in dark, before the browser has made the first chart."""
    page = look(f"{served.url}diagnose?session=ripple", color_scheme="dark")
    page.wait_for_function("() => document.body.classList.contains('body--dark')")
    drawn = f"const o = {HERO}.getOption(); return o.series.length >= 3 && o.textStyle.color === '{DARK.ink}';"
    page.wait_for_function(f"() => {{ try {{ {drawn} }} catch {{ return false; }} }}")  # the first chart goes meanwhile


def test_on_a_phone_nothing_lies_over_another(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}diagnose?session=ripple")
    page.set_viewport_size({"width": 390, "height": 844})
    page.locator(".drawn:not(.hero-picture) canvas").first.wait_for()
    beyond = """[...document.querySelectorAll('.drawn canvas')].filter(
        c => c.getBoundingClientRect().bottom > c.closest('.drawn').getBoundingClientRect().bottom).length"""
    assert page.evaluate(beyond) == 0
    page.get_by_role("button", name="Compare").click()
    page.locator('[role=img][aria-label="Timeline"] canvas').wait_for()
    buttons = page.locator(".over .zoom").bounding_box()
    drawn = page.locator('[role=img][aria-label="Timeline"] canvas').bounding_box()
    assert buttons["y"] + buttons["height"] <= drawn["y"] + 8  # where the title begins
    page.wait_for_function(f"() => {PLOT}.getOption().legend[0].top > 20")
    assert page.evaluate(f"{PLOT}.getOption().legend[0].top") < page.evaluate(f"{PLOT}.getOption().grid[0].top")


def test_a_legend_looks_as_what_it_names(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}diagnose?session=ripple")
    page.wait_for_function(f"() => {HERO}.getOption().series.length >= 3")
    icons = page.evaluate(f"Object.fromEntries({HERO}.getOption().legend[0].data.map(e => [e.name, e.icon]))")
    for series in page.evaluate(f"{HERO}.getOption().series.map(s => [s.name, s.type])"):
        shape = {"scatter": "circle", "line": ICONS["thick"], "custom": "roundRect"}[series[1]]
        assert icons[series[0]] == shape


def leaves_a_run_out_by_keyboard(page: Any) -> None:
    """Arrows, Space and Enter on the strip: each press fits again, and the focus stays on the run."""
    focused = "document.activeElement.ariaLabel ?? ''"
    page.locator(".per-axis").wait_for()
    page.get_by_role("button", name=re.compile(r"^000_up\.csv")).focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate(focused).startswith("001_down.csv")
    figures = page.locator(".figure b").all_inner_texts()
    page.keyboard.press("Space")
    page.get_by_role("button", name=re.compile(r"^001_down\.csv.*left out"), pressed=True).wait_for()
    page.wait_for_function(
        "old => { const b = [...document.querySelectorAll('.figure b')].map(e => e.innerText);"
        " return b.length === 3 && b.join() !== old; }", arg=",".join(figures),
    )  # fmt: skip
    page.wait_for_function(f"() => ({focused}).startsWith('001_down.csv')")
    page.keyboard.press("Enter")  # in again
    page.wait_for_function(
        "old => [...document.querySelectorAll('.figure b')].map(e => e.innerText).join() === old", arg=",".join(figures)
    )
    page.wait_for_function(f"() => ({focused}).startsWith('001_down.csv')")
    page.keyboard.press("Home")
    assert page.evaluate(focused).startswith("000_up.csv")
    page.keyboard.press("Enter")
    page.get_by_role("button", name=re.compile(r"^000_up\.csv.*left out"), pressed=True).wait_for()
    page.get_by_text("1 left out").wait_for()
    page.get_by_role("status").wait_for(state="hidden")


@pytest.mark.wide
def test_the_address_holds_session_and_page(served: Any, look: Callable[..., Any]) -> None:
    """It follows what is shown; a reload and another tab with the same address show the same."""
    page = look(f"{served.url}compare?session=tone")
    page.locator(".session-name", has_text="tone").wait_for()
    page.get_by_role("button", name="Calibrate & export").click()
    page.wait_for_url("**/calibrate?session=tone")
    for again in (page, look(f"{served.url}start")):
        again.goto(page.url)  # of a page that is already there: a reload
        again.locator("nav button[aria-current=page]", has_text="Calibrate & export").wait_for()
        again.locator(".session-name", has_text="tone").wait_for()
        again.locator("section[aria-label='scale and bias'] .nicegui-echart").wait_for()
    page.get_by_role("button", name="Open…").click()
    page.get_by_role("button", name="ripple").click()
    page.wait_for_url("**/compare?session=ripple")


@pytest.mark.wide
def test_a_wrong_effect_stays_in_doubt_and_a_run_stays_out_after_a_restart(
    serve: Callable[..., Any], served: Any, look: Callable[..., Any]
) -> None:
    """A drift is tried where a ripple is; it is marked as unproven, now, in another model and after a restart."""
    simulate(served.folder / "short", "paper", ["table_ripple"], 3, scenarios=2, seconds=5.0)
    page = look(f"{served.url}diagnose?session=short")
    page.get_by_role("textbox", name="name of a new branch").fill("by hand")
    page.get_by_role("button", name="Branch").click()
    page.get_by_role("button", name="by hand", pressed=True).wait_for()
    page.get_by_role("combobox", name="effect").click()
    page.get_by_role("option").first.wait_for()
    page.get_by_role("option", name="Drift", exact=False).first.click()
    page.get_by_role("button", name="Try it").click()
    page.locator(".badge.bad", has_text="not proven").first.wait_for()
    by_hand = page.locator("article.card", has_text="In doubt: it was chosen by hand")
    assert re.search(r"on [xyz]\b", by_hand.locator(".head").inner_text())
    assert re.search(r"excess error went from [\d.]+ to [\d.]+ mdps", by_hand.inner_text())
    table = page.locator("table.plain tbody tr")
    assert [row.split("\t")[0] for row in table.all_inner_texts()] == ["first", "by hand"]
    assert all(re.search(r"\t[\d.]+\t", row) for row in table.all_inner_texts())  # each with its figures
    page.get_by_role("button", name="first", exact=True).click()
    page.get_by_role("button", name="first", exact=True, pressed=True).wait_for()
    page.get_by_role("button", name="remove Drift").wait_for(state="hidden")  # the other model never had it
    page.get_by_role("button", name="by hand", exact=True).click()
    page.locator(".badge.bad", has_text="not proven").first.wait_for()
    page.get_by_role("button", name="Compare").click()
    leaves_a_run_out_by_keyboard(page)
    kept = json.loads((served.folder / "short/workbench.json").read_text())
    assert kept["excluded"] == ["000_up.csv"]
    assert kept["current"] == "by hand"
    again = look(f"{serve(served.folder).url}diagnose?session=short")
    again.locator(".badge.bad", has_text="not proven").first.wait_for()
    again.get_by_role("button", name="by hand", pressed=True).wait_for()
    again.get_by_role("button", name="Compare").click()
    again.get_by_text("1 left out").wait_for()
