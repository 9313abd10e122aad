"""A picture of a recording as it would be imported: each kind of column over time, run after run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gyrocal.present.figure import new_figure
from gyrocal.recording.session import Run, Session
from gyrocal.units import CELSIUS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROWS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("rate, dps", ("gx_dps", "gy_dps", "gz_dps", "rate_ref_dps", "ref_x_dps", "ref_y_dps", "ref_z_dps")),
    ("angle, deg", ("table_angle_deg", "ref_angle_deg")),
    ("quaternion", ("ref_qw", "ref_qx", "ref_qy", "ref_qz")),
    ("acceleration, g", ("ax_g", "ay_g", "az_g")),
    (f"temperature, {CELSIUS}", ("temp_c",)),
)
"""The unit of each row of axes, and the columns drawn there."""
POINTS = 4000
"""Largest number of samples of a run that are drawn, evenly spread."""


def preview(session: Session) -> Figure:
    """The figure: one row of axes for each kind of column that is there."""
    there = {name for run in session.runs for name in run.table.columns}
    rows = [(unit, [c for c in columns if c in there]) for unit, columns in ROWS if there & set(columns)]
    figure = new_figure(10, 1 + 2 * len(rows))
    grid = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    start_s = 0.0
    for run in session.runs:
        step = max(1, len(run) // POINTS)
        t_s = start_s + run.t_s[::step]
        for axes, (_, columns) in zip(grid, rows, strict=True):
            for color, name in enumerate(columns):
                values = run.column(name)
                if values is not None:
                    axes.plot(t_s, values[::step], color=f"C{color}", linewidth=0.7, label=name if start_s == 0 else None)
        said = f"{run.file}\n{run.face}, axis {run.axis}, {_true_rate(run)}"
        grid[0].annotate(said, (t_s[0], 1), xycoords=("data", "axes fraction"), fontsize=6, va="bottom")
        start_s += run.duration_s
        for axes in grid:
            axes.axvline(start_s, color="0.8", linewidth=0.7)
    for axes, (unit, _) in zip(grid, rows, strict=True):
        axes.set_ylabel(unit)
        axes.legend(loc="upper right", fontsize=7)
        axes.margins(x=0.01)
    grid[-1].set_xlabel("time, runs one after another, s")
    return figure


def _true_rate(run: Run) -> str:
    """What is known of the true rate, in a word or two."""
    if run.table_rate_dps is not None:
        return f"{run.table_rate_dps:g} dps"
    if run.turn_deg is not None:
        return f"{run.turn_deg:g} deg"
    return "a reference" if any(name.startswith(("rate_ref", "ref_")) for name in run.table.columns) else "rate not known"


def draw(session: Session, path: Path) -> None:
    """Write the picture as PNG, or in the format of the name's ending."""
    preview(session).savefig(path, dpi=120)
