"""From a device's port into a session folder: what was received is on disk at once, gaps stay gaps."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from gyrocal.device.port import Link, PortGone, describe_error
from gyrocal.device.wire import Sentence, parse_real, parse_value, raw_table
from gyrocal.errors import DeviceError, InputError
from gyrocal.recording.session import AXES, FORMAT, GAP_PERIODS, read_header, write_header

COLUMNS = ("t_s", "gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g", "temp_c")
SILENCE_S = 3.0
"""So long without a word, and the device counts as gone."""


@dataclass(frozen=True)
class Wanted:
    """The one run to record: ``table_rate_dps`` signed, about the table; ``turn_deg`` where only the angle is known."""

    face: str
    seconds: float
    table_rate_dps: float | None = None
    turn_deg: float | None = None
    axis: str | None = None

    def fits(self, setting: Setting) -> bool:
        """Whether a run that the device announces is this one."""
        return (
            setting.face == self.face
            and (self.axis is None or setting.axis == self.axis)
            and _same(setting.turn_deg, self.turn_deg)
            and (self.turn_deg is not None or _same(setting.table_rate_dps, self.table_rate_dps))
        )


@dataclass(frozen=True)
class Setting:
    """What the device says of a run."""

    face: str
    axis: str
    table_rate_dps: float | None
    turn_deg: float | None

    @staticmethod
    def of(fields: dict[str, str], face: str) -> Setting:
        axis = fields.get("axis", "")
        if face not in ("up", "down") or axis not in AXES:
            raise DeviceError(f"the device speaks of a run with face {face!r} and axis {axis!r}; flash it again")
        turn_deg, rate_dps = _short(fields.get("turn_deg", "")), _short(fields.get("table_dps", ""))
        return Setting(face, axis, rate_dps, turn_deg or None)


def _short(text: str) -> float | None:
    """A setting; digits beyond a float32's come from a device that keeps it as one."""
    value = parse_real(text)
    return None if value is None else float(f"{value:.7g}")


def _same(a: float | None, b: float | None) -> bool:
    return a is b is None or (a is not None and b is not None and np.isclose(a, b, rtol=1e-6, atol=1e-9).item())


@dataclass
class Recorded:
    """One run that was recorded.

    ``lost``: samples that the device took and that did not arrive; ``missed``: those that it never took, by their times.
    """

    file: str
    scenario: str
    face: str
    axis: str
    table_rate_dps: float | None
    turn_deg: float | None
    samples: int = 0
    lost: int = 0
    missed: int = 0
    seconds: float = 0.0


@dataclass
class Report:
    """What came of a recording; ``results`` and ``errors`` are the ``$CAL`` and ``$ERR`` that came meanwhile."""

    session: str
    runs: list[Recorded] = field(default_factory=list)
    lost_sentences: int = 0
    bad_sentences: int = 0
    results: list[dict[str, Any]] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


class SessionFolder:
    """A session that grows run by run; ``session.toml`` is replaced whole each time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._keys: dict[str, Any] = {}
        self._entries: list[dict[str, Any]] = []
        if (path / "session.toml").exists():
            self._keys = read_header(path).model_dump(exclude_none=True)
            self._entries = self._keys.pop("run")
        elif path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise InputError(f"{path}: is there already and is no session; choose another name")

    def settle(self, hello: Sentence) -> None:
        """Take the device's settings into a new session, or check that an old one is of the same kind."""
        rate_hz = hello.real("rate_hz")
        if rate_hz is None:
            raise DeviceError("the device does not say its rate_hz; flash it again")
        if not self._keys:
            self._keys = {
                "format": FORMAT,
                "sensor": hello.fields.get("sensor"),
                "axis": hello.fields.get("axis") or "z",
                "sample_rate_hz": rate_hz,
                "full_scale_dps": hello.real("full_scale_dps"),
                "lsb_dps": hello.real("lsb_dps"),
            }
        elif not _same(self._keys["sample_rate_hz"], rate_hz):
            raise InputError(
                f"{self.path}: is at {self._keys['sample_rate_hz']:g} Hz, the device at {rate_hz:g} Hz; "
                "record into a new session"
            )

    def new_file(self, face: str) -> Path:
        """A name for the next run's table that is not taken."""
        number = len(self._entries)
        while any((self.path / f"{number:03d}_{f}.csv").exists() for f in ("up", "down")):
            number += 1
        return self.path / f"{number:03d}_{face}.csv"

    def add(self, entry: dict[str, Any]) -> None:
        if entry.get("axis") == self._keys["axis"]:
            entry = {**entry, "axis": None}
        self._entries.append(entry)
        write_header(self.path, self._keys, self._entries)


class RunWriter:
    """One run's table, written as samples arrive. ``session.toml`` names it from its second sample on."""

    def __init__(
        self, folder: SessionFolder, setting: Setting, hello: Sentence, scenario: str, day: int | None
    ) -> None:
        lsb = [hello.real(name) for name in ("lsb_dps", "lsb_g", "lsb_c", "zero_c")]
        if None in lsb:
            raise DeviceError("the device does not say the size of its counts; flash it again")
        lsb_dps, lsb_g, lsb_c, self._zero_c = (value or 0.0 for value in lsb)
        self._units = np.array([lsb_dps] * 3 + [lsb_g] * 3 + [lsb_c])
        self._folder, self._day = folder, day
        folder.path.mkdir(parents=True, exist_ok=True)
        self._path = folder.new_file(setting.face)
        self._file: TextIO = self._path.open("w", encoding="ascii", newline="")
        self._file.write(",".join(COLUMNS) + "\n")
        self._period_us = 1e6 / (hello.real("rate_hz") or np.nan)
        self._first_us: int | None = None
        self._last: tuple[int, int] | None = None
        self.run = Recorded(self._path.name, scenario, **asdict(setting))

    def write(self, sentences: list[Sentence], until_s: float = np.inf) -> bool:
        """Append ``$RAW`` sentences of this run; True once a sample at or after ``until_s`` came, which is left out."""
        if not sentences:
            return False
        table = raw_table(sentences)
        if np.isnan(table.counts[:, :3]).any():
            raise DeviceError("a $RAW sentence without rates; is the sensor's driver of this version?")
        if self._first_us is None:
            self._first_us = int(table.t_us[0])
        seconds = (table.t_us - self._first_us) * 1e-6
        inside = seconds < until_s - 0.5e-6
        count = len(inside) if inside.all() else int(np.argmin(inside))
        values = table.counts * self._units
        values[:, 6] += self._zero_c
        lines = []
        for t_s, row in zip(seconds[:count].tolist(), values[:count].tolist(), strict=True):
            cells = ["" if v != v else f"{v:.9g}" for v in row]
            lines.append(f"{t_s:.6f},{','.join(cells)}\n")
        self._file.writelines(lines)
        self._file.flush()
        self._count(table.number[:count], table.t_us[:count])
        return count < len(inside)

    def _count(self, numbers: np.ndarray[Any, Any], t_us: np.ndarray[Any, Any]) -> None:
        if not len(numbers):
            return
        assert self._first_us is not None
        before = self.run.samples
        self.run.samples += len(numbers)
        last = (int(numbers[0]) - 1, int(t_us[0]) - self._period_us) if self._last is None else self._last
        steps = np.diff(numbers, prepend=last[0])
        periods = np.diff(t_us, prepend=last[1]) / self._period_us
        self.run.lost += int(np.sum(steps - 1))
        self.run.missed += int(np.sum(np.where(periods > GAP_PERIODS * steps, np.rint(periods) - steps, 0)))
        self.run.seconds = (int(t_us[-1]) - self._first_us) * 1e-6
        self._last = int(numbers[-1]), int(t_us[-1])
        if before < 2 <= self.run.samples:
            self._folder.add(self._entry())

    def _entry(self) -> dict[str, Any]:
        assert self._first_us is not None
        run = self.run
        return {
            "file": run.file, "scenario": run.scenario, "face": run.face,
            "table_rate_dps": None if run.turn_deg else run.table_rate_dps, "axis": run.axis,
            "turn_deg": run.turn_deg, "day": self._day, "power_on_s": round(self._first_us * 1e-6, 3),
        }  # fmt: skip

    def close(self) -> None:
        """A file of fewer than two samples is removed."""
        self._file.close()
        if self.run.samples < 2:
            self._path.unlink(missing_ok=True)


class Recorder:
    """Takes a device's sentences apart into runs and writes them.

    Args:
        link: an open conversation with the device.
        out: the session's folder, new or to be added to.
        scenario: of the first run; with ``wanted`` None each restart of the device begins the next one.
        wanted: the one run to record; None: every run that the device announces.
        imu: which sensor's samples to take.
        progress: told after each batch of samples.
    """

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
        self._scenario = scenario
        self._day, self._imu, self._progress = day, imu, progress
        self._writer: RunWriter | None = None
        self._said = ""
        self._hello: Sentence | None = None

    def record(self) -> Report:
        """Record until done.

        Raises:
            DeviceError: the device refused, restarted, went away or fell silent; what came until then is kept.
            InputError: the folder holds something else, or a session at another rate.
        """
        self._hello = self.link.greet()
        self._folder.settle(self._hello)
        try:
            if self._wanted is None or self.link.replays:
                self._join()
            else:
                self._start(self._wanted)
            self._take()
        except KeyboardInterrupt:
            self._stop_device()
        finally:
            self._end_run()
            self.report.lost_sentences = self.link.reader.lost
            self.report.bad_sentences = self.link.reader.bad
        return self.report

    def _start(self, wanted: Wanted) -> None:
        """Set the device up and have it begin."""
        if wanted.axis is not None:
            self.link.command(f"set axis {wanted.axis}")
        rate = "none" if wanted.table_rate_dps is None else f"{wanted.table_rate_dps:.9g}"
        self.link.command(f"set table_dps {rate}")
        self.link.command(f"set turn_deg {wanted.turn_deg or 0.0:.9g}")
        self.link.command("stream raw")
        self.link.command(f"start {wanted.face}")

    def _join(self) -> None:
        """The device begins by itself; a run may be going on already."""
        with contextlib.suppress(PortGone):  # a short replay may be over; all that it said is kept
            self.link.command("stream raw")
            if self._wanted is not None:
                self.link.command("status")

    def _take(self) -> None:
        heard_at = time.monotonic()
        while True:
            try:
                sentences = self.link.receive()
            except PortGone:
                self._check_end()
                return
            now = time.monotonic()
            if any(s.tag == "RAW" and s.imu == self._imu for s in sentences):
                heard_at = now
            elif now - heard_at > SILENCE_S:
                if self._writer is not None:
                    raise DeviceError(f"{self.link.name}: no sample for {SILENCE_S:g} s; {self._kept()}")
                self.link.command("status")
                heard_at = time.monotonic()
            if self._digest(s for s in sentences if s.imu == self._imu):
                self._end_run()
                self._stop_device()
                return

    def _digest(self, sentences: Iterable[Sentence]) -> bool:
        """Handle sentences in order; True when the wanted run is complete."""
        samples: list[Sentence] = []
        for sentence in sentences:
            if sentence.tag == "RAW":
                if self._writer is not None and not sentence.text.startswith("-"):
                    samples.append(sentence)
                continue
            if self._write(samples):
                return True
            samples = []
            if self._event(sentence):
                return True
        return self._write(samples)

    def _write(self, samples: list[Sentence]) -> bool:
        if self._writer is None or not samples:
            return False
        done = self._writer.write(samples, np.inf if self._wanted is None else self._wanted.seconds)
        if self._progress is not None:
            self._progress(self._writer.run)
        return done

    def _event(self, sentence: Sentence) -> bool:
        fields = sentence.fields
        if sentence.tag in ("CAL", "ERR"):
            self._note(sentence)
        elif sentence.tag == "HEL" and sentence.seq == 0:
            if self._writer is not None:
                raise DeviceError(f"{self.link.name}: the device restarted during the run; {self._kept()}")
            self._next_scenario()
        elif sentence.tag == "STA" and fields.get("state") == "recording" and self._writer is None:
            assert self.link.hello is not None
            self._begin(Setting.of(self.link.hello.fields, fields.get("face", "")))
        elif sentence.tag == "RUN" and fields.get("state") == "start" and self._writer is None:
            self._begin(Setting.of(fields, fields.get("face", "")))
        elif sentence.tag == "RUN" and fields.get("state") == "end" and self._writer is not None:
            if self._wanted is None:
                self._end_run()
            elif self._complete_at_end(self._writer.run, self._wanted):
                return True
            else:
                raise DeviceError(f"{self.link.name}: the device ended the run early; {self._kept()}")
        return False

    def _begin(self, setting: Setting) -> None:
        if self._wanted is not None and not self._wanted.fits(setting):
            if self.link.replays:
                return
            raise DeviceError(f"{self.link.name}: the device began another run than was asked for: {setting}")
        if setting.turn_deg is None and setting.table_rate_dps is None:
            raise InputError("the device announces a run whose rate is not known; send it `set table_dps RATE` first")
        self._writer = RunWriter(self._folder, setting, self._settings(), self._scenario, self._day)

    def _settings(self) -> Sentence:
        """The device's settings; asked for again where it has restarted since."""
        if not self.link.answered:
            with contextlib.suppress(PortGone):  # it has ended; all that it said is kept
                self.link.greet()
        if self.link.answered:
            self._hello = self.link.hello
        assert self._hello is not None
        return self._hello

    def _complete_at_end(self, run: Recorded, wanted: Wanted) -> bool:
        """A run that ends with its last sample less than 1.5 periods before the wanted time is whole."""
        assert self._hello is not None
        return run.seconds + 1.5 / (self._hello.real("rate_hz") or 1.0) >= wanted.seconds

    def _next_scenario(self) -> None:
        if self._wanted is None and self.report.runs:
            head = self._scenario.rstrip("0123456789")
            digits = self._scenario[len(head) :] or "0"
            self._scenario = f"{head}{int(digits) + 1:0{len(digits)}d}"

    def _end_run(self) -> None:
        if self._writer is not None:
            self._writer.close()
            if self._writer.run.samples >= 2:
                self.report.runs.append(self._writer.run)
            self._writer = None

    def _check_end(self) -> None:
        """The device is gone: an error unless it had come to its end between two runs."""
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
        """End the run on a device that was told to begin it, and hear what it has to say of it."""
        if self.link.replays or self._wanted is None:
            return
        deadline = time.monotonic() + SILENCE_S
        with contextlib.suppress(DeviceError):  # what was wanted is on disk
            self.link.command("stop")
            while time.monotonic() < deadline:
                for sentence in self.link.receive():
                    self._note(sentence)
                    if sentence.tag == "RUN" and sentence.fields.get("state") == "end":
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
    """What the command line asks for, checked; InputError names the option."""
    if face not in ("up", "down"):
        raise InputError(f"--face {face}: want up or down" if face else "--face is missing: up or down (or --follow)")
    if (rate is None) == (turn_deg is None):
        raise InputError("give --rate (the table's true rate, deg/s) or --turn-deg (the run's net angle), one of them")
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
