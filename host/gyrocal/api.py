"""The Python interface: what the command line does, in a few lines.

    from gyrocal.api import Model, Session, compare, diagnose

    session = Session.open("folder")
    model = Model.open("default")
    best = diagnose(session, model).best
    model = model.add(best.effect.id, best.axis)
    print(compare(session, model).pooled)

Tables are polars frames (``session.runs[0].table``, ``residual_table``), pictures matplotlib figures (:mod:`gyrocal.pictures`).
"""

from gyrocal.calibrate import Estimate, calibrate
from gyrocal.compare import Comparison, compare, residual_table
from gyrocal.diagnose import Candidate, Diagnosis, add, diagnose
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.fit import Fit, fit
from gyrocal.model import Model, Term
from gyrocal.plausibility import check
from gyrocal.session import Run, Session
from gyrocal.simulate import simulate
from gyrocal.warning import Warning

__all__ = [
    "Candidate", "Comparison", "DeviceError", "Diagnosis", "Estimate", "Fit", "GyrocalError", "InputError", "Model", "Run",
    "Session", "Term", "Warning", "add", "calibrate", "check", "compare", "diagnose", "fit", "residual_table", "simulate",
]  # fmt: skip
