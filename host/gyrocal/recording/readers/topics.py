"""Helpers for readers of logs with several topics: the choice of a topic, and the package that reads the format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gyrocal.errors import InputError, did_you_mean

SHOWN = 20


def chosen(path: Path, topic: str | None, topics: Sequence[str], preferred: Sequence[str], option: str = "--") -> str:
    """``topic`` if it is there, or the first one preferred; InputError that lists the topics otherwise."""
    shown = ", ".join(topics[:SHOWN]) + (", ..." if len(topics) > SHOWN else "")
    if topic is not None and topic not in topics:
        raise InputError(f"{path}: no topic {topic!r}{did_you_mean(topic, topics)}; there are {shown}")
    if topic is None and not preferred:
        known = f"no topic is known to hold a gyroscope's readings; choose one by {option}topic: {shown}"
        raise InputError(f"{path}: {known if topics else 'no topics in it'}")
    return topic if topic is not None else preferred[0]
