"""Grade any tool on the benchmarks' cases: a Python file with one function, ``answer(session)``. docs/grading.md tells how.

    gyrocal benchmark edge --tool benchmarks/tools/stepwise_bic.py --stop 24
    gyrocal benchmark blind --tool mytool.py --limit 2
    gyrocal benchmark paper --tool mytool.py --sample
    GYROCAL_STRANGERS=FOLDER gyrocal benchmark strangers --tool mytool.py

``answer`` gets the folder of a session and returns a dict, each key of which may be left out: ``names``, the effects that are
certain as ``[id, axis]`` with the library's ids; ``sizes``, values by ``effect.axis.parameter``; ``corrected``, the true rates
[n, 3] of each run by its file's name. What it raises counts as a case without an answer.
"""

from __future__ import annotations

import importlib.util
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks import edge, edge_table
from benchmarks.paper_campaign import FIRST_SEED, SECONDS
from numpy.typing import NDArray

from gyrocal.calibration import limit
from gyrocal.effects.base import effects
from gyrocal.errors import InputError
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Session
from gyrocal.simulation.simulate import RATE_HZ, TABLE_RATE_DPS, paper_windows

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]
Name = tuple[str, str]
LEAST_DPS = 1e-4
"""An error that is smaller beside a bias and a scale has nothing to be removed."""
SCENARIOS, SAMPLED, EDGE_CASES = 48, 6, 24


@dataclass(frozen=True)
class Told:
    """What a tool answered on a session, and the processor time that it took, s."""

    names: tuple[Name, ...] = ()
    sizes: Mapping[str, float] = field(default_factory=dict)
    corrected: Mapping[str, Array] = field(default_factory=dict)
    seconds: float = 0.0
    error: str | None = None


Tool = Callable[[Path], Told]


def loaded(file: Path) -> Tool:
    """The tool in a Python file. Raises InputError if it has no function ``answer``."""
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise InputError(f"--tool {file}: no Python file; give one with a function answer(session)")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    answer = getattr(module, "answer", None)
    if not callable(answer):
        raise InputError(f"--tool {file}: it has no function answer(session)")

    def asked(session: Path) -> Told:
        begun = time.process_time()
        try:
            found = answer(session)
            names = tuple((str(id_), str(axis)) for id_, axis in found.get("names", ()))
            sizes = {str(name): float(value) for name, value in found.get("sizes", {}).items()}
            corrected = {Path(name).stem: np.asarray(rates, float) for name, rates in found.get("corrected", {}).items()}
        except Exception as error:
            return Told(seconds=time.process_time() - begun, error=f"{type(error).__name__}: {error}")
        return Told(names, sizes, corrected, time.process_time() - begun)

    return asked


@dataclass(frozen=True)
class Reading:
    """A run's readings, its true rates, and what the sensor's effects added to the readings, all [n, 3], deg/s."""

    name: str
    day: int
    readings: Array
    rates: Array
    added: Array


def left_over(told: Told, runs: Sequence[Reading]) -> float | None:
    """The error that a correction leaves, over that of the readings; None where not every run has one, or nothing to remove.

    Both are without noise, and a bias and a scale of each day and axis are taken out, as in the blind benchmark.
    """
    if set(told.corrected) != {run.name for run in runs}:
        return None
    left, before = list[Array](), list[Array]()
    for day in dict.fromkeys(run.day for run in runs):
        mine = [run for run in runs if run.day == day]
        for i in range(len(AXES)):
            rate = np.concatenate([run.rates[:, i] for run in mine])
            known = np.column_stack([np.ones_like(rate), rate])
            added = np.concatenate([run.added[:, i] for run in mine])
            removed = np.concatenate([(run.readings - told.corrected[run.name])[:, i] for run in mine])
            for kept, signal in ((left, removed - added), (before, added)):
                kept.append(signal - known @ np.linalg.lstsq(known, signal, rcond=None)[0])
    after, first = (float(np.sqrt(np.mean(np.concatenate(part) ** 2))) for part in (left, before))
    return after / first if first > LEAST_DPS else None


def of_sensor(id_: str) -> bool:
    """True for an effect that a correction removes: not the table's, not of the clock, and no reading that is lost."""
    known = effects().get(id_)
    return known is not None and not known.uncorrected


def planted_sizes(planted: Sequence[Any]) -> dict[str, float]:
    """What the generators planted, by ``effect.axis.parameter``."""
    return {f"{e.id}.{axis}.{name}": size for e in planted for axis in e.axes for name, size in e.parameters.items()}


def sizes_off(told: Told, planted: Mapping[str, float]) -> list[float]:
    """How far the stated sizes are from what was planted, relative to that."""
    return [abs(told.sizes[name] / size - 1) for name, size in planted.items() if name in told.sizes and size]


@dataclass
class Tally:
    """What a tool answered on the cases so far."""

    failed: list[dict[str, str]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    off: list[float] = field(default_factory=list)
    left: list[float] = field(default_factory=list)

    def add(self, case: str, told: Told, planted: Mapping[str, float], runs: Sequence[Reading]) -> None:
        """Count an answer; ``runs`` is empty where no effect of the case can be removed."""
        self.failed += [{"case": case, "error": told.error}] if told.error is not None else []
        self.seconds.append(told.seconds)
        self.off += sizes_off(told, planted)
        left = left_over(told, runs) if runs else None
        self.left += [left] if left is not None else []

    def to_json(self) -> dict[str, Any]:
        return {
            "cases": len(self.seconds), "failed": self.failed,
            "sizes": {"stated": len(self.off), "median_off": _median(self.off)},
            "corrected": {"cases": len(self.left), "median_of_before": _median(self.left)},
            "seconds": _median(self.seconds),
        }  # fmt: skip


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if len(values) else None


def of_edge(tool: Tool, sample: bool, progress: Progress, part: str = "work", stop: int = EDGE_CASES) -> dict[str, Any]:
    """Names, sizes and corrections on the first cases of a part of the edge benchmark."""
    from edge import drawn, planting, recording

    rows, tally = list[edge_table.Row](), Tally()
    jobs = edge.chosen(part, (), 0, SAMPLED if sample else stop)
    for count, job in enumerate(jobs, 1):
        draw = drawn.Draw(*job)
        case = draw.case()
        with tempfile.TemporaryDirectory() as scratch:
            recording.write(case.made, case.readings, Path(scratch) / "session", case.random)
            told = tool(Path(scratch) / "session")
        signals = [planting.signal(one, case.made) for one in case.planted if of_sensor(one.id)]
        runs = [
            Reading(f"{k:03d}_{run.face}", run.day, case.readings[k].T, run.w.T, sum(signal[k].T for signal in signals))
            for k, run in enumerate(case.made.runs) if signals
        ]  # fmt: skip
        tally.add(draw.name, told, planted_sizes(case.planted), runs)
        said = [{"effect": id_, "axis": axis, "decision": "add", "group": []} for id_, axis in told.names]
        rows += [{"kind": draw.kind, "truth": drawn.truth(case), "candidates": said}] if told.error is None else []
        progress(count, len(jobs))
    kinds = dict.fromkeys(row["kind"] for row in rows)
    by_kind = {kind: edge_table.names([row for row in rows if row["kind"] == kind]) for kind in kinds}
    return {"names": edge_table.names(rows), "by_kind": by_kind, **tally.to_json()}


def of_blind(tool: Tool, sample: bool, progress: Progress, limit: int | None = None) -> dict[str, Any]:
    """Names, sizes and corrections on the fixed cases of the blind benchmark; ``limit`` of each kind."""
    from blind import benchmark as blind
    from blind.generator.detectability import detectability
    from blind.generator.session import make
    from blind.outcome import Answer, Outcome

    planned = blind.chosen(sample, "fixed", (), limit)
    outcomes, tally = list[Outcome](), Tally()
    for count, case in enumerate(planned, 1):
        with tempfile.TemporaryDirectory() as scratch:
            truth = make(case, Path(scratch) / "session")
            readings = {run.file: run.gyro_dps for run in Session.open(Path(scratch) / "session").runs}
            told = tool(Path(scratch) / "session")
        about = np.eye(len(AXES))[AXES.index(case.table_axis)]
        ids = [e.id for e in case.effects if of_sensor(e.id)]
        runs = [
            Reading(
                Path(run.file).stem, run.day, readings[run.file], np.outer(run.rate_dps, about),
                sum(run.injected_dps[id_].T for id_ in ids),
            )
            for run in truth.runs if ids
        ]  # fmt: skip
        tally.add(case.name, told, planted_sizes(case.effects), runs)
        faintest = min((detectability(truth, e.id) for e in case.effects), default=0.0)
        answer = Answer("add" if told.names else "adequate", told.names, tuple(id_ for id_, _ in told.names[:1]))
        outcomes.append(Outcome(case, faintest, {"tool": answer}))
        progress(count, len(planned))
    figures = blind.score(outcomes, "tool")
    kept = ("false_alarm_rate", "top1_rate", "misnamed_rate", "completed_rate", "set_found_rate")
    return {**{name: figures[name] for name in kept}, **tally.to_json()}


def pair_of(up: Array, down: Array, folder: Path) -> None:
    """The session of a scenario of the paper: its two faces, of which ``up`` and ``down`` are measured less true rates, dps."""
    frames, facts = [], []
    for face, rate, errors in (("up", TABLE_RATE_DPS, up), ("down", -TABLE_RATE_DPS, down)):
        zeros = np.zeros(errors.size)
        times = np.arange(errors.size) / RATE_HZ
        frames.append({"t_s": times, "gx_dps": zeros, "gy_dps": zeros, "gz_dps": errors + rate})
        facts.append({"face": face, "table_rate_dps": TABLE_RATE_DPS, "scenario": "s000"})
    Session.from_frames(frames, facts, sensor="LSM6DSO", axis="z").save(folder)


def of_paper(tool: Tool, sample: bool, progress: Progress) -> dict[str, Any]:
    """Mean errors of scale and bias after 2, 4 and 6 s of each face, over those of the best possible answer."""
    count, data = SAMPLED if sample else SCENARIOS, paper_windows(SCENARIOS, FIRST_SEED)
    truth, tally, table2 = np.column_stack([data["scale"], data["bias_dps"]])[:count], Tally(), []
    for k, seconds in enumerate(SECONDS):
        n = round(seconds * RATE_HZ)
        found = np.full((count, 2), np.nan)
        for i in range(count):
            with tempfile.TemporaryDirectory() as scratch:
                pair_of(data["up"][i, :n].astype(float), data["down"][i, :n].astype(float), Path(scratch) / "session")
                told = tool(Path(scratch) / "session")
            tally.add(f"{seconds:g} s, scenario {i}", told, {}, ())
            found[i] = [told.sizes.get(name, np.nan) for name in ("scale.z.scale", "bias.z.bias_dps")]
            progress(k * count + i + 1, len(SECONDS) * count)
        best = limit.limit(data["up"][:count], data["down"][:count], seconds, known=False)
        least = np.abs(np.column_stack([best.scale, best.bias_dps]) - truth).mean(axis=0)
        error = np.abs(found - truth).mean(axis=0)
        table2.append({
            "seconds": seconds, "scale_mae": float(error[0]), "bias_mae_dps": float(error[1]),
            "scale_over_limit": float(error[0] / least[0]), "bias_over_limit": float(error[1] / least[1]),
        })  # fmt: skip
    return {"table2": table2, **tally.to_json()}


def of_strangers(tool: Tool, sample: bool, progress: Progress) -> dict[str, Any]:
    """Scale and bias of public recordings with a reference, against least squares by numpy (``strangers_truth.py``)."""
    from benchmarks.real_facts import close
    from benchmarks.strangers import imported
    from benchmarks.strangers_truth import recordings, reference_of, truth_of

    chosen = [one for one in recordings() if one.reference][: 2 if sample else None]
    facts, absent, tally = [], [], Tally()
    for count, one in enumerate(chosen, 1):
        progress(count, len(chosen))
        if not one.file.is_file():
            absent.append(one.name)
            continue
        with tempfile.TemporaryDirectory() as scratch:
            imported(one, Path(scratch) / "session", one.options)
            told = tool(Path(scratch) / "session")
        tally.add(one.name, told, {}, ())
        scale, bias_dps = reference_of(one, truth_of(one))
        for i, a in enumerate(AXES):
            told_scale, told_bias = told.sizes.get(f"scale.{a}.scale"), told.sizes.get(f"bias.{a}.bias_dps")
            facts.append(close(one.name, f"scale of {a}", told_scale, float(scale[i]), 0.01, "least squares in numpy"))
            facts.append(close(one.name, f"bias of {a}, dps", told_bias, float(bias_dps[i]), 0.1, "least squares in numpy"))
    return {"facts": [asdict(f) for f in facts], "true": sum(f.ok for f in facts), "of": len(facts), "absent": absent,
            **tally.to_json()}  # fmt: skip


GRADED: dict[str, Callable[..., dict[str, Any]]] = {
    "edge": of_edge, "blind": of_blind, "paper": of_paper, "strangers": of_strangers,
}


def run(sample: bool, progress: Progress, *, name: str, tool: Path, **part: Any) -> dict[str, Any]:
    """Grade the tool in a file on a benchmark. Raises InputError for a file without ``answer`` and for another benchmark."""
    if name not in GRADED:
        raise InputError(f"benchmark {name}: it grades gyrocal alone; --tool goes with {', '.join(GRADED)}")
    unknown = part.keys() - signature(GRADED[name]).parameters.keys()
    if unknown:
        raise InputError(f"benchmark {name} with --tool has no part {', '.join(sorted(unknown))}")
    return {"tool": tool.name, "benchmark": name, **GRADED[name](loaded(tool), sample, progress, **part)}


WORDS = {
    "false_alarm_rate": "a name where nothing is missing", "top1_rate": "the true effect is named first",
    "misnamed_rate": "a name that is wrong", "completed_rate": "all is named, and nothing more",
    "set_found_rate": "of sets, effects named",
}  # fmt: skip


def show(found: dict[str, Any]) -> None:
    """Print the figures of a tool."""
    rows = [[words, _text(found[key])] for key, words in WORDS.items() if key in found]
    if "names" in found:
        n = found["names"]
        rows.append(["sure names; wrong ones", f"{n['sure']}; {n['wrong']}"])
        rows.append(["planted effects that are named", f"{n['reached']['count']} of {n['reached']['of']}"])
    for line in found.get("table2", ()):
        over = f"{line['scale_over_limit']:.3g}; {line['bias_over_limit']:.3g}"
        rows.append([f"errors of scale; bias over the limit's, {line['seconds']:g} s", over])
    if "facts" in found:
        rows.append(["facts true", f"{found['true']} of {found['of']}"])
    rows.append([f"sizes, median error of {found['sizes']['stated']}", _text(found["sizes"]["median_off"])])
    rows.append([f"error left by corrections, of {found['corrected']['cases']}", _text(found["corrected"]["median_of_before"])])
    rows.append(["processor time of a case, s", _text(found["seconds"])])
    title = f"{found['tool']} on {found['benchmark']}: {found['cases']} cases, {len(found['failed'])} without an answer"
    table(title, ["figure:", "value"], rows)
    for one in found["failed"]:
        stdout.print(f"{one['case']}: {one['error']}", markup=False)
    if found.get("absent"):
        stdout.print(f"absent: {', '.join(found['absent'])}; GYROCAL_STRANGERS names the folder of clones", markup=False)


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
