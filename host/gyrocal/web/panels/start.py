"""The first panel: open a session, try a simulated one, or plug in a device."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from gyrocal.errors import InputError
from gyrocal.web import hidden
from gyrocal.web.state import Topic

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
            _open(tab)
            _try(tab)
            _plug_in(tab)
    return lambda topic: None


def _open(tab: Tab) -> None:
    bench = tab.bench

    async def opened(folder: Any) -> None:
        tab.go("compare")
        await bench.open(folder)

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

    with ui.element("section").classes("face"):
        ui.html("<h2>Open a session</h2>", sanitize=False)
        with ui.element("div").classes("scroll list").style("max-height: 300px"):
            found = bench.places.sessions()
            for folder in found:
                name = bench.places.name(folder)
                ui.button(name, icon="folder", on_click=lambda f=folder: opened(f), color=None).props(
                    "flat no-caps align=left dense"
                )
            if not found:
                ui.label(
                    f"None in {bench.places.home} yet. A session is a folder with session.toml and one table for each run."
                ).classes("dim small")
        ui.upload(label="or drop a zipped session here", auto_upload=True, max_files=1, on_upload=uploaded).props(
            'flat bordered accept=".zip"'
        ).classes("full-width")


def _try(tab: Tab) -> None:
    async def simulated() -> None:
        tab.go("compare")
        await tab.bench.simulate([chosen.value] if chosen.value else [])

    with ui.element("section").classes("face"):
        ui.html("<h2>Try it</h2>", sanitize=False)
        ui.label(
            "A simulated sensor on a turntable, with a hidden effect that its model lacks:"
        ).classes("dim small")
        chosen = hidden.menu()
        ui.button("Simulate and look", icon="science", on_click=simulated, color=None).props(
            "unelevated no-caps"
        ).classes("primary").bind_enabled_from(chosen, "value", lambda value: value is not None)


def _plug_in(tab: Tab) -> None:
    with ui.element("section").classes("face"):
        ui.html("<h2>Plug in a device</h2>", sanitize=False)
        ui.label("Watch it live, calibrate it face up and face down, and record it. There is also a simulated device.").classes(
            "dim small"
        )
        ui.button("Go live", icon="sensors", on_click=lambda: tab.go("live"), color=None).props(
            "unelevated no-caps"
        ).classes("primary")
