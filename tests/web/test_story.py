"""The whole story in a real browser: the numbers on the page are the command line's."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.cli import main
from gyrocal.digits import percentage
from gyrocal.present.output import mdps, plus_minus
from gyrocal.simulation.simulate import simulate
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.words import method

SECONDS, SCENARIOS = 20, 3


def cli(folder: Path, *arguments: str) -> Any:
    """What the command line prints, run in this process."""
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        assert main([*arguments, "--json"]) == 0
    return json.loads(out.getvalue())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("story")
    simulate(folder / "hidden", "paper", ["table_ripple"], 3, scenarios=SCENARIOS, seconds=SECONDS)
    return folder


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any], folder: Path, chromium: Any) -> Any:
    """A workbench of its own, which opens the session that its command names."""
    return serve(folder, "hidden")


def figures(page: Any) -> list[str]:
    """rms, floor and excess, as the compare panel shows them."""
    page.locator(".figure b").first.wait_for()
    return list(page.locator(".figure b").all_inner_texts())


def shown_excess(page: Any) -> list[str]:
    """The waterfall's excess after each step, from its words for those who do not see it."""
    label = page.locator('[aria-label^="excess error, mdps:"]').get_attribute("aria-label")
    return str(label).split(": ")[1].split()


CHART = "getElement(Number(document.querySelector('.nicegui-echart').id.slice(1))).chart"
POINTS = f"{CHART}.getOption().series[0].data.filter(p => p[1] !== null)"
"""Those of the first curve that the browser holds."""
MOST = f"Math.max(...{CHART}.getOption().series.map(s => s.data.filter(p => p[1] !== null).length))"
"""The number of points of the longest curve. A recording has points only in the part of a variable that it covers."""


def calibration_row(estimate: dict[str, Any], large: bool) -> list[str]:
    """An estimate of the command line as the page's table shows it. ``large`` biases of 1 dps and more are told in dps."""
    factor = 1.0 if large else 1e3
    scale, bias = (
        told.split(" ± ")
        for told in (
            plus_minus(100 * estimate["scale"], 100 * estimate["scale_se"]),
            plus_minus(factor * estimate["bias_dps"], factor * estimate["bias_se_dps"]),
        )
    )
    return [
        estimate["scenario"], method(estimate["method"]), f"2, first {estimate['seconds']:g} s", *scale, *bias,
        f"{estimate['misfit']:.2f}", "yes" if estimate["trusted"] else "no: " + ", ".join(estimate["flags"]),
    ]  # fmt: skip


def downloaded(page: Any, button: str) -> str:
    """The text that a button sends."""
    with page.expect_download() as download:
        page.get_by_role("button", name=button).click()
    return Path(download.value.path()).read_text()


@pytest.mark.slow
@pytest.mark.usefixtures("known_answers", "measured_adds")
def test_the_story(served: Any, folder: Path, look: Callable[..., Any]) -> None:
    compared = cli(folder, "compare", "hidden")
    added = cli(folder, "add", "table_ripple", "hidden", "--model", "m.toml")
    excess = mdps(compared["excess_within_dps"], 2)  # as the explained part counts with few power cycles
    before, after = (mdps(added[name]["excess_within_dps"], 2) for name in ("before", "after"))

    page = look(served.url)
    compares(page, compared)
    card = diagnoses(page, cli(folder, "diagnose", "hidden"))
    assert shown_excess(page) == [excess]
    card.get_by_role("button", name="Add to the model").click()
    page.get_by_text("The model is adequate: what is left over is noise.").wait_for()
    assert shown_excess(page) == [before, after]
    told = f"The excess error within power cycles, rms over x, y and z, went from {before} to {after} mdps."
    assert page.get_by_text(told).is_visible()
    in_all = " → ".join(mdps(added[name]["excess_dps"], 2) for name in ("before", "after"))
    floor = mdps(added["after"]["floor_dps"], 2)
    told = f"With what differs between power cycles, offset and scale: {in_all} mdps over a floor of {floor} mdps."
    assert page.get_by_text(told).is_visible()
    part = 1 - (added["after"]["excess_within_dps"] / added["before"]["excess_within_dps"]) ** 2
    assert page.get_by_text(f"{part:.1%} of its square explained").is_visible()
    page.locator('[aria-label="calibration error against seconds"]').wait_for()

    page.get_by_role("button", name="Undo").click()
    card.get_by_role("button", name="Add to the model").wait_for()
    assert shown_excess(page) == [excess]
    page.get_by_role("button", name="Redo").click()
    page.get_by_text("The model is adequate: what is left over is noise.").wait_for()
    assert shown_excess(page) == [before, after]

    calibrates(page, cli(folder, "calibrate", "hidden", "--model", "m.toml")["estimates"])
    exports(page, folder, [before, after])
    another_tab_follows(page, look(f"{served.url}diagnose", color_scheme="dark"), served.url, [before, after, before])


def compares(page: Any, compared: dict[str, Any]) -> None:
    """The first page shows the figures of ``compare`` that the bars of Diagnose show: of few power cycles those within them.

    The residual stands against the table's angle on request.
    """
    page.get_by_text("The model does not fit.").wait_for()
    told, sure = plus_minus(1e3 * compared["excess_within_dps"], 1e3 * compared["excess_within_se_dps"]).split(" ± ")
    error, floor, excess = figures(page)
    assert excess == told
    assert float(error) ** 2 - float(floor) ** 2 == pytest.approx(float(excess) ** 2, rel=0.02)
    in_all = mdps(compared["excess_dps"], 2)
    assert page.get_by_text(f"With what differs between power cycles, offset and scale: {in_all} mdps").is_visible()
    names = page.locator(".figure .nicegui-label, .figure div").all_inner_texts()
    assert [n for n in names if "," in n][:3] == ["error, mdps rms", "noise floor, mdps", f"excess ± {sure}, mdps"]
    assert page.locator(".per-axis").inner_text().startswith("excess by axis, mdps: x ")
    widths = page.locator(".cells").evaluate("""e => {
        e.style.width = "93px";
        const widths = [...e.children].map(cell => Math.round(cell.offsetWidth));
        e.style.width = "";
        return widths;
    }""")
    assert len(set(widths)) == 1  # also in the last line, which is not full
    page.get_by_role("button", name=re.compile("z, against table angle")).click()
    page.locator('[role=img][aria-label="Table angle"]').wait_for()


def diagnoses(page: Any, diagnosed: dict[str, Any]) -> Any:
    """The card of the missing effect, with the figure of ``diagnose``."""
    page.get_by_role("button", name="What is missing?").click()
    card = page.locator("article.add", has_text="Ripple of the table's speed")
    card.wait_for()
    part = f"{percentage(diagnosed['candidates'][0]['explained'])} of the squared excess error on z, within power cycles"
    assert part in card.inner_text()
    return card


def calibrates(page: Any, estimates: list[dict[str, Any]]) -> None:
    """The table shows the estimates of ``calibrate`` with the model."""
    page.get_by_role("button", name="Calibrate & export").click()
    answers = page.locator("table.plain", has_text="misfit").first.locator("tbody tr")
    answers.nth(len(estimates) - 1).wait_for()
    rows = answers.all_inner_texts()
    large = any(abs(e["bias_dps"] or 0.0) >= 1.0 for e in estimates)
    assert [row.split("\t") for row in rows] == [calibration_row(e, large) for e in estimates]


def exports(page: Any, folder: Path, excess: list[str]) -> None:
    """The model is the command line's, the report is self-contained, and the firmware gets both of its files."""
    assert downloaded(page, "Model, TOML") == (folder / "m.toml").read_text()
    report = downloaded(page, "Report, one HTML file")
    for words in (*excess, "Ripple of the table&#39;s speed", '<td class="text">no: misfit</td>'):
        assert words in report
    assert not re.search(r"""(?:src|href)=["'](?!data:|#)""", report)

    page.get_by_role("button", name="Write it").click()
    page.get_by_text("largest difference").wait_for()
    assert "table_ripple" in (folder / "firmware/include/calibration.h").read_text()
    assert (folder / "firmware/model.toml").read_text() == (folder / "m.toml").read_text()


def another_tab_follows(page: Any, other: Any, url: str, excess: list[str]) -> None:
    """Another tab sees the same model, and what one removes the other sees gone."""
    other.get_by_text("The model is adequate: what is left over is noise.").wait_for()
    assert other.evaluate("document.body.classList.contains('body--dark')")
    page.goto(f"{url}diagnose")
    page.get_by_role("button", name="remove Ripple of the table's speed").click()
    other.get_by_text("Missing: ripple of the table's speed on z.").wait_for()  # as it was found before
    assert shown_excess(other) == excess


def test_zoom_shows_single_samples(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare")
    figures(page)
    page.get_by_role("button", name="Timeline").click()
    page.locator('[role=img][aria-label="Timeline"] canvas').wait_for()
    before = page.evaluate(f"() => {POINTS}.length")
    for _ in range(5):
        page.get_by_role("button", name="zoom in").click()
    page.wait_for_function(
        f"(before) => {{ const p = {POINTS}; return p.length !== before && p.length > 400"
        " && Math.abs((p.at(-1)[0] - p[0][0]) / (p.length - 1) - 1 / 145) < 2e-4; }",
        arg=before,
    )


@pytest.mark.wide
def test_every_view_draws_on_every_axis(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare")
    figures(page)
    for axis in ("x", "y"):
        page.get_by_role("button", name=axis, exact=True).click()
        page.get_by_role("button", name=axis, exact=True, pressed=True).wait_for()
    views = page.locator(".chip:not(.axis-x):not(.axis-y):not(.axis-z)").all_inner_texts()
    assert {"Timeline", "In the run", "Temperature", "Table angle", "Reading", "Spectrum", "Orders", "Allan"} <= set(views)
    for view in views:
        page.get_by_role("button", name=view, exact=True).click()
        page.locator(f'[role=img][aria-label="{view}"] canvas').wait_for()
        # one point for each value, and one for each run
        few = view in ("Rate", "Accel. z", "Face", "Direction", "Size of the rate")
        page.wait_for_function(f"(least) => {MOST} > least", arg=0 if few else 10)


@pytest.mark.wide
def test_light_and_dark_keep_what_was_chosen(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare")
    figures(page)
    page.get_by_role("button", name="Timeline").click()
    page.get_by_role("button", name="x", exact=True).click()
    page.get_by_role("button", name="x", exact=True, pressed=True).wait_for()
    page.get_by_role("button", name="zoom in").click()
    zoomed = CHART + ".getOption().dataZoom[0]"
    page.wait_for_function(f"() => {zoomed}.start > 0")
    chosen = page.evaluate(f"() => [{zoomed}.start, {zoomed}.end]")
    page.wait_for_timeout(500)  # the server has heard of it
    page.get_by_role("button", name="light or dark").click()
    page.wait_for_function(f"() => {CHART}.getOption().title[0].textStyle.color === '{charts.DARK.dim}'")
    assert page.evaluate(f"() => [{zoomed}.start, {zoomed}.end]") == pytest.approx(chosen)
    assert page.get_by_role("button", name="x", exact=True, pressed=True).is_visible()


@pytest.mark.wide
def test_the_keyboard_is_enough(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start")
    page.get_by_role("button", name="hidden").wait_for()
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.matches('button, a') && document.activeElement.innerText.includes('hidden')"):
            break
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline == "solid"
    page.keyboard.press("Enter")
    page.get_by_text("The model does not fit.").wait_for()


@pytest.mark.wide
def test_long_work_can_be_stopped(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start")
    page.get_by_role("button", name="hidden").click()
    figures(page)
    page.get_by_role("button", name="What is missing?").click()
    page.get_by_role("status").filter(has_text=re.compile("Looking for what is missing: .+")).wait_for()
    page.get_by_role("button", name="Stop").click()
    page.get_by_text("Looking for what is missing: stopped").first.wait_for()
    find = page.get_by_role("button", name="Find what is missing")
    find.wait_for()
    find.click()
    page.get_by_role("status").filter(has_text=re.compile("Looking for what is missing: .+")).wait_for()
    page.get_by_role("button", name="Stop").click()
    page.get_by_text("Looking for what is missing: stopped").first.wait_for()


def test_an_upload_opens_and_a_bad_one_says_why(served: Any, folder: Path, look: Callable[..., Any], tmp_path: Path) -> None:
    good = shutil.make_archive(str(tmp_path / "sent"), "zip", folder / "hidden")
    (tmp_path / "bad.zip").write_bytes(b"no zip at all")
    page = look(f"{served.url}start")
    page.locator("input[type=file]").set_input_files(tmp_path / "bad.zip")
    page.get_by_text("bad.zip: cannot be unpacked").wait_for()
    page.goto(f"{served.url}start")
    page.locator("input[type=file]").set_input_files(good)
    page.locator(".session-name", has_text="sent").wait_for()
    figures(page)
    assert (folder / "sent/session.toml").is_file()
