"""The plots of a comparison: timeline, folds, spectrum, Allan deviation. Only data on the screen are sent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.web import charts
from gyrocal.web.against import Panel
from gyrocal.web.charts import Options, Palette
from gyrocal.web.decimate import Pyramid, binned, thinned
from gyrocal.web.traces import Traces
from gyrocal.web.views import AXES, Curve, RunView

STRETCHES = 700
BINS = 48
MOST_LINES = 40
FEW = 12
"""Curves with fewer points than this show each point."""
MOST_BOUNDS = 60
MOST_NAMED = 20
LEGEND_RIGHT = 130

Window = tuple[float, float]
"""The ends of the visible part of the timeline, in per cent."""


@dataclass(frozen=True)
class Timeline:
    """Recordings one after another: measured and modelled above, the residual below. Without a model only measured."""

    traces: Traces
    runs: Sequence[tuple[int, RunView]]
    axes: Sequence[str]
    palette: Palette

    @property
    def total_s(self) -> float:
        return round(sum(run.seconds for _, run in self.runs), 3)

    @property
    def modelled(self) -> bool:
        return self.traces.modelled is not None

    def options(self, window: Window, x_name: str) -> Options:
        p = self.palette
        across: Options = {"min": 0, "max": self.total_s, "scale": False}
        zoom = {"filterMode": "none", "start": window[0], "end": window[1], "throttle": 40}
        slider = {
            "type": "slider", "height": 16, "bottom": 6, "showDataShadow": False, "textStyle": {"color": p.dim},
            "borderColor": p.line, "labelFormatter": "", "brushSelect": False,
        }  # fmt: skip
        grids, titles = [charts.grid(top=30, bottom=62)], [charts.title(p, "measured, less the true rate, mdps", 8)]
        kinds = ["measured"]
        if self.modelled:
            grids = [charts.grid(top=30, height="38%"), charts.grid(top="56%", bottom=62)]
            titles = [
                charts.title(p, "measured and modelled, less the true rate, mdps", 8),
                charts.title(p, "left over: measured less modelled, mdps", "51%"),
            ]
            kinds = ["measured", "model"]
        last = len(grids) - 1
        zoom["xAxisIndex"] = list(range(len(grids)))
        labels = {"showMinLabel": False, "showMaxLabel": False}
        return charts.base(
            p,
            grid=grids,
            legend=charts.legend(p, [f"{axis} {kind}" for axis in self.axes for kind in kinds], right=LEGEND_RIGHT, top=4),
            title=titles,
            xAxis=[
                *(charts.axis(p, gridIndex=k, label={"show": False}, **across) for k in range(last)),
                charts.axis(p, x_name, gridIndex=last, nameGap=20, label=labels, **across),
            ],
            yAxis=[charts.axis(p, gridIndex=k) for k in range(len(grids))],
            dataZoom=[{"type": "inside", **zoom}, {**zoom, **slider}],
            series=self.series(window),
        )

    def series(self, window: Window) -> list[Options]:
        """The curves of one axis or of all three, within the window."""
        p = self.palette
        modelled, residual = self.traces.modelled, self.traces.residual
        out = []
        for axis in self.axes:
            i, colour, alone = AXES.index(axis), p.axes[axis], len(self.axes) == 1
            faint = {"opacity": 0.55 if alone else 0.35}
            measured = self._seen(self.traces.measured, i, window)
            out.append(charts.line(f"{axis} measured", measured, p.dim if alone else colour, style=faint))
            if modelled is not None and residual is not None:
                line, left = self._seen(modelled, i, window), self._seen(residual, i, window)
                out.append(charts.line(f"{axis} model", line, colour, style={"width": 2.2}))
                out.append(charts.line(f"{axis} left over", left, colour, on=1))
        out[-1]["markLine"] = self._bounds()
        return out

    def _bounds(self) -> Options:
        """The boundaries between recordings."""
        p = self.palette
        data, at = [], 0.0
        style = {"color": p.dim, "fontSize": 10, "position": "insideStartTop", "rotate": 0, "align": "left"}
        for _, run in self.runs if len(self.runs) <= MOST_BOUNDS else []:
            name = f"{'▲' if run.face == 'up' else '▼'} {run.scenario}"
            label = {**style, "show": len(self.runs) <= MOST_NAMED, "formatter": name}
            data.append({"xAxis": round(at, 3), "label": label})
            at += run.seconds
        return charts.marks(p, data, p.dim)

    def _seen(self, pyramid: Pyramid, axis: int, window: Window) -> list[list[float | None]]:
        """The visible part of one trace in mdps, with a gap between recordings."""
        low, high = (w / 100 * self.total_s for w in window)
        points: list[list[float | None]] = []
        at = 0.0
        for _, run in self.runs:
            begins, at = at, at + run.seconds
            if at < low or begins > high:
                continue
            t_s = self.traces.t_s[run.first : run.first + run.rows]
            start = max(0, int(np.searchsorted(t_s, low - begins)) - 1)
            stop = min(run.rows, int(np.searchsorted(t_s, high - begins)) + 1)
            if stop <= start:
                continue
            share = (min(at, high) - max(begins, low)) / max(high - low, 1e-9)
            stretches = max(2, round(STRETCHES * share))
            rows, values = pyramid.window(axis, run.first + start, run.first + stop, stretches)
            x = begins + t_s[(rows - run.first).astype(np.intp)]
            there = ~np.isnan(values)
            points += [
                list(pair) for pair in zip(x[there].round(4).tolist(), (values[there] * 1e3).round(2).tolist(), strict=True)
            ]
            points.append([round(at, 4), None])
        return points


def folded(p: Palette, points: dict[str, Any], panel: Panel, runs: Sequence[int], axes: Sequence[str]) -> Options:
    """Means of the residual against a variable: a thin line for each recording, a thick line with twice its error for all."""
    shown = runs[:: max(1, -(-len(runs) // MOST_LINES))] if len(runs) > 1 else []
    mine = np.isin(points["run"], runs)
    height = 88 / len(axes) - 5
    grids, titles, xs, ys = [], [], [], []
    series: list[Options] = []
    for k, axis in enumerate(axes):
        x, y = points[panel.key(axis)], points[axis] * 1e3
        top = 6 + k * (height + 5)
        grids.append(charts.grid(top=f"{top}%", height=f"{height - 3}%"))
        titles.append(charts.title(p, f"{axis}: left over, means, mdps", f"{top - 4.5}%"))
        period = panel.variable.period
        last: Options = {} if period is None else {"max": period, "min": 0, "interval": period / 8}
        bottom = k == len(axes) - 1
        xs.append(charts.axis(p, panel.label if bottom else "", gridIndex=k, nameGap=22, label={"show": bottom}, **last))
        ys.append(charts.axis(p, gridIndex=k))
        for i in shown:
            one = points["run"] == i
            cx, cy, _ = binned(x[one], y[one], BINS)
            few = {"showSymbol": cx.size < FEW, "symbolSize": 7}
            series.append(charts.line("a recording", _pairs(cx, cy), p.axes[axis], on=k, style={"opacity": 0.35}, **few))
        cx, cy, se = binned(x[mine], y[mine], BINS)
        band: Options = {"stack": f"band {k}", "stackStrategy": "all", "on": k, "style": {"opacity": 0}}
        filled: Options = {"areaStyle": {"color": p.ink, "opacity": 0.15}}
        series.append(charts.line("twice the mean's error", _pairs(cx, cy - 2 * se), p.ink, **band))
        series.append(charts.line("twice the mean's error", _pairs(cx, 4 * se), p.ink, **band, **filled))
        series.append(charts.line("mean", _pairs(cx, cy), p.ink, on=k, style={"width": 2.2}, showSymbol=cx.size < FEW))
    return charts.base(p, grid=grids, title=titles, xAxis=xs, yAxis=ys, series=series, dataZoom=_zoom(len(axes)))


def curves(
    p: Palette, found: dict[str, Curve], axes: Sequence[str], what: str, expected: str, x_name: str,
    lines: Sequence[dict[str, Any]] = (),
) -> Options:  # fmt: skip
    """Spectrum or Allan deviation of the residual, with the curve of noise alone. ``lines`` are findings to mark."""
    series, names = [], []
    for axis in axes:
        if axis not in found:
            continue
        x, y, level = (np.array(v) for v in (found[axis].x, found[axis].y, found[axis].expected))
        names += [f"{axis} left over", f"{axis} {expected}"]
        series.append(charts.line(names[-2], _pairs(x, y * 1e3), p.axes[axis]))
        series.append(
            charts.line(names[-1], _pairs(*thinned(x, level * 1e3, 300)), p.ink, style={"width": 2, "type": "dashed"})
        )
    data = [
        {"xAxis": float(f["note"].rsplit(" at ", 1)[1].split()[0]), "label": {"formatter": f["note"], "color": p.bad}}
        for f in lines
        if f["axis"] in axes and " at " in f["note"]
    ]
    if series and data:
        series[0]["markLine"] = charts.marks(p, data, p.bad, "solid")
    return charts.base(
        p,
        legend=charts.legend(p, names, right=18, top=4), tooltip=charts.tooltip(p), title=charts.title(p, what, 8),
        grid=charts.grid(right=24, top=34, bottom=48), series=series, dataZoom=_zoom(1),
        xAxis=charts.axis(p, x_name, kind="log", scale=False, min="dataMin", max="dataMax"),
        yAxis=charts.axis(p, kind="log", scale=False),
    )  # fmt: skip


def _zoom(grids: int) -> list[Options]:
    return [{"type": "inside", "xAxisIndex": list(range(grids)), "filterMode": "none"}]


def _pairs(x: Any, y: Any) -> list[list[float]]:
    columns = (np.asarray(v, float).round(6).tolist() for v in (x, y))
    return [list(pair) for pair in zip(*columns, strict=True)]
