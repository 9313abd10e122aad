"""The large picture of an effect: before it is added, while it is subtracted, and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.web.pictures import charts
from gyrocal.web.values.models import Step, latest
from gyrocal.web.values.views import Card, Picture
from gyrocal.web.widgets.tools import named, tools
from gyrocal.web.worker.effect_picture import left_now, of_each_run

if TYPE_CHECKING:
    from gyrocal.web.page import Tab

COPY = """async () => {
    const chart = getElement(%d)?.chart;
    if (!chart) return;  // another picture has taken its place
    const colour = getComputedStyle(document.body).getPropertyValue("--face").trim();
    const url = chart.getDataURL({pixelRatio: 2, backgroundColor: colour});
    const bytes = Uint8Array.from(atob(url.split(",")[1]), c => c.charCodeAt(0));
    const picture = new Blob([bytes], {type: "image/png"});
    try {
        await navigator.clipboard.write([new ClipboardItem({"image/png": picture})]);
        emitEvent("picture_copied", true);
    } catch (refused) {
        emitEvent("picture_copied", false);
    }
}"""


class HeroView:
    """The chart and its buttons. It stays in the page while the model changes, so that the change is seen."""

    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        self._chosen: Card | None = None
        self._drawn: Picture | None = None
        self.frame = ui.element("div").classes("face drawn hero-picture over")
        with self.frame:
            bar = ui.element("div").classes("tools")
            self.image = ui.element("div").classes("chart grow").props("role=img")
            with self.image:
                self.chart = ui.echart(charts.base(tab.palette, series=[])).classes("chart")
            with bar:
                copy = ui.button("Copy as image", icon="content_copy", color=None).props("flat dense no-caps")
                copy.on("click", js_handler=COPY % self.chart.id)
                tools(self.chart, lambda: named(self.bench, "effect"))
        ui.on("picture_copied", lambda e: self._copied(bool(e.args)))

    def choose(self, card: Card) -> None:
        """Show the picture of another card."""
        self._chosen = card
        self.draw()

    def draw(self) -> None:
        """Draw the chosen card, else the first one, else the effect that was added last.

        A first card without a picture, as a tone has none, leaves the place empty: another effect's would stand for it.
        """
        diagnosis, step = self.bench.diagnosis, latest(self.bench.steps)
        cards = [] if diagnosis is None else diagnosis.named
        card = self._chosen if self._chosen in cards else next(iter(cards), None)
        card = card if card is not None and card.picture is not None else None
        shown = None if step is None or cards else self._still_there(step)
        self.frame.set_visibility(card is not None or shown is not None)
        if step is not None and shown is not None:
            assert self.bench.traces is not None
            flat = [0.0] * len(shown.centres)
            words = self._words(step.title, shown, step.recipe.cards[0].equation, added=True)
            self._show(shown, left_now(shown, self.bench.traces.points), flat, words, added=True)
        elif card is not None:
            assert card.picture is not None
            hint = " (a hint, not enough to be sure)" if card.judged["decision"] == "suggest" else ""
            words = self._words(f"{card.title}{hint}", card.picture, card.equation, added=False)
            self._show(card.picture, card.picture.left, card.picture.curve, words)

    def _still_there(self, step: Step) -> Picture | None:
        """The picture of an effect that was added, unless the recordings do not hold what it shows any more."""
        chosen = None if self._chosen is None else self._chosen.picture
        shown = chosen if chosen in [card.picture for card in step.recipe.cards] else step.recipe.picture
        session, files = self.bench.session, []
        if session is not None:
            files = [run.file for run in session.runs if run.file not in self.bench.excluded]
        if shown is None or shown.view not in self.bench.steps[-1].view.against:
            return None
        if shown.run is None or (shown.file in files and session is not None and session.runs[shown.run].file == shown.file):
            return shown
        return None

    def _words(self, title: str, shown: Picture, equation: str, *, added: bool) -> list[str]:
        """What stands above the picture, and goes with it where it is copied to."""
        fall, session = self.bench.fall(), self.bench.session
        assert session is not None
        state = ", in the model now" if added else ""
        lines = [f"{title} on {shown.axis}{state}", f"{session.sensor} · {equation}"]
        where = "all recordings" if shown.run is None else f"{shown.file}, about its mean"
        if fall is not None:
            step = latest(self.bench.steps) if added else None
            bar = fall.bars[-1 if step is None else self.bench.steps.index(step)]
            how = " within power cycles" if fall.within else ""
            figures = f"{fall.told(bar.before)} → {fall.told(bar.after)}" if added else fall.told(bar.after)
            lines.append(f"excess error{how} {figures} {fall.unit.name} {fall.over_axes}")
        return [*lines, where + f", without {shown.beside}" * bool(shown.beside)]

    def _show(
        self, shown: Picture, left: list[float], curve: list[float], words: list[str], *, added: bool = False
    ) -> None:  # fmt: skip
        each = [] if self.bench.traces is None or shown.beside else of_each_run(shown, self.bench.traces.points)
        options: dict[str, Any] = charts.hero(self.tab.palette, shown, left, curve, words, each, added=added)
        self.image.props(f"aria-label={charts.words(words)}")
        fresh = "false" if shown == self._drawn else "true"
        self._drawn = shown
        self.chart.options.update(options)  # a chart that the browser has not made yet begins with them
        self.chart.run_chart_method(":setOption", charts.script(options), f"({{notMerge: {fresh}}})")

    def _copied(self, done: bool) -> None:
        with self.frame:
            ui.notify("The picture is in the clipboard." if done else "The browser gives no access to the clipboard; save it.")
