"""Network `gyrocal` on tables and sensors other than those of the campaign `table2`, with flat priors.

The network carries the campaign's law of effects: ripple and transient up to twice as large or small, phases by chance. The
table shows how far off it is, and how often the truth is within its 68 and 95 %, where effects are absent, half or twice as
large, or follow another law of phases; and for sensors of any scale within 3 % and bias within 10 deg/s.

    gyrocal benchmark robustness
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gyrocal.calibration.network import STAGES_S, FaceNetwork
from gyrocal.present.output import table
from gyrocal.recording.session import Array
from gyrocal.simulation.simulate import LSB_DPS, paper_windows

SCENARIOS, SAMPLE = 4000, 1000
SEED = 800_000
SIZES = (0.0, 0.5, 1.0, 2.0)
SCALE_WITHIN, BIAS_WITHIN_DPS = 0.03, 10.0


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Run all and return what ``gyrocal benchmark robustness --json`` prints."""
    n = SAMPLE if sample else SCENARIOS
    tables: dict[str, Callable[[], dict[str, Any]]] = {
        **{f"effects x {size:g}": lambda size=size: paper_windows(n, SEED, effects=size) for size in SIZES},
        "all faces start at one angle": lambda: paper_windows(n, SEED, phase_deg=(30.0, 30.0)),
        "start angles within a quarter turn": lambda: paper_windows(n, SEED, phase_deg=(0.0, 90.0)),
        f"scale +-{SCALE_WITHIN:.0%}, bias +-{BIAS_WITHIN_DPS:g} dps": lambda: population(n),
    }
    rows: list[dict[str, Any]] = []
    for done, (name, draw) in enumerate(tables.items()):
        rows += [{"table": name, **row} for row in judge(draw())]
        progress(done + 1, len(tables))
    return {"scenarios": n, "rows": rows}


def population(n: int, seed: int = SEED) -> dict[str, Any]:
    """Draw ``n`` scenarios of ``table2``, each of another sensor, with the given spreads about the campaign's."""
    data, rng = paper_windows(n, seed), np.random.default_rng(seed)
    scale, bias = rng.uniform(-SCALE_WITHIN, SCALE_WITHIN, n), rng.uniform(-BIAS_WITHIN_DPS, BIAS_WITHIN_DPS, n)
    # whole counts are added, so that readings stay whole counts
    up, down = (np.rint((scale * w_dps + bias) / LSB_DPS) * LSB_DPS for w_dps in (data["w_up_dps"], data["w_down_dps"]))
    return data | {
        "up": data["up"] + up[:, None], "down": data["down"] + down[:, None],
        "scale": data["scale"] + (up - down) / (data["w_up_dps"] - data["w_down_dps"]),
        "bias_dps": data["bias_dps"] + (up + down) / 2,
    }  # fmt: skip


def judge(data: dict[str, Any]) -> list[dict[str, Any]]:
    """Mean absolute errors, coverage, error over standard deviation and the share without an answer after 2, 4 and 6 s."""
    net, truth, rows = FaceNetwork.shipped(), np.column_stack([data["scale"], data["bias_dps"]]), []
    for k, seconds in enumerate(STAGES_S):
        n = net.samples(k)
        y: Array = net.estimate(data["up"][:, :n], data["down"][:, :n], k, data["w_up_dps"], data["w_down_dps"])
        known = np.isfinite(y[:, 0])
        off = (y[:, :2] - truth)[known]
        z = off / y[known, 2:]
        rows.append({
            "seconds": seconds, "scale_mae": float(np.abs(off[:, 0]).mean()), "bias_mae_dps": float(np.abs(off[:, 1]).mean()),
            "covered_68": float(np.mean(np.abs(z) < 1.0)), "covered_95": float(np.mean(np.abs(z) < 1.96)),
            "scale_z_sd": float(z[:, 0].std()), "bias_z_sd": float(z[:, 1].std()), "no_answer": float(1 - known.mean()),
        })  # fmt: skip
    return rows


def show(found: dict[str, Any]) -> None:
    """Print the table on the terminal."""
    rows = [
        [r["table"], f"{r['seconds']:g}", f"{r['scale_mae']:.6f}", f"{1e3 * r['bias_mae_dps']:.2f}",
         f"{100 * r['covered_68']:.1f}", f"{100 * r['covered_95']:.1f}", f"{r['scale_z_sd']:.2f}, {r['bias_z_sd']:.2f}",
         f"{100 * r['no_answer']:.2f}"]
        for r in found["rows"]
    ]  # fmt: skip
    columns = ["table:", "seconds", "scale", "bias mdps", "within 68 %", "within 95 %", "error / sd", "no answer, %"]
    table(f"network gyrocal, flat priors, {found['scenarios']} scenarios each", columns, rows)
