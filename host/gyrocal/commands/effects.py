"""``gyrocal effects``."""

from typing import Annotated

import typer

from gyrocal.commands import AsJson, OwnEffects


def run(
    effect: Annotated[str | None, typer.Argument(metavar="[ID]", help="Explain this one.")] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """List the effects that are known, or explain one: its cause, its equation, and what looks like it."""
    from gyrocal.effects import base
    from gyrocal.present.library import listed, print_effect, print_library
    from gyrocal.present.output import emit

    found = list(base.effects().values()) if effect is None else [base.effect(effect)]
    if as_json:
        emit({"effects": listed(found)})
    elif effect is None:
        print_library(found)
    else:
        print_effect(found[0])
