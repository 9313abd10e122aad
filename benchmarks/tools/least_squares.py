"""What a script of ten lines does at a rate table: least squares of scale and bias on each axis, in numpy alone.

This is also what imucal and imu_tk fit of a gyroscope's own axis, where they get what they need.
"""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

AXES = ("x", "y", "z")


def answer(session: Path) -> dict[str, Any]:
    head = tomllib.loads((session / "session.toml").read_text())
    readings, rates = {}, {}
    for run in head["run"]:
        file = session / run["file"]
        frame = pl.read_parquet(file) if file.suffix == ".parquet" else pl.read_csv(file)
        side = 1.0 if run["face"] == "up" else -1.0
        axis = run.get("axis", head.get("axis", "z"))
        readings[run["file"]] = frame.select(f"g{a}_dps" for a in AXES).to_numpy()
        rates[run["file"]] = {a: np.zeros(frame.height) for a in AXES}
        if "rate_ref_dps" in frame.columns:
            rates[run["file"]][axis] = frame["rate_ref_dps"].to_numpy()
        elif "table_rate_dps" in run:
            rates[run["file"]][axis] = np.full(frame.height, side * run["table_rate_dps"])
        else:
            raise ValueError("no rate is known at every moment")
    sizes, corrected = {}, {name: values.copy() for name, values in readings.items()}
    for i, a in enumerate(AXES):
        y, w = np.concatenate([r[:, i] for r in readings.values()]), np.concatenate([r[a] for r in rates.values()])
        turns = bool(np.ptp(w) > 0)
        columns = np.column_stack([np.ones_like(w), w] if turns else [np.ones_like(w)])
        found = np.linalg.lstsq(columns, y, rcond=None)[0]
        slope = found[1] if turns else 1.0
        sizes |= {f"bias.{a}.bias_dps": found[0]} | ({f"scale.{a}.scale": slope - 1} if turns else {})
        for values in corrected.values():
            values[:, i] = (values[:, i] - found[0]) / slope
    return {"sizes": sizes, "corrected": corrected}
