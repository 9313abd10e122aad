"""The units in which people read numbers: rates in mdps, or in dps from one degree per second on, and °C for degC of files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gyrocal.digits import pair, plain, rounded

IN_FILES = "degC"
CELSIUS = "°C"
LARGE_DPS = 0.9995
"""From here on three digits of mdps would round to 1000."""
LARGE_PART = 0.01
"""Parts of the rate are told in ppm below this and in percent from here on."""


def to_read(unit: str) -> str:
    """A unit, as "dps/degC", in the letters of a screen, of a report and of printed text."""
    return unit.replace(IN_FILES, CELSIUS)


def number_of(count: int, noun: str) -> str:
    """A count with its noun: "1 run", "2 runs"."""
    return f"{count} {noun}" + "s" * (count != 1)


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
PPM = RateUnit("ppm of the rate", 1e6, 0)
"""A unit of parts of the rate, as is the next; each multiplies a fraction."""
PERCENT = RateUnit("% of the rate", 1e2, 2)


def unit_of(values_dps: Iterable[float | None]) -> RateUnit:
    """The unit for rates in deg/s that stand together, as in one table: that of the largest."""
    return DPS if any(v is not None and abs(v) >= LARGE_DPS for v in values_dps) else MDPS


def rate_text(value_dps: float, sign: str = "") -> str:
    """A rate in three digits with its unit; a ``sign`` of "+" shows that of a positive value too."""
    unit = unit_of([value_dps])
    return f"{plain(value_dps * unit.per_dps, sign)} {unit.name}"


def part_unit(note: str) -> RateUnit:
    """The unit in which the words of a finding, by :func:`part_text`, tell a part of the rate."""
    return PERCENT if "% of the rate" in note else PPM


def part_text(part: float, sign: str = "") -> str:
    """A fraction in three digits, as ppm or %; a ``sign`` of "+" shows that of a positive value too."""
    return f"{plain(part * 100, sign)}%" if abs(part) >= LARGE_PART else f"{plain(part * 1e6, sign)} ppm"
