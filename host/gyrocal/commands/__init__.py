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


BUILT_IN = ("paper", "default")


def start_and_target(model: Path | None, out: Path | None) -> tuple[Path | None, Path | None]:
    """The model to start from, None for `default`, and the file in which the result is kept, None for none.

    Without ``out`` both are the file of ``--model``, which may be new. Raises InputError where a built-in model would be
    written.
    """
    option, target = ("--out", out) if out is not None else ("--model", model)
    if str(target) in BUILT_IN:
        from gyrocal.errors import InputError

        raise InputError(f"{option} {target}: built in; give the name of a file to write, e.g. -o model.toml")
    new = out is None and model is not None and not model.exists()
    return None if new else model, target


def want_axis(axis: str | None) -> None:
    """Raise InputError unless this is an axis, or no axis was given."""
    from gyrocal.errors import InputError
    from gyrocal.recording.session import AXES

    if axis is not None and axis not in AXES:
        raise InputError(f"--axis {axis}: want x, y or z")


SessionFolder = Annotated[Path, typer.Argument(metavar="SESSION", help="A session folder.")]
KeptModel = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="The model file that gains the effects; made from `default` if it is new. Without it nothing is kept.",
    ),
]
KeptIn = Annotated[
    Path | None,
    typer.Option("-o", "--out", metavar="M.toml", help="Keep the result in this file, and leave that of --model as it is."),
]
GivenModel = Annotated[str | None, typer.Option(help="The model: paper, default, or a model file.")]
OneAxis = Annotated[str | None, typer.Option("--axis", metavar="x|y|z", help="This axis alone.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
OwnEffects = Annotated[
    Path | None,
    typer.Option("--effects", callback=_load, help="A folder with effects of your own (Python files, which are run)."),
]
"""The folder is loaded as soon as the option is read. From then on its effects are equal to the built-in ones."""
Trust = Annotated[bool, typer.Option("--trust", help="Run the code that another option names.")]
"""Consent to run code that a file holds."""
