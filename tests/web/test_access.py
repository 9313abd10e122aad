"""Every page for everybody: language, headings, labels, contrast, the keyboard, reduced motion, and a phone."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate
from gyrocal.web.pictures import charts

PAGES = ("start", "import", "live", "compare", "diagnose", "calibrate")
UNNAMED = """() => [...document.querySelectorAll('input:not([type=hidden]), button, select, [role=button], [role=img]')]
    .filter(e => e.checkVisibility({visibilityProperty: true}) && !(e.innerText || "").trim() && !e.ariaLabel && !e.title
        && !(e.labels && [...e.labels].some(label => label.innerText.trim())) && !e.getAttribute("aria-labelledby"))
    .map(e => e.outerHTML.slice(0, 200))"""
UNREACHED = """() => [...document.querySelectorAll('.content *')].filter(e =>
    ['auto', 'scroll'].includes(getComputedStyle(e).overflowY) && e.scrollHeight > e.clientHeight + 1 && e.clientHeight > 0
    && e.tabIndex < 0 && !e.querySelector('button, a, input, select, [tabindex="0"]')).map(e => e.outerHTML.slice(0, 200))"""


SMALL = """() => [...document.querySelectorAll('button, summary, a, [role=button], [role=checkbox], [role=radio], input')]
    .filter(e => e.checkVisibility({visibilityProperty: true, opacityProperty: true}))
    .filter(e => !e.closest('.unseen, .skip, .q-uploader'))
    .filter(e => Math.min(e.getBoundingClientRect().width, e.getBoundingClientRect().height) < 23.5
        && !(e.closest('.q-field') && e.closest('.q-field').getBoundingClientRect().height >= 24))
    .map(e => [e.outerHTML.slice(0, 120), e.getBoundingClientRect().width, e.getBoundingClientRect().height])"""
"""What is pressed and is smaller than 24 px; a field is pressed as a whole."""


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    simulate(workbench.folder / "access", "paper", ["table_ripple"], 3, scenarios=3, seconds=8)
    return workbench


def settled(page: Any, url: str, name: str) -> None:
    """Open a page and wait until no job runs and nothing moves."""
    page.goto(f"{url}{name}?session=access")
    page.locator(".content h1").wait_for(state="attached")
    if name in ("compare", "diagnose", "calibrate"):
        page.locator(".figure b, article, table.plain td, .content button").first.wait_for()
    page.locator(".job").wait_for(state="hidden")


def axe() -> str:
    """The source of axe, from the package that ships it."""
    spec = find_spec("axe_playwright_python")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    return (Path(spec.submodule_search_locations[0]) / "axe.min.js").read_text(encoding="utf-8")


@pytest.mark.wide
@pytest.mark.parametrize("scheme", [pytest.param("light", marks=pytest.mark.wide), "dark"])
def test_pages_say_their_language_heading_and_labels_and_axe_finds_nothing(
    served: Any, look: Callable[..., Any], require_module: Callable[[str], None], scheme: str
) -> None:
    require_module("axe_playwright_python")
    page, source = look(f"{served.url}start", color_scheme=scheme), axe()
    for name in PAGES:
        settled(page, served.url, name)
        assert page.evaluate("document.documentElement.lang") == "en-US"
        assert page.locator("h1").count() == 1, name
        assert page.evaluate(UNNAMED) == [], name
        assert page.evaluate(UNREACHED) == [], name
        assert page.evaluate(SMALL) == [], name
        page.evaluate(source)
        found = page.evaluate("axe.run().then(r => r.violations.map(v => [v.id, v.nodes.map(n => n.html.slice(0, 150))]))")
        assert found == [], name


CUT = """() => [...document.querySelectorAll('.content *')].filter(e => e.checkVisibility() && e.clientWidth
        && !e.closest('.unseen, svg, .nicegui-echart, .q-uploader__input'))
    .filter(e => {
        if (e.getBoundingClientRect().right <= innerWidth + 1) return false;
        for (let p = e.parentElement; p; p = p.parentElement)
            if (['auto', 'scroll'].includes(getComputedStyle(p).overflowX)) return false;
        return true;
    }).map(e => e.outerHTML.slice(0, 120))"""
"""What reaches beyond the window and cannot be scrolled to."""
COLLIDING = """() => [...document.querySelectorAll('.nicegui-echart')].filter(e => e.checkVisibility()).flatMap(e => {
    const chart = getElement(Number(e.id.slice(1))).chart;
    const texts = chart.getZr().storage.getDisplayList(true).filter(
        d => d.type === 'tspan' && !d.invisible && /^-?[0-9.]+$/.test(d.style.text)).map(d => {
        const r = d.getBoundingRect().clone();
        if (d.transform) r.applyTransform(d.transform);
        return [d.style.text, r];
    });
    const near = (a, b) => Math.min(a.x + a.width, b.x + b.width) > Math.max(a.x, b.x) && Math.abs(a.y - b.y) < 12;
    return texts.flatMap(([one, a], i) => texts.slice(0, i).filter(([, b]) => near(a, b)).map(([other]) => [one, other]));
})"""
"""Numbers of 11 px beside an axis that stand less than a line apart."""


@pytest.mark.wide
def test_a_phone_scrolls_down_alone_cuts_nothing_off_and_its_ticks_stand_apart(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start")
    page.set_viewport_size({"width": 390, "height": 844})
    for name in PAGES:
        settled(page, served.url, name)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
        narrow = "[...document.querySelectorAll('.face')].filter(e => e.offsetWidth && e.offsetWidth < 300)"
        assert page.evaluate(f"{narrow}.map(e => e.outerHTML.slice(0, 150))") == [], name
        page.wait_for_timeout(300)
        assert page.evaluate(CUT) == [], name
        assert page.evaluate(COLLIDING) == [], name


def test_a_long_command_and_a_wide_table_stay_on_a_phone(served: Any, look: Callable[..., Any]) -> None:
    """A path has no spaces to break it at, and only some tables could be scrolled."""
    page = look(f"{served.url}start")
    page.set_viewport_size({"width": 390, "height": 844})
    settled(page, served.url, "calibrate")
    put = """() => {
        const cells = "<td>0.123456789</td>".repeat(20);
        const [pre, div] = ["pre", "div"].map(name => document.createElement(name));
        pre.className = "command";
        pre.textContent = "/a/long/path".repeat(12);
        div.innerHTML = `<table class=plain><tbody><tr>${cells}</tr></tbody></table>`;
        document.querySelector("[aria-label='files']").append(pre, div);
        return pre.scrollWidth - pre.clientWidth;
    }"""
    assert page.evaluate(put) <= 0
    assert page.evaluate(CUT) == []


def test_few_stops_of_the_tab_key_lead_to_the_plot(served: Any, look: Callable[..., Any]) -> None:
    """Each run and each view was a stop: 42 came before the plot."""
    page = look(f"{served.url}start")
    settled(page, served.url, "compare")
    page.keyboard.press("Tab")
    skip = page.get_by_role("button", name="Skip to the plot")
    assert skip.evaluate("e => e === document.activeElement && e.getBoundingClientRect().top >= 0")
    stops = 1
    while not page.evaluate("Boolean(document.activeElement.closest('.over'))"):
        page.keyboard.press("Tab")
        stops += 1
        assert stops < 16
    page.keyboard.press("Shift+Tab")
    assert page.evaluate("document.activeElement.innerText") == "x"
    page.keyboard.press("End")
    assert page.evaluate("document.activeElement.innerText") == "Allan"
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.innerText") == "Allan"  # the stop is where it was left
    skip.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.matches('.plots')")


def test_what_has_the_focus_has_one_ring(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start")
    settled(page, served.url, "diagnose")
    page.get_by_role("textbox", name="name of a new branch").focus()
    page.keyboard.press("a")
    ring = "getComputedStyle(document.activeElement).outlineStyle"
    assert page.evaluate(ring) == "none"  # its field draws one
    page.keyboard.press("Tab")
    assert page.evaluate(ring) == "solid"


@pytest.mark.wide
def test_dark_is_kept_for_the_next_visit(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start", color_scheme="light")
    dark = "document.body.classList.contains('body--dark')"
    for expected in (True, False):
        settled(page, served.url, "start")
        page.get_by_role("button", name="light or dark").click()
        page.wait_for_function(f"() => {dark} === {str(expected).lower()}")
        settled(page, served.url, "compare")
        page.wait_for_function(f"() => {dark} === {str(expected).lower()}")
    assert "gyrocal-dark" not in page.evaluate("document.cookie")  # it follows the system again


def test_reduced_motion_stands_still(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start", reduced_motion="reduce")
    page.get_by_role("button", name="Open").first.wait_for()
    moving = "[...document.querySelectorAll('*')].filter(e => /[1-9]/.test(getComputedStyle(e).transitionDuration)).length"
    assert page.evaluate(moving) == 0


@pytest.mark.wide
def test_a_choice_of_dark_outlives_an_answer_that_was_on_its_way(served: Any, look: Callable[..., Any]) -> None:
    """The page asks a new tab which mode it is in; who chose dark meanwhile got dark with light charts."""
    page = look(f"{served.url}start", color_scheme="light")
    page.add_init_script("""
        const contains = DOMTokenList.prototype.contains;
        DOMTokenList.prototype.contains = function (name) {
            if (name !== "body--dark") return contains.call(this, name);
            DOMTokenList.prototype.contains = contains;
            return new Promise(answer => setTimeout(() => { window.answered = true; answer(false); }, 3000));
        };
    """)
    page.goto(f"{served.url}compare?session=access")
    page.get_by_role("button", name="light or dark").click()
    chart = "getElement(Number(document.querySelector('.nicegui-echart').id.slice(1))).chart"
    color = f"() => {chart}.getOption().title[0].textStyle.color"
    page.wait_for_function(f"{color} === '{charts.DARK.dim}'")
    page.wait_for_function("() => window.answered")
    page.wait_for_timeout(1000)  # the server has heard of it
    assert page.evaluate(color) == charts.DARK.dim
