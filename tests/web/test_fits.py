"""Tables and legends fit: a row of answers is one line on a small screen, and a phone shows every name of a legend."""

from collections.abc import Callable
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate

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
CHART = "[aria-label='calibration error against seconds']"


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory, chromium: Any) -> Any:
    folder = tmp_path_factory.mktemp("fits")
    simulate(folder / "ripple", "paper", ["table_ripple"], 3, scenarios=3, seconds=20)
    return serve(folder)


def test_an_answer_is_one_line_of_its_table(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}calibrate?session=ripple")
    rows = page.locator(".answers tbody tr")
    rows.first.wait_for()
    assert page.locator(".answers").evaluate("e => e.scrollWidth <= e.clientWidth")
    heights = rows.evaluate_all("all => all.map(row => row.getBoundingClientRect().height)")
    assert len(heights) == 27
    assert max(heights) < 30
    head = page.locator(".answers thead tr").inner_text().split("\t")
    assert "axis" not in [name.strip() for name in head]  # it stands above the table


def test_a_phone_shows_every_name_of_the_calibration_error(served: Any, look: Callable[..., Any]) -> None:
    """Four names scrolled in one line, and the last could be read only by pressing an arrow."""
    page = look(f"{served.url}diagnose?session=ripple")
    page.get_by_role("button", name="Find what is missing").click()
    page.get_by_role("button", name="Add to the model").first.click()
    page.set_viewport_size({"width": 390, "height": 844})
    chart = page.locator(CHART)
    chart.wait_for()
    page.get_by_text("in the model now").first.wait_for()
    page.locator(".job").wait_for(state="hidden")
    look_up = f"(() => getElement(document.querySelector({CHART!r}).id.slice(1)).chart)()"
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
