"""gyrocal itself: `explain` with the model `default`, whose values are the sizes and whose correction is the answer."""

import tempfile
from pathlib import Path
from typing import Any

from gyrocal.api import Session, apply, explain


def answer(session: Path) -> dict[str, Any]:
    opened = Session.open(session)
    found = explain(opened)
    model = found.model
    values = {f"{p['effect']}.{p['axis']}.{p['name']}": p["value"] for p in model.values_json()}
    names = [(term.effect_id, term.axis) for term in model.terms if term.effect.role is None]
    if opened.reference.kind == "gravity":
        return {"names": names, "sizes": values}
    with tempfile.TemporaryDirectory() as scratch:
        apply(session, model, Path(scratch) / "corrected")
        corrected = {run.file: run.gyro_dps for run in Session.open(Path(scratch) / "corrected").runs}
    return {"names": names, "sizes": values, "corrected": corrected}
