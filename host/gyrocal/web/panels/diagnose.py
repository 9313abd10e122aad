"""What is missing: ranked cards, Add, and the excess error falling."""

from __future__ import annotations

import asyncio
import html
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from gyrocal.present.report import BLOCKED
from gyrocal.web import charts, warned
from gyrocal.web.fall_chart import waterfall
from gyrocal.web.formula_card import formula_card
from gyrocal.web.held import parameters
from gyrocal.web.hero_view import HeroView
from gyrocal.web.models import Step, latest
from gyrocal.web.side_by_side import side_by_side
from gyrocal.web.small_picture import signature_svg
from gyrocal.web.state import Topic
from gyrocal.web.tools import named, tools
from gyrocal.web.views import Card, DiagnosisView, Picture
from gyrocal.web.words import CALIBRATION_ERROR, evidence, held_by_hand, no_picture, not_yet, small_excess, symbols

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
                self.hero = HeroView(tab)
                self.fall = ui.element("div").classes("face drawn")
                self.calibration = ui.element("div").classes("face drawn")
        for draw in (self._cards, self._model, self.hero.draw, self._fall, self._calibration):
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
                    ui.label(not_yet(self.bench)).classes("big")
                    if self.bench.session is None and not self.bench.opening:
                        ui.button("Open one", on_click=lambda: self.tab.go("start"), color=None).props("flat no-caps")
                return
            warned.show(self.bench.step.view.compared["warnings"], self.bench)
            if found is None:
                self._invite()
                self._added()
                self._any()
                return
            self._sentence(found)
            if found.verdict == "unknown":
                self.acts += formula_card(self.bench, found)
            shown = [c for c in found.cards if c.judged["decision"] in ("add", "suggest")]
            for card in shown:
                self._card(card)
            self._rest(found)
            self._any()

    def _invite(self) -> None:
        assert self.bench.step is not None
        compared = self.bench.step.view.compared
        fits, judged = compared["verdict"] == "adequate", compared["verdict"] != "implausible"
        fall = self.bench.fall()
        with ui.element("div").classes(f"face verdict {'good' if fits else 'bad'}").style("flex: none"), ui.element("div"):
            verdict = "The model fits: what is left over is noise." if fits else "The model does not fit yet."
            ui.label(verdict if judged else BLOCKED).classes("big")
            if fall is not None and fall.sentence:
                ui.label(fall.sentence)
            if fits:
                self._small()
            else:
                self._held()
            if self._in_doubt():
                ui.label(f"Not proven: {', '.join(self._in_doubt())}.").classes("worry")
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
            if found.verdict != "adequate":
                self._held()

    def _small(self) -> None:
        """Why an excess that differs from zero is no misfit."""
        assert self.bench.step is not None
        text = small_excess(self.bench.step.view.compared["per_axis"])
        if text:
            ui.label(text).classes("small")

    def _held(self) -> None:
        """The parameters that were held by hand, which may be what does not fit."""
        assert self.bench.step is not None
        text = held_by_hand(self.bench.step.view.holdable)
        if text:
            ui.label(text).classes("worry")

    def _added(self) -> None:
        """The candidate that was added last, as the diagnosis found it."""
        step, found = latest(self.bench.steps), self.bench.diagnosed
        if step is None:
            return
        every = [c for c in ([] if found is None else found.cards) if c.judged["effect"] == step.effect]
        cards = [c for c in every if c.judged["decision"] in ("add", "suggest") and c.judged["axis"] in step.axes]
        for card in cards:
            self._card(card, added=True)
        others = {c.judged["axis"] for c in every if c.judged["decision"] == "add"} - step.axes
        if others:
            ui.label(
                f"It is not in the model on {', '.join(sorted(others))}, where it is not certain for itself beside the rest."
            ).classes("small")
        if not cards:
            self._by_hand(step)

    def _in_doubt(self) -> list[str]:
        """Titles of the effects in the model that were not proven when they were added."""
        return [title for title, doubts in self._doubts().values() if doubts]

    def _doubts(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """The title of each effect that the steps have added, and what speaks against it."""
        out: dict[str, tuple[str, tuple[str, ...]]] = {}
        for step in self.bench.steps:
            if step.removed:
                out.pop(step.effect, None)
            elif step.effect:
                out[step.id] = (step.title, step.recipe.doubts)
        return out

    def _card(self, card: Card, *, added: bool = False) -> None:
        judged = card.judged
        passed = judged["decision"] == "add"
        alone = passed and not card.looks_like
        proven = not card.doubts
        word = "proven" if alone else "one of several" if passed else "a hint, not enough to be sure"
        with ui.element("article").classes(f"card {'add' if passed and not added else ''}"):
            with ui.element("div").classes("head"):
                ui.html(f"<h2>{html.escape(card.title)}</h2>", sanitize=False)
                ui.label(f"on {judged['axis']}").classes(f"axis-{judged['axis']}")
                ui.space()
                if added:
                    word = "in the model now" if proven else "in the model, not proven"
                ui.label(word).classes(f"badge {('good' if proven else 'bad') if added else 'add' if passed else ''}")
            with ui.element("div").classes("evidenced"):
                ui.label(card.cause).classes("small")
                if card.picture is not None:
                    self._thumbnail(card, card.picture)
            if card.picture is None:
                ui.label(no_picture(card.equation)).classes("dim small")
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
            if symbols(card.equation):
                ui.label(symbols(card.equation)).classes("dim small")

    def _thumbnail(self, card: Card, shown: Picture) -> None:
        """The picture of the effect in small. A press shows it in full."""
        assert card.signature is not None
        words = f"picture of {card.title} on {shown.axis}"
        band = [(x, y - 2 * se, y + 2 * se) for x, y, se in zip(shown.centres, shown.curve, shown.se, strict=True)]
        with ui.element("div").style("flex: none"):
            button = ui.element("button").classes("thumbnail").props(f'type="button" aria-label="{words}, in full"')
            with button.on("click", lambda: self.hero.choose(card)):
                small = signature_svg(card.signature.dots, card.signature.line, words, band, few=card.signature.few)
                ui.html(small, sanitize=False)
            ui.label(f"left over (dots) and effect (line) {card.signature.title}").classes("dim small").style(
                "max-width: 220px; font-size: 11px"
            )

    def _by_hand(self, step: Step) -> None:
        """An effect that was added without a card of the diagnosis."""
        proven = not step.recipe.doubts
        with ui.element("article").classes("card"):
            with ui.element("div").classes("head"):
                ui.html(f"<h2>{html.escape(step.title)}</h2>", sanitize=False)
                ui.label(f"on {', '.join(sorted(step.axes))}")
                ui.space()
                word = "in the model now" if proven else "in the model, not proven"
                ui.label(word).classes(f"badge {'good' if proven else 'bad'}")
            for doubt in step.recipe.doubts:
                ui.label(f"In doubt: {doubt}.").classes("small")
            fall = self.bench.fall()
            if fall is not None:
                before, after = fall.told(fall.bars[-1].before), fall.told(fall.bars[-1].after)
                ui.label(f"With it, the excess error went from {before} to {after} {fall.unit.name}.")
            if step.formula:
                ui.label(step.formula.removeprefix(f"{step.title}: ")).classes("equation")

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

    def _any(self) -> None:
        """A list of all effects of the library, of which any can be tried."""
        with ui.element("div").classes("face").style("flex: none"), ui.row().classes("tight"):
            ui.label("Try any effect:").classes("small")
            chosen = ui.select({}, label="effect").props("outlined dense options-dense").style("width: 260px")

            async def attempt() -> None:
                if chosen.value is not None:
                    await self.bench.add(chosen.value, titles[chosen.value])

            button = ui.button("Try it", color=None, on_click=attempt)
            self.acts.append(button.props("outline no-caps"))

        titles: dict[str, str] = {}

        async def fill() -> None:
            titles.update(await asyncio.to_thread(_titles))
            chosen.set_options(titles)

        with chosen:
            ui.timer(0, fill, once=True)

    # The model, the fall, the calibration.

    def _model(self) -> None:
        self.model.clear()
        step = self.bench.step
        self.model.set_visibility(step is not None)
        if step is None:
            return
        with self.model, ui.row().classes("tight"):
            ui.label("The model contains").classes("dim")
            doubts = self._doubts()
            for effect, title, removable in step.view.effects:
                if removable:
                    doubted = effect in doubts and bool(doubts[effect][1])
                    with ui.element("span").classes(f"badge {'bad' if doubted else 'add'}"):
                        ui.label(f"{title}, not proven" if doubted else title).style("display: inline")
                        button = ui.button(icon="close", on_click=partial(self.bench.remove, effect, title), color=None)
                        button.props(f'flat round dense size="8px" aria-label="remove {title}"')
                else:
                    ui.label(title).classes("badge")
            ui.space()
            with ui.row().classes("tight").style("flex-wrap: nowrap"):
                undo = ui.button("Undo", icon="undo", on_click=self.bench.undo, color=None).props("flat dense no-caps")
                undo.set_enabled(len(self.bench.steps) > 1)
                redo = ui.button("Redo", icon="redo", on_click=self.bench.redo, color=None).props("flat dense no-caps")
                redo.set_enabled(bool(self.bench.undone))
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
                        "This session is judged by the angles of its runs, so no excess of a rate stands here; "
                        "the command line tells the angles: gyrocal compare."
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
                ui.label(found.note).classes("dim")
            else:
                chart = ui.echart(charts.calibration(self.tab.palette, found.errors)).classes("chart grow")
                chart.props('role="img" aria-label="calibration error against seconds"')
                with bar:
                    tools(chart, lambda: named(self.bench, "calibration_error"))


def _titles() -> dict[str, str]:
    """The titles of all effects that can be fitted, by id."""
    from gyrocal.effects.base import effects

    kinds = [kind for kind in effects().values() if kind.parameters and kind.role is None]
    return {kind.id: kind.title for kind in sorted(kinds, key=lambda kind: kind.title)}


def show(tab: Tab) -> Callable[[Topic], None]:
    return DiagnosePanel(tab).hear
