"""Drift of a production line: a quantity that changes with the order in which the boards were made.

The boards of a line are sorted by date, or by serial number where no date is given. The test is that of the largest cumulative
sum about the mean, whose limit is the Brownian bridge (Page, Biometrika 41 (1954) 100; Billingsley 1968, section 11).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Board:
    """The place of a board in production: its line, its date and its serial number."""

    line: str
    made_on: str | None
    serial: str

    @property
    def order(self) -> tuple[Any, ...]:
        """Key that sorts boards by date, then by serial number, whose digits count as numbers."""
        parts = re.split(r"(\d+)", self.serial)
        return (self.made_on or "", [(int(p), "") if p.isdigit() else (-1, p) for p in parts])


@dataclass(frozen=True)
class Trend:
    """A quantity that changes on a line: ``before`` and ``after`` the ``change`` (the first date or serial number after it).

    ``shape`` is "step", or "slope" if a straight line over the order of the boards describes the change better.
    """

    parameter: str
    line: str
    shape: str
    change: str
    before: float
    after: float
    p_value: float

    def to_json(self) -> dict[str, Any]:
        return dict(self.__dict__)


def bridge(value: float) -> float:
    """Probability that a Brownian bridge goes further from zero than ``value`` (Kolmogorov's distribution)."""
    from scipy.special import kolmogorov

    return float(kolmogorov(value))


def find(parameters: dict[str, tuple[Array, Sequence[Board]]]) -> list[Trend]:
    """The trends of all quantities; each has values [n] and its boards [n], without those that are odd."""
    tests = [(name, line) for name, (_, boards) in parameters.items() for line in sorted({b.line for b in boards})]
    found = []
    for name, line in tests:
        values, boards = parameters[name]
        trend = _on_line(name, line, [(b, float(v)) for b, v in zip(boards, values, strict=True) if b.line == line])
        if trend is not None and trend.p_value <= POLICY.fleet_trends / len(tests):
            found.append(trend)
    return sorted(found, key=lambda t: t.p_value)


def _on_line(name: str, line: str, made: list[tuple[Board, float]]) -> Trend | None:
    if len(made) < POLICY.fleet_boards:
        return None
    made.sort(key=lambda pair: pair[0].order)
    y = np.array([value for _, value in made])
    n, level = y.size, y - y.mean()
    noise = float(np.sqrt(np.mean(np.diff(y) ** 2) / 2))  # neighbours share the trend
    noise = max(noise, 1e-300)
    split = np.flatnonzero([made[i][0].order[0] != made[i - 1][0].order[0] or not made[i][0].made_on for i in range(1, n)]) + 1
    if not split.size:
        return None
    p_value = bridge(float(np.max(np.abs(np.cumsum(level)[split - 1]))) / (noise * np.sqrt(n)))
    gains = [(i * y[:i].mean() ** 2 + (n - i) * y[i:].mean() ** 2 - n * y.mean() ** 2) / noise**2 for i in split]
    at = int(split[int(np.argmax(gains))])
    x = np.arange(n) - (n - 1) / 2
    slope = float(x @ level / (x @ x))
    straight = slope**2 * float(x @ x) / noise**2
    first = made[at][0]
    if straight > max(gains):
        ends = y.mean() - slope * (n - 1) / 2, y.mean() + slope * (n - 1) / 2
        return Trend(name, line, "slope", made[0][0].made_on or made[0][0].serial, float(ends[0]), float(ends[1]), p_value)
    return Trend(name, line, "step", first.made_on or first.serial, float(y[:at].mean()), float(y[at:].mean()), p_value)
