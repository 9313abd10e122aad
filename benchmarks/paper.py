"""Tables 1 to 3 and Figs. 4 and 5 of the paper on the simulated campaign `table2`, with the rivals and the limit beside.

A campaign is three days of 13, 7 and 28 scenarios. What a method must learn, it learns on other scenarios than those that it
is judged by: `prior` and `shrunk` on the days that are left (leave one day out), or on all but the last two scenarios of the
last day, as in the paper. Networks and model are those that ship, made from scenarios drawn apart: the model by `gyrocal add`
from one simulated campaign (docs/calibration.md); the C core answers by its calibration.h. What that model says of scale and
bias is the network's prior too; a table of its own gives network and limit flat ones. The last two tables plant what nobody
was told of: how far off the answers are before and after the effect is added, and how often the misfit says so.

    gyrocal benchmark paper
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.calibration import limit
from gyrocal.calibration.calibrate import network_prior
from gyrocal.calibration.estimator import Calibration, Column, calibration_of
from gyrocal.calibration.header import render
from gyrocal.calibration.network import FaceNetwork, Network
from gyrocal.calibration.scenarios import Simulation, answers
from gyrocal.core.estimator import CoreEstimator
from gyrocal.device.monitor import misfit_limit
from gyrocal.diagnosis.diagnose import add
from gyrocal.effects import base
from gyrocal.error_model.model import Model
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.simulation.simulate import RATE_HZ, TABLE_RATE_DPS, WHITE_SD_DPS, paper_windows

SEEDS = 42
SAMPLE_SEEDS = 2
FIRST_SEED = 700_000
DAYS = np.repeat([1, 2, 3], [13, 7, 28])
SECONDS = (2.0, 4.0, 6.0)
MOST = round(SECONDS[-1] * RATE_HZ)
"""Samples of the longest answer."""
LABEL_S = 70
LEARN_S = 30.0
METHODS = ("baseline", "prior", "shrunk", "model", "paper", "gyrocal", "limit")
FLAT_METHODS = ("baseline", "gyrocal", "limit")
WITH_SE = ("model", "gyrocal", "limit")
HIDDEN_SD = 0.0012
"""Of both quadratures of a second-order ripple, a fraction: in the middle of what is typical."""
MISFIT_TESTS, SAMPLE_TESTS = 1500, 600
SAMPLE_CAMPAIGN = 24
FIVE_SE = 25.0
SIGMAS = (5, 6, 7, 8)
PAPERS = {"improvement": 72.0, "time": 75.0}
MODEL = Path(str(files("gyrocal"))) / "data" / "table2"
IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"


@dataclass(frozen=True)
class Campaign:
    """48 scenarios: residuals of both faces [48, 70 s of samples], truth, and the baseline after each whole second."""

    up: Array
    down: Array
    truth: Array
    baseline: Array
    """[70, 48, 2]: after 1, 2, ... 70 s."""

    @staticmethod
    def draw(seed: int) -> Campaign:
        data = paper_windows(len(DAYS), seed, float(LABEL_S))
        ends = np.round(np.arange(1, LABEL_S + 1) * RATE_HZ).astype(int)
        up, down = (np.cumsum(data[f], axis=1, dtype=float)[:, ends - 1] / ends for f in ("up", "down"))
        baseline = np.stack([(up - down) / (2 * TABLE_RATE_DPS), (up + down) / 2], axis=-1).swapaxes(0, 1)
        return Campaign(data["up"], data["down"], np.column_stack([data["scale"], data["bias_dps"]]), baseline)


@cache
def shipped() -> CoreEstimator:
    """The model that ships, in the C core."""
    return CoreEstimator(MODEL / "calibration.h")


def folds() -> Iterator[tuple[str, Array, Array]]:
    """(which split, scenarios to learn from, scenarios to be judged by)."""
    everything = np.arange(len(DAYS))
    for day in (1, 2, 3):
        held = np.equal(DAYS, day)
        yield "day", everything[~held], everything[held]
    yield "paper", everything[:-2], everything[-2:]


def answered(campaign: Campaign) -> tuple[Array, Array]:
    """Answers [methods, seconds, scenarios, 2] of those that learned elsewhere, and their standard errors; NaN: none."""
    found = np.full((len(METHODS), len(SECONDS), len(DAYS), 2), np.nan)
    errors = found.copy()
    up, down = campaign.up, campaign.down
    ours, papers = FaceNetwork.shipped(), Network.shipped()
    prior = network_prior(MODEL / "model.toml", "z")
    model = shipped().answers(up[:, :MOST], down[:, :MOST], SECONDS, limit.PROTOCOL)
    for k, seconds in enumerate(SECONDS):
        windows = round(seconds / 2)
        cut = [y[:, : windows * papers.window].reshape(-1, papers.window) for y in (up, down)]
        y = papers.estimate(cut[0], cut[1], TABLE_RATE_DPS, -TABLE_RATE_DPS)
        found[METHODS.index("paper"), k] = y.reshape(len(DAYS), windows, 2).mean(1)
        n = ours.samples(k)
        y = ours.estimate(up[:, :n], down[:, :n], k, TABLE_RATE_DPS, -TABLE_RATE_DPS, prior)
        p = limit.limit(up, down, seconds)
        for method, values, se in (
            ("baseline", campaign.baseline[round(seconds) - 1], np.nan),
            ("gyrocal", y[:, :2], y[:, 2:]),
            ("model", model[k][:, [0, 2]], model[k][:, [1, 3]]),
            ("limit", np.column_stack([p.scale, p.bias_dps]), np.column_stack([p.scale_se, p.bias_se_dps])),
        ):
            found[METHODS.index(method), k], errors[METHODS.index(method), k] = values, se
    return found, errors


def without_priors(campaign: Campaign) -> Array:
    """Answers [FLAT_METHODS, seconds, scenarios, 2] of those that know the effects, but nothing of scale and bias."""
    found = np.empty((len(FLAT_METHODS), len(SECONDS), len(DAYS), 2))
    net = FaceNetwork.shipped()
    for k, seconds in enumerate(SECONDS):
        n = net.samples(k)
        best = limit.limit(campaign.up, campaign.down, seconds, known=False)
        found[:, k] = (
            campaign.baseline[round(seconds) - 1],
            net.estimate(campaign.up[:, :n], campaign.down[:, :n], k, TABLE_RATE_DPS, -TABLE_RATE_DPS)[:, :2],
            np.column_stack([best.scale, best.bias_dps]),
        )
    return found


def judge(campaign: Campaign, elsewhere: Array, known: Array, tested: Array) -> Array:
    """Answers [methods, seconds, tested, 2]: those of ``elsewhere`` and what the labels of ``known`` scenarios teach."""
    labels = campaign.baseline[-1][known]
    found = elsewhere[:, :, tested].copy()
    for k, seconds in enumerate(SECONDS):
        base = campaign.baseline[round(seconds) - 1]
        mean, of_base = labels.mean(0), base[known].mean(0)
        slope = np.mean((labels - mean) * (base[known] - of_base), axis=0) / base[known].var(0)
        found[METHODS.index("prior"), k] = mean
        found[METHODS.index("shrunk"), k] = mean + slope * (base[tested] - of_base)
    return found


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """All seeds; what ``gyrocal benchmark paper --json`` prints. The pictures go to docs/images unless it is a sample."""
    seeds = SAMPLE_SEEDS if sample else SEEDS
    kept: dict[str, list[tuple[Array, Array, Array, Array]]] = {"day": [], "paper": []}
    seconds_of_baseline, labels, truths, flat = [], [], [], []
    for seed in range(seeds):
        campaign = Campaign.draw(FIRST_SEED + seed)
        labels.append(campaign.baseline[-1])
        truths.append(campaign.truth)
        seconds_of_baseline.append(np.abs(campaign.baseline - campaign.truth))
        elsewhere, errors = answered(campaign)
        flat.append(np.abs(without_priors(campaign) - campaign.truth))
        for split, known, tested in folds():
            found = judge(campaign, elsewhere, known, tested)
            kept[split].append((found, errors[:, :, tested], campaign.truth[tested], campaign.baseline[-1][tested]))
        progress(seed + 1, seeds + 2)
    by_second = np.concatenate(seconds_of_baseline, axis=1).mean(1)
    joined = {split: tuple(np.concatenate([p[i] for p in parts], axis=-2) for i in range(4)) for split, parts in kept.items()}
    report = _report(joined, by_second, np.concatenate(labels), np.concatenate(truths))
    report["table2_flat"] = _table2(np.concatenate(flat, axis=2), FLAT_METHODS)
    tests = SAMPLE_TESTS if sample else MISFIT_TESTS
    report["hidden_effect"] = judge_hidden(SAMPLE_CAMPAIGN if sample else len(DAYS), tests)
    progress(seeds + 1, seeds + 2)
    report["misfit"] = judge_misfit(tests)
    if not sample:
        _draw(report, by_second, np.concatenate(labels), np.concatenate(truths))
    return report


def session(up: Array, down: Array, rng: np.random.Generator) -> Session:
    """Scenarios as a session of three days: ``up`` and ``down`` [n, samples], measured - true rate of z; x and y at rest."""
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
    """What a user gets: `gyrocal add table_ripple`, `gyrocal add spin_up`, `gyrocal export`; in the C core."""
    model = None
    for effect in ("table_ripple", "spin_up"):
        *_, model = add(campaign, model, effect)
    with tempfile.TemporaryDirectory() as folder:
        header = Path(folder, "calibration.h")
        header.write_text(render(model))
        return CoreEstimator(header)


def judge_hidden(scenarios: int, tests: int) -> dict[str, Any]:
    """A table that also ripples twice a turn: answers of what was learned without it, and of what a campaign of so many
    ``scenarios`` with it teaches."""
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
    prior = network_prior(MODEL / "model.toml", "z")
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


def judge_misfit(tests: int) -> list[dict[str, Any]]:
    """Signals outside the model, of sizes from none to large: how often the misfit is above its limit after 2, 4 and 6 s where
    the signal, as far as the model cannot take it up, exceeds five of its standard errors (those of a test that knows its
    shape); where there is none; and after 6 s where each is of exactly so many standard errors."""
    rng = np.random.default_rng(FIRST_SEED + 1)
    device = calibration_of(Model.open(MODEL / "model.toml"), "z")
    quiet = replace(
        device, run_columns=tuple(replace(c, mean=0.0) for c in device.run_columns),
        bias_dps=(0.0, device.bias_dps[1]), scale=(0.0, device.scale[1]),
    )  # fmt: skip
    data = paper_windows(tests, FIRST_SEED + 100)
    t_s = limit.PROTOCOL.runs(6.0)[0].t_s
    turn = np.deg2rad(TABLE_RATE_DPS * t_s)

    def normal(sd: float) -> Array:
        return rng.normal(0.0, sd, (tests, 1))

    def phase() -> Array:
        return rng.uniform(0, 2 * np.pi, (tests, 1))

    kinds: dict[str, Callable[[], Array]] = {
        "none": lambda: normal(0.0) * t_s,
        "ripple of order 2, 0.1 %": lambda: TABLE_RATE_DPS * normal(0.001) * np.cos(2 * turn + phase()),
        "ripple of order 3, 0.1 %": lambda: TABLE_RATE_DPS * normal(0.001) * np.cos(3 * turn + phase()),
        "tone of 1 Hz, 30 mdps": lambda: normal(0.03) * np.sin(2 * np.pi * t_s + phase()),
        "jump of 0.1 dps": lambda: normal(0.1) * (t_s > rng.uniform(0, 6, (tests, 1))),
        "jump of 30 mdps": lambda: normal(0.03) * (t_s > rng.uniform(0, 6, (tests, 1))),
        "drift of 20 mdps/s": lambda: normal(0.02) * t_s,
        "offset of 50 mdps": lambda: normal(0.05) * np.ones_like(t_s),
    }

    def outside(up: Array, down: Array, seconds: float) -> Array:
        """What of a signal the model cannot take up, squared, in standard errors."""
        return answers(quiet, up, down, seconds, limit.PROTOCOL).chi2

    def flags(up: Array, down: Array) -> list[Array]:
        found = shipped().answers(data["up"] + up, data["down"] + down, SECONDS, limit.PROTOCOL)
        return [of[:, 4] > misfit_limit(seconds) for of, seconds in zip(found, SECONDS, strict=True)]

    rows: list[dict[str, Any]] = []
    for kind, draw in kinds.items():
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


Joined = dict[str, tuple[Array, ...]]


def _report(joined: Joined, by_second: Array, labels: Array, truths: Array) -> dict[str, Any]:
    found, errors, truth, label = joined["day"]
    off = np.abs(found - truth)
    improvement, saving, conv = {}, {}, {}
    last = off[:, -1].mean(1)
    for m, method in enumerate(METHODS):
        gain = 100 * (1 - last[m] / last[0])
        improvement[method] = _terms(gain) | {"mean_interval": _interval(off, m)}
        reached = [_first_second(by_second[:, j], last[m, j]) for j in range(2)]
        conv[method] = {"scale": reached[0], "bias": reached[1]}
        saving[method] = _terms(np.array([100 * (1 - 6 / (t or LABEL_S)) for t in reached]))
    covered = {
        method: [_terms(np.mean(off[METHODS.index(method), k] < errors[METHODS.index(method), k], axis=0)) for k in range(3)]
        for method in WITH_SE
    }
    return {
        "scenarios": int(truth.shape[0]),
        "seeds": int(truth.shape[0] // len(DAYS)),
        "table1": {
            "label_mean": _terms(labels.mean(0)), "label_sd": _terms(labels.std(0)),
            "truth_mean": _terms(truths.mean(0)), "truth_sd": _terms(truths.std(0)),
            "label_mae": _terms(np.abs(labels - truths).mean(0)),
        },
        "table2": _table2(off),
        "table2_against_labels": _table2(np.abs(found - label)),
        "table2_paper_split": _table2(np.abs(joined["paper"][0] - joined["paper"][2])),
        "covered_68": covered,
        "improvement_percent": improvement,
        "convergence_s": conv,
        "time_saving_percent": saving,
        "baseline_mae": [{"seconds": t + 1, "scale": float(e[0]), "bias_dps": float(e[1])} for t, e in enumerate(by_second)],
    }  # fmt: skip


def _terms(values: Array) -> dict[str, float]:
    return {"scale": float(values[0]), "bias": float(values[1]), "mean": float(np.mean(values))}


def _first_second(by_second: Array, error: float) -> int | None:
    """The first whole second at which the baseline is as good; None if not within 70 s."""
    reached = np.flatnonzero(by_second <= error)
    return int(reached[0]) + 1 if reached.size else None


def _table2(off: Array, methods: Sequence[str] = METHODS) -> list[dict[str, Any]]:
    """Mean absolute errors with 95 % intervals (normal, of the mean), and how many times the limit's they are."""
    rows = []
    best = off[methods.index("limit")].mean(1)
    for k, seconds in enumerate(SECONDS):
        for m, method in enumerate(methods):
            mae, half = off[m, k].mean(0), 1.96 * off[m, k].std(0) / np.sqrt(off.shape[2])
            rows.append({
                "seconds": seconds, "method": method, "scale_mae": float(mae[0]), "bias_mae_dps": float(mae[1]),
                "scale_over_limit": float(mae[0] / best[k, 0]), "bias_over_limit": float(mae[1] / best[k, 1]),
                "scale_half_interval": float(half[0]), "bias_half_interval_dps": float(half[1]),
            })  # fmt: skip
    return rows


def _interval(off: Array, m: int) -> list[float]:
    """95 % of the improvement at 6 s, mean of both terms, by bootstrap over scenarios."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, off.shape[2], (1000, off.shape[2]))
    drawn = 100 * (1 - off[m, -1][rows].mean(1) / off[0, -1][rows].mean(1)).mean(1)
    return [float(v) for v in np.percentile(drawn, [2.5, 97.5])]


def _draw(report: dict[str, Any], by_second: Array, labels: Array, truths: Array) -> None:
    """Figs. 4 and 5: the labels' spread; the baseline's error against time, the methods after 2, 4 and 6 s."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    from gyrocal.present.pictures import BLUE, GREEN, GREY, ORANGE, PURPLE

    figure = Figure(figsize=(8, 3.2), layout="constrained", dpi=110)
    for j, (axes, name, factor) in enumerate(zip(figure.subplots(1, 2), ("scale, %", "bias, mdps"), (100, 1e3), strict=True)):
        bins = np.histogram_bin_edges(factor * labels[:, j], 40)
        axes.hist(factor * labels[:, j], bins, color=BLUE, alpha=0.6, label="baseline over 70 s")
        axes.hist(factor * truths[:, j], bins, histtype="step", color=GREY, lw=1.5, label="truth")
        axes.set(xlabel=name, ylabel="scenarios")
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylim(top=1.3 * figure.axes[0].get_ylim()[1])
    figure.axes[0].legend(frameon=False, fontsize=9)
    figure.suptitle("Labels, as in the paper's Fig. 4", fontsize=11)
    figure.savefig(IMAGES / "paper_fig4.png")

    figure = Figure(figsize=(8, 3.6), layout="constrained", dpi=110)
    styles = {
        "prior": (GREY, "_", 9), "paper": (ORANGE, "*", 9), "gyrocal": (PURPLE, "D", 9), "model": (GREEN, "o", 4),
        "limit": ("k", "x", 6),
    }  # fmt: skip
    for j, (axes, name, factor) in enumerate(zip(figure.subplots(1, 2), ("scale, %", "bias, mdps"), (100, 1e3), strict=True)):
        axes.semilogy(np.arange(1, LABEL_S + 1), factor * by_second[:, j], color=BLUE, label="baseline")
        for method, (colour, marker, size) in styles.items():
            rows = [row for row in report["table2"] if row["method"] == method]
            mae = [factor * row[("scale_mae", "bias_mae_dps")[j]] for row in rows]
            hollow = "none" if marker == "D" else colour
            axes.semilogy(SECONDS, mae, marker, color=colour, mfc=hollow, label=method, ms=size, ls="none")
        axes.yaxis.set_major_formatter(ScalarFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set(xlabel="seconds of each face", ylabel=f"mean error of {name}")
        axes.grid(alpha=0.25, which="both")
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].legend(frameon=False, fontsize=9)
    figure.suptitle("Error against time, as in the paper's Fig. 5", fontsize=11)
    figure.savefig(IMAGES / "paper_fig5.png")


def show(report: dict[str, Any]) -> None:
    """The tables on the terminal."""
    titles = {
        "table2": f"mean error against the truth, leave one day out, {report['scenarios']} scenarios",
        "table2_against_labels": "the same against the paper's labels, the baseline over 70 s",
        "table2_flat": "nothing known of scale and bias beforehand",
        "table2_paper_split": "the last two scenarios of the last day, as in the paper",
    }
    for key, title in titles.items():
        rows = [
            [f"{r['seconds']:g}", r["method"], f"{r['scale_mae']:.6f} ± {r['scale_half_interval']:.6f}",
             f"{1e3 * r['bias_mae_dps']:.2f} ± {1e3 * r['bias_half_interval_dps']:.2f}",
             f"{r['scale_over_limit']:.3f}", f"{r['bias_over_limit']:.3f}"]
            for r in report[key]
        ]  # fmt: skip
        table(title, ["seconds", "method:", "scale", "bias mdps", "scale / limit", "bias / limit"], rows)
    rows = []
    for method in METHODS:
        gain, saved = report["improvement_percent"][method], report["time_saving_percent"][method]
        low, high = gain["mean_interval"]
        reached = [report["convergence_s"][method][term] or f"> {LABEL_S}" for term in ("scale", "bias")]
        rows.append([
            method, f"{gain['scale']:.1f}", f"{gain['bias']:.1f}", f"{gain['mean']:.1f} ({low:.1f} to {high:.1f})",
            str(reached[0]), str(reached[1]), f"{saved['mean']:.1f}",
        ])  # fmt: skip
    table(
        f"at 6 s against the baseline (paper: {PAPERS['improvement']:g} % less error, {PAPERS['time']:g} % less time)",
        ["method:", "less error % scale", "bias", "mean", "T_conv s scale", "bias", "less time %"], rows,
    )  # fmt: skip
    hidden = report["hidden_effect"]
    rows = [
        [f"{r['seconds']:g}", r["method"], f"{r['scale_mae']:.6f}", f"{1e3 * r['bias_mae_dps']:.2f}",
         f"{r['scale_over_limit']:.3f}", f"{r['bias_over_limit']:.3f}",
         "" if r["flagged"] is None else f"{100 * r['flagged']:.1f}"]
        for r in hidden["answers"]
    ]  # fmt: skip
    columns = ["seconds", "method:", "scale", "bias mdps", "scale / limit", "bias / limit", "misfit says so, %"]
    table(f"a hidden effect, {hidden['hidden']}, {hidden['scenarios']} scenarios", columns, rows)
    rows = [
        [r["hidden"], f"{r['seconds']:g}", f"{100 * r['beyond_five_se']:.1f}",
         "" if r["flagged_of_those"] is None else f"{100 * r['flagged_of_those']:.1f}", f"{100 * r['flagged']:.1f}"]
        for r in report["misfit"]
    ]  # fmt: skip
    table("misfit", ["hidden:", "seconds", "beyond five se, %", "flagged of those, %", "flagged of all, %"], rows)
    rows = [
        [r["hidden"], *(f"{100 * share:.1f}" for share in r["flagged_at_sigma"].values())]
        for r in report["misfit"] if "flagged_at_sigma" in r
    ]  # fmt: skip
    table("misfit after 6 s, %, of signals of exactly so many standard errors", ["hidden:", *map(str, SIGMAS)], rows)
    for method, stages in report["covered_68"].items():
        said = ", ".join(f"{s:g} s {c['scale']:.3f} and {c['bias']:.3f}" for s, c in zip(SECONDS, stages, strict=True))
        stdout.print(f"{method}: the truth is within one standard error (scale and bias): {said}")
