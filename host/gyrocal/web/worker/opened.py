"""The session that the worker holds: read, checked, and written as traces. The engine, which takes longer, is not imported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.inference.blocks import known_dps
from gyrocal.present.decimate import Pyramid
from gyrocal.recording.session import Session
from gyrocal.web.values.views import NOT_NAMED, Recording, RunView, SessionView


class Opened:
    """Holds the current session. Results that are too large to send are written to ``scratch``."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._whole: Session | None = None
        self._used: tuple[Recording, Session] | None = None
        """The session without the runs that are left out."""
        self._number = 0

    def open(self, folder: Path, progress: Callable[[str], None]) -> SessionView:
        """Read and check a session, and write its traces."""
        progress("reading the recordings")
        session = Session.open(folder)
        self._whole, self._used = session, None
        progress("preparing the pictures")
        traces, first, rows = self.room(), self.first_rows(), session.rows
        t_s = np.lib.format.open_memmap(traces / "t_s.npy", "w+", np.float64, (rows,))

        def fill(samples: Any) -> None:
            for run in session.runs:
                at = slice(first[run.index], first[run.index] + len(run))
                t_s[at] = run.t_s - run.t_s[0]
                for axis in range(3):
                    samples[axis, at] = run.gyro_dps[:, axis] - known_dps(run, axis)

        Pyramid.write(traces / "measured", 3, rows, fill)
        runs = [
            RunView(r.file, r.scenario, r.face, r.axis, r.table_rate_dps, r.day, first[r.index], len(r), r.duration_s)
            for r in session.runs
        ]
        return SessionView(folder, session.sensor or NOT_NAMED, session.axis, session.sample_rate_hz, runs, traces)

    def session(self, recording: Recording) -> Session:
        """The session without the runs that are left out. The same recording gives the same object."""
        if self._whole is None or self._whole.path != recording.path:
            self._whole, self._used = Session.open(recording.path), None
        if self._used is None or self._used[0] != recording:
            kept = [run for run in self._whole.runs if run.file not in recording.excluded]
            if not kept:
                raise InputError("every run is excluded; include one at least")
            self._used = (recording, self._whole.with_runs(kept) if recording.excluded else self._whole)
        return self._used[1]

    def first_rows(self) -> dict[int, int]:
        """The first row of each run of the whole session in its traces, by the run's index."""
        assert self._whole is not None
        runs = self._whole.runs
        return dict(zip((run.index for run in runs), np.cumsum([0, *map(len, runs)]).tolist(), strict=False))

    @property
    def rows(self) -> int:
        """Samples of the whole session."""
        return 0 if self._whole is None else self._whole.rows

    def forget(self) -> None:
        """Read the session again when it is asked for, because its files have changed."""
        self._whole = self._used = None

    def room(self) -> Path:
        """A new folder in the scratch folder, which may already contain the folders of an earlier worker."""
        while True:
            self._number += 1
            room = self._scratch / f"{self._number:06d}"
            if not room.exists():
                room.mkdir(parents=True)
                return room
