"""Effects of the user's own as classes: made known as if they were in the library."""

from __future__ import annotations

from gyrocal.effects.base import Effect, effects
from gyrocal.errors import InputError

LIBRARY = "gyrocal.effects."


def known(kind: Effect | type[Effect]) -> Effect:
    """The effect of a class or an instance, which all commands of this process know by its id from now on.

    A class that is defined anew, as in a notebook, takes the place of the one before. Raises InputError if the id is that of an
    effect of the library.
    """
    made = kind() if isinstance(kind, type) else kind
    there = effects().get(made.id)
    if there is not None and type(there) is not type(made) and type(there).__module__.startswith(LIBRARY):
        raise InputError(f"{type(made).__name__}: its id {made.id!r} is that of an effect of the library; give it another id")
    if there is None or type(there) is not type(made):
        effects()[made.id] = made
    return effects()[made.id]
