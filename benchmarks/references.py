"""Each kind of reference: errors over standard errors, and effects named, in simulated sessions with a known truth.

    gyrocal benchmark references --limit 200 --results references.jsonl
    gyrocal benchmark references --kind rates --kind by_hand --limit 20

The spread of an error over its standard error should be within 0.85 to 1.2. Sessions that the results already hold are not run
again.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks import reference_sessions as sessions
from benchmarks.sessions_by_seed import bounds, judged, share

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.gravity.aims import progress
from gyrocal.gravity.calibrate import calibrate, misalignment
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Session
from gyrocal.simulation.simulate import simulate

SEEDS, FIRST_SEED = 20, 0
SAMPLE = ("second_file", "encoder", "by_hand")
BAND = (0.85, 1.2)
LEAST_S = 50.0
"""15 rests, which a guided recording has at the least, take longer."""
SCALE, CROSS = 0.003, 0.004
"""Errors of scale and misalignment that a calibration by hand should stay within."""


@dataclass(frozen=True)
class Kind:
    """A kind of reference and how its sessions are made; None for the campaign ``hands``.

    ``to_aims``: the recording ends where ``gyrocal record --hands`` ends it.
    """

    words: str
    make: Callable[[np.random.Generator], sessions.Made] | None
    to_aims: bool = False


KINDS = {
    "rates": Kind("rates about three axes, own frame and clock", sessions.rates),
    "orientations": Kind("orientations, own frame and clock", sessions.quaternions),
    "second_file": Kind("a rate in a second file, own clock and sample rate", sessions.second_file),
    "encoder": Kind("an encoder's angle, steps of 0.02-0.2 deg", sessions.encoder((0.02, 0.1, 0.2), planted=False)),
    "encoder_cycles": Kind(
        "an encoder's angle, and a scale that differs by 0.05 % between power cycles",
        sessions.encoder((0.02, 0.1, 0.2), planted=False, scale_sd=5e-4),
    ),
    "coarse_encoder": Kind("an encoder's angle, steps of 0.5-1 deg", sessions.encoder((0.5, 1.0), planted=False)),
    "encoder_effect": Kind("an effect by an encoder, steps of 0.02-0.5 deg", sessions.encoder((0.02, 0.1, 0.5), planted=True)),
    "turns": Kind("turns of a known angle", sessions.turns),
    "by_hand": Kind("gravity, 30 rests", None),
    "by_hand_guided": Kind("gravity, ended at the aims of record --hands", None, to_aims=True),
}


def judge(job: tuple[str, int]) -> dict[str, Any]:
    """One session: errors, errors over standard errors by parameter, the verdict, and whether the planted effect is named."""
    (name, seed), begun = job, time.process_time()
    kind = KINDS[name]
    if kind.make is None:
        found = _by_hand(seed, kind.to_aims)
    else:
        found = _made(kind.make(np.random.default_rng([zlib.crc32(name.encode()), seed])))
    return {"kind": name, "seed": seed, **found, "seconds": time.process_time() - begun}


def _made(made: sessions.Made) -> dict[str, Any]:
    model = Model.builtin("default")
    for effect, axis in made.known:
        model = model.add(effect, axis)
    given, named, false = model, None, False
    if made.effect is not None:
        found = diagnose(made.session, model)
        added = [(c.axis, {c.effect.id, *c.group}) for c in found.candidates if c.decision == "add"]
        named = any(axis == made.effect[1] and made.effect[0] in group for axis, group in added)
        false = any(axis != made.effect[1] or made.effect[0] not in group for axis, group in added)
        given = model.add(*made.effect)
    last = compare(made.session, given)
    lines = {(p["effect"], p["axis"], p["name"]): p for p in last.to_json()["parameters"]}
    truth = {key: value for key, value in _truth(made, lines).items() if key in lines}
    return {
        "verdict": last.verdict, "named": named, "false": false,
        "effect": made.effect[0] if made.effect else None,
        "errors": [[*key, lines[key]["value"] - value, lines[key]["se"]] for key, value in truth.items()],
        "where": [[f.axis, f.against, f.note] for f in last.where],
    }  # fmt: skip


def _truth(made: sessions.Made, lines: dict[Any, Any]) -> dict[Any, float]:
    """What is planted, with the rotation vector (of the two of one rotation) that is nearer to the one found."""
    keys = [("alignment", None, f"r{a}_deg") for a in AXES]
    if keys[0] not in made.truth:
        return made.truth
    planted, found = np.array([made.truth[k] for k in keys]), np.array([lines[k]["value"] for k in keys])
    other = planted * (1 - 360 / max(float(np.linalg.norm(planted)), 1e-300))
    nearest = min((planted, other), key=lambda r: float(np.linalg.norm(r - found)))
    return {**made.truth, **dict(zip(keys, map(float, nearest), strict=True))}


def _by_hand(seed: int, to_aims: bool) -> dict[str, Any]:
    """A simulated phone-grade part, turned by hand between rests, against its truth."""
    session, truth = simulate(campaign="hands", seed=seed)
    found = calibrate(_until_aims(session) if to_aims else session)
    planted = truth["runs"][0]
    errors: list[list[Any]] = []
    for e in found.estimates:
        i = AXES.index(e.axis)
        assert e.scale is not None
        assert e.bias_dps is not None
        errors.append(["scale", e.axis, "scale", e.scale - planted["scale"][i], e.scale_se])
        errors.append(["bias", e.axis, "bias_dps", e.bias_dps - planted["bias_dps"][i], e.bias_se_dps])
    for row in misalignment(next(iter(found.fits.values())), "s000"):
        true = truth["misalignment"][AXES.index(row["axis"])][AXES.index(row["about"])]
        errors.append(["misalignment", row["axis"], f"m_{row['about']}", row["value"] - true, row["se"]])
    flagged = any(e.flags for e in found.estimates)
    limits = {"scale": SCALE, "misalignment": CROSS}
    within = all(abs(error) < limits[effect] for effect, _, _, error, _ in errors if effect in limits)
    verdict = "misfit" if flagged else "adequate"
    return {"verdict": verdict, "named": None, "false": False, "effect": None, "errors": errors, "where": [], "within": within}


def _until_aims(session: Session) -> Session:
    """The recording until its standard errors meet the aims, looked at every five seconds."""
    (whole,) = session.runs
    for seconds in np.arange(LEAST_S, whole.duration_s, 5.0):
        part = session.with_runs([whole.first(float(seconds)) or whole])
        if progress(part).met:
            return part
    return session


def run(
    sample: bool, progress: Callable[[int, int], None], kinds: Sequence[str] = (), limit: int = SEEDS,
    results: Path | None = None, seed: int = FIRST_SEED,
) -> dict[str, Any]:  # fmt: skip
    """What ``gyrocal benchmark references --json`` prints: ``limit`` seeds from ``seed`` of each kind."""
    unknown = [k for k in kinds if k not in KINDS]
    if unknown:
        raise InputError(f"no kind {unknown[0]!r} of reference; there are {', '.join(KINDS)}")
    wanted = list(kinds) or (list(SAMPLE) if sample else list(KINDS))
    jobs = [(kind, s) for s in range(seed, seed + (1 if sample else limit)) for kind in wanted]
    rows = judged(judge, jobs, results, progress)
    return {"rows": [_line(kind, [row for row in rows if row["kind"] == kind]) for kind in wanted]}


def _line(kind: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The figures of one kind. Shares have their exact 95 % limits."""
    n, planted = len(rows), [r for r in rows if r["effect"] is not None]
    parameters: dict[str, list[tuple[float, float | None]]] = {}
    for r in rows:
        for effect, _, name, error, se in r["errors"]:
            parameters.setdefault(effect if effect == "misalignment" else name, []).append((error, se))
    adequate, named = sum(r["verdict"] == "adequate" for r in rows), sum(bool(r["named"]) for r in planted)
    within = [r["within"] for r in rows if "within" in r]
    return {
        "kind": kind, "words": KINDS[kind].words, "sessions": n,
        "adequate": adequate, "adequate_bounds": bounds(adequate, n),
        "named": named if planted else None, "named_bounds": bounds(named, len(planted)) if planted else None,
        "false_names": sum(r["false"] for r in rows),
        "by_effect": {e: [sum(r["named"] for r in planted if r["effect"] == e), sum(r["effect"] == e for r in planted)]
                      for e in sorted({r["effect"] for r in planted})},
        "within": sum(within) if within else None, "within_bounds": bounds(sum(within), len(within)) if within else None,
        "parameters": {name: _spread(of) for name, of in parameters.items()},
    }  # fmt: skip


def _spread(of: Sequence[tuple[float, float | None]]) -> dict[str, Any]:
    """Root mean square and largest of the error, and of the error over its standard error where that is known."""
    errors, z = np.array([e for e, _ in of]), np.array([e / se for e, se in of if se])
    wide = 2 / np.sqrt(2 * max(z.size, 1))
    out = {"n": int(z.size), "error_rms": float(np.sqrt(np.mean(errors**2))), "error_largest": float(np.abs(errors).max())}
    if z.size:
        rms = float(np.sqrt(np.mean(z**2)))
        out |= {"z_mean": float(z.mean()), "z_rms": rms, "z_largest": float(np.abs(z).max())}
        out["ok"] = bool(BAND[0] * (1 - wide) <= rms <= BAND[1] * (1 + wide))
    return out


def show(found: dict[str, Any]) -> None:
    """Two tables: verdicts and names of each kind, and the errors of its parameters."""

    def if_any(count: int | None, limits: Sequence[float] | None, n: int) -> str:
        return "-" if count is None or limits is None else share(count, limits, n)

    rows, errors = [], []
    for line in found["rows"]:
        n, by = line["sessions"], line["by_effect"].values()
        rows.append([
            line["kind"], line["words"], share(line["adequate"], line["adequate_bounds"], n),
            if_any(line["named"], line["named_bounds"], sum(of for _, of in by)), str(line["false_names"]),
            if_any(line["within"], line["within_bounds"], n),
        ])  # fmt: skip
        for name, of in line["parameters"].items():
            z = [f"{of[key]:.2f}" for key in ("z_rms", "z_largest")] if of["n"] else ["-", "-"]
            errors.append([line["kind"], name, str(of["n"]), f"{of['error_rms']:.2g}", f"{of['error_largest']:.2g}", *z])
    columns = ["kind:", "reference:", "model adequate (95 %)", "effect named (95 %)", "false names", "within 0.3 %, 0.004"]
    table("each kind of reference", columns, rows)
    table("errors", ["kind:", "parameter:", "number", "error, rms", "largest", "over its standard error", "largest "], errors)
    stdout.print("An error over its standard error should spread by 0.85 to 1.2.", markup=False)
