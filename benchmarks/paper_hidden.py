"""Hidden effects: the answers before and after the effect is added, and how often the misfit reveals it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.calibration import limit
from gyrocal.calibration.estimator import Calibration, Column, calibration_of
from gyrocal.calibration.header import render
from gyrocal.calibration.network import FaceNetwork, Prior
from gyrocal.calibration.scenarios import Simulation, answers
from gyrocal.core.estimator import CoreEstimator
from gyrocal.device.monitor import misfit_limit
from gyrocal.diagnosis.answer.add import add
from gyrocal.effects import base
from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.simulation.simulate import RATE_HZ, TABLE_RATE_DPS, WHITE_SD_DPS, paper_windows

from .paper_campaign import DAYS, FIRST_SEED, MODEL, SECONDS, shipped

LEARN_S = 30.0
HIDDEN_SD = 0.0012
"""Standard deviation of either quadrature of a second-order ripple, as a fraction of the rate; a typical size."""
FIVE_SE = 25.0
"""The chi-square of a signal of five standard errors."""
SIGMAS = (5, 6, 7, 8)


def session(up: Array, down: Array, rng: np.random.Generator) -> Session:
    """A session of three days from ``up`` and ``down`` [n, samples], z's measured minus true rate in dps; x and y rest."""
    days = DAYS[np.linspace(0, len(DAYS) - 1, len(up)).astype(int)]
    t_s = np.round(np.arange(up.shape[1]) / RATE_HZ, 6)
    runs = []
    for row in range(len(up)):
        for face, residual, sign in (("up", up[row], 1.0), ("down", down[row], -1.0)):
            columns = {"t_s": t_s, **{f"g{a}_dps": rng.normal(0.0, WHITE_SD_DPS, t_s.size) for a in AXES}}
            columns["gz_dps"] = residual + sign * TABLE_RATE_DPS
            runs.append(
                Run(
                    len(runs), f"{row:03d}_{face}.csv", f"s{row:03d}", face, "z", TABLE_RATE_DPS, None,  # type: ignore[arg-type]
                    int(days[row]), 3.0, RATE_HZ, frame=pl.DataFrame(columns),
                )
            )  # fmt: skip
    return Session(RATE_HZ, tuple(runs), "z")


def learned(campaign: Session) -> CoreEstimator:
    """The model that `gyrocal add table_ripple`, `gyrocal add spin_up` and `gyrocal export` make, loaded into the C core."""
    model = None
    for effect in ("table_ripple", "spin_up"):
        *_, model = add(campaign, model, effect)
    with tempfile.TemporaryDirectory() as folder:
        header = Path(folder, "calibration.h")
        header.write_text(render(model))
        return CoreEstimator(header)


def judge_hidden(scenarios: int, tests: int) -> dict[str, Any]:
    """Judge the methods on a table that also ripples twice a turn, with ``tests`` pairs of runs.

    "model before" was learned without that ripple, "model after" from a campaign of so many ``scenarios`` with it.
    """
    second = tuple(Column(base.effect("table_ripple"), {"amplitude_2": 0.0}, i, 0.0, HIDDEN_SD) for i in range(2))

    def truth(grid: int) -> Calibration:
        known = limit.table2(grid)
        return replace(known, run_columns=known.run_columns[:2] + second + known.run_columns[2:])

    rng = np.random.default_rng(FIRST_SEED)
    up, down, *_ = Simulation(truth(64), limit.PROTOCOL, LEARN_S, by_sample=True).draw(scenarios, rng)
    cores = {"model before": shipped(), "model after": learned(session(up, down, rng))}

    up, down, scale, bias = Simulation(truth(64), limit.PROTOCOL, SECONDS[-1], by_sample=True).draw(tests, rng)
    by_model = {method: core.answers(up, down, SECONDS, limit.PROTOCOL) for method, core in cores.items()}
    values, net, rows = np.column_stack([scale, bias]), FaceNetwork.shipped(), []
    prior = Prior(limit.table2().scale, limit.table2().bias_dps)
    for k, seconds in enumerate(SECONDS):
        n = net.samples(k)
        y = net.estimate(up[:, :n], down[:, :n], k, TABLE_RATE_DPS, -TABLE_RATE_DPS, prior)
        means = up[:, :n].mean(1), down[:, :n].mean(1)
        found = {
            "baseline": (np.column_stack([(means[0] - means[1]) / (2 * TABLE_RATE_DPS), (means[0] + means[1]) / 2]), None),
            "gyrocal": (y[:, :2], None),
        }
        for method, a in by_model.items():
            found[method] = (a[k][:, [0, 2]], float(np.mean(a[k][:, 4] > misfit_limit(seconds))))
        p = answers(truth(12), up, down, seconds, limit.PROTOCOL, by_sample=True)
        found["limit"] = (np.column_stack([p.scale, p.bias_dps]), None)
        best = np.abs(found["limit"][0] - values).mean(0)
        for method, (answer, flags) in found.items():
            mae = np.abs(answer - values).mean(0)
            rows.append({
                "seconds": seconds, "method": method, "scale_mae": float(mae[0]), "bias_mae_dps": float(mae[1]),
                "scale_over_limit": float(mae[0] / best[0]), "bias_over_limit": float(mae[1] / best[1]), "flagged": flags,
            })  # fmt: skip
    return {"hidden": f"ripple of order 2, quadratures of {HIDDEN_SD:g}", "scenarios": tests, "answers": rows}


def _hidden_signals(tests: int, rng: np.random.Generator) -> dict[str, Callable[[], Array]]:
    """For each kind of signal, a function that draws it in dps for a run of each test, [tests, samples of 6 s]."""
    t_s = limit.PROTOCOL.runs(6.0)[0].t_s
    turn = np.deg2rad(TABLE_RATE_DPS * t_s)

    def normal(sd: float) -> Array:
        return rng.normal(0.0, sd, (tests, 1))

    def phase() -> Array:
        return rng.uniform(0, 2 * np.pi, (tests, 1))

    return {
        "none": lambda: normal(0.0) * t_s,
        "ripple of order 2, 0.1 %": lambda: TABLE_RATE_DPS * normal(0.001) * np.cos(2 * turn + phase()),
        "ripple of order 3, 0.1 %": lambda: TABLE_RATE_DPS * normal(0.001) * np.cos(3 * turn + phase()),
        "tone of 1 Hz, 30 mdps": lambda: normal(0.03) * np.sin(2 * np.pi * t_s + phase()),
        "jump of 0.1 dps": lambda: normal(0.1) * (t_s > rng.uniform(0, 6, (tests, 1))),
        "jump of 30 mdps": lambda: normal(0.03) * (t_s > rng.uniform(0, 6, (tests, 1))),
        "drift of 20 mdps/s": lambda: normal(0.02) * t_s,
        "offset of 50 mdps": lambda: normal(0.05) * np.ones_like(t_s),
    }


def judge_misfit(tests: int) -> list[dict[str, Any]]:
    """Judge how often the misfit exceeds its limit for signals that the model does not contain, in ``tests`` pairs of runs.

    A signal's size is the chi-square of the part that the model cannot absorb, as a test that knows its shape would measure
    it. The rates are given after 2, 4 and 6 s, over all signals and over those of more than five standard errors, and after
    6 s for signals of exactly ``SIGMAS`` standard errors.
    """
    rng = np.random.default_rng(FIRST_SEED + 1)
    device = calibration_of(Model.open(MODEL / "model.toml"), "z")
    quiet = replace(
        device, run_columns=tuple(replace(c, mean=0.0) for c in device.run_columns),
        bias_dps=(0.0, device.bias_dps[1]), scale=(0.0, device.scale[1]),
    )  # fmt: skip
    data = paper_windows(tests, FIRST_SEED + 100)
    def outside(up: Array, down: Array, seconds: float) -> Array:
        """The chi-square of the part of a signal that the model cannot absorb, one number for each pair of runs."""
        return answers(quiet, up, down, seconds, limit.PROTOCOL).chi2

    def flags(up: Array, down: Array) -> list[Array]:
        found = shipped().answers(data["up"] + up, data["down"] + down, SECONDS, limit.PROTOCOL)
        return [of[:, 4] > misfit_limit(seconds) for of, seconds in zip(found, SECONDS, strict=True)]

    rows: list[dict[str, Any]] = []
    for kind, draw in _hidden_signals(tests, rng).items():
        up, down = draw(), draw()
        for seconds, flagged in zip(SECONDS, flags(up, down), strict=True):
            beyond = outside(up, down, seconds) > FIVE_SE
            rows.append({
                "hidden": kind, "seconds": seconds, "beyond_five_se": float(beyond.mean()), "flagged": float(flagged.mean()),
                "flagged_of_those": float(flagged[beyond].mean()) if beyond.sum() >= 10 else None,
            })  # fmt: skip
        if not beyond.any():
            continue
        at = {}
        for sigma in SIGMAS:
            for _ in range(3):  # the transient that fits best changes with the size
                size = (sigma / np.sqrt(outside(up, down, SECONDS[-1])))[:, None]
                up, down = size * up, size * down
            at[sigma] = float(flags(up, down)[-1].mean())
        rows[-1]["flagged_at_sigma"] = at
    return rows
