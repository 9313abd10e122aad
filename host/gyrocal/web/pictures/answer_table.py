"""The answers of a calibration as a table, for the page and the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gyrocal.digits import percent
from gyrocal.present.tables import number
from gyrocal.present.taken import cell
from gyrocal.units import RateUnit, unit_of
from gyrocal.web.pictures.words import method


def columns(unit: RateUnit) -> list[str]:
    """The columns of :func:`rows`, whose biases are in a unit."""
    return [
        "power cycle:", "axis:", "method:", "recordings:", "scale, %", "±", f"bias, {unit.name}", "± ", "misfit", "trusted:"
    ]


def rows(found: Sequence[dict[str, Any]]) -> list[list[str]]:
    """One row for each answer, in the unit of all together."""
    unit = unit_of(e["bias_dps"] for e in found)
    return [
        [
            e["scenario"], e["axis"], method(e["method"]), cell(e["taken"]), *percent(e["scale"], e["scale_se"]),
            *unit.pair(e["bias_dps"], e["bias_se_dps"]),
            number(e["misfit"], ".2f"), "yes" if e["trusted"] else "no: " + ", ".join(e["flags"]),
        ]
        for e in found
    ]  # fmt: skip
