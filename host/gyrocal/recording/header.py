"""session.toml, ``gyrocal-session/1``: its keys, read, checked and written."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gyrocal.errors import InputError
from gyrocal.files import UNREADABLE, read_toml, replace_text

FORMAT = "gyrocal-session/1"
Axis = Literal["x", "y", "z"]
Face = Literal["up", "down"]


class RunEntry(BaseModel):
    """One ``[[run]]`` of session.toml."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    file: str
    scenario: str = "s000"
    face: Face
    axis: Axis | None = None
    table_rate_dps: float | None = None
    table_rate_se_dps: float | None = Field(default=None, ge=0)
    turn_deg: float | None = None
    turn_se_deg: float | None = Field(default=None, ge=0)
    day: int | None = None
    power_on_s: float | None = Field(default=None, ge=0)


class Reference(BaseModel):
    """The table ``[reference]`` of session.toml: its kind, its clock, and the noise of a reading where the data cannot show it.

    With ``kind = "gravity"`` no true rate is known: gravity's direction at rests before and after each movement is the
    reference.
    """

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, frozen=True)

    kind: Literal["gravity"] | None = None
    clock: Literal["own", "same"] = "same"
    """``own``: the reference was stamped by another clock than the readings."""
    ref_noise_dps: float | None = Field(default=None, ge=0)
    temp_noise_c: float | None = Field(default=None, ge=0)


class SessionFile(BaseModel):
    """session.toml."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    format: Literal["gyrocal-session/1"]
    sensor: str | None = None
    axis: Axis = "z"
    sample_rate_hz: float = Field(gt=0)
    full_scale_dps: float | None = Field(default=None, gt=0)
    lsb_dps: float | None = Field(default=None, gt=0)
    latitude_deg: float | None = Field(default=None, ge=-90, le=90)
    board: str | None = None
    rig: str | None = None
    line: str | None = None
    made_on: str | datetime.date | None = None
    corrected: str | None = None
    accept: list[str] | None = None
    reference: Reference = Reference()
    run: list[RunEntry] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _hands_have_no_face(cls, raw: Any) -> Any:
        """A run whose reference is gravity lies on no table, so its face may be left out."""
        match raw:
            case {"reference": {"kind": "gravity"}, "run": [*runs]}:
                return {**raw, "run": [{"face": "up", **r} if isinstance(r, dict) else r for r in runs]}
        return raw

    @model_validator(mode="after")
    def _files_differ(self) -> SessionFile:
        seen: set[str] = set()
        for entry in self.run:
            if entry.file in seen:
                raise ValueError(f"run file {entry.file!r} is listed twice")
            seen.add(entry.file)
        return self


WHAT_IT_IS = "a session is a folder with session.toml and a table a run"


MOST_NAMED = 5


def folder_of(path: Path) -> Path:
    """A session's folder, given as such or by its ``session.toml``."""
    return path.parent if path.name == "session.toml" and path.is_file() else path


def read_header(folder: Path) -> SessionFile:
    """Parse and check ``session.toml``."""
    path = folder / "session.toml"
    if folder.is_file():
        raise InputError(f"{folder}: not a folder; {WHAT_IT_IS}; `gyrocal import` makes one of a recording")
    inside = sorted(p.parent.name for p in folder.glob("*/session.toml"))
    if inside and not path.exists():
        there = ", ".join(inside[:MOST_NAMED])
        raise InputError(f"{folder}: a folder of sessions ({there}); name one of them, such as {folder / inside[0]}")
    raw = read_toml(path, f"no such file; {WHAT_IT_IS}, as `gyrocal import`, `record` and `simulate` make", "a session")
    if raw.get("format") != FORMAT:
        raise InputError(f"{path}: format is {raw.get('format')!r}, this version reads {FORMAT!r}")
    try:
        return SessionFile.model_validate(raw, strict=True)  # a number in quotes is none
    except ValidationError as error:
        raise InputError(f"{path}: {describe(error)}") from None


def check_inside(folder: Path, file: str) -> None:
    """Raise InputError if a run's file, with its links resolved, is not in the session's folder or below it."""
    try:
        inside = folder.resolve() in (folder / file).resolve().parents
    except UNREADABLE:
        return  # no file has such a name
    if not inside:
        raise InputError(f"{folder / 'session.toml'}: run file {file!r} lies outside the session's folder; copy it there")


def describe(error: ValidationError, run: str = "[[run]]") -> str:
    """The first fault that pydantic found, in plain words: where it is, what is wrong, and what to write.

    ``run`` is what a run's entry is called, before its number.
    """
    fault = error.errors()[0]
    match fault["loc"]:
        case ():
            return fault["msg"].removeprefix("Value error, ")
        case ("run", int(number), str(key), *_):
            place = f"{run} {number + 1}: "
        case ("reference", str(key), *_):
            place = "[reference]: "
        case (key, *_):
            place = ""
    if fault["type"] == "missing":
        return f"{place}{key} is missing; write {_EXAMPLES.get(str(key), f'{key} = ...')}"
    if fault["type"] == "extra_forbidden":
        return f"{place}there is no key {key}; remove it"
    return f"{place}{key} = {_as_toml(fault['input'])}; {must_be(fault)}"


_EXAMPLES = {
    "file": 'file = "000_up.csv", the table of this run',
    "face": 'face = "up" or face = "down"',
    "sample_rate_hz": "sample_rate_hz = 100.0, the samples per second",
    "run": "[[run]] and below it the keys of a run, for each table",
    "axis": 'axis = "x", "y" or "z"',
    "table_rate_dps": "table_rate_dps = 78.0, in dps",
    "seconds": "seconds = 60.0",
    "scenario": 'scenario = "s000", the same for the runs of one power cycle',
}
"""What to write for a key that is missing from a session or a plan."""
_MUST_BE = {
    "float_type": "write a number without quotes",
    "float_parsing": "write a number",
    "int_type": "write a whole number without quotes",
    "int_from_float": "write a whole number",
    "int_parsing": "write a whole number",
    "string_type": "write text in quotes",
    "finite_number": "write a finite number",
    "list_type": "write a list in brackets",
    "too_short": "give at least one",
}
_MUST_BE_TABLE = {
    "run": "write a table that begins with [[run]], in two brackets, for each run",
    "reference": "write a table that begins with [reference]",
    "accept": 'write a list such as accept = ["clipped:z"]',
}
_LIMITS = {"gt": "above", "ge": "of at least", "lt": "below", "le": "of at most"}


def must_be(fault: Mapping[str, Any]) -> str:
    """What to write for a value that pydantic refused, from one of its errors."""
    key = next((part for part in fault["loc"] if part in _MUST_BE_TABLE), None)
    if key is not None and fault["type"] in ("list_type", "model_type", "dict_type", "too_short"):
        return _MUST_BE_TABLE[str(key)]
    limits = fault.get("ctx", {})
    if "expected" in limits:
        return f"write {str(limits['expected']).replace(chr(39), chr(34))}"
    for name, words in _LIMITS.items():
        if name in limits:
            return f"write a number {words} {limits[name]:g}"
    return _MUST_BE.get(fault["type"], str(fault["msg"]))


def _as_toml(value: Any) -> str:
    """A value as it stands in session.toml, shortened."""
    words = f'"{value}"' if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else repr(value)
    return words if len(words) <= 60 else words[:57] + "..."


def write_header(folder: Path, header: Mapping[str, Any], runs: Iterable[Mapping[str, Any]]) -> None:
    """Write ``session.toml`` whole or not at all; keys that are None are left out."""
    content: dict[str, Any] = {k: v for k, v in header.items() if v is not None}
    content["run"] = [{k: v for k, v in entry.items() if v is not None} for entry in runs]
    replace_text(folder / "session.toml", tomli_w.dumps(content), durable=False)
