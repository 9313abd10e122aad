"""Warnings at the top of the panel that they concern."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nicegui import ui

from gyrocal.warning import Warning, by_weight, line


def show(warnings: Sequence[dict[str, Any]]) -> None:
    """Show the ``warnings`` of a comparison's JSON, the blocking ones first and marked. Show nothing if there are none."""
    if not warnings:
        return
    with ui.element("section").classes("face").props('aria-label="warnings"').style("flex: none"):
        for warning in by_weight(Warning(**w) for w in warnings):
            with ui.row().classes("tight").style("flex-wrap: nowrap; align-items: baseline"):
                ui.element("span").classes(f"light {'bad' if warning.blocking else ''}")
                ui.label(line(warning)).classes("small").style("font-weight: 600" if warning.blocking else "")
