"""What is missing: ranked cards, Add, and the excess error falling."""

from __future__ import annotations

import html
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from gyrocal.present.report import BLOCKED
from gyrocal.web import charts, warned
from gyrocal.web.state import Topic
from gyrocal.web.views import Card, DiagnosisView
from gyrocal.web.words import evidence

if TYPE_CHECKING:
    from gyrocal.web.page import Tab


class DiagnosePanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        self.acts: list[ui.button] = []
        """The buttons that start a search; they are disabled during one."""
        with ui.element("div").classes("two fill"):
            self.cards = ui.element("section").classes("scroll").props('aria-label="what is missing"')
            with ui.element("section").classes("column"):
                self.model = ui.element("div").classes("face")
                self.fall = ui.element("div").classes("face grow column").style("padding: 10px 14px; gap: 4px")
                self.calibration = ui.element("div").classes("face grow column").style("padding: 10px 14px; gap: 4px")
        for draw in (self._cards, self._model, self._fall, self._calibration):
            draw()

    def hear(self, topic: Topic) -> None:
        if topic == "job":
            self._allow()
        if topic in ("session", "model", "diagnosis"):
            self._cards()
        if topic in ("session", "model"):
            self._model()
            self._fall()
        if topic in ("session", "model", "calibration"):
            self._calibration()

    def _allow(self) -> None:
        for button in self.acts:
            button.set_enabled(not self.bench.searching)

    # Cards.

    def _cards(self) -> None:
        self.acts = []
        self._draw_cards()
        self._allow()

    def _draw_cards(self) -> None:
        self.cards.clear()
        with self.cards:
            found = self.bench.diagnosis
            if self.bench.step is None:
                with ui.element("div").classes("face"):
                    ui.label("Open a session first.").classes("big")
                    ui.button("Open one", on_click=lambda: self.tab.go("start"), color=None).props("flat no-caps")
                return
            warned.show(self.bench.step.view.compared["warnings"])
            if found is None:
                self._invite()
                self._added()
                return
            self._sentence(found)
            if found.verdict == "unknown":
                self._unknown(found)
            shown = [c for c in found.cards if c.judged["decision"] in ("add", "suggest")]
            for card in shown:
                self._card(card)
            self._rest(found)

    def _invite(self) -> None:
        assert self.bench.step is not None
        compared = self.bench.step.view.compared
        fits, judged = compared["verdict"] == "adequate", compared["verdict"] != "implausible"
        bars = self.bench.waterfall()
        with ui.element("div").classes(f"face verdict {'good' if fits else 'bad'}").style("flex: none"), ui.element("div"):
            verdict = "The model fits: what is left over is noise." if fits else "The model does not fit yet."
            ui.label(verdict if judged else BLOCKED).classes("big")
            if len(bars) > 1:
                ui.label(f"The excess error went from {bars[0].after:.2f} to {bars[-1].after:.2f} mdps.")
            with ui.row().style("margin-top: 8px"):
                look = ui.button(
                    "Look again" if fits else "Find what is missing", icon="search", on_click=self.bench.diagnose, color=None
                )
                look.props("flat no-caps" if fits else "unelevated no-caps").classes("" if fits else "primary")
                self.acts.append(look)
                if fits:
                    onward = ui.button(
                        "Take it to the device", icon="memory", on_click=lambda: self.tab.go("calibrate"), color=None
                    )
                    onward.props("unelevated no-caps").classes("primary")

    def _sentence(self, found: DiagnosisView) -> None:
        tone = {"adequate": "good"}.get(found.verdict, "bad")
        with ui.element("div").classes(f"face verdict {tone}").style("flex: none"):
            ui.label(found.sentence).classes("big").style("font-size: 16px")

    def _added(self) -> None:
        """The candidate that was added last, as the diagnosis found it."""
        step, found = self.bench.step, self.bench.diagnosed
        if step is not None and step.formula and not step.removed:
            self._formula(step.title, step.formula)
        if step is None or found is None or step.removed:
            return
        for card in found.cards:
            if card.judged["effect"] == step.effect and card.judged["decision"] in ("add", "suggest"):
                self._card(card, added=True)

    def _card(self, card: Card, *, added: bool = False) -> None:
        judged = card.judged
        passed = judged["decision"] == "add"
        alone = passed and not card.looks_like
        word = "fits the evidence" if alone else "one of several" if passed else "a hint, not enough to be sure"
        with ui.element("article").classes(f"card {'add' if passed and not added else ''}"):
            with ui.element("div").classes("head"):
                ui.html(f"<h2>{html.escape(card.title)}</h2>", sanitize=False)
                ui.label(f"on {judged['axis']}").classes(f"axis-{judged['axis']}")
                ui.space()
                ui.label("in the model now" if added else word).classes(f"badge {'good' if added else 'add' if passed else ''}")
            with ui.row().style("flex-wrap: nowrap; align-items: flex-start; gap: 14px"):
                ui.label(card.cause).classes("small").style("flex: 1")
                if card.signature is not None:
                    with ui.element("div").style("flex: none"):
                        ui.html(
                            charts.signature_svg(card.signature.dots, card.signature.line, f"signature of {card.title}"),
                            sanitize=False,
                        )
                        ui.label(
                            f"{card.signature.title}: left over (dots), this effect (line)"
                            if card.signature.dots
                            else card.signature.title
                        ).classes("dim small").style("max-width: 220px; font-size: 11px")
            with ui.element("dl").classes("evidence").style("margin: 0"):
                for name, text in evidence(card):
                    ui.html(f"<dt>{html.escape(name)}</dt>", sanitize=False)
                    ui.html(f"<dd>{html.escape(text)}</dd>", sanitize=False)
            with ui.row().classes("tight"):
                if not added:
                    act = partial(self.bench.add, judged["effect"], card.title)
                    button = ui.button("Add to the model", icon="add", on_click=act, color=None)
                    button.props("unelevated no-caps" if passed else "outline no-caps").classes("primary" if passed else "")
                    self.acts.append(button)
                ui.label(card.equation).classes("equation")

    def _formula(self, name: str, formula: str) -> None:
        with ui.element("article").classes("card"):
            with ui.element("div").classes("head"):
                ui.html(f"<h2>{html.escape(name)}</h2>", sanitize=False)
                ui.space()
                ui.label("in the model now").classes("badge good")
            ui.label("An effect of your own:").classes("small")
            ui.label(formula.removeprefix(f"{name}: ")).classes("equation")

    def _unknown(self, found: DiagnosisView) -> None:
        u = found.unknown
        assert u is not None
        with ui.element("article").classes("card add"):
            with ui.element("div").classes("head"):
                ui.html("<h2>A misfit that no effect of the library explains</h2>", sanitize=False)
                ui.label(f"on {u['axis']}").classes(f"axis-{u['axis']}")
            with ui.element("dl").classes("evidence").style("margin: 0"):
                for name, text in (
                    ("it shows against", u["against"].replace("_", " ")),
                    ("shape", u["shape"]),
                    ("size", f"{u['amplitude_dps'] * 1e3:.3g} mdps"),
                ):
                    ui.html(f"<dt>{name}</dt>", sanitize=False)
                    ui.html(f"<dd>{html.escape(text)}</dd>", sanitize=False)
            with ui.row().classes("tight"):
                called = ui.input("name", value="custom").props("outlined dense").style("width: 130px")
                keep = ui.button(
                    "Find a formula and keep it", icon="functions", on_click=lambda: self.bench.keep(called.value), color=None
                )
                keep.props("unelevated no-caps").classes("primary")
                self.acts.append(keep)
            ui.label("or, if you can guess its form, write it down:").classes("small dim")
            with ui.row().classes("tight").style("width: 100%; flex-wrap: nowrap"):
                formula = ui.input(placeholder="mine: k*rate**2").props('outlined dense aria-label="formula"').classes("grow")
                attempt = ui.button("Try and add", on_click=lambda: self._try(formula.value), color=None)
                self.acts.append(attempt.props("outline no-caps"))
            ui.label(
                "Names: rate (true rate), t (time in the run), power_on_s, temp_c, theta (table angle), ax, ay, az. "
                "Whatever else is a parameter to be fitted."
            ).classes("small dim")

    async def _try(self, text: str) -> None:
        if text and text.strip():
            name = text.partition(":")[0].strip() if ":" in text else "formula"
            await self.bench.add(text.strip(), name, text.strip())

    def _rest(self, found: DiagnosisView) -> None:
        looked = [c for c in found.cards if c.judged["decision"] == "reject"]
        blind: dict[str, tuple[Card, list[str]]] = {}
        for c in found.cards:
            if c.judged["decision"] == "not_measurable":
                blind.setdefault(c.judged["effect"], (c, []))[1].append(c.judged["axis"])
        if looked:
            names = dict.fromkeys(c.title for c in looked)
            with ui.expansion(f"Looked for and not found ({len(names)})").classes("face").style("flex: none; padding: 0"):
                ui.label(", ".join(names)).classes("small dim")
        if blind:
            with ui.expansion(f"This recording cannot show ({len(blind)})").classes("face").style("flex: none; padding: 0"):
                for card, axes in blind.values():
                    ui.label(f"{card.title} on {', '.join(axes)}: {card.judged['next_measurement']}").classes("small dim")

    # The model, the fall, the calibration.

    def _model(self) -> None:
        self.model.clear()
        step = self.bench.step
        self.model.set_visibility(step is not None)
        if step is None:
            return
        with self.model, ui.row().classes("tight"):
            ui.label("The model contains").classes("dim")
            for effect, title, removable in step.view.effects:
                if removable:
                    with ui.element("span").classes("badge add"):
                        ui.label(title).style("display: inline")
                        button = ui.button(icon="close", on_click=partial(self.bench.remove, effect, title), color=None)
                        button.props(f'flat round dense size="8px" aria-label="remove {title}"')
                else:
                    ui.label(title).classes("badge")
            ui.space()
            ui.button("Undo", icon="undo", on_click=self.bench.undo, color=None).props("flat dense no-caps").set_enabled(
                len(self.bench.steps) > 1
            )
            ui.button("Redo", icon="redo", on_click=self.bench.redo, color=None).props("flat dense no-caps").set_enabled(
                bool(self.bench.undone)
            )

    def _fall(self) -> None:
        self.fall.clear()
        bars = self.bench.waterfall()
        self.fall.set_visibility(self.bench.step is not None)
        with self.fall:
            if self.bench.step is not None and not bars:
                why = "This recording is too short to hold out a part, so the excess error is unknown."
                if self.bench.step.view.compared["residual"] == "angle":
                    why = "This session is judged by angle, which only the command line shows: gyrocal compare."
                ui.label(why).classes("dim")
            if not bars:
                return
            with ui.row():
                ui.html("<h2>Error beyond the noise</h2>", sanitize=False)
                floor = f"{self.bench.floor_mdps():.2f} mdps"
                ui.label(f"unseen data, over a noise floor of {floor}").classes("dim small")
                if len(bars) > 1 and bars[0].after > 0:
                    gone = 1 - (bars[-1].after / bars[0].after) ** 2
                    ui.label(f"{gone:.1%} of its square explained").classes(f"badge {'good' if gone > 0 else 'bad'}")
            figures = " ".join(f"{b.after:.2f}" for b in bars)
            chart = ui.echart(charts.waterfall(self.tab.palette, bars)).classes("chart grow")
            chart.props(f'role="img" aria-label="excess error, mdps: {figures}"')

    def _calibration(self) -> None:
        self.calibration.clear()
        self.calibration.set_visibility(self.bench.step is not None)
        found = self.bench.calibration
        tall = found is None or bool(found.errors)
        self.calibration.classes(add="grow" if tall else "", remove="" if tall else "grow")
        with self.calibration:
            with ui.row():
                ui.html("<h2>Calibration error</h2>", sanitize=False)
                ui.label("difference between the first 2, 4 and 6 s and the whole recording").classes("dim small")
            if found is None:
                ui.label("Calibrating…" if self.bench.jobs.current else "").classes("dim")
            elif not found.errors:
                ui.label(found.note).classes("dim")
            else:
                ui.echart(charts.calibration(self.tab.palette, found.errors)).classes("chart grow").props(
                    'role="img" aria-label="calibration error against seconds"'
                )


def show(tab: Tab) -> Callable[[Topic], None]:
    return DiagnosePanel(tab).hear
