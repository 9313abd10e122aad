"""The Python interface, which does in a few lines what the command line does.

    from gyrocal.api import Model, Session, compare, diagnose

    session = Session.open("folder")
    model = Model.open("default")
    best = diagnose(session, model).best
    if best is not None:
        model = model.add(best.effect.id, best.axis)
    print(compare(session, model).summary())

A session may be given as its folder everywhere. Sessions, models and results have ``summary()``, ``to_dataframe()`` (polars)
and ``plot()`` (matplotlib), and show themselves in a notebook. More pictures: :mod:`gyrocal.present.pictures`. See docs/api.md.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from gyrocal.calibration import calibrate as _calibrate
from gyrocal.calibration.apply import apply as _apply
from gyrocal.calibration.calibrate import Estimate
from gyrocal.calibration.calibration import Calibration
from gyrocal.diagnosis import add as _add
from gyrocal.diagnosis import compare as _compare
from gyrocal.diagnosis import diagnose as _diagnose
from gyrocal.diagnosis import explain as _explain
from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.comparison import Comparison
from gyrocal.diagnosis.diagnose import Diagnosis
from gyrocal.diagnosis.explain import Explanation
from gyrocal.diagnosis.residuals import residual_table
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.gravity import as_is as _as_is
from gyrocal.gravity import calibrate as _gravity_calibration
from gyrocal.gravity import compare as _by_gravity
from gyrocal.gravity import diagnose as _gravity_diagnosis
from gyrocal.inference import fit as _fit
from gyrocal.inference.fitted import Fit
from gyrocal.planning import plan as _plan
from gyrocal.planning.plan import Plan
from gyrocal.plausibility import check
from gyrocal.present import notebook
from gyrocal.recording.importer import import_recording as _import_recording
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate as _simulate
from gyrocal.warning import Warning

__all__ = [
    "Calibration", "Candidate", "Comparison", "DeviceError", "Diagnosis", "Estimate", "Explanation", "Fit", "FormulaEffect",
    "GyrocalError", "InputError", "Model", "Plan", "Run", "Session", "Term", "Warning", "add", "apply", "calibrate", "check",
    "compare", "diagnose", "explain", "fit", "import_recording", "notebook", "plan", "residual_table", "simulate",
]  # fmt: skip

P = ParamSpec("P")
R = TypeVar("R")
FLAG = re.compile(r"(`[^`]*`)|--([a-z][a-z-]*)")
"""An option of the command line in a message, and what is not one: a command to type."""
ARGUMENTS = {
    "chamber": "chamber_c", "effect": "effects", "format": "form", "heldout-day": "only_day", "map": "maps",
    "max": "most_steps", "method": "methods", "rate": "table_rate_dps", "ref-clock": "clock", "ref-map": "second",
    "reference": "second", "run": "cuts", "sections": "cuts", "table": "table_dps",
}  # fmt: skip
"""Options whose argument has another name."""


def _in_python(function: Callable[P, R]) -> Callable[P, R]:
    """The function with errors that name its arguments instead of the command line's options."""

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except GyrocalError as error:
            words = FLAG.sub(lambda found: found[1] or ARGUMENTS.get(found[2], found[2].replace("-", "_")), str(error))
            if words == str(error):
                raise
            raise type(error)(words) from error

    return called


def _of_folder(function: Callable[Concatenate[Session, P], R]) -> Callable[Concatenate[Session | str | Path, P], R]:
    """The function, which also takes a session's folder instead of the session."""

    @functools.wraps(function)
    def called(session: Session | str | Path, *args: P.args, **kwargs: P.kwargs) -> R:
        opened = session if isinstance(session, Session) else Session.open(session)
        return _in_python(function)(opened, *args, **kwargs)

    return called


def _or_by_gravity(function: Callable[P, R], by_gravity: Callable[..., Any]) -> Callable[P, R]:
    """The function, with its counterpart for a session whose reference is gravity: that one's result has angles for rates."""

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        session = args[0]
        if not isinstance(session, Session) or session.reference.kind != "gravity":
            return function(*args, **kwargs)
        unknown = sorted(set(kwargs) - set(inspect.signature(by_gravity).parameters))
        if unknown:
            raise InputError(f"{', '.join(unknown)}: not for a session whose reference is gravity; leave it out")
        found: R = by_gravity(*args, **kwargs)
        return found

    return called


def _compare_angles(session: Session, model: Model | str | Path | None = None, as_is: bool = False) -> Any:
    return (_as_is.compare_as_is if as_is else _by_gravity.compare)(session, model)


@_of_folder
@functools.wraps(_calibrate.calibrate)
def calibrate(session: Session, *args: Any, **kwargs: Any) -> Calibration:
    if session.reference.kind == "gravity":
        return Calibration(_gravity_calibration.calibrate(session, *args, **kwargs).estimates)
    return Calibration(_calibrate.calibrate(session, *args, **kwargs))


add = _of_folder(_or_by_gravity(_add.add, _gravity_diagnosis.add))
compare = _of_folder(_or_by_gravity(_compare.compare, _compare_angles))
diagnose = _of_folder(_or_by_gravity(_diagnose.diagnose, _gravity_diagnosis.diagnose))
explain = _of_folder(_or_by_gravity(_explain.explain, _gravity_diagnosis.explain))
fit = _of_folder(_fit.fit)
plan = _of_folder(_plan.plan)
apply = _in_python(_apply)
import_recording = _in_python(_import_recording)
simulate = _in_python(_simulate)
