"""The blind benchmark: is the missing effect named, is nothing named where nothing is missing, and does the error fall?

The tool sees the session's folder alone. Beside it, on the same sessions: the oracle, which fits the structure that was
planted, and on the fixed cases forward selection by the ordinary F-test (`stepwise`). docs/blind.md defines every figure.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

import gyrocal
from gyrocal.errors import InputError
from gyrocal.fleet.engine import engine

from . import cases, drawn
from .drawn import Draw
from .generator.case import Case
from .judge import judge
from .outcome import Outcome

PROCESSES = 2
SETS = ("fixed", *drawn.SETS)
MEDIANS = ("error_reduction_ratio", "set_error_ratio")

Progress = Callable[[int, int], None]


def benchmark(
    sample: bool = False,
    progress: Progress | None = None,
    *,
    cases_of: str = "fixed",
    kinds: Sequence[str] = (),
    limit: int | None = None,
    skip: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    results: Path | None = None,
) -> dict[str, Any]:
    """The report on a set of cases, or on a part of it: `kinds` alone, and of each `limit` cases after the first `skip`."""
    return report(run(chosen(sample, cases_of, kinds, limit, skip), progress, workers, results, scheduler))


def chosen(sample: bool, cases_of: str, kinds: Sequence[str], limit: int | None, skip: int = 0) -> list[Case | Draw]:
    """The cases of a set ("fixed", "work", "frozen" or "unseen"), or the part that is asked for."""
    if cases_of not in SETS:
        raise InputError(f"no set of cases {cases_of!r}; there are {', '.join(SETS)}")
    listed: Sequence[Case | Draw]
    if cases_of == "fixed":
        listed = cases.SAMPLE if sample else cases.CASES
    else:
        listed = drawn.draws(cases_of)
        limit = 1 if sample and limit is None else limit
    known = list(dict.fromkeys(case.kind for case in listed))
    for kind in kinds:
        if kind not in known:
            raise InputError(f"no cases of kind {kind!r}; there are {', '.join(known)}")
    wanted = [case for case in listed if not kinds or case.kind in kinds]
    seen: Counter[str] = Counter()
    part = []
    for case in wanted:
        seen[case.kind] += 1
        if seen[case.kind] > skip and (limit is None or seen[case.kind] <= skip + limit):
            part.append(case)
    return part


def run(
    planned: Sequence[Case | Draw], progress: Progress | None = None, workers: int | None = None, results: Path | None = None,
    scheduler: str | None = None,
) -> list[Outcome]:  # fmt: skip
    """Every case, in the order given; `progress` hears how many are done, and of how many.

    The cases run on `workers` processes of this machine (0 = this process), or on a Dask scheduler. `results` is a JSONL
    file that gains a line as each case ends. Cases that it holds of the same code are not run again.
    """
    outcomes = _finished(results)
    left = [case for case in planned if case.name not in outcomes]
    if not left:
        return [outcomes[case.name] for case in planned]
    threads = ("OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS")
    before = {name: os.environ.get(name) for name in threads}
    os.environ.update(dict.fromkeys(threads, "1"))  # read by the processes as they start
    try:
        processes = PROCESSES if workers is None and scheduler is None else workers
        with engine(processes, scheduler) as where:
            for outcome in where.run(judge, left):
                outcomes[outcome.case.name] = outcome
                if results is not None:
                    with results.open("a", encoding="utf-8") as file:
                        file.write(json.dumps({"code": code_state(), **outcome.to_row()}) + "\n")
                if progress is not None:
                    progress(len(planned) - sum(case.name not in outcomes for case in left), len(planned))
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value
    return [outcomes[case.name] for case in planned]


def _finished(results: Path | None) -> dict[str, Outcome]:
    if results is None or not results.exists():
        return {}
    rows = [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]
    return {row["case"]["name"]: Outcome.from_row(row) for row in rows if row["code"] == code_state()}


@cache
def code_state() -> str:
    """A digest of the tool's and the benchmark's source: results of other code are not comparable."""
    digest = hashlib.sha256()
    for folder in (Path(gyrocal.__file__).parent, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def score(outcomes: Iterable[Outcome], method: str = "gyrocal") -> dict[str, float | None]:
    """The benchmark's figures (docs/blind.md), and `completed_rate`; None where no case bears on a figure."""
    return {figure: (_median if figure in MEDIANS else _mean)(v) for figure, v in _values(list(outcomes), method).items()}


def _values(outcomes: Sequence[Outcome], method: str) -> dict[str, list[float]]:
    """What each case contributes to each figure."""
    kinds: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        kinds.setdefault(outcome.case.kind, []).append(outcome)
    named = [o for kind in ("effect", "pair") for o in kinds.get(kind, []) if o.counts]
    sets = kinds.get("set", [])
    if method == "oracle":  # it knows the structure: what it can fit is all that is asked of it
        named = [o for o in named if o.fitted]
        kinds, sets = {}, []
    elsewhere = [o for kind in ("confounded", "unknown") for o in kinds.get(kind, [])]
    effects = [o for o in named if o.fitted and o.case.kind == "effect"]
    values: dict[str, Iterable[float]] = {
        "false_alarm_rate": (not o.right(method) for o in kinds.get("null", [])),
        "top1_rate": (o.right(method) for o in named),
        "set_contains_rate": (o.in_group(method) for o in named),
        "mean_set_size": (len(o.answers[method].group) for o in named if o.answers[method].named),
        "confounded_declared_rate": (o.right(method) for o in kinds.get("confounded", [])),
        "unknown_flagged_rate": (o.right(method) for o in kinds.get("unknown", []) if o.counts),
        "misnamed_rate": (o.misnamed(method) for o in [*named, *sets, *elsewhere]),
        "error_reduction_ratio": (_ratio(o, method) for o in effects),
        "completed_rate": (o.completed(method) for o in sets or named),
        "set_found_rate": (o.found(method) for o in sets),
        "set_error_ratio": (_ratio(o, method) for o in sets if o.fitted),
    }
    return {figure: [float(value) for value in each] for figure, each in values.items()}


def bounds(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Of each rate, the number of cases and the exact 95 % limits of a binomial share (Clopper and Pearson 1934)."""
    found = {}
    for figure, values in _values(outcomes, "gyrocal").items():
        if not values or not figure.endswith("_rate") or figure == "set_found_rate":  # effects of one set are not independent
            continue
        n, k = len(values), round(sum(values))
        low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
        high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
        found[figure] = {"n": n, "within": [low, high]}
    return found


def _ratio(outcome: Outcome, method: str) -> float:
    mine, best = outcome.answers[method].error_dps, outcome.answers["oracle"].error_dps
    assert best is not None
    return float("inf") if mine is None else mine / best


def _mean(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.mean(listed)) if listed else None


def _median(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.median(listed)) if listed else None


def report(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The JSON object of `gyrocal benchmark blind`: the tool's figures, then the others' beside them."""
    kinds = dict.fromkeys(o.case.kind for o in outcomes)
    counts = {kind: sum(o.case.kind == kind and o.counts for o in outcomes) for kind in kinds}
    others = {"stepwise_f_test": "stepwise", "oracle": "oracle"}
    return {
        **score(outcomes),
        "bounds": bounds(outcomes),
        **{
            key: score([o for o in outcomes if method in o.answers], method) for key, method in others.items()
        },
        "cases": counts,
        "too_faint": [o.case.name for o in outcomes if not o.counts],
        "failures": [{"case": o.case.name, "fault": o.fault, "what": o.line()} for o in outcomes if o.fault is not None],
    }
