"""Measured against modelled, and what is left over against whatever it may depend on."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from gyrocal.digits import UNKNOWN
from gyrocal.present.verdict import beyond_noise, high_floor, stands_on
from gyrocal.variables.base import variables
from gyrocal.variables.frequency import Frequency
from gyrocal.variables.order import Order
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.words import above_excess
from gyrocal.web.state.traces import Traces
from gyrocal.web.state.workbench import Topic
from gyrocal.web.values.residual_plots import panels
from gyrocal.web.values.views import AXES, NOT_JUDGED, ModelView, Place, RunView
from gyrocal.web.widgets import export, plots, warned
from gyrocal.web.widgets.chips import chip, press
from gyrocal.web.widgets.run_strip import REFOCUS, strip
from gyrocal.web.widgets.toolbar import toolbar
from gyrocal.web.widgets.tools import named, tool, tools

if TYPE_CHECKING:
    from gyrocal.web.page import Tab
    from gyrocal.web.values.excess_by_step import Fall

PANELS = {panel.name: panel for panel in panels()}
VIEWS = {
    "timeline": ("Timeline", "recordings one after another, s"),
    **{name: (panel.title, panel.label) for name, panel in PANELS.items()},
    Frequency.name: (Frequency.title, Frequency.label()),
    Order.name: (Order.title, "order, periods per turn of the table"),
    "averaging": ("Allan", "averaging time, s"),
}
"""The text of the button of every plot, and the label of its horizontal axis."""
SPECTRA = {
    Frequency.name: ("amplitude density of what is left over", "/√Hz", "noise alone"),
    Order.name: ("amplitude of what is left over", "", "white noise alone"),
}
"""The title of each spectrum, what stands behind its unit, and the name of its reference."""
AROUND = 4.0
"""Factor by which the part of a spectrum around a finding is wider than the finding on both sides."""
ALL = (0.0, 100.0)
MOST_NAMED = 3
"""Findings that are buttons."""
MOVES = (
    ("zoom_in", "zoom in", 0.25, -0.25), ("zoom_out", "zoom out", -0.5, 0.5),
    ("chevron_left", "earlier", -0.5, -0.5), ("chevron_right", "later", 0.5, 0.5),
)  # fmt: skip
"""Icon and word of each zoom button, and how far both ends of the window move, as parts of its width."""
ZOOM = """() => {
    const chart = getElement(%d)?.chart, low = %g, high = %g;
    if (!chart) return;  // another picture has taken its place
    const seen = chart.getOption().dataZoom[0];
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
        self.place: Place | None = None
        """The finding whose picture is shown."""
        self.pressed: int | None = None
        """The run that was pressed last in the strip, which keeps the focus."""
        self.chart: Any = None
        """None as long as there is nothing to draw."""
        self.root = ui.element("div").classes("column fill")
        self._build()

    def hear(self, topic: Topic) -> None:
        if topic == "session":
            self.chose_axes, self.chosen, self.window, self.against, self.place = False, [], ALL, "timeline", None
            self.pressed = None
        if topic in ("session", "runs", "model"):
            self._build()
        if topic == "scheme" and self.chart is not None:
            self._draw()

    def _build(self) -> None:
        self.root.clear()
        self.chart = None
        with self.root:
            if self.bench.session is None:
                self._nothing()
                return
            self._verdict()
            if self.bench.traces is None:
                return
            left = {} if self.bench.step is None else self.bench.step.view.left
            with ui.element("div").classes("beside"):
                floor = None if self.bench.step is None else self.bench.step.view.compared.get("floor_dps")
                excluded, last_run = self.bench.excluded, self.bench.last_run
                strip(self.bench.session.runs, left, 1e3 * (floor or 0.0), excluded, last_run, self._include)
                if self.pressed is not None:
                    ui.run_javascript(REFOCUS % self.pressed)
                runs = {i: run.file for i, run in enumerate(self.bench.session.runs)}
                select = ui.select(runs, multiple=True, value=self.chosen, label="show runs", on_change=self._runs_chosen)
                select.props("outlined dense options-dense clearable").style("width: 150px")
            if not self.chose_axes:
                where = self._where()
                self.axes = [str(where[0]["axis"]) if where else self.bench.session.axis]
            self._controls()
            self._place(self.bench.traces)

    def _where(self) -> list[dict[str, Any]]:
        """The findings of the model; empty as long as there is no model."""
        return [] if self.bench.step is None else list(self.bench.step.view.compared["where"])

    async def _include(self, file: str) -> None:
        assert self.bench.session is not None
        self.pressed = next(i for i, run in enumerate(self.bench.session.runs) if run.file == file)
        await self.bench.include(file, file in self.bench.excluded)

    def _found(self) -> list[tuple[dict[str, Any], Place]]:
        """The findings of the model with their pictures."""
        places = [] if self.bench.step is None else self.bench.step.view.places
        return list(zip(self._where(), places, strict=True))

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
        warned.show(view.compared["warnings"], self.bench)
        fits, judged = view.compared["verdict"] == "adequate", view.compared["verdict"] != "implausible"
        tone = "good" if fits else "bad"
        with ui.element("section").classes(f"face verdict {tone}").props('aria-label="verdict"'):
            with ui.element("div"):
                beyond = beyond_noise(view.compared) if fits else ""
                verdict = "The model is adequate." if fits else "The model does not fit."
                verdict = "No test finds what the model lacks." if beyond else verdict
                ui.label(verdict if judged else "The session's axis is not judged.").classes("big")
                why = "What is left over is noise." if fits else "The readings contain an effect that it lacks:"
                why = f"But more than noise is left over: an excess of {beyond}." if beyond else why
                why = why if judged else "A warning stands against it: mend the session, or accept the warning."
                ui.label(why).classes("dim")
                with ui.row().classes("tight").style("margin-top: 4px"):
                    for finding, place in list(zip(view.compared["where"], view.places, strict=True))[:MOST_NAMED]:
                        shown = PANELS.get(place.view)
                        against = shown.label.partition(",")[0] if shown else variables()[finding["against"]].quantity
                        if not place.view:
                            text = f"{finding['axis']}: {finding['note']}; no picture against a variable shows it"
                            ui.label(text).classes("finding plain")
                            continue
                        ui.button(
                            f"{finding['axis']}, against {against}: {finding['note']}",
                            on_click=lambda f=finding, p=place: self._look_at(f["axis"], p),
                            color=None,
                        ).props("flat dense no-caps").classes("finding")
            above = above_excess(view.compared["where"][:MOST_NAMED], view.compared["per_axis"])
            above = stands_on(view.compared) or high_floor(view.compared) or above
            _figures(view, self.bench.fall(), tone, above, judged=judged)
            if not fits and judged:
                button = ui.button("What is missing?", icon="search", on_click=self._diagnose, color=None)
                button.props("unelevated no-caps").classes("primary")

    async def _diagnose(self) -> None:
        self.tab.go("diagnose")
        if self.bench.diagnosis is None:
            await self.bench.diagnose()

    def _look_at(self, axis: str, place: Place) -> None:
        """Show the picture that proves a finding, at the place that the finding names."""
        self.axes, self.chose_axes = [axis], True
        self.against = place.view if place.view in self._available() else "timeline"
        self.window, self.place = ALL, place
        self._draw()

    def _available(self) -> list[str]:
        if self.bench.step is None:
            return ["timeline"]
        view = self.bench.step.view
        there = {"timeline", *view.against}
        there |= {n for n, of in ((Frequency.name, view.spectra), (Order.name, view.orders), ("averaging", view.allan)) if of}
        return [name for name in VIEWS if name in there]

    def _controls(self) -> None:
        assert self.bench.session is not None
        with ui.row().classes("tight views-row") as row:
            axes = AXES if self.bench.step is None else self.bench.step.view.compared["per_axis"]
            self.axis_chips = {a: chip(a, partial(self._toggle, a)).classes(f"axis-{a}") for a in axes}
            ui.separator().props("vertical")
            self.view_chips = {n: chip(VIEWS[n][0], partial(self._choose, n)) for n in self._available()}
        toolbar(row, "axes, and what they are drawn against")

    def _press(self) -> None:
        """Show which chips are pressed, and in which views the model fails."""
        self.frame.props(f'aria-label="{VIEWS[self.against][0]}"')
        self.moves.set_visibility(self.against == "timeline")
        for axis, button in self.axis_chips.items():
            press(button, axis in self.axes)
        failing = {p.view for f, p in self._found() if f["axis"] in self.axes}
        for name, button in self.view_chips.items():
            press(button, name == self.against)
            button.classes(add="flag" if name in failing else "", remove="" if name in failing else "flag")
            button.props(f'aria-description="{"the model fails here" if name in failing else ""}"')

    def _zoom_buttons(self) -> None:
        """Zoom in the browser, so that quick clicks add up. ECharts reports the resulting window to :meth:`_zoomed`."""
        with ui.element("div").classes("zoom"):
            self.moves = ui.element("span")
            with self.moves:
                for icon, word, low, high in MOVES:
                    tool(icon, word).on("click", js_handler=ZOOM % (self.chart.id, low, high))
            tools(self.chart, self._file, self._csv, self._reset)

    def _reset(self) -> None:
        self.window, self.place = ALL, None
        self._draw()

    def _file(self) -> str:
        """The name of a file that the chart is saved to."""
        return named(self.bench, f"{self.against}_{''.join(self.axes)}")

    def _csv(self) -> str:
        """The data on the screen."""
        assert self.bench.traces is not None
        return export.as_csv(self._options(self.bench.traces))

    def _toggle(self, axis: str) -> None:
        self.axes, self.chose_axes = [a for a in AXES if (a in self.axes) != (a == axis)] or [axis], True
        self._draw()

    def _choose(self, against: str) -> None:
        if against != self.against:
            self.against, self.place = against, None
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
            self.frame = ui.element("div").classes("chart plots").props("role=img")
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
            options = self._options(traces)
            self.chart.options.clear()
            self.chart.options.update(options)  # a chart that the browser has not made yet begins with them
            self.chart.run_chart_method(":setOption", charts.script(options), "({notMerge: true})")

    def _options(self, traces: Traces) -> charts.Options:
        p, x_name = self.tab.palette, VIEWS[self.against][1]
        if self.against == "timeline":
            return self._timeline(traces).options(self.window, x_name)
        assert self.bench.step is not None
        view = self.bench.step.view
        if self.against in (Frequency.name, Order.name):
            over = view.spectra if self.against == Frequency.name else view.orders
            marked = [
                (p.low, p.high, f["note"]) for f, p in self._found()
                if p.view == self.against and f["axis"] in self.axes and p.low is not None and p.high is not None
            ]  # fmt: skip
            what, per, alone = SPECTRA[self.against]
            return plots.curves(p, over, self.axes, what, per, f"{alone}{self._with_misfit}", x_name, marked, self._seen_part())
        if self.against == "averaging":
            what = "Allan deviation of what is left over"
            return plots.curves(p, view.allan, self.axes, what, "", f"noise model{self._with_misfit}", x_name)
        place = self.place if self.place is not None and self.place.view == self.against else Place(self.against)
        drawn = plots.By(place.about_means, place.part)
        return plots.folded(p, traces.points, PANELS[self.against], [i for i, _ in self._runs()], self.axes, drawn)

    @property
    def _with_misfit(self) -> str:
        """What the legend says of the noise of a model that does not fit: its fit takes slow parts of the misfit for drift."""
        fits = self.bench.step is None or self.bench.step.view.compared["verdict"] == "adequate"
        return "" if fits else ", part of the misfit in it"

    def _seen_part(self) -> tuple[float, float] | None:
        """The part of a spectrum around the finding that is shown."""
        place = self.place
        if place is None or place.view != self.against or place.low is None or place.high is None:
            return None
        return place.low / AROUND, place.high * AROUND

    def _timeline(self, traces: Traces) -> plots.Timeline:
        return plots.Timeline(traces, self._runs(), self.axes, self.tab.palette)

    def _zoomed(self, event: events.GenericEventArguments) -> None:
        said = (event.args.get("batch") or [event.args])[0]
        traces = self.bench.traces
        if self.against != "timeline" or traces is None:
            return
        timeline = self._timeline(traces)
        if said.get("start") is not None:
            self.window = (float(said["start"]), float(said["end"]))
        elif said.get("startValue") is not None:  # a box was drawn
            low, high = (100 * float(said[end]) / timeline.total_s for end in ("startValue", "endValue"))
            self.window = (max(0.0, low), min(100.0, high))
        else:
            return
        seen = [{"data": series["data"]} for series in timeline.series(self.window)]
        self.chart.run_chart_method("setOption", {"series": seen})


def _counted(view: ModelView, fall: Fall | None) -> tuple[str, list[list[str]]]:
    """The unit, and name, rms, floor, excess and its error of each axis and of all: the figures that the bars of Diagnose show.

    They are those of ``gyrocal compare`` where nothing is held out, and for a session that is judged by angle.
    """
    if fall is None:
        return view.unit, [row[:5] for row in view.rows]
    named = [(row[0], fall.now.of_axes.get(row[0].partition(" ")[0])) for row in view.rows[:-1]]
    levels = [*((name, level) for name, level in named if level is not None), (view.rows[-1][0], fall.now.level)]
    return fall.unit.name, [
        [name, *(fall.unit.text(x, 2, v.excess_se_dps) for x in (v.rms_dps, v.floor_dps, v.excess_dps, v.excess_se_dps))]
        for name, v in levels
    ]


def _figures(view: ModelView, fall: Fall | None, tone: str, above: str, *, judged: bool) -> None:
    """rms, floor and excess of all axes, and the excess of each axis that is judged.

    Where the session's axis is not ``judged``, the figures say so and have no colour of a verdict.
    """
    unit, (*axes, (_, rms, floor, excess, excess_se)) = _counted(view, fall)
    sure = "" if excess_se == UNKNOWN else f" ± {excess_se}"
    with ui.element("div").style("margin-left: auto"):
        with ui.element("div").classes("figures").style("justify-content: flex-end"):
            for name, value, kind in (
                (f"error, {unit} rms", rms, ""), (f"noise floor, {unit}", floor, ""),
                (f"excess{sure}, {unit}", excess, f"excess {tone if judged else 'unjudged'}"),
            ):  # fmt: skip
                with ui.element("div").classes(f"figure {kind}"):
                    ui.html(f"<b>{value}</b>", sanitize=False)
                    ui.label(name)
        if not judged:
            ui.label("Not judged: figures of the readings as they stand, with what the warning contradicts.").classes(
                "dim small per-axis"
            )
        known = [
            name if NOT_JUDGED in name else f"{name} {of} ± {error}" for name, _, _, of, error in axes if of != UNKNOWN
        ]
        told = f"excess by axis, {unit}: {' · '.join(known)}" if known else "not known: nothing could be left out of the fit"
        ui.label(told).classes("dim small per-axis")
        for text in ("", "") if fall is None else (f"Counted in {fall.counted}.", fall.in_all):
            if text:
                ui.label(text).classes("dim small counted")
        if above:
            ui.label(above).classes("dim small per-axis above")


def show(tab: Tab) -> Callable[[Topic], None]:
    return ComparePanel(tab).hear
