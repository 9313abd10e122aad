"""Tables and legends fit: a row of answers is one line on a small screen, and a phone shows every name of a legend."""

from collections.abc import Callable
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    simulate(workbench.folder / "fits", "paper", ["table_ripple"], 3, scenarios=3, seconds=8)
    return workbench


@pytest.mark.wide
def test_an_answer_is_one_line_of_its_table(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}calibrate?session=fits")
    rows = page.locator(".answers tbody tr")
    rows.first.wait_for()
    assert page.locator(".answers").evaluate("e => e.scrollWidth <= e.clientWidth")
    heights = rows.evaluate_all("all => all.map(row => row.getBoundingClientRect().height)")
    assert len(heights) == 27
    assert max(heights) < 30
    head = page.locator(".answers thead tr").inner_text().split("\t")
    assert "axis" not in [name.strip() for name in head]  # it stands above the table
