"""Recording from a device's port into a session folder. Samples are written as they arrive, and gaps remain gaps."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.device.port import Link, PortGone, describe_error
from gyrocal.device.run_stream import Begun, Ended, Ending, HeardRun, Part, Restarted, Rows, RunStream, Setting, Told
from gyrocal.device.run_writer import Recorded, RunWriter, SessionFolder, same
from gyrocal.device.wire import Sentence, parse_value
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.recording.session import AXES
from gyrocal.warning import Warning

SILENCE_S = 3.0
"""Time without a sentence after which the device counts as gone."""


@dataclass(frozen=True)
class Wanted:
    """The one run to record. ``table_rate_dps`` is signed, about the table; ``turn_deg`` is set if only the angle is known."""

    face: str
    seconds: float
    table_rate_dps: float | None = None
    turn_deg: float | None = None
    axis: str | None = None

    def fits(self, setting: Setting) -> bool:
        """True if a run that the device announces is this one."""
        return (
            setting.face == self.face
            and (self.axis is None or setting.axis == self.axis)
            and same(setting.turn_deg, self.turn_deg)
            and (self.turn_deg is not None or same(setting.table_rate_dps, self.table_rate_dps))
        )


@dataclass
class Report:
    """The result of a recording. ``results`` and ``errors`` hold the ``$CAL`` and ``$ERR`` that came during it."""

    session: str
    runs: list[Recorded] = field(default_factory=list)
    warnings: list[Warning] = field(default_factory=list)
    lost_sentences: int = 0
    bad_sentences: int = 0
    results: list[dict[str, Any]] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    def warn(self, code: str, text: str, file: str | None = None) -> None:
        """Add a warning about ``file``, or about all files if it is None."""
        self.warnings.append(Warning(code, None, file, text))


class Recorder:
    """Writes the runs of a device into a session.

    Args:
        link: an open conversation with the device.
        out: the session's folder: a new one, or one to add runs to.
        scenario: the power cycle of the first run; if ``wanted`` is None, each restart of the device begins the next one.
        wanted: the one run to record, or None for every run that comes.
        imu: the number of the sensor whose samples are recorded.
        progress: a function that is called after each batch of samples.

    ``report`` is also valid after an error.
    """

    patience_s = 2 * SILENCE_S
    """Time without a word between runs after which the device counts as gone."""
    reference: str | None = None
    """``gravity`` if the runs have no true rate."""

    def __init__(
        self,
        link: Link,
        out: Path,
        *,
        wanted: Wanted | None,
        scenario: str = "s000",
        day: int | None = None,
        imu: int = 0,
        progress: Callable[[Recorded], None] | None = None,
    ) -> None:
        self.link = link
        self.report = Report(str(out))
        self._folder = SessionFolder(out)
        self._wanted = wanted
        self._until_s = np.inf if wanted is None else wanted.seconds
        self._scenario = scenario
        self._day, self._imu, self._progress = day, imu, progress
        self._stream = RunStream()
        self._writer: RunWriter | None = None
        self._said = ""
        self._hello: Sentence | None = None
        self._heard: set[int] = set()
        self._taking = self._stopped = False

    def record(self) -> Report:
        """Record until the wanted run, or the device, has ended.

        Raises:
            DeviceError: the device refused, restarted, went away or fell silent; the samples until then are kept.
            InputError: the folder holds something else, or a session with another sample rate.
            GyrocalError: the folder cannot be written, for example because the disk is full; whole rows until then are kept.
        """
        self._hello = self.link.greet()
        self._folder.settle(self._hello, self.reference)
        try:
            self._record()
        except OSError as error:
            what = f"{error.filename or self._folder.path}: cannot be written ({error.strerror or error})"
            raise GyrocalError(f"{what}; the samples until then are kept; make room and record the rest") from None
        return self.report

    def _record(self) -> None:
        try:
            if self._wanted is None or self.link.replays:
                self._join()
            else:
                self._start(self._wanted)
            self._take()
        except KeyboardInterrupt:
            self._stop_device()
        except DeviceError as error:
            self.report.warn("device_gone", str(error).removeprefix(f"{self.link.name}: "))
            if self._writer is not None and self._writer.heard.ending is None:
                self._writer.heard.ending = Ending.UNHEARD
            raise
        finally:
            self._end_run()
            self._count_damage()

    @contextlib.contextmanager
    def stopped_by_signals(self) -> Iterator[None]:
        """Let Ctrl-C, SIGTERM and SIGHUP end the recording normally. Before the recording begins they end the program."""

        def stop(*_: object) -> None:
            if not self._taking:
                raise KeyboardInterrupt
            self._stopped = True

        numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
        before = {number: signal.getsignal(number) for number in numbers}
        try:
            for number in numbers:
                if before[number] is not signal.SIG_IGN:  # nohup
                    signal.signal(number, stop)
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _start(self, wanted: Wanted) -> None:
        """Send the settings and start the run."""
        if wanted.axis is not None:
            self.link.command(f"set axis {wanted.axis}")
        rate = "none" if wanted.table_rate_dps is None else f"{wanted.table_rate_dps:.9g}"
        self.link.command(f"set table_dps {rate}")
        self.link.command(f"set turn_deg {wanted.turn_deg or 0.0:.9g}")
        self.link.command(self.link.stream)
        self._leave_behind(self.link.command(f"start {wanted.face}"))

    def _leave_behind(self, answer: Sentence) -> None:
        """Of the sentences before the answer to ``start``, the settings count and no run: another host may have begun one."""
        self._parts(self.link.take_before(answer))
        self._stream.run = None

    def _join(self) -> None:
        """Follow a device that starts its runs by itself; a run may already be in progress."""
        with contextlib.suppress(PortGone):  # a short replay may be over; its sentences are kept
            self.link.command(self.link.stream)
            self.link.send("status")

    def _ask(self) -> None:
        """Ask the device for its settings and for the run in progress, if there is one."""
        with contextlib.suppress(PortGone):  # reading raises the error, once all is read
            self.link.send("hello")
            self.link.send("status")

    def _take(self) -> None:
        self._taking = True
        sampled_at = heard_at = time.monotonic()
        while True:
            if self._stopped:
                raise KeyboardInterrupt
            try:
                sentences = self.link.receive()
            except PortGone:
                self._check_end()
                return
            now = time.monotonic()
            heard_at = now if sentences else heard_at
            if any(s.tag == "RAW" and s.imu == self._imu for s in sentences):
                sampled_at = now
            elif now - sampled_at > SILENCE_S:
                if self._writer is not None:
                    raise DeviceError(f"{self.link.name}: no sample for {SILENCE_S:g} s; {self._kept()}")
                if self._heard and self._imu not in self._heard:
                    there = " or ".join(f"--imu {imu}" for imu in sorted(self._heard))
                    raise DeviceError(f"{self.link.name}: there is no sensor {self._imu}; want {there}")
                if now - heard_at > self.patience_s:
                    raise DeviceError(f"{self.link.name}: no word for {self.patience_s:g} s{self._said}")
                self.link.send("status")
                sampled_at = now
            if self._digest(sentences):
                self._stop_device()
                return

    def _digest(self, sentences: list[Sentence]) -> bool:
        """Handle sentences in order. Returns True when the wanted run is complete."""
        return any(self._handle(part) for part in self._parts(sentences))  # the samples that follow are not wanted

    def _parts(self, sentences: list[Sentence]) -> list[Part]:
        """The events of this sensor's runs in sentences, which are noted."""
        self._heard |= {s.imu for s in sentences}
        mine = [s for s in sentences if s.imu == self._imu]
        for sentence in mine:
            self._note(sentence)
        return self._stream.feed(mine)

    def _handle(self, part: Part) -> bool:
        writer = self._writer
        if isinstance(part, Begun):
            self._begin(part.run)
        elif isinstance(part, Told):
            if writer is None:
                self._begin(part.run)
            elif part.run.setting is not None:
                writer.settle(part.run.setting)
        elif isinstance(part, Rows):
            return writer is not None and self._write(writer, part)
        elif isinstance(part, Ended):
            return self._ended(part.run)
        elif isinstance(part, Restarted):
            self._restarted()
        return False

    def _begin(self, heard: HeardRun) -> None:
        """Begin to write a run. If one run is wanted, no other is written."""
        wanted = self._wanted
        if heard.start is None:
            self._ask()
        if wanted is not None and heard.setting is None:
            if self.link.replays and self.reference is None:
                return  # until its setting is known; without a rate, every run will do
            axis = wanted.axis or self._folder.axis
            heard.setting = Setting(wanted.face, axis, wanted.table_rate_dps, wanted.turn_deg)
            heard.face = wanted.face
        setting = heard.setting
        if wanted is not None and setting is not None and not wanted.fits(setting):
            if self.link.replays:
                return
            raise DeviceError(f"{self.link.name}: the device began another run than was asked for: {setting}")
        if self.reference is None and setting is not None and not setting.has_rate:
            raise InputError("the device announces a run whose rate is not known; send it `set table_dps RATE` first")
        self._writer = RunWriter(self._folder, self._settings(), self._scenario, self._day, heard)

    def _write(self, writer: RunWriter, rows: Rows) -> bool:
        done = writer.write(rows.sentences, self._until_s)
        if self._progress is not None:
            self._progress(writer.run)
        if done:
            self._end_run(cut=True)
        return done

    def _ended(self, heard: HeardRun) -> bool:
        writer, wanted = self._writer, self._wanted
        if writer is None or wanted is None:
            self._end_run()
            return False
        if heard.ending is Ending.RESTART:
            raise DeviceError(f"{self.link.name}: the device restarted during the run; {self._kept()}")
        assert self._hello is not None  # a run that ends less than 1.5 periods before the wanted time is whole
        if writer.seconds_sent() + 1.5 / (self._hello.real("rate_hz") or 1.0) < wanted.seconds:
            raise DeviceError(f"{self.link.name}: the device ended the run early; {self._kept()}")
        self._end_run()
        return True

    def _restarted(self) -> None:
        """Begin the next scenario for a new power cycle, and start the stream again, which a restart ends."""
        if self._wanted is not None:
            return
        if any(run.scenario == self._scenario for run in self.report.runs):
            head = self._scenario.rstrip("0123456789")
            digits = self._scenario[len(head) :] or "0"
            self._scenario = f"{head}{int(digits) + 1:0{len(digits)}d}"
        with contextlib.suppress(PortGone):  # reading raises the error, once all is read
            self.link.send(self.link.stream)

    def _settings(self) -> Sentence:
        """The device's settings. They are requested again if it has restarted since."""
        if not self.link.answered:
            with contextlib.suppress(PortGone):  # the device has ended; its sentences are kept
                self.link.greet()
        if self.link.answered:
            self._hello = self.link.hello
        assert self._hello is not None
        return self._hello

    def _end_run(self, *, cut: bool = False) -> None:
        """Close the run that is being written, and add warnings about its defects."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
        heard = writer.heard
        by_gravity = not writer.settled and writer.settle_by_gravity()
        writer.end(self._until_s, cut=cut)
        run = writer.run
        file = run.file if run.samples >= 2 else None
        if writer.is_listed:
            self.report.runs.append(run)
        elif run.samples >= 2:
            why = "too few of its samples follow each other" if writer.settled else "nothing tells its face and rate"
            self.report.warn("run_unannounced", f"a run of {run.samples} samples is left out of the session: {why}", file)
        if run.lost:
            all_of_them = run.samples + run.lost
            self.report.warn("samples_lost", f"{run.lost} of {all_of_them} samples that were sent did not arrive", file)
        unheard = [
            what
            for what, is_unheard in (
                ("start", heard.start is None),
                ("end", heard.ending in (Ending.UNHEARD, Ending.RESTART)),
            )
            if is_unheard
        ]
        if unheard and (run.samples or run.lost):
            source = "; its face is that of the accelerometer, its rate the last run's: check both" if by_gravity else ""
            self.report.warn("run_unannounced", f"the {' and the '.join(unheard)} of a run did not arrive{source}", file)

    def _count_damage(self) -> None:
        reader, report = self.link.reader, self.report
        report.lost_sentences, report.bad_sentences = reader.lost, reader.bad + reader.overlong
        repeated = sum(run.repeated for run in report.runs)
        if report.bad_sentences:
            advice = "shorten the cable, or check the port's speed"
            report.warn("line_damaged", f"{report.bad_sentences} lines came damaged: {advice}")
        if repeated:
            report.warn("line_damaged", f"{repeated} samples came more than once; each is kept once")

    def _check_end(self) -> None:
        """Raise an error for a device that is gone, unless it ended between two runs."""
        if self._writer is not None:
            raise DeviceError(f"{self.link.name}: the device is gone during the run; {self._kept()}{self._said}")
        if self._wanted is not None:
            wanted = f"face {self._wanted.face}, {self._wanted.table_rate_dps} dps"
            raise DeviceError(f"{self.link.name}: the device ended and no such run came ({wanted}){self._said}")
        if not self.report.runs:
            raise DeviceError(f"{self.link.name}: the device is gone and no run came{self._said}")

    def _kept(self) -> str:
        run = self._writer.run if self._writer is not None else None
        if run is None or run.samples < 2:
            return "nothing is kept of it"
        return f"{run.samples} samples, {run.seconds:.2f} s, are kept in {self._folder.path / run.file}"

    def _stop_device(self) -> None:
        """End the run on a device that began it on command, and read its last sentences."""
        if self.link.replays or self._wanted is None:
            return
        deadline = time.monotonic() + SILENCE_S
        with contextlib.suppress(DeviceError):  # the wanted samples are on disk
            self.link.command("stop")
            while time.monotonic() < deadline:
                sentences = self.link.receive()
                self._digest(sentences)
                if any(s.tag == "RUN" and s.imu == self._imu and s.fields.get("state") == "end" for s in sentences):
                    return

    def _note(self, sentence: Sentence) -> None:
        if sentence.tag == "ERR":
            self._said = f"; the device said: {describe_error(sentence)}"
            self.report.errors.append(describe_error(sentence))
        elif sentence.tag == "CAL":
            self.report.results.append({k: parse_value(v) for k, v in sentence.fields.items()})


def wanted(
    face: str | None, rate: float | None, seconds: float | None, turn_deg: float | None, axis: str | None
) -> Wanted:
    """The run that the command line asks for. Raises InputError, which names the option, if it is contradictory."""
    if face not in ("up", "down"):
        raise InputError(f"--face {face}: want up or down" if face else "--face is missing: up or down (or --follow)")
    if (rate is None) == (turn_deg is None):
        raise InputError("give --rate (the table's true rate, dps) or --turn-deg (the run's net angle), one of them")
    if seconds is None or not 0.0 < seconds < np.inf:
        raise InputError("--seconds: how long to record, a positive number")
    if axis is not None and axis not in AXES:
        raise InputError(f"--axis {axis}: want x, y or z")
    for name, value in (("--rate", rate), ("--turn-deg", turn_deg)):
        if value is not None and not np.isfinite(value):
            raise InputError(f"{name} {value}: want a number")
    if turn_deg == 0.0:
        raise InputError("--turn-deg 0: a run at rest is --rate 0")
    return Wanted(face, seconds, rate, turn_deg, axis)
