"""Measured against modelled, and what is left over against whatever it may depend on."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from gyrocal.variables.frequency import Frequency
from gyrocal.web import charts, plots, warned
from gyrocal.web.against import opened_by, panels
from gyrocal.web.chips import chip, press
from gyrocal.web.state import Topic
from gyrocal.web.traces import Traces
from gyrocal.web.views import AXES, RunView

if TYPE_CHECKING:
    from gyrocal.web.page import Tab

PANELS = {panel.name: panel for panel in panels()}
VIEWS = {
    "timeline": ("Timeline", "recordings one after another, s"),
    **{name: (panel.title, panel.label) for name, panel in PANELS.items()},
    Frequency.name: (Frequency.title, Frequency.label()),
    "averaging": ("Allan", "averaging time, s"),
}
"""The text of the button of every plot, and the label of its horizontal axis."""
ALL = (0.0, 100.0)
MOVES = (
    ("zoom_in", "zoom in", 0.25, -0.25), ("zoom_out", "zoom out", -0.5, 0.5),
    ("chevron_left", "earlier", -0.5, -0.5), ("chevron_right", "later", 0.5, 0.5),
)  # fmt: skip
"""Icon and word of each zoom button, and how far both ends of the window move, as parts of its width."""
ZOOM = """() => {
    const chart = getElement(%d).chart, seen = chart.getOption().dataZoom[0], low = %g, high = %g;
    const width = seen.end - seen.start;
    let start = seen.start + low * width, end = seen.end + high * width;
    const back = low === high ? Math.max(0, -start) - Math.max(0, end - 100) : 0;
    chart.dispatchAction({type: "dataZoom", start: Math.max(0, start + back), end: Math.min(100, end + back)});
}"""


class ComparePanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        self.axes: list[str] = []
        self.chose_axes = False
        """True if the user chose the axis; otherwise it is the one on which the model fails most."""
        self.against = "timeline"
        self.chosen: list[int] = []
        """The runs that are shown; all if empty."""
        self.window = ALL
        self.chart: Any = None
        self.root = ui.element("div").classes("column fill")
        self._build()

    def hear(self, topic: Topic) -> None:
        if topic == "session":
            self.chose_axes, self.chosen, self.window, self.against = False, [], ALL, "timeline"
        if topic in ("session", "model"):
            self._build()

    def _build(self) -> None:
        self.root.clear()
        with self.root:
            if self.bench.session is None:
                self._nothing()
                return
            self._verdict()
            if self.bench.traces is None:
                return
            if not self.chose_axes:
                where = self._where()
                self.axes = [str(where[0]["axis"]) if where else self.bench.session.axis]
            self._controls()
            self._place(self.bench.traces)

    def _where(self) -> list[dict[str, Any]]:
        """The findings of the model; empty as long as there is no model."""
        return [] if self.bench.step is None else list(self.bench.step.view.compared["where"])

    def _nothing(self) -> None:
        with ui.element("section").classes("face"):
            ui.label("Reading the session…" if self.bench.opening else "No session is open.").classes("big")
            if not self.bench.opening:
                ui.button("Open one", on_click=lambda: self.tab.go("start"), color=None).props("flat no-caps")

    def _verdict(self) -> None:
        step, session = self.bench.step, self.bench.session
        assert session is not None
        if step is None:
            with ui.element("section").classes("face verdict"):
                told = f"{len(session.runs)} recordings, {session.rows:,} samples."
                ui.label(f"{told} Comparing the model with them…").classes("big")
            return
        view = step.view
        warned.show(view.compared["warnings"])
        fits, judged = view.compared["verdict"] == "adequate", view.compared["verdict"] != "implausible"
        tone = "good" if fits else "bad"
        with ui.element("section").classes(f"face verdict {tone}").props('aria-label="verdict"'):
            with ui.element("div"):
                verdict = "The model fits." if fits else "The model does not fit."
                ui.label(verdict if judged else "The session's axis is not judged.").classes("big")
                why = "What is left over is noise." if fits else "The readings contain an effect that it lacks:"
                why = why if judged else "A warning stands against it: mend the session, or accept the warning."
                ui.label(why).classes("dim")
                with ui.row().classes("tight").style("margin-top: 4px"):
                    for finding in view.compared["where"][:3]:
                        against = finding["against"].replace("_", " ")
                        ui.button(
                            f"{finding['axis']}, against {against}: {finding['note']}",
                            on_click=lambda f=finding: self._look_at(f),
                            color=None,
                        ).props("flat dense no-caps").classes("finding")
            with ui.element("div").classes("figures"):
                _, rms, floor, excess, *_ = view.rows[-1]
                for name, value, kind in (
                    ("error, mdps rms", rms, ""), ("noise floor", floor, ""), ("excess", excess, f"excess {tone}"),
                ):  # fmt: skip
                    with ui.element("div").classes(f"figure {kind}"):
                        ui.html(f"<b>{value}</b>", sanitize=False)
                        ui.label(name)
            if not fits and judged:
                button = ui.button("What is missing?", icon="search", on_click=self._diagnose, color=None)
                button.props("unelevated no-caps").classes("primary")

    async def _diagnose(self) -> None:
        self.tab.go("diagnose")
        if self.bench.diagnosis is None:
            await self.bench.diagnose()

    def _look_at(self, finding: dict[str, Any]) -> None:
        self.axes, self.chose_axes = [finding["axis"]], True
        wanted = opened_by(finding["against"])
        self.against = wanted if wanted in self._available() else "timeline"
        self.window = ALL
        self._draw()

    def _available(self) -> list[str]:
        if self.bench.step is None:
            return ["timeline"]
        view = self.bench.step.view
        there = {"timeline", *view.against, Frequency.name if view.spectra else "", "averaging" if view.allan else ""}
        return [name for name in VIEWS if name in there]

    def _controls(self) -> None:
        assert self.bench.session is not None
        with ui.row().classes("tight"):
            axes = AXES if self.bench.step is None else self.bench.step.view.compared["per_axis"]
            self.axis_chips = {a: chip(a, partial(self._toggle, a)).classes(f"axis-{a}") for a in axes}
            ui.separator().props("vertical")
            self.view_chips = {n: chip(VIEWS[n][0], partial(self._choose, n)) for n in self._available()}
            ui.space()
            runs = {i: run.file for i, run in enumerate(self.bench.session.runs)}
            select = ui.select(runs, multiple=True, value=self.chosen, label="all recordings", on_change=self._runs_chosen)
            select.props("outlined dense options-dense clearable").style("width: 140px")

    def _press(self) -> None:
        """Show which chips are pressed, and in which views the model fails."""
        self.frame.props(f'aria-label="{VIEWS[self.against][0]}"')
        self.zoom.set_visibility(self.against == "timeline")
        for axis, button in self.axis_chips.items():
            press(button, axis in self.axes)
        failing = {opened_by(f["against"]) for f in self._where() if f["axis"] in self.axes}
        for name, button in self.view_chips.items():
            press(button, name == self.against)
            button.classes(add="flag" if name in failing else "", remove="" if name in failing else "flag")
            button.props(f'aria-description="{"the model fails here" if name in failing else ""}"')

    def _zoom_buttons(self) -> None:
        """Zoom in the browser, so that quick clicks add up. ECharts reports the resulting window to :meth:`_zoomed`."""
        self.zoom = ui.element("div").classes("zoom")
        with self.zoom:
            for icon, word, low, high in MOVES:
                button = ui.button(icon=icon, color=None).props(f'flat round dense size="sm" aria-label="{word}"')
                button.on("click", js_handler=ZOOM % (self.chart.id, low, high))

    def _toggle(self, axis: str) -> None:
        self.axes, self.chose_axes = [a for a in AXES if (a in self.axes) != (a == axis)] or [axis], True
        self._draw()

    def _choose(self, against: str) -> None:
        if against != self.against:
            self.against = against
            self._draw()

    def _runs_chosen(self, event: events.ValueChangeEventArguments) -> None:
        self.chosen = sorted(event.value or [])
        self.window = ALL
        self._draw()

    def _runs(self) -> list[tuple[int, RunView]]:
        assert self.bench.session is not None
        return [(i, r) for i, r in enumerate(self.bench.session.runs) if not self.chosen or i in self.chosen]

    def _place(self, traces: Traces) -> None:
        with ui.element("div").classes("face grow over").style("padding: 6px 8px"):
            self.frame = ui.element("div").classes("chart").props("role=img")
            with self.frame:
                self.chart = ui.echart(self._options(traces)).classes("chart")
            self.chart.on("chart:datazoom", self._zoomed, ["start", "end", "batch"], throttle=0.05)
            self._zoom_buttons()
        self._press()

    def _draw(self) -> None:
        """Draw again in the existing chart."""
        traces = self.bench.traces
        if traces is not None:
            self._press()
            self.chart.run_chart_method("setOption", self._options(traces), {"notMerge": True})

    def _options(self, traces: Traces) -> charts.Options:
        p, x_name = self.tab.palette, VIEWS[self.against][1]
        if self.against == "timeline":
            return self._timeline(traces).options(self.window, x_name)
        assert self.bench.step is not None
        view = self.bench.step.view
        if self.against == Frequency.name:
            lines = [f for f in self._where() if f["against"] == Frequency.name]
            what = "amplitude density of what is left over, mdps/√Hz"
            return plots.curves(p, view.spectra, self.axes, what, "level between lines", x_name, lines)
        if self.against == "averaging":
            what = "Allan deviation of what is left over, mdps"
            return plots.curves(p, view.allan, self.axes, what, "noise model", x_name)
        return plots.folded(p, traces.points, PANELS[self.against], [i for i, _ in self._runs()], self.axes)

    def _timeline(self, traces: Traces) -> plots.Timeline:
        return plots.Timeline(traces, self._runs(), self.axes, self.tab.palette)

    def _zoomed(self, event: events.GenericEventArguments) -> None:
        said = (event.args.get("batch") or [event.args])[0]
        traces = self.bench.traces
        if self.against != "timeline" or said.get("start") is None or traces is None:
            return
        self.window = (float(said["start"]), float(said["end"]))
        seen = [{"data": series["data"]} for series in self._timeline(traces).series(self.window)]
        self.chart.run_chart_method("setOption", {"series": seen})


def show(tab: Tab) -> Callable[[Topic], None]:
    return ComparePanel(tab).hear
