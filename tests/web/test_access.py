"""Every page for everybody: language, headings, labels, contrast, the keyboard, reduced motion, and a phone."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate

PAGES = ("start", "import", "live", "compare", "diagnose", "calibrate")
UNNAMED = """() => [...document.querySelectorAll('input:not([type=hidden]), button, select, [role=button], [role=img]')]
    .filter(e => e.checkVisibility({visibilityProperty: true}) && !(e.innerText || "").trim() && !e.ariaLabel && !e.title
        && !(e.labels && [...e.labels].some(label => label.innerText.trim())) && !e.getAttribute("aria-labelledby"))
    .map(e => e.outerHTML.slice(0, 200))"""
UNREACHED = """() => [...document.querySelectorAll('.content *')].filter(e =>
    ['auto', 'scroll'].includes(getComputedStyle(e).overflowY) && e.scrollHeight > e.clientHeight + 1 && e.clientHeight > 0
    && e.tabIndex < 0 && !e.querySelector('button, a, input, select, [tabindex="0"]')).map(e => e.outerHTML.slice(0, 200))"""


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any], chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("access")
    simulate(folder / "s", "paper", ["table_ripple"], 3, scenarios=3, seconds=8)
    return serve(folder, "s")


def settled(page: Any, url: str, name: str) -> None:
    """Open a page and wait until no job runs and nothing moves."""
    page.goto(f"{url}{name}")
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


def test_pages_say_their_language_heading_and_labels(served: Any, look: Callable[..., Any]) -> None:
    page = look(served.url)
    for name in PAGES:
        settled(page, served.url, name)
        assert page.evaluate("document.documentElement.lang") == "en-US"
        assert page.locator("h1").count() == 1, name
        assert page.evaluate(UNNAMED) == [], name
        assert page.evaluate(UNREACHED) == [], name


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(served: Any, look: Callable[..., Any], require_module: Callable[[str], None], scheme: str) -> None:
    require_module("axe_playwright_python")
    page, source = look(served.url, color_scheme=scheme), axe()
    for name in PAGES:
        settled(page, served.url, name)
        page.evaluate(source)
        found = page.evaluate("axe.run().then(r => r.violations.map(v => [v.id, v.nodes.map(n => n.html.slice(0, 150))]))")
        assert found == [], name


def test_a_phone_needs_no_sideways_scrolling(served: Any, look: Callable[..., Any]) -> None:
    page = look(served.url)
    page.set_viewport_size({"width": 390, "height": 844})
    for name in PAGES:
        settled(page, served.url, name)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
        narrow = "[...document.querySelectorAll('.face')].filter(e => e.offsetWidth && e.offsetWidth < 300)"
        assert page.evaluate(f"{narrow}.map(e => e.outerHTML.slice(0, 150))") == [], name


def test_reduced_motion_stands_still(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}start", reduced_motion="reduce")
    page.get_by_role("button", name="Open").first.wait_for()
    moving = "[...document.querySelectorAll('*')].filter(e => /[1-9]/.test(getComputedStyle(e).transitionDuration)).length"
    assert page.evaluate(moving) == 0
