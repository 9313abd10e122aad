"""The unit in which rates are told: mdps, and dps for what reaches one degree per second."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

LARGE_DPS = 0.9995
"""From here on three digits of mdps would round to 1000."""
LARGE_PART = 0.01
"""Parts of the rate are told in ppm below this and in percent from here on."""


@dataclass(frozen=True)
class RateUnit:
    """A unit, what it multiplies a rate in deg/s by, and how many more decimals its numbers have than those in mdps."""

    name: str
    per_dps: float
    decimals: int

    def text(self, value_dps: float | None, decimals: int = 1) -> str:
        """A rate in deg/s as a number in this unit; ``decimals`` are those in mdps. A dash for None."""
        return "-" if value_dps is None else f"{value_dps * self.per_dps:.{decimals + self.decimals}f}"


MDPS = RateUnit("mdps", 1e3, 0)
DPS = RateUnit("dps", 1.0, 3)


def unit_of(values_dps: Iterable[float | None]) -> RateUnit:
    """The unit for rates in deg/s that stand together, as in one table: that of the largest."""
    return DPS if any(v is not None and abs(v) >= LARGE_DPS for v in values_dps) else MDPS


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
