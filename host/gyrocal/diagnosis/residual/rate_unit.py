"""How numbers are told: rates in mdps, or in dps from one degree per second on, and digits as far as the error allows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

LARGE_DPS = 0.9995
"""From here on three digits of mdps would round to 1000."""
UNKNOWN = "-"
"""A number that is not known."""
MOST_PLACES = 7
"""Decimals above which a number is told with an exponent."""
LARGE_PART = 0.01
"""Parts of the rate are told in ppm below this and in percent from here on."""


@dataclass(frozen=True)
class RateUnit:
    """A unit, what it multiplies a rate in deg/s by, and how many more decimals its numbers have than those in mdps."""

    name: str
    per_dps: float
    decimals: int

    def text(self, value_dps: float | None, decimals: int = 1, error_dps: float | None = None) -> str:
        """A rate in deg/s as a number in this unit, rounded as :func:`rounded` does; ``decimals`` are those in mdps."""
        value, error = (None if v is None else v * self.per_dps for v in (value_dps, error_dps))
        return rounded(value, error, decimals + self.decimals)

    def pair(self, value_dps: float | None, se_dps: float | None) -> tuple[str, str]:
        """A rate in deg/s and its standard error as numbers in this unit, as :func:`pair` gives them."""
        return pair(value_dps, se_dps, self.per_dps, 1 + self.decimals)


MDPS = RateUnit("mdps", 1e3, 0)
DPS = RateUnit("dps", 1.0, 1)


def places(error: float | None, otherwise: int) -> int:
    """Decimals that show the first two digits of an error; ``otherwise`` without an error."""
    if error is None or not math.isfinite(error) or error <= 0:
        return otherwise
    return max(0, 1 - math.floor(math.log10(error)))


def rounded(value: float | None, error: float | None, decimals: int) -> str:
    """A number to the second digit of its error, or with ``decimals`` where it has none. A dash for None."""
    if value is None:
        return UNKNOWN
    at = places(error, decimals)
    if at > MOST_PLACES and value != 0:
        return f"{value:.{max(1, math.floor(math.log10(abs(value))) + at)}e}"
    return f"{round(value, at) + 0.0:.{min(at, MOST_PLACES)}f}"


def pair(value: float | None, se: float | None, factor: float, decimals: int) -> tuple[str, str]:
    """A value and its standard error, both times ``factor`` and both as :func:`rounded` gives them."""
    scaled, error = (None if v is None else factor * v for v in (value, se))
    return rounded(scaled, error, decimals), rounded(error, error, decimals)


def shares(parts: Sequence[tuple[float | None, bool]], factor: float) -> list[str]:
    """Parts of an error, times ``factor``, each with whether its square adds to the error's.

    They are told in two digits, but with no decimals beyond the third digit of the error. What these do not show is told as
    less than the last of them.
    """
    whole = math.hypot(*(part or 0.0 for part, inside in parts if inside))
    return [_share(part, whole, factor) for part, _ in parts]


def _share(part: float | None, whole: float, factor: float) -> str:
    if part is None or part == 0:
        return UNKNOWN if part is None else "0"
    at = min(places(factor * part, 0), places(factor * whole, MOST_PLACES) + 1)
    least = 10.0**-at
    return f"< {least:.{at}f}" if factor * part < least else f"{factor * part:.{at}f}"


def negligible(told: str) -> bool:
    """True for a part of an error that :func:`shares` tells as nothing, or as less than its column shows."""
    return told == "0" or told.startswith("<")


def percent(value: float | None, se: float | None) -> tuple[str, str]:
    """A fraction and its standard error in percent, as :func:`pair` gives them."""
    return pair(value, se, 100.0, 4)


def unit_of(values_dps: Iterable[float | None]) -> RateUnit:
    """The unit for rates in deg/s that stand together, as in one table: that of the largest."""
    return DPS if any(v is not None and abs(v) >= LARGE_DPS for v in values_dps) else MDPS


PPM = RateUnit("ppm of the rate", 1e6, 0)
"""A unit of parts of the rate, as is the next; each multiplies a fraction."""
PERCENT = RateUnit("% of the rate", 1e2, 2)


def part_unit(note: str) -> RateUnit:
    """The unit in which the words of a finding, by :func:`part_text`, tell a part of the rate."""
    return PERCENT if "% of the rate" in note else PPM


def rate_text(value_dps: float, sign: str = "") -> str:
    """A rate in three digits with its unit; a ``sign`` of "+" shows that of a positive value too."""
    unit = unit_of([value_dps])
    return f"{plain(value_dps * unit.per_dps, sign)} {unit.name}"


def part_text(part: float, sign: str = "") -> str:
    """A fraction in three digits, as ppm or %; a ``sign`` of "+" shows that of a positive value too."""
    return f"{plain(part * 100, sign)}%" if abs(part) >= LARGE_PART else f"{plain(part * 1e6, sign)} ppm"


def plain(value: float, sign: str = "") -> str:
    """Three digits without an exponent."""
    return f"{value:{sign}.0f}" if abs(value) >= 999.5 else f"{value:{sign}.3g}"
