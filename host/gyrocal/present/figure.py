"""An empty figure of matplotlib, which is imported when the first picture is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gyrocal.extras import needed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float, **options: Any) -> Figure:
    """A figure of ``width`` by ``height`` inches without axes. Raises InputError if matplotlib is not installed."""
    figure: Figure = needed("matplotlib.figure", "plot", "a picture").Figure(
        figsize=(width, height), layout="constrained", **options
    )
    return figure
