"""The picture of an effect for the report: the same means, curve, band and words as the large picture of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gyrocal.present.pictures import AXIS_COLOURS, framed
from gyrocal.units import unit_of
from gyrocal.web.pictures import charts
from gyrocal.web.values.views import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def effect_figure(shown: Picture) -> Figure:
    """The residual's means and the effect's curve against the variable that the effect depends on, before it is added."""
    unit = unit_of(1e-3 * v for v in (*shown.left, *shown.curve))
    x = np.asarray(shown.centres)
    left, curve, se = (1e-3 * unit.per_dps * np.asarray(v) for v in (shown.left, shown.curve, shown.se))
    colour = AXIS_COLOURS[shown.axis]
    figure, axes = framed(8, 3.2)
    if shown.few:  # nothing was measured between the values
        axes.errorbar(x, curve, yerr=2 * se, fmt="none", ecolor=colour, elinewidth=9, alpha=0.25, label=charts.WITHIN_SE)
        axes.plot(x, curve, "_", color=colour, ms=18, mew=2.5, label=charts.EFFECT)
        axes.margins(x=0.1)
    else:
        axes.fill_between(x, curve - 2 * se, curve + 2 * se, color=colour, alpha=0.25, linewidth=0, label=charts.WITHIN_SE)
        axes.plot(x, curve, color=colour, lw=2, label=charts.EFFECT)
    axes.plot(x, left, "o", color="black", ms=4, label=charts.LEFT)
    if shown.marks:
        axes.set_xticks(list(shown.marks), list(shown.marks.values()))
    where = "all recordings" if shown.run is None else shown.file
    axes.set(xlabel=shown.x_label, ylabel=unit.name)
    axes.set_title(f"Left over on {shown.axis}, {where}", pad=26)
    axes.legend(frameon=False, fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 0.99), ncols=3)
    return figure
