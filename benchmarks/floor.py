"""Is the floor the rms that noise leaves, and do compare and diagnose agree?

    python benchmarks/floor.py RESULTS.jsonl [sessions]

Sessions that hold noise alone, of several kinds. Each is judged with the model `default`; one line of RESULTS.jsonl is one
session, and sessions that are there already are not judged again. The table at the end gives for each kind the mean ratio of
rms to floor with its standard error, the mean and the spread of (rms^2 - floor^2) over its standard error (pooled, and within
power cycles), alarms, and the sessions in which compare and diagnose contradict each other.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.noise.drift import ou_noise
from gyrocal.recording.session import AXES, Array, Run, Session

RATE_HZ, WHITE_DPS, LSB_DPS = 104.0, 0.044, 0.00875
SESSIONS = 20

Rng = np.random.Generator


def session(
    rng: Rng, cycles: int, rates_dps: tuple[float, ...], seconds: float, *, drift: tuple[float, float] = (0.0, 1.0),
    bias_sd_dps: float = 0.0, scale_sd: float = 0.0, reference: Array | None = None,
) -> Session:  # fmt: skip
    """Runs of ``seconds`` at ``rates_dps`` in each power cycle; ``drift`` is (sd in deg/s, correlation time in s) and goes on
    from run to run."""
    n, runs = round(seconds * RATE_HZ), []
    t_s = np.arange(n) / RATE_HZ
    scale, bias_dps = rng.normal(0.004, 0.003), rng.normal(0, 0.3, 3)
    for cycle in range(cycles):
        offset, more = rng.normal(0, bias_sd_dps, 3), rng.normal(0, scale_sd)
        slow = ou_noise(n * len(rates_dps), 1 / RATE_HZ, *drift, 3, rng) if drift[0] > 0 else np.zeros((n * len(rates_dps), 3))
        for i, rate in enumerate(rates_dps):
            true = np.full(n, rate) if reference is None else reference
            noise = rng.normal(0, WHITE_DPS, (n, 3)) + bias_dps + offset + slow[n * i : n * (i + 1)]
            noise[:, 2] += (1 + scale + more) * true
            reading = np.rint(noise / LSB_DPS) * LSB_DPS
            frame = pl.DataFrame({"t_s": t_s} | {f"g{a}_dps": reading[:, j] for j, a in enumerate(AXES)})
            if reference is not None:
                frame = frame.with_columns(rate_ref_dps=pl.Series(true))
            known = rate if reference is None else None
            face = "up" if rate >= 0 else "down"
            table_dps = known if face == "up" or known is None else -known
            runs.append(
                Run(len(runs), f"{len(runs):03d}_{face}.csv", f"s{cycle:03d}", face, "z", table_dps, None, None, None, RATE_HZ,
                    frame=frame, lsb_dps=LSB_DPS)
            )  # fmt: skip
    return Session(RATE_HZ, tuple(runs), axis="z", lsb_dps=LSB_DPS)


PAIR = (78.0, -78.0)
MANY = (0.0, 30.0, -30.0, 78.0, -78.0, 150.0, -150.0, 0.0)
STEPS = np.repeat([0.0, 30.0, 60.0, 90.0, 60.0, 30.0, 0.0, -30.0, -60.0, -90.0, -60.0, -30.0, 0.0], round(30 * RATE_HZ))
KINDS: dict[str, Callable[[Rng], Session]] = {
    "white": lambda rng: session(rng, 6, PAIR, 20),
    "drift of 30 s": lambda rng: session(rng, 6, PAIR, 30, drift=(0.005, 30.0)),
    "drift of 3000 s": lambda rng: session(rng, 6, PAIR, 30, drift=(0.03, 3000.0)),
    "turn-on bias and scale, 10 cycles": lambda rng: session(rng, 10, PAIR, 20, bias_sd_dps=0.01, scale_sd=3e-4),
    "turn-on bias and scale, 3 cycles": lambda rng: session(rng, 3, PAIR, 30, bias_sd_dps=0.01, scale_sd=3e-4),
    "one cycle of eight runs": lambda rng: session(rng, 1, MANY, 20, drift=(0.005, 100.0)),
    "one static run of 900 s": lambda rng: session(rng, 1, (0.0,), 900, drift=(0.01, 2000.0)),
    "staircase of 390 s": lambda rng: session(rng, 1, (0.0,), 390, drift=(0.005, 200.0), reference=STEPS),
}


def judge(kind: str, seed: int) -> dict[str, Any]:
    """One session of noise alone, compared and diagnosed."""
    made = KINDS[kind](np.random.default_rng([seed, list(KINDS).index(kind)]))
    began = time.perf_counter()
    compared = compare(made)
    between = time.perf_counter()
    verdict = diagnose(made).verdict
    axes = {
        axis: {
            "ratio": float(np.sqrt(s.all / f.all)), "z": (s.all - f.all) / f.error,
            "z_within": (s.within - f.within) / f.error_within,
        }
        for axis, s, f in ((a, compared.squares[a], compared.floors[a]) for a in compared.per_axis)
    }  # fmt: skip
    where = [[f.axis, f.against, f.note, f.chance] for f in compared.where]
    return {
        "kind": kind, "seed": seed, "compare": compared.verdict, "diagnose": verdict, "axes": axes, "where": where,
        "held_out": compared.held_out, "compare_s": between - began, "diagnose_s": time.perf_counter() - between,
    }  # fmt: skip


def report(rows: list[dict[str, Any]]) -> None:
    print(f"{'kind':34s} {'n':>3s} {'held out':8s} {'rms / floor':>17s} {'z':>13s} {'z within':>13s}  alarms  contradictions")
    for kind in KINDS:
        mine = [r for r in rows if r["kind"] == kind]
        if not mine:
            continue
        ratio, z, within = (np.array([a[k] for r in mine for a in r["axes"].values()]) for k in ("ratio", "z", "z_within"))
        apart = sum((r["compare"] == "adequate") != (r["diagnose"] == "adequate") for r in mine)
        alarms = sum(r["compare"] != "adequate" for r in mine)
        print(
            f"{kind:34s} {len(mine):3d} {mine[0]['held_out']:8s} {ratio.mean():.5f} +- {ratio.std() / ratio.size**0.5:.5f} "
            f"{z.mean():5.2f} sd {z.std():5.2f} {within.mean():5.2f} sd {within.std():5.2f}  {alarms:6d}  {apart:14d}"
        )


def main() -> int:
    path, count = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else SESSIONS
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {(r["kind"], r["seed"]) for r in rows}
    with path.open("a") as file:
        for seed in range(count):
            for kind in KINDS:
                if (kind, seed) not in done:
                    rows.append(judge(kind, seed))
                    file.write(json.dumps(rows[-1]) + "\n")
                    file.flush()
    report(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
