"""Output of the commands: one JSON object, tables, progress on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.table import Table

from gyrocal import verbosity
from gyrocal.digits import places, rounded

PIPE_WIDTH = 140
stdout = Console(highlight=False, markup=False, soft_wrap=True, width=None if sys.stdout.isatty() else PIPE_WIDTH)
stderr = Console(stderr=True, highlight=False, markup=False)


def emit(value: Any) -> None:
    """Print one JSON object alone on stdout. Numbers that are not finite become null, because JSON does not have them."""
    print(json.dumps(_plain(value), indent=1))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def working(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Show a line of progress on stderr if it is a terminal, and with ``-v`` each step as a line of its own."""
    if verbosity.step("working"):
        yield _steps()
        return
    if quiet or not stderr.is_terminal:
        yield lambda _: None
        return
    with stderr.status("") as status:
        yield lambda text: status.update(text)


def _steps() -> Callable[[str], None]:
    """A function that writes a step where it differs from the one before."""
    last = ""

    def say(text: str) -> None:
        nonlocal last
        if text != last:
            verbosity.step(text)
            last = text

    return say


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on stdout. Columns whose names end in a colon are text, the others are numbers."""
    grid = Table(title=title or None, title_justify="left", title_style="bold", header_style="bold")
    for name in columns:
        grid.add_column(name.rstrip(":"), justify="left" if name.endswith(":") else "right", overflow="fold")
    for row in rows:
        grid.add_row(*row)
    stdout.print(grid)


def mdps(value_dps: float | None, digits: int = 1) -> str:
    """A rate in deg/s as text in mdps."""
    return "-" if value_dps is None else f"{value_dps * 1e3:.{digits}f}"


def plus_minus(value: float, se: float | None, unit: str = "") -> str:
    """A value with its standard error as text, rounded to the first two digits of the error."""
    if places(se, -1) < 0:
        return f"{value:.4g} {unit}".strip()
    return f"{rounded(value, se, 0)} ± {rounded(se, se, 0)} {unit}".strip()
