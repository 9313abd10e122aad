"""What people see of sessions whose reference is gravity."""

from __future__ import annotations

from gyrocal.gravity.budget import budget
from gyrocal.gravity.calibrate import Calibration, misalignment
from gyrocal.gravity.scene import Scene
from gyrocal.present.output import mdps, plus_minus, stdout, table
from gyrocal.present.report import print_warnings


def print_calibration(c: Calibration) -> None:
    """Rests, estimates, misalignment and the budget of the errors."""
    print_warnings(c.warnings)
    for name, fitted in c.fits.items():
        scene = fitted.scene
        turned = scene.turned_deg
        stdout.print(
            f"{name}: {len(scene.rests)} rests, {len(scene.movements)} movements that turn gravity by {turned.min():.0f} to "
            f"{turned.max():.0f} deg; rests begin at {_begins(scene)} s",
            markup=False,
        )
    rows = [
        [e.scenario, e.axis, "-" if e.scale is None else plus_minus(100 * e.scale, _percent(e.scale_se)), mdps(e.bias_dps),
         mdps(e.bias_se_dps), f"{e.misfit or 0:.2f}", "yes" if e.trusted else "no: " + ", ".join(e.flags)]
        for e in c.estimates
    ]  # fmt: skip
    table("", ["scenario:", "axis:", "scale %", "bias mdps", "± mdps", "misfit", "trusted:"], rows)
    cross = [
        [row["scenario"], row["axis"], row["about"],
         "-" if row["value"] is None else plus_minus(100 * row["value"], _percent(row["se"]))]
        for name, fitted in c.fits.items() for row in misalignment(fitted, name)
    ]  # fmt: skip
    table("What an axis reads of rotation about another", ["scenario:", "axis:", "about:", "%"], cross)
    shares = [
        [row.axis, row.cause, f"{100 * row.scale_se:.4f}", mdps(row.bias_se_dps, 2), row.advice]
        for fitted in c.fits.values() for row in budget(fitted)
    ]  # fmt: skip
    table("Where the error comes from", ["axis:", "cause:", "scale ± %", "bias ± mdps", "to lower it:"], shares)


def _begins(scene: Scene) -> str:
    return ", ".join(f"{scene.session.runs[r.run].sample_s[r.start]:.1f}" for r in scene.rests)


def _percent(se: float | None) -> float | None:
    return None if se is None else 100 * se
