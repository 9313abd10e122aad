"""Named values of an effect as the coefficients of its columns, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.parameter import Values
from gyrocal.recording.session import Array


class Coding:
    """The ordinary rule: each linear parameter is the coefficient of one column, and is in use if the values contain it.

    A coefficient that differs from run to run does so with the standard deviation ``NAME_sd``.
    """

    parts: tuple[tuple[float, ...], ...] = ((),)
    """What tells the columns of one parameter apart, one entry a column: the last arguments of ``effects/<id>.c``."""

    def __init__(self, linear: Sequence[str]) -> None:
        self.linear = linear

    def used(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """The linear parameters in use."""
        return tuple(name for name in self.linear if name in values)

    def coefficients(self, values: Mapping[str, float]) -> Array:
        """Linear coefficients [k] from values; the mean over runs if the runs differ."""
        return np.array([values[name] for name in self.used(values)])

    def named(self, coefficients: Array, values: Mapping[str, float]) -> Values:
        """Named linear parameters from coefficients [k]; ``values`` determines which are in use."""
        return dict(zip(self.used(values), map(float, coefficients), strict=True))

    def spread(self, values: Mapping[str, float]) -> Array:
        """Standard deviation of each coefficient over the runs, shape [k]; zero if the effect is the same in all runs."""
        return np.array([values.get(f"{name}_sd", 0.0) for name in self.used(values)])

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        """The parameters of spreads [k]: the inverse of :meth:`spread`."""
        return {f"{name}_sd": float(sd) for name, sd in zip(self.used(values), spread, strict=True)}

    def groups(self, values: Mapping[str, float]) -> list[int]:
        """The index of each column's spread. Columns that share a spread have the same index (a cosine and its sine)."""
        return [i for i in range(len(self.used(values))) for _ in self.parts]


class AboutZero(Coding):
    """Coefficients that differ from run to run about zero: the value is their standard deviation."""

    def spread(self, values: Mapping[str, float]) -> Array:
        return np.array([values.get(name, 0.0) for name in self.used(values)])

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return dict(zip(self.used(values), map(float, spread), strict=True))


class OneSpread(Coding):
    """Coefficients that differ from run to run about zero with one standard deviation, ``sd``."""

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {"sd": float(spread[0])}

    def groups(self, values: Mapping[str, float]) -> list[int]:
        return [0] * len(self.linear)
