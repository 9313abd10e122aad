"""Tests and evidence beside the tests alone, session by session, over results of several parts of ``gyrocal benchmark edge``.

    gyrocal benchmark edge --part frozen --stop 300 --workers 2 --out frozen.jsonl
    python benchmarks/edge_paired.py frozen.jsonl another.jsonl

It prints exact one-sided McNemar tests of fewer sessions with a wrong name, and of more effects reached.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import edge_table


def main() -> None:
    rows = [dict(row, case=f"{path}:{row['case']}") for path in sys.argv[1:] for row in edge_table.read(Path(path))]
    alone = [edge_table.of_tests(row) for row in rows if row["error"] is None]
    found = edge_table.compared(alone, rows)
    for name, words in (("wrong", "sessions with a wrong name"), ("reached", "effects reached")):
        of = found[name]
        print(
            f"{words}: the tests alone {of['before']}, with the evidence {of['after']}; only without it {of['only_before']}, "
            f"only with it {of['only_after']}, p {of['p']:.2g}"
        )  # fmt: skip


if __name__ == "__main__":
    main()
