"""``gyrocal allan``."""

from typing import Annotated

import typer

from gyrocal.commands import AsJson, SessionFolder


def run(
    session: SessionFolder,
    axis: Annotated[str | None, typer.Option(help="x, y or z; the session's own by default.")] = None,
    taus: Annotated[str | None, typer.Option(metavar="T,...", help="Averaging times, s; eight a decade by default.")] = None,
    as_json: AsJson = False,
) -> None:
    """Overlapping Allan deviation of a session's readings at rest and at constant rates over averaging times."""
    from gyrocal.errors import InputError
    from gyrocal.noise.allan import of_session
    from gyrocal.present.output import emit, table
    from gyrocal.recording.session import Session

    try:
        taus_s = None if taus is None else [float(tau) for tau in taus.split(",")]
    except ValueError:
        raise InputError(f"--taus {taus}: seconds, or several with commas") from None
    opened = Session.open(session)
    about = axis or opened.axis
    found, deviations_dps = of_session(opened, about, taus_s)
    if as_json:
        emit({"axis": about, "tau_s": found.tolist(), "deviation_dps": deviations_dps.tolist()})
        return
    rows = [[f"{t:.4g}", f"{1e3 * d:.4g}"] for t, d in zip(found, deviations_dps, strict=True)]
    table(f"Allan deviation about {about}", ["s", "mdps"], rows)
