"""Models as files of other programs: one module for each target, whose ``render`` turns a model into text.

A target lists under ``left`` what it cannot hold. ``gyrocal export --format NAME`` finds the targets in this folder.
"""

import pkgutil


def targets() -> list[str]:
    """The names of all targets."""
    return sorted(info.name.rstrip("_") for info in pkgutil.iter_modules(__path__) if info.name != "base")
