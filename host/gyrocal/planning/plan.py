"""What to record next: the plan that answers a question with the greatest probability in the given time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.diagnosis.naming.candidate import number_tested
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.planning.columns import Columns, Member
from gyrocal.planning.contest import Contest
from gyrocal.planning.expected import Expected
from gyrocal.planning.precision import Precision
from gyrocal.planning.question import Question, ask, check_one_question
from gyrocal.planning.rig import Cycle, Pose, Rig
from gyrocal.planning.search import Criterion, ToMeasure, ToTellApart, search
from gyrocal.policy import POLICY
from gyrocal.recording.plan_file import PlannedRun, PlannedRuns
from gyrocal.recording.session import Session
from gyrocal.shown import Shown
from gyrocal.threads import one_thread

Progress = Callable[[str], None]
LENGTHS = (0.5, 1.0, 2.5, 6.0)
"""Lengths of a run that are tried, as multiples of the session's own."""
CHAMBER_C = (5.0, 45.0)
"""A usual chamber's range, with which the use of a chamber is estimated, degC."""


@dataclass(frozen=True, repr=False)
class Plan(Shown):
    """The runs to record next, and what they promise.

    ``power`` is the probability that the session with these runs added answers the question, and ``power_same_again`` that with
    the same minutes spent as the session's own runs. ``minutes`` is recorded time; ways between runs and power cycles come on
    top. ``advice`` says what else would be needed; it is empty where the plan is good enough.
    """

    question: Question
    runs: tuple[PlannedRun, ...]
    minutes: float
    power: float
    power_same_again: float
    advice: str = ""
    day: int | None = field(default=None)
    """The label of the runs' group: the next day where the session has days."""

    def to_json(self) -> dict[str, Any]:
        return {
            "question": self.question.to_json(), "runs": [asdict(run) for run in self.runs], "minutes": self.minutes,
            "power": self.power, "power_same_again": self.power_same_again, "why": self.question.why, "advice": self.advice,
        }  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write the runs as a plan that ``simulate --plan`` and ``record --plan`` carry out."""
        PlannedRuns(self.runs, self.day).save(path)


@one_thread
def plan(
    session: Session,
    model: Model | str | Path | None = None,
    *,
    between: Sequence[str] = (),
    measure: str | None = None,
    minutes: float | None = None,
    table_dps: float | None = None,
    chamber_c: tuple[float, float] | None = None,
    progress: Progress | None = None,
) -> Plan:
    """The runs that answer a question best: which of the effects ``between`` acts, or how large the effect ``measure`` is.

    Without a question, the diagnosis of the session asks one. Without ``minutes``, the shortest plan that is good enough is
    sought, up to ``most_plan_minutes`` of recording. ``table_dps`` is the largest rate of the table, the session's own by
    default. ``chamber_c`` is the range of a chamber's air; without one, every run is at the room's temperature.

    Raises InputError for a session that has no constant rates of a table or contradicts itself, and for a question that no run
    answers.
    """
    if minutes is not None and not 0.0 < minutes < np.inf:
        raise InputError(f"--minutes {minutes:g}: want the time to record, a positive number")
    check_one_question(between, measure)
    if session.reference.kind == "gravity":
        raise InputError("plan needs runs of a table; this session is judged by gravity, so turn the sensor more often instead")
    rig = Rig.of(session, table_dps, chamber_c)
    diagnosis = diagnose(session, model, progress=progress)
    if diagnosis.verdict == "implausible":
        raise InputError("plan: the session contradicts itself; run `gyrocal diagnose` and mend what its warnings say first")
    planner = _Planner.of(diagnosis, ask(diagnosis, between, measure), rig, progress)
    found = planner.best(minutes)
    return replace(found, advice=planner.advice(found))


@dataclass(frozen=True)
class _Candidate:
    """A plan under comparison: its cycles in order, the seconds of each run, and its powers."""

    runs: tuple[PlannedRun, ...]
    power: float
    same_again: float

    @property
    def minutes(self) -> float:
        return sum(run.seconds for run in self.runs) / 60


@dataclass(frozen=True)
class _Planner:
    """Everything that a search needs of a session and its question."""

    diagnosis: Diagnosis
    question: Question
    members: list[Member]
    rig: Rig
    expected: Expected
    progress: Progress | None

    @staticmethod
    def of(diagnosis: Diagnosis, question: Question, rig: Rig, progress: Progress | None) -> _Planner:
        expected = Expected.of(diagnosis.comparison.fit.session)
        return _Planner(diagnosis, question, question.members(diagnosis), rig, expected, progress)

    @property
    def session(self) -> Session:
        return self.diagnosis.comparison.fit.session

    def best(self, minutes: float | None) -> Plan:
        """The best plan of these minutes, or the shortest that is good enough."""
        lengths_min = [minutes]
        if minutes is None:
            doublings = round(np.log2(POLICY.most_plan_minutes / POLICY.least_plan_minutes))
            lengths_min = [POLICY.least_plan_minutes * 2**k for k in range(doublings + 1)]
        found: _Candidate | None = None
        for length_min in lengths_min:
            assert length_min is not None
            tried = self.of_minutes(length_min)
            if found is None or tried.power > found.power + 0.01:
                found = tried
            if found.power >= POLICY.enough_power:
                break
        assert found is not None
        day = max(self.session.days) + 1 if self.session.days else None
        return Plan(
            self.question, found.runs, round(found.minutes, 3), round(found.power, 4), round(found.same_again, 4), day=day
        )

    def of_minutes(self, minutes: float) -> _Candidate:
        """The best plan of these minutes over the lengths of a run; the session's own runs again where nothing is better."""
        if self.progress is not None:
            self.progress(f"planning {minutes:g} minutes")
        cycles = list(self.rig.cycles())
        best: _Candidate | None = None
        for seconds in self._lengths_s(minutes):
            criterion = self._criterion(cycles, seconds)
            most_runs = max(1, int(minutes * 60 / seconds + 1e-9))
            chosen = search(criterion, [len(cycle) for cycle in cycles], most_runs)
            power = criterion.power([(k, float(n)) for k, n in chosen.items()])
            if best is None or power > best.power + 1e-6:
                best = _Candidate(self._runs([(cycles[k], n) for k, n in chosen.items()], seconds), power, 0.0)
        assert best is not None
        again = criterion.power(self._same_again(len(cycles), minutes))
        if best.power <= again:
            return _Candidate(self._own_runs(minutes), again, again)
        return replace(best, same_again=criterion.power(self._same_again(len(cycles), best.minutes)))

    def _criterion(self, cycles: Sequence[Cycle], seconds: float) -> Criterion:
        current = Current.of(self.diagnosis.comparison, self.question.axis)
        columns = Columns(current, self.members, self.rig, self.expected, cycles, seconds)
        if self.question.kind == "measure":
            return ToMeasure(Precision.of(columns, self.members[0]))
        tested = max(1, number_tested(self.diagnosis.candidates))
        least = float(tails.chi_square_value(POLICY.name_alarm / tested, 1)) / 2
        everyone = range(len(self.members))
        return ToTellApart([
            [Contest.of(columns, self.members, truth, rival, least) for rival in (None, *everyone) if rival != truth]
            for truth in everyone
        ])  # fmt: skip

    def _lengths_s(self, minutes: float) -> list[float]:
        """Lengths of a run to try, s: multiples of the session's own, at least one run."""
        low, high = POLICY.shortest_planned_s, min(POLICY.longest_planned_s, minutes * 60)
        tried = [float(np.clip(round(self.rig.seconds * times), min(low, high), high)) for times in LENGTHS]
        return list(dict.fromkeys(tried))

    def _same_again(self, first: int, minutes: float) -> list[tuple[int, float]]:
        """The session's own power cycles in turn until the minutes are spent, the last one in part."""
        left_s = minutes * 60
        lengths_s = [sum(run.duration_s for run in runs) for _, runs in self.session.by_scenario()]
        chosen: list[tuple[int, float]] = []
        while left_s > 1e-6:
            for k, length_s in enumerate(lengths_s):
                part = min(1.0, left_s / length_s)
                left_s -= part * length_s
                if part > 0:
                    chosen.append((first + k, part))
        return chosen

    def _runs(self, cycles: Sequence[tuple[Cycle, int]], seconds: float) -> tuple[PlannedRun, ...]:
        """The runs of the chosen power cycles, kinds mixed, so that a part of the plan is a smaller plan."""
        order = sorted(
            ((i + 0.5) / n, k) for k, (_, n) in enumerate(cycles) for i in range(n)
        )  # fmt: skip
        names = _names(self.session, len(order))
        return tuple(
            pose.planned(seconds, name) for name, (_, k) in zip(names, order, strict=True) for pose in cycles[k][0]
        )  # fmt: skip

    def _own_runs(self, minutes: float) -> tuple[PlannedRun, ...]:
        """The session's own runs again, until the minutes are spent."""
        left_s, out = minutes * 60, []
        own = [runs for _, runs in self.session.by_scenario()]
        least_s = 2 / self.session.sample_rate_hz
        names = _names(self.session, 1 + int(left_s / min(sum(r.duration_s for r in runs) for runs in own)) + len(own))
        for k, name in enumerate(names):
            for run in own[k % len(own)]:
                seconds = round(min(run.duration_s, left_s), 3)
                if seconds > least_s:
                    pose = Pose(run.axis, run.face, run.table_rate_dps or 0.0, None)
                    out.append(pose.planned(seconds, name))
                left_s -= seconds
        return tuple(out)

    def advice(self, found: Plan) -> str:
        """What would answer the question better, where a plan is not good enough; empty where it is."""
        if found.power >= POLICY.enough_power:
            return ""
        kinds = [member.effect for member in self.members]
        thermal = [kind.id for kind in kinds if "temp_c" in kind.requires]
        parts = [f"With these runs the answer is not sure: {kind.id} shows in {kind.measure_next}." for kind in kinds[:1]]
        if self.rig.temps_c == (None,) and thermal and self.expected.warming is not None:
            with_chamber = replace(self, rig=replace(self.rig, temps_c=(None, *CHAMBER_C)), progress=None)
            power = with_chamber.of_minutes(found.minutes).power
            if power > found.power + 0.05:
                low, high = CHAMBER_C
                parts.insert(0, f"A chamber would help: with --chamber {low:g}:{high:g} the power is {power:.2f}.")
        if "temp_c" in {name for kind in kinds for name in kind.requires} and self.expected.warming is None:
            parts.insert(0, f"Record the temperature (temp_c): {', '.join(thermal)} cannot be seen without it.")
        return " ".join(parts)


def _names(session: Session, count: int) -> list[str]:
    """Names of new power cycles: the session's highest number goes on."""
    numbers = [int(name[1:]) for name in session.scenarios if name[:1] == "s" and name[1:].isdigit()]
    first = max(numbers, default=len(session.scenarios) - 1) + 1
    return [f"s{first + k:03d}" for k in range(count)]
