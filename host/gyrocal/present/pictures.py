"""Pictures of a comparison and of a calibration's errors, by matplotlib."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gyrocal.diagnosis.compare import Comparison
from gyrocal.diagnosis.probes import Finding, Steps
from gyrocal.effects import quantities
from gyrocal.effects.base import elapsed_s, table_angle_rad
from gyrocal.errors import InputError
from gyrocal.inference import heldout
from gyrocal.noise.allan import allan_deviation, model_deviation
from gyrocal.recording.session import AXES, Array, Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart by colour-blind eyes too.
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#6f6f6f"
AXIS_COLOURS = {"x": ORANGE, "y": GREEN, "z": BLUE}


LEAST_RATE_DPS = 5.0
RUNS_SHOWN, TURNS_SHOWN = 4, 3
STEPS_SHOWN = 24


def _gravity(run: Run, axis: int) -> Array:
    """Acceleration along an axis, [n], g; zero without an accelerometer."""
    acc_g = quantities.acceleration_g(run)
    return np.zeros(len(run)) if acc_g is None else acc_g[:, axis]


def _power_on_s(run: Run, axis: int) -> Array:
    return elapsed_s(run) + (run.power_on_s or 0.0)


QUANTITIES: dict[str, tuple[str, Callable[[Run, int], Array]]] = {
    "time": ("time in the run, s", lambda r, a: elapsed_s(r)),
    "power_on_time": ("time since power-on, s", _power_on_s),
    "temperature": ("temperature, degC", lambda r, a: quantities.warming_c(r) + quantities.REFERENCE_C),
    "rate": ("true rate, deg/s", quantities.rate_about),
    "acceleration": ("acceleration along the axis, g", _gravity),
    "table_angle": ("angle of the table, turns", lambda r, a: np.abs(table_angle_rad(r)) / (2 * np.pi)),
}
"""What a comparison holds the residual against: its name, and its value [n] in a run for an axis."""


def _figure(width: float, height: float) -> tuple[Figure, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=110)
    axes = figure.add_subplot()
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def residual_against_time(comparison: Comparison) -> Figure:
    """Block means of the residual against time in the run, runs on top of each other."""
    figure, axes = _figure(8, 3.2)
    for p in heldout.fitted(comparison.fit):
        name = AXES[p.axis]
        b = next(b for b in comparison.fit.blocks if b.run is p.run)
        means = b.mean(p.residual_dps[:, None])[:, 0]
        axes.plot(b.t_s - p.run.t_s[0], means * 1e3, ".", ms=1.2, alpha=0.5, color=AXIS_COLOURS[name])
    for name in comparison.fit.axes:
        axes.plot([], [], "o", color=AXIS_COLOURS[name], label=name)
    axes.set(xlabel="time in the run, s", ylabel="measured - model, mdps", title="Residual, means of 0.1 s")
    axes.legend(loc="upper right", ncols=3, frameon=False)
    return figure


def residual_against(comparison: Comparison, finding: Finding) -> Figure | None:
    """Residual of the finding's axis against what it is found against; None for a spectrum's or a code's.

    Dots are means of a second; the line is the mean over as many of them in each of some steps. What grows with the rate is
    shown as a part of it. A wave in the table's angle whose phase differs from run to run has a line a run.
    """
    if finding.against not in QUANTITIES:
        return None
    label, quantity = QUANTITIES[finding.against]
    turning = finding.against == "table_angle"
    each_run = turning and finding.kind is not None and finding.kind.scope == "run"
    of_rate = isinstance(finding.kind, Steps) and finding.kind.times_rate
    points = []
    for p in heldout.fitted(comparison.fit):
        if AXES[p.axis] == finding.axis:
            b = next(b for b in comparison.fit.blocks if b.run is p.run)
            columns = [quantity(p.run, p.axis), p.residual_dps * 1e3, quantities.rate_about(p.run, p.axis)]
            step = np.floor((b.t_s - p.run.t_s[0]) * (4 if turning else 1))
            means = b.mean(np.column_stack(columns))
            means = np.array([means[step == k].mean(axis=0) for k in np.unique(step)])
            points.append(means[np.abs(means[:, 2]) > LEAST_RATE_DPS] if of_rate else means)
    figure, axes = _figure(8, 3.2)
    style = {"ls": "-", "lw": 1.2, "alpha": 0.8} if each_run else {"ls": "", "marker": ".", "ms": 3, "alpha": 0.25}
    shown = points[:RUNS_SHOWN] if each_run else points
    x, y, rate_dps = np.concatenate(shown).T
    y = y * 1e3 / rate_dps if of_rate else y
    x = x % 1.0 if turning and not each_run else x
    for part in np.split(np.arange(x.size), np.cumsum([len(run) for run in shown])[:-1]):
        axes.plot(x[part], y[part], color=AXIS_COLOURS[finding.axis], **style)
    if each_run:
        axes.set_xlim(0, TURNS_SHOWN)
    else:
        order = np.array_split(np.argsort(x), STEPS_SHOWN)
        axes.plot([x[k].mean() for k in order], [y[k].mean() for k in order], "o-", color="black", ms=4, lw=1.2)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set(
        xlabel=f"{label}{f', from the start of each run; the first {RUNS_SHOWN}' if each_run else ''}",
        ylabel=f"measured - model, {'ppm of the rate' if of_rate else 'mdps'}", title=f"Residual on {finding.axis}",
    )  # fmt: skip
    return figure


def spectra(comparison: Comparison) -> Figure:
    """Amplitude spectral density of the residual, and its level between lines."""
    figure, axes = _figure(8, 3.2)
    for name, lines in comparison.spectra.items():
        if lines.frequency_hz.size:
            axes.loglog(lines.frequency_hz, np.sqrt(lines.power) * 1e3, lw=0.7, color=AXIS_COLOURS[name], label=name)
            axes.loglog(lines.frequency_hz, np.sqrt(lines.level) * 1e3, lw=1.5, ls="--", color=AXIS_COLOURS[name])
    axes.set(xlabel="frequency, Hz", ylabel="mdps/√Hz", title="Spectrum of the residual (dashed: between lines)")
    axes.legend(frameon=False, ncols=3)
    return figure


def allan(comparison: Comparison) -> Figure:
    """Allan deviation of the residual and of the model's noise."""
    figure, axes = _figure(8, 3.2)
    rate_hz = comparison.fit.session.sample_rate_hz
    predictions = list(heldout.fitted(comparison.fit))
    for name, fitted in comparison.fit.axes.items():
        series = [p.residual_dps for p in predictions if AXES[p.axis] == name]
        if not series:
            continue
        tau_s, deviation = allan_deviation(series, rate_hz)
        axes.loglog(tau_s, deviation * 1e3, "o-", ms=3, lw=0.8, color=AXIS_COLOURS[name], label=name)
        axes.loglog(tau_s, model_deviation(tau_s, fitted.noise, rate_hz) * 1e3, "--", lw=1.2, color=AXIS_COLOURS[name])
    axes.set(xlabel="averaging time, s", ylabel="mdps", title="Allan deviation of the residual (dashed: the noise model)")
    axes.legend(frameon=False, ncols=3)
    return figure


def levels(comparison: Comparison) -> Figure:
    """Excess over the floor, axis by axis."""
    figure, axes = _figure(8, 1.9)
    for i, (name, level) in enumerate(comparison.per_axis.items()):
        axes.barh(i, level.floor_dps * 1e3, color=GREY, height=0.6)
        if level.excess_dps is not None and level.rms_dps is not None:
            axes.barh(
                i,
                (level.rms_dps - level.floor_dps) * 1e3,
                left=level.floor_dps * 1e3,
                color=AXIS_COLOURS[name],
                height=0.6,
            )
            axes.text(level.rms_dps * 1e3, i, f"  excess {level.excess_dps * 1e3:.1f}", va="center", fontsize=9)
    axes.set(
        yticks=range(len(comparison.per_axis)),
        yticklabels=list(comparison.per_axis),
        xlabel="rms of held-out samples, mdps (grey: noise floor)",
    )
    axes.margins(x=0.15)
    return figure


def calibration_errors(errors: Mapping[str, Mapping[float, tuple[float, float]]], title: str) -> Figure:
    """Mean absolute error of scale and bias against seconds, a line a method: {method: {seconds: (scale, bias_dps)}}."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.4), layout="constrained", dpi=110)
    panels = figure.subplots(1, 2)
    styles = [(GREY, "s"), (PURPLE, "^"), (ORANGE, "D"), (BLUE, "o")]
    for (method, points), (colour, marker) in zip(errors.items(), styles * len(errors), strict=False):
        seconds = sorted(points)
        for k, (axes, factor) in enumerate(zip(panels, (100.0, 1e3), strict=True)):
            axes.plot(seconds, [points[s][k] * factor for s in seconds], marker=marker, color=colour, label=method)
    for axes, label in zip(panels, ("scale, %", "bias, mdps"), strict=True):
        axes.set(
            xlabel="seconds of each face",
            ylabel=f"mean error of {label}",
            xticks=sorted(next(iter(errors.values()))),
            ylim=(0, None),
        )
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].legend(frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11)
    return figure


def of_comparison(comparison: Comparison) -> dict[str, tuple[str, Figure]]:
    """Every picture of a comparison: {file name: (title, figure)}."""
    drawn = {"levels": ("Excess over the floor", levels(comparison))}
    if comparison.where:
        first = comparison.where[0]
        figure = residual_against(comparison, first)
        if figure is not None:
            drawn["where"] = (f"Where it fails most: on {first.axis}, against {first.against.replace('_', ' ')}", figure)
    return drawn | {
        "time": ("Residual against time", residual_against_time(comparison)),
        "spectrum": ("Spectrum", spectra(comparison)),
        "allan": ("Allan deviation", allan(comparison)),
    }


def save(comparison: Comparison, folder: Path) -> None:
    """Every picture of a comparison as PNG in a folder, made if it is not there."""
    try:
        folder.mkdir(exist_ok=True)
        for name, (_, figure) in of_comparison(comparison).items():
            figure.savefig(folder / f"{name}.png")
    except OSError as error:
        raise InputError(f"{folder}: {error.strerror}") from None


def png_data(figure: Figure) -> str:
    """The figure as a data URL: smaller than SVG where there are many points."""
    import base64

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
