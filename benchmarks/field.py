"""Sessions as users bring them: false names and alarms where nothing is planted, and errors of what is planted.

    gyrocal benchmark field --limit 5 --results field.jsonl
    gyrocal benchmark field --kind flicker --kind chamber70 --limit 10 --seed 500

The sessions are written by :mod:`benchmarks.field_sessions` and :mod:`benchmarks.field_planted`, whose physics does not come
from the library, and are read from their folders as users' are. Sessions that the results already hold are not run again.
"""

from __future__ import annotations

import tempfile
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks import field_planted as planted
from benchmarks import field_sessions as nulls
from benchmarks.sessions_by_seed import bounds, judged, share

from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.errors import InputError
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import Session

SEEDS, FIRST_SEED = 10, 401
SAMPLE = ("ten_hz", "chamber_wide")


@dataclass(frozen=True)
class Kind:
    """What a user brings, and how it is made."""

    words: str
    make: Callable[[nulls.Recording], None]


NULLS = {
    "plain": Kind("white noise and a slow drift", nulls.plain),
    "lowpass": Kind("a sensor's low-pass of 5-42 Hz, 100-500 Hz", nulls.lowpass),
    "flicker": Kind("flicker noise over decades", nulls.flicker),
    "encoder_stairs": Kind("a staircase by a noisy, coarse encoder", nulls.encoder_stairs),
    "encoder_swing": Kind("a swing by a noisy, coarse encoder", nulls.encoder_swing),
    "swing": Kind("a swing, exact reference", nulls.exact_swing),
    "stairs": Kind("a staircase, exact reference", nulls.exact_stairs),
    "level_in_run": Kind("the noise's level changes in a run", nulls.level_in_run),
    "level_between": Kind("the noise's level differs between runs", nulls.level_between),
    "correlated": Kind("axes that share noise", nulls.correlated),
    "t5": Kind("tails of Student's t, 5 degrees of freedom", nulls.heavy_tails(5)),
    "t3": Kind("tails of Student's t, 3 degrees of freedom", nulls.heavy_tails(3)),
    "thermometer": Kind("a noisy, coarse thermometer", nulls.thermometer),
    "forty_min": Kind("runs of 40 minutes", nulls.forty_min),
    "khz": Kind("1000 Hz", nulls.khz),
    "ten_hz": Kind("10 Hz", nulls.ten_hz),
    "coarse": Kind("counts of 0.06-0.1 deg/s", nulls.coarse),
    "static_hours": Kind("static hours", nulls.static_hours),
}
PLANTED = {
    "chamber45": Kind("a chamber at 43.5-46.5 degC", planted.chamber(43.5, 46.5)),
    "chamber70": Kind("a chamber at 67-73 degC", planted.chamber(67, 73)),
    "chamber_wide": Kind("set points from -10 to 60 degC", planted.chamber_wide),
    "ramp": Kind("one-way ramps of temperature", planted.ramp),
    "temp_missing": Kind("two runs without a thermometer", planted.temp_missing),
    "stairs_asymmetry": Kind("asymmetry on a staircase by a noisy encoder", planted.stairs_asymmetry),
    "lag_delay": Kind("a delay of 1-300 ms", planted.late(filtered=False)),
    "lag_filter": Kind("a first-order low-pass of 1-300 ms", planted.late(filtered=True)),
    "clock": Kind("a clock error of 0.01-2 %", planted.clock),
    "warmup": Kind("a warm-up after power-on", planted.warmup),
    "ripple": Kind("a ripple of the table", planted.ripple),
    "tone": Kind("a vibration's tone", planted.tone),
}
KINDS = {**NULLS, **PLANTED}


def write(kind: str, seed: int, folder: Path) -> dict[str, Any]:
    """Write the session of a kind and a seed; return its truth."""
    made = nulls.Recording(seed, np.random.default_rng([zlib.crc32(kind.encode()), seed]))
    KINDS[kind].make(made)
    return made.write(folder)


def judge(job: tuple[str, int]) -> dict[str, Any]:
    """One session: verdicts, names, floor over rms, and errors over standard errors of what is planted."""
    kind, seed = job
    with tempfile.TemporaryDirectory() as folder:
        truth = write(kind, seed, Path(folder) / "s")
        session = Session.open(Path(folder) / "s")
        began = time.process_time()
        compared, found = compare(session), diagnose(session)
        last = compared
        if truth["effect"]:
            last = add(session, None, truth["effect"]).after
    planted_of = {**truth["planted"], "scale": truth["scale"]}
    lines = [p for p in last.to_json()["parameters"] if p["axis"] in ("z", None) and p["effect"] in (truth["effect"], "scale")]
    z = {p["name"]: (p["value"] - planted_of[p["name"]]) / p["se"] for p in lines if p["name"] in planted_of and p["se"]}
    level = last.pooled
    return {
        "kind": kind, "seed": seed, "rows": truth["rows"], "seconds": time.process_time() - began, "effect": truth["effect"],
        "compare": compared.verdict, "diagnose": found.verdict, "after": last.verdict, "z": z,
        "where": [[f.axis, f.against, f.note, f.chance] for f in compared.where],
        "names": [[c.effect.id, c.axis, [*c.group]] for c in found.candidates if c.decision == "add"],
        "floor_over_rms": level.floor_dps / level.rms_dps if level.rms_dps else None,
        "excess_over_floor": max((of.excess_within_dps or 0.0) / of.floor_dps for of in last.per_axis.values()),
    }  # fmt: skip


def run(
    sample: bool, progress: Callable[[int, int], None], kinds: Sequence[str] = (), limit: int = SEEDS, workers: int = 1,
    results: Path | None = None, seed: int = FIRST_SEED,
) -> dict[str, Any]:  # fmt: skip
    """What ``gyrocal benchmark field --json`` prints: ``limit`` seeds from ``seed`` of each kind."""
    unknown = [k for k in kinds if k not in KINDS]
    if unknown:
        raise InputError(f"no kind {unknown[0]!r} of session; there are {', '.join(KINDS)}")
    wanted = list(kinds) or (list(SAMPLE) if sample else list(KINDS))
    jobs = [(kind, s) for s in range(seed, seed + (1 if sample else limit)) for kind in wanted]
    return summary(judged(judge, jobs, results, progress, workers))


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """A line for each kind, and for all nulls and all planted kinds together."""
    out = []
    for title, group in (("no effect", NULLS), ("planted", PLANTED)):
        mine = [row for row in rows if row["kind"] in group]
        present = [kind for kind in group if any(row["kind"] == kind for row in mine)]
        out += [_line(kind, group[kind].words, [r for r in mine if r["kind"] == kind]) for kind in present]
        if len(present) > 1:
            out.append(_line(title, "all of these", mine))
    return {"rows": out}


def _line(kind: str, words: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    false = sum(any(r["effect"] not in (name, *group) for name, _, group in r["names"]) for r in rows)
    named = sum(any(r["effect"] in (name, *group) for name, _, group in r["names"]) for r in rows)
    nulls_alarmed = sum(r["effect"] is None and (r["compare"], r["diagnose"]) != ("adequate", "adequate") for r in rows)
    apart = sum((r["compare"] == "adequate") != (r["diagnose"] == "adequate") for r in rows)
    ratios = [r["floor_over_rms"] for r in rows if r["floor_over_rms"]]
    excesses = [r["excess_over_floor"] for r in rows if "excess_over_floor" in r]
    planted_z = [v for r in rows for name, v in r["z"].items() if name != "scale"]
    scale_z = [r["z"]["scale"] for r in rows if "scale" in r["z"]]
    return {
        "kind": kind, "words": words, "sessions": len(rows), "false_names": false, "named": named, "alarms": nulls_alarmed,
        "contradictions": apart, "bounds": [bounds(n, len(rows)) for n in (false, nulls_alarmed)],
        "floor_over_rms": [min(ratios), max(ratios)] if ratios else None, "excess_over_floor": max(excesses, default=None),
        "z": _spread(planted_z), "scale_z": _spread(scale_z),
    }  # fmt: skip


def _spread(z: Sequence[float]) -> dict[str, float] | None:
    if not z:
        return None
    return {"n": len(z), "mean": float(np.mean(z)), "rms": float(np.sqrt(np.mean(np.square(z)))), "largest": max(map(abs, z))}


def show(found: dict[str, Any]) -> None:
    """The table."""

    def spread(of: dict[str, float] | None) -> str:
        return "-" if of is None else f"{of['rms']:.2f} ({of['n']}), {of['largest']:.1f}"

    rows = []
    for line in found["rows"]:
        n = line["sessions"]
        ratio = "-" if line["floor_over_rms"] is None else "-".join(f"{x:.3f}" for x in line["floor_over_rms"])
        rows.append([
            line["kind"], line["words"], share(line["false_names"], line["bounds"][0], n),
            share(line["alarms"], line["bounds"][1], n), f"{line['named']}/{n}", str(line["contradictions"]), ratio,
            spread(line["z"]), spread(line["scale_z"]),
        ])  # fmt: skip
    columns = [
        "kind:", "what is brought:", "false names (95 %)", "alarms (95 %)", "named", "contradictions", "floor / rms",
        "z of planted: rms (n), largest", "z of scale",
    ]  # fmt: skip
    table("sessions as users bring them", columns, rows)
    stdout.print("A scale of one power cycle alone is judged against the scale of that cycle.", markup=False)
