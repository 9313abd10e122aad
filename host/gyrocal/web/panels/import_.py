"""The import of somebody else's file: columns guessed and shown, corrected by the person, and written as a session."""

from __future__ import annotations

import html
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from gyrocal.errors import InputError
from gyrocal.present.tables import plain
from gyrocal.web.state.on_page import on_page
from gyrocal.web.state.workbench import Topic
from gyrocal.web.widgets import warned
from gyrocal.web.widgets.column_chart import strips
from gyrocal.web.worker.intake import KINDS, Asked, Looked

if TYPE_CHECKING:
    from gyrocal.recording.cut import Cut
    from gyrocal.recording.steady import Stretch
    from gyrocal.web.page import Tab

LARGEST_BYTES = 2 << 30
TABLE, HAND = "table", "hand"
MOTIONS = {TABLE: "on a table, or with a measured rate or angle", HAND: "by hand between rests: gravity is the reference"}
HINTS = {
    TABLE: (
        "The table rate is signed, 0 at rest; leave it out where a column holds the true rate or an angle. Face and "
        "rate may also stand in the file's name, as in s000_down_-78dps.csv."
    ),
    HAND: "It needs all three accelerations, and about fifteen rests of two seconds in different poses.",
}
"""How the sensor moved, and what its file cannot say."""


class ImportPanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench = tab, tab.bench
        self.file: Path | None = None
        self.looked: Looked | None = None
        self.reference: Path | None = None
        """A second file, which holds the true rates."""
        self.cuts: list[Taken] = []
        """The rows of the stretches that the file can be cut into."""
        self.draw: Callable[[], None] = lambda: None
        """Draws the preview in the colours of the page."""
        with ui.element("div").classes("two importing"):
            with ui.element("div").classes("column"):
                self._source()
                self.facts = ui.element("section").classes("face column tight").props('aria-label="facts"')
            self.found = ui.element("section").classes("face column tight").props('aria-label="what it would become"')
        self.facts.set_visibility(False)
        with self.found:
            ui.label("Choose a file. Nothing is written before you have seen what it would become.").classes("dim")

    def _source(self) -> None:
        with ui.element("section").classes("face column tight"):
            ui.html("<h2>1. The file</h2>", sanitize=False)
            files = self.bench.places.files(KINDS)
            self.chosen = ui.select(
                {str(path): self.bench.places.name(path) for path in files}, label=f"a file in {self.bench.places.home}",
                with_input=True, on_change=self._choose,
            ).props("outlined dense")  # fmt: skip
            self.none = ui.label("This folder has no file that can be imported.").classes("dim small")
            self.none.set_visibility(not files)
            _drop("Or drop a file here", "a recording to import", self._uploaded)

    async def _choose(self, event: events.ValueChangeEventArguments) -> None:
        if event.value:
            await self._take(self.bench.places.inside(event.value))

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        await self._take(await self._saved(event, "imports"))

    async def _saved(self, event: events.UploadEventArguments, name: str) -> Path:
        folder = self.bench.scratch / name
        folder.mkdir(exist_ok=True)
        file = folder / (Path(event.file.name).name or "upload")
        await event.file.save(file)
        return file

    async def _take(self, file: Path) -> None:
        self.file, self.reference = file, None
        self.none.set_visibility(False)
        self._facts()
        await self._look(Asked())

    def _facts(self) -> None:
        """What the file cannot say by itself."""
        assert self.file is not None
        self.facts.clear()
        self.facts.set_visibility(True)
        with self.facts:
            ui.html("<h2>2. What the file cannot say</h2>", sanitize=False)
            self.motion = ui.radio(MOTIONS, value=TABLE, on_change=self._moved).props("dense").classes("small")
            with ui.row().classes("tight"):
                self.face = ui.select({"": "not said", "up": "up", "down": "down"}, value="", label="face")
                self.axis = ui.select({"": "guess", "x": "x", "y": "y", "z": "z"}, value="", label="axis")
                self.rate = ui.number("table rate, dps").props("outlined dense").style("width: 140px")
                self.turn = ui.number("known turn, deg").props("outlined dense").style("width: 140px")
                self.sample_rate = ui.number("samples a second").props("outlined dense").style("width: 140px")
                self.lsb = ui.number("one count, dps").props("outlined dense").style("width: 140px")
                self.sensor = ui.input("sensor").props("outlined dense").style("width: 140px")
            for field in (self.face, self.axis):
                field.props("outlined dense").style("width: 110px")
            self.hint = ui.label(HINTS[TABLE]).classes("dim small")
            self.of_table = ui.element("div").classes("column tight")
            with self.of_table:
                self.runs = ui.element("div").classes("column tight").props('role="group" aria-label="runs of the file"')
                self._second_file()
            self._stretches([])
            ui.html("<h2>3. Columns and units</h2>", sanitize=False)
            self.maps = ui.textarea("one mapping a line: target=column:unit").props("outlined dense autogrow")
            self.maps.classes("full-width")
            self.columns = ui.label().classes("dim small")
            ui.button("Look again", icon="refresh", on_click=self._again, color=None).props("outline no-caps")

    def _second_file(self) -> None:
        """The file of a reference: an encoder's, a camera's or a table's own log."""
        files = {str(path): self.bench.places.name(path) for path in self.bench.places.files(KINDS) if path != self.file}
        with ui.element("details").classes("fold"):
            with ui.element("summary"):
                ui.label("The true rate is in a second file")
            chosen = ui.select(files, label="the file of the reference", with_input=True, clearable=True)
            chosen.props("outlined dense").on_value_change(self._referred)
            _drop("Or drop the reference here", "a reference to import", self._reference_uploaded)
            self.referred = ui.label().classes("small")
            self.own_clock = ui.checkbox("it has a clock of its own", on_change=self._again).props("dense").classes("small")

    async def _referred(self, event: events.ValueChangeEventArguments) -> None:
        self.reference = self.bench.places.inside(event.value) if event.value else None
        await self._with_reference()

    async def _reference_uploaded(self, event: events.UploadEventArguments) -> None:
        self.reference = await self._saved(event, "references")
        await self._with_reference()

    async def _with_reference(self) -> None:
        self.referred.text = "" if self.reference is None else f"The reference is {self.reference.name}."
        await self._again()

    def _stretches(self, found: Sequence[Stretch]) -> None:
        """Offer the stretches of even rate as runs; what was said of them stays as long as they are the same."""
        if found and [taken.stretch for taken in self.cuts] == list(found):
            return
        self.runs.clear()
        self.cuts = []
        with self.runs:
            if found:
                ui.label(
                    f"The readings stand at several rates. These {len(found)} stretches can be its runs; say the table's true "
                    "rate of each (0 at rest), or leave it out."
                ).classes("small")
            self.cuts = [Taken(stretch) for stretch in found]

    async def _moved(self) -> None:
        """Show what belongs to this kind of motion, and what the file would become."""
        by_hand = self.motion.value == HAND
        for field in (self.face, self.axis, self.rate, self.turn, self.of_table):
            field.set_visibility(not by_hand)
        self.hint.text = HINTS[self.motion.value]
        await self._again()

    def _asked(self) -> Asked:
        lines = tuple(line.strip() for line in (self.maps.value or "").splitlines() if line.strip())
        guessed = self.looked is not None and lines == tuple(text for text, why in self.looked.maps if why != "as you said")
        asked = Asked(
            () if guessed else lines, self.face.value or None, self.rate.value, self.axis.value or None, self.sample_rate.value,
            self.lsb.value, self.sensor.value or None, turn_deg=self.turn.value, reference=self.reference,
            own_clock=bool(self.own_clock.value), cuts=self._cuts(),
        )  # fmt: skip
        if self.motion.value != HAND:
            return asked
        no_table = replace(asked, face=None, table_rate_dps=None, axis=None, turn_deg=None, cuts=())
        return replace(no_table, reference=None, own_clock=False, gravity=True)

    def _cuts(self) -> tuple[Cut, ...]:
        """The stretches that were ticked; none where a reference or a turn takes the place of their rates."""
        if self.reference is not None or self.turn.value is not None:
            return ()
        return tuple(cut for taken in self.cuts if (cut := taken.cut()) is not None)

    async def _again(self) -> None:
        await self._look(self._asked())

    async def _look(self, asked: Asked) -> None:
        assert self.file is not None
        looked = await self.bench.ask(f"Reading {self.file.name}", "look", self.file, asked)
        if looked is None:
            return
        self.looked = looked
        self.maps.value = "\n".join(text for text, _ in looked.maps)
        self.columns.text = "Columns of the file: " + ", ".join(looked.columns)
        self._stretches(looked.stretches)
        self._show(looked)

    def _show(self, looked: Looked) -> None:
        assert self.file is not None
        self.found.clear()
        with self.found:
            ui.html(f"<h2>What {html.escape(self.file.name)} would become</h2>", sanitize=False)
            if looked.problem:
                with ui.row().classes("tight").style("flex-wrap: nowrap; align-items: baseline"):
                    ui.element("span").classes("light bad")
                    ui.label(on_page(looked.problem.replace(f"{self.file.parent}/", ""))).props('role="status"')
            rows = [[*text.split("=", 1), why] for text, why in (*looked.maps, *looked.of_reference)]
            if rows:
                ui.html(plain(("becomes:", "from:", "why:"), rows), sanitize=False).classes("sideways")
            if looked.problem:
                return
            ui.label(looked.told).props('role="status"')
            warned.show(looked.warnings)
            assert looked.recorded is not None
            self.draw = strips(self.tab, looked.recorded, "Every column over time")
            with ui.row().classes("tight"):
                name = ui.input("folder of the new session", value=self.bench.places.free(self.file.name.split(".")[0]).name)
                name.props("outlined dense")
                ui.button("Import and open", icon="input", on_click=lambda: self._import(name.value), color=None).props(
                    "unelevated no-caps"
                ).classes("primary")

    async def _import(self, name: str) -> None:
        assert self.file is not None
        try:
            out = self.bench.places.new(name or "")
        except InputError as error:
            self.bench.say(str(error))
            return
        done: Any = await self.bench.ask(f"Importing {self.file.name}", "take", self.file, self._asked(), out)
        if done is not None:
            self.tab.go("compare")
            await self.bench.open(out)


class Taken:
    """A stretch of the file that becomes a run if its box is ticked, with the face and the true rate that the person states."""

    def __init__(self, stretch: Stretch) -> None:
        self.stretch = stretch
        said = f"{stretch.start_s:.1f} to {stretch.end_s:.1f} s"
        with ui.row().classes("tight"):
            self._taken = ui.checkbox(f"{said}, reads {stretch.mean_dps:+.2f} dps", value=True).props("dense").classes("small")
            self._face = ui.select(["up", "down"], value=stretch.face).props(f'outlined dense aria-label="face from {said}"')
            self._rate = ui.number("true table rate, dps").props(f'outlined dense aria-label="table rate from {said}"')
            self._rate.style("width: 170px")

    def cut(self) -> Cut | None:
        """The run; None if it is left out."""
        return self.stretch.cut(self._face.value, self._rate.value) if self._taken.value else None


def _drop(words: str, name: str, uploaded: Callable[[events.UploadEventArguments], Awaitable[None]]) -> None:
    """A place where a file can be dropped or chosen."""
    accepted = ",".join(KINDS)
    upload = ui.upload(auto_upload=True, max_files=1, max_file_size=LARGEST_BYTES, on_upload=uploaded)
    with upload.props(f'flat bordered accept="{accepted}"').add_slot("header"), ui.row().classes("tight drop"):
        ui.label(words).classes("grow")
        with ui.element("label").classes("unseen"):
            ui.label(name)
            ui.element("q-uploader-add-trigger")
        choose = ui.button("Choose…", icon="upload_file", color=None).props("outline no-caps dense")
        choose.on("click", js_handler=f"() => getElement({upload.id}).$refs.qRef.pickFiles()")


def show(tab: Tab) -> Callable[[Topic], None]:
    panel = ImportPanel(tab)
    return lambda topic: panel.draw() if topic == "scheme" else None
