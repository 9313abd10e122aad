"""One file for each command: ``gyrocal VERB`` is ``run`` in ``commands/VERB.py`` (``import`` is ``import_.py``).

Here are the options that several commands share. It imports whatever lies below it; only ``cli`` imports it.
"""

from pathlib import Path
from typing import Annotated

import typer


def want_trust(trust: bool, what: str) -> None:
    """Raise InputError unless ``--trust`` was given. ``what`` names the option and the code that it runs."""
    from gyrocal.errors import InputError

    if not trust:
        raise InputError(f"{what}. Nothing was run; if you trust this code, add --trust")


def want_pictures(*files: Path | None) -> None:
    """Raise InputError if one of these files is to be drawn, and what draws it is not installed."""
    from gyrocal.extras import want

    drawn = next((file for file in files if file is not None), None)
    if drawn is not None:
        want(f"{drawn}, which has pictures,", "plot")


def _load(folder: Path | None) -> Path | None:
    if folder is not None:
        from gyrocal.effects import base

        base.load(folder)
    return folder


def _writable(model: Path) -> Path:
    """Check the file name of a model to write: any name except those of the built-in models."""
    if str(model) in ("paper", "default"):
        from gyrocal.errors import InputError

        raise InputError(f"--model {model}: built in; give the name of a file to write, e.g. model.toml")
    return model


SessionFolder = Annotated[Path, typer.Argument(metavar="SESSION", help="A session folder.")]
ModelFile = Annotated[
    Path,
    typer.Option(
        callback=_writable, help="The model file to which the effects are added. If there is none, it is made from `default`."
    ),
]  # fmt: skip
GivenModel = Annotated[str | None, typer.Option(help="The model: paper, default, or a model file.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
OwnEffects = Annotated[
    Path | None,
    typer.Option("--effects", callback=_load, help="A folder with effects of your own (Python files, which are run)."),
]
"""The folder is loaded as soon as the option is read. From then on its effects are equal to the built-in ones."""
Trust = Annotated[bool, typer.Option("--trust", help="Run the code that another option names.")]
"""Consent to run code that a file holds."""
