"""The degree Celsius: as files, JSON and the parameters of effects write it, and as people read it."""

from __future__ import annotations

IN_FILES = "degC"
CELSIUS = "°C"


def to_read(unit: str) -> str:
    """A unit, as "dps/degC", in the letters of a screen, of a report and of printed text."""
    return unit.replace(IN_FILES, CELSIUS)
