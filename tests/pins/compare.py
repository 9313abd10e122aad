"""Answers as text in which every figure stands with its error, ``0.0051±0.0003``, and what differs between two of them.

Words, names, counts and structure must be equal. A figure must be within one of its errors of the pinned one, because another
processor adds in another order, and the search for the noise then stops elsewhere in the flat top of its likelihood. As far as
the data cannot tell these places apart, no figure moves by more than its error. A change of behaviour that changes no word and
moves no figure by its error is not seen here; the tests of the layers see it.

A standard deviation, the errors among them, may differ by a ``QUARTER``: n independent deviations tell it to the part
``1 / sqrt(2 n)`` of itself, and these sessions have about 8 (power cycles, days, correlation times of the drift). The same
holds of figures without an error of their own, such as the size of the drift or the number of jumps.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

QUARTER = 0.25
FIGURE = re.compile(r"(-?\d[\d.]*(?:e[-+]\d+)?)±(\d[\d.]*(?:e[-+]\d+)?)")
NUMBER = re.compile(r"(?<![\w.±])-?\d+\.\d+(?:e[-+]?\d+)?(?![.\d±])")
DIGITS = 2
"""Significant digits of an error; its figure ends with the last of them. Rounding moves neither by a tenth of the error."""


def figure(value: float, error: float | None = None) -> str:
    """A figure with its error, both rounded; where there is no error, a quarter of the figure."""
    error = QUARTER * abs(value) if error is None else error
    if error == 0.0 or not math.isfinite(error):
        return f"{value:.3g}±{error:.3g}"
    place = DIGITS - 1 - math.floor(math.log10(error))
    return f"{round(value, place) + 0.0:.12g}±{round(error, place):.12g}"


def with_quarters(text: str) -> str:
    """A text in which each decimal fraction is a figure without an error of its own."""
    return NUMBER.sub(lambda number: figure(float(number[0])), text)


def differences(pinned: Any, found: Any, where: str = "", errors: float = 1.0) -> Iterator[str]:
    """One line for each place where ``found`` is not ``pinned``, figures within so many of their errors."""
    if isinstance(pinned, dict) and isinstance(found, dict):
        for key in pinned.keys() | found.keys():
            if key in pinned and key in found:
                yield from differences(pinned[key], found[key], f"{where}/{key}", errors)
            else:
                yield f"{where}/{key}: is {'missing' if key in pinned else 'new'}"
    elif isinstance(pinned, list) and isinstance(found, list) and len(pinned) == len(found):
        for i, (one, other) in enumerate(zip(pinned, found, strict=True)):
            yield from differences(one, other, f"{where}/{i}", errors)
    elif isinstance(pinned, str) and isinstance(found, str):
        if not same(pinned, found, errors):
            yield f"{where}: {found!r}, pinned is {pinned!r}"
    elif type(pinned) is not type(found) or pinned != found:
        yield f"{where}: {found!r}, pinned is {pinned!r}"


def same(pinned: str, found: str, errors: float = 1.0) -> bool:
    """True if two texts are equal but for figures that agree."""
    if FIGURE.sub("±", pinned) != FIGURE.sub("±", found):
        return False
    pairs = zip(FIGURE.findall(pinned), FIGURE.findall(found), strict=True)
    return all(agree(*map(float, one), *map(float, other), errors) for one, other in pairs)


def agree(value: float, error: float, other: float, other_error: float, errors: float = 1.0) -> bool:
    """True if two figures are within so many of their errors, and the errors within a quarter."""
    smaller, larger = sorted([error, other_error])
    return abs(other - value) <= errors * larger and larger - smaller <= QUARTER * larger
