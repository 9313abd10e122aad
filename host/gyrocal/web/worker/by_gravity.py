"""The worker's part of a session by gravity: rests, movements, the comparison by angle, scale and bias."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyrocal.units import unit_of
from gyrocal.web.pictures.recorded import Recorded, recorded
from gyrocal.web.values.budget import Budget, of_gravity

if TYPE_CHECKING:
    from gyrocal.gravity.scene import Rest, Scene
    from gyrocal.recording.session import Session



@dataclass(frozen=True)
class GravityView:
    """A session whose reference is gravity, compared with the default model."""

    path: Path
    compared: dict[str, Any]
    """The exact output of `gyrocal compare --json`."""
    headline: str
    rows: list[list[str]]
    """Axis, rms, floor, excess and its error in deg, as the command line prints them; last all movements."""
    rests: list[list[str]]
    """File, start, length, and the acceleration in g of each rest."""
    movements: list[list[str]]
    """File, end, the axis mainly turned about, the turn of gravity by accelerometer and by gyroscope, and their angle."""
    estimates: list[dict[str, Any]]
    budgets: tuple[Budget, ...]
    recorded: Recorded = field(repr=False)
    """The readings with their rests."""


def look(folder: Path, progress: Callable[[str], None]) -> GravityView:
    """Compare the default model with a session by gravity. Raises InputError where its rests are too few."""
    from gyrocal.gravity.budget import budget
    from gyrocal.gravity.calibrate import calibrate
    from gyrocal.gravity.compare import compare, residual_table
    from gyrocal.present.gravity import headline
    from gyrocal.present.report import angle_row
    from gyrocal.recording.session import Session

    progress("finding rests and movements")
    session = Session.open(folder)
    found = compare(session)
    scene = found.fit.scene
    rows = [*(angle_row(f"about {axis}", v) for axis, v in found.per_axis.items()), angle_row("all", found.pooled)]
    progress("scale and bias")
    calibrated = calibrate(session, None, None, None)
    estimates = [e.to_json() for e in calibrated.estimates]
    unit = unit_of(e.bias_dps for e in calibrated.estimates)
    budgets = of_gravity([row for fitted in calibrated.fits.values() for row in budget(fitted)], unit)
    angles = ("measured_deg", "modelled_deg", "residual_deg")
    left = [
        [r["file"], f"{r['t_s']:.1f}", r["axis"], *(f"{r[name]:.3f}" for name in angles)]
        for r in residual_table(found).iter_rows(named=True)
    ]
    progress("drawing")
    return GravityView(
        folder, found.to_json(), headline(found), rows, _rests(session, scene), left, estimates, budgets,
        recorded(session, [_rest(session, rest) for rest in scene.rests]),
    )


def missing(folder: Path) -> tuple[str, list[list[str]]]:
    """The verdict of a diagnosis as a sentence, and effect, axis and decision of what is added or suggested."""
    from gyrocal.gravity.diagnose import diagnose
    from gyrocal.present.report import sizes
    from gyrocal.present.verdict import nothing_found
    from gyrocal.recording.session import Session

    found = diagnose(Session.open(folder), None, ())
    passed = [c for c in found.candidates if c.decision in ("add", "suggest")]
    best = found.best
    told = {
        "ambiguous": f"One of {'' if best is None else ', '.join(best.group)}: the session cannot tell which.",
        "adequate": nothing_found(found.candidates, found.comparison.to_json()),
    }  # fmt: skip
    if found.verdict == "add" and best is not None:
        axes = ", ".join(sorted(c.axis for c in passed if c.decision == "add" and c.effect.id == best.effect.id))
        told["add"] = f"Missing: {best.effect.title.lower()} on {axes}."
    words = told.get(found.verdict, "Something is left over that no effect of the library explains.")
    return words, [[c.effect.title, c.axis, c.decision, sizes(c)] for c in passed]


def _rests(session: Session, scene: Scene) -> list[list[str]]:
    return [
        [
            session.runs[rest.run].file, f"{session.runs[rest.run].sample_s[rest.start]:.1f}", f"{rest.seconds:.1f}",
            ", ".join(f"{a:.3f}" for a in rest.acc_g),
        ]
        for rest in scene.rests
    ]  # fmt: skip


def _rest(session: Session, rest: Rest) -> tuple[int, float, float]:
    """The run of a rest, and its begin and end in it, s."""
    run = session.runs[rest.run]
    begin_s = float(run.sample_s[rest.start] - run.sample_s[0])
    return rest.run, begin_s, begin_s + rest.seconds
