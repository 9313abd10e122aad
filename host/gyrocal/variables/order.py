"""Order: lines of the residual's spectrum over the angle of the table."""

from __future__ import annotations

from gyrocal.variables.base import Variable


class Order(Variable):
    name, title, quantity, unit, order = "order", "Orders", "order", "per turn", 12
    picture = "spectrum"
    no_formula = "it is a line at a fixed number per turn; a tone of the table's angle describes it"
