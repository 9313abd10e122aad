"""The device, live: what it reads, how far the calibration is, what it answers; a recording with one click."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import ui

from gyrocal.device.monitor import doubtful
from gyrocal.errors import InputError
from gyrocal.web.device import hidden_effects as hidden
from gyrocal.web.device.coach import Coach, judged, words
from gyrocal.web.device.guide import Guide
from gyrocal.web.state.workbench import Topic
from gyrocal.web.widgets.chips import chip, press
from gyrocal.web.widgets.readings import Readings

if TYPE_CHECKING:
    from gyrocal.device.record import Wanted
    from gyrocal.web.page import Tab

SPEEDS = {"1": "in real time", "5": "5 times faster", "20": "20 times faster"}
POSES_A_MINUTE = 17
"""How many poses a simulated hand takes in a minute of the device."""


class LivePanel:
    def __init__(self, tab: Tab) -> None:
        self.tab, self.bench, self.live = tab, tab.bench, tab.bench.live
        self.imu = 0
        """The sensor that is shown: the chosen one, otherwise the first one of the board."""
        self._chosen: int | None = None
        self.shown: dict[Callable[[], None], Any] = {}
        """The values that each part was drawn from."""
        self.chips: dict[int, ui.button] = {}
        with ui.element("div").classes("live fill"):
            with ui.element("div").classes("scroll"):
                self.connection = ui.element("section").classes("face column tight").props('aria-label="connection"')
                self.sensors = ui.element("section").classes("face column tight").props('aria-label="sensors of the board"')
                self.recording = ui.element("section").classes("face column tight").props('aria-label="recording"')
            with ui.element("div").classes("column"):
                with ui.element("div").classes("column") as self.at_table:
                    self.coach = Coach(self.live)
                self.guide = Guide(self.live)
                self.readings = Readings(self.live, tab)
        self.hear("device")
        ui.timer(0.25, lambda: self.hear("device"))

    def hear(self, topic: Topic) -> None:
        """Redraw only what has changed, so that no button disappears while it is pressed."""
        if topic == "scheme":
            self.readings.redraw()
        if topic != "device":
            return
        live, status = self.live, self.live.status
        there: dict[int, Any] = status.get("sensors", {})
        if there:
            self._show_sensor(min(there, key=lambda imu: (imu != self._chosen, imu)))
        sensor, going = live.sensor(self.imu), status.get("recording") or {}
        hello = sensor.get("hello") or {}
        states = {imu: self._sensor_words(imu) for imu in there} if len(there) > 1 else {}
        parts: dict[Callable[[], None], Any] = {
            self._connection: (live.port, live.ended, self._state_words(), self._part_words(), self._complaint()),
            self._sensors: (states, self.imu),
            self._recording: (
                self.imu, hello.get("table_dps"), bool(hello), status.get("replays"), live.ended, going.get("going"),
                going.get("folder"),
            ),
        }  # fmt: skip
        for draw, now in parts.items():
            if self.shown.get(draw) != now:
                self.shown[draw] = now
                draw()
        self._figures()
        self.coach.update()
        self.guide.update()
        self.at_table.set_visibility(not self.guide.shown)

    # Connection.

    def _connection(self) -> None:
        self.connection.clear()
        with self.connection:
            with ui.row().classes("tight"):
                ui.html("<h2>Device</h2>", sanitize=False)
                if self.live.port:
                    ui.space()
                    leave = ui.button("Disconnect", icon="link_off", on_click=self.live.disconnect, color=None)
                    leave.props("flat dense no-caps")
            if not self.live.port:
                self._choose()
                return
            with ui.row().style("flex-wrap: nowrap"):
                light = "" if self.live.ended else "good" if self.live.connected else "bad"
                ui.element("span").classes(f"light {light}")
                with ui.element("div"):
                    ui.label(self._state_words()).props('role="status"')
                    if part := self._part_words():
                        ui.label(part).classes("dim small")
            self.counts = ui.label().classes("dim small")
            if complaint := self._complaint():
                ui.label(f"The device reports: {complaint}").classes("worry small")

    def _part_words(self) -> str:
        """The name and the settings of the part; empty before its hello came."""
        hello = self.live.sensor(self.imu).get("hello") or {}
        sensor, rate, scale = (hello.get(name, "?") for name in ("sensor", "rate_hz", "full_scale_dps"))
        return f"{sensor}, {rate} Hz, ±{scale} dps" if hello else ""

    def _complaint(self) -> str:
        """The device's latest error. A misfit is not one; it is shown with the results."""
        errors: list[str] = self.live.status.get("errors", [])
        return next((error for error in reversed(errors) if "misfit (" not in error), "")

    def _state_words(self) -> str:
        if self.live.ended:
            return "The simulated device has played its recording to the end."
        if self.live.connected:
            return f"Connected to {'the simulated device' if self.live.simulated else self.live.port}"
        if self.live.status.get("problem"):
            return str(self.live.status["problem"])
        return (
            "Unplugged: waiting for it to come back" if self.live.status.get("sensors") else f"Listening at {self.live.port}…"
        )

    def _choose(self) -> None:
        ports = self.live.ports()
        port = ui.select(
            ports, value=next(iter(ports), None), label="serial port", with_input=True, new_value_mode="add-unique",
            key_generator=lambda text: text,
        ).props("outlined dense")  # fmt: skip
        if not ports:
            with ui.row().classes("tight"):
                ui.label(
                    "No serial device is plugged in. Connect the board by a USB cable that carries data, then look again; or "
                    "type the name of a port."
                ).classes("dim small")
                again = ui.button("Look again", icon="refresh", on_click=self._look_again, color=None)
                again.props("outline dense no-caps")
        connect = ui.button("Connect", icon="link", on_click=lambda: self._connect(port.value), color=None)
        connect.props("unelevated no-caps").classes("primary" if ports else "")
        ui.separator()
        ui.label("Without a board, run the firmware's own code on this machine:").classes("dim small")
        chosen = hidden.menu()
        speed = ui.select(SPEEDS, value="1", label="speed").props("outlined dense")
        start = ui.button(
            "Start a simulated device", icon="memory", on_click=lambda: self._simulate(chosen.value, speed.value), color=None
        )
        start.props("unelevated no-caps").classes("" if ports else "primary")
        start.bind_enabled_from(chosen, "value", lambda value: value is not None)
        held = ui.button("Start one held in a hand", icon="back_hand", on_click=lambda: self._hold(speed.value), color=None)
        held.props("outline no-caps")

    def _look_again(self) -> None:
        self._connection()
        if not self.live.ports():
            self.bench.say("Still no serial device. Check the cable, and that your user may open ports (group dialout).")

    def _connect(self, port: str | None) -> None:
        try:
            if not port:
                raise InputError("Plug the device in and choose its port.")
            self.live.connect(port.strip())
        except InputError as error:
            self.bench.say(str(error))

    async def _simulate(self, effect: str, speed: str) -> None:
        options = ["--speed", speed, *(["--effect", effect] if effect else [])]
        ui.notify("Starting the simulated device…", timeout=2000)
        try:
            await self.live.simulate(self.bench.scratch / "device", options)
        except InputError as error:
            self.bench.say(str(error))

    async def _hold(self, speed: str) -> None:
        """A simulated device whose sensor a hand turns from pose to pose, for a minute longer than a recording needs."""
        from gyrocal.simulation.hands import POSES
        from gyrocal.simulation.simulate import simulate

        ui.notify("Starting the simulated device…", timeout=2000)
        folder = Path(tempfile.mkdtemp(prefix="held", dir=self.bench.scratch)) / "session"
        await asyncio.to_thread(simulate, folder, "hands", scenarios=POSES + round(POSES_A_MINUTE * float(speed)))
        try:
            await self.live.simulate(self.bench.scratch / "device", ["--session", str(folder), "--speed", speed])
        except InputError as error:
            self.bench.say(str(error))

    def _figures(self) -> None:
        status = self.live.status
        if self.live.port and "good" in status:
            lost, bad = status["lost"], status["bad"]
            sensor = self.live.sensor(self.imu)
            missed = f", {sensor['missed']} not read in time" if sensor.get("missed") else ""
            rate = sample_rate(sensor, replays=bool(status.get("replays")))
            if status.get("replays") and not self.live.ended and sensor.get("state") in ("idle", "flip"):
                rate += ", without readings until it turns"
            self.counts.text = f"{rate}, {lost} lost, {bad} damaged, {status['restarts']} restarts{missed}"
            going = status.get("recording") or {}
            if going.get("going"):
                self._tell_progress(going, sensor)
            self.counts.classes(add="worry" if lost or bad else "", remove="" if lost or bad else "worry")

    # Which of its sensors.

    def _sensors(self) -> None:
        """The sensors of a board with several, each with its state. The user chooses the one that is shown."""
        there = sorted(self.live.status.get("sensors", {}))
        self.sensors.set_visibility(len(there) > 1)
        if there != list(self.chips):
            self.sensors.clear()
            with self.sensors:
                ui.html("<h2>Sensors of this board</h2>", sanitize=False)
                self.chips = {i: chip("", partial(self._look_at, i)) for i in there}
        for imu, button in self.chips.items():
            button.text = f"sensor {imu}: {self._sensor_words(imu)}"
            press(button, imu == self.imu)

    def _sensor_words(self, imu: int) -> str:
        sensor = self.live.sensor(imu)
        fit = ""
        if sensor.get("results"):
            fit = ", not trusted" if any(map(doubtful, judged(sensor["results"]))) else ", trusted"
        return words(sensor) + fit

    def _look_at(self, imu: int) -> None:
        self._chosen = imu
        self.hear("device")

    def _show_sensor(self, imu: int) -> None:
        if imu != self.imu:
            self.imu = imu
            self.readings.show(imu)
            self.coach.show(imu)

    # Recording.

    def _recording(self) -> None:
        self.recording.clear()
        status, hello = self.live.status, self.live.sensor(self.imu).get("hello")
        going = status.get("recording") or {}
        self.recording.set_visibility(bool(hello) and (bool(going) or not self.live.ended))
        if not hello or not self.recording.visible:
            return
        with self.recording:
            of = f" of sensor {self.imu}" if len(self.chips) > 1 else ""
            ui.html(f"<h2>Record a session{of}</h2>", sanitize=False)
            if going.get("going"):
                self._progress()
                return
            if going:
                self._recorded(going)
            if self.live.ended:
                return
            name = ui.input("folder", value=self._folder(going)).props("outlined dense").classes("full-width")
            if status.get("replays"):
                button = ui.button(
                    "Record", icon="fiber_manual_record", on_click=lambda: self._start(name.value, None), color=None
                )
                button.props("unelevated no-caps").classes("primary")
                self._by_hand(name)
                return
            rate = ui.number("table rate, dps", value=_number(hello.get("table_dps"), 78.0)).props("outlined dense")
            seconds = ui.number("seconds", value=30, min=1).props("outlined dense")
            with ui.row().classes("tight"):
                for face in ("up", "down"):
                    ui.button(
                        f"Record face {face}", icon="fiber_manual_record", color=None,
                        on_click=lambda f=face: self._start(name.value, (f, rate.value, seconds.value)),
                    ).props("unelevated no-caps").classes("primary")  # fmt: skip
            self._by_hand(name)

    def _by_hand(self, name: ui.input) -> None:
        """The way without a table."""
        ui.separator()
        ui.label("Without a table: turn the sensor by hand from pose to pose. The page says which turn is missing.").classes(
            "dim small"
        )
        ui.button(
            "Record by hand", icon="back_hand", on_click=lambda: self._start(name.value, None, by_hand=True), color=None
        ).props("outline no-caps")

    def _progress(self) -> None:
        with ui.row().classes("tight").style("flex-wrap: nowrap"):
            self.lamp = ui.element("span").classes("light")
            self.progress = ui.label("Waiting for a run of the device.").classes("small")
        ui.button("Stop recording", icon="stop", on_click=self.live.stop, color=None).props("outline dense no-caps")

    def _tell_progress(self, going: dict[str, Any], sensor: dict[str, Any]) -> None:
        """What is being written, or what the recorder waits for."""
        run = going.get("run")
        writes = run is not None and sensor.get("state") == "recording"
        self.lamp.classes(add="rec" if writes else "", remove="" if writes else "rec")
        told = "" if run is None else f"{run['file']}: {run['seconds']:.1f} s, {run['samples']} samples, {run['lost']} lost"
        if writes:
            self.progress.text = f"Writing {told}"
        else:
            until = "the next run of the device begins" if self.live.status.get("replays") else "the device begins its run"
            self.progress.text = f"{told}. " * bool(told) + f"Nothing is written until {until}."

    def _recorded(self, going: dict[str, Any]) -> None:
        runs = going.get("done") or []
        if going.get("error"):
            ui.label(going["error"]).classes("worry small")
        if runs:
            seconds = sum(run["seconds"] for run in runs)
            counted = "1 recording" if len(runs) == 1 else f"{len(runs)} recordings"
            where = self.bench.places.name(self._path(going))
            ui.label(f"{counted}, {seconds:.0f} s, {'is' if len(runs) == 1 else 'are'} in {where}.")
            ui.button("Does the model fit it?", icon="insights", on_click=lambda: self._open(going), color=None).props(
                "unelevated no-caps"
            ).classes("primary")

    def _path(self, going: dict[str, Any]) -> Any:
        return self.bench.places.inside(going["folder"])

    async def _open(self, going: dict[str, Any]) -> None:
        self.tab.go("compare")
        await self.bench.open(going["folder"])

    def _folder(self, going: dict[str, Any]) -> str:
        if going and not self.live.status.get("replays"):
            return self.bench.places.name(self._path(going))
        return self.bench.places.free("recorded").name

    def _start(self, name: str, run: tuple[str, float, float] | None, *, by_hand: bool = False) -> None:
        from gyrocal.device.record import wanted

        try:
            folder = self.bench.places.inside(name or "")
            if not (folder / "session.toml").is_file():
                folder = self.bench.places.new(name or "")
            what = None if run is None else wanted(run[0], run[1], run[2], None, None)
            self.live.record(folder, what, _scenario(folder, what, by_hand), self.imu, by_hand=by_hand)
        except InputError as error:
            self.bench.say(str(error))


def _number(text: Any, otherwise: float) -> float:
    try:
        return float(text)
    except (TypeError, ValueError):
        return otherwise


def _scenario(folder: Any, run: Wanted | None, by_hand: bool) -> str:
    """The power cycle of a new run: the last one, or a new one if the last one already has such a run; by hand, the last."""
    from gyrocal.recording.header import read_header

    if not (folder / "session.toml").is_file():
        return "s000"
    entries = read_header(folder).run
    last = entries[-1].scenario
    if by_hand or (run is not None and not any(e.scenario == last and e.face == run.face for e in entries)):
        return last
    return f"s{len({e.scenario for e in entries}):03d}"


FASTER = 1.3
"""Times by which a replay must be faster than its own clock, so that it is told."""


def sample_rate(sensor: dict[str, Any], *, replays: bool) -> str:
    """How many samples a second arrive; a replay can send those of more seconds of its own time in each."""
    arriving, own = float(sensor.get("rate_hz", 0.0)), (sensor.get("hello") or {}).get("rate_hz")
    try:
        nominal = float(own or 0.0)
    except ValueError:
        nominal = 0.0
    if replays and nominal and arriving > FASTER * nominal:
        return f"{nominal:g} samples a second of its own time, which runs {arriving / nominal:.1f} times as fast"
    return f"{arriving:.0f} samples a second"


def show(tab: Tab) -> Callable[[Topic], None]:
    return LivePanel(tab).hear
