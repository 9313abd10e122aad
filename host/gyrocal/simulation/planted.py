"""What ``--effect`` of the command line says is to be planted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gyrocal.effects.base import Values, effect
from gyrocal.errors import InputError
from gyrocal.parameter import Described


def parse(text: str, find: Callable[[str], Described] = effect) -> tuple[str, Values]:
    """Parse ``ID[:name=value[,name=value...]]`` of the command line into an id and values.

    ``find`` returns the effect or noise with an id. Raises InputError for an unknown id or name, or an invalid number.
    """
    effect_id, _, rest = text.partition(":")
    kind = find(effect_id.strip())
    values: Values = {}
    for part in filter(None, (p.strip() for p in rest.split(","))):
        name, equals, value = part.partition("=")
        name = kind.parameter(name.strip()).name
        try:
            values[name] = float(value)
        except ValueError:
            raise InputError(f"--effect {text}: {part!r} is not name=value with a number") from None
        if not equals or not np.isfinite(values[name]):
            raise InputError(f"--effect {text}: {part!r} is not name=value with a finite number")
        if refusal := kind.parameter(name).refusal(values[name]):
            raise InputError(f"--effect {text}: {refusal}")
    return kind.id, values
