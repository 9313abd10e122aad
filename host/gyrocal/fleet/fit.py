"""A fleet's sessions fitted as one population: tasks for the sessions, then the population from their summaries."""

from __future__ import annotations

import json
import time
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import replace_text
from gyrocal.fleet import missing, trend
from gyrocal.fleet.board import Done, digest_of, listen, work
from gyrocal.fleet.drift import PILOT, FleetDrift, fleet_drifts, pilot
from gyrocal.fleet.engine import Engine
from gyrocal.fleet.likelihood import CycleSpreads, Kind, evidence, names_of
from gyrocal.fleet.listing import sessions
from gyrocal.fleet.missing import Evidence, Missing
from gyrocal.fleet.outliers import Outlier, outliers
from gyrocal.fleet.pooling import Pooled, labelled, pool
from gyrocal.fleet.summary import Summary
from gyrocal.recording.session import AXES, Array

RESULTS = "results"
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Estimates:
    """One quantity of many sessions: the sessions' numbers in :attr:`Fleet.boards`, values and standard errors, each [n]."""

    sessions: np.ndarray[Any, np.dtype[np.intp]]
    values: Array = field(repr=False)
    se: Array = field(repr=False)


@dataclass(frozen=True)
class Fleet:
    """A fleet as one population. ``boards`` has each fitted session without its axes, in the order of the paths.

    ``noise`` are the levels of the noise of a sample, which are no parameters of the population.
    """

    model: Model
    boards: list[Summary]
    failed: list[Done]
    estimates: dict[str, Estimates]
    population: dict[str, Pooled]
    noise: dict[str, Pooled]
    outliers: list[Outlier]
    missing: list[Missing]
    trends: list[trend.Trend]
    attribution: str
    spreads: dict[Kind, Array]
    drifts: dict[str, FleetDrift]
    seconds: float

    @property
    def sessions_per_s(self) -> float:
        """Sessions per second, failed ones included."""
        return (len(self.boards) + len(self.failed)) / max(self.seconds, 1e-9)

    def to_json(self) -> dict[str, Any]:
        return {
            "boards": len({b.board for b in self.boards}),
            "sessions": len(self.boards),
            "failed": [{"session": d.session, "reason": d.reason} for d in self.failed],
            "population": {name: found.to_json() for name, found in self.population.items()},
            "outliers": [o.to_json() for o in self.outliers],
            "missing": [m.to_json() for m in self.missing],
            "trends": [t.to_json() for t in self.trends],
            "attribution": self.attribution,
            "warnings": dict(sorted(Counter(w for b in self.boards for w in b.warnings).items())),
            "sessions_per_s": self.sessions_per_s,
        }


def fit_fleet(source: str, model: Model, engine: Engine, out: Path, progress: Progress | None = None) -> Fleet:
    """Fit every session of ``source`` (see :func:`~gyrocal.fleet.listing.sessions`) and pool them.

    Summaries are kept in ``out/results`` and never computed twice; a session that failed is tried again. The result does not
    depend on the number of workers or their order. Raises InputError if there is no session, or none that can be fitted.
    """
    began = time.perf_counter()
    paths, results = sessions(source), out / RESULTS
    try:
        results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{results}: {error.strerror}") from None
    drifts = _drifts(paths, model, engine, results)
    task = partial(work, model=model, drifts=drifts, results=str(results.absolute()))
    done = _done(engine, task, paths, progress)
    seconds = time.perf_counter() - began
    fitted, failed = [d for d in done if d.key], [d for d in done if not d.key]
    if not fitted:
        raise InputError(f"{source}: none of {len(done)} sessions could be fitted; the first: {failed[0].reason}")
    return _pooled(model, results, fitted, failed, drifts, seconds)


def _drifts(paths: Sequence[str], model: Model, engine: Engine, results: Path) -> dict[str, FleetDrift]:
    """The drift near which each session is fitted. A fleet that grows keeps that of its first ``PILOT`` or more sessions."""
    kept = results / f"{digest_of(model)}.fleet-drift.json"
    if kept.is_file():
        return {axis: FleetDrift(**drift) for axis, drift in json.loads(kept.read_text()).items()}
    told = _done(engine, partial(listen, model=model, results=str(results.absolute())), pilot(paths), None)
    drifts = fleet_drifts(json.loads((results / f"{d.key}.drift.json").read_text()) for d in told if d.key)
    if sum(bool(d.key) for d in told) == PILOT:
        replace_text(kept, json.dumps({axis: asdict(drift) for axis, drift in drifts.items()}))
    return drifts


def _done(engine: Engine, task: Callable[[str], Done], paths: Sequence[str], progress: Progress | None) -> list[Done]:
    done = []
    for one in engine.run(task, paths, lambda path, reason: Done(path, reason=reason)):
        done.append(one)
        if progress is not None:
            progress(len(done), len(paths))
    return sorted(done, key=lambda d: d.session)


def _summaries(results: Path, fitted: Sequence[Done], equations: bool = True) -> Iterator[Summary]:
    """The summaries one by one, in the order of the sessions' paths."""
    for done in fitted:
        yield Summary.load(results / f"{done.key}.npz", equations).at(done.session)


def drift_weights(
    boards: Iterable[Summary], drifts: dict[str, FleetDrift]
) -> tuple[dict[str, FleetDrift], dict[str, Array]]:  # fmt: skip
    """The drift of each axis from all boards, and the weights [3] of their equations at the drifts near the first one."""
    said = {axis: np.zeros(3) for axis in drifts}
    for board in boards:
        for axis in board.axes.keys() & said.keys():
            said[axis] += board.axes[axis].drift_loglik
    refined, weights = dict(drifts), {axis: np.ones(1) for axis in AXES}
    for axis, drift in drifts.items():
        refined[axis], weights[axis] = drift.refined(said[axis])
    return refined, weights


def _pooled(
    model: Model, results: Path, fitted: Sequence[Done], failed: list[Done], drifts: dict[str, FleetDrift], seconds: float
) -> Fleet:  # fmt: skip
    boards, estimates = _estimates(_summaries(results, fitted, equations=False))
    drifts, weights = drift_weights(_summaries(results, fitted, equations=False), drifts)
    cycles = {axis: CycleSpreads() for axis in AXES}
    names: dict[str, set[str]] = {axis: set() for axis in AXES}
    for summary in _summaries(results, fitted):
        for axis, one in summary.axes.items():
            cycles[axis].add(one, weights[axis])
            names[axis] |= set(names_of([one]))
    spreads = {kind: sd for axis in AXES for kind, sd in cycles[axis].fit().items()}
    board, rig = labelled([b.board for b in boards]), labelled([b.rig for b in boards])
    population, found = {}, []
    for name, of in estimates.items():
        if name in WHITE:
            continue
        pooled = pool(of.values, of.se, board[of.sessions], rig[of.sessions])
        if pooled is not None:
            population[name] = pooled
            found += outliers(name, pooled, of.values, [boards[i] for i in of.sessions])
    rigs = len({b.rig for b in boards} - {None})
    known = {axis: sorted(of) for axis, of in names.items() if of}
    said = [
        Evidence(axis, known[axis], score, information, board, rig, rigs)
        for axis, (score, information) in _evidence(results, fitted, weights, spreads, known).items()
    ]
    parameters = {name: pooled for name, pooled in population.items() if name not in NOISE}
    noise = {name: pooled for name, pooled in population.items() if name in NOISE}
    return Fleet(
        model, boards, failed, estimates, parameters, noise, sorted(found, key=Outlier.order), missing.find(said),
        _trends(boards, estimates, population, rig), _attribution(rigs, len(boards)), spreads, drifts, seconds,
    )  # fmt: skip


NOISE = {f"sample_noise.{axis}.sd_dps" for axis in AXES}
"""The noise of one sample, from successive samples. It is no parameter of the population, but boards can be outliers in it."""
WHITE = {f"white_noise.{axis}.sd_dps" for axis in AXES}
"""The white noise of the fit, for the population's model. A colour that a fit finds by chance makes it a fifth larger, so it
shows no odd board."""


def _estimates(summaries: Iterable[Summary]) -> tuple[list[Summary], dict[str, Estimates]]:
    """The boards without their axes, which a large fleet does not hold in memory, and the numbers of all boards by name."""
    boards: list[Summary] = []
    collected: dict[str, tuple[array[int], array[float], array[float]]] = {}
    for i, summary in enumerate(summaries):
        boards.append(replace(summary, axes={}))
        for axis, one in summary.axes.items():
            white, sample = f"white_noise.{axis}.sd_dps", f"sample_noise.{axis}.sd_dps"
            levels = {white: one.noise["white_sd_dps"], sample: one.noise.get("sample_sd_dps", np.nan)}
            errors_of_levels = {white: 0.0, sample: one.noise.get("sample_sd_se_dps", np.nan)}
            for name, value in (one.values | levels).items():
                se = (one.se | errors_of_levels).get(name)
                if se is not None and np.isfinite(se) and np.isfinite(value):
                    of, values, errors = collected.setdefault(name, (array("q"), array("d"), array("d")))
                    of.append(i)
                    values.append(value)
                    errors.append(se)
    found = {name: Estimates(np.array(of, dtype=np.intp), np.array(values), np.array(errors))
             for name, (of, values, errors) in sorted(collected.items())}  # fmt: skip
    return boards, found


def _evidence(
    results: Path, fitted: Sequence[Done], weights: dict[str, Array], spreads: dict[Kind, Array], names: dict[str, list[str]]
) -> dict[str, tuple[Array, Array]]:  # fmt: skip
    """Score [n, k] and information [n, k, k] of the candidates of each axis; zero for a session without the axis."""
    said = {axis: (np.zeros((len(fitted), len(of))), np.zeros((len(fitted), len(of), len(of)))) for axis, of in names.items()}
    for i, summary in enumerate(_summaries(results, fitted)):
        for axis, one in summary.axes.items():
            if axis in names:
                said[axis][0][i], said[axis][1][i] = evidence(one, weights[axis], spreads, names[axis])
    return said


def _trends(
    boards: Sequence[Summary], estimates: dict[str, Estimates], population: dict[str, Pooled], rig: Any
) -> list[trend.Trend]:  # fmt: skip
    """Trends of each quantity without the offset of its rig, over the boards that are not odd."""
    asked: dict[str, tuple[Array, Sequence[trend.Board]]] = {}
    for name, pooled in population.items():
        of = estimates[name]
        kept = of.sessions[pooled.used]
        values = (of.values - pooled.rig_offset[rig[of.sessions]])[pooled.used]
        asked[name] = values, [trend.Board(boards[i].line or "", boards[i].made_on, boards[i].board) for i in kept]
    return trend.find(asked)


def _attribution(rigs: int, boards: int) -> str:
    if rigs >= 2:
        return f"{rigs} rigs, so differences between rigs are distinguished from differences between boards"
    which = "one rig" if rigs else "no session names its rig"
    return f"{which}: what is common to all {boards} sessions belongs to boards or rig, and the data cannot say to which"
