"""The standard errors and the trust of `calibrate` over a population of sensors, on tables with and without effects.

Each sensor has a scale within 3 % and a bias within 10 deg/s, evenly drawn, white noise, and drift of 0 to 1.35 mdps over 20 to
40 s, which is a bias instability of up to 3 deg/h. Its first face is recorded for 40 s from 3 s after power-on, its second one
9 s later. Four kinds of tables and sensors:

- none: no effect;
- typical: one in ten has each of the effects of the library that act within such a session, of a size drawn evenly in the
  logarithm from its typical range: ripple of orders 1 and 2, spin-up, a tone, warm-up, slow drift, a jump of the bias;
- warm-up: each has a warm-up of the largest typical size, 50 mdps over 60 s;
- warm-up, 20 s: the same where the first face is recorded for 20 s.

Truth is the sensor's scale, and its mean bias over both faces' seconds, with what changes it in that time: warm-up, slow drift,
jump. The random drift does not belong to it.

    gyrocal benchmark population --workers 2 --results population.jsonl
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

import gyrocal
from gyrocal.calibration.estimator import Answer, Calibration
from gyrocal.calibration.limit import PROTOCOL
from gyrocal.calibration.network import FaceNetwork
from gyrocal.calibration.scenarios import answers
from gyrocal.calibration.trust import disagreement
from gyrocal.calibration.uncertainty import (
    DRIFT_SD_DPS,
    DRIFT_TAU_S,
    PRESENT,
    Combined,
    FaceSums,
    face_posterior,
    held,
    last_turn,
    misfit,
    misfit_limit,
    misfit_of,
    moved,
    white_variance,
)
from gyrocal.effects import base
from gyrocal.fleet.engine import engine
from gyrocal.noise.drift import ou_noise
from gyrocal.noise.whitening import Noise
from gyrocal.policy import POLICY
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import Array
from gyrocal.simulation.simulate import LSB_DPS, RATE_HZ, TABLE_RATE_DPS, WHITE_SD_DPS

SENSORS, SAMPLE_SENSORS = 2000, 300
SEED = 900_000
SECONDS = (2.0, 4.0, 6.0)
SCALE, BIAS_DPS = 0.03, 10.0
DRIFT_DPS, DRIFT_S = (0.0, 0.00135), (20.0, 40.0)
POWER_ON_S, FLIP_S = 3.0, 9.0
FEWEST = 10
"""Number of trusted answers from which on their errors have figures."""
W_DPS = (TABLE_RATE_DPS, -TABLE_RATE_DPS)
ORDERS = (1, 2)
FAR = 5.0
METHODS = ("baseline", "cnn", "model")
FIGURES = (("sd", ".2f"), ("95", ".1%"), ("sd_all", ".2f"))


@dataclass(frozen=True)
class Kind:
    """Tables and sensors of a population: which part has each effect, the warm-up of all, how long the first face lasts."""

    part: float = 0.0
    warmup: tuple[float, float] | None = None
    """Size (deg/s) and time constant (s)."""
    recorded_s: float = 40.0


KINDS = {
    "none": Kind(), "typical": Kind(PRESENT), "warm-up": Kind(warmup=(0.05, 60.0)),
    "warm-up, 20 s": Kind(warmup=(0.05, 60.0), recorded_s=20.0),
}  # fmt: skip


@dataclass(frozen=True)
class Population:
    """Readings less the true rate (dps) of both faces [N, samples], the second of 6 s; true scale and, by seconds, bias [N]."""

    faces: tuple[Array, Array]
    t_us: np.ndarray[Any, np.dtype[np.int64]]
    """Times of the first face's samples."""
    scale: Array
    bias_dps: dict[float, Array]

    @staticmethod
    def draw(n: int, kind: Kind, seed: int) -> Population:
        rng = np.random.default_rng(seed)
        samples = [round(s * RATE_HZ) for s in (kind.recorded_s, SECONDS[-1])]
        t_s = np.round(np.arange(samples[0]) / RATE_HZ, 6)
        scale, bias_dps = rng.uniform(-SCALE, SCALE, (n, 1)), rng.uniform(-BIAS_DPS, BIAS_DPS, (n, 1))
        common = _Common.draw(n, kind, rng)
        faces, lasting = [], []
        power_on_s = (POWER_ON_S, POWER_ON_S + kind.recorded_s + FLIP_S)
        for w_dps, since_s, m in zip(W_DPS, power_on_s, samples, strict=True):
            lasting.append(common.lasting(t_s[:m], since_s, rng))
            passing = common.passing(t_s[:m], w_dps, rng)
            sd_dps, tau_s = rng.uniform(*DRIFT_DPS, (n, 1)), float(rng.uniform(*DRIFT_S))
            drift = ou_noise(m, 1 / RATE_HZ, 1.0, tau_s, n, rng).T * sd_dps
            noise = rng.normal(0.0, WHITE_SD_DPS, (n, m))
            y = (1 + scale) * w_dps + bias_dps + lasting[-1] + passing + drift + noise
            faces.append(np.round(y / LSB_DPS) * LSB_DPS - w_dps)
        means = {s: sum(x[:, : round(s * RATE_HZ)].mean(1) for x in lasting) / 2 for s in SECONDS}
        truth = {s: bias_dps[:, 0] + mean for s, mean in means.items()}
        return Population((faces[0], faces[1]), np.rint(t_s * 1e6).astype(np.int64), scale[:, 0], truth)


@dataclass(frozen=True)
class _Common:
    """The effects of a table and a sensor, and their parameters that both faces share, [N, 1] each."""

    n: int
    sizes: dict[str, Array]
    tone_hz: Array
    warmup_tau_s: Array

    @staticmethod
    def draw(n: int, kind: Kind, rng: np.random.Generator) -> _Common:
        def size(effect: str, parameter: str) -> Array:
            acts = rng.random((n, 1)) < kind.part
            return acts * _typical(n, effect, parameter, rng)

        sizes = {f"ripple_{k}": size("table_ripple", f"amplitude_{k}") for k in ORDERS}
        sizes |= {"spin_up": size("spin_up", "A") * _sign(n, rng), "tone": size("vibration_tone", "A_dps")}
        sizes |= {"warmup": size("warmup", "A_dps") * _sign(n, rng), "drift": size("drift", "k_dps_per_s") * _sign(n, rng)}
        sizes |= {"jump": size("bias_jumps", "size_dps")}
        tone_hz = np.exp(rng.uniform(np.log(1.0), np.log(RATE_HZ / 2), (n, 1)))
        warmup_tau_s = _typical(n, "warmup", "tau_s", rng)
        if kind.warmup is not None:
            sizes["warmup"], warmup_tau_s = kind.warmup[0] * _sign(n, rng), np.full((n, 1), kind.warmup[1])
        return _Common(n, sizes, tone_hz, warmup_tau_s)

    def passing(self, t_s: Array, w_dps: float, rng: np.random.Generator) -> Array:
        """Ripple, spin-up and tone of one face in dps, [N, samples]."""
        angle = np.deg2rad(abs(w_dps)) * t_s

        def phase() -> Array:
            return rng.uniform(0, 2 * np.pi, (self.n, 1))

        y = -w_dps * self.sizes["spin_up"] * np.exp(-t_s / _typical(self.n, "spin_up", "tau_s", rng))
        for k in ORDERS:
            y += w_dps * self.sizes[f"ripple_{k}"] * np.cos(k * angle + phase())
        tone: Array = self.sizes["tone"] * np.sin(2 * np.pi * self.tone_hz * t_s + phase())
        return y + tone

    def lasting(self, t_s: Array, power_on_s: float, rng: np.random.Generator) -> Array:
        """Warm-up, drift and, in one of ten runs, a jump, in dps, [N, samples]."""
        since_s = power_on_s + t_s
        jumps = (rng.random((self.n, 1)) < 0.1) * self.sizes["jump"] * _sign(self.n, rng)
        moved = t_s > rng.uniform(0.2, 0.8, (self.n, 1)) * t_s[-1]
        y: Array = self.sizes["warmup"] * np.exp(-since_s / self.warmup_tau_s) + self.sizes["drift"] * since_s + jumps * moved
        return y


def _typical(n: int, effect: str, parameter: str, rng: np.random.Generator) -> Array:
    low, high = base.effect(effect).parameter(parameter).typical
    drawn: Array = np.exp(rng.uniform(np.log(low), np.log(high), (n, 1)))
    return drawn


def _sign(n: int, rng: np.random.Generator) -> Array:
    return rng.choice([-1.0, 1.0], (n, 1))


def judged(population: Population, seconds: float) -> dict[str, tuple[Answer, Array]]:
    """The answers of each method as arrays [N] (NaN for no answer), and whether they are trusted [N]."""
    samples = round(seconds * RATE_HZ)
    t_us = population.t_us
    readings = [face[:, :samples] for face in population.faces]
    sums = [FaceSums.of(y, t_us[:samples], RATE_HZ) for y in readings]
    variance = white_variance(sums)
    faces = [face_posterior(s, variance, w, LSB_DPS) for s, w in zip(sums, W_DPS, strict=True)]
    blocks = sum(f.blocks for f in faces)
    every, limit = Combined.of(faces, W_DPS), misfit_limit(blocks)
    turn = last_turn(population.faces[0], t_us, W_DPS[0], round(1e6 * seconds))
    off = np.zeros(len(variance)) if turn is None else moved(every, turn, W_DPS[0], variance, seconds, LSB_DPS)

    def plausible(scale: Array, bias_dps: Array) -> Array:
        found: Array = (np.abs(scale) <= POLICY.largest_scale) & (np.abs(bias_dps) <= POLICY.largest_bias_dps)
        return found

    means = [y.mean(1) for y in readings]
    drifting = Calibration("default", "z", (), (), (0.0, np.inf), (0.0, np.inf), Noise(WHITE_SD_DPS, DRIFT_SD_DPS, DRIFT_TAU_S))
    fitted = answers(drifting, *readings, seconds, PROTOCOL)
    found = {}
    for method, scale, bias_dps in (
        ("baseline", (means[0] - means[1]) / (2 * TABLE_RATE_DPS), (means[0] + means[1]) / 2),
        ("model", fitted.scale, fitted.bias_dps),
    ):
        answer = Answer(scale, every.errors_of(scale, bias_dps)[0], bias_dps, every.errors_of(scale, bias_dps)[1], None)
        found[method] = answer, (held(misfit(faces), off, blocks) <= limit) & plausible(scale, bias_dps)
    net, stage = FaceNetwork.shipped(), SECONDS.index(seconds)
    y = net.estimate(*(face[:, : net.samples(stage)] for face in readings), stage, *W_DPS)
    answer = Answer(y[:, 0], y[:, 2], y[:, 1], y[:, 3], None)  # type: ignore[arg-type]
    fits = held(misfit_of(faces, [answer.bias_dps + answer.scale * w for w in W_DPS]), off, blocks) <= limit  # type: ignore[misc]
    agrees = disagreement(every, answer) <= POLICY.network_disagrees
    scale_se, bias_se_dps = every.errors_of(y[:, 0], y[:, 1])
    answer = replace(answer, scale_se=scale_se, bias_se_dps=bias_se_dps)  # type: ignore[arg-type]
    found["cnn"] = answer, fits & agrees & plausible(y[:, 0], y[:, 1])
    return found


def figures(answer: Answer, trusted: Array, truth: tuple[Array, Array]) -> dict[str, Any]:
    """One row of figures: error over standard error of scale and bias, of trusted and of all answers, coverage, trust."""
    errors = {"scale": (answer.scale - truth[0]) / answer.scale_se, "bias": (answer.bias_dps - truth[1]) / answer.bias_se_dps}
    there = np.isfinite(errors["scale"])
    row: dict[str, Any] = {"answered": float(there.mean()), "trusted": float(trusted.mean())}
    for name, z in errors.items():
        known, off = np.abs(z[there]), np.abs(z[there & trusted])
        row |= {
            f"{name}_sd": float(np.sqrt(np.mean(off**2))) if off.size >= FEWEST else None,
            f"{name}_95": float(np.mean(off <= 1.96)) if off.size >= FEWEST else None,
            f"{name}_sd_all": float(np.sqrt(np.mean(known**2))) if known.size else None,
        }
    wrong = trusted & (np.maximum(np.abs(errors["scale"]), np.abs(errors["bias"])) > FAR)
    n = int(trusted.sum())
    return row | {"trusted_and_far": int(wrong.sum()), "n": n, "bound_95": upper_bound(int(wrong.sum()), n)}


def upper_bound(count: int, n: int) -> float:
    """Exact one-sided 95 % bound of a rate, where ``count`` of ``n`` were seen: 3/n for none (Clopper and Pearson, 1934)."""
    return float(beta.ppf(0.95, count + 1, n - count)) if count < n else 1.0


def rows_of(job: tuple[int, str, float]) -> list[dict[str, Any]]:
    """A row for each method: so many sensors of a kind after so many seconds."""
    n, kind, seconds = job
    population = Population.draw(n, KINDS[kind], SEED + list(KINDS).index(kind))
    found = judged(population, seconds)
    truth = population.scale, population.bias_dps[seconds]
    return [{"effects": kind, "seconds": seconds, "method": m, **figures(*found[m], truth)} for m in METHODS]


def run(
    sample: bool, progress: Callable[[int, int], None], workers: int | None = 0, scheduler: str | None = None,
    results: Path | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return what ``gyrocal benchmark population --json`` prints: a row for each kind of sensor, time and method.

    ``results`` is a JSONL file of finished rows, which are not computed again by the same code.
    """
    n = SAMPLE_SENSORS if sample else SENSORS
    jobs = [(n, kind, seconds) for kind in KINDS for seconds in SECONDS]
    state = code_digest().hex()
    known = results.read_text(encoding="utf-8").splitlines() if results is not None and results.is_file() else []
    done = {tuple(line["job"]): line["rows"] for line in map(json.loads, known) if line["state"] == state}
    left = [job for job in jobs if job not in done]
    with engine(workers if scheduler is None else None, scheduler) as where:
        for job, rows in where.run(_with_job, left):
            done[job] = rows
            if results is not None:
                with results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"state": state, "job": job, "rows": rows}) + "\n")
            progress(len(done), len(jobs))
    return {"sensors": n, "rows": [row for job in jobs for row in done[job]]}


def _with_job(job: tuple[int, str, float]) -> tuple[tuple[int, str, float], list[dict[str, Any]]]:
    return job, rows_of(job)


def code_digest() -> bytes:
    """A digest of the tool's and this file's source: results of other code are not comparable."""
    digest = hashlib.blake2b(Path(__file__).read_bytes(), digest_size=8)
    for path in sorted(Path(gyrocal.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()


def show(found: dict[str, Any]) -> None:
    """Print the table on the terminal."""

    def number(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    rows = [
        [
            r["effects"], f"{r['seconds']:g}", r["method"], f"{r['answered']:.1%}",
            *(number(r[f"{name}_{key}"], form) for name in ("scale", "bias") for key, form in FIGURES),
            f"{r['trusted']:.1%}", f"{r['trusted_and_far']} of {r['n']}", f"{r['bound_95']:.2%}",
        ]
        for r in found["rows"]
    ]  # fmt: skip
    columns = [
        "effects:", "first s", "method:", "answered", "scale: error/se", "95 %", "of all", "bias: error/se", "95 %", "of all",
        "trusted", "trusted, yet > 5 se off", "95 % bound",
    ]  # fmt: skip
    table(f"{found['sensors']} sensors: scale within 3 %, bias within 10 deg/s", columns, rows)
    stdout.print(
        "error/se: root mean square of the error over its standard error, 1 where it is honest. It is that of the trusted "
        "answers, 95 % their part within 1.96; the column beside them is that of all answers."
    )
