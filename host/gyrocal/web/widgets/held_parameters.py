"""The parameters of the effects in a model: each can be held at a value by hand, or be fitted again."""

from __future__ import annotations

from nicegui import ui

from gyrocal.present.output import plus_minus
from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.models import Recipe, Step
from gyrocal.web.values.views import Holdable


def parameters(bench: Workbench) -> list[ui.button]:
    """A folded list of the parameters that can be held. Returns its buttons, each of which starts a fit."""
    if bench.step is None or not bench.step.view.holdable:
        return []
    every = bench.step.view.holdable
    held = sum(p.held for p in every)
    with ui.element("details").classes("fold"):
        with ui.element("summary"):
            ui.label(f"Parameters, {held} of {len(every)} held" if held else f"Parameters, all {len(every)} fitted")
        return [button for each in every for button in _row(bench, each)]


def _row(bench: Workbench, of: Holdable) -> list[ui.button]:
    called = f"{of.name} of {of.title.lower()} on {of.axis}"
    value = f"{of.value:.6g} {of.unit}, held" if of.held else plus_minus(of.value, of.se, of.unit)
    with ui.row().classes("tight"):
        ui.label(f"{called}: {value}").classes("small")
        ui.space()
        wanted = ui.number(value=float(f"{of.value:.6g}"), format="%.6g")
        wanted.props(f'outlined dense aria-label="value of {called}"').style("width: 120px").classes("low")

        async def hold() -> None:
            if wanted.value is not None:
                await change(bench, of, float(wanted.value))

        async def free() -> None:
            await change(bench, of, None)

        buttons = [ui.button("Hold", on_click=hold, color=None).props(f'flat dense no-caps aria-label="hold {called}"')]
        if of.held:
            buttons.append(ui.button("Free", on_click=free, color=None).props(f'flat dense no-caps aria-label="free {called}"'))
    return buttons


async def change(bench: Workbench, of: Holdable, value: float | None) -> None:
    """Hold a parameter of the model at a value, or fit it again if ``value`` is None. Undo reverts it."""
    if bench.step is None:
        return
    now = "fitted again" if value is None else f"held at {value:g} {of.unit}"
    what = f"{of.name} of {of.title.lower()} on {of.axis} {now}"
    asked = (bench.step.source, of.effect, of.axis, of.name, value)
    view = await bench.ask(f"Fitting with {what}", "hold", bench.recording, *asked)
    if view is not None:
        doubts = next((s.recipe.doubts for s in reversed(bench.steps) if s.effect == of.effect), ())
        await bench.take(Step(Recipe(view.toml, of.effect, of.title, doubts=doubts, held=what), view))
