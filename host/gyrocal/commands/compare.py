"""``gyrocal compare``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, GivenModel, OneAxis, OwnEffects, SessionFolder, want_axis, want_pictures


def run(
    session: SessionFolder,
    model: GivenModel = None,
    axis: OneAxis = None,
    as_is: Annotated[
        bool, typer.Option("--as-is", help="Keep the file's parameters: does the model still hold, and which have moved?")
    ] = False,
    html: Annotated[Path | None, typer.Option(help="Write a page with pictures.")] = None,
    pictures: Annotated[Path | None, typer.Option(help="Write the pictures alone, as PNG, into a folder.")] = None,
    residuals: Annotated[
        Path | None, typer.Option(help="Write file,t_s,axis,measured_dps,modelled_dps as CSV or Parquet.")
    ] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Compare the model with the measurements: how much error is left beyond the noise, and where."""
    from gyrocal.diagnosis.answer.compare import compare
    from gyrocal.diagnosis.residual.residual_table import write_residuals
    from gyrocal.errors import InputError
    from gyrocal.present.output import emit, working
    from gyrocal.present.report import print_comparison, write_page
    from gyrocal.recording.session import Session

    for target in (html, pictures, residuals):
        if target is not None and not target.absolute().parent.is_dir():
            raise InputError(f"{target}: no such folder to write into")
        if target is not None and target != pictures and target.is_dir():
            raise InputError(f"{target}: a folder; give the name of a file in it")
    want_axis(axis)
    want_pictures(html, pictures)
    opened = Session.open(session)
    if opened.reference.kind == "gravity":
        from gyrocal.present.gravity import show_compare

        show_compare(opened, model, residuals, html or pictures, as_json, as_is, axis)
        return
    with working(as_json) as say:
        found = compare(opened, model, as_is=as_is, progress=say)
        if axis is not None:
            found = found.on(axis)
        if residuals is not None:
            write_residuals(found, residuals)
        if html is not None:
            say("drawing")
            write_page(html, found)
        if pictures is not None:
            from gyrocal.present.pictures import save

            say("drawing")
            save(found, pictures)
    if as_json:
        emit(found.to_json())
    else:
        print_comparison(found)
