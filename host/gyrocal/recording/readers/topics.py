"""Helpers for readers of logs with several topics: the choice of a topic, and the package that reads the format."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError, did_you_mean

SHOWN = 20


def needed(module: str, extra: str, path: Path) -> Any:
    """A package that the extra ``gyrocal[extra]`` installs. Raises InputError if it is missing."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise InputError(
            f"{path}: needs the package {module.partition('.')[0]}, which is not installed: pip install 'gyrocal[{extra}]'"
        ) from None


def chosen(path: Path, topic: str | None, topics: Sequence[str], preferred: Sequence[str]) -> str:
    """``topic`` if it is there, or the first one preferred; InputError that lists the topics otherwise."""
    shown = ", ".join(topics[:SHOWN]) + (", ..." if len(topics) > SHOWN else "")
    if topic is not None and topic not in topics:
        raise InputError(f"{path}: no topic {topic!r}{did_you_mean(topic, topics)}; there are {shown}")
    if topic is None and not preferred:
        raise InputError(f"{path}: several topics; choose one by --topic: {shown}" if topics else f"{path}: no topics in it")
    return topic if topic is not None else preferred[0]
