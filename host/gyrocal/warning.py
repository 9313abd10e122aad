"""Warnings: contradictions in a recording, which are reported beside the answer and do not replace it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Warning:
    """One warning. ``axis`` and ``file`` are None if it applies to all of them.

    ``text`` says what is contradicted, by how much, and what to change. A ``blocking`` warning excludes its axis from every
    judgement until the session is corrected or the warning is accepted.
    """

    code: str
    axis: str | None
    file: str | None
    text: str
    blocking: bool = False

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    def blocks(self, axis: str) -> bool:
        """True if the warning excludes this axis from the judgement."""
        return self.blocking and self.axis in (None, axis)


def accepted(warnings: Iterable[Warning], accept: Sequence[str]) -> list[Warning]:
    """The warnings, of which those named in ``accept`` (as ``code`` or ``code:axis``) no longer block."""
    return [replace(w, blocking=w.blocking and w.code not in accept and f"{w.code}:{w.axis}" not in accept) for w in warnings]


def by_weight(warnings: Iterable[Warning]) -> list[Warning]:
    """The warnings sorted so that the blocking ones come first."""
    return sorted(warnings, key=lambda w: not w.blocking)


def line(warning: Warning) -> str:
    """A warning as one line: its file, its text (which names the axis) and its code."""
    return f"{f'{warning.file}: ' if warning.file else ''}{warning.text} ({warning.code})"


def lines(warnings: Iterable[Warning]) -> list[str]:
    """One line of text for each warning, the blocking ones first."""
    return [line(w) for w in by_weight(warnings)]
