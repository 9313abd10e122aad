"""A plan carried out at a device: each planned run is told to a person, waited for, and recorded once."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.device.port import Link, PortGone
from gyrocal.device.record import Recorder, Report, Wanted
from gyrocal.device.run_stream import HeardRun, Rows
from gyrocal.device.run_writer import RunWriter
from gyrocal.device.wire import Sentence
from gyrocal.errors import DeviceError
from gyrocal.recording.plan_file import PlannedRun, PlannedRuns
from gyrocal.recording.session import Session


class PlanRecorder(Recorder):
    """Follows a device and writes the runs of a plan into a session, in their order.

    Runs that the session has already are left out, so a plan that was interrupted goes on. Other runs of the device are not
    recorded. ``tell`` is given what a person should do next. ``imu`` and ``progress`` are those of :class:`Recorder`.
    """

    patience_s = np.inf

    def __init__(self, link: Link, out: Path, plan: PlannedRuns, tell: Callable[[str], None], **options: Any) -> None:
        super().__init__(link, out, wanted=None, day=plan.day, **options)
        there = Session.open(out, check=False).runs if (out / "session.toml").exists() else ()
        self._left = deque(plan.missing_in(there))
        self._total, self._tell = len(plan.runs), tell
        self._last = ""
        """The scenario of this power cycle's last recorded run; empty after a restart."""
        self._passed: list[HeardRun] = []
        self._away = False

    @property
    def left(self) -> list[PlannedRun]:
        """The planned runs that are not recorded yet."""
        return list(self._left)

    def record(self) -> Report:
        """Record until the plan is carried out; raises as :meth:`Recorder.record` does. What came until then is kept."""
        return super().record() if self._left else self.report

    def _join(self) -> None:
        super()._join()
        self._prepare()

    def _prepare(self) -> None:
        """Tell the person the next run, and the device its settings."""
        planned = self._left[0]
        number = self._total - len(self._left) + 1
        self._tell(f"run {number} of {self._total}: {instruction(planned, new_cycle=planned.scenario != self._last)}")
        self._set_device()

    def _set_device(self) -> None:
        if self.link.replays or not self._left:
            return
        planned = self._left[0]
        with contextlib.suppress(PortGone):  # it is being switched off; the settings come again when it is back
            self.link.send(f"set axis {planned.axis}")
            self.link.send(f"set table_dps {planned.table_rate_dps:.9g}")
            self.link.send("set turn_deg 0")
            self.link.send(self.link.stream)

    def _digest(self, sentences: list[Sentence]) -> bool:
        if not self.link.connected:
            if self.link.replays:
                raise DeviceError(f"{self.link.name}: the device has ended, and {len(self._left)} planned runs did not come")
            self._away = True
        elif self._away:
            self._away = False
            self._set_device()
        return super()._digest(sentences)

    def _begin(self, heard: HeardRun) -> None:
        """Begin to write the next planned run; other runs are passed over."""
        if any(heard is passed for passed in self._passed):
            return
        if heard.setting is None:
            self._ask()
            return
        planned = self._left[0]
        if self._last and planned.scenario != self._last:
            self._pass(heard, f"switch the part off and on first: {planned.scenario} is a new power cycle")
        elif not Wanted(planned.face, planned.seconds, planned.table_rate_dps, axis=planned.axis).fits(heard.setting):
            self._pass(heard, f"another run than planned began, and is not recorded; {instruction(planned, new_cycle=False)}")
        else:
            self._scenario, self._until_s = planned.scenario, planned.seconds
            super()._begin(heard)

    def _pass(self, heard: HeardRun, why: str) -> None:
        self._passed.append(heard)
        self._tell(why)

    def _write(self, writer: RunWriter, rows: Rows) -> bool:
        if not super()._write(writer, rows):
            return False
        if not self.link.replays:
            with contextlib.suppress(PortGone):  # what was wanted is on disk
                self.link.send("stop")
        return self._is_last(writer.heard)

    def _ended(self, heard: HeardRun) -> bool:
        writer = self._writer
        if writer is None:
            return False
        planned, period_s = self._left[0], 1.0 / ((self._hello and self._hello.real("rate_hz")) or 1.0)
        self._end_run()
        if writer.seconds_sent() + 1.5 * period_s >= planned.seconds:
            return self._is_last(heard)
        self._pass(heard, f"the run ended after {writer.run.seconds:.1f} s of {planned.seconds:g} s; record it again")
        return False

    def _is_last(self, heard: HeardRun) -> bool:
        """Note that the planned run is recorded, and go on to the next. Returns True after the last one."""
        self._passed.append(heard)
        self._last = self._left.popleft().scenario
        if self._left:
            self._prepare()
        return not self._left

    def _restarted(self) -> None:
        """A new power cycle: the stream and the settings are given again."""
        if self._left and self._left[0].scenario == self._last:
            raise DeviceError(
                f"{self.link.name}: the device restarted within power cycle {self._last}, whose next run is planned; remove "
                f"the runs of {self._last} from session.toml and carry out the plan again"
            )
        self._last = ""
        with contextlib.suppress(PortGone):  # reading says so, once all is read
            self.link.send(self.link.stream)
        self._set_device()


def instruction(run: PlannedRun, *, new_cycle: bool) -> str:
    """What a person does for one run, in words."""
    power = f"new power cycle {run.scenario}: switch the part off and on; " if new_cycle else ""
    air = "" if run.temp_c is None else f", the chamber at {run.temp_c:g} °C and settled"
    table = "at rest" if run.table_rate_dps == 0 else f"the table at {run.table_rate_dps:g} dps"
    return f"{power}axis {run.axis}, face {run.face}, {table}{air}; start the run, it ends after {run.seconds:g} s"
