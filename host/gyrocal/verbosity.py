"""How much a command says: as much as it has to, nothing but errors and JSON (``-q``), or also each of its steps (``-v``)."""

from __future__ import annotations

import os
import platform
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout

from gyrocal import __version__

_since_s: float | None = None


def step(text: str) -> bool:
    """Write a step to stderr if ``-v`` was given, with the seconds since the start; True if it was written."""
    if _since_s is None:
        return False
    print(f"[{time.monotonic() - _since_s:7.2f} s] {text}", file=sys.stderr, flush=True)
    return True


@contextmanager
def level(*, quiet: bool, verbose: bool, json: bool) -> Iterator[None]:
    """Run a command with ``-q``, ``-v`` or neither of them. With ``-q``, stdout is left open for JSON alone."""
    global _since_s
    with ExitStack() as stack:
        if quiet:
            nowhere = stack.enter_context(open(os.devnull, "w", encoding="utf-8"))
            stack.enter_context(redirect_stderr(nowhere))
            if not json:
                stack.enter_context(redirect_stdout(nowhere))
        _since_s = time.monotonic() if verbose else None
        step(f"gyrocal {__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}")
        try:
            yield
        finally:
            _since_s = None
