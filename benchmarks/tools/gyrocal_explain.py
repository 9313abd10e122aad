"""gyrocal itself: `explain` with the model `default`, whose values are the sizes and whose correction is the answer."""

from pathlib import Path
from typing import Any

from gyrocal.api import Session, explain


def answer(session: Path) -> dict[str, Any]:
    opened = Session.open(session)
    found = explain(opened)
    model = found.model
    values = {f"{p['effect']}.{p['axis']}.{p['name']}": p["value"] for p in model.values_json()}
    names = [(term.effect_id, term.axis) for term in model.terms if term.effect.role is None]
    if opened.reference.kind == "gravity":
        return {"names": names, "sizes": values}
    rates = ["gx_dps", "gy_dps", "gz_dps"]
    corrected = {run.file: model.correct(run.table).select(rates).to_numpy() for run in opened.runs}
    return {"names": names, "sizes": values, "corrected": corrected}
