"""session.toml, ``gyrocal-session/1``: its keys, read, checked and written."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gyrocal.errors import InputError
from gyrocal.files import read_toml, replace_text

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


def read_header(folder: Path) -> SessionFile:
    """Parse and check ``session.toml``."""
    path = folder / "session.toml"
    if folder.is_file():
        raise InputError(f"{folder}: not a folder; {WHAT_IT_IS}; `gyrocal import` makes one of a recording")
    raw = read_toml(path, f"no such file; {WHAT_IT_IS}, as `gyrocal import`, `record` and `simulate` make", "a session")
    if raw.get("format") != FORMAT:
        raise InputError(f"{path}: format is {raw.get('format')!r}, this version reads {FORMAT!r}")
    try:
        return SessionFile.model_validate(raw, strict=True)  # a number in quotes is none
    except ValidationError as error:
        raise InputError(f"{path}: {describe(error)}") from None


def describe(error: ValidationError) -> str:
    """The first fault that pydantic found, in a person's words."""
    fault = error.errors()[0]
    where = ".".join(f"{part + 1}" if isinstance(part, int) else str(part) for part in fault["loc"])
    message = fault["msg"].removeprefix("Value error, ")
    return (
        f"{where}: {message} (got {fault['input']!r})" if where and fault["type"] != "missing" else f"{where} {message}".strip()
    )


def write_header(folder: Path, header: Mapping[str, Any], runs: Iterable[Mapping[str, Any]]) -> None:
    """Write ``session.toml`` whole or not at all; keys that are None are left out."""
    content: dict[str, Any] = {k: v for k, v in header.items() if v is not None}
    content["run"] = [{k: v for k, v in entry.items() if v is not None} for entry in runs]
    replace_text(folder / "session.toml", tomli_w.dumps(content), durable=False)
