"""``gyrocal schema``."""

from typing import Annotated

import typer

from gyrocal.commands import AsJson


def run(
    verb: Annotated[str | None, typer.Argument(metavar="[VERB]", help="A verb; left out: all of them by name.")] = None,
    as_json: AsJson = False,
) -> None:
    """Print the JSON schema of what a verb prints with --json, or of every verb."""
    from gyrocal.json_schemas import ANSWERS, schema
    from gyrocal.present.output import emit

    emit(schema(verb) if verb is not None else {name: schema(name) for name in ANSWERS})
