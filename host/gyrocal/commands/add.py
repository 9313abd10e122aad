"""``gyrocal add``."""

import os.path
from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, KeptIn, KeptModel, OneAxis, OwnEffects, SessionFolder, start_and_target, want_axis


def run(
    effect: Annotated[str, typer.Argument(metavar="EFFECT", help="An effect's id, e.g. table_ripple, or [NAME:] FORMULA.")],
    session: SessionFolder,
    model: KeptModel = None,
    out: KeptIn = None,
    axis: OneAxis = None,
    heldout_day: Annotated[int | None, typer.Option(help="Judge on this day only.")] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Add an effect to a model: fit it on all data, show the error before and after on held-out data.

    EFFECT and SESSION may be given in either order. The model is kept in the file of --out, or of --model; without
    them nothing is written.
    """
    from gyrocal.diagnosis.answer.add import add, effect_named
    from gyrocal.effects.base import effects as effects_known
    from gyrocal.present.output import emit, working
    from gyrocal.present.report import print_before_after
    from gyrocal.recording.session import Session

    # ``os.path.exists`` and not ``Path.exists``, which raises where a formula is longer than a name of a file may be.
    swapped = str(session) in effects_known() and effect not in effects_known()
    if swapped or (os.path.exists(effect) and not os.path.exists(session)):
        effect, session = str(session), Path(effect)
    want_axis(axis)
    start, target = start_and_target(model, out)
    effect_named(effect)
    opened = Session.open(session)
    if opened.reference.kind == "gravity":
        from gyrocal.present.gravity import show_add

        show_add(opened, effect, start, target, heldout_day, as_json, axis)
        return
    with working(as_json) as say:
        before, after, fitted = add(opened, start, effect, axis=axis, only_day=heldout_day, progress=say)
    if target is not None:
        fitted.save(target)
    if as_json:
        warnings = [w.to_json() for w in before.warnings]
        emit({"before": before.to_json(), "after": after.to_json(), "warnings": warnings})
    else:
        print_before_after(before, after, target)
