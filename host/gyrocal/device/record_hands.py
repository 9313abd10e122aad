"""A recording by hand, without a table: it tells what is still missing, and ends when scale and misalignment are known."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.device.port import Link
from gyrocal.device.record import Recorder, Report, Wanted
from gyrocal.device.run_stream import Ending, HeardRun
from gyrocal.device.wire import Sentence
from gyrocal.errors import DeviceError
from gyrocal.gravity.aims import Aim, Progress, progress
from gyrocal.recording.session import Session

EVERY_S = 1.0
"""Time between two judgements of the recording, s of the device."""


@dataclass
class HandsReport(Report):
    """The result of a recording by hand: also the number of its rests, and how far each axis is."""

    rests: int = 0
    aims: list[Aim] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        return {**super().to_json(), "aims": [aim.to_json() for aim in self.aims]}


class HandsRecorder(Recorder):
    """Writes one run without a rate, and ends it when the aims of :mod:`gyrocal.gravity.aims` are met.

    ``tell`` is given the progress every second, and at last that of the whole recording. ``imu``, ``scenario``, ``day`` and
    ``progress`` are those of :class:`Recorder`. The judgement runs in a thread of its own, so that no sample is lost meanwhile.
    """

    reference = "gravity"

    def __init__(self, link: Link, out: Path, tell: Callable[[Progress], None], **options: Any) -> None:
        super().__init__(link, out, wanted=Wanted("up", np.inf), **options)
        self.report: HandsReport = HandsReport(str(out))
        self._reached: Progress | None = None
        self._tell = tell
        self._judged_s = 0.0
        self._worker = ThreadPoolExecutor(1)
        self._judging: Future[Progress] | None = None

    def record(self) -> Report:
        """Record until the aims are met, the run ends, or Ctrl-C; raises as :meth:`Recorder.record` does."""
        try:
            return super().record()
        finally:
            self._worker.shutdown()
            if self.report.runs:
                self._judged(progress(self._session()))

    def _judged(self, now: Progress) -> None:
        self._reached = now
        self.report.rests, self.report.aims = now.rests, list(now.aims)
        self._tell(now)

    def _digest(self, sentences: list[Sentence]) -> bool:
        return super()._digest(sentences) or self._is_complete()

    def _is_complete(self) -> bool:
        """Judge the recording each second. Returns True once the aims are met."""
        if self._judging is not None and (self._judging.done() or self.link.replays):  # a replay waits for its reader
            judged, self._judging = self._judging.result(), None
            self._judged(judged)
        writer = self._writer
        if writer is not None and writer.is_listed and self._judging is None and writer.run.seconds >= self._judged_s + EVERY_S:
            self._judged_s = writer.run.seconds
            self._judging = self._worker.submit(progress, self._session(), self._reached)
        return self._reached is not None and self._reached.met

    def _session(self) -> Session:
        """The runs of this power cycle so far, as they are on disk."""
        session = Session.open(self._folder.path)
        mine = [run for run in session.runs if run.scenario == self._scenario]
        return session.with_runs(replace(run, frame=run.table) for run in mine)

    def _ended(self, heard: HeardRun) -> bool:
        if self._writer is None:
            return False
        if heard.ending is Ending.RESTART:
            raise DeviceError(f"{self.link.name}: the device restarted during the run; {self._kept()}")
        self._end_run()
        return True
