"""Delays, low-passes and clock errors of known size, fitted: error over standard error. python benchmarks/time_errors.py

The sessions come from closed forms (sums of sines) and not from the library's own evaluation of time. A cell passes if the
spread of the error over its standard error is within 0.85 to 1.2, widened to what its number of sessions can tell.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

Array = NDArray[Any]

SCALE, BIAS_DPS, WHITE_DPS, TURN_ON_DPS, LSB_DPS = 0.004, -0.05, 0.03, 0.01, 0.00875
BAND = (0.85, 1.2)


@dataclass(frozen=True)
class Cell:
    """What is planted, and the runs it is planted in."""

    name: str
    delay_s: float = 0.0
    filter_s: float = 0.0
    clock: float = 0.0
    runs: int = 4
    seconds: float = 20.0
    rate_hz: float = 100.0
    reference_noise_dps: float = 0.0

    @property
    def truth(self) -> dict[str, tuple[str, float]]:
        """The effects to fit, each with its parameter and the planted value."""
        out = {}
        if self.delay_s or self.filter_s:
            out["lag"] = ("tau_s", self.delay_s or self.filter_s)
        if self.clock:
            out["clock_error"] = ("e", self.clock)
        return out


LONG = {"runs": 1, "seconds": 1200.0, "rate_hz": 20.0}
CELLS = [
    *(Cell(f"delay {1e3 * d:g} ms", delay_s=d) for d in (0.001, 0.005, 0.02, 0.1, 0.3)),
    *(Cell(f"low-pass {1e3 * f:g} ms", filter_s=f) for f in (0.005, 0.05, 0.3)),
    *(Cell(f"clock {e:g}", clock=e, **LONG) for e in (1e-4, -1e-3, 1e-3, 2e-2, -2e-2)),  # type: ignore[arg-type]
    Cell("clock 0.001, delay 12 ms", delay_s=0.012, clock=1e-3, **LONG),  # type: ignore[arg-type]
    Cell("clock -0.02, delay 100 ms", delay_s=0.1, clock=-2e-2, **LONG),  # type: ignore[arg-type]
    Cell("delay 12 ms, reference noise 0.05 dps", delay_s=0.012, reference_noise_dps=0.05),
]


def session(cell: Cell, seed: int) -> Any:
    """One session: a table swings with three sines at once, of other frequencies in each run."""
    from gyrocal.recording.session import Run, Session

    rng = np.random.default_rng((seed, round(1e6 * (cell.delay_s + 2 * cell.filter_s + 3 * abs(cell.clock)))))
    made = []
    for i in range(cell.runs):
        t_s = np.arange(round(cell.seconds * cell.rate_hz)) / cell.rate_hz
        size_dps, hz = np.array([60.0, 30.0, 12.0]), np.array([0.13, 0.41, 1.05]) * rng.uniform(0.9, 1.1, 3)
        phase = rng.uniform(0, 2 * np.pi, 3)
        w = 2 * np.pi * hz
        reference = np.sin(np.outer(t_s, w) + phase) @ size_dps + rng.normal(0, cell.reference_noise_dps, t_s.size)
        shown_s = (1 + cell.clock) * t_s - cell.delay_s
        passed, late = size_dps / np.hypot(1, w * cell.filter_s), np.arctan(w * cell.filter_s)
        gyro = rng.normal(rng.normal(0, TURN_ON_DPS, 3), WHITE_DPS, (t_s.size, 3))
        gyro[:, 2] += (1 + SCALE) * (np.sin(np.outer(shown_s, w) + phase - late) @ passed) + BIAS_DPS
        gyro = np.round(gyro / LSB_DPS) * LSB_DPS
        frame = pl.DataFrame({"t_s": t_s, **{f"g{a}_dps": gyro[:, k] for k, a in enumerate("xyz")}, "rate_ref_dps": reference})
        made.append(Run(i, f"{i:03d}_up.csv", f"s{i}", "up", "z", None, None, None, None, cell.rate_hz, frame=frame))
    return Session(cell.rate_hz, tuple(made))


def errors(cell: Cell, seed: int) -> dict[str, tuple[float, float]]:
    """Error over standard error, and standard error, of each planted parameter."""
    from gyrocal.error_model.model import Model, Term
    from gyrocal.inference.fit import fit

    model = Model.builtin("default")
    for effect_id in cell.truth:
        model = model.with_term(Term(effect_id, "z"))
    found = fit(session(cell, seed), model, axes="z").model
    out = {}
    for effect_id, (name, value) in cell.truth.items():
        term = found.term(effect_id, "z")
        assert term is not None
        out[name] = ((term.values[name] - value) / term.se[name], term.se[name])
    return out


def within(spread: float, seeds: int) -> bool:
    """Is a spread within the band, widened by two standard errors of a spread from so many values?"""
    room = 2 / (2 * seeds) ** 0.5
    return BAND[0] * (1 - room) <= spread <= BAND[1] * (1 + room)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--only", default="", help="cells whose names contain this")
    arguments = parser.parse_args()
    passed = True
    print("cell                                      parameter  se (median)  mean z  spread of z  largest  s a fit")
    for cell in (c for c in CELLS if arguments.only in c.name):
        began = time.perf_counter()
        found = [errors(cell, seed) for seed in range(arguments.seeds)]
        took_s = (time.perf_counter() - began) / arguments.seeds
        for name in found[0]:
            z, se = (np.array([f[name][k] for f in found]) for k in range(2))
            spread = float(np.sqrt(np.mean(z**2)))
            passed &= within(spread, arguments.seeds)
            print(
                f"{cell.name:41s} {name:9s}  {np.median(se):11.2e}  {z.mean():6.2f}  {spread:11.2f}  {np.abs(z).max():7.2f}  "
                f"{took_s:7.2f}",
                flush=True,
            )
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
