"""Scale and bias from the first seconds of a session's runs: by baseline, network and model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.calibration.estimator import Answer, calibration_of, estimate
from gyrocal.effects.base import Role
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import AXES, GAP_PERIODS, Array, Run, Session

METHODS = ("baseline", "cnn", "model")
DEFAULT_SECONDS = (2.0, 4.0, 6.0)
STEADY = 0.03
"""Of the rate: what a rate may vary and still be one rate; the device has the same."""


@dataclass(frozen=True)
class Estimate:
    """One answer; an error that the method does not give is None."""

    scenario: str
    method: str
    seconds: float
    axis: str
    scale: float
    scale_se: float | None
    bias_dps: float
    bias_se_dps: float | None

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


def calibrate(
    session: Session, seconds: Sequence[float] | None = None, methods: Iterable[str] | None = None,
    model: Model | str | Path | None = None,
) -> list[Estimate]:  # fmt: skip
    """Scale and bias of every scenario, from the first ``seconds`` of each run.

    ``seconds`` None: 2, 4 and 6 where there are up/down pairs, else whole runs. Baseline and network need a pair, two runs of
    opposite true rate about one axis; the model method takes whatever fixes both terms (runs at rest and known turns, say), and
    where no power cycle does so by itself, all of them together (scenario ``all``).
    ``methods`` None: those that the session allows, ``model`` if a model is given or there is no pair.
    """
    found_pairs = [pair for _, runs in session.by_scenario() for pair in pairs(runs)]
    paired = bool(found_pairs)
    if methods is None:
        suits = paired and all(_suits_network(run) for pair in found_pairs for run in pair)
        methods = ["baseline"] * paired + ["cnn"] * suits + ["model"] * (model is not None or not paired)
    methods = list(methods)
    for method in methods:
        if method not in METHODS:
            raise InputError(f"--method {method}: there are {', '.join(METHODS)}")
    if not paired and set(methods) - {"model"}:
        where = session.path or "the session"
        raise InputError(
            f"{where}: no scenario has two runs of opposite true rate (face up and face down) that baseline and cnn need; "
            "record the other face, or use --method model"
        )
    spans: Sequence[float | None] = seconds if seconds is not None else (DEFAULT_SECONDS if paired else (None,))
    found: list[Estimate] = []
    for span in spans:
        if span is not None and not 0 < span < np.inf:
            raise InputError(f"--seconds {span}: must be positive and finite")
        for scenario, runs in session.by_scenario():
            for method in methods:
                found += _estimates(session, scenario, runs, span, method, model)
        if "model" in methods and not any(e.method == "model" and e.seconds == (span or e.seconds) for e in found):
            found += _pooled(session, span, model)
    if not found:
        raise InputError(f"{session.path or 'the session'}: {_why_nothing(session, spans, methods)}")
    return found


def _why_nothing(session: Session, spans: Sequence[float | None], methods: Sequence[str]) -> str:
    """What keeps scale and bias from being told, and what to do."""
    longest_s = max(run.duration_s for run in session.runs)
    asked = [span for span in spans if span is not None]
    if asked and min(asked) > longest_s:
        return (
            f"the runs are too short: the longest lasts {longest_s:.3g} s, asked for are the first {min(asked):g}; "
            "record longer runs, or ask for less with --seconds"
        )
    if set(methods) == {"cnn"}:
        if any(consecutive(run) < len(run) for run in session.runs):
            return "samples are missing in the first seconds, and the network takes windows without a gap; use another --method"
        return "the runs are too short for the network, which takes windows of 2 s; give --seconds 2 or more, or a --method"
    return "scale and bias cannot be told; record both faces, or rest and a known turn"


def pairs(runs: Sequence[Run]) -> list[tuple[Run, Run]]:
    """For each axis the first two runs that turn steadily in opposite true directions: (positive, negative true rate)."""
    out = []
    for axis in AXES:
        steady = [r for r in runs if r.axis == axis and _steady(r)]
        positive = [r for r in steady if r.rate_dps[0] > 0]
        negative = [r for r in steady if r.rate_dps[0] < 0]
        # opposite rates of one size first, else any two
        match = sorted(
            ((p, n) for p in positive for n in negative),
            key=lambda pair: abs(abs(pair[0].rate_dps[0]) - abs(pair[1].rate_dps[0])) > STEADY * abs(pair[0].rate_dps[0]),
        )
        if match:
            out.append(match[0])
    return out


def _steady(run: Run) -> bool:
    """Does the run turn at one known rate all the time?"""
    rate_dps = run.rate_dps
    return not run.rate_is_mean and rate_dps[0] != 0 and bool(np.ptp(rate_dps) <= STEADY * abs(rate_dps[0]))


def _estimates(
    session: Session, scenario: str, runs: Sequence[Run], span: float | None, method: str, model: Model | str | Path | None
) -> list[Estimate]:  # fmt: skip
    out: list[Estimate] = []

    def keep(axis: str, answer: Answer | None, used: Sequence[Run]) -> None:
        if answer is None:
            return
        seconds = span if span is not None else max(r.duration_s for r in used)
        out.append(
            Estimate(
                scenario, method, float(seconds), axis, answer.scale, answer.scale_se, answer.bias_dps, answer.bias_se_dps
            )
        )  # fmt: skip

    if method == "model":
        cut = [r if r.rate_is_mean else (r if span is None else r.first(span)) for r in runs]
        parts = [r for r in cut if r is not None]
        opened = Model.open(model)
        for axis in AXES:
            # turned by hand about another axis, a run says more of misalignment than of this axis
            mine = [r for r in parts if r.axis == axis or not r.rate_is_mean]
            if opened.on(axis) and _informed(mine, axis):
                white = white_sd_dps(mine, axis)
                keep(axis, estimate(calibration_of(opened, axis, white), mine), mine)
        return out
    for up, down in pairs(runs):
        first = [up, down] if span is None else [up.first(span), down.first(span)]
        halves = [r for r in first if r is not None]
        if len(halves) < 2:
            continue
        if method == "baseline":
            keep(up.axis, baseline(halves[0], halves[1]), halves)
        else:
            keep(up.axis, network(up, down, span or min(up.duration_s, down.duration_s)), halves)
    return out


def _pooled(session: Session, span: float | None, model: Model | str | Path | None) -> list[Estimate]:
    """One answer from all power cycles together, where none fixes both terms by itself: scenario ``all``."""
    from gyrocal.inference.fit import fit

    cut = [r if r.rate_is_mean or span is None else r.first(span) for r in session.runs]
    runs = [r for r in cut if r is not None]
    axes = [axis for axis in AXES if _informed(runs, axis)]
    if not axes:
        return []
    seconds = span if span is not None else max(r.duration_s for r in runs)
    out = []
    for axis, fitted in fit(session.with_runs(runs), Model.open(model), axes=axes).axes.items():
        scale, bias = (next(t for t in fitted.terms if t.effect.role is role) for role in (Role.SCALE, Role.BIAS))
        if scale.values and "bias_dps" in bias.values:
            out.append(
                Estimate(
                    "all",
                    "model",
                    float(seconds),
                    axis,
                    scale.values["scale"],
                    scale.se["scale"],
                    bias.values["bias_dps"],
                    bias.se["bias_dps"],
                )
            )
    return out


def _informed(runs: Sequence[Run], axis: str) -> bool:
    """Do these runs fix both scale and bias of an axis: two true rates about it at least, one of them not zero?"""
    ends = [(float(r.rate_dps.min()), float(r.rate_dps.max())) if r.axis == axis else (0.0, 0.0) for r in runs]
    return bool(ends) and max(high for _, high in ends) - min(low for low, _ in ends) > 1e-6


def white_sd_dps(runs: Sequence[Run], axis: str) -> float:
    """White noise of one sample as successive differences show it, pooled over runs."""
    i = AXES.index(axis)
    total = sum(float(np.sum(np.diff(r.gyro_dps[:, i]) ** 2)) for r in runs)
    # motion by hand is no noise: only runs whose true rate is known at each sample count, if there are any
    steady = [r for r in runs if not r.rate_is_mean]
    if steady:
        total = sum(
            float(np.sum(np.diff(r.gyro_dps[:, i] - (r.rate_dps if r.axis == axis else 0.0)) ** 2)) for r in steady
        )
        runs = steady
    return max(float(np.sqrt(total / (2 * sum(len(r) - 1 for r in runs)))), 1e-9)


def baseline(up: Run, down: Run) -> Answer:
    """The paper's eq. (9)-(10) from two runs; standard errors from the white noise that successive differences show."""
    w_up, w_down = float(np.mean(up.rate_dps)), float(np.mean(down.rate_dps))
    (mean_up, var_up), (mean_down, var_down) = _mean(up), _mean(down)
    scale = (mean_up - mean_down) / (w_up - w_down) - 1
    span = abs(w_up - w_down)
    return Answer(
        scale, float(np.sqrt(var_up + var_down)) / span,
        mean_up - (1 + scale) * w_up, float(np.sqrt(w_down**2 * var_up + w_up**2 * var_down)) / span, None,
    )  # fmt: skip


def _mean(run: Run) -> tuple[float, float]:
    y: Array = run.gyro_dps[:, run.axis_index]
    white = float(np.sum(np.diff(y) ** 2)) / (2 * (y.size - 1))
    return float(np.mean(y)), white / y.size


def network(up: Run, down: Run, seconds: float) -> Answer | None:
    """The shipped network `gyrocal` on as much of the first 2, 4 or 6 s as ``seconds`` holds.

    None where the runs are too short for 2 s, or a sample is missing.
    """
    from gyrocal.calibration.network import STAGES_S, BlockNetwork

    net = BlockNetwork.shipped()
    if not _suits_network(up):
        raise InputError(
            f"{up.file}: the network was trained at {net.rate_hz:g} Hz and {net.table_dps:g} dps, this run has "
            f"{up.sample_rate_hz:g} Hz and {abs(float(up.rate_dps[0])):g} dps; "
            "leave cnn out of --method or train a network for it"
        )
    stage = sum(net.samples(k) <= seconds * net.rate_hz + 1e-6 for k in range(len(STAGES_S))) - 1
    if stage < 0 or min(consecutive(up), consecutive(down)) < net.samples(stage):
        return None
    n, w_dps = net.samples(stage), abs(float(up.rate_dps[0]))
    means = [
        net.block_means(r.gyro_dps[:n, r.axis_index] - r.rate_dps[:n])
        for r in sorted((up, down), key=lambda r: -float(r.rate_dps[0]))  # the network's first face has the positive rate
    ]
    scale, bias_dps, scale_sd, bias_sd_dps = map(float, net.estimate(means[0], means[1], stage, w_dps, -w_dps)[0])
    return Answer(scale, scale_sd, bias_dps, bias_sd_dps, None)


def consecutive(run: Run) -> int:
    """How many samples there are, from the first one on, before one is missing."""
    late = np.flatnonzero(1e-6 * (np.diff(run.t_us) * run.sample_rate_hz) > GAP_PERIODS)
    return int(late[0]) + 1 if late.size else len(run)


def _suits_network(run: Run) -> bool:
    """Is the run at the sample rate and the table rate that the shipped network was trained for?"""
    from gyrocal.calibration.network import RATE_TOLERANCE, BlockNetwork

    net = BlockNetwork.shipped()
    near = abs(abs(float(run.rate_dps[0])) - net.table_dps) <= RATE_TOLERANCE * net.table_dps
    return near and abs(run.sample_rate_hz - net.rate_hz) <= 1e-3 * net.rate_hz
