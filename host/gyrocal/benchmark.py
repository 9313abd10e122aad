"""Benchmarks, which run from a checkout: their cases are tests, which a wheel does not contain."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from gyrocal.errors import GyrocalError, InputError, did_you_mean
from gyrocal.present.output import stderr, stdout, table

ROOT = Path(__file__).parents[2]
FROM_A_FOLDER = (
    "paper", "robustness", "inference", "population", "coverage", "real", "fleet", "soak", "field", "references", "edge",
    "strangers",
)  # fmt: skip
BENCHMARKS = dict.fromkeys(FROM_A_FOLDER, ROOT / "benchmarks") | {
    "blind": ROOT / "tests" / "blind"
}

PARTS = {
    "blind": {"cases_of", "kinds", "limit", "skip", "workers", "scheduler", "results"}, "soak": {"hours", "seed"},
    "field": {"kinds", "limit", "workers", "results", "seed"}, "references": {"kinds", "limit", "results", "seed"},
    "edge": {"part", "kinds", "start", "stop", "workers", "out", "against"},
    "fleet": {"limit", "workers", "scheduler", "results"}, "population": {"workers", "scheduler", "results"},
}  # fmt: skip

Runner = Callable[[bool, Callable[[int, int], None]], dict[str, Any]]

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
    "set_found_rate": "effects of the sets that were found",
    "set_error_ratio": "error left over the oracle's on sets, median",
}
METHODS = {"gyrocal": None, "stepwise F-test": "stepwise_f_test", "oracle": "oracle"}


def benchmark(name: str, *, sample: bool = False, quiet: bool = False, **part: Any) -> dict[str, Any]:
    """Run a benchmark and return what its ``--json`` prints. Unless ``quiet``, show a progress bar on stderr.

    With ``tool``, a Python file, that tool is graded in gyrocal's place (``benchmarks/any_tool.py``).

    ``part`` says which cases of the blind benchmark to run, and how (``tests/blind/benchmark.py``), which sessions of the
    field benchmark, or the soak's ``hours`` and first ``seed``.

    Raises InputError for an unknown name, and GyrocalError outside a checkout.
    """
    from rich.progress import Progress

    runner = _runner(name, part)
    with Progress(console=stderr, transient=True, disable=quiet or not stderr.is_terminal) as bar:
        task = bar.add_task(f"benchmark {name}", total=None)
        found: dict[str, Any] = runner(sample, lambda done, total: bar.update(task, completed=done, total=total))
    return found


def _module(name: str) -> Any:
    """Import the benchmark's module from the checkout."""
    if name not in BENCHMARKS:
        raise InputError(f"no benchmark {name!r}{did_you_mean(name, BENCHMARKS)}; there are {', '.join(BENCHMARKS)}")
    folder = BENCHMARKS[name]
    module = "blind.benchmark" if name == "blind" else f"{folder.name}.{name}"
    if not (folder.parent / f"{module.replace('.', '/')}.py").is_file():
        raise GyrocalError(f"benchmark {name} runs from a checkout: its cases are not in a wheel")
    if str(folder.parent) not in sys.path:
        sys.path.insert(0, str(folder.parent))
    return importlib.import_module(module)


def _tools() -> Any:
    """The module that grades other tools."""
    _module("edge")  # which makes the folder a package that is found
    return importlib.import_module("benchmarks.any_tool")


def _runner(name: str, part: dict[str, Any]) -> Runner:
    module = _module(name)
    if "tool" in part:
        return partial(_tools().run, name=name, **part)
    if not part.keys() <= PARTS.get(name, frozenset()):
        raise InputError(
            f"benchmark {name} has no parts like these: use --cases, --kind, --limit, --skip, --workers, --scheduler and "
            "--results with blind, --limit, --workers, --scheduler and --results with fleet, the last three with population, "
            "--kind, --limit, --workers, --results and --seed with field (references: not --workers), --hours and --seed "
            "with soak, --part, --kind, --start, --stop, --workers, --out and --against with edge"
        )
    return partial(module.benchmark if name == "blind" else module.run, **part)


def show(name: str, found: dict[str, Any]) -> None:
    """Print the tables of a benchmark's report."""
    if "tool" in found:
        _tools().show(found)
        return
    if name != "blind":
        _module(name).show(found)
        return
    figures = [found if key is None else found[key] for key in METHODS.values()]
    rows = [[words, *("-" if f[key] is None else f"{f[key]:.3f}" for f in figures)] for key, words in ROWS.items()]
    title = ", ".join(f"{count} {kind}" for kind, count in found["cases"].items())
    table(title, ["figure:", *METHODS], rows)
    for failure in found["failures"]:
        stdout.print(f"{failure['fault']}: {failure['what']}", markup=False)
