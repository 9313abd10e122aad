"""The display of results in Python and in a notebook. ``gyrocal.present.notebook`` defines it for each kind of result."""

from __future__ import annotations

import html
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class View:
    """The display of one kind of result: words (the first line is the summary), a table, and a picture."""

    summary: Callable[[Any], str]
    table: Callable[[Any], pl.DataFrame]
    figure: Callable[[Any], Figure]


VIEWS: dict[type, View] = {}
"""The display by class of result; filled when ``gyrocal.api`` is imported."""
HTML_ROWS = 20


class Shown:
    """A result with ``summary()``, ``to_dataframe()`` (polars) and ``plot()`` (matplotlib)."""

    def _view(self) -> View | None:
        return next((VIEWS[kind] for kind in type(self).__mro__ if kind in VIEWS), None)

    def _known_view(self) -> View:
        view = self._view()
        if view is None:
            raise RuntimeError("import gyrocal.api first: it says how results are shown")
        return view

    def summary(self) -> str:
        """The result in words, a few lines."""
        return self._known_view().summary(self)

    def to_dataframe(self) -> pl.DataFrame:
        """The result as a table; ``.to_pandas()`` converts it."""
        return self._known_view().table(self)

    def plot(self) -> Figure:
        """The result as a picture; a notebook shows it, ``.savefig(path)`` writes it."""
        return self._known_view().figure(self)

    def __repr__(self) -> str:
        view = self._view()
        return f"<{type(self).__name__}{f': {view.summary(self).splitlines()[0]}' if view else ''}>"

    def _repr_html_(self) -> str:
        view = self._known_view()
        return f"<pre>{html.escape(view.summary(self))}</pre>{view.table(self).head(HTML_ROWS)._repr_html_()}"
