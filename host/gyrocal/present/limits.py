"""What a session excludes of an effect that it does not prove: the size above which it would have been seen."""

from __future__ import annotations

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.present.report import in_percent
from gyrocal.units import to_read

ERRORS_OF_LIMIT = 1.96
"""Standard errors beyond the fitted value at which 95 % of a normal distribution end on both sides."""


def limits(c: Candidate) -> str:
    """The largest sizes of a fitted effect that agree with the session at 95 %, in words; empty if it was not fitted."""
    units = {p.name: to_read(p.unit) for p in c.effect.parameters}
    told = []
    for name in c.effect.coding.used(c.values):
        se = c.se.get(name)
        if se:
            factor, unit = in_percent(units.get(name, ""))
            told.append(f"|{name}| is below {factor * (abs(c.values[name]) + ERRORS_OF_LIMIT * se):.2g} {unit}".rstrip())
    return f"{', '.join(told)} at 95 %" if told else ""
