"""``gyrocal apply``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyrocal.commands import AsJson, OwnEffects
from gyrocal.commands.import_ import Columns, Format, LsbDps, LsbG, Map, RateHz, Skip, Topic, Yes, confirmed, names_of

if TYPE_CHECKING:
    from gyrocal.recording.importer import Imported


def run(
    source: Annotated[Path, typer.Argument(metavar="SRC", help="A session folder, or any log that `gyrocal import` reads.")],
    model: Annotated[Path, typer.Option(help="The model file, with fitted values.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="The corrected recording: a folder for a session, else a table (.csv, .csv.gz, .parquet)."
        ),
    ],
    bias: Annotated[
        str, typer.Option(metavar="model|rest:S|FILE", help="This power cycle's bias: the model's, the mean of the first S "
                          "seconds at rest, or the output of `gyrocal calibrate --json`.")
    ] = "model",
    maps: Map = None,
    yes: Yes = False,
    form: Format = None,
    topic: Topic = None,
    columns: Columns = None,
    skip: Skip = None,
    rate_hz: RateHz = None,
    lsb_dps: LsbDps = None,
    lsb_g: LsbG = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Correct recorded rates with a model: those of a session or of any log. No true rate is needed.

    A log gives a table with the columns of a session. Its columns are mapped as `gyrocal import` does; without --map they are
    guessed, shown, and taken if you agree.
    """
    from gyrocal.calibration.apply import apply
    from gyrocal.present.output import emit, stdout
    from gyrocal.present.report import print_warnings

    guessed: list[str] = []

    def confirm(log: "Imported") -> None:
        guessed.extend(g.map for g in log.guessed)
        if not as_json:
            confirmed(log, yes, "Correct it so?")

    found = apply(
        source, model, out, bias, maps or (), confirm=confirm, form=form, topic=topic, columns=names_of(columns), skip=skip,
        rate_hz=rate_hz, lsb_dps=lsb_dps, lsb_g=lsb_g,
    )  # fmt: skip
    if as_json:
        emit(found.to_json() | ({"guessed": guessed} if guessed else {}))
        return
    print_warnings(found.warnings)
    stdout.print(f"{out}: {found.rows} rows; removed: {', '.join(found.applied) or 'nothing'}")
    if found.accelerometer:
        stdout.print("accelerations: scale, bias and misalignment of the accelerometer removed")
    for effect, why in found.left.items():
        stdout.print(f"{effect} stays in the readings: {why}")
