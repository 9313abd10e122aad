"""Several models of one session: branched, named, held side by side."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from gyrocal.present.tables import plain
from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.models import added

COLUMNS = ("model:", "adds:", "rms", "floor", "excess", "± ", "within cycles", "unit:")


def side_by_side(bench: Workbench) -> None:
    """The name of the model that is shown, the others to switch to, undo and redo, and a table of all."""
    views = bench.named_views()
    with ui.row().classes("tight").style("margin-top: 2px"):
        ui.label("Models").classes("dim small")
        for name in views:
            current = name == bench.models.current
            button = ui.button(name, on_click=partial(bench.switch, name), color=None).props("flat dense no-caps")
            button.classes(f"chip {'on' if current else ''}").props(f'aria-pressed="{str(current).lower()}"')
            if not current:
                drop = ui.button(icon="close", on_click=partial(bench.forget, name), color=None)
                drop.props(f'flat round dense size="sm" aria-label="forget the model {name}"')
        called = ui.input(placeholder="name").props('outlined dense aria-label="name of a new branch"')
        called.style("width: 90px").classes("low")
        branch = ui.button("Branch", icon="call_split", on_click=lambda: bench.branch(called.value or ""), color=None)
        branch.props("flat dense no-caps")
        ui.space()
        undo = ui.button("Undo", icon="undo", on_click=bench.undo, color=None).props("flat dense no-caps")
        undo.set_enabled(len(bench.steps) > 1)
        redo = ui.button("Redo", icon="redo", on_click=bench.redo, color=None).props("flat dense no-caps")
        redo.set_enabled(bool(bench.undone))
    if len(views) < 2:
        return
    rows = []
    for name, view in views.items():
        current = name == bench.models.current
        recipes = [step.recipe for step in bench.steps] if current else bench.models.of[name]
        figures = ["open it to see"] + [""] * 5 if view is None else [*view.rows[-1][1:], view.unit]
        rows.append([name, ", ".join(added(recipes)) or "–", *figures])
    ui.html(plain(COLUMNS, rows), sanitize=False)
    ui.label("Each as gyrocal compare gives it, over its own noise floor.").classes("dim small")
