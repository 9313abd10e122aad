"""Benchmarks run from a checkout: their cases are tests, which a wheel does not carry."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from gyrocal.errors import GyrocalError, InputError
from gyrocal.output import stderr, stdout, table

TESTS = Path(__file__).parents[2] / "tests"
BENCHMARKS = ("blind",)

ROWS = {
    "false_alarm_rate": "null called anything but adequate",
    "top1_rate": "true effect named first",
    "set_contains_rate": "true effect in the group shown",
    "mean_set_size": "effects in the group shown",
    "confounded_declared_rate": "confounded: said so",
    "unknown_flagged_rate": "unknown: said so",
    "misnamed_rate": "one cause stated, and wrong",
    "error_reduction_ratio": "error left over the oracle's, median",
    "completed_rate": "all found one by one, nothing more",
}
METHODS = {"gyrocal": None, "stepwise F-test": "stepwise_f_test", "oracle": "oracle"}


def benchmark(name: str, *, sample: bool = False, quiet: bool = False) -> dict[str, Any]:
    """Run one benchmark; what its ``--json`` prints. A progress bar on stderr unless ``quiet``."""
    from rich.progress import Progress

    if name not in BENCHMARKS:
        raise InputError(f"no benchmark {name!r}; there is {', '.join(BENCHMARKS)}")
    if not (TESTS / name / "benchmark.py").is_file():
        raise GyrocalError(f"benchmark {name} runs from a checkout: its cases are in tests/{name}, which a wheel lacks")
    if str(TESTS) not in sys.path:
        sys.path.insert(0, str(TESTS))
    runner, cases = (importlib.import_module(f"{name}.{part}") for part in ("benchmark", "cases"))
    with Progress(console=stderr, transient=True, disable=quiet or not stderr.is_terminal) as bar:
        task = bar.add_task(f"benchmark {name}", total=None)
        outcomes = runner.run(
            cases.SAMPLE if sample else cases.CASES,
            lambda done, total: bar.update(task, completed=done, total=total),
        )
    found: dict[str, Any] = runner.report(outcomes)
    return found


def show(found: dict[str, Any]) -> None:
    """The table, then each case in which the tool was wrong."""
    figures = [found if key is None else found[key] for key in METHODS.values()]
    rows = [[words, *("-" if f[key] is None else f"{f[key]:.3f}" for f in figures)] for key, words in ROWS.items()]
    title = ", ".join(f"{count} {kind}" for kind, count in found["cases"].items())
    table(title, ["figure:", *METHODS], rows)
    for failure in found["failures"]:
        stdout.print(f"{failure['fault']}: {failure['what']}", markup=False)
