"""Self-contained HTML pages. All of them extend ``page.html``, which holds the style, the warnings and the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyrocal import __version__
from gyrocal.errors import InputError
from gyrocal.extras import needed
from gyrocal.files import replace_text
from gyrocal.present.tables import plain
from gyrocal.recording.session import Session
from gyrocal.warning import Warning, by_weight, line

if TYPE_CHECKING:
    from markupsafe import Markup


def render(template: str, name: str, verdict: str, adequate: bool, warnings: Sequence[Warning], **content: Any) -> str:
    """The page as HTML text.

    ``template`` is a path inside the package, such as ``present/report.html``. ``name`` is the heading, and ``verdict`` is the
    sentence below it, which is marked green if ``adequate``. ``content`` is what the template itself shows; beside it a
    template has ``table(columns, rows, kind)`` for every table.
    """
    jinja2 = needed("jinja2", "plot", "a page")
    package = files("gyrocal")
    loader = jinja2.FunctionLoader(lambda path: package.joinpath(path).read_text(encoding="utf-8"))
    text: str = jinja2.Environment(autoescape=True, loader=loader).get_template(template).render(
        name=name, verdict=verdict, adequate=adequate, warnings=[(w.blocking, line(w)) for w in by_weight(warnings)],
        version=__version__, table=_table, **content,
    )  # fmt: skip
    return text


def _table(columns: Sequence[str], rows: Sequence[Sequence[object]], kind: str = "") -> Markup:
    """A table that scrolls where it is wider than the page, and repeats its header on each printed page."""
    from markupsafe import Markup

    return Markup(f'<div class="wide">{plain(columns, rows, kind=kind)}</div>')


def write(path: Path, text: str) -> None:
    """Write a page whole or not at all. Raises InputError if the file cannot be written."""
    try:
        replace_text(path, text)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None


def name_of(session: Session) -> str:
    """The name of the session's folder."""
    return session.path.name if session.path else "session"
