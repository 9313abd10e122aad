"""What a simulation planted: ``OUT.truth.json`` beside the session's folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError
from gyrocal.files import replace_text
from gyrocal.recording.session import Session

TRUTH_FORMAT = "gyrocal-truth/1"


@dataclass
class RunTruth:
    """What was planted in one run; per axis x, y, z."""

    file: str
    scale: list[float]
    bias_dps: list[float]
    effects: list[dict[str, Any]] = field(default_factory=list)


def saved(session: Session, out: str | Path, record: Mapping[str, Any], parquet: bool) -> Session:
    """The session in its folder, with its truth beside it."""
    saved = session.save(out, parquet=parquet)
    replace_text(Path(f"{out}.truth.json"), json.dumps(record, indent=1) + "\n")
    return saved


def check_new(out: str | Path | None) -> None:
    """Raise InputError if the session's folder exists already, or if a file that is no truth has the truth's name."""
    if out is not None:
        if Path(out).exists():
            raise InputError(f"{out}: exists already; choose another name or remove it")
        _check_replaceable(Path(f"{out}.truth.json"))


def _check_replaceable(truth: Path) -> None:
    """InputError where a file of the truth's name is no truth: it is not ours to replace."""
    if truth.exists():
        try:
            ours = json.loads(truth.read_text(encoding="utf-8"))["format"] == TRUTH_FORMAT
        except (OSError, ValueError, KeyError, TypeError):
            ours = False
        if not ours:
            raise InputError(f"{truth}: exists already and holds no truth of a simulation; choose another name")
