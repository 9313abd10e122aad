"""How many digits of a number people are shown: as far as its error allows, or three, and percentages."""

from __future__ import annotations

import math
from collections.abc import Sequence

UNKNOWN = "-"
"""A number that is not known."""
MOST_PLACES = 7
"""Decimals above which a number is told with an exponent."""
MOST_DECIMALS = 3
"""Decimals of a percentage with which a part is shown that is nearly the whole."""


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


def plain(value: float, sign: str = "") -> str:
    """Three digits without an exponent."""
    return f"{value:{sign}.0f}" if abs(value) >= 999.5 else f"{value:{sign}.3g}"


def percent(value: float | None, se: float | None) -> tuple[str, str]:
    """A fraction and its standard error in percent, as :func:`pair` gives them."""
    return pair(value, se, 100.0, 4)


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
