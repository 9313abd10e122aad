"""The error budget of a calibration on a table, in words."""

from __future__ import annotations

from collections.abc import Sequence

from gyrocal.calibration.budget import BudgetRow, largest
from gyrocal.calibration.calibrate import POOLED, Estimate
from gyrocal.digits import percent, shares
from gyrocal.present.output import stdout, table
from gyrocal.present.taken import words
from gyrocal.units import unit_of


def shown(found: Sequence[Estimate]) -> Estimate | None:
    """The trusted estimate from the longest time with the smallest error of the scale; None if there is none."""
    known = [e for e in found if e.trusted and e.budget and e.scale_se is not None]
    return min(known, key=lambda e: (-e.seconds, e.scale_se), default=None)


def print_budget(found: Sequence[Estimate]) -> None:
    """Print the budget of the estimate by :func:`shown` and its largest source; nothing if no estimate is trusted."""
    best = shown(found)
    if best is None:
        return
    unit = unit_of(e.bias_dps for e in found)
    listed = sorted(best.budget, key=lambda row: (not row.in_se, -(row.scale or 0.0)))
    scale = shares([(row.scale, row.in_se) for row in listed], 100.0)
    bias = shares([(row.bias_dps, row.in_se) for row in listed], unit.per_dps)
    rows = [[row.source, s, b, "yes" if row.in_se else "no"] for row, s, b in zip(listed, scale, bias, strict=True)]
    columns = ["source:", "scale ± %", f"bias ± {unit.name}", "in the standard error:"]
    table(f"Where the error comes from: {answered(best)}", columns, rows)
    stdout.print(headline(best.budget), markup=False)


def answered(one: Estimate) -> str:
    """Which estimate it is, and what it was calculated from."""
    whose = "all power cycles" if one.scenario == POOLED else one.scenario
    return f"axis {one.axis} of {whose}, {one.method}, from {words(one.taken)}"


def headline(rows: Sequence[BudgetRow]) -> str:
    """The largest source and what would lower it; the sources that the session does not show, in a line of their own."""
    top, unknown = largest(rows), [row for row in rows if row.scale is None]
    told = []
    if top is not None:
        where = "in" if top.in_se else "not in"
        told.append(
            f"The largest known source is {top.source}: {_percent(top.scale)} % of the scale, {where} the standard error. "
            f"To lower it, {top.advice}."
        )
    if unknown:
        told.append(f"Not known: {'; '.join(f'{row.source} ({row.advice})' for row in unknown)}.")
    return "\n".join(told)


def _percent(scale: float | None) -> str:
    return percent(scale, scale)[0]
