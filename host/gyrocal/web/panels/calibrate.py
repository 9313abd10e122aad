"""Scale and bias by every method; a network for the model; what goes to the device; the report."""

from __future__ import annotations

import html
import shlex
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.errors import INDEX_IS, INSTALL_TRAIN
from gyrocal.present.tables import number, plain
from gyrocal.units import unit_of
from gyrocal.web.pictures import answer_table as answers
from gyrocal.web.pictures import scatter
from gyrocal.web.state.on_page import on_page
from gyrocal.web.state.training import Training, missing
from gyrocal.web.state.workbench import Topic
from gyrocal.web.widgets.tools import named, tools

if TYPE_CHECKING:
    from gyrocal.web.page import Tab

MOST_ROWS = 300
EPOCHS = 40
SHIPPED_FOR = "turns at 78 deg/s, read 145 times a second"


class CalibratePanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        self.axis = "" if self.bench.session is None else self.bench.session.axis
        self.training: Training | None = None
        """The training whose progress is shown."""
        with ui.element("div").classes("two answering fill"):
            self.answers = ui.element("section").classes("face column tight").props('aria-label="scale and bias"')
            with ui.element("div").classes("scroll"):
                self.network = ui.element("section").classes("face column tight").props('aria-label="network"')
                self.device = ui.element("section").classes("face column tight").props('aria-label="to the device"')
                self.files = ui.element("section").classes("face column tight").props('aria-label="files"')
                self.budget = ui.element("section").classes("face column tight").props('aria-label="error budget"')
        self.hear("session")
        ui.timer(1.0, self._told)

    def hear(self, topic: Topic) -> None:
        if topic == "session":
            self.axis = "" if self.bench.session is None else self.bench.session.axis
        if topic in ("session", "model", "calibration", "scheme"):
            self._answers()
        if topic in ("session", "model", "calibration"):
            self._budget()
        if topic == "training" and self.training is not None and self.training is self.bench.training:
            self._told()
            return
        if topic in ("session", "model", "training"):
            self._network()
        if topic in ("session", "model", "training", "export"):
            self._device()
        if topic in ("session", "model"):
            self._files()

    def _answers(self) -> None:
        self.answers.clear()
        found = self.bench.calibration
        with self.answers:
            ui.html("<h2>Scale and bias</h2>", sanitize=False)
            if self.bench.step is None:
                ui.label(self.bench.not_yet).classes("dim")
                if self.bench.session is None and not self.bench.opening:
                    ui.button("Open one", on_click=lambda: self.tab.go("start"), color=None).props("flat no-caps")
                return
            if found is None:
                ui.label("Calibrating…" if self.bench.jobs.current else "This session gives no answer.").classes("dim")
                return
            if not found.estimates:
                ui.label(on_page(found.note)).classes("dim")
                return
            for told in scatter.sentences(found.estimates, self.axis):
                ui.label(told)
            drawn = scatter.options(self.tab.palette, found.estimates, self.axis)
            if drawn:
                bar = ui.element("div").classes("tools")
                with ui.element("div").classes("scattered"):
                    chart = ui.echart(drawn).classes("chart")
                    chart.props(f'role="img" aria-label="{drawn["title"]["text"]}"')
                with bar:
                    tools(chart, lambda: named(self.bench, f"bias_{self.axis}"))
            ui.label(on_page(found.note) or "The model's answers are those of the model as it is now.").classes("dim small")
            if len(found.estimates) > MOST_ROWS:
                ui.label(f"The first {MOST_ROWS} of {len(found.estimates)}; `gyrocal calibrate` prints all.").classes(
                    "dim small"
                )
            rows = ui.element("div").props('role="region" aria-label="answers" tabindex="0"')
            with rows.classes("scroll grow sideways long answers"):
                ui.html(_table(found.estimates[:MOST_ROWS]), sanitize=False)
            for meaning in scatter.meanings(found.estimates):
                ui.label(meaning).classes("dim small")

    def _budget(self) -> None:
        """Where the error of the best answer comes from, and what would have to be better next."""
        budget = None if self.bench.calibration is None else self.bench.calibration.budget
        self.budget.clear()
        self.budget.set_visibility(budget is not None)
        if budget is not None:
            with self.budget:
                ui.html(f"<h2>Where the error comes from: {html.escape(budget.of)}</h2>", sanitize=False)
                ui.label(on_page(budget.headline)).classes("small")
                ui.html(on_page(budget.table()), sanitize=False).classes("sideways")

    def _network(self) -> None:
        """The section about a network for the model: its training, its progress and its errors."""
        self.network.clear()
        self.network.set_visibility(self.bench.step is not None)
        if self.bench.step is None:
            return
        self.training = training = self.bench.training
        trained = self.bench.network(self.axis)
        with self.network:
            ui.html("<h2>A network for this model</h2>", sanitize=False)
            if training is not None:
                self.bar = ui.linear_progress(show_value=False).props('aria-label="training"')
                with ui.row().classes("tight"):
                    self.told = ui.label().classes("small").props('role="status"')
                    ui.space()
                    ui.button("Stop training", icon="stop", on_click=training.cancel, color=None).props("outline no-caps dense")
                self._told()
            elif trained is not None:
                _parity(trained.parity)
                where = f"Trained for axis {self.axis}, in {self.bench.places.name(trained.folder)}."
                ui.label(f"{where} Mean error on new runs drawn from the model, and the model's own:").classes("small")
                ui.html(_errors(trained.errors), sanitize=False)
                ui.label("The network's answers in the table are still those of the network that ships.").classes("dim small")
            elif lacking := missing():
                words = f"Training needs {' and '.join(lacking)}. Install, and start the workbench again. {INDEX_IS}:"
                ui.label(words).classes("small")
                _command(f"{shlex.quote(sys.executable)} -m {INSTALL_TRAIN}")
            else:
                ui.label(
                    f"The shipped network is trained for {SHIPPED_FOR}. A network trained on runs drawn from this model can "
                    "replace it on the device. The training takes minutes."
                ).classes("small")
                with ui.row().classes("tight"):
                    name = ui.input("folder", value=self.bench.places.free("network").name).props("outlined dense")
                    axis = self._axes()
                    epochs = ui.number("epochs", value=EPOCHS, min=1, precision=0).props("outlined dense").style("width: 80px")
                    ui.button(
                        "Train it", icon="model_training", color=None,
                        on_click=lambda: self.bench.train(name.value, axis.value, int(epochs.value or EPOCHS)),
                    ).props("outline no-caps")  # fmt: skip

    def _told(self) -> None:
        """The progress of the training as text."""
        training = self.training
        if training is None:
            return
        self.bar.value = training.done / training.epochs
        parts = [f"epoch {training.done} of {training.epochs}" if training.done else "starting"]
        if training.done == training.epochs:
            parts.append("checking the network")
        if training.loss is not None:
            parts.append(f"loss {training.loss:.3f}")
        if training.left_s is not None:
            left = training.left_s
            parts.append(f"{left / 60:.0f} min left" if left >= 90 else f"{left:.0f} s left")
        self.told.text = ", ".join(parts)

    def _axes(self) -> ui.select:
        assert self.bench.step is not None
        axes = list(self.bench.step.view.compared["per_axis"])
        select = ui.select(axes, value=self.axis, label="axis", on_change=lambda e: self._turn(e.value))
        return select.props("outlined dense").style("width: 80px")

    def _turn(self, axis: str) -> None:
        """Choose another axis of the sensor."""
        if axis != self.axis:
            self.axis = axis
            self._network()
            self._device()

    def _device(self) -> None:
        self.device.clear()
        self.device.set_visibility(self.bench.step is not None)
        if self.bench.step is None or self.bench.session is None:
            return
        effects = [title for _, title, removable in self.bench.step.view.effects if removable]
        with self.device:
            ui.html("<h2>To the device</h2>", sanitize=False)
            knows = ", ".join(effects).lower() if effects else "nothing beyond scale, bias and noise"
            network = "that ships" if self.bench.network(self.axis) is None else "trained for it"
            ui.label(
                f"A firmware project to flash. It calibrates by this model ({knows}) and by the network {network}."
            ).classes("small")
            exported = self.bench.exported
            if exported is None:
                with ui.row().classes("tight"):
                    name = ui.input("folder", value=self.bench.places.free("firmware").name).props("outlined dense")
                    axis = self._axes()
                    button = ui.button(
                        "Write it", icon="memory", on_click=lambda: self.bench.export(name.value, axis.value), color=None
                    )
                    button.props("unelevated no-caps").classes("primary")
                return
            _parity(exported.parity)
            ui.label(f"Written to {self.bench.places.name(exported.folder)}. With the board plugged in:").classes("small")
            _command(f"cd {shlex.quote(str(exported.folder))} && pio run -t upload && pio device monitor")

    def _files(self) -> None:
        self.files.clear()
        self.files.set_visibility(self.bench.step is not None)
        with self.files:
            ui.html("<h2>To keep</h2>", sanitize=False)
            with ui.row().classes("tight"):
                for text, icon, act in (
                    ("Report, one HTML file", "description", self._report),
                    ("Model, TOML", "download", self._model),
                ):
                    ui.button(text, icon=icon, on_click=act, color=None).props("outline no-caps dense")
            ui.label("The report shows all of this on one page. The command line takes the model with --model.").classes(
                "dim small"
            )

    async def _report(self) -> None:
        text = await self.bench.report()
        if self.files.is_deleted:  # the panel was left meanwhile
            return
        if text is not None and self.bench.session is not None:
            ui.download.content(text, f"{self.bench.session.path.name}.html", "text/html")

    def _model(self) -> None:
        if self.bench.step is not None:
            ui.download.content(self.bench.step.view.toml, "model.toml", "application/toml")


def _parity(parity: dict[str, Any] | None) -> None:
    if parity is None:
        ui.label("The network in C was not checked, which needs onnxruntime: pip install 'gyrocal[net]'").classes("small")
        return
    with ui.row().classes("tight").style("flex-wrap: nowrap"):
        ui.element("span").classes(f"light {'good' if parity['ok'] else 'bad'}")
        agree = "agree" if parity["ok"] else "DISAGREE"
        told = f"largest difference {parity['max_abs_diff']:.1e} over {parity['windows']} windows"
        ui.label(f"The network in C and in onnxruntime {agree}: {told}.").classes("small")


def _command(command: str) -> None:
    """A command to type, with a button that copies it."""
    with ui.row().classes("tight").style("flex-wrap: nowrap; width: 100%"):
        ui.html(f'<pre class="command">{html.escape(command)}</pre>', sanitize=False).classes("grow")
        ui.button(icon="content_copy", on_click=lambda: ui.clipboard.write(command), color=None).props(
            'flat round dense aria-label="copy the command"'
        )


def _table(estimates: list[dict[str, Any]]) -> str:
    """The answers. The axis is left out where all are of one, which stands above the table."""
    columns, rows = answers.columns(unit_of(e["bias_dps"] for e in estimates)), answers.rows(estimates)
    if len({e["axis"] for e in estimates}) == 1:
        at = columns.index("axis:")
        columns, rows = columns[:at] + columns[at + 1 :], [row[:at] + row[at + 1 :] for row in rows]
    return plain(columns, rows, [not e["trusted"] for e in estimates])


def _errors(errors: list[dict[str, Any]]) -> str:
    """The errors of the trained network on scenarios drawn from the model that were not used in training."""
    by = {(e["method"], e["seconds"]): e for e in errors}
    rows = []
    for seconds in sorted({e["seconds"] for e in errors}):
        net, model = by["net", seconds], by["model", seconds]
        scales = [number(e["scale_mae"], ".4f", 100) for e in (net, model)]
        rows.append([f"{seconds:g}", *scales, *(number(e["bias_mae_dps"], ".2f", 1e3) for e in (net, model))])
    return plain(("first s", "scale, %: network", "the model", "bias, mdps: network", "the model "), rows)


def show(tab: Tab) -> Callable[[Topic], None]:
    return CalibratePanel(tab).hear
