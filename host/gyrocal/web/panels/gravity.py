"""A session by gravity: its rests, the comparison by angle, scale and bias, and what is missing."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nicegui import ui

from gyrocal.digits import UNKNOWN, percent
from gyrocal.present.tables import number, plain
from gyrocal.present.verdict import stands_on
from gyrocal.units import unit_of
from gyrocal.web.pictures.words import unseen
from gyrocal.web.state.on_page import on_page
from gyrocal.web.state.workbench import Topic
from gyrocal.web.widgets import warned
from gyrocal.web.widgets.column_chart import strips
from gyrocal.web.worker.by_gravity import GravityView

if TYPE_CHECKING:
    from gyrocal.web.page import Tab

ESTIMATES = ("axis:", "scale, %", "±", "bias, {}", "± ", "misfit", "trusted:")
"""With the bias's unit to be put in."""
ANGLES = ("turned by accelerometer, deg", "by gyroscope with model, deg", "angle between both, deg")
"""How far each movement turned gravity, and how far apart both find it at the end, which also counts errors across the turn."""


def show(tab: Tab) -> Callable[[Topic], None]:
    view = tab.bench.gravity
    assert view is not None
    with ui.element("div").classes("column"):
        warned.show(view.compared["warnings"])
        _verdict(view)
        with ui.element("section").classes("face"):
            drawn = strips(tab, view.recorded, "The readings; rests are shaded")
        with ui.element("div").classes("two importing"):
            with ui.element("div").classes("column"):
                _levels(view)
                _missing(tab, view)
                _estimates(view)
                _budgets(view)
            with ui.element("div").classes("column"):
                _listed("Rests", ("file:", "from, s", "length, s", "acceleration x, y, z, g"), view.rests)
                columns = ("file:", "until, s", "mainly about:", *ANGLES)
                _listed("Movements between them", columns, view.movements)
    return lambda topic: drawn() if topic == "scheme" else None


def _verdict(view: GravityView) -> None:
    compared = view.compared
    tone = "good" if compared["verdict"] == "adequate" else "bad"
    with ui.element("section").classes(f"face verdict {tone}").props('aria-label="verdict"'):
        with ui.element("div"):
            ui.label(view.headline).classes("big")
            counted = f"{compared['movements']} movements between {compared['rests']} rests are compared by angle"
            ui.label(f"The reference is gravity: {counted}. {unseen(compared['held_out'])}").classes("dim")
            if why := stands_on(compared):
                ui.label(why).classes("dim small")
        with ui.element("div").classes("figures"):
            *values, error = view.rows[-1][1:]
            sure = "" if error == UNKNOWN else f" ± {error}"
            for name, value, told in zip(("rms", "floor", "excess"), values, ("rms", "floor", f"excess{sure}"), strict=True):
                with ui.element("div").classes(f"figure {name}"):
                    ui.html(f"<b>{value}</b>", sanitize=False)
                    ui.label(f"{told}, deg")


def _levels(view: GravityView) -> None:
    with ui.element("section").classes("face column tight"):
        title = "Angle between gravity as the gyroscope turned it and as the accelerometer shows it, on unseen data, deg"
        ui.html(f"<h2>{title}</h2>", sanitize=False)
        ui.html(plain(("turned:", "rms", "floor", "excess", "±"), view.rows), sanitize=False).classes("sideways")
        where = [[f["axis"], f["against"].replace("_", " "), f"{f['strength']:.1f}", f["note"]] for f in view.compared["where"]]
        if where:
            ui.html(plain(("axis:", "against:", "strength, σ", "what:"), where), sanitize=False).classes("sideways")


def _missing(tab: Tab, view: GravityView) -> None:
    with ui.element("section").classes("face column tight").props('aria-label="what is missing"'):
        ui.html("<h2>What is missing</h2>", sanitize=False)
        place = ui.element("div")

        async def look() -> None:
            found = await tab.bench.ask("Looking for what is missing", "missing_by_gravity", view.path)
            if found is None:
                return
            place.clear()
            with place:
                ui.label(found[0]).props('role="status"')
                if found[1]:
                    ui.html(plain(("effect:", "axis:", "decision:", "size:"), found[1]), sanitize=False).classes("sideways")
                name = tab.bench.places.name(view.path)
                ui.label(f"To add an effect: gyrocal add EFFECT {name} --model model.toml").classes("dim small")

        with place:
            find = ui.button("Find what is missing", icon="search", on_click=look, color=None)
            find.props("unelevated no-caps").classes("primary")


def _estimates(view: GravityView) -> None:
    unit = unit_of(e["bias_dps"] for e in view.estimates)
    rows = [
        [
            e["axis"], *percent(e["scale"], e["scale_se"]), *unit.pair(e["bias_dps"], e["bias_se_dps"]),
            number(e["misfit"], ".2f"),
            "yes" if e["trusted"] else "no: " + ", ".join(e["flags"]),
        ]
        for e in view.estimates
    ]  # fmt: skip
    with ui.element("section").classes("face column tight"):
        ui.html("<h2>Scale and bias, fitted together with the misalignment of the axes</h2>", sanitize=False)
        columns = [name.format(unit.name) for name in ESTIMATES]
        ui.html(plain(columns, rows, [not e["trusted"] for e in view.estimates]), sanitize=False).classes("sideways")


def _budgets(view: GravityView) -> None:
    with ui.element("section").classes("face column tight").props('aria-label="error budget"'):
        ui.html("<h2>Where the error comes from</h2>", sanitize=False)
        for budget in view.budgets:
            ui.label(budget.of).classes("dim small")
            ui.html(on_page(budget.table()), sanitize=False).classes("sideways")


def _listed(title: str, columns: tuple[str, ...], rows: list[list[str]]) -> None:
    with ui.element("section").classes("face column tight"):
        ui.html(f"<h2>{title} ({len(rows)})</h2>", sanitize=False)
        with ui.element("div").classes("scroll sideways long").props(f'role="region" aria-label="{title}" tabindex="0"'):
            ui.html(plain(columns, rows), sanitize=False)
