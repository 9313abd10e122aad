"""``gyrocal benchmark edge``: sure names and probabilities where an effect is hard to tell, beside small disturbances.

    gyrocal benchmark edge --part work --stop 100 --workers 2 --out work.jsonl
    gyrocal benchmark edge --part work --out work.jsonl --against earlier.jsonl

The sessions come from ``tests/edge``, which shares no code with the tool. Cases that the file holds are not run again.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks import edge_table
from benchmarks.edge_table import Row

from gyrocal.errors import InputError
from gyrocal.present.output import stderr

TESTS = str(Path(__file__).parents[1] / "tests")
if TESTS not in sys.path:  # the generator's place
    sys.path.insert(0, TESTS)

WORKERS, SAMPLE = 2, 10
LEAST_LOG_ODDS = -4.6
KEPT = (
    "effect", "axis", "group", "decision", "probability", "log_odds", "checks", "together", "heldout_gain", "heldout_gain_se",
    "by_tests",
)  # fmt: skip
show = edge_table.show


def run(
    sample: bool, progress: Callable[[int, int], None], *, part: str = "work", kinds: Sequence[str] = (), start: int = 0,
    stop: int | None = None, workers: int = WORKERS, out: Path | None = None, against: Path | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The figures of the cases ``start`` to ``stop`` of a part; with ``against``, also beside those of an earlier file.

    Raises InputError for a part or kind that there is not, and for the frozen part without its seed.
    """
    names = chosen(part, tuple(kinds), start, SAMPLE if sample and stop is None else stop)
    known = {row["case"]: row for row in edge_table.read(out)} if out is not None else {}
    left = [job for job in names if _name(job) not in known]
    for count, row in enumerate(_each(left, workers), len(names) - len(left) + 1):
        known[row["case"]] = row
        if out is not None:
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        progress(count, len(names))
        if not stderr.is_terminal:
            stderr.print(f"{count}/{len(names)} {row['case']} {row['verdict']} {row['seconds']:.1f} s", markup=False)
    rows = [known[_name(job)] for job in names]
    found = edge_table.table_of(rows)
    return found | ({"compared": edge_table.compared(edge_table.read(against), rows)} if against is not None else {})


Job = tuple[str, str, int]


def _name(job: Job) -> str:
    from edge.drawn import Draw

    return Draw(*job).name


def chosen(part: str, kinds: tuple[str, ...], start: int, stop: int | None) -> list[Job]:
    """Part, kind and number of the cases asked for."""
    from edge import drawn

    if part not in drawn.COUNTS:
        raise InputError(f"no part {part!r} of the edge benchmark; there are {', '.join(drawn.COUNTS)}")
    for kind in kinds:
        if kind not in drawn.COUNTS[part]:
            raise InputError(f"no cases of kind {kind!r}; there are {', '.join(drawn.COUNTS[part])}")
    try:
        drawn.seed_of(part)
    except ValueError as error:
        raise InputError(str(error)) from None
    return [(d.part, d.kind, d.number) for d in drawn.draws(part, kinds)[start:stop]]


def _each(jobs: Sequence[Job], workers: int) -> Iterator[Row]:
    if workers <= 1:
        yield from map(_judged, jobs)
        return
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS"), "1"))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(_judged, job) for job in jobs]):
            yield done.result()


def _judged(job: Job) -> Row:
    """The row of a case; of one that could not be drawn or weighed, a row that says so."""
    try:
        return judge(job)
    except Exception as error:
        empty: Row = {"verdict": "failed", "candidates": [], "seconds": 0.0, "truth": None, "behind": {}}
        known = dict(zip(("part", "kind", "number"), job, strict=True))
        return {"case": _name(job), **known, "error": f"{type(error).__name__}: {error}"} | empty


def judge(job: Job) -> Row:
    """One case: draw it, let the tool diagnose it once, and hold the answer beside the truth and the oracle."""
    from edge import drawn, recording
    from edge.apart import Judge
    from gyrocal.api import Session, diagnose

    draw, begun = drawn.Draw(*job), time.process_time()
    case = draw.case()
    row: Row = {"case": draw.name, "part": draw.part, "kind": draw.kind, "number": draw.number, "truth": drawn.truth(case)}
    drawn_s = time.process_time() - begun
    answer: dict[str, Any] = {"verdict": "failed", "candidates": []}
    row["error"] = None
    with tempfile.TemporaryDirectory() as scratch:
        recording.write(case.made, case.readings, Path(scratch) / "session", case.random)
        begun = time.process_time()
        try:
            found = diagnose(Session.open(Path(scratch) / "session"))
            answer = found.to_json()
            by_tests = {(c.effect.id, c.axis): [c.decision, list(c.group)] for c in getattr(found, "tested", found.candidates)}
            for told, candidate in zip(answer["candidates"], found.candidates, strict=True):
                told["log_odds"] = candidate.log_odds
                told["by_tests"] = by_tests[candidate.effect.id, candidate.axis]
            for told, one in zip(answer["alternatives"], found.alternatives, strict=True):
                told["log_odds"] = one.found.log_odds
        except Exception as error:
            row["error"] = f"{type(error).__name__}: {error}"
        seconds = time.process_time() - begun
    row |= {
        "verdict": answer["verdict"],
        "candidates": [{key: c[key] for key in KEPT if key in c} for c in answer["candidates"] if _told(c)],
        "alternatives": answer.get("alternatives"),
        "unknown": answer.get("unknown"),
        "warnings": [[w["code"], w["axis"], w["blocking"]] for w in answer.get("warnings", [])],
        "seconds": seconds,
        "draw_seconds": drawn_s,
    }
    judged = Judge(case.made, case.ideal)
    row["oracle"], row["behind"] = {}, {}
    for axis in drawn.axes_of(case):
        oracle = judged.oracle("xyz".index(axis), case.planted, case.disturbance, case.readings)
        row["oracle"][axis] = oracle.report()
        behind = oracle.behind(_answered(row, axis))
        row["behind"][axis] = behind if behind == behind else None
    return row


def _told(candidate: dict[str, Any]) -> bool:
    log_odds = candidate.get("log_odds")
    return candidate["decision"] in ("add", "suggest") or (log_odds is not None and log_odds >= LEAST_LOG_ODDS)


def _answered(row: Row, axis: str) -> list[str]:
    """The set that was answered on an axis: the sure names, or where sets are told, the most probable one."""
    told = [a for a in row["alternatives"] or [] if a["axis"] == axis and a.get("probability") is not None]
    if told:
        return list(max(told, key=lambda a: a["probability"])["effects"])
    return [id_ for id_, on in edge_table.sure(row) if on == axis]
