"""``gyrocal plot``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, OwnEffects, want_pictures


def run(
    source: Annotated[Path, typer.Argument(metavar="SRC", help="A session, a log, or a model file.")],
    out: Annotated[Path, typer.Argument(metavar="FILE", help="The picture: .png, .pdf or .svg by its name; it is replaced.")],
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Draw a session's recordings, the readings of any log, or a model's parameters, into a file."""
    from gyrocal.present.drawing import draw

    want_pictures(out)
    draw(source, out)
    if as_json:
        from gyrocal.present.output import emit

        emit({"file": str(out)})
