"""How units, numbers and parts of a whole are read by people: °C, where files and JSON say degC, and percentages."""

from __future__ import annotations

import math

IN_FILES = "degC"
CELSIUS = "°C"
MOST_DECIMALS = 3
"""Decimals of a percentage with which a part is shown that is nearly the whole."""


def to_read(unit: str) -> str:
    """A unit, as "dps/degC", in the letters of a screen, of a report and of printed text."""
    return unit.replace(IN_FILES, CELSIUS)


def number_of(count: int, noun: str) -> str:
    """A count with its noun: "1 run", "2 runs"."""
    return f"{count} {noun}" + "s" * (count != 1)


def percentage(part: float, decimals: int = 0) -> str:
    """A fraction in percent. Only 1 is 100%: nearer to it, a part has as many decimals as show the first digit of what is left.

    What rounds to zero has no sign.
    """
    left = 1 - part
    if 0 < left < 0.5 * 10.0 ** (-2 - decimals):
        decimals = -2 - math.floor(math.log10(left))
        if decimals > MOST_DECIMALS:
            return f"more than {1 - 10.0 ** (-2 - MOST_DECIMALS):.{MOST_DECIMALS}%}"
    return f"{round(part, decimals + 2) + 0.0:.{decimals}%}"
