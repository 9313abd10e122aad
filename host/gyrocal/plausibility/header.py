"""Checks of session.toml and the tables as files: unknown keys, and rows that were left out."""

from __future__ import annotations

from difflib import get_close_matches

from gyrocal.recording.session import RunEntry, Session, SessionFile
from gyrocal.warning import Warning


def check(session: Session) -> list[Warning]:
    """``unknown_key`` and ``line_damaged``."""
    out = [Warning("unknown_key", None, None, _unread(key, SessionFile)) for key in session.unread]
    for run in session.runs:
        out += [Warning("unknown_key", None, run.file, _unread(key, RunEntry)) for key in run.unread]
        if run.damage:
            out.append(Warning("line_damaged", None, run.file, run.damage))
    return out


def _unread(key: str, schema: type[RunEntry] | type[SessionFile]) -> str:
    known = [name for name in schema.model_fields if name != "run"]
    (nearest,) = get_close_matches(key, known, n=1, cutoff=0.0)
    return f"the key {key!r} of session.toml is unknown; the nearest known key is {nearest}. Correct or remove it"
