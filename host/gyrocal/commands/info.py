"""``gyrocal info``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, OwnEffects


def run(
    source: Annotated[Path, typer.Argument(metavar="SRC", help="A session, a model, a plan, or any log that can be imported.")],
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Say what a file or a folder holds."""
    from gyrocal.present.holds import holds, print_held
    from gyrocal.present.output import emit

    found = holds(source)
    if as_json:
        emit(found)
    else:
        print_held(source, found)
