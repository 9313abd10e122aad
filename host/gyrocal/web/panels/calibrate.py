"""Scale and bias by every method; what goes to the device; the report."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.web.state import Topic
from gyrocal.web.tables import number, plain

if TYPE_CHECKING:
    from gyrocal.web.page import Tab

MOST_ROWS = 300


class CalibratePanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        with ui.element("div").classes("two fill"):
            self.answers = ui.element("section").classes("face column tight").props('aria-label="scale and bias"')
            with ui.element("div").classes("scroll"):
                self.device = ui.element("section").classes("face column tight").props('aria-label="to the device"')
                self.files = ui.element("section").classes("face column tight").props('aria-label="files"')
        self.hear("session")

    def hear(self, topic: Topic) -> None:
        if topic in ("session", "model", "calibration"):
            self._answers()
        if topic in ("session", "model", "export"):
            self._device()
        if topic in ("session", "model"):
            self._files()

    def _answers(self) -> None:
        self.answers.clear()
        found = self.bench.calibration
        with self.answers:
            ui.html("<h2>Scale and bias from the first seconds</h2>", sanitize=False)
            if self.bench.step is None:
                ui.label("Open a session first.").classes("dim")
                ui.button("Open one", on_click=lambda: self.tab.go("start"), color=None).props("flat no-caps")
                return
            if found is None:
                ui.label("Calibrating…" if self.bench.jobs.current else "No answer from this session.").classes("dim")
                return
            ui.label(found.note or "The model's answers are those of the model as it is now.").classes("dim small")
            if len(found.estimates) > MOST_ROWS:
                ui.label(f"The first {MOST_ROWS} of {len(found.estimates)}; `gyrocal calibrate` prints all.").classes(
                    "dim small"
                )
            with ui.element("div").classes("scroll grow"):
                ui.html(_table(found.estimates[:MOST_ROWS]), sanitize=False)

    def _device(self) -> None:
        self.device.clear()
        self.device.set_visibility(self.bench.step is not None)
        if self.bench.step is None or self.bench.session is None:
            return
        effects = [title for _, title, removable in self.bench.step.view.effects if removable]
        with self.device:
            ui.html("<h2>To the device</h2>", sanitize=False)
            knows = ", ".join(effects).lower() if effects else "nothing beyond scale, bias and noise"
            ui.label(f"The firmware as a project to flash, calibrating by this model: {knows}.").classes("small")
            exported = self.bench.exported
            if exported is None:
                with ui.row().classes("tight"):
                    name = ui.input("folder", value=self.bench.places.free("firmware").name).props("outlined dense")
                    axis = ui.select(
                        list(self.bench.step.view.compared["per_axis"]), value=self.bench.session.axis, label="axis"
                    )
                    axis.props("outlined dense").style("width: 80px")
                    button = ui.button(
                        "Write it", icon="memory", on_click=lambda: self.bench.export(name.value, axis.value), color=None
                    )
                    button.props("unelevated no-caps").classes("primary")
                return
            parity = exported.parity
            with ui.row().classes("tight"):
                ui.element("span").classes(f"light {'good' if parity['ok'] else 'bad'}")
                agree = "agree" if parity["ok"] else "DISAGREE"
                told = f"largest difference {parity['max_abs_diff']:.1e} over {parity['windows']} windows"
                ui.label(f"The network in C and in onnxruntime {agree}: {told}.").classes("small")
            ui.label(f"Written to {self.bench.places.name(exported.folder)}. With the board plugged in:").classes("small")
            command = f"cd {exported.folder} && pio run -t upload && pio device monitor"
            with ui.row().classes("tight").style("flex-wrap: nowrap; width: 100%"):
                ui.html(f'<pre class="command">{html.escape(command)}</pre>', sanitize=False).classes("grow")
                ui.button(icon="content_copy", on_click=lambda: ui.clipboard.write(command), color=None).props(
                    'flat round dense aria-label="copy the command"'
                )

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
            ui.label("The report holds everything on the screen. `gyrocal` takes the model file with --model.").classes(
                "dim small"
            )

    async def _report(self) -> None:
        text = await self.bench.report()
        if text is not None and self.bench.session is not None:
            ui.download.content(text, f"{self.bench.session.path.name}.html", "text/html")

    def _model(self) -> None:
        if self.bench.step is not None:
            ui.download.content(self.bench.step.view.toml, "model.toml", "application/toml")


COLUMNS = ("scenario:", "axis:", "method:", "first s", "scale, %", "±", "bias, mdps", "± ")


def _table(estimates: list[dict[str, Any]]) -> str:
    rows = [
        [
            e["scenario"], e["axis"], e["method"], number(e["seconds"], "g"), number(e["scale"], ".4f", 100),
            number(e["scale_se"], ".4f", 100), number(e["bias_dps"], ".1f", 1e3), number(e["bias_se_dps"], ".1f", 1e3),
        ]
        for e in estimates
    ]  # fmt: skip
    return plain(COLUMNS, rows)


def show(tab: Tab) -> Callable[[Topic], None]:
    return CalibratePanel(tab).hear
