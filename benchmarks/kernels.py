"""How far answers differ where another processor's kernels add in another order. python benchmarks/kernels.py

OpenBLAS chooses its kernels by the processor. A child process is told another processor's by OPENBLAS_CORETYPE, and answers
`compare` and `diagnose` on the same two simulated sessions; in one an effect is missing beside the one that is named. The
table has, for each kind of figure, the largest difference from the first kernel's answer in units of the figure's error, as
`tests/pins/kept.py` states it, and beneath it the words that differ.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.pins import compare, kept
from tests.pins.record import SESSIONS

KERNELS = ("Haswell", "Zen", "SkylakeX", "Prescott")
NAMES = ("paper", "rest")
DIGITS = 12
LEVELS = ("rms", "floor", "excess", "within", "gain", "drop", "explained")


def answers(folder: Path) -> dict[str, Any]:
    """What the commands say of every session in a folder, and the kernels that numpy and scipy say they use."""
    import scipy.linalg  # noqa: F401  # its library is listed once it is loaded
    from threadpoolctl import threadpool_info

    from gyrocal.cli import main as gyrocal

    compare.DIGITS = DIGITS
    said: dict[str, Any] = {}
    for path in sorted(path.parent for path in folder.glob("*/session.toml")):
        for verb, keep in (("compare", kept.of_compare), ("diagnose", kept.of_diagnose)):
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                gyrocal([verb, str(path), "--json"])
            said[f"{path.name} {verb}"] = keep(json.loads(out.getvalue()))
    return {"kernels": sorted({pool["architecture"] for pool in threadpool_info() if "architecture" in pool}), "said": said}


def under(kernel: str, folder: Path) -> dict[str, Any] | None:
    """The answers of a child with this kernel; none where this processor cannot run it."""
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, __file__, "answers", str(folder)], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode < 0:  # an instruction that it lacks
        return None
    if done.returncode:
        raise SystemExit(done.stderr)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def figures(said: Any, where: str = "") -> Iterator[tuple[str, str, float, float]]:
    """Place, kind, value and error of each figure in what is kept of an answer."""
    if isinstance(said, dict):
        for key, value in said.items():
            yield from figures(value, f"{where}/{key}")
    elif isinstance(said, list):
        for i, value in enumerate(said):
            yield from figures(value, f"{where}/{i}")
    elif isinstance(said, str):
        for i, found in enumerate(compare.FIGURE.finditer(said)):
            name = where.rsplit("/", 1)[1] if found.start() == 0 else said[: found.start()].split()[-1]
            kind = (
                name if name in LEVELS else "where" if name.endswith(":") else "drift" if "colored" in where else "parameters"
            )
            yield f"{where} {i}", kind, float(found[1]), float(found[2])


def largest(one: Any, other: Any) -> dict[str, float]:
    """The largest difference of each kind of figure that both answers have, in units of its error."""
    there = {place: (value, error) for place, _, value, error in figures(other)}
    out: dict[str, float] = {}
    for place, kind, value, error in figures(one):
        if place in there and (unit := max(error, there[place][1])) > 0:
            out[kind] = max(out.get(kind, 0.0), abs(value - there[place][0]) / unit)
    return out


def words(one: Any, other: Any) -> list[str]:
    """Where the answers differ in more than figures."""
    return [line for line in compare.differences(one, other) if "missing" in line or "new" in line or _reworded(line)]


def _reworded(line: str) -> bool:
    found, _, pinned = line.partition(", pinned is ")
    return compare.FIGURE.sub("±", found.partition(": ")[2]) != compare.FIGURE.sub("±", pinned)


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        for name in NAMES:
            SESSIONS[name](Path(scratch) / name)
        with ThreadPoolExecutor() as pool:
            found = dict(zip(KERNELS, pool.map(lambda kernel: under(kernel, Path(scratch)), KERNELS), strict=True))
    run = {kernel: answer for kernel, answer in found.items() if answer is not None}
    first, *others = run
    columns = {kernel: largest(run[first]["said"], run[kernel]["said"]) for kernel in others}
    kinds = dict.fromkeys(kind for column in columns.values() for kind in column)
    print(f"| figure, in units of its error | {' | '.join(others)} |\n| --- |{' ---: |' * len(others)}")
    for kind in kinds:
        print(f"| {kind} | {' | '.join(f'{columns[kernel].get(kind, 0.0):.2g}' for kernel in others)} |")
    print()
    for kernel in KERNELS:
        ran = "not on this processor" if kernel not in run else f"numpy and scipy used {', '.join(run[kernel]['kernels'])}"
        told = words(run[first]["said"], run[kernel]["said"]) if kernel in others else []
        print(f"{kernel}: {ran}" + "".join(f"\n  {line}" for line in told))


if __name__ == "__main__":
    if sys.argv[1:2] == ["answers"]:
        print(json.dumps(answers(Path(sys.argv[2]))))
    else:
        main()
