"""The functions of the Python interface: those of the layers below, which also take a session's folder, and whose errors name
arguments. :mod:`gyrocal.api` offers them."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from gyrocal.calibration import calibrate as _calibrate
from gyrocal.calibration.apply import apply as _apply
from gyrocal.calibration.calibration import Calibration
from gyrocal.calibration.exported import export as _export
from gyrocal.diagnosis.answer import add as _add
from gyrocal.diagnosis.answer import compare as _compare
from gyrocal.diagnosis.answer import diagnose as _diagnose
from gyrocal.diagnosis.answer import explain as _explain
from gyrocal.effects.base import Effect
from gyrocal.effects.base import effects as _effects
from gyrocal.effects.base import load as _load
from gyrocal.error_model.model import Model
from gyrocal.errors import GyrocalError, InputError
from gyrocal.gravity import as_is as _as_is
from gyrocal.gravity import calibrate as _gravity_calibration
from gyrocal.gravity import compare as _by_gravity
from gyrocal.gravity import diagnose as _gravity_diagnosis
from gyrocal.inference import fit as _fit
from gyrocal.noise.allan import of_session as _allan
from gyrocal.planning import plan as _plan
from gyrocal.recording.importer import import_recording as _import_recording
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate as _simulate

P = ParamSpec("P")
R = TypeVar("R")
FLAG = re.compile(r"(`[^`]*`)|--([a-z][a-z-]*)")
"""An option of the command line in a message, and what is not one: a command to type."""
ARGUMENTS = {
    "chamber": "chamber_c", "effect": "effects", "format": "form", "heldout-day": "only_day", "map": "maps",
    "max": "most_steps", "method": "methods", "rate": "table_rate_dps", "ref-clock": "clock", "ref-map": "second",
    "reference": "second", "run": "cuts", "sections": "cuts", "table": "table_dps",
    "taus": "taus_s",
}  # fmt: skip
"""Options whose argument has another name."""


SEVERAL = re.compile("(Sequence|Iterable)\\[")
"""What the annotation of an argument begins with that takes several values."""


def _in_python(function: Callable[P, R]) -> Callable[P, R]:
    """The function with errors that name its arguments instead of the command line's options.

    A single value is taken for several: ``seconds=6``, ``methods="model"``.
    """

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = inspect.signature(function).bind(*args, **kwargs)
        for name, value in bound.arguments.items():
            if isinstance(value, str | int | float) and SEVERAL.match(str(bound.signature.parameters[name].annotation)):
                bound.arguments[name] = [value]
        try:
            return function(*bound.args, **bound.kwargs)
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
        by_hand = _gravity_calibration.calibrate(session, *args, **kwargs)
        found = Calibration(by_hand.estimates)
        found.accelerometer = next(iter(by_hand.fits.values())).scene.accelerometer_model
        return found
    return Calibration(_calibrate.calibrate(session, *args, **kwargs))


add = _of_folder(_or_by_gravity(_add.add, _gravity_diagnosis.add))
compare = _of_folder(_or_by_gravity(_compare.compare, _compare_angles))
diagnose = _of_folder(_or_by_gravity(_diagnose.diagnose, _gravity_diagnosis.diagnose))
explain = _of_folder(_or_by_gravity(_explain.explain, _gravity_diagnosis.explain))
allan = _of_folder(_allan)
fit = _of_folder(_fit.fit)
plan = _of_folder(_plan.plan)
apply = _in_python(_apply)
import_recording = _in_python(_import_recording)
simulate = _in_python(_simulate)
export = _in_python(_export)

@_in_python
def load_effects(place: str | Path) -> list[str]:
    """Load effects from the Python files of a folder, or from one file, which are run, and return their ids.

    Raises InputError if there is no such place, a file fails, or no file defines an effect.
    """
    return _load(Path(place))


def effects() -> dict[str, Effect]:
    """Every known effect by id: the library's, those of installed packages, and those of :func:`load_effects`."""
    return dict(_effects())
