"""Lines and branches of the C core that the tests of `tests/core` execute, a row a file. `make coverage` runs it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
REPORT = re.compile(
    r"File '[^']*gyrocal_core/(?P<file>[^']+\.c)'\nLines executed:(?P<lines>[\d.]+)% of (?P<of_lines>\d+)\n"
    r"(?:Branches executed:[\d.]+% of (?P<of_branches>\d+)\nTaken at least once:(?P<branches>[\d.]+)%|No branches)"
)


def measure(folder: Path) -> list[tuple[str, int, int, int, int]]:
    """Run the tests with objects in ``folder``; (file, lines executed, lines, branches taken, branches) by file."""
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "tests/core", "--ignore=tests/core/test_build.py"]
    subprocess.run(command, cwd=ROOT, env={**os.environ, "GYROCAL_CORE_COVERAGE": str(folder)}, check=True)
    counts = sorted(folder.glob("*.gcda"))
    done = subprocess.run(["gcov", "-b", "-n", *counts], cwd=folder, capture_output=True, text=True, check=True)
    rows = []
    for found in REPORT.finditer(done.stdout):
        of_lines, of_branches = int(found["of_lines"]), int(found["of_branches"] or 0)
        lines = round(float(found["lines"]) * of_lines / 100)
        rows.append((found["file"], lines, of_lines, round(float(found["branches"] or 0) * of_branches / 100), of_branches))
    return sorted(rows)


def main() -> None:
    with TemporaryDirectory() as folder:
        rows = measure(Path(folder))
    rows.append(("all", *(sum(row[i] for row in rows) for i in range(1, 5))))
    print("| File | Lines | Branches |")
    print("|---|---|---|")
    for file, lines, of_lines, branches, of_branches in rows:
        taken = f"{100 * branches / of_branches:.1f} % of {of_branches}" if of_branches else "none"
        print(f"| `{file}` | {100 * lines / of_lines:.1f} % of {of_lines} | {taken} |")


if __name__ == "__main__":
    main()
