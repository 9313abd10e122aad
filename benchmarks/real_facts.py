"""A fact about a recording by others as gyrocal tells it and as it is, and the sessions that ``benchmarks/real.py`` grades."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from gyrocal.diagnosis.answer.explain import Explanation
from gyrocal.recording.session import AXES, Array, Session


@dataclass(frozen=True)
class Fact:
    """What gyrocal says of a recording, and what is true. ``source`` states where the truth comes from."""

    recording: str
    what: str
    ours: str
    truth: str
    source: str
    ok: bool


def close(recording: str, what: str, ours: float | None, truth: float, within: float, source: str) -> Fact:
    """A number that must agree within a tolerance."""
    ok = ours is not None and abs(ours - truth) <= within
    told = "-" if ours is None else f"{ours:.4g}"
    return Fact(recording, what, told, f"{truth:.4g} ± {within:.2g}", source, ok)


def said(recording: str, what: str, ours: str, truth: str, source: str, ok: bool) -> Fact:
    """A statement that must be true."""
    return Fact(recording, what, ours, truth, source, ok)


def named_on(found: Explanation, axis: str) -> list[str]:
    """The effects that gyrocal added or left open on an axis."""
    added = [t.effect_id for t in found.model.on(axis) if t.effect.role is None]
    return [*added, *(i for one in found.left if one.axis == axis for i in one.group)]


def value(found: Explanation, effect: str, axis: str, name: str) -> float | None:
    """A fitted parameter; None if the model does not have it."""
    line = found.model.line(effect, axis)
    return None if line is None else line.values.get(name)


def words(items: list[str]) -> str:
    return ", ".join(items) or "nothing"


def saved(work: Path, t_s: Array, gyro_dps: Array, facts: dict[str, Any], **columns: Array) -> Session:
    """One run as a session folder, as a user would write it: a CSV file and session.toml."""
    lsb_dps, clock = facts.pop("lsb_dps", None), facts.pop("clock", None)
    return saved_runs(work, t_s, gyro_dps, [("run", slice(None), facts)], lsb_dps=lsb_dps, clock=clock, **columns)


def saved_runs(
    work: Path, t_s: Array, gyro_dps: Array, runs: list[tuple[str, Any, dict[str, Any]]], *, lsb_dps: float | None = None,
    clock: str | None = None, **columns: Array,
) -> Session:  # fmt: skip
    """Runs cut from one recording, each with the facts of its entry in session.toml."""
    work.mkdir(parents=True, exist_ok=True)
    axis = runs[0][2].get("axis", "z") if len(runs) == 1 else "z"
    step_s = (t_s[-1] - t_s[0]) / (t_s.size - 1)
    lines = ['format = "gyrocal-session/1"', f'axis = "{axis}"', f"sample_rate_hz = {1 / step_s:.6f}"]
    lines += [] if lsb_dps is None else [f"lsb_dps = {lsb_dps}"]
    lines += [] if clock is None else ["[reference]", f'clock = "{clock}"']
    for name, rows, facts in runs:
        table_of_run = {"t_s": t_s[rows] - t_s[rows][0], **{f"g{a}_dps": gyro_dps[rows, i] for i, a in enumerate(AXES)}}
        table_of_run |= {key: column[rows] for key, column in columns.items()}
        pl.DataFrame(table_of_run).fill_nan(None).write_csv(work / f"{name}.csv")
        facts = {"face": "up", "scenario": "s000", **facts}
        lines += ["[[run]]", f'file = "{name}.csv"']
        lines += [f"{k} = {json.dumps(v)}" for k, v in facts.items()]
    (work / "session.toml").write_text("\n".join(lines) + "\n")
    return Session.open(work)
