"""Random use leaves no error: none in the browser's console, which ``look`` watches, and none in the server (``serve``).

`python benchmarks/monkey.py` does the same for longer.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate
from gyrocal.web.panels.compare import ZOOM
from gyrocal.web.widgets.effect_view import COPY
from gyrocal.web.widgets.export import BOX, PNG

from .monkey import play

ACTS, SEED = 40, 7
COSTLY = "Train it|Write it|Simulate and look|Surprise me|Another one"


@pytest.mark.wide
def test_random_use_leaves_no_error(serve: Callable[..., Any], look: Callable[..., Any], tmp_path: Path) -> None:
    simulate(tmp_path / "s", "paper", ["table_ripple"], 3, scenarios=3, seconds=8)
    served = serve(tmp_path, "s")
    page = look(served.url, reduced_motion="no-preference")
    page.locator(".figure b").first.wait_for()
    play(page, served.url, SEED, ACTS, COSTLY)
    assert served.process.poll() is None


@pytest.mark.wide
def test_a_chart_that_is_not_yet_made_leaves_no_error(serve: Callable[..., Any], chromium: Any, tmp_path: Path) -> None:
    """It can be removed from the moment that the page stands, and its buttons pressed, before the server says anything."""
    served = serve(tmp_path)
    context = chromium.new_context()
    context.add_init_script("window.WebSocket = undefined")
    context.route("**/socket.io/**", lambda route: route.abort())
    page = context.new_page()
    page.goto(f"{served.url}diagnose")
    page.locator("header").wait_for()
    chart = next(a for a in re.findall(r'import\("([^"]+)"\)', page.content()) if a.endswith("echart.js"))
    remove = f"import({chart!r}).then(({{default: chart}}) => chart.beforeUnmount.call({{}}) ?? 'removed')"
    assert page.evaluate(remove) == "removed"
    for press in (PNG % (0, "name"), BOX % 0, COPY % 0, ZOOM % (0, 0.25, -0.25)):  # no chart has this number
        page.evaluate(press)
    context.close()
