"""What is missing: ranked cards, Add, and the excess error falling."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from gyrocal.present.report import BLOCKED
from gyrocal.present.verdict import left_over
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.excess_chart import waterfall
from gyrocal.web.pictures.words import CALIBRATION_ERROR, held_by_hand
from gyrocal.web.state.on_page import on_page
from gyrocal.web.state.workbench import Topic
from gyrocal.web.values.models import doubts_of, latest
from gyrocal.web.values.story import as_added
from gyrocal.web.values.views import DiagnosisView
from gyrocal.web.widgets import warned
from gyrocal.web.widgets.cards import by_hand, effect_card, grouped, not_found, together
from gyrocal.web.widgets.effect_view import HeroView
from gyrocal.web.widgets.explain_all import explain_all
from gyrocal.web.widgets.formula_card import formula_card
from gyrocal.web.widgets.held_parameters import parameters
from gyrocal.web.widgets.side_by_side import side_by_side
from gyrocal.web.widgets.tools import named, tools
from gyrocal.web.widgets.try_any import try_any

if TYPE_CHECKING:
    from gyrocal.web.page import Tab


class DiagnosePanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        self.acts: list[ui.button] = []
        """The buttons that start a search; they are disabled during one."""
        self.acts_on_model: list[ui.button] = []
        with ui.element("div").classes("two fill"):
            self.cards = ui.element("section").classes("scroll").props('aria-label="what is missing" tabindex=0')
            with ui.element("section").classes("scroll").props('aria-label="the model and its error" tabindex=0'):
                self.model = ui.element("div").classes("face")
                self.fall = ui.element("div").classes("face drawn")
                self.hero = HeroView(tab)
                self.calibration = ui.element("div").classes("face drawn")
        for draw in (self._cards, self._model, self._fall, self.hero.draw, self._calibration):
            draw()

    def hear(self, topic: Topic) -> None:
        if topic == "job":
            self._allow()
        if topic in ("session", "model", "diagnosis"):
            self._cards()
            self.hero.draw()
        if topic in ("session", "model"):
            self._model()
            self._fall()
        if topic in ("session", "model", "calibration", "scheme"):
            self._calibration()
        if topic == "scheme":
            self.hero.draw()
            self._fall()

    def _allow(self) -> None:
        for button in (*self.acts, *self.acts_on_model):
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
                    ui.label(self.bench.not_yet).classes("big")
                    if self.bench.session is None and not self.bench.opening:
                        ui.button("Open one", on_click=lambda: self.tab.go("start"), color=None).props("flat no-caps")
                return
            warned.show(self.bench.step.view.compared["warnings"], self.bench)
            if found is None:
                self._invite()
                self._added()
                self.acts += try_any(self.bench)
                return
            self._sentence(found)
            if found.verdict == "unknown":
                self.acts += formula_card(self.bench, found)
            for cards in grouped(found.named):
                self.acts += effect_card(self.bench, cards, self.hero.choose)
            together(found)
            not_found(found)
            self.acts += try_any(self.bench)

    def _invite(self) -> None:
        assert self.bench.step is not None
        compared = self.bench.step.view.compared
        fits, judged = compared["verdict"] == "adequate", compared["verdict"] != "implausible"
        fall = self.bench.fall()
        with ui.element("div").classes(f"face verdict {'good' if fits else 'bad'}").style("flex: none"), ui.element("div"):
            verdict = left_over(compared, "The model is adequate") if fits else "The model does not fit yet."
            ui.label(verdict if judged else on_page(BLOCKED)).classes("big")
            if fall is not None and fall.sentence:
                ui.label(fall.sentence)
            if not fits:
                self._held()
            if self._in_doubt():
                ui.label(f"Not proven: {', '.join(self._in_doubt())}.").classes("worry")
            with ui.row().style("margin-top: 8px"):
                if not fits and judged:
                    self._explain()
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
        with ui.element("div").classes(f"face verdict {tone}").style("flex: none"), ui.element("div").classes("column tight"):
            ui.label(on_page(found.sentence)).classes("big").style("font-size: 16px")
            if found.verdict != "adequate":
                self._held()
            if any(card.judged["decision"] == "add" and not card.doubts for card in found.cards):
                self._explain()

    def _explain(self) -> None:
        """The button that adds every effect that is certain, and looks again after each."""
        button = ui.button("Add all that is certain", icon="playlist_add", color=None)
        button.style("align-self: flex-start")
        self.acts.append(button.props("outline no-caps").on_click(partial(explain_all, self.bench)))

    def _held(self) -> None:
        """The parameters that were held by hand, which may be what does not fit."""
        assert self.bench.step is not None
        text = held_by_hand(self.bench.step.view.holdable)
        if text:
            ui.label(text).classes("worry")

    def _added(self) -> None:
        """The candidate that was added last, as the diagnosis found it."""
        step = latest(self.bench.steps)
        if step is None:
            return
        before = self.bench.steps[self.bench.steps.index(step) - 1]
        cards = [as_added(card, before, step) for card in step.recipe.cards if card.judged["axis"] in step.axes]
        for group in grouped(cards):
            effect_card(self.bench, group, self.hero.choose, added=True)
        others = {c.judged["axis"] for c in step.recipe.cards if c.judged["decision"] == "add"} - step.axes
        if others:
            ui.label(
                f"It is not in the model on {', '.join(sorted(others))}, where it is not certain beside the other effects."
            ).classes("small")
        if not cards:
            by_hand(self.bench, step)

    def _in_doubt(self) -> list[str]:
        """Titles of the effects in the model that were not proven when they were added."""
        return [title for title, doubts in doubts_of(self.bench.steps).values() if doubts]

    # The model, the fall, the calibration.

    def _model(self) -> None:
        self.model.clear()
        step = self.bench.step
        self.model.set_visibility(step is not None)
        if step is None:
            return
        with self.model, ui.row().classes("tight"):
            ui.label("The model contains").classes("dim")
            doubts = doubts_of(self.bench.steps)
            for effect, title, removable in step.view.effects:
                if removable:
                    doubted = effect in doubts and bool(doubts[effect][1])
                    with ui.element("span").classes(f"badge {'bad' if doubted else 'add'}"):
                        ui.label(f"{title}, not proven" if doubted else title).style("display: inline")
                        button = ui.button(icon="close", on_click=partial(self.bench.remove, effect, title), color=None)
                        button.props(f'flat round dense size="sm" aria-label="remove {title}"')
                else:
                    ui.label(title).classes("badge")
        with self.model:
            self.acts_on_model = parameters(self.bench)
            side_by_side(self.bench)
        self._allow()

    def _fall(self) -> None:
        self.fall.clear()
        found = self.bench.fall()
        self.fall.set_visibility(self.bench.step is not None)
        with self.fall:
            if self.bench.step is not None and found is None:
                why = "This recording is too short to hold out a part, so the excess error is unknown."
                if self.bench.step.view.compared["residual"] == "angle":
                    why = (
                        "This session is judged by the angles of its runs, which Compare tells, so no excess of a rate stands "
                        "here."
                    )
                ui.label(why).classes("dim")
            if found is None:
                return
            with ui.row().classes("tight"):
                ui.html("<h2>Error beyond the noise</h2>", sanitize=False)
                if len(found.bars) > 1:
                    first, last = found.bars[0].after, found.bars[-1].after
                    tone = "good" if last < first else "bad"
                    told = f"{found.told(first)} → {found.told(last)} {found.unit.name} rms"
                    ui.label(told).classes(f"badge {tone}")
                if found.part is not None:
                    ui.label(found.part_told).classes("dim small")
                bar = ui.element("div").classes("tools")
            ui.label(f"excess, {found.counted}").classes("dim small")
            if found.in_all:
                ui.label(found.in_all).classes("dim small")
            figures = " ".join(found.told(b.after) for b in found.bars)
            chart = ui.echart(waterfall(self.tab.palette, found.bars, found.unit)).classes("chart grow")
            chart.props(f'role="img" aria-label="excess error, {found.unit.name}: {figures}"')
            with bar:
                tools(chart, lambda: named(self.bench, "excess"))

    def _calibration(self) -> None:
        self.calibration.clear()
        self.calibration.set_visibility(self.bench.step is not None)
        found = self.bench.calibration
        tall = found is not None and bool(found.errors)
        self.calibration.classes(add="" if tall else "short", remove="short" if tall else "")
        with self.calibration:
            with ui.row().classes("tight"):
                ui.html("<h2>Calibration error</h2>", sanitize=False)
                bar = ui.element("div").classes("tools")
            ui.label(CALIBRATION_ERROR).classes("dim small")
            if found is None:
                ui.label("Calibrating…" if self.bench.jobs.current else "").classes("dim")
            elif not found.errors:
                ui.label(on_page(found.note)).classes("dim")
            else:
                chart = ui.echart(charts.calibration(self.tab.palette, found.errors)).classes("chart grow")
                chart.props('role="img" aria-label="calibration error against seconds"')
                with bar:
                    tools(chart, lambda: named(self.bench, "calibration_error"))


def show(tab: Tab) -> Callable[[Topic], None]:
    return DiagnosePanel(tab).hear
