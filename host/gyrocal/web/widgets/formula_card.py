"""The card of a misfit that no effect of the library explains: a formula is searched for it, or written by hand."""

from __future__ import annotations

import html

from nicegui import ui

from gyrocal.variables.base import symbols, variables
from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.views import DiagnosisView


def formula_card(bench: Workbench, found: DiagnosisView) -> list[ui.button]:
    """Draw the card. Returns its buttons, each of which starts a fit."""
    u = found.unknown
    assert u is not None

    async def attempt() -> None:
        text = (written.value or "").strip()
        if text:
            reason = await bench.add(text, text.partition(":")[0].strip() if ":" in text else "formula", text)
            if not refused.is_deleted:  # the model has changed
                refused.text = reason

    with ui.element("article").classes("card add"):
        with ui.element("div").classes("head"):
            ui.html("<h2>A misfit that no effect of the library explains</h2>", sanitize=False)
            ui.label(f"on {u['axis']}").classes(f"axis-{u['axis']}")
        with ui.element("dl").classes("evidence").style("margin: 0"):
            for name, text in (("it shows against", variables()[u["against"]].quantity), ("shape", u["shape"])):
                ui.html(f"<dt>{name}</dt>", sanitize=False)
                ui.html(f"<dd>{html.escape(text)}</dd>", sanitize=False)
        with ui.row().classes("tight"):
            called = ui.input("name", value="custom").props("outlined dense").style("width: 130px")
            keep = ui.button(
                "Find a formula and keep it", icon="functions", on_click=lambda: bench.keep(called.value), color=None
            )
            keep.props("unelevated no-caps").classes("primary")
        ui.label("or, if you can guess its form, write it down:").classes("small dim")
        with ui.row().classes("tight").style("width: 100%; flex-wrap: nowrap"):
            written = ui.input(placeholder="mine: k*rate**2").props('outlined dense aria-label="formula"').classes("grow")
            own = ui.button("Try and add", on_click=attempt, color=None).props("outline no-caps")
        refused = ui.label().classes("worry small").props('role="status"')
        names = "; ".join(f"{name}: {symbol.meaning}" for name, symbol in symbols().items())
        ui.label(f"Names: {names}. The result is in dps. Any other name is a parameter to be fitted.").classes("small dim")
    return [keep, own]
