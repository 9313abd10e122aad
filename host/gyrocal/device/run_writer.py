"""A session folder that grows run by run. Each sample is written at once, and the folder is always a valid session."""

from __future__ import annotations

from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.device.run_stream import GRAVITY_MIN_G, Ending, HeardRun, Setting
from gyrocal.device.wire import Sentence, raw_table
from gyrocal.errors import DeviceError, InputError
from gyrocal.recording.header import FORMAT, read_header, write_header
from gyrocal.recording.session import AXES, GAP_PERIODS

COLUMNS = ("t_s", "gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g", "temp_c")
NAMES = ("up", "down", "unknown")
"""The file name suffix of a run."""
FAST, SLOW = 0.5, 2.0
"""The bounds, in periods, within which a session's reader accepts the median time step."""


def same(a: float | None, b: float | None) -> bool:
    """True if two settings are equal apart from the notation of their numbers."""
    return a is b is None or (a is not None and b is not None and np.isclose(a, b, rtol=1e-6, atol=1e-9).item())


@dataclass
class Recorded:
    """One recorded run. ``face`` and ``axis`` are empty until they are known.

    ``lost`` counts samples that the device sent and that did not arrive, ``missed`` those that it never took (by the times of
    their neighbours), ``repeated`` those that came again. ``before`` counts samples from before the recording, which joined the
    run. More than ``lost`` may be lost if not ``end_known``.
    """

    file: str
    scenario: str
    face: str = ""
    axis: str = ""
    table_rate_dps: float | None = None
    turn_deg: float | None = None
    samples: int = 0
    lost: int = 0
    missed: int = 0
    repeated: int = 0
    seconds: float = 0.0
    before: int = 0
    end_known: bool = True

    @property
    def losses(self) -> str:
        """What is missing, in words."""
        at_least = "" if self.end_known else "at least "
        unknown = "" if self.end_known else " (how many at its end is unknown)"
        before = f", {self.before} before the recording joined it" if self.before else ""
        return f"{at_least}{self.lost} lost on the way{unknown}{before}, {self.missed} missed by the device"


def _write_whole(file: FileIO, text: str) -> None:
    """Append text to a file, or leave the file as it was and raise OSError, for example when the disk is full."""
    data = memoryview(text.encode("ascii"))
    size = file.tell()
    try:
        while data:
            data = data[file.write(data) :]
    except OSError:
        file.truncate(size)
        file.seek(size)
        raise


class SessionFolder:
    """A session that grows run by run. ``session.toml`` is always replaced as a whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._keys: dict[str, Any] = {}
        self._entries: list[dict[str, Any]] = []
        if (path / "session.toml").exists():
            self._keys = read_header(path).model_dump(exclude_none=True)
            self._entries = self._keys.pop("run")
        elif path.exists() and (not path.is_dir() or any(not p.name.endswith("_unknown.csv") for p in path.iterdir())):
            raise InputError(f"{path}: exists already and is no session; choose another name")

    @property
    def axis(self) -> str:
        """The session's axis, x, y or z."""
        return str(self._keys["axis"])

    def settle(self, hello: Sentence, reference: str | None = None) -> None:
        """Give the device's settings to a new session, or check that those of an existing session are the same.

        ``reference`` is ``gravity`` if the runs have no true rate.
        """
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
                "reference": None if reference is None else {"kind": reference},
            }
        elif self._keys["reference"].get("kind") != reference:
            has = "a true rate" if reference else "gravity as the reference"
            raise InputError(f"{self.path}: its runs have {has}, and this one does not; record into a new session")
        elif not same(self._keys["sample_rate_hz"], rate_hz):
            raise InputError(
                f"{self.path}: is at {self._keys['sample_rate_hz']:g} Hz, the device at {rate_hz:g} Hz; "
                "record into a new session"
            )

    def new_number(self) -> int:
        """The number of the next run, for which no file exists."""
        number = len(self._entries)
        while any((self.path / f"{number:03d}_{name}.csv").exists() for name in NAMES):
            number += 1
        return number

    def list(self, entry: dict[str, Any]) -> None:
        """Add a run's file to the session."""
        if entry.get("axis") == self._keys["axis"]:
            entry = {**entry, "axis": None}
        self._entries.append(entry)
        write_header(self.path, self._keys, self._entries)

    def leave_out(self, file: str) -> None:
        """Remove a file from the session. A session without runs is deleted."""
        self._entries = [entry for entry in self._entries if entry["file"] != file]
        if self._entries:
            write_header(self.path, self._keys, self._entries)
        else:
            (self.path / "session.toml").unlink()


class RunWriter:
    """Writes the table of one run as its samples arrive.

    The file is called `NNN_unknown.csv` until the run's setting is known. ``session.toml`` lists it from its second sample on,
    and only while most of its samples are consecutive.
    """

    def __init__(self, folder: SessionFolder, hello: Sentence, scenario: str, day: int | None, heard: HeardRun) -> None:
        lsb = [hello.real(name) for name in ("lsb_dps", "lsb_g", "lsb_c", "zero_c")]
        if None in lsb:
            raise DeviceError("the device does not say the size of its counts; flash it again")
        lsb_dps, lsb_g, lsb_c, self._zero_c = (value or 0.0 for value in lsb)
        self._units = np.array([lsb_dps] * 3 + [lsb_g] * 3 + [lsb_c])
        self._period_us = 1e6 / (hello.real("rate_hz") or np.nan)
        self._folder, self._day, self.heard = folder, day, heard
        self._number = folder.new_number()
        self._setting: Setting | None = None
        self._file: FileIO | None = None
        self._first_us = 0
        self._last_number = self._last_us = 0
        self._even_steps = 0
        self._acc_sum_g = np.zeros(3)
        self._listed = False
        self.run = Recorded("", scenario)
        self._name("unknown")
        if heard.setting is not None:
            self.settle(heard.setting)

    @property
    def path(self) -> Path:
        """The file of the run."""
        return self._folder.path / self.run.file

    @property
    def settled(self) -> bool:
        """True once the settings of the run are known."""
        return self._setting is not None

    @property
    def is_listed(self) -> bool:
        """True once session.toml contains the run."""
        return self._listed

    def settle(self, setting: Setting) -> None:
        """Give the file its name, and add it to the session, now that the run's setting is known."""
        self._setting = setting
        run = self.run
        run.face, run.axis = setting.face, setting.axis
        run.table_rate_dps, run.turn_deg = setting.table_rate_dps, setting.turn_deg
        self._name(setting.face)
        self._list()

    def settle_by_gravity(self) -> bool:
        """Take the face from the mean acceleration along the axis if no sentence gave it. Returns False if it is not clear."""
        settings = self.heard.settings or {}
        axis = settings.get("axis", "")
        along_g = self._acc_sum_g[AXES.index(axis)] / max(self.run.samples, 1) if axis in AXES else 0.0
        if not abs(along_g) > GRAVITY_MIN_G:
            return False
        setting = Setting.of(settings, "up" if along_g > 0 else "down")
        if setting.has_rate:
            self.settle(setting)
        return setting.has_rate

    def write(self, sentences: list[Sentence], until_s: float = np.inf) -> bool:
        """Append ``$RAW`` sentences of this run. Returns True after a sample at or after ``until_s``, which is not written."""
        table = raw_table(sentences)
        if np.isnan(table.counts[:, :3]).any():
            raise DeviceError("a $RAW sentence without rates; is the sensor's driver of this version?")
        if self.run.samples == 0:
            self._first_us = int(table.t_us[0])
        seconds = (table.t_us - self._first_us) * 1e-6
        inside = seconds < until_s - 0.5e-6
        count = len(inside) if inside.all() else int(np.argmin(inside))
        if count:
            values = table.counts[:count] * self._units
            values[:, 6] += self._zero_c
            self._append(seconds[:count], values)
            self._count(table.number[:count], table.t_us[:count], values)
            self._list()
        if count < len(inside):
            missing = int(table.number[count]) - self._last_number - 1
            self._count_behind(missing, (int(table.t_us[count]) - self._last_us) / (missing + 1), until_s)
        return count < len(inside)

    def seconds_sent(self) -> float:
        """The length of the run in seconds, with the samples that the device reported and that did not come."""
        return self.run.seconds + max(self.heard.sent - 1 - self._last_number, 0) * self._period_us * 1e-6

    def end(self, until_s: float = np.inf, *, cut: bool = False) -> None:
        """Close the file. With ``cut``, the run was written up to ``until_s``, and later samples do not count.

        A file of fewer than two samples is removed.
        """
        run, heard = self.run, self.heard
        run.repeated, run.before = heard.repeated, heard.from_number
        run.end_known = cut or heard.is_length_known or heard.ending not in (Ending.UNHEARD, Ending.RESTART)
        if not run.samples:
            run.lost = max(heard.sent - heard.from_number, 0)
        elif not cut:
            self._count_behind(heard.sent - 1 - self._last_number, self._period_us, until_s)
        if self._file is not None:
            self._file.close()
        if run.samples < 2:
            self.path.unlink(missing_ok=True)

    def _name(self, name: str) -> None:
        before = self.path
        self.run.file = f"{self._number:03d}_{name}.csv"
        if self._file is not None and self.path != before:
            self._file.close()
            before.rename(self.path)
            self._file = FileIO(self.path, "a")

    def _append(self, seconds: np.ndarray[Any, Any], values: np.ndarray[Any, Any]) -> None:
        if self._file is None:
            self._folder.path.mkdir(parents=True, exist_ok=True)
            self._file = FileIO(self.path, "w")
            _write_whole(self._file, ",".join(COLUMNS) + "\n")
        lines = []
        for t_s, row in zip(seconds.tolist(), values.tolist(), strict=True):
            cells = ["" if v != v else f"{v:.9g}" for v in row]
            lines.append(f"{t_s:.6f},{','.join(cells)}\n")
        _write_whole(self._file, "".join(lines))

    def _count(self, numbers: np.ndarray[Any, Any], t_us: np.ndarray[Any, Any], values: np.ndarray[Any, Any]) -> None:
        run = self.run
        if run.samples == 0:
            run.lost = int(numbers[0]) - self.heard.from_number
            self._last_number, self._last_us = int(numbers[0]) - 1, int(t_us[0] - self._period_us)
            self._even_steps = -1
        steps = np.diff(numbers, prepend=self._last_number)
        periods = np.diff(t_us, prepend=self._last_us) / self._period_us
        run.samples += len(numbers)
        run.lost += int(np.sum(steps - 1))
        run.missed += int(np.sum(np.where(periods > GAP_PERIODS * steps, np.rint(periods) - steps, 0)))
        run.repeated = self.heard.repeated
        run.seconds = (int(t_us[-1]) - self._first_us) * 1e-6
        self._even_steps += int(np.sum((periods > FAST) & (periods < SLOW)))
        self._acc_sum_g += np.nan_to_num(values[:, 3:6]).sum(axis=0)
        self._last_number, self._last_us = int(numbers[-1]), int(t_us[-1])

    def _count_behind(self, missing: int, step_us: float, until_s: float) -> None:
        """Count samples sent after the last one that came, if they belong to the first ``until_s``."""
        if missing > 0:
            seconds = (self._last_us - self._first_us + step_us * np.arange(1, missing + 1)) * 1e-6
            self.run.lost += int(np.sum(seconds < until_s - 0.5e-6))

    def _list(self) -> None:
        """Update the session's list of runs so that every listed run can be read."""
        can_be_read = self.settled and self.run.samples >= 2 and 2 * self._even_steps > self.run.samples - 1
        if can_be_read and not self._listed:
            self._folder.list(self._entry())
        elif self._listed and not can_be_read:
            self._folder.leave_out(self.run.file)
        self._listed = can_be_read

    def _entry(self) -> dict[str, Any]:
        run = self.run
        return {
            "file": run.file, "scenario": run.scenario, "face": run.face,
            "table_rate_dps": None if run.turn_deg else run.table_rate_dps, "axis": run.axis,
            "turn_deg": run.turn_deg, "day": self._day, "power_on_s": round(self._first_us * 1e-6, 3),
        }  # fmt: skip
