"""Scale and bias from the first seconds of a session's runs: by baseline, network and model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gyrocal.calibration.budget import BudgetRow, beside, by_evidence, by_fit, by_network, by_posterior, temperature_spread_c
from gyrocal.calibration.estimator import BLOCK_US, Answer, calibration_of, estimate
from gyrocal.calibration.flags import ordered
from gyrocal.calibration.network_answer import consecutive, network, network_prior, network_stage
from gyrocal.calibration.pairs import is_steady, network_suits, pairs
from gyrocal.calibration.taken import Taken
from gyrocal.calibration.trust import Evidence, answer_flags, reading_flags, warning_flags, with_table
from gyrocal.calibration.turns import with_scatter_of_runs, with_scatter_of_turns
from gyrocal.calibration.uncertainty import DRIFT_TAU_S, drift_sd_dps
from gyrocal.effects.base import Role
from gyrocal.effects.earth_rate import EarthRate, in_known_rate
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError, did_you_mean
from gyrocal.extras import lacking, want
from gyrocal.noise.whitening import Noise
from gyrocal.plausibility import check
from gyrocal.plausibility.runs import told_by_others
from gyrocal.recording.register import registered
from gyrocal.recording.session import AXES, Run, Session
from gyrocal.warning import Warning

if TYPE_CHECKING:
    from gyrocal.calibration.network import Prior

METHODS = ("baseline", "cnn", "model")
DEFAULT_SECONDS = (2.0, 4.0, 6.0)
POOLED = "all"
"""The scenario of an estimate from all power cycles together."""
NAMED = 5
"""Scenarios without an estimate that are named; if there are more, only their number is reported."""


@dataclass(frozen=True)
class Estimate:
    """One answer. Values that the method does not give are None; a network without an answer gives none at all."""

    scenario: str
    method: str
    seconds: float
    axis: str
    scale: float | None
    scale_se: float | None
    bias_dps: float | None
    bias_se_dps: float | None
    misfit: float | None = None
    flags: tuple[str, ...] = ()
    """The flags that were raised against it (:data:`gyrocal.calibration.flags.FLAGS`)."""
    budget: tuple[BudgetRow, ...] = field(default=(), repr=False, compare=False)
    """The sources of its errors; empty if its standard errors are not known."""
    taken: Taken = field(default=Taken(), compare=False)
    """What it was calculated from; nothing is known of it for an answer by gravity."""

    def __repr__(self) -> str:
        known = "no answer" if self.scale is None else f"scale {self.scale:.6g}, bias {self.bias_dps:.5g} dps"
        return f"<Estimate: {self.scenario}, {self.axis}, {self.method}, {self.seconds:g} s: {known}>"

    @property
    def trusted(self) -> bool:
        """True if no flag was raised against it."""
        return not self.flags

    def to_json(self) -> dict[str, Any]:
        fields = asdict(replace(self, budget=()))
        del fields["budget"], fields["taken"]
        return {**fields, "flags": list(self.flags), "trusted": self.trusted}

    def budget_json(self) -> list[dict[str, Any]]:
        """The rows of the budget, each with the estimate to which it belongs."""
        which = {"scenario": self.scenario, "method": self.method, "seconds": self.seconds, "axis": self.axis}
        return [{**which, **row.to_json()} for row in self.budget]


@dataclass(frozen=True)
class _Task:
    """The data that all estimates of a session share: the session, the model of the model method, and the warnings."""

    session: Session
    model: Model | str | Path | None
    warnings: Sequence[Warning]

    @cached_property
    def temperature_spread_c(self) -> float | None:
        """The spread of the session's temperatures, degC; None without a thermometer."""
        return temperature_spread_c(self.session)

    @cached_property
    def noise_of_slopes(self) -> dict[str, float]:
        """Noise of one sample as means over the estimator's blocks show it, dps, by axis with rates from measured angles.

        The slope of a smooth curve through noisy angles varies little from sample to sample and much from block to block. The
        fit of the model knows it, by which ``compare`` judges the same session.
        """
        from gyrocal.inference.fit import fit
        from gyrocal.inference.noise_shape import noise_of_means, of_slopes

        if not any(r.measured_rates is not None and r.measured_rates.derived for r in self.session.runs):
            return {}
        fitted = fit(self.session, Model.open(self.model)).axes
        return {axis: noise_of_means(f, 1e-6 * BLOCK_US) for axis, f in fitted.items() if of_slopes(f)}


def calibrate(
    session: Session, seconds: Sequence[float | None] | None = None, methods: Iterable[str] | None = None,
    model: Model | str | Path | None = None, warnings: Sequence[Warning] | None = None,
) -> list[Estimate]:  # fmt: skip
    """Scale and bias of every scenario, from the first ``seconds`` of each run; None among them means whole runs.

    Without ``seconds``, sessions with up/down pairs are calibrated from 2, 4 and 6 s, others from whole runs. Baseline and
    network need a pair, which is two runs of opposite true rate about one axis. The model method uses any runs that determine
    both terms, for example runs at rest and known turns. If no power cycle does so by itself, it uses all of them together
    (scenario ``all``). Without ``methods``, those that the session allows are used: ``model`` if a model is given or there is
    no pair, ``cnn`` if the network suits a pair and onnxruntime is installed. Without ``warnings``, they are those of
    :func:`gyrocal.plausibility.check`. With a latitude, the Earth's rate is part of the true rate. An estimate that a blocking
    warning concerns is not trusted.
    Raises InputError if there is no answer at all.
    """
    session = _with_frame(session, model)
    paired = any(pairs(runs) for _, runs in session.by_scenario())
    if methods is None:
        suits = not lacking("net") and network_suits(session)
        methods = ["baseline"] * paired + ["cnn"] * suits + ["model"] * (model is not None or not paired)
    methods = list(methods)
    for method in methods:
        if method not in METHODS:
            raise InputError(f"--method {method}: there are {', '.join(METHODS)}{did_you_mean(method, METHODS)}")
    if "cnn" in methods:
        want("--method cnn", "net")
    if not paired and set(methods) - {"model"}:
        where = session.path or "the session"
        raise InputError(
            f"{where}: no scenario has two runs of opposite true rate (face up and face down) that baseline and cnn need; "
            "record the other face, or use --method model"
        )
    spans: Sequence[float | None] = seconds if seconds is not None else (DEFAULT_SECONDS if paired else (None,))
    task = _Task(session, model, check(session, model) if warnings is None else warnings)
    found: list[Estimate] = []
    for span in spans:
        if span is not None and not 0 < span < np.inf:
            raise InputError(f"--seconds {span}: must be positive and finite")
        for scenario, runs in session.by_scenario():
            true = [in_known_rate(run) for run in runs]
            for method in methods:
                found += _estimates(task, scenario, true, span, method)
        if "model" in methods and not any(e.method == "model" and e.seconds == (span or e.seconds) for e in found):
            found += _pooled(task, span)
    if not found:
        raise InputError(f"{session.path or 'the session'}: {_why_nothing(task, spans, methods)}")
    return found


def _with_frame(session: Session, model: Model | str | Path | None) -> Session:
    """The session with the frame and clock of its reference as the model's fit has them, which ``compare`` tells too.

    A turn of the frame by one degree gives an axis about which the sensor hardly turns another scale.
    """
    session = registered(session)
    if session.registration_fit is None:
        return session
    from gyrocal.inference.registering import refined

    return refined(session, Model.open(model))


def unanswered(session: Session, found: Sequence[Estimate], seconds: Sequence[float | None] | None = None) -> list[Warning]:
    """``no_answer``: the scenarios without an estimate, if others have one, and those that lack one from some ``seconds``."""
    of_seconds = (w for span in seconds or () if span is not None for w in _unanswered_span(session, found, span))
    return [*_unanswered_scenarios(session, found), *of_seconds]


def _unanswered_span(session: Session, found: Sequence[Estimate], span: float) -> list[Warning]:
    answered = {e.scenario for e in found if e.seconds == span}
    left = [name for name in dict.fromkeys(e.scenario for e in found) if name not in answered]
    if not left:
        return []
    runs = [r for r in session.runs if r.scenario in left] or list(session.runs)
    names = ", ".join(left[:NAMED]) + (f" and {len(left) - NAMED} more" if len(left) > NAMED else "")
    of = f" for scenario {names}" if answered else ""
    longest_s = max(r.duration_s for r in runs)
    text = f"no estimate from the first {span:g} s{of}: the longest run lasts {longest_s:.3g} s. Ask for less with --seconds"
    return [Warning("no_answer", None, None, text)] if longest_s < span else []


def _unanswered_scenarios(session: Session, found: Sequence[Estimate]) -> list[Warning]:
    answered = {e.scenario for e in found}
    left = [(scenario, runs) for scenario, runs in session.by_scenario() if scenario not in answered]
    if not left or answered == {POOLED}:
        return []
    names = ", ".join(f"{scenario} ({', '.join(map(_described, runs))})" for scenario, runs in left[:NAMED])
    more = f" and {len(left) - NAMED} more" if len(left) > NAMED else ""
    text = (
        f"no estimate for scenario {names}{more}: it lacks two runs that turn steadily in opposite true directions about one "
        "axis and last the seconds asked for. Correct face or table_rate_dps, or record the other face"
    )
    return [Warning("no_answer", None, None, text)]


def _described(run: Run) -> str:
    return f"{run.file}: {float(np.mean(run.rate_dps)):+.4g} dps for {run.duration_s:.3g} s"


def _why_nothing(task: _Task, spans: Sequence[float | None], methods: Sequence[str]) -> str:
    """Why scale and bias cannot be determined, and what to do."""
    session = task.session
    for warning in task.warnings:
        if warning.code == "sample_rate":  # wrong times, for example in milliseconds, can leave no samples
            return warning.text
    longest_s = max(run.duration_s for run in session.runs)
    asked = [span for span in spans if span is not None]
    if asked and min(asked) > longest_s:
        return (
            f"the runs are too short: the longest lasts {longest_s:.4g} s, asked for are the first {min(asked):g}; "
            "record longer runs, ask for less, or for --seconds all"
        )
    if set(methods) == {"cnn"}:
        if any(consecutive(run) < len(run) for run in session.runs):
            return "samples are missing in the first seconds, and the network takes windows without a gap; use another --method"
        return "the runs are too short for the network, which takes windows of 2 s; give --seconds 2 or more, or a --method"
    if not any(run.rate_is_mean or np.any(run.rate_dps) for run in session.runs):
        return (
            "at rest the scale cannot be determined; record both faces, or a known turn too. The bias can: `gyrocal explain "
            "SESSION --model M.toml` writes it into a model"
        )
    return "scale and bias cannot be determined; record both faces, or rest and a known turn"


class Found(NamedTuple):
    """An answer, if there is one, about an axis from some runs; the flags that the method raises, and its errors' sources."""

    axis: str
    used: Sequence[Run]
    answer: Answer | None
    flags: frozenset[str] = frozenset()
    sources: Sequence[BudgetRow] = ()
    modelled: Sequence[str] = ()
    """Ids of the effects that the method's model corrects."""


def _estimates(task: _Task, scenario: str, runs: Sequence[Run], span: float | None, method: str) -> list[Estimate]:
    if method == "model":
        cut = [r if r.rate_is_mean or span is None else r.first(span) for r in runs]
        both = [(first, run) for first, run in zip(cut, runs, strict=True) if first is not None]
        found = _by_model(both, span, Model.open(task.model), task.noise_of_slopes)
    else:
        found = []
        for up, down in pairs(runs):
            first = (up, down) if span is None else (up.first(span), down.first(span))
            if first[0] is None or first[1] is None:
                continue
            if method == "baseline":
                found.append(_by_baseline(first[0], first[1], (up, down), span))
            else:
                found += _by_network(up, down, span or min(up.duration_s, down.duration_s), network_prior(task.model, up.axis))
    return [_estimate(task, scenario, method, span, one) for one in found]


def _estimate(task: _Task, scenario: str, method: str, span: float | None, found: Found) -> Estimate:
    """An answer from the first ``span`` s, or from whole runs, with its flags and its budget."""
    axis, used, answer, own, sources, modelled = found
    seconds = float(span or max(r.duration_s for r in used))
    taken = Taken.of(used, len(task.session.runs), span)
    flags = set(own) | reading_flags(used, axis, task.session.full_scale_dps) | warning_flags(task.warnings, axis, used)
    if answer is None:
        return Estimate(scenario, method, seconds, axis, None, None, None, None, None, ordered(flags), taken=taken)
    flags |= answer_flags(answer, sum(np.unique(r.t_us // BLOCK_US).size for r in used))
    scale_se, bias_se_dps, misfit = (
        None if x is None or np.isnan(x) else x for x in (answer.scale_se, answer.bias_se_dps, answer.misfit)
    )
    bounds = beside(used, axis, task.temperature_spread_c, modelled, weighed=scenario == POOLED) if sources else ()
    rows = (*sources, *bounds)
    return Estimate(
        scenario, method, seconds, axis, answer.scale, scale_se, answer.bias_dps, bias_se_dps, misfit, ordered(flags), rows,
        taken,
    )  # fmt: skip


def _pooled(task: _Task, span: float | None) -> list[Estimate]:
    """One answer from all power cycles together (scenario ``all``), if none determines both terms by itself."""
    from gyrocal.inference.fit import fit

    session = task.session
    cut = [r if r.rate_is_mean or span is None else r.first(span) for r in session.runs]
    runs = [r for r in cut if r is not None]
    axes = [axis for axis in AXES if _informed(runs, axis)]
    if not axes:
        return []
    out = []
    for axis, fitted in fit(session.with_runs(runs), Model.open(task.model), axes=axes).axes.items():
        scale, bias = (next(t for t in fitted.terms if t.effect.role is role) for role in (Role.SCALE, Role.BIAS))
        if scale.values and "bias_dps" in bias.values:
            scale_se = with_table(scale.se["scale"], runs)
            answer = Answer(scale.values["scale"], scale_se, bias.values["bias_dps"], bias.se["bias_dps"], None)
            modelled = [t.effect.id for t in fitted.terms] + [EarthRate.id] * (session.latitude_deg is not None)  # by the fit
            one = Found(axis, runs, answer, sources=by_fit(answer, runs), modelled=modelled)
            out.append(_estimate(task, POOLED, "model", span, one))
    return out


def _informed(runs: Sequence[Run], axis: str) -> bool:
    """True if these runs have two true rates about an axis, one of them not zero, which determine its scale and bias.

    Beside a reference with three axes, what an axis reads of the others' rates must not be as large as its own rate.
    """
    views = [r.about(axis) for r in runs]
    ends = [(float(r.rate_dps.min()), float(r.rate_dps.max())) if r.axis == axis else (0.0, 0.0) for r in views]
    turns = bool(ends) and max(high for _, high in ends) - min(low for low, _ in ends) > 1e-6
    return turns and not all(r.three_axes and told_by_others(r, axis) for r in views)


def white_sd_dps(runs: Sequence[Run], axis: str) -> float:
    """White noise of one sample, dps, from successive differences, pooled over runs."""
    i = AXES.index(axis)
    total = sum(float(np.sum(np.diff(r.gyro_dps[:, i]) ** 2)) for r in runs)
    # differences of a motion by hand are no noise, so runs with a known true rate are preferred
    steady = [r for r in runs if not r.rate_is_mean]
    if steady:
        total = sum(
            float(np.sum(np.diff(r.gyro_dps[:, i] - (r.rate_dps if r.axis == axis else 0.0)) ** 2)) for r in steady
        )
        runs = steady
    return max(float(np.sqrt(total / (2 * sum(len(r) - 1 for r in runs)))), 1e-9)


def _by_model(
    runs: Sequence[tuple[Run, Run]], span: float | None, model: Model, of_slopes: Mapping[str, float]
) -> list[Found]:  # fmt: skip
    """The model's answers from the first ``span`` s of runs, given as (these seconds, whole run)."""
    found: list[Found] = []
    for axis in AXES:
        # a run turned by hand about another axis shows misalignment more than this axis
        used = [(first.about(axis), run.about(axis)) for first, run in runs if run.axis == axis or not run.rate_is_mean]
        mine, whole = [first for first, _ in used], [run for _, run in used]
        if not model.on(axis) or not _informed(mine, axis):
            continue
        calibration = calibration_of(model, axis, of_slopes.get(axis) or white_sd_dps(mine, axis))
        if axis in of_slopes:  # that of samples may exceed the noise at low frequencies, which a fitted model knows
            white_dps = max(of_slopes[axis], calibration.noise.white_sd_dps)
            calibration = replace(calibration, noise=replace(calibration.noise, white_sd_dps=white_dps))
        fitted = model.noise_on(axis).white_sd_dps is not None
        if not fitted:
            drift_dps = drift_sd_dps(max(run.duration_s for run in mine))
            calibration = replace(calibration, noise=Noise(calibration.noise.white_sd_dps, drift_dps, DRIFT_TAU_S))
        mine = with_scatter_of_turns(calibration, mine)
        answer = estimate(calibration, mine)
        if answer is None:
            continue
        steady = all(r.axis == axis and (is_steady(r) or not np.any(r.rate_dps)) for r in mine)
        evidence = Evidence.of(mine, whole, span) if steady and not fitted else None
        if evidence is not None:
            answer = evidence.with_errors(answer)
            sources = by_evidence(evidence, answer)
        else:
            answer = answer if fitted else with_scatter_of_runs(answer, calibration, mine)
            answer = replace(answer, scale_se=with_table(answer.scale_se, mine))
            sources = by_posterior(calibration, mine, answer, fitted=fitted)
        modelled = [t.effect.id for t in model.on(axis) if t.effect.id != EarthRate.id]  # the estimator has no column for it
        found.append(Found(axis, mine, answer, sources=sources, modelled=modelled))
    return found


def _by_baseline(up: Run, down: Run, whole: Sequence[Run], span: float | None) -> Found:
    answer, evidence = _baseline(up, down, whole, span)
    return Found(up.axis, [up, down], answer, sources=[] if evidence is None else by_evidence(evidence, answer))


def baseline(up: Run, down: Run) -> Answer:
    """The paper's eq. (9)-(10) from two runs, with the standard errors that noise, drift and typical effects leave."""
    return _baseline(up, down)[0]


def _baseline(
    up: Run, down: Run, whole: Sequence[Run] = (), span: float | None = None
) -> tuple[Answer, Evidence | None]:  # fmt: skip
    w_up, w_down = float(np.mean(up.rate_dps)), float(np.mean(down.rate_dps))
    mean_up, mean_down = (float(np.mean(r.gyro_dps[:, r.axis_index])) for r in (up, down))
    scale = (mean_up - mean_down) / (w_up - w_down) - 1
    answer = Answer(scale, np.nan, mean_up - (1 + scale) * w_up, np.nan, np.nan)
    evidence = Evidence.of([up, down], whole, span)
    return (answer if evidence is None else evidence.with_errors(answer)), evidence


def _by_network(up: Run, down: Run, seconds: float, prior: Prior) -> list[Found]:
    """The network's answer with its flags; no answer if the runs are too short or samples are missing."""
    from gyrocal.calibration.network import STAGES_S

    stage = network_stage(up, down, seconds)
    if stage is None:
        return []
    used = [run.first(STAGES_S[stage]) or run for run in (up, down)]
    answer, evidence = network(up, down, stage, prior), Evidence.of(used, (up, down), STAGES_S[stage])
    if answer is None or evidence is None:
        return [Found(up.axis, used, None, frozenset({"net_range"}))]
    flags = frozenset({"disagrees"} if evidence.disagrees(answer) else ())
    known = prior.is_known
    answer = replace(answer, misfit=evidence.misfit_of(answer)) if known else evidence.with_errors_of(answer)
    answer = replace(answer, scale_se=with_table(answer.scale_se, used))
    sources = by_network(answer, used) if known else by_evidence(evidence, answer, of_network=True)
    return [Found(up.axis, used, answer, flags, sources)]
