"""The buttons of a chart: box zoom, reset, and what it shows as CSV and as PNG. Every chart has the same ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.web.widgets import export

if TYPE_CHECKING:
    from gyrocal.web.state.workbench import Workbench


def tool(icon: str, word: str) -> ui.button:
    """A small round button that says what it does."""
    return ui.button(icon=icon, color=None).props(f'flat round dense size="sm" aria-label="{word}"').tooltip(word)


def tools(
    chart: ui.echart, name: Callable[[], str], csv: Callable[[], str] | None = None, reset: Callable[[], Any] | None = None
) -> None:  # fmt: skip
    """Lay out the buttons of ``chart``. ``name`` gives the name of the saved files without its ending.

    ``csv`` gives the text of the table, by default that of the chart's options; ``reset`` replaces the browser's own reset.
    """
    text = csv or (lambda: export.as_csv(chart.options))
    tool("crop_free", "box zoom").on("click", js_handler=export.BOX % chart.id)
    again = tool("restart_alt", "reset zoom")
    if reset is None:
        again.on("click", js_handler=export.RESET % chart.id)
    else:
        again.on("click", reset)
    tool("table_view", "save as CSV").on("click", lambda: ui.download.content(text(), f"{name()}.csv", "text/csv"))
    tool("image", "save as PNG").on(
        "click", lambda: ui.run_javascript(f"({export.PNG % (chart.id, json.dumps(name() + '.png'))})()")
    )


def named(bench: Workbench, what: str) -> str:
    """The name of a file that shows ``what`` of the session that is open."""
    opened = bench.session or bench.gravity
    return f"{'gyrocal' if opened is None else opened.path.name}_{what}"
