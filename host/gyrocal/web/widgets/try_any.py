"""The list of all effects of the library, of which any can be tried; a refusal is told beside it."""

from __future__ import annotations

import asyncio

from nicegui import ui

from gyrocal.web.state.workbench import Workbench


def try_any(bench: Workbench) -> list[ui.button]:
    """Draw the list. Returns its button, which starts a fit."""
    titles: dict[str, str] = {}
    with ui.element("div").classes("face column tight").style("flex: none"):
        with ui.row().classes("tight"):
            ui.label("Try any effect:").classes("small")
            chosen = ui.select({}, label="effect", with_input=True).props("outlined dense options-dense")
            chosen.style("width: 300px")
            button = ui.button("Try it", color=None).props("outline no-caps")
        refused = ui.label().classes("worry small").props('role="status"')
        refused.set_visibility(False)

    async def attempt() -> None:
        if chosen.value is None:
            return
        reason = await bench.add(chosen.value, titles[chosen.value])
        if not refused.is_deleted:  # the model has changed
            refused.text = reason
            refused.set_visibility(bool(reason))

    async def fill() -> None:
        titles.update(await asyncio.to_thread(_titles))
        chosen.set_options(titles)

    button.on_click(attempt)
    with chosen:
        ui.timer(0, fill, once=True)
    return [button]


def _titles() -> dict[str, str]:
    """The titles of all effects that can be fitted, by id."""
    from gyrocal.effects.base import effects

    kinds = [kind for kind in effects().values() if kind.parameters and kind.role is None]
    return {kind.id: kind.title for kind in sorted(kinds, key=lambda kind: kind.title)}
