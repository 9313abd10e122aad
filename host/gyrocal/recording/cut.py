"""The runs of a table and their facts, from the options ``--run``, ``--run-meta`` and ``--sections``."""

from __future__ import annotations

import fnmatch
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError
from gyrocal.files import LARGEST_JSON_BYTES, UNREADABLE, read_small_text, why_unreadable
from gyrocal.recording.header import RunEntry, must_be

_META_NAMES = {"rate": "table_rate_dps", "turn": "turn_deg"}


@dataclass(frozen=True)
class Edge:
    """Where a run starts or ends: a row of the table (the first is 0) or a time from its first sample, s."""

    value: float
    in_seconds: bool

    @staticmethod
    def parse(text: str, what: str) -> Edge | None:
        """``540`` is a row, ``5.2s`` a time, an empty text the table's own edge."""
        text = text.strip()
        if not text:
            return None
        match = re.fullmatch(r"(\d+)|([0-9.]+(?:[eE][-+]?\d+)?)\s*s", text)
        try:
            if match is None:
                raise ValueError
            return Edge(float(match[1] or match[2]), match[1] is None)
        except ValueError:
            raise InputError(f"{what}: {text!r} is neither a row number nor seconds such as 12.5s") from None


def parse_meta(text: str, what: str) -> dict[str, Any]:
    """Read ``face=up,axis=x,rate=0,turn=360,scenario=s000,day=1,power_on_s=3`` into a run's keys of session.toml."""
    keys: dict[str, Any] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        name, equals, value = (p.strip() for p in part.partition("="))
        name = _META_NAMES.get(name, name)
        if not equals or name not in RunEntry.model_fields or name == "file":
            known = ", ".join(k for k in RunEntry.model_fields if k != "file")
            raise InputError(f"{what}: {part!r} is not NAME=VALUE with a name of {known}, rate, turn")
        keys[name] = value
    return check_meta(keys, what)


def check_meta(keys: Mapping[str, Any], what: str) -> dict[str, Any]:
    """A run's keys with their types checked; those not given stay away."""
    from pydantic import ValidationError

    try:
        entry = RunEntry.model_validate({"file": "-", "face": "up", **keys})
    except ValidationError as error:
        fault = error.errors()[0]
        name = {v: k for k, v in _META_NAMES.items()}.get(str(fault["loc"][0]), fault["loc"][0])
        raise InputError(f"{what}: {name}={fault['input']}; {must_be(fault)}") from None
    return {name: getattr(entry, name) for name in keys}


@dataclass(frozen=True)
class Cut:
    """One run to take out of a table; ``meta`` holds keys of session.toml's ``[[run]]``."""

    name: str
    start: Edge | None = None
    end: Edge | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def parse(text: str) -> Cut:
        """Read ``NAME:START:END[:face=up,axis=x,...]``; the end is the first row or moment not taken."""
        what = f"--run {text}"
        parts = text.split(":", 3)
        if len(parts) < 3:
            raise InputError(f"{what}: want NAME:START:END[:face=up,rate=0,...]")
        return Cut(
            check_name(parts[0].strip(), what),
            Edge.parse(parts[1], what),
            Edge.parse(parts[2], what),
            parse_meta(parts[3], what) if len(parts) == 4 else {},
        )


def check_name(name: str, what: str) -> str:
    """A run's name is its file's: letters, digits, ``_``, ``-`` and dots inside."""
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}", name):
        raise InputError(f"{what}: {name!r} cannot name a run; use letters, digits, _ and -")
    return name


def check_names_differ(cuts: Sequence[Cut]) -> None:
    """Raise InputError if two runs would have one file."""
    names = [cut.name for cut in cuts]
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise InputError(f"--run: two runs are named {doubled[0]!r}")


def read_sections(path: Path) -> list[Cut]:
    """Cuts from JSON, ``{"name": {"start": row, "end": row}, ...}``; the end is the first row not taken."""
    try:
        content = json.loads(read_small_text(path, LARGEST_JSON_BYTES))
    except UNREADABLE as error:
        raise InputError(f"{path}: {why_unreadable(error)}") from None
    if not isinstance(content, dict) or not content:
        raise InputError(f'{path}: want {{"name": {{"start": row, "end": row}}, ...}}')
    cuts = []
    for name, section in content.items():
        rows = [section.get(k) for k in ("start", "end")] if isinstance(section, dict) else []
        if len(rows) != 2 or not all(type(r) is int and 0 <= r < 2**53 for r in rows):
            raise InputError(f"{path}: section {name!r} wants whole numbers start and end")
        start, end = (Edge(float(row), False) for row in rows if row is not None)
        cuts.append(Cut(check_name(name, str(path)), start, end))
    return cuts


def with_meta(
    cuts: Sequence[Cut], rules: Iterable[str], defaults: Mapping[str, Any],
    named: Callable[[str], Mapping[str, Any]] = lambda _: {}, others: Sequence[str] = (),
) -> list[Cut]:  # fmt: skip
    """Each cut with its keys: those that ``named`` reads from its name, then ``defaults``, then every rule
    ``PATTERN:key=value,...`` that fits, then its own. A rule that fits none of them has to fit one of the ``others``, the names
    of the recording's other runs.
    """
    names = dict.fromkeys([*others, *(cut.name for cut in cuts)])
    parsed = []
    for rule in rules:
        what = f"--run-meta {rule}"
        pattern, colon, text = rule.partition(":")
        if not colon:
            raise InputError(f"{what}: want PATTERN:key=value,..., for example '*_rot:turn=360'")
        if not any(fnmatch.fnmatchcase(name, pattern) for name in names):
            raise InputError(f"{what}: no run is named so; there are {', '.join(names)}")
        parsed.append((pattern, parse_meta(text, what)))
    rules_of = {cut.name: [keys for pattern, keys in parsed if fnmatch.fnmatchcase(cut.name, pattern)] for cut in cuts}
    return [replace(cut, meta=_merge([named(cut.name), defaults, *rules_of[cut.name], cut.meta])) for cut in cuts]


def _merge(layers: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Later layers win; an angle takes the place of an earlier layer's rate, a rate that of an angle."""
    merged: dict[str, Any] = {}
    for layer in layers:
        for name, other in (("turn_deg", "table_rate_dps"), ("table_rate_dps", "turn_deg")):
            if name in layer and other not in layer:
                merged.pop(other, None)
        merged.update(layer)
    return merged
