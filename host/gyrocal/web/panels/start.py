"""The first panel: open a session, import other files, try a simulated session, or plug in a device."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from gyrocal.errors import InputError
from gyrocal.web.device import hidden_effects as hidden
from gyrocal.web.state.places import Listed
from gyrocal.web.state.workbench import Topic

if TYPE_CHECKING:
    from gyrocal.web.page import Tab


def show(tab: Tab) -> Callable[[Topic], None]:
    with ui.element("section").classes("hero"):
        ui.html("<h1>Does your gyroscope's error model fit your recordings?</h1>", sanitize=False)
        ui.label(
            "Open a recording. The page shows how much error is left beyond the noise and where, names the physical effect "
            "that is missing, and lets you add it and watch the error fall."
        ).classes("dim")
        with ui.element("div").classes("ways"):
            with ui.element("section").classes("face").props('aria-label="open a session"'):
                _open(tab)
            with ui.element("div").classes("column"):
                for way in (_try, _plug_in, _import):
                    with ui.element("section").classes("face"):
                        way(tab)
    return lambda topic: None


def _open(tab: Tab) -> None:
    bench = tab.bench

    async def opened(folder: Any) -> None:
        tab.go("compare")
        await bench.open(folder)

    async def typed() -> None:
        try:
            folder = bench.places.session(path.value.strip() or ".")
        except InputError as error:
            bench.say(str(error))
            return
        await opened(folder)

    ui.html("<h2>Open a session</h2>", sanitize=False)
    with ui.row().classes("tight").style("flex-wrap: nowrap; width: 100%"):
        path = ui.input("path of a session's folder", placeholder=str(bench.places.home)).props("outlined dense")
        path.classes("grow").on("keydown.enter", typed)
        ui.button("Open", icon="folder_open", on_click=typed, color=None).props("unelevated no-caps").classes("primary")
    found = bench.places.listed()
    if found:
        ui.label(f"{len(found)} sessions, newest first" if len(found) > 1 else "1 session").classes("dim small")
        with ui.element("div").classes("scroll sessions").props('role="region" aria-label="sessions" tabindex="0"'):
            for one in found:
                with ui.button(on_click=lambda f=one.path: opened(f), color=None).props("flat no-caps align=left dense"):
                    ui.icon("folder").props('aria-hidden="true"')
                    ui.label(one.name).classes("name")
                    ui.label(_words(one)).classes("dim small")
    else:
        ui.label(
            f"There is none in {bench.places.home} yet. A session is a folder with session.toml and one table for each run."
        ).classes("dim small")
    _upload(tab, "a zipped session", ".zip", opened)


def _words(one: Listed) -> str:
    """What a list says of a session."""
    size = f"{one.size_bytes / 1e6:.1f} MB" if one.size_bytes >= 1e5 else f"{one.size_bytes / 1e3:.0f} kB"
    runs = "1 run" if one.runs == 1 else f"{one.runs} runs"
    return ", ".join(text for text in (one.sensor, one.date, runs, size, one.problem) if text)


def _upload(tab: Tab, what: str, accepted: str, opened: Callable[[Any], Any]) -> None:
    """A place to drop a file or to choose one, for the mouse and for the keyboard."""
    bench = tab.bench

    async def uploaded(event: events.UploadEventArguments) -> None:
        archive = bench.scratch / "upload.zip"
        try:
            await event.file.save(archive)
            folder = await asyncio.to_thread(bench.places.unpack, archive, event.file.name)
        except InputError as error:
            bench.say(str(error))
            return
        finally:
            archive.unlink(missing_ok=True)
        await opened(folder)

    upload = ui.upload(auto_upload=True, max_files=1, on_upload=uploaded).props(f'flat bordered accept="{accepted}"')
    with upload.classes("full-width").add_slot("header"), ui.row().classes("tight drop"):
        ui.label(f"Or drop {what} here").classes("grow")
        with ui.element("label").classes("unseen"):
            ui.label(what)
            ui.element("q-uploader-add-trigger")
        choose = ui.button("Choose…", icon="upload_file", color=None).props("outline no-caps dense")
        choose.on("click", js_handler=f"() => getElement({upload.id}).$refs.qRef.pickFiles()")


def _try(tab: Tab) -> None:
    async def simulated() -> None:
        tab.go("compare")
        await tab.bench.simulate([chosen.value] if chosen.value else [])

    async def surprised() -> None:
        tab.go("compare")
        await tab.hunt.begin()

    ui.html("<h2>Try it</h2>", sanitize=False)
    ui.label("A simulated sensor on a turntable, with a hidden effect that its model lacks:").classes("dim small")
    with ui.row().classes("tight"):
        chosen = hidden.menu()
        chosen.classes("grow")
        ui.button("Simulate and look", icon="science", on_click=simulated, color=None).props(
            "unelevated no-caps"
        ).classes("primary").bind_enabled_from(chosen, "value", lambda value: value is not None)
    with ui.row().classes("tight"):
        ui.button("Surprise me", icon="casino", on_click=surprised, color=None).props("outline no-caps")
        ui.label("An effect is chosen at random and kept secret. Find it, then ask for the truth.").classes("dim small grow")


def _plug_in(tab: Tab) -> None:
    ui.html("<h2>Plug in a device</h2>", sanitize=False)
    ports = ui.label("Looking for serial ports…").classes("dim small").style("white-space: pre-line")
    go = ui.button("Go live", icon="sensors", on_click=lambda: tab.go("live"), color=None)
    go.props("unelevated no-caps").classes("primary")

    async def look() -> None:
        found = await asyncio.to_thread(tab.bench.live.ports)
        ports.text = (
            "\n".join(found.values()) if found else
            "No serial device is plugged in. Connect the board by USB, or run the simulated device on the live page."
        )  # fmt: skip

    ui.timer(0, look, once=True)


def _import(tab: Tab) -> None:
    ui.html("<h2>Import another recording</h2>", sanitize=False)
    ui.label("CSV of any columns and units, Parquet, MATLAB, NumPy, ROS bag, MCAP or ULog.").classes("dim small")
    ui.button("Import…", icon="input", on_click=lambda: tab.go("import_"), color=None).props("outline no-caps")
