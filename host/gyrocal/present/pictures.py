"""Figures of a comparison and of a calibration's errors, by matplotlib."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.quantities import rate_about
from gyrocal.errors import InputError
from gyrocal.inference import heldout
from gyrocal.noise.allan import allan_deviation, model_deviation
from gyrocal.present.figure import new_figure
from gyrocal.present.spectra import against_frequency, against_order
from gyrocal.recording.session import AXES, Array
from gyrocal.units import part_unit
from gyrocal.variables.base import Variable, variables
from gyrocal.variables.frequency import Frequency
from gyrocal.variables.order import Order
from gyrocal.variables.shapes import Columns, ShapeOfEachRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which colour-blind people can also distinguish.
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#6f6f6f"
AXIS_COLOURS = {"x": ORANGE, "y": GREEN, "z": BLUE}


LEAST_RATE_DPS = 5.0
RUNS_SHOWN, PERIODS_SHOWN = 4, 3
STEPS_SHOWN = 24
FEW_DECADES = 4
"""Decades of a logarithmic axis up to which 2 and 5 are told beside 1."""


def framed(width: float, height: float) -> tuple[Figure, Any]:
    """A figure of ``width`` by ``height`` inches with one pair of axes."""
    figure = new_figure(width, height, dpi=110)
    axes = figure.add_subplot()
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def logarithmic(axes: Any) -> None:
    """Logarithmic axes whose ticks are plain numbers, with room above the curves for the legend."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(xscale="log", yscale="log")
    if axes.lines:
        axes.set_ylim(top=1.7 * axes.get_ylim()[1])
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        decades = np.log10(high / low)
        subs = (1,) if decades > FEW_DECADES else (1, 2, 5) if decades > 1 else range(1, 10)
        axis.set_major_locator(LogLocator(subs=tuple(subs), numticks=30))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def residual_against_time(comparison: Comparison) -> Figure:
    """Block means of the residual against time in the run, with all runs in one plot."""
    figure, axes = framed(8, 3.2)
    for p in heldout.fitted(comparison.fit):
        name = AXES[p.axis]
        b = next(b for b in comparison.fit.blocks if b.run.index == p.run.index)
        means = b.mean(p.residual_dps[:, None])[:, 0]
        axes.plot(b.t_s - p.run.t_s[0], means * 1e3, ".", ms=1.2, alpha=0.5, color=AXIS_COLOURS[name])
    shown = "means of 0.1 s" if comparison.fit.session.sample_rate_hz > 10 else "every sample"
    for name in comparison.fit.axes:
        axes.plot([], [], "o", color=AXIS_COLOURS[name], label=name)
    axes.set(xlabel="time in the run, s", ylabel="measured - model, mdps", title=f"Residual, {shown}")
    axes.legend(loc="upper right", ncols=3, frameon=False)
    return figure


def residual_against(comparison: Comparison, finding: Finding, after: Comparison | None = None) -> Figure | None:
    """Residual of the finding's axis against the finding's variable; None if the variable has no values (a frequency).

    Dots are one-second means. The line is the mean over steps that contain equally many dots. A residual that grows with the
    rate is shown as a fraction of it, one in proportion to a quantity against that quantity. A periodic variable (a turn) is
    folded at its period. If the phase differs from run to run, there is one line for each run. ``after`` is a comparison with a
    richer model, whose residual is drawn on top.
    """
    variable = variables()[finding.against](comparison.fit.session.about(finding.axis).runs)
    of_rate = finding.times_rate
    each_run = variable.period is not None and isinstance(finding.shape, ShapeOfEachRun)
    own = finding.shape if isinstance(finding.shape, Columns) and finding.shape.label else None
    figure, axes = framed(8, 3.2)
    for drawn, colour, line in ((comparison, AXIS_COLOURS[finding.axis], "black"), (after, GREY, PURPLE)):
        points = [] if drawn is None else _means(drawn, variable, AXES.index(finding.axis), own)
        if of_rate:
            points = [run[np.abs(run[:, 2]) > LEAST_RATE_DPS] for run in points]
        if not any(run.size for run in points):
            if drawn is comparison:
                return None
            continue
        style = {"ls": "-", "lw": 1.2, "alpha": 0.8} if each_run else {"ls": "", "marker": ".", "ms": 3, "alpha": 0.25}
        shown = points[:RUNS_SHOWN] if each_run else points
        x, y, rate_dps = np.concatenate(shown).T
        y = 1e-3 * y / rate_dps * part_unit(finding.note).per_dps if of_rate else y
        if variable.period is not None:
            x = np.abs(x) if each_run else x % variable.period
        for part in np.split(np.arange(x.size), np.cumsum([len(run) for run in shown])[:-1]):
            axes.plot(x[part], y[part], color=colour, **style)
        if each_run and after is not None:
            axes.plot([], [], color=colour, label="before" if drawn is comparison else "after")
        if each_run and variable.period is not None:
            axes.set_xlim(0, PERIODS_SHOWN * variable.period)
        else:
            order = [k for k in np.array_split(np.argsort(x), STEPS_SHOWN) if k.size]
            label = "mean before" if drawn is comparison else "mean after"
            axes.plot([x[k].mean() for k in order], [y[k].mean() for k in order], "o-", color=line, ms=4, lw=1.2, label=label)
        if after is not None:
            axes.legend(frameon=False, fontsize=9, loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
    axes.axhline(0.0, color=GREY, lw=0.8)
    label = own.label if own else variable.label(finding.axis if variable.components else "")
    axes.set(
        xlabel=f"{label}{f', from the start of each run; the first {RUNS_SHOWN} runs' if each_run else ''}",
        ylabel=f"measured - model, {part_unit(finding.note).name if of_rate else 'mdps'}", title=f"Residual on {finding.axis}",
    )  # fmt: skip
    return figure


def _means(comparison: Comparison, variable: Variable, axis: int, own: Columns | None) -> list[Array]:
    """One-second means (a quarter of a second for a periodic variable) of each run that has the variable.

    Each has the shape [m, 3]: the variable (its component along the axis if it has components; the first of ``own`` if given,
    in means of 0.1 s, because it changes fast), the residual (mdps) and the
    true rate about the axis (deg/s).
    """
    per_second = 10 if own else 1 if variable.period is None else 4
    blocks = {b.run.index: b for b in comparison.fit.blocks}
    out = []
    for p in heldout.fitted(comparison.fit):
        found = (own.of(p.run) if own else variable.values(p.run, axis)) if p.axis == axis else None
        if found is None:
            continue
        b = blocks[p.run.index]
        x = found[:, 0] if own else found[:, axis] if variable.components else found
        means = b.mean(np.column_stack([x, p.residual_dps * 1e3, rate_about(p.run, axis)]))
        step = np.floor((b.t_s - p.run.t_s[0]) * per_second)
        out.append(np.array([means[step == k].mean(axis=0) for k in np.unique(step)]))
    return out


def spectra(comparison: Comparison, against: str = Frequency.name) -> Figure | None:
    """The residual's spectrum from one period in the longest run on, as the workbench draws it.

    It is the amplitude density over the frequency, or for ``Order.name`` the amplitude over periods per turn of the table. The
    latter is None if no run turns far enough.
    """
    by_axis: dict[str, dict[int, Array]] = {axis: {} for axis in comparison.fit.axes}
    for p in heldout.fitted(comparison.fit):
        by_axis[AXES[p.axis]][p.run.index] = p.residual_dps
    figure, axes = framed(8, 3.2)
    over_turn, reference = against == Order.name, "noise alone"
    for name, residuals in by_axis.items():
        if not residuals:
            continue
        c = against_order(comparison, name, residuals) if over_turn else against_frequency(
            comparison, name, list(residuals.values())
        )  # fmt: skip
        if c is None or not c.x:
            continue
        y, expected, low, high = (1e3 * np.array(v) for v in (c.y, c.expected, c.low, c.high))
        axes.fill_between(c.x, low, high, color=AXIS_COLOURS[name], alpha=0.2, linewidth=0)
        axes.plot(c.x, y, lw=0.9, color=AXIS_COLOURS[name], label=name)
        axes.plot(c.x, expected, lw=1.5, ls="--", color=AXIS_COLOURS[name])
    if over_turn:
        if not axes.lines:
            return None
        reference = "white noise alone"
    x, y_name = ("periods per turn of the table", "mdps") if over_turn else ("frequency, Hz", "mdps/√Hz")
    over = " over the turn of the table" if over_turn else ""
    title = f"Spectrum of the residual{over}\nline: mean, band: lowest to highest, dashed: {reference}"
    logarithmic(axes)
    axes.set(xlabel=x, ylabel=y_name, title=title)
    axes.legend(frameon=False, ncols=3, loc="upper right")
    return figure


def of_spectra(comparison: Comparison) -> dict[str, tuple[str, Figure]]:
    """The spectra that a comparison has, over the frequency and over the turn: {file name: (title, figure)}."""
    titles = {"spectrum": ("Spectrum", Frequency.name), "orders": ("Spectrum over the turn of the table", Order.name)}
    drawn = {name: (title, spectra(comparison, against)) for name, (title, against) in titles.items()}
    return {name: (title, figure) for name, (title, figure) in drawn.items() if figure is not None}


def allan(comparison: Comparison) -> Figure:
    """Allan deviation of the residual and of the model's noise."""
    figure, axes = framed(8, 3.2)
    rate_hz = comparison.fit.session.sample_rate_hz
    predictions = list(heldout.fitted(comparison.fit))
    for name, fitted in comparison.fit.axes.items():
        series = [p.residual_dps for p in predictions if AXES[p.axis] == name]
        if not series:
            continue
        tau_s, deviation = allan_deviation(series, rate_hz)
        axes.plot(tau_s, deviation * 1e3, "o-", ms=3, lw=0.8, color=AXIS_COLOURS[name], label=name)
        axes.plot(tau_s, model_deviation(tau_s, fitted.noise, rate_hz) * 1e3, "--", lw=1.2, color=AXIS_COLOURS[name])
    logarithmic(axes)
    axes.set(xlabel="averaging time, s", ylabel="mdps", title="Allan deviation of the residual (dashed: the noise model)")
    axes.legend(frameon=False, ncols=3)
    return figure


def levels(comparison: Comparison) -> Figure:
    """Excess over the floor for each axis."""
    figure, axes = framed(8, 1.9)
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


def waterfall(labels: Sequence[str], excess_dps: Sequence[float], floor_dps: float) -> Figure:
    """Held-out excess (deg/s) of the given model and after each step, as falling bars over the noise floor's level."""
    figure, axes = framed(8, 0.9 + 0.45 * len(labels))
    values = np.asarray(excess_dps) * 1e3
    for i, value in enumerate(values):
        axes.barh(i, value, color=GREY if i == 0 else BLUE, height=0.6, label="left over" if i == 1 else None)
        before = values[i - 1] if i else value
        if before > value:
            removed = "removed by the step" if i == 1 else None
            axes.barh(i, before - value, left=value, color=BLUE, alpha=0.2, height=0.6, label=removed)
        told = f"{before:.2f} → {value:.2f}" if i else f"{value:.2f}"
        axes.text(max(value, before), i, f"  {told}", va="center", fontsize=9)
    axes.axvline(floor_dps * 1e3, color=ORANGE, lw=1, ls="--", label="the noise floor itself")
    axes.set(yticks=range(len(labels)), yticklabels=labels, xlabel="held-out excess error over the noise floor, mdps")
    axes.invert_yaxis()
    axes.margins(x=0.12)
    axes.legend(frameon=False, fontsize=9, loc="lower right", bbox_to_anchor=(1, 1), ncols=3)
    return figure


def calibration_errors(errors: Mapping[str, Mapping[float, tuple[float, float]]], title: str) -> Figure:
    """Mean absolute error of scale and bias against seconds, one line for each method.

    ``errors`` maps method and seconds to (scale, bias_dps).
    """
    figure = new_figure(8, 3.4, dpi=110)
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
    """Every figure of a comparison: {file name: (title, figure)}."""
    drawn = {"levels": ("Excess over the floor", levels(comparison))}
    if comparison.where:
        first = comparison.where[0]
        figure = residual_against(comparison, first)
        if figure is not None:
            drawn["where"] = (f"Where it fails most: on {first.axis}, against {first.against.replace('_', ' ')}", figure)
    return drawn | {
        "time": ("Residual against time", residual_against_time(comparison)),
        **of_spectra(comparison),
        "allan": ("Allan deviation", allan(comparison)),
    }


def save(comparison: Comparison, folder: Path) -> None:
    """Write every figure of a comparison as PNG into a folder, which is created if necessary."""
    try:
        folder.mkdir(exist_ok=True)
        for name, (_, figure) in of_comparison(comparison).items():
            figure.savefig(folder / f"{name}.png")
    except OSError as error:
        raise InputError(f"{folder}: {error.strerror}") from None


def png_data(figure: Figure) -> str:
    """The figure as a data URL of a PNG, which is smaller than SVG for many points."""
    import base64

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
