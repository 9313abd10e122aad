"""Sessions that hold no effect, only noise as sensors have it: how often does gyrocal raise an alarm or name an effect?

    python benchmarks/null_noise.py OUT.jsonl [--sessions 30] [--first 0] [KIND ...]

Each kind draws its own sessions from a seed. OUT.jsonl gets one line a session, and a kind goes on where it was stopped. The
table counts, for each kind, false names (verdict ``add`` or ``ambiguous``) and false alarms (``unknown``), each with its 95 %
upper bound (Clopper and Pearson).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.present.output import table
from gyrocal.recording.session import Array, Run, Session

LSB_DPS = 0.00875
WHITE_DPS = 0.044
FLICKER_DECADES = 6
SEED = 88_000

Draw = Callable[[np.random.Generator, int, float], Array]
"""Noise of one run, shape [n, 3], deg/s, from a generator, the number of samples, and the sample rate in Hz."""


def white(rng: np.random.Generator, n: int, rate_hz: float) -> Array:
    return rng.normal(0.0, WHITE_DPS, (n, 3))


def low_passed(rng: np.random.Generator, n: int, rate_hz: float, cutoff_hz: float, order: int = 2) -> Array:
    """White noise at eight times the sample rate, through the sensor's low-pass, then sampled: what is above folds back."""
    from scipy.signal import butter, sosfilt

    fine = 8
    sos = butter(order, cutoff_hz, fs=fine * rate_hz, output="sos")
    filtered = sosfilt(sos, rng.normal(size=(fine * (n + round(rate_hz / cutoff_hz) * 4), 3)), axis=0)
    picked = filtered[::fine][-n:]
    return WHITE_DPS * picked / filtered.std()


def flicker(rng: np.random.Generator, n: int, rate_hz: float, instability_dps: float) -> Array:
    """Noise of density ``B^2 / (2 pi f)`` from the sample rate down to far below the run's length (IEEE Std 952-1997)."""
    padded = 8 * n
    frequency_hz = np.fft.rfftfreq(padded, 1 / rate_hz)
    amplitude = np.zeros(frequency_hz.size)
    amplitude[1:] = np.sqrt(instability_dps**2 / (2 * np.pi * frequency_hz[1:]) * rate_hz * padded / 2)
    phasors = rng.normal(size=(frequency_hz.size, 3)) + 1j * rng.normal(size=(frequency_hz.size, 3))
    return np.fft.irfft(amplitude[:, None] * phasors / np.sqrt(2), padded, axis=0)[:n]


def student(rng: np.random.Generator, n: int, freedom: float) -> Array:
    return WHITE_DPS * rng.standard_t(freedom, (n, 3)) / np.sqrt(freedom / (freedom - 2))


def modulated(rng: np.random.Generator, n: int, rate_hz: float) -> Array:
    """The level steps once or twice in a run, by a factor up to 3."""
    level = np.ones(n)
    for at in rng.integers(0, n, rng.integers(1, 3)):
        level[at:] *= np.exp(rng.uniform(-1.1, 1.1))
    return white(rng, n, rate_hz) * level[:, None]


def bursts(rng: np.random.Generator, n: int, rate_hz: float) -> Array:
    """Interference: some bursts of 0.05-2 s in which the noise is 3-10 times as large."""
    out = white(rng, n, rate_hz)
    for _ in range(rng.poisson(n / rate_hz / 12)):
        start, length = rng.integers(0, n), round(rate_hz * np.exp(rng.uniform(np.log(0.05), np.log(2.0))))
        out[start : start + length] *= rng.uniform(3, 10)
    return out


def correlated(rng: np.random.Generator, n: int, rate_hz: float) -> Array:
    rho = rng.uniform(0.3, 0.9)
    return np.sqrt(rho) * white(rng, n, rate_hz)[:, :1] + np.sqrt(1 - rho) * white(rng, n, rate_hz)


def campaign(rng: np.random.Generator, rate_hz: float, draw: Draw, lsb_dps: float = LSB_DPS, rest: bool = False) -> Session:
    """Four to six power cycles, face up then face down, of 25-40 s, at +-78 deg/s (or at rest), each axis with its own bias."""
    seconds, cycles = rng.uniform(25, 40), int(rng.integers(4, 7))
    bias, scale, room_c = rng.normal(0, 0.5, 3), rng.normal(0, 0.004), rng.uniform(20, 30)
    runs = []
    for cycle in range(cycles):
        offset, warm_c = rng.normal(0, 0.005, 3), room_c + rng.normal(0, 1.5)
        for face, sign in (("up", 1.0), ("down", -1.0)):
            rate_dps = 0.0 if rest else 78.0 * sign
            runs.append(one_run(rng, len(runs), f"s{cycle:03d}", face, rate_dps, seconds, rate_hz, draw, bias + offset,
                                scale, warm_c, lsb_dps))  # fmt: skip
    return session_of(runs, rate_hz, lsb_dps)


def static(rng: np.random.Generator, rate_hz: float, draw: Draw, lsb_dps: float = LSB_DPS, seconds: float = 600.0) -> Session:
    """One long run at rest."""
    bias = rng.normal(0, 0.5, 3)
    run = one_run(rng, 0, "s000", "up", 0.0, seconds, rate_hz, draw, bias, 0.0, rng.uniform(20, 30), lsb_dps)
    return session_of([run], rate_hz, lsb_dps)


def one_run(
    rng: np.random.Generator, index: int, cycle: str, face: str, rate_dps: float, seconds: float, rate_hz: float, draw: Draw,
    bias_dps: Array, scale: float, room_c: float, lsb_dps: float,
) -> Run:  # fmt: skip
    n = round(seconds * rate_hz)
    t_s = np.arange(n) / rate_hz
    sign = 1.0 if face == "up" else -1.0
    truth = np.zeros((n, 3))
    truth[:, 2] = (1 + scale) * rate_dps
    gyro = np.rint((truth + bias_dps + draw(rng, n, rate_hz)) / lsb_dps) * lsb_dps
    temp_c = room_c + 1.5 * (1 - np.exp(-t_s / 200)) + 0.3 * np.sin(2 * np.pi * t_s / 90)
    tilt = rng.normal(0, 0.01, 2)
    acc = rng.normal(0, 0.003, (n, 3)) + np.array([tilt[0], tilt[1], sign])
    frame = pl.DataFrame({
        "t_s": t_s, "gx_dps": gyro[:, 0], "gy_dps": gyro[:, 1], "gz_dps": gyro[:, 2],
        "ax_g": acc[:, 0], "ay_g": acc[:, 1], "az_g": acc[:, 2], "temp_c": np.round(temp_c * 256) / 256,
    })  # fmt: skip
    table_dps = rate_dps * sign
    name = f"{index:03d}_{face}.csv"
    return Run(index, name, cycle, face, "z", table_dps, None, None, 3.0, rate_hz, frame=frame, lsb_dps=lsb_dps)  # type: ignore[arg-type]


def session_of(runs: list[Run], rate_hz: float, lsb_dps: float) -> Session:
    return Session(rate_hz, tuple(runs), lsb_dps=lsb_dps)


def _filtered(rng: np.random.Generator, seed: int) -> Session:
    rate_hz, cutoff_hz = ((50, 5), (50, 15), (104, 12), (104, 33), (145, 42), (200, 20), (208, 5), (416, 42))[seed % 8]
    return campaign(rng, float(rate_hz), lambda g, n, f: low_passed(g, n, f, float(cutoff_hz)))


def _levels_of_runs(rng: np.random.Generator, seed: int) -> Session:
    def draw(g: np.random.Generator, n: int, f: float) -> Array:
        return white(g, n, f) * np.exp(g.normal(0, 0.5))

    return campaign(rng, 104.0, draw)


def _coarse(rng: np.random.Generator, seed: int) -> Session:
    return campaign(rng, 104.0, white, lsb_dps=WHITE_DPS / rng.uniform(0.3, 0.8))


def walking(rng: np.random.Generator, seed: int) -> Session:
    """One power cycle of 14 runs while the room warms by 5 degC.

    The bias walks on by 0.3, 1 or 3 mdps over the root of a second, over runs and the pauses between them.
    """
    rate_hz, seconds, pause_s, step_dps = 25.0, 40.0, 10.0, (3e-4, 1e-3, 3e-3)[seed % 3]
    all_s = np.arange(round(14 * (seconds + pause_s) * rate_hz)) / rate_hz
    walk = np.cumsum(rng.normal(0, step_dps / rate_hz**0.5, (all_s.size, 3)), axis=0)
    runs: list[Run] = []
    for k, rate_dps in enumerate(2 * (45.0, -45.0, 90.0, -90.0, 20.0, -20.0, 120.0)):
        begin = round(k * (seconds + pause_s) * rate_hz)
        warm_c = 25 + 5 * (1 - float(np.exp(-all_s[begin] / 300)))

        def draw(g: np.random.Generator, n: int, f: float, begin: int = begin) -> Array:
            return white(g, n, f) + walk[begin : begin + n]

        run = one_run(rng, k, "s000", "up", rate_dps, seconds, rate_hz, draw, np.zeros(3), 4e-3, warm_c, LSB_DPS)
        runs.append(replace(run, power_on_s=float(all_s[begin])))
    return session_of(runs, rate_hz, LSB_DPS)


KINDS: dict[str, Callable[[np.random.Generator, int], Session]] = {
    "white": lambda g, s: campaign(g, 104.0, white),
    "low-pass 5-42 Hz": _filtered,
    "low-pass 42 Hz at 1 kHz": lambda g, s: campaign(g, 1000.0, lambda r, n, f: low_passed(r, n, f, 42.0)),
    "low-pass, static": lambda g, s: static(g, 104.0, lambda r, n, f: low_passed(r, n, f, float((5, 12, 33)[s % 3]))),
    "flicker": lambda g, s: campaign(g, 104.0, lambda r, n, f: white(r, n, f) + flicker(r, n, f, 0.003 + 0.012 * (s % 2))),
    "flicker, static": lambda g, s: static(g, 52.0, lambda r, n, f: white(r, n, f) + flicker(r, n, f, 0.003 + 0.012 * (s % 2))),
    "flicker, low-pass": lambda g, s: campaign(
        g, 208.0, lambda r, n, f: low_passed(r, n, f, 20.0) + flicker(r, n, f, 0.006)
    ),
    "level changes in a run": lambda g, s: campaign(g, 104.0, modulated),
    "level changes, static": lambda g, s: static(g, 52.0, modulated),
    "level differs between runs": _levels_of_runs,
    "correlated axes": lambda g, s: campaign(g, 104.0, correlated),
    "correlated, coarse counts": lambda g, s: campaign(g, 104.0, correlated, lsb_dps=0.07),
    "coarse counts": _coarse,
    "t5": lambda g, s: campaign(g, 104.0, lambda r, n, f: student(r, n, 5.0)),
    "t3": lambda g, s: campaign(g, 104.0, lambda r, n, f: student(r, n, 3.0)),
    "t5, static": lambda g, s: static(g, 52.0, lambda r, n, f: student(r, n, 5.0)),
    "bursts": lambda g, s: campaign(g, 104.0, bursts),
    "bursts, static": lambda g, s: static(g, 52.0, bursts),
    "10 Hz": lambda g, s: campaign(g, 10.0, white, rest=True),
    "10 Hz, flicker, static": lambda g, s: static(g, 10.0, lambda r, n, f: white(r, n, f) / 4 + flicker(r, n, f, 0.006)),
    "a bias that walks on": walking,
}  # fmt: skip


def judge(kind: str, seed: int) -> dict[str, Any]:
    """One session's verdict, with its false names and findings."""
    rng = np.random.default_rng((SEED, list(KINDS).index(kind), seed))
    session = KINDS[kind](rng, seed)
    began = time.process_time()
    found = diagnose(session)
    return {
        "kind": kind, "seed": seed, "verdict": found.verdict, "seconds": round(time.process_time() - began, 1),
        "names": [f"{c.effect.id} {c.axis}" for c in found.candidates if c.decision == "add"],
        "where": [f"{f.axis} {f.against}: {f.note} (chance {f.chance:.1e})" for f in found.comparison.where],
    }  # fmt: skip


def show(path: Path) -> None:
    """The table of everything that is in the file so far."""
    from scipy.stats import beta

    lines = [json.loads(line) for line in path.read_text().splitlines()]
    rows = []
    for kind in [*KINDS, "all"]:
        mine = [x for x in lines if x["kind"] == kind] if kind != "all" else lines
        n = len(mine)
        if not n:
            continue
        names = sum(x["verdict"] in ("add", "ambiguous") for x in mine)
        alarms = sum(x["verdict"] not in ("adequate", "implausible") for x in mine)
        bounds = [100 * beta.ppf(0.95, k + 1, max(n - k, 1e-9)) for k in (names, alarms)]
        rows.append([kind, str(n), str(names), f"{bounds[0]:.1f}", str(alarms), f"{bounds[1]:.1f}"])
    columns = ["noise", "sessions", "false names", "at most, %", "alarms of any kind", "at most, %"]
    table("sessions without an effect", columns, rows)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("out", type=Path)
    options.add_argument("kinds", nargs="*", metavar="KIND")
    options.add_argument("--sessions", type=int, default=30)
    options.add_argument("--first", type=int, default=0, help="the first seed")
    given = options.parse_args()
    done = set()
    if given.out.exists():
        done = {(x["kind"], x["seed"]) for x in map(json.loads, given.out.read_text().splitlines())}
    with given.out.open("a") as out:
        for seed in range(given.first, given.first + given.sessions):
            for kind in given.kinds or KINDS:
                if (kind, seed) not in done:
                    print(json.dumps(judge(kind, seed)), file=out, flush=True)
    show(given.out)


if __name__ == "__main__":
    main()
