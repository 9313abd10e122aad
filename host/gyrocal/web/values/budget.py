"""The error budget on the page: each source of error as a bar, and what would lower it."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gyrocal.digits import negligible, shares
from gyrocal.units import MDPS, RateUnit, unit_of

if TYPE_CHECKING:
    from gyrocal.calibration.calibrate import Estimate
    from gyrocal.gravity.budget import BudgetRow as GravityRow


@dataclass(frozen=True)
class Line:
    """A source of error: its parts of scale (fraction) and bias (deg/s), None if unknown, and how to lower it.

    ``in_se`` is False for a bound of what the standard error leaves out.
    """

    source: str
    scale: float | None
    bias_dps: float | None
    in_se: bool
    advice: str


@dataclass(frozen=True)
class Budget:
    """The sources of one answer or axis, as the command line prints them."""

    of: str
    lines: tuple[Line, ...]
    headline: str = ""
    unit: RateUnit = MDPS
    """The unit of the biases, which is that of the answers."""

    def table(self) -> str:
        """The sources as an HTML table with a bar for the scale's part."""
        most = max((line.scale or 0.0 for line in self.lines), default=0.0)
        bounds = any(not line.in_se for line in self.lines)
        source, bias = "source, and what would lower it", f"bias ±, {self.unit.name}"
        head = f"<th class=text>{source}</th><th>scale ±, %</th><td></td><th>{bias}</th>"
        scale = shares([(line.scale, line.in_se) for line in self.lines], 100.0)
        biases = shares([(line.bias_dps, line.in_se) for line in self.lines], self.unit.per_dps)
        rows = "".join(_row(line, most, *told) for line, *told in zip(self.lines, scale, biases, strict=True))
        note = "<p class='dim small'>A pale bar is a bound of what the standard error does not contain.</p>" if bounds else ""
        return f"<table class=plain><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{note}"


def of_answers(found: Sequence[Estimate]) -> Budget | None:
    """The budget that `gyrocal calibrate` prints; None if no answer is trusted."""
    from gyrocal.present.budget import answered, headline, shown

    best = shown(found)
    if best is None:
        return None
    rows = sorted(best.budget, key=lambda row: (not row.in_se, -(row.scale or 0.0)))
    lines = tuple(Line(row.source, row.scale, row.bias_dps, row.in_se, row.advice) for row in rows)
    unit = unit_of(e.bias_dps for e in found)
    return Budget(answered(best), lines, headline(best.budget), unit)


def of_gravity(rows: Sequence[GravityRow], unit: RateUnit = MDPS) -> tuple[Budget, ...]:
    """A budget for each axis of a session by gravity, its biases in ``unit``."""
    axes = dict.fromkeys(row.axis for row in rows)
    mine = {axis: [row for row in rows if row.axis == axis] for axis in axes}
    return tuple(
        Budget(f"axis {axis}", tuple(Line(r.cause, r.scale_se, r.bias_se_dps, True, r.advice) for r in of), unit=unit)
        for axis, of in mine.items()
    )


def _row(line: Line, most: float, scale: str, bias: str) -> str:
    part = (line.scale or 0.0) / most if most > 0 else 0.0
    bar = f'<div class="reached{"" if line.in_se else " bound"}" aria-hidden="true"><div style="width: {part:.1%}"></div></div>'
    outside = "" if line.in_se else " (a bound, not in the standard error)"
    advice = "" if negligible(scale) and negligible(bias) else f"<div class='dim small'>{html.escape(line.advice)}</div>"
    source = html.escape(line.source + outside) + advice
    scale, bias = (html.escape(told).replace(" ", "&nbsp;") for told in (scale, bias))
    return f"<tr><td class=text>{source}</td><td>{scale}</td><td>{bar}</td><td>{bias}</td></tr>"
