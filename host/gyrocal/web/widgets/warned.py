"""Warnings at the top of the panel that they concern, with what to change and buttons that mend it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.warning import Warning, by_weight, line
from gyrocal.web.state.on_page import on_page
from gyrocal.web.worker.mend import Mend, mends

if TYPE_CHECKING:
    from gyrocal.web.state.workbench import Workbench


AFTER_IMPORT = ("drop_first", "units", "face", "sign")
"""Ways to mend that the page of an import points to."""


def show(warnings: Sequence[dict[str, Any]], bench: Workbench | None = None) -> None:
    """Show the ``warnings`` of a comparison's JSON, the blocking ones first and marked. Show nothing if there are none.

    With ``bench``, each warning has the buttons that mend it; without, what is shown is no session yet.
    """
    if not warnings:
        return
    with ui.element("section").classes("face warned").props('aria-label="warnings" tabindex=0'):
        for warning in by_weight(Warning(**w) for w in warnings):
            with ui.row().classes("tight").style("flex-wrap: nowrap; align-items: baseline"):
                ui.element("span").classes(f"light {'bad' if warning.blocking else ''}")
                ui.label(on_page(line(warning))).classes("small").style("font-weight: 600" if warning.blocking else "")
            if bench is None and any(way.kind in AFTER_IMPORT for way in mends(warning.to_json(), [])):
                ui.label("Once it is imported, Compare has a button for this.").classes("dim small").style("padding-left: 20px")
            session = None if bench is None else bench.session
            offered = [] if bench is None or session is None else mends(warning.to_json(), session.runs, bench.last_run)
            if bench is not None and offered:
                with ui.row().classes("tight").style("padding-left: 20px"):
                    for mend in offered:
                        button = ui.button(mend.label, on_click=partial(_ask, mend, bench), color=None)
                        button.props("outline dense no-caps")


def _ask(mend: Mend, bench: Workbench) -> None:
    """Say what will be written, and do it if the user confirms."""
    with ui.dialog() as dialog, ui.card():
        ui.label(f"{mend.label}?").classes("big")
        ui.label(mend.told).style("max-width: 60ch")

        async def confirm() -> None:
            dialog.close()
            await bench.mend(mend)

        with ui.row():
            sure = ui.button("Do it", on_click=confirm, color=None).props("unelevated no-caps")
            sure.classes("primary")
            ui.button("Cancel", on_click=dialog.close, color=None).props("flat no-caps")
    dialog.open()
