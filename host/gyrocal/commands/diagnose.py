"""``gyrocal diagnose``."""

from typing import Annotated

import typer

from gyrocal.commands import AsJson, GivenModel, OneAxis, OwnEffects, SessionFolder, want_axis


def run(
    session: SessionFolder,
    model: GivenModel = None,
    axis: OneAxis = None,
    formula: Annotated[
        list[str] | None, typer.Option(metavar="[NAME:] FORMULA", help="Try a formula of your own too; may be repeated.")
    ] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Find the physical effect that the model is missing, with evidence on held-out data."""
    from gyrocal.diagnosis.answer.diagnose import diagnose
    from gyrocal.present.output import emit, working
    from gyrocal.present.report import print_diagnosis
    from gyrocal.recording.session import Session

    want_axis(axis)
    opened = Session.open(session)
    if opened.reference.kind == "gravity":
        from gyrocal.present.gravity import show_diagnose

        show_diagnose(opened, session, model, formula or (), as_json, axis)
        return
    with working(as_json) as say:
        found = diagnose(opened, model, formulas=formula or (), progress=say)
    if axis is not None:
        found = found.on(axis)
    if as_json:
        emit(found.to_json())
    else:
        print_diagnosis(found, session, model)
