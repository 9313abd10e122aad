"""A threshold with its documentation."""

from __future__ import annotations

from dataclasses import field
from typing import Any

JUDGEMENT = "chosen by judgement; not yet measured by itself"


def threshold(
    value: float | tuple[float, ...], meaning: str, *, larger: str, smaller: str, chosen_by: str = JUDGEMENT
) -> Any:
    """A dataclass field with a default ``value``, the ends of a range, or values that are tried in turn.

    Its metadata hold four sentences: what it means, the consequence of a larger and of a smaller value, and its origin.
    """
    words = {"meaning": meaning, "larger": larger, "smaller": smaller, "chosen_by": chosen_by}
    return field(default=value, metadata=words)
