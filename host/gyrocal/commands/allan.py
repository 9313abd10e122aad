"""``gyrocal allan``."""

from typing import TYPE_CHECKING, Annotated

import typer

from gyrocal.commands import AsJson, SessionFolder

if TYPE_CHECKING:
    from gyrocal.noise.allan import AllanFigures


def in_words(figures: "AllanFigures") -> str:
    """Angle random walk and bias instability as lines of text."""
    lines = []
    if figures.noise_density_dps is not None:
        walk = f"{figures.angle_random_walk_deg:.3g} deg/√h"
        mdps = 1e3 * figures.noise_density_dps
        density = f"{mdps:.3g} mdps/√Hz for Kalibr, {2**0.5 * mdps:.3g} in a datasheet"
        lines.append(f"angle random walk: {walk}; noise density: {density}")
    size = f"{3600 * figures.bias_instability_dps:.3g} deg/h"
    short = f"at most {size}: the curve has no certain bottom up to {figures.at_s:.3g} s; a longer rest shows it"
    return "\n".join([*lines, f"bias instability: {f'{size} at {figures.at_s:.3g} s' if figures.bottom else short}"])


def run(
    session: SessionFolder,
    axis: Annotated[str | None, typer.Option(help="x, y or z; the session's own by default.")] = None,
    taus: Annotated[str | None, typer.Option(metavar="T,...", help="Averaging times, s; eight a decade by default.")] = None,
    as_json: AsJson = False,
) -> None:
    """Overlapping Allan deviation of a session's readings, with angle random walk and bias instability.

    Counted are runs at rest and at constant rates.
    """
    from gyrocal.errors import InputError
    from gyrocal.noise.allan import AllanFigures, of_session
    from gyrocal.present.output import emit, stdout, table
    from gyrocal.recording.session import Session

    try:
        taus_s = None if taus is None else [float(tau) for tau in taus.split(",")]
    except ValueError:
        raise InputError(f"--taus {taus}: seconds, or several with commas") from None
    opened = Session.open(session)
    about = axis or opened.axis
    found, deviations_dps = of_session(opened, about, taus_s)
    figures = AllanFigures.of(found, deviations_dps)
    if as_json:
        told = None if figures is None else figures.to_json()
        emit({"axis": about, "tau_s": found.tolist(), "deviation_dps": deviations_dps.tolist(), "figures": told})
        return
    rows = [[f"{t:.4g}", f"{1e3 * d:.4g}"] for t, d in zip(found, deviations_dps, strict=True)]
    table(f"Allan deviation about {about}", ["s", "mdps"], rows)
    if figures is not None:
        stdout.print(in_words(figures), markup=False)
