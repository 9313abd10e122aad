"""plan.toml, ``gyrocal-plan/1``: which runs to record, written by ``plan`` and carried out by ``simulate`` and ``record``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gyrocal.errors import InputError
from gyrocal.files import read_toml, replace_text
from gyrocal.recording.header import Axis, Face, describe
from gyrocal.recording.session import Run

FORMAT = "gyrocal-plan/1"
HEADER = """\
# Runs to record, in this order: `gyrocal record OUT --port P --plan FILE`, or `gyrocal simulate OUT --plan FILE`.
# Runs of one scenario share one power cycle. temp_c is the air of the chamber; a run without it is recorded as before.
"""


@dataclass(frozen=True)
class PlannedRun:
    """One run to record: ``temp_c`` (degC) is the air of the chamber, None = as before; a new scenario is a new power cycle."""

    axis: Axis
    face: Face
    table_rate_dps: float
    seconds: float
    temp_c: float | None
    scenario: str

    def is_(self, run: Run) -> bool:
        """True if a recorded run is this one: in the same power cycle and pose, at the same rate, and as long."""
        return (
            (run.scenario, run.axis, run.face) == (self.scenario, self.axis, self.face)
            and run.table_rate_dps is not None
            and abs(run.table_rate_dps - self.table_rate_dps) <= 1e-6 * max(1.0, abs(self.table_rate_dps))
            and run.duration_s >= self.seconds - 1.5 / run.sample_rate_hz
        )


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    axis: Axis
    face: Face
    table_rate_dps: float
    seconds: float = Field(gt=0)
    temp_c: float | None = None
    scenario: str


class _PlanFile(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    format: str
    day: int | None = None
    run: list[_Entry] = Field(min_length=1)


@dataclass(frozen=True)
class PlannedRuns:
    """The runs of a plan in order; ``day`` is the label of their group, None where the session has no days."""

    runs: tuple[PlannedRun, ...]
    day: int | None = None

    @staticmethod
    def open(path: str | Path) -> PlannedRuns:
        """Read a plan. Raises InputError, which names the file and what is wrong."""
        path = Path(path)
        raw = read_toml(path, f"no such plan; `gyrocal plan SESSION --out {path}` makes one", "a plan")
        if raw.get("format") != FORMAT:
            raise InputError(f"{path}: format is {raw.get('format')!r}, this version reads {FORMAT!r}")
        try:
            found = _PlanFile.model_validate(raw)
        except ValidationError as error:
            raise InputError(f"{path}: {describe(error)}") from None
        runs = tuple(PlannedRun(**entry.model_dump()) for entry in found.run)
        ended: set[str] = set()
        for before, run in pairwise(runs):
            ended |= {before.scenario} - {run.scenario}
            if run.scenario in ended:
                raise InputError(f"{path}: scenario {run.scenario} begins again; the runs of one power cycle follow each other")
        return PlannedRuns(runs, found.day)

    def save(self, path: str | Path) -> None:
        """Write the plan, whole or not at all."""
        entries = [{k: v for k, v in asdict(run).items() if v is not None} for run in self.runs]
        day = {} if self.day is None else {"day": self.day}
        replace_text(Path(path), HEADER + tomli_w.dumps({"format": FORMAT, **day, "run": entries}))

    def missing_in(self, recorded: Sequence[Run]) -> list[PlannedRun]:
        """The planned runs that are not recorded yet, in order. A recorded run counts for one planned run."""
        left = list(recorded)
        missing = []
        for planned in self.runs:
            found = next((run for run in left if planned.is_(run)), None)
            if found is None:
                missing.append(planned)
            else:
                left.remove(found)
        return missing
