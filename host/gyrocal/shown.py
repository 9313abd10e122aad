"""The display of results in Python and in a notebook. ``gyrocal.present.notebook`` defines it for each kind of result.

What models and results can do by the layers above them is given here by ``gyrocal.api``.
"""

from __future__ import annotations

import html
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gyrocal.extras import needed

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class View:
    """The display of one kind of result: words (the first line is the summary), a table, and a picture."""

    summary: Callable[[Any], str]
    table: Callable[[Any], pl.DataFrame]
    figure: Callable[[Any], Figure]


VIEWS: dict[type, View] = {}
"""The display by class of result; filled when a result is first shown after an import of ``gyrocal.api``."""
HTML_ROWS = 20


_fill: Callable[[], object] | None = None


def views_from(fill: Callable[[], object]) -> None:
    """Have :data:`VIEWS` filled by a function when a result is first shown."""
    global _fill
    _fill = fill


_export: Callable[..., Any] | None = None


def exports_by(export: Callable[..., Any]) -> None:
    """Have models exported by a function of a layer above them."""
    global _export
    _export = export


def exporter() -> Callable[..., Any]:
    """The function of :func:`exports_by`."""
    if _export is None:
        raise RuntimeError("import gyrocal.api first: it says how a model is exported")
    return _export


def pandas_of(table: pl.DataFrame) -> pd.DataFrame:
    """A polars table as a pandas one. polars itself needs pyarrow for that, which is larger than all of gyrocal."""
    pandas = needed("pandas", "", "to_pandas()")
    columns = {c.name: c.to_list() if c.dtype.is_nested() else c.to_numpy() for c in table.get_columns()}
    found: pd.DataFrame = pandas.DataFrame(columns)
    return found


class Shown:
    """A result with ``summary()``, ``to_dataframe()`` (polars) and ``plot()`` (matplotlib)."""

    def _view(self) -> View | None:
        if _fill is not None and not VIEWS:
            _fill()
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
        """The result as a polars table."""
        return self._known_view().table(self)

    def to_pandas(self) -> pd.DataFrame:
        """The result as a pandas table, for which pandas is enough. Raises InputError where that is not installed."""
        return pandas_of(self.to_dataframe())

    def plot(self) -> Figure:
        """The result as a picture; a notebook shows it, ``.savefig(path)`` writes it."""
        return self._known_view().figure(self)

    def __repr__(self) -> str:
        view = self._view()
        return f"<{type(self).__name__}{f': {view.summary(self).splitlines()[0]}' if view else ''}>"

    def _repr_html_(self) -> str:
        view = self._known_view()
        return f"<pre>{html.escape(view.summary(self))}</pre>{view.table(self).head(HTML_ROWS)._repr_html_()}"
