"""How well hands calibrate: many simulated phone-grade parts, each turned by hand between rests, against their truth.

    python benchmarks/hands.py RESULTS.jsonl --sessions 200

Appends a line for each session, and prints the part of them in which every scale is within 0.3 % and every misalignment within
0.004, and the spread of the error over the standard error.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.gravity.calibrate import calibrate, misalignment
from gyrocal.recording.session import AXES
from gyrocal.simulation.simulate import simulate

SCALE, CROSS = 0.003, 0.004
"""The errors that are asked for."""


def case(seed: int) -> dict[str, Any]:
    """One session: errors and errors over standard errors of scales, misalignments and biases, misfit and flags."""
    session, truth = simulate(campaign="hands", seed=seed)
    found = calibrate(session)
    planted = truth["runs"][0]
    errors: dict[str, list[float]] = {"scale": [], "bias": [], "cross": []}
    ratios: dict[str, list[float]] = {"scale": [], "bias": [], "cross": []}
    for e in found.estimates:
        i = AXES.index(e.axis)
        assert e.scale is not None
        assert e.scale_se is not None
        assert e.bias_dps is not None
        assert e.bias_se_dps is not None
        errors["scale"].append(e.scale - planted["scale"][i])
        errors["bias"].append(e.bias_dps - planted["bias_dps"][i])
        ratios["scale"].append(errors["scale"][-1] / e.scale_se)
        ratios["bias"].append(errors["bias"][-1] / e.bias_se_dps)
    for row in misalignment(next(iter(found.fits.values())), "s000"):
        error = row["value"] - truth["misalignment"][AXES.index(row["axis"])][AXES.index(row["about"])]
        errors["cross"].append(error)
        ratios["cross"].append(error / row["se"])
    flags = sorted({flag for e in found.estimates for flag in e.flags})
    return {"seed": seed, "errors": errors, "ratios": ratios, "misfit": found.estimates[0].misfit, "flags": flags}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--sessions", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    rows = []
    for seed in range(given.first, given.first + given.sessions):
        rows.append(case(seed))
        with given.results.open("a", encoding="utf-8") as handle:
            handle.write(json.dumps(rows[-1]) + "\n")
    errors = {name: np.array([r["errors"][name] for r in rows]) for name in ("scale", "bias", "cross")}
    ratios = {name: np.array([r["ratios"][name] for r in rows]) for name in ("scale", "bias", "cross")}
    within = (np.abs(errors["scale"]).max(axis=1) < SCALE) & (np.abs(errors["cross"]).max(axis=1) < CROSS)
    print(f"{len(rows)} sessions, {within.mean():.1%} with every scale within 0.3 % and every misalignment within 0.004")
    for name, unit in (("scale", "%"), ("cross", "%"), ("bias", "dps")):
        factor = 100 if unit == "%" else 1
        rms, spread = np.sqrt(np.mean(errors[name] ** 2)) * factor, np.sqrt(np.mean(ratios[name] ** 2))
        print(f"{name}: rms error {rms:.4f} {unit}, error over standard error {spread:.2f}")
    largest = max(float(np.abs(r).max()) for r in ratios.values())
    print(f"flagged: {np.mean([bool(r['flags']) for r in rows]):.1%}, largest error over standard error {largest:.1f}")


if __name__ == "__main__":
    main()
