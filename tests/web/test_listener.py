"""The process that holds the port: the live view and a recording read the same bytes; unplugging heals."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from device.fake import FakeDevice
from gyrocal.device.record import Wanted
from gyrocal.recording.session import Session
from gyrocal.web.device.live import Live

from .loop import finish

PATIENCE_S = 30.0


async def until(true: Callable[[], Any]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline, "it did not come about"
        await asyncio.sleep(0.02)


def stream(n: int, pause_s: float = 0.0) -> Callable[[FakeDevice], None]:
    def run(fake: FakeDevice) -> None:
        for i in range(n):
            fake.sample(i, 8914 if fake.face == "up" else -8914)
            time.sleep(pause_s)

    return run


def recording(live: Live) -> dict[str, Any]:
    return live.status.get("recording") or {}


def test_both_faces_are_recorded_while_one_watches(tmp_path: Path) -> None:
    async def story(fake: FakeDevice) -> None:
        live = Live(lambda: None)
        live.connect(fake.port)
        try:
            await until(lambda: live.connected and live.sensor(0).get("hello"))
            for face in ("up", "down"):
                live.record(tmp_path / "out", Wanted(face, 0.5, table_rate_dps=78.0), "s000")
                await until(lambda face=face: any(r["face"] == face for r in recording(live).get("done", [])))
                assert recording(live)["error"] == ""
            assert live.status["lost"] == live.status["bad"] == 0
            assert fake.connections == 1
            seen = live.sensors[0].latest(100.0)
            assert abs(seen[0, 3]) == 8914 * 0.00875
        finally:
            live.close()

    with FakeDevice(stream(60)) as fake:
        finish(story(fake))
    session = Session.open(tmp_path / "out")
    assert [(r.face, r.scenario, r.table_rate_dps, len(r)) for r in session.runs] == [
        ("up", "s000", 78.0, 50),
        ("down", "s000", 78.0, 50),
    ]


@pytest.mark.wide
def test_a_cable_pulled_keeps_what_came_and_heals(tmp_path: Path) -> None:
    def pulled(fake: FakeDevice) -> None:
        stream(30 if fake.connections == 1 else 60)(fake)
        if fake.connections == 1:
            fake.unplug()

    async def story(fake: FakeDevice) -> None:
        live = Live(lambda: None)
        live.connect(fake.port)
        try:
            await until(lambda: live.connected and live.sensor(0).get("hello"))
            wanted = Wanted("up", 0.5, table_rate_dps=78.0)
            live.record(tmp_path / "first", wanted, "s000")
            await until(lambda: recording(live).get("error"))
            assert "30 samples" in recording(live)["error"]
            await until(lambda: fake.connections == 2 and live.connected)
            live.record(tmp_path / "second", wanted, "s000")
            await until(lambda: recording(live).get("folder", "").endswith("second") and recording(live)["done"])
        finally:
            live.close()

    with FakeDevice(pulled) as fake:
        finish(story(fake))
    assert len(Session.open(tmp_path / "first").runs[0]) == 30
    assert len(Session.open(tmp_path / "second").runs[0]) == 50


def test_stop_ends_a_recording_early(tmp_path: Path) -> None:
    async def story(fake: FakeDevice) -> None:
        live = Live(lambda: None)
        live.connect(fake.port)
        try:
            await until(lambda: live.connected and live.sensor(0).get("hello"))
            live.record(tmp_path / "out", Wanted("up", 60.0, table_rate_dps=78.0), "s000")
            await until(lambda: (recording(live).get("run") or {}).get("samples", 0) >= 20)
            live.stop()
            await until(lambda: recording(live).get("done"))
            assert "stop" in fake.commands
        finally:
            live.close()

    with FakeDevice(stream(25)) as fake:
        finish(story(fake))
    assert len(Session.open(tmp_path / "out").runs[0]) == 25


def test_a_simulated_device_that_is_given_up_while_it_starts(tmp_path: Path) -> None:
    async def story() -> None:
        live = Live(lambda: None)
        starting = asyncio.create_task(live.simulate(tmp_path / "device", ["--speed", "1"]))
        await asyncio.sleep(0)
        live.disconnect()
        await starting
        assert not live.port
        assert not live.simulated

    finish(story())
