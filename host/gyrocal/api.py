"""The Python interface: what the command line does, in a few lines.

    from gyrocal.api import Model, Session, compare, diagnose

    session = Session.open("folder")
    model = Model.open("default")
    best = diagnose(session, model).best
    model = model.add(best.effect.id, best.axis)
    print(compare(session, model).pooled)

Tables are polars frames (``session.runs[0].table``, ``residual_table``), pictures matplotlib figures
(:mod:`gyrocal.present.pictures`).
"""

from gyrocal.calibration.calibrate import Estimate, calibrate
from gyrocal.diagnosis.add import add
from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.compare import compare
from gyrocal.diagnosis.comparison import Comparison
from gyrocal.diagnosis.diagnose import Diagnosis, diagnose
from gyrocal.diagnosis.residuals import residual_table
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import Fit
from gyrocal.plausibility import check
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate
from gyrocal.warning import Warning

__all__ = [
    "Candidate", "Comparison", "DeviceError", "Diagnosis", "Estimate", "Fit", "FormulaEffect", "GyrocalError", "InputError",
    "Model", "Run", "Session", "Term", "Warning", "add", "calibrate", "check", "compare", "diagnose", "fit", "residual_table",
    "simulate",
]  # fmt: skip
