"""A plan as text: its question, its runs, and what they promise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from gyrocal.planning.plan import Plan
from gyrocal.present.output import stdout, table
from gyrocal.recording.plan_file import PlannedRun


def print_plan(p: Plan, session: Path, out: Path | None) -> None:
    """Print the question, the power cycles to record, and the probability of an answer."""
    stdout.print(p.question.why)
    table("", ["power cycles:", "number", "record:", "s"], cycle_rows(p.runs))
    stdout.print(promise(p), style="bold")
    if p.advice:
        stdout.print(p.advice)
    if out is None:
        stdout.print(f"next: gyrocal plan {session} --out PLAN.toml ... writes the plan")
    else:
        stdout.print(f"next: gyrocal record {session} --port PORT --plan {out}")


def cycle_rows(runs: Sequence[PlannedRun]) -> list[list[str]]:
    """One row for power cycles of equal runs that follow each other: their names, number, runs and seconds."""
    cycles = [(name, list(of)) for name, of in groupby(runs, key=lambda run: run.scenario)]
    rows = []
    for _, alike in groupby(cycles, key=lambda cycle: [(words(run), run.seconds) for run in cycle[1]]):
        same = list(alike)
        names = same[0][0] if len(same) == 1 else f"{same[0][0]} to {same[-1][0]}"
        own = same[0][1]
        rows.append([names, str(len(same)), "; then ".join(map(words, own)), " + ".join(f"{run.seconds:g}" for run in own)])
    return rows


def words(run: PlannedRun) -> str:
    """One run in words."""
    turning = "at rest" if run.table_rate_dps == 0 else f"table at {run.table_rate_dps:g} dps"
    air = "" if run.temp_c is None else f", chamber at {run.temp_c:g} °C"
    return f"{run.axis} {run.face}, {turning}{air}"


def promise(p: Plan) -> str:
    """What the plan promises, in a sentence."""
    answer = "names the effect that acts" if p.question.kind == "tell_apart" else "gives the parameter to a tenth"
    return (
        f"With these {p.minutes:g} minutes of recording, the session {answer} with probability {p.power:.2f}; "
        f"with its own runs again, {p.power_same_again:.2f}."
    )
