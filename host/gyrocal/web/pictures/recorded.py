"""The columns of a recording over time, run after run: what a file would become, and a session by gravity with its rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gyrocal.web.pictures import charts
from gyrocal.web.pictures.charts import Options, Palette

if TYPE_CHECKING:
    from gyrocal.recording.session import Session

STRETCHES = 600
MOST_NAMED = 4
STRIP_PX, REST_PX = 150, 34
"""Height of a strip, and of the words above and below all of them."""


@dataclass(frozen=True)
class Trace:
    """A column: intervals [from, to, lowest, highest] and a line through the means [time, mean], s and the strip's unit."""

    column: str
    band: list[list[float]]
    line: list[list[float | None]]


@dataclass(frozen=True)
class Strip:
    """The columns of one quantity."""

    label: str
    traces: list[Trace]


@dataclass(frozen=True)
class Recorded:
    """Strips over one time in s, the beginnings of the runs with their words, and the rests from and to."""

    strips: list[Strip]
    runs: list[tuple[float, str]]
    total_s: float
    rests: list[tuple[float, float]]

    @property
    def height_px(self) -> int:
        """The height that the strips need."""
        return REST_PX + STRIP_PX * len(self.strips)


def recorded(session: Session, rests: Sequence[tuple[int, float, float]] = ()) -> Recorded:
    """The columns of a session; ``rests`` are the index of a run, begin and end in it, s."""
    from gyrocal.present.preview import ROWS

    starts_s, runs, total_s = [], [], 0.0
    for run in session.runs:
        known = "a reference" if run.table_rate_dps is None else f"{run.table_rate_dps:g} dps"
        on_table = "" if session.reference.kind == "gravity" else f", {run.face}, axis {run.axis}, {known}"
        starts_s.append(total_s)
        runs.append((round(total_s, 3), f"{run.file}{on_table}"))
        total_s += run.duration_s
    strips = []
    for label, columns in ROWS:
        traces = [_trace(session, starts_s, total_s, column) for column in columns]
        if there := [trace for trace in traces if trace.line]:
            strips.append(Strip(label, there))
    shaded = [(round(starts_s[run] + low, 3), round(starts_s[run] + high, 3)) for run, low, high in rests]
    return Recorded(strips, runs, round(total_s, 3), shaded)


def _trace(session: Session, starts_s: Sequence[float], total_s: float, column: str) -> Trace:
    import numpy as np

    from gyrocal.present.decimate import means

    band: list[list[float]] = []
    line: list[list[float | None]] = []
    for run, start_s in zip(session.runs, starts_s, strict=True):
        values = run.column(column)
        if values is None or not np.isfinite(values).any():
            continue
        t_s = start_s + run.t_s - run.t_s[0]
        stretches = max(2, round(STRETCHES * run.duration_s / total_s))
        starts = np.unique(np.linspace(0, values.size, stretches, endpoint=False).astype(np.intp))
        last = np.append(starts[1:], values.size) - 1
        low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
        middle, mean = (t_s[starts] + t_s[last]) / 2, means(values, starts)
        there = np.isfinite(mean)
        band += np.column_stack([t_s[starts], t_s[last], low, high])[there].round(5).tolist()
        line += [*np.column_stack([middle, mean])[there].round(5).tolist(), [round(float(t_s[-1]), 5), None]]
    return Trace(column, band, line)


def options(p: Palette, shown: Recorded) -> Options:
    """The strips, one below another, each as filled extremes and a line through the means; rests are shaded."""
    last = len(shown.strips) - 1
    tops = [34 + STRIP_PX * k for k in range(last + 1)]
    units = [charts.unit_in(strip.label) for strip in shown.strips]
    across: Options = {"min": 0, "max": shown.total_s, "scale": False}
    series: list[Options] = []
    for k, strip in enumerate(shown.strips):
        for trace, colour in zip(strip.traces, [*p.axes.values(), p.ink, p.bad, *p.methods], strict=False):
            series.append(charts.line(trace.column, trace.line, colour, on=k))
            series.append(charts.band(trace.column, trace.band, colour, 0.3, on=k))
        first = next(s for s in series if s["xAxisIndex"] == k)
        named = k == 0 and len(shown.runs) <= MOST_NAMED
        label = {"position": "insideStartTop", "rotate": 0, "align": "left", "color": p.dim, "fontSize": 10}
        bounds = [{"xAxis": at, "label": {**label, "show": named, "formatter": said}} for at, said in shown.runs]
        first["markLine"] = charts.marks(p, bounds, p.dim)
        areas = [[{"xAxis": low}, {"xAxis": high}] for low, high in shown.rests]
        first["markArea"] = {"silent": True, "itemStyle": {"color": p.dim, "opacity": 0.18}, "data": areas}
    return charts.base(
        p, series=series, units=units, toolbox=charts.BOX_OF_TIME, tooltip=charts.tooltip(p, units, "s"),
        axisPointer={"link": [{"xAxisIndex": "all"}]},
        dataZoom=[{"type": "inside", "disabled": True, "xAxisIndex": list(range(last + 1)), "filterMode": "none"}],
        title=[charts.title(p, strip.label, top - 16) for strip, top in zip(shown.strips, tops, strict=True)],
        legend=[
            charts.legend(p, [charts.entry(t.column, "line") for t in strip.traces], top=top - 18, right=16)
            for strip, top in zip(shown.strips, tops, strict=True)
        ],
        grid=[charts.grid(top=top, height=STRIP_PX - 40, right=16) for top in tops],
        xAxis=[
            charts.axis(p, "time, runs one after another, s" if k == last else "", gridIndex=k, nameGap=20,
                        label={"show": k == last, "showMinLabel": False, "showMaxLabel": False}, **across)
            for k in range(last + 1)
        ],
        yAxis=[charts.axis(p, gridIndex=k, splitNumber=3) for k in range(last + 1)],
    )  # fmt: skip
