"""The page around the panels: header, current job, messages to the user."""

from __future__ import annotations

import asyncio
import contextlib
import html
import time
from collections.abc import Awaitable, Callable
from importlib import import_module
from urllib.parse import quote

from nicegui import Client, Event, app, ui

from gyrocal.web.pictures import charts
from gyrocal.web.state.surprise import Hunt
from gyrocal.web.state.workbench import Topic, Workbench

PANELS = {"live": "Live", "compare": "Compare", "diagnose": "Diagnose", "calibrate": "Calibrate & export"}
"""The panels, each a file of ``panels``. They are imported when they are shown, or after the first page is drawn."""
OF_SESSION = ("compare", "diagnose", "calibrate")
"""The panels of a session on a table; one by gravity has a panel of its own in their place."""
TITLES = PANELS | {"import_": "Import"}
DRAWN_S = 1.0
UNDRAWN = """<script>import("%s").then(({default: chart}) => {
    chart.beforeUnmount = function () { this.chart?.dispose(); };
}, () => {})</script>"""
"""NiceGUI's chart is made shortly after its element, and cannot be removed in between without this.

It stands in the head, so that it precedes the page's own import of the chart, and with it every chart."""
LEAVING = """<script>addEventListener("keyup", event => {
    if (event.target.closest?.("[class*='-leave-active']")) event.stopPropagation();
}, true)</script>"""
"""A list that fades out still hears keys, for which Quasar has no element any more."""
SCHEME = """matchMedia("(prefers-color-scheme: dark)").addEventListener(
    "change", () => setTimeout(() => emitEvent("scheme"), 50))"""
"""The system has changed between light and dark; the class of the body follows at once."""
DARK = "gyrocal-dark"
"""The cookie that keeps the choice of light (0) or dark (1) in this browser; without it the page follows the system."""
KEEP_DARK = """document.cookie = `gyrocal-dark=%d; path=/; samesite=strict; max-age=${
    matchMedia("(prefers-color-scheme: dark)").matches === Boolean(%d) ? 0 : 31536000}`"""
"""Keep the choice, unless it is that of the system."""
SKIP = """() => {
    const to = document.querySelector(".content .plots") ?? document.querySelector(".content");
    to.tabIndex = -1;
    to.focus();
}"""
"""The plot of a panel, or else the panel, gets the focus."""
changed: Event[Topic] = Event()
_bench: list[Workbench] = []
_hunts: list[Hunt] = []
_actor: list[str] = [""]
"""The browser tab, by its client's id, whose person acted last."""


def tell(topic: Topic) -> None:
    """Tell all tabs what has changed. Within an event of a tab, its person is the one who acted."""
    if ui.context.slot_stack:
        with contextlib.suppress(RuntimeError):  # the button that was pressed is gone; its tab has navigated, which counted
            _actor[0] = ui.context.client.id
    changed.emit(topic)


def serve(bench: Workbench) -> None:
    """Use this workbench for every tab that opens the page."""
    _bench[:] = [bench]
    _hunts[:] = [Hunt(bench)]


class Tab:
    """One browser tab: the panel that it shows, and its light or dark mode."""

    def __init__(self, view: str, session: str = "") -> None:
        self.bench = _bench[0]
        self.view = view
        self.mine = session
        """The session that this tab was opened for, by its name; another tab may have opened another one since."""
        self._client = ui.context.client.id
        kept = ui.context.client.request.cookies.get(DARK)
        self.dark = kept == "1"
        self._chosen_dark = None if kept is None else self.dark
        self.hunt = _hunts[0]
        self._gravity = self.bench.gravity
        self._update: Callable[[Topic], None] = lambda _: None

    @property
    def palette(self) -> charts.Palette:
        return charts.palette(self.dark)

    def _query(self) -> str:
        """The part of the address that names the session, so that the address opens it again."""
        return f"?session={quote(self.mine)}" if self.mine else ""

    def build(self) -> None:
        ui.add_head_html(UNDRAWN % _chart_module() + LEAVING)
        self._mode = ui.dark_mode(self._chosen_dark)
        with ui.header().classes("top"):
            self._skip = ui.button(color=None).props("flat no-caps dense").classes("skip").on("click", js_handler=SKIP)
            with ui.link(target="/").classes("brand").props('aria-label="gyrocal workbench, start"'):
                ui.html(f'<svg viewBox="0 0 32 32" width="22" height="22" aria-hidden="true">{MARK}</svg>', sanitize=False)
                ui.label("gyrocal")
            with ui.element("nav").classes("views").props('aria-label="panels"'):
                self._buttons = {
                    name: ui.button(title, on_click=lambda n=name: self.go(n), color=None).props("flat no-caps dense")
                    for name, title in PANELS.items()
                }
            ui.space()
            self._name = ui.label().classes("session-name")
            ui.button("Open…", icon="folder_open", on_click=lambda: self.go("start"), color=None).props("flat no-caps dense")
            self._theme = ui.button(icon="contrast", on_click=self._toggle_dark, color=None).props(
                'flat round dense aria-label="light or dark"'
            )
        with ui.row().classes("job") as self._job:
            ui.spinner(size="18px")
            self._job_text = ui.label().props('role="status"')
            ui.button("Stop", icon="stop", on_click=lambda: self.bench.jobs.cancel(), color=None).props("flat dense no-caps")
        self._displaced = ui.element("section").classes("hunt").props('aria-label="another session" role="status"')
        self._hunted = ui.element("section").classes("hunt").props('aria-label="hidden effect"')
        self._content = ui.element("div").classes("content")
        self.go(self.view, push=False)
        self._hear("session")
        self._hear("job")
        changed.subscribe(self._hear)
        ui.timer(0.5, lambda: self._hear("job"))
        ui.timer(0.05, self._ask_dark, once=True)
        ui.on("scheme", self._ask_dark)
        ui.run_javascript(SCHEME)

    def go(self, view: str, *, push: bool = True) -> None:
        """Show a panel."""
        self.view = view
        if push:
            _actor[0] = self._client
            ui.navigate.history.push(address(view) + self._query())
        for name, button in self._buttons.items():
            button.classes(add="on", remove="") if name == view else button.classes(remove="on")
            button.props('aria-current="page"' if name == view else 'aria-current="false"')
        self._skip.text = "Skip to the plot" if view == "compare" else "Skip to the content"
        self._content.clear()
        with self._content:
            if view in TITLES:
                ui.html(f"<h1>{html.escape(TITLES[view])}</h1>", sanitize=False).classes("unseen")
            self._update = _panel("gravity" if self.bench.gravity is not None and view in OF_SESSION else view)(self)
        self._hunt()

    def _hear(self, topic: Topic) -> None:
        bench = self.bench
        if self._content.is_deleted:  # the browser has left, and its page is not yet taken off the list of listeners
            return
        if topic == "job":
            job = bench.jobs.current
            self._job.set_visibility(job is not None)
            if job is not None:
                seconds = time.monotonic() - job.began
                told = f" · {seconds:.0f} s" if seconds >= 1 else ""
                self._job_text.text = f"{job.title}{': ' + job.text if job.text else ''}{told}"
        elif topic == "message":
            with self._content:
                ui.notify(bench.message, position="bottom", timeout=9000, close_button="Close", multi_line=True)
        elif topic == "session":
            opened = bench.session or bench.gravity
            self._name.text = "" if opened is None else bench.places.name(opened.path)
            if opened is not None and (not self.mine or self._client == _actor[0]):
                self._take()
            self._tell_displaced()
            if bench.gravity is not self._gravity:
                self._gravity = bench.gravity
                self.go(self.view, push=False)
        if topic in ("session", "model"):
            self._hunt()
        with self._content:
            self._update(topic)

    def _take(self) -> None:
        """The open session is that of this tab from now on."""
        self.mine = self._name.text
        ui.navigate.history.replace(address(self.view) + self._query())
        self._tell_displaced()

    def _tell_displaced(self) -> None:
        """Say which other session another tab has opened, and how to return."""
        name = self._name.text
        self._displaced.clear()
        self._displaced.set_visibility(bool(name) and name != self.mine)
        if name and name != self.mine:
            with self._displaced:
                ui.label(
                    f"Another tab has opened {name}. The workbench holds one session at a time, so this tab shows it too; "
                    f"the models of {self.mine} are kept."
                )
                back = ui.button(f"Return to {self.mine}", on_click=self._return, color=None)
                back.props("flat dense no-caps")
                ui.button(f"Stay with {name}", on_click=self._take, color=None).props("flat dense no-caps")

    async def _return(self) -> None:
        following = self.bench.open_named(self.mine)
        if following is None:
            self.bench.say(f"{self.mine} cannot be opened now. Open it from the list of sessions.")
        else:
            await following

    def _hunt(self) -> None:
        """The line of a session with a hidden effect: the task, then the truth."""
        secret = self.hunt.secret
        self._hunted.clear()
        self._hunted.set_visibility(secret is not None and self.view in OF_SESSION)
        if secret is None:
            return
        with self._hunted:
            if secret.told:
                ui.label(self.hunt.truth()).props('role="status"')
                ui.button("Another one", on_click=self.hunt.begin, color=None).props("flat dense no-caps")
            else:
                ui.label("An effect is hidden in this session. See where the model fails, find what is missing, and add it.")
                ui.button("Show the truth", on_click=self.hunt.tell, color=None).props("flat dense no-caps")

    async def _ask_dark(self) -> None:
        """Draw the charts for the mode of the page, which follows the system until the user chooses one."""
        with contextlib.suppress(TimeoutError):  # the tab was closed meanwhile
            dark = bool(await ui.run_javascript("document.body.classList.contains('body--dark')", timeout=5.0))
            if self._mode.value is None and dark != self.dark:  # else the user has chosen one while the answer was on its way
                self._set_dark(dark)

    async def _toggle_dark(self) -> None:
        """The choice is kept first: whoever sees the page change may leave it at once."""
        wanted = not self.dark
        with contextlib.suppress(TimeoutError):  # the tab was closed meanwhile
            await ui.run_javascript(KEEP_DARK % (wanted, wanted), timeout=5.0)
        self._mode.value = wanted
        self._set_dark(wanted)

    def _set_dark(self, dark: bool) -> None:
        """Draw the charts of the panel in the colours of the mode; what the user chose on it stays."""
        self.dark = dark
        with self._content:
            self._update("scheme")


MARK = (
    '<circle cx="16" cy="16" r="13" fill="none" stroke="var(--accent)" stroke-width="4"/>'
    '<path d="M16 16 L25 9" stroke="#E69F00" stroke-width="4" stroke-linecap="round"/>'
)


def _chart_module() -> str:
    from nicegui import __version__

    assert ui.echart.component is not None
    return f"/_nicegui/{__version__}/components/{ui.echart.component.key}"


def address(view: str) -> str:
    """The path of a panel's page; the underscore keeps a module's name from being a keyword."""
    return f"/{view.rstrip('_')}"


async def _in_tab(client: Client, following: Awaitable[None]) -> None:
    """Await what a tab has begun, as an event of this tab."""
    with client:
        await following


def _panel(view: str) -> Callable[[Tab], Callable[[Topic], None]]:
    show: Callable[[Tab], Callable[[Topic], None]] = import_module(f"gyrocal.web.panels.{view}").show
    return show


def register() -> None:
    """Register the addresses of the page."""

    def index() -> None:
        bench = _bench[0]
        looking = bench.opening or bench.session is not None or bench.gravity is not None
        Tab("compare" if looking else "live" if bench.live.port else "start").build()

    ui.page("/")(index)

    def at(view: str) -> Callable[[str], None]:
        def shown(session: str = "") -> None:
            places = _bench[0].places
            known = session if session in map(places.name, places.sessions()) else ""
            following = _bench[0].open_named(known) if known else None
            if following is not None:
                opening.append(asyncio.create_task(_in_tab(ui.context.client, following)))
            Tab(view, known).build()

        return shown

    opening: list[asyncio.Task[None]] = []  # a task that nobody holds may be collected

    for view in ("start", *TITLES):
        ui.page(address(view))(at(view))

    async def prepare() -> None:
        """Import what the next panels need, after the first page has been drawn."""
        await asyncio.sleep(DRAWN_S)
        _bench[0].jobs.prepare()
        await asyncio.to_thread(lambda: [_panel(view) for view in PANELS])

    app.on_connect(prepare)
