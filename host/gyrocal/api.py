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

A name is imported when it is first used, so that the import of this module itself takes no time.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

from gyrocal import shown

if TYPE_CHECKING:
    from gyrocal.calibration.calibrate import Estimate
    from gyrocal.calibration.calibration import Calibration
    from gyrocal.calls import (
        add,
        allan,
        apply,
        calibrate,
        compare,
        diagnose,
        effects,
        explain,
        export,
        fit,
        import_recording,
        load_effects,
        plan,
        simulate,
    )
    from gyrocal.diagnosis.answer.diagnose import Diagnosis
    from gyrocal.diagnosis.answer.explain import Explanation
    from gyrocal.diagnosis.naming.candidate import Candidate
    from gyrocal.diagnosis.residual.comparison import Comparison
    from gyrocal.diagnosis.residual.residual_table import residual_table
    from gyrocal.effects.base import Effect
    from gyrocal.error_model.corrector import Corrector
    from gyrocal.error_model.formula import FormulaEffect
    from gyrocal.error_model.model import Model
    from gyrocal.error_model.term import Term
    from gyrocal.errors import DeviceError, GyrocalError, InputError
    from gyrocal.inference.fitted import Fit
    from gyrocal.planning.plan import Plan
    from gyrocal.plausibility import check
    from gyrocal.present import notebook
    from gyrocal.recording.run import Run
    from gyrocal.recording.session import Session
    from gyrocal.warning import Warning as SessionWarning

__all__ = [
    "Calibration", "Candidate", "Comparison", "Corrector", "DeviceError", "Diagnosis", "Effect", "Estimate", "Explanation",
    "Fit", "FormulaEffect", "GyrocalError", "InputError", "Model", "Plan", "Run", "Session", "SessionWarning", "Term",
    "add", "allan", "apply", "calibrate", "check", "compare", "diagnose", "effects", "explain", "export", "fit",
    "import_recording", "load_effects", "notebook", "plan", "residual_table", "simulate",
]  # fmt: skip

NAMES = {
    "gyrocal.calibration.calibrate": ("Estimate",),
    "gyrocal.calibration.calibration": ("Calibration",),
    "gyrocal.calls": (
        "add", "allan", "apply", "calibrate", "compare", "diagnose", "effects", "explain", "export", "fit", "import_recording",
        "load_effects", "plan", "simulate",
    ),
    "gyrocal.diagnosis.naming.candidate": ("Candidate",),
    "gyrocal.diagnosis.residual.comparison": ("Comparison",),
    "gyrocal.diagnosis.answer.diagnose": ("Diagnosis",),
    "gyrocal.diagnosis.answer.explain": ("Explanation",),
    "gyrocal.diagnosis.residual.residual_table": ("residual_table",),
    "gyrocal.effects.base": ("Effect",),
    "gyrocal.error_model.corrector": ("Corrector",),
    "gyrocal.error_model.formula": ("FormulaEffect",),
    "gyrocal.error_model.model": ("Model",),
    "gyrocal.error_model.term": ("Term",),
    "gyrocal.errors": ("DeviceError", "GyrocalError", "InputError"),
    "gyrocal.inference.fitted": ("Fit",),
    "gyrocal.planning.plan": ("Plan",),
    "gyrocal.plausibility": ("check",),
    "gyrocal.recording.run": ("Run",),
    "gyrocal.recording.session": ("Session",),
    "gyrocal.warning": ("SessionWarning",),
}  # fmt: skip
"""The names by the module that defines them; ``notebook`` is a module itself."""
MODULE_OF = {name: module for module, names in NAMES.items() for name in names}
THERE = {"SessionWarning": "Warning"}
"""Names that are others in their module, where nothing is shadowed."""

shown.exports_by(lambda *args, **options: __getattr__("export")(*args, **options))
shown.views_from(lambda: import_module("gyrocal.present.notebook"))


def __getattr__(name: str) -> Any:
    if name == "notebook":
        return import_module("gyrocal.present.notebook")
    if name == "Warning":
        warnings.warn("gyrocal.api.Warning is now SessionWarning, and goes in 1.0", DeprecationWarning, stacklevel=2)
        name = "SessionWarning"
    if name not in MODULE_OF:
        raise AttributeError(f"module 'gyrocal.api' has no attribute {name!r}")
    value = getattr(import_module(MODULE_OF[name]), THERE.get(name, name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
