"""JSON: every parameter of the model with its standard error, unit and equation, and the noise."""

from __future__ import annotations

import json
import math

from gyrocal import __version__
from gyrocal.calibration.targets.base import Rendered
from gyrocal.error_model.model import Model


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The whole model as one object. Nothing is left out."""
    lines = []
    for line in model.lines():
        units = {p.name: p.unit for p in line.kind.parameters}
        lines.append({
            "effect": line.id, "axis": line.axis, "equation": line.kind.equation,
            "parameters": {
                name: {"value": value, "se": _finite(line.se.get(name)), "unit": units.get(name.removesuffix("_sd"))}
                for name, value in line.values.items()
            },
        })  # fmt: skip
    white = {axis: noise.white_sd_dps for axis, noise in model.noise.items() if noise.white_sd_dps is not None}
    content = {
        "made_by": f"gyrocal {__version__}", "name": model.name, "sample_rate_hz": rate_hz, "white_sd_dps": white,
        "fitted_on": {name: list(ends) for name, ends in model.fitted_on.ranges.items()},
        "accelerometer": None if model.accelerometer is None else model.accelerometer.to_json(),
        "corrected": model.fitted_on.corrected or None, "effects": lines,
    }  # fmt: skip
    return Rendered("model.json", json.dumps(content, indent=1, allow_nan=False) + "\n", {})


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
