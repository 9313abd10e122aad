"""``gyrocal firmware``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson


def run(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder, or a project written before.")],
    model: Annotated[str | None, typer.Option(help="Error model (name or TOML) that the device calibrates by.")] = None,
    axis: Annotated[str, typer.Option(help="The sensor's axis along the table's that the model is for: x, y or z.")] = "z",
    include: Annotated[
        Path | None, typer.Option(help="Folder of calibration.h and weights.h, as `gyrocal export` writes them.")
    ] = None,
    part_file: Annotated[
        Path | None,
        typer.Option(help="The configuration file that a BMI270 needs: Bosch's bmi270.c, or its bytes."),
    ] = None,
    library: Annotated[
        bool, typer.Option("--library", help="Write a library for Arduino, PlatformIO, ESP-IDF or CMake in place of a project.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Write a PlatformIO project: the firmware with the shipped headers, or those of --model and --include.

    In it, `pio run -t upload` builds and flashes it, `pio device monitor` reads it. With --library, the core alone: drivers,
    calibration and protocol, with examples, for a program of your own.
    """
    from gyrocal.core.firmware_project import create, create_library
    from gyrocal.errors import InputError
    from gyrocal.present.output import emit

    if axis not in ("x", "y", "z"):
        raise InputError(f"--axis {axis}: want x, y or z")
    if library:
        create_library(directory, model, include, axis, part_file)
        if as_json:
            emit({"folder": str(directory), "kind": "library"})
            return
        typer.echo(f"{directory}: put it where your Arduino, PlatformIO or ESP-IDF project keeps its libraries; see examples/")
        return
    create(directory, model, include, axis, part_file)
    if as_json:
        emit({"folder": str(directory), "kind": "project"})
        return
    typer.echo(f"{directory}: flash it with: cd {directory} && pio run -t upload && pio device monitor")
