"""Plain tables."""

from __future__ import annotations

import html
from collections.abc import Sequence

from gyrocal.digits import UNKNOWN


def plain(
    columns: Sequence[str], rows: Sequence[Sequence[object]], marked: Sequence[bool] = (), kind: str = ""
) -> str:
    """A table as HTML. Columns whose names end in a colon are text. The last cell of ``marked`` rows is highlighted.

    ``kind`` are further classes of the table.
    """
    kinds = [' class="text"' if name.endswith(":") else "" for name in columns]
    head = "".join(f"<th{kind}>{html.escape(name.rstrip(':'))}</th>" for name, kind in zip(columns, kinds, strict=True))
    body = []
    for i, row in enumerate(rows):
        cells = [f"<td{kind}>{html.escape(str(cell))}</td>" for cell, kind in zip(row, kinds, strict=True)]
        worry = i < len(marked) and marked[i]
        body.append(f"<tr{' class=marked' if worry else ''}>{''.join(cells)}</tr>")
    return f'<table class="{f"plain {kind}".strip()}"><thead><tr>{head}</tr></thead><tbody>{"".join(body)}</tbody></table>'


def number(value: object, form: str, factor: float = 1.0) -> str:
    """A formatted number, or a dash for None."""
    return format(factor * value, form) if isinstance(value, int | float) else UNKNOWN
