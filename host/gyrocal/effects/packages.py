"""Effects that installed packages bring, by an entry point of the group ``gyrocal.effects`` that names a module with them."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import entry_points
from types import ModuleType

from gyrocal.errors import InputError, first_line

GROUP = "gyrocal.effects"


def modules() -> Iterator[ModuleType]:
    """The modules of effects of all installed packages. Raises InputError for one that cannot be imported."""
    for name, package in packages().items():
        try:
            yield importlib.import_module(name)
        except Exception as error:
            reason = f"{type(error).__name__}: {first_line(error)}"
            raise InputError(f"the package {package} with effects fails ({reason}); mend it or uninstall it") from error


@cache
def packages() -> dict[str, str]:
    """The names of the packages by the modules that their entry points name."""
    points = entry_points(group=GROUP)
    return {point.value: point.dist.name if point.dist is not None else point.name for point in points}


def package_of(kind: object) -> str:
    """The name of the package that brings an effect; empty if gyrocal or the user does."""
    return packages().get(type(kind).__module__, "")
