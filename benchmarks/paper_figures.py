"""The report of benchmark `paper`: its figures from the methods' errors, its tables on the terminal, and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.present.output import stdout, table
from gyrocal.recording.session import Array

from .paper_campaign import DAYS, LABEL_S, SECONDS
from .paper_hidden import SIGMAS

METHODS = ("baseline", "prior", "shrunk", "model", "paper", "gyrocal", "limit")
WITH_SE = ("model", "gyrocal", "limit")
PAPERS = {"improvement": 72.0, "time": 75.0}
IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
Joined = dict[str, tuple[Array, ...]]


def report_of(joined: Joined, by_second: Array, labels: Array, truths: Array) -> dict[str, Any]:
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
        "table2": table2_of(off),
        "table2_against_labels": table2_of(np.abs(found - label)),
        "table2_paper_split": table2_of(np.abs(joined["paper"][0] - joined["paper"][2])),
        "covered_68": covered,
        "improvement_percent": improvement,
        "convergence_s": conv,
        "time_saving_percent": saving,
        "baseline_mae": [{"seconds": t + 1, "scale": float(e[0]), "bias_dps": float(e[1])} for t, e in enumerate(by_second)],
    }  # fmt: skip


def _terms(values: Array) -> dict[str, float]:
    return {"scale": float(values[0]), "bias": float(values[1]), "mean": float(np.mean(values))}


def _first_second(by_second: Array, error: float) -> int | None:
    """The first whole second at which the baseline's error is as small; None if it is not within 70 s."""
    reached = np.flatnonzero(by_second <= error)
    return int(reached[0]) + 1 if reached.size else None


def table2_of(off: Array, methods: Sequence[str] = METHODS) -> list[dict[str, Any]]:
    """Mean absolute errors with normal 95 % intervals of the mean, and their ratios to the limit's.

    ``off`` [methods, seconds, scenarios, 2] holds absolute errors of the scale and of the bias in dps.
    """
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
    """The 95 % interval of the improvement at 6 s, averaged over both terms, by bootstrap over scenarios."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, off.shape[2], (1000, off.shape[2]))
    drawn = 100 * (1 - off[m, -1][rows].mean(1) / off[0, -1][rows].mean(1)).mean(1)
    return [float(v) for v in np.percentile(drawn, [2.5, 97.5])]


def draw(report: dict[str, Any], by_second: Array, labels: Array, truths: Array) -> None:
    """Draw Fig. 4, the spread of the labels, and Fig. 5, the errors against time."""
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
    """Print the report's tables on the terminal."""
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
