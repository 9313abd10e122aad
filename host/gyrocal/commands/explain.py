"""``gyrocal explain``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, KeptIn, KeptModel, OwnEffects, SessionFolder, start_and_target, want_pictures
from gyrocal.policy import POLICY


def run(
    session: SessionFolder,
    model: KeptModel = None,
    out: KeptIn = None,
    most_steps: Annotated[int, typer.Option("--max", metavar="N", help="Stop after this many steps.")] = POLICY.most_steps,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the whole explanation as one page.")] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Find and add every missing effect that is certain, and state what stays open.

    The model is kept in the file of --out, or of --model; without them nothing is written.
    """
    from gyrocal.diagnosis.answer.explain import explain
    from gyrocal.present.explanation import print_explanation, write_explanation
    from gyrocal.present.output import emit, stderr, working
    from gyrocal.present.report import kept_in
    from gyrocal.recording.session import Session

    want_pictures(html)
    start, target = start_and_target(model, out)
    opened = Session.open(session)
    if opened.reference.kind == "gravity":
        from gyrocal.present.gravity import show_explain

        show_explain(opened, session, start, target, most_steps, html, as_json)
        return
    with working(as_json) as say:
        found = explain(opened, start, most_steps=most_steps, progress=say)
    if found.verdict != "implausible" and target is not None:
        found.model.save(target)
    if html is not None:
        write_explanation(html, found)
    if as_json:
        emit(found.to_json())
        if found.verdict == "implausible" and target is not None:
            stderr.print(kept_in(target, found.model.ids, found.verdict))
    else:
        print_explanation(found, session, target)
