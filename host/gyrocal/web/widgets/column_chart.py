"""The chart of a recording's columns, with its buttons."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nicegui import ui

from gyrocal.web.pictures import charts, recorded
from gyrocal.web.widgets.tools import named, tools

if TYPE_CHECKING:
    from gyrocal.web.page import Tab
    from gyrocal.web.pictures.recorded import Recorded


def strips(tab: Tab, shown: Recorded, words: str) -> Callable[[], None]:
    """Draw the columns under a heading. The returned function draws them in the colours of the page."""
    with ui.row().classes("tight"):
        ui.html(f"<h2>{words}</h2>", sanitize=False)
        bar = ui.element("div").classes("tools")
    with ui.element("div").style(f"height: {shown.height_px}px; width: 100%"):
        chart = ui.echart(recorded.options(tab.palette, shown)).classes("chart")
        chart.props(f'role="img" aria-label="{words}"')
    with bar:
        tools(chart, lambda: named(tab.bench, "recording"))

    def draw() -> None:
        options = recorded.options(tab.palette, shown)
        chart.options.update(options)
        chart.run_chart_method(":setOption", charts.script(options), "({notMerge: true})")

    return draw
