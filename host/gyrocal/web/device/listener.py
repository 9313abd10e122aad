"""The process that owns the device's port. It reads, records and passes on samples independently of the page.

A recording uses the recorder of `gyrocal record` on a copy of the bytes that the live view reads.
"""

from __future__ import annotations

import contextlib
import queue
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyrocal.device.monitor import SAMPLE_UNITS, Monitor, Sensor
from gyrocal.device.port import POLL_S, REPLAY_NOTE, Link, Port, PortGone, open_port
from gyrocal.device.record import Recorded, Recorder, Wanted
from gyrocal.errors import DeviceError, GyrocalError

if TYPE_CHECKING:
    from gyrocal.gravity.aims import Progress

RETRY_S = 1.0
STATUS_S = 0.2
ASK_S = 1.0
"""Time between two questions to the device what it waits for."""


@dataclass(frozen=True)
class News:
    """The news since the last call. ``samples`` holds (imu, device time in us, seven values in the order of SAMPLE_UNITS)."""

    samples: list[tuple[Any, ...]]
    events: list[dict[str, Any]]
    status: dict[str, Any] | None = None


@dataclass
class Recording:
    """The progress of a recording."""

    folder: str
    imu: int
    going: bool = True
    run: dict[str, Any] | None = None
    done: list[dict[str, Any]] = field(default_factory=list)
    error: str = ""
    by_hand: bool = False
    hands: dict[str, Any] | None = None
    """Of a recording by hand: the rests so far, whether it is at rest now, the errors with their aims, and the next turn."""


class Tap:
    """A second reader of the same port. ``stop`` makes the next read raise KeyboardInterrupt, as Ctrl-C does."""

    def __init__(self, write: Callable[[bytes], None], first: bytes) -> None:
        self._write = write
        self._chunks: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._stopping = False
        self._chunks.put(first)

    def put(self, chunk: bytes | None) -> None:
        """Pass on bytes that came; None if the device is gone."""
        self._chunks.put(chunk)

    def stop(self) -> None:
        self._stopping = True

    def read(self) -> bytes:
        if self._stopping:
            self._stopping = False
            raise KeyboardInterrupt
        try:
            chunk = self._chunks.get(timeout=POLL_S)
        except queue.Empty:
            return b""
        if chunk is None:
            raise PortGone("the device is gone: unplugged, or it ended")
        return chunk

    def write(self, data: bytes) -> None:
        self._write(data)

    def close(self) -> None:
        self._write = lambda _: None


class Tee:
    """The real port. Its bytes also go to the tap, if there is one."""

    def __init__(self, port: Port, listener: Listener) -> None:
        self._port, self._listener = port, listener

    def read(self) -> bytes:
        tap = self._listener.tap
        try:
            data = self._port.read()
        except PortGone:
            if tap is not None:
                tap.put(None)
            raise
        if tap is not None and data:
            tap.put(data)
        return data

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def close(self) -> None:
        self._port.close()


class Listener:
    """Listens at a port until it is stopped, and reconnects to a device that is plugged in again."""

    def __init__(self, page: Connection, name: str) -> None:
        self.tap: Tap | None = None
        self._page, self._name = page, name
        self._link: Link | None = None
        self._monitor: Monitor | None = None
        self._recording: Recording | None = None
        self._sending = threading.Lock()
        self._told = self._asked = 0.0
        self._problem = ""
        self._ended = False

    def run(self) -> None:
        threading.Thread(target=self._obey, daemon=True).start()
        while not self._ended:
            try:
                with Link(self._name, reconnect=True, opener=lambda n, b: Tee(open_port(n, b), self)) as link:
                    self._link, self._problem = link, ""
                    self._monitor = Monitor(link)
                    self._monitor.run(self._heard)
            except DeviceError as error:
                self._problem = str(error)
                self._send(News([], [], self._status()))
            time.sleep(RETRY_S)

    def _heard(self, events: list[dict[str, Any]]) -> None:
        replays = self._link is not None and self._link.replays  # between its runs it has no readings to replay
        samples = [
            (e["imu"], e["t_us"], *(e[name] for name in SAMPLE_UNITS))
            for e in events if e["event"] == "sample" and not (replays and e["n"] < 0)
        ]  # fmt: skip
        others = [e for e in events if e["event"] not in ("sample", "ack")]
        now = time.monotonic()
        due = now - self._told > STATUS_S or others
        if due:
            self._told = now
        if now - self._asked > ASK_S and self._monitor is not None and self.tap is None:
            self._asked = now
            self._monitor.ask_state()
        if samples or due:
            self._send(News(samples, others, self._status() if due else None))

    def _status(self) -> dict[str, Any]:
        link, monitor = self._link, self._monitor
        if link is None or monitor is None:
            return {"connected": False, "problem": self._problem}
        return {
            "connected": link.connected and not self._problem, "problem": self._problem, "replays": link.replays,
            "sensors": {imu: _sensor_status(monitor.sensors[imu]) for imu in sorted(monitor.sensors)},
            "errors": list(monitor.errors), **monitor.counts(),
            "recording": None if self._recording is None else asdict(self._recording),
        }  # fmt: skip

    def _send(self, news: News) -> None:
        with self._sending, contextlib.suppress(BrokenPipeError, OSError):
            self._page.send(news)

    def _obey(self) -> None:
        try:
            while True:
                word, *rest = self._page.recv()
                if word == "record":
                    self._record(*rest)
                elif word == "stop" and self.tap is not None:
                    self.tap.stop()
                elif word == "say" and self._link is not None:
                    with contextlib.suppress(GyrocalError):
                        self._link.send(rest[0])
        except (EOFError, OSError):  # the page is gone
            self._ended = True
            if self.tap is not None:
                self.tap.stop()
                time.sleep(2 * POLL_S)
            signal.raise_signal(signal.SIGTERM)

    def _record(self, out: str, wanted: Wanted | None, scenario: str, imu: int, by_hand: bool) -> None:
        link = self._link
        if link is None or (self._recording is not None and self._recording.going):
            return
        self._recording = recording = Recording(out, imu, by_hand=by_hand)
        note = f"# {REPLAY_NOTE}\n".encode() if link.replays else b""
        self.tap = tap = Tap(lambda data: link.send(data.decode("ascii").rstrip("\n")), note)

        def work() -> None:
            recorder: Recorder | None = None
            problem = ""
            try:
                with Link(self._name, opener=lambda n, b: tap) as mine:
                    recorder = _recorder(mine, recording, wanted, scenario)
                    recorder.record()
            except (GyrocalError, OSError) as error:
                problem = str(error)
            finally:
                self.tap = None
                recording.done = [] if recorder is None else [asdict(run) for run in recorder.report.runs]
                recording.going, recording.error = False, problem  # who hears of the error may record again
                self._send(News([], [], self._status()))

        threading.Thread(target=work, daemon=True).start()


def _recorder(link: Link, recording: Recording, wanted: Wanted | None, scenario: str) -> Recorder:
    """What records, and tells ``recording`` how far it is."""

    def progress(run: Recorded) -> None:
        recording.run = asdict(run)

    options: dict[str, Any] = {"scenario": scenario, "imu": recording.imu, "progress": progress}
    out = Path(recording.folder)
    if not recording.by_hand:
        return Recorder(link, out, wanted=wanted, **options)
    from gyrocal.device.record_hands import HandsRecorder

    def guide(now: Progress) -> None:
        recording.hands = now.to_json()

    return HandsRecorder(link, out, guide, **options)


def _sensor_status(sensor: Sensor) -> dict[str, Any]:
    return {
        "state": sensor.state, "face": sensor.face, "waits": sensor.waits, "second": sensor.second,
        "run_s": sensor.run_s(), "hello": sensor.hello, "rate_hz": sensor.rate_hz(),
        "missed": sensor.missed, "results": list(sensor.results.values()),
    }  # fmt: skip


def listen(page: Connection, name: str) -> None:
    """The main function of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Listener(page, name).run()
