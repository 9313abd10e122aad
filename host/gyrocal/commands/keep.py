"""``gyrocal keep``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, KeptIn, KeptModel, OwnEffects, SessionFolder, Trust, start_and_target, want_trust


def run(
    session: SessionFolder,
    model: KeptModel = None,
    out: KeptIn = None,
    name: Annotated[str, typer.Option(help="Name of the effect.")] = "custom",
    file: Annotated[
        Path | None,
        typer.Option(
            help="A new Python file for it, to be edited and named by --effects FOLDER, not a formula. Needs --trust, because "
            "the file is run."
        ),
    ] = None,
    effects: OwnEffects = None,
    trust: Trust = False,
    as_json: AsJson = False,
) -> None:
    """Keep what `diagnose` calls unknown as an effect of your own: find a formula, add it, show the error before and after."""
    from gyrocal.diagnosis.answer.formula_search import keep
    from gyrocal.present.output import emit, plus_minus, stdout, working
    from gyrocal.present.report import print_before_after
    from gyrocal.recording.session import Session

    if file is not None:
        want_trust(trust, f"--file {file}: this Python file is written, and then run")
    start, target = start_and_target(model, out)
    opened = Session.open(session)
    with working(as_json) as say:
        found, before, after, fitted = keep(opened, start, name, file, progress=say)
    if target is not None:
        fitted.save(target)
    if as_json:
        warnings = [w.to_json() for w in before.warnings]
        emit({**found.to_json(), "before": before.to_json(), "after": after.to_json(), "warnings": warnings})
        return
    gain = "" if found.gain is None else f"; held-out gain in log-likelihood {plus_minus(found.gain, found.gain_se)}"
    stdout.print(f"{found.formula}\nfound on {found.axis}, against {found.against.replace('_', ' ')}{gain}", style="bold")
    print_before_after(before, after, target)
    if file is not None:
        stdout.print(f"edit {file}; every command that reads the model wants --effects {file.parent} from now on")
