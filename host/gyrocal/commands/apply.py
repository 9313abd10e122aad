"""``gyrocal apply``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, OwnEffects


def run(
    source: Annotated[Path, typer.Argument(metavar="SRC", help="A session folder, a CSV or a Parquet table.")],
    model: Annotated[Path, typer.Option(help="The model file, with fitted values.")],
    out: Annotated[Path, typer.Option(help="The corrected recording: a folder for a session, else a table.")],
    bias: Annotated[
        str, typer.Option(metavar="model|rest:S|FILE", help="This power cycle's bias: the model's, the mean of the first S "
                          "seconds at rest, or the output of `gyrocal calibrate --json`.")
    ] = "model",
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Correct recorded rates with a model."""
    from gyrocal.calibration.apply import apply
    from gyrocal.present.output import emit, stdout

    found = apply(source, model, out, bias)
    if as_json:
        emit(found.to_json())
        return
    stdout.print(f"{out}: {found.rows} rows; removed: {', '.join(found.applied) or 'nothing'}")
    for effect, why in found.left.items():
        stdout.print(f"{effect} stays in the readings: {why}")
