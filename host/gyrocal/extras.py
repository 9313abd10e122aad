"""The packages that only some verbs need. Each set of them is an extra of ``pip install 'gyrocal[extra]'``.

The sets are those of ``pyproject.toml``.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from gyrocal.errors import InputError

EXTRAS: dict[str, tuple[str, ...]] = {
    "fleet": ("distributed",), "net": ("onnxruntime",), "page": ("nicegui", "matplotlib", "jinja2"),
    "plot": ("matplotlib", "jinja2"),
}  # fmt: skip
"""The modules of the extras whose absence is told before any work is done."""


def lacking(*extras: str) -> dict[str, str]:
    """The first missing module of each of these extras that is not installed whole."""
    missing = {extra: [name for name in EXTRAS[extra] if importlib.util.find_spec(name) is None] for extra in extras}
    return {extra: names[0] for extra, names in missing.items() if names}


def want(what: str, *extras: str) -> None:
    """Raise InputError with the command that installs what ``what`` lacks, unless all of these extras are installed."""
    missing = lacking(*extras)
    if missing:
        raise InputError(_advice(what, ", ".join(dict.fromkeys(missing.values())), ",".join(missing)))


def needed(module: str, extra: str, what: str) -> Any:
    """Import a module that comes with an extra, or with none (""). Raises InputError that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise InputError(_advice(what, module.partition(".")[0], extra)) from None


def _advice(what: str, packages: str, extras: str) -> str:
    are = "are" if "," in packages else "is"
    install = f"'gyrocal[{extras}]'" if extras else packages
    return f"{what} needs {packages}, which {are} not installed: pip install {install}"
