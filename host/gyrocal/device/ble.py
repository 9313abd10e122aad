"""A board by Bluetooth Low Energy, ``ble://NAME``: the Nordic UART Service, through the package of the extra ``ble``."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from collections.abc import Coroutine
from concurrent.futures import TimeoutError as LateError
from typing import Any

from gyrocal.device.address import BLE, token_of, without_token
from gyrocal.device.port import ANSWER_S, POLL_S, Port, PortGone
from gyrocal.errors import DeviceError
from gyrocal.extras import needed

HEARS, TELLS = (f"6e40000{n}-b5a3-f393-e0a9-e50e24dcca9e" for n in (2, 3))
"""The characteristics of the service, seen from the board: it hears commands and tells sentences."""
SCAN_S = 10.0
PIECE = 20
"""Bytes of a command that every packet holds."""


class BlePort(Port):
    """A port by Bluetooth. An event loop in a thread of its own carries the bytes; the board is given its token first."""

    def __init__(self, name: str) -> None:
        self._bleak = needed("bleak", "ble", without_token(name))
        self.name = without_token(name)
        token = token_of(name)
        self._chunks: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="gyrocal bluetooth", daemon=True)
        self._thread.start()
        self._client: Any = None
        try:
            self._client = self._wait_for(self._open(self.name.removeprefix(f"{BLE}://")), SCAN_S + ANSWER_S)
            self.write(f"token {token}\n".encode("ascii"))
        except BaseException:
            self.close()
            raise

    def read(self) -> bytes:
        try:
            chunk = self._chunks.get(timeout=POLL_S)
        except queue.Empty:
            return b""
        if chunk is None:
            self._chunks.put(None)
            raise PortGone(f"{self.name}: the device is gone: out of reach, switched off, or it closed the connection")
        return chunk

    def write(self, data: bytes) -> None:
        self._wait_for(self._write(data), ANSWER_S)

    def close(self) -> None:
        if self._client is not None:
            with contextlib.suppress(DeviceError):
                self._wait_for(self._client.disconnect(), ANSWER_S)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(ANSWER_S)

    async def _open(self, who: str) -> Any:
        device = await self._bleak.BleakScanner.find_device_by_filter(
            lambda found, _: who.lower() in (str(found.name).lower(), found.address.lower()), timeout=SCAN_S
        )
        if device is None:
            raise DeviceError(
                f"{self.name}: no such device within {SCAN_S:g} s; is it near and on, its firmware built with -DGYROCAL_BLE, "
                "and a token set through the cable (`wifi token`)?"
            )
        client = self._bleak.BleakClient(device, disconnected_callback=lambda _: self._chunks.put(None))
        await client.connect()
        await client.start_notify(TELLS, lambda _, data: self._chunks.put(bytes(data)))
        return client

    async def _write(self, data: bytes) -> None:
        for at in range(0, len(data), PIECE):
            await self._client.write_gatt_char(HEARS, data[at : at + PIECE], response=True)

    def _wait_for(self, work: Coroutine[Any, Any, Any], timeout_s: float) -> Any:
        """The result of a coroutine of the loop. What Bluetooth refuses is a DeviceError; PortGone once it was connected."""
        try:
            return asyncio.run_coroutine_threadsafe(work, self._loop).result(timeout_s)
        except (self._bleak.exc.BleakError, OSError, LateError) as error:
            why = str(error) or type(error).__name__
            if self._client is not None:
                raise PortGone(f"{self.name}: the device is gone ({why})") from None
            raise DeviceError(f"{self.name}: {why}; is Bluetooth of this computer on?") from None
