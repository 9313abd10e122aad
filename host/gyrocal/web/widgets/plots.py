"""The plots of a comparison: timeline, folds, spectrum, Allan deviation. Only data on the screen are sent."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gyrocal.present.bins import Binned, binned
from gyrocal.present.decimate import Pyramid
from gyrocal.units import MDPS, RateUnit, unit_of
from gyrocal.variables.rate import Rate
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.charts import Options, Palette
from gyrocal.web.state.traces import Traces
from gyrocal.web.values.residual_plots import Panel, panels
from gyrocal.web.values.views import AXES, RunView

if TYPE_CHECKING:
    from gyrocal.present.spectra import Curve

STRETCHES = 700
BINS = 48
MOST_LINES = 100
"""Recordings beyond this are not all drawn, as the legend then says."""
FEW = 12
"""Curves with fewer points than this show each point."""
SINGLE = 300
"""Traces with fewer samples than this on the screen show each sample."""
LEAST_RATE_DPS = 5.0
"""A residual is a part of a rate that is faster than this."""
MOST_BOUNDS = 60
MOST_NAMED = 20
NAME_PX = 60
"""Width of the page for each run from which on the runs are named."""
LEGEND: Options = {"left": "auto", "right": 270}
"""The place of a legend beside the buttons, and, in a narrow chart, on a line of its own."""
LEGEND_ALONE: Options = {"left": 12, "right": 12}
LINE_PX = 18

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

    @property
    def _above(self) -> RateUnit:
        """The unit of the readings, less the true rate, and of the model."""
        return self._unit(self.traces.measured)

    @property
    def _below(self) -> RateUnit:
        """The unit of the residual."""
        return MDPS if self.traces.residual is None else self._unit(self.traces.residual)

    def _unit(self, pyramid: Pyramid) -> RateUnit:
        return unit_of([pyramid.largest([AXES.index(axis) for axis in self.axes])])

    def options(self, window: Window, x_name: str) -> Options:
        p = self.palette
        above, below = self._above.name, self._below.name
        across: Options = {"min": 0, "max": self.total_s, "scale": False}
        zoom = {"filterMode": "none", "start": window[0], "end": window[1], "throttle": 40}
        slider = {
            "type": "slider", "height": 16, "bottom": 6, "showDataShadow": False, "textStyle": {"color": p.dim},
            "borderColor": p.line, "labelFormatter": "", "brushSelect": False,
        }  # fmt: skip
        grids, titles = [charts.grid(bottom=62)], [charts.title(p, f"measured, less the true rate, {above}", 8)]
        kinds = ["measured"]
        if self.modelled:
            grids = [charts.grid(), charts.grid(top="56%", bottom=62)]
            titles = [
                charts.title(p, f"measured and modelled, less the true rate, {above}", 8),
                charts.title(p, f"left over: measured less modelled, {below}", "51%"),
            ]
            kinds = ["measured", "model", "left over"]
        wide, narrow = ({"height": "38%"}, {"height": "30%"}) if self.modelled else ({}, {})
        last = len(grids) - 1
        zoom["xAxisIndex"] = list(range(len(grids)))
        labels = {"showMinLabel": False, "showMaxLabel": False}
        return charts.base(
            p,
            grid=grids,
            legend=charts.legend(p, self._entries(kinds)),
            media=charts.fitting(
                {"legend": {**LEGEND, "top": 4}, "grid": [{"top": 30, **wide}], "yAxis": _ticks(5, len(grids))},
                {
                    "legend": {**LEGEND_ALONE, "top": 8 + LINE_PX}, "grid": [{"top": 30 + LINE_PX, **narrow}],
                    "yAxis": _ticks(3, len(grids)),
                },
            ),
            title=titles, tooltip=charts.tooltip(p, [above, below], "s"), axisPointer={"link": [{"xAxisIndex": "all"}]},
            toolbox=charts.BOX_OF_TIME, units=[above, below],
            xAxis=[
                *(charts.axis(p, gridIndex=k, label={"show": False}, **across) for k in range(last)),
                charts.axis(p, x_name, gridIndex=last, nameGap=20, label=labels, **across),
            ],
            yAxis=[charts.axis(p, gridIndex=k) for k in range(len(grids))],
            dataZoom=[{"type": "inside", **zoom}, {**zoom, **slider}],
            series=self.series(window),
        )

    def _entries(self, kinds: Sequence[str]) -> list[Options]:
        return [charts.entry(f"{axis} {kind}", "thick" if kind == "model" else "line") for axis in self.axes for kind in kinds]

    def series(self, window: Window) -> list[Options]:
        """The traces of one axis or of all three within the window, each as filled extremes and a line through the means."""
        p = self.palette
        modelled, residual = self.traces.modelled, self.traces.residual
        above, below = self._above, self._below
        out = []
        for axis in self.axes:
            i, colour, alone = AXES.index(axis), p.axes[axis], len(self.axes) == 1
            measured = self._seen(self.traces.measured, i, window, above)
            out += self._trace(f"{axis} measured", measured, p.dim if alone else colour)
            if modelled is not None and residual is not None:
                model = p.ink if alone else colour
                out += self._trace(f"{axis} model", self._seen(modelled, i, window, above), model, style={"width": 2})
                out += self._trace(f"{axis} left over", self._seen(residual, i, window, below), colour, on=1)
        out[-2]["markLine"] = self._bounds()
        return out

    @staticmethod
    def _trace(name: str, seen: Seen, colour: str, *, on: int = 0, style: Options | None = None) -> list[Options]:
        few = len(seen.line) < SINGLE
        line = charts.line(name, seen.line, colour, on=on, style=style, showSymbol=few, symbolSize=4)
        return [line, charts.band(name, seen.band, colour, 0.3, on=on)]

    def _bounds(self) -> Options:
        """The boundaries between recordings."""
        p = self.palette
        data, at = [], 0.0
        style = {"color": p.dim, "fontSize": 10, "position": "insideStartTop", "rotate": 0, "align": "left"}
        for _, run in self.runs if len(self.runs) <= MOST_BOUNDS else []:
            name = f"{'▲' if run.face == 'up' else '▼'} {run.scenario}"
            named = f"() => innerWidth > {NAME_PX * len(self.runs)} ? {json.dumps(name)} : ''"
            label = {**style, "show": len(self.runs) <= MOST_NAMED, ":formatter": named}
            data.append({"xAxis": round(at, 3), "label": label})
            at += run.seconds
        return charts.marks(p, data, p.dim)

    def _seen(self, pyramid: Pyramid, axis: int, window: Window, unit: RateUnit) -> Seen:
        """The visible part of one trace in a unit, with a gap between recordings."""
        low, high = (w / 100 * self.total_s for w in window)
        filled: list[list[float]] = []
        line: list[Any] = []
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
            s = pyramid.window(axis, run.first + start, run.first + stop, max(2, round(STRETCHES * share)))
            first, last = (begins + t_s[(rows - run.first).astype(np.intp)] for rows in (s.first, s.last))
            there = ~np.isnan(s.mean)
            if np.any(s.first != s.last):
                filled += _rows(first[there], last[there], s.low[there] * unit.per_dps, s.high[there] * unit.per_dps)
            if there.any():
                line += [*_rows((first[there] + last[there]) / 2, s.mean[there] * unit.per_dps), [round(at, 4), None]]
        return Seen(filled, line)


class Seen(NamedTuple):
    """The visible part of a trace: intervals [x from, x to, lowest, highest], and a line through the means."""

    band: list[list[float]]
    line: list[Any]


def _rows(*columns: Any) -> list[list[float]]:
    return np.column_stack(columns).round(6).tolist()


@dataclass(frozen=True)
class By:
    """How the residual is drawn: each recording about its own mean, or as a part of the rate in the unit ``part``."""

    about_means: bool = False
    part: RateUnit | None = None

    @property
    def words(self) -> str:
        """What a title says of it."""
        return ", each recording about its own mean" if self.about_means else ""

    def drawn(self, points: dict[str, Any], axis: str) -> Any:
        """The residual of an axis [blocks], or its part of the rate where the rate is fast enough."""
        y = points[axis]
        if self.part is not None:
            rate = points[next(panel for panel in panels() if panel.name == Rate.name).key(axis)]
            y = np.where(np.abs(rate) > LEAST_RATE_DPS, y, np.nan) / np.where(rate == 0, np.nan, rate)
        return _about_means(y, points["run"]) if self.about_means else y


AS_IS = By()


def folded(
    p: Palette, points: dict[str, Any], panel: Panel, runs: Sequence[int], axes: Sequence[str], by: By = AS_IS
) -> Options:
    """Means of the residual against a variable: a thin line for each recording, a thick line with twice its error for all."""
    points = points | {axis: by.drawn(points, axis) for axis in axes}
    mine = np.isin(points["run"], runs)
    found = {axis: binned(points[panel.key(axis)][mine], points[axis][mine], BINS, points["run"][mine]) for axis in axes}
    unit = by.part or unit_of(float(v) for one in found.values() for v in one.mean)
    shown = _spread_over(runs, MOST_LINES) if len(runs) > 1 else []
    each = "each recording" if len(shown) == len(runs) else f"{len(shown)} of {len(runs)} recordings"
    xs, ys = [], []
    series: list[Options] = []
    for k, axis in enumerate(axes):
        one = found[axis]
        x, mean, se = one.centre, one.mean * unit.per_dps, one.se * unit.per_dps
        label: Options = {"show": k == len(axes) - 1}
        place = _across(panel, one)
        if "min" in place and panel.variable.period is None:
            label |= {"showMinLabel": False, "showMaxLabel": False}
        if panel.variable.marks:
            label[":formatter"] = charts.named(panel.variable.marks)
        xs.append(charts.axis(p, panel.label if label["show"] else "", gridIndex=k, nameGap=22, label=label, **place))
        ys.append(charts.axis(p, gridIndex=k))
        ends = _ends(points[panel.key(axis)][mine])
        for i in shown:
            there = np.isfinite(one.of_runs[i]) if i < len(one.of_runs) else np.zeros(x.size, dtype=bool)
            dotted = int(there.sum()) < FEW
            few = {"showSymbol": dotted, "symbolSize": 7, "lineStyle": {"opacity": 0.35}}
            pairs = _broken(ends, x[there], one.of_runs[i][there] * unit.per_dps, dotted=dotted) if there.any() else []
            series.append(charts.line(each, pairs, p.axes[axis], on=k, style={"opacity": 0.35}, **few))
        few = {"showSymbol": x.size < FEW, "symbolSize": 6}
        pairs = _broken(ends, x, mean, se, dotted=x.size < FEW)
        series.append(charts.line("mean of all", pairs, p.ink, on=k, style={"width": 2.2}, **few))
        series.append(charts.band(WITHIN, _rows(one.low, one.high, mean - 2 * se, mean + 2 * se), p.ink, 0.18, on=k))
    entries = [charts.entry("mean of all", "line"), charts.entry(WITHIN, "band", 0.3)]
    entries += [charts.entry(each, "line", 0.35)] if shown else []
    grids = [charts.grid() for _ in axes]
    titles = [charts.title(p, f"{axis}: left over{by.words}, means, {unit.name}", 0) for axis in axes]
    return charts.base(
        p, grid=grids, title=titles, xAxis=xs, yAxis=ys, series=series, dataZoom=_zoom(len(axes)), toolbox=charts.BOX,
        units=[unit.name for _ in axes],
        legend=charts.legend(p, entries, top=0), axisPointer={"link": [{"xAxisIndex": "all"}]},
        media=charts.fitting(_stacked(len(axes), 6) | {"legend": LEGEND}, _stacked(len(axes), 13) | {"legend": LEGEND_ALONE}),
        tooltip=charts.tooltip(p, [unit.name], charts.unit_in(panel.label), panel.variable.marks),
    )  # fmt: skip


def _across(panel: Panel, found: Binned) -> Options:
    """The ends and ticks of the horizontal axis, with room beside a few values, as those of a face."""
    x, period = found.centre, panel.variable.period
    if period is not None:
        return {"max": period, "min": 0, "interval": period / 8}
    if not x.size or x.size >= charts.FEW:
        return {}
    if panel.variable.marks:  # the ticks begin at the end of the axis
        return {"min": float(x[0]) - 1, "max": float(x[-1]) + 1, "interval": 1}
    space = 0.25 * float(np.ptp(x)) or 1.0
    return {"min": float(x[0]) - space, "max": float(x[-1]) + space}


def _spread_over(runs: Sequence[int], most: int) -> list[int]:
    """At most so many runs, drawn at random but always the same, because faces and rates often alternate."""
    drawn = np.random.default_rng(0).permutation(len(runs))[:most]
    return [runs[k] for k in np.sort(drawn)]


WITHIN = "twice the mean's error"


def _about_means(y: Any, run: Any) -> Any:
    """Values [n] less the mean of their run [n]."""
    known = np.isfinite(y)
    total, count = np.bincount(run[known], y[known], run.max() + 1), np.bincount(run[known], minlength=run.max() + 1)
    return y - (total / np.maximum(count, 1))[run]


def _stacked(count: int, top: float) -> Options:
    """The places of plots one below another and of their titles, from ``top`` % of the chart's height on."""
    step = (94 - top) / count
    return {
        "grid": [{"top": f"{top + k * step:.2f}%", "height": f"{step - 8:.2f}%"} for k in range(count)],
        "title": [{"top": f"{top + k * step - 4.5:.2f}%"} for k in range(count)],
        "yAxis": _ticks(5 if count == 1 else 3, count),
    }


def _ends(x: Any) -> tuple[float, float]:
    """The lowest and the highest of values [n]; 0 and 1 if there are none."""
    there = x[np.isfinite(x)]
    return (float(there.min()), float(there.max())) if there.size else (0.0, 1.0)


def _broken(ends: tuple[float, float], *columns: Any, dotted: bool) -> list[Any]:
    """A line through the means of bins between two ends, without strokes over stretches that hold no values.

    ``columns`` are the bins' centres, the means and, if they are known, their errors. Means that are ``dotted`` need no stroke.
    """
    return charts.strokes(_pairs(*columns), (ends[1] - ends[0]) / BINS or 1.0, alone=not dotted)


def curves(
    p: Palette, found: dict[str, Curve], axes: Sequence[str], what: str, per: str, expected: str, x_name: str,
    marked: Sequence[tuple[float, float, str]] = (), seen: tuple[float, float] | None = None,
) -> Options:  # fmt: skip
    """A spectrum or the Allan deviation of the residual, with the curve of noise alone.

    ``what`` is the quantity, and ``per`` what stands behind its unit, as "/√Hz".
    ``marked`` are findings as (lowest x, highest x, words). ``seen`` is the part of the horizontal axis that is shown first.
    """
    series, xs, ys = [], [], []
    entries: list[Options] = []
    unit = unit_of(v for axis in axes if axis in found for v in (*found[axis].y, *found[axis].high))
    factor = unit.per_dps
    for axis in axes:
        if axis not in found:
            continue
        c = found[axis]
        names = f"{axis} left over", f"{axis} {expected}"
        entries += [charts.entry(names[0], "line"), charts.entry(names[1], "dashed")]
        low = np.maximum(np.array(c.low) * factor, 1e-7)  # a logarithmic axis has no zero
        rows = _rows(c.first, c.last, low, np.array(c.high) * factor) if c.low else []
        series.append(charts.line(names[0], _pairs(c.x, np.array(c.y) * factor), p.axes[axis], style={"width": 1.4}))
        series.append(charts.band(names[0], _spread(c, rows), p.axes[axis], 0.3))
        dashed = {"width": 2, "type": "dashed"}
        series.append(charts.line(names[1], _pairs(c.x, np.array(c.expected) * factor), p.ink, style=dashed))
        xs += c.x
        ys += [factor * v for v in (*c.y, *c.high)]
    if series and marked:
        lines = [_mark(p, (low * high) ** 0.5, words) for low, high, words in marked]
        areas = [[{"xAxis": low}, {"xAxis": high}] for low, high, _ in marked if high > low]
        shade = {"color": p.bad, "opacity": 0.12}
        series[0]["markLine"] = charts.marks(p, lines, p.bad, "solid")
        series[0]["markArea"] = {"silent": True, "animation": False, "itemStyle": shade, "data": areas}
    highest = max(ys, default=1.0)
    zoom = _zoom(1)
    if seen is not None and xs:  # the chart ignores a part that reaches beyond its axis
        zoom[0].update(startValue=max(seen[0], min(xs)), endValue=min(seen[1], max(xs)))
    shown, x_unit = f"{unit.name}{per}", x_name.rsplit(", ", 1)[1]
    return charts.base(
        p,
        legend=charts.legend(p, entries), tooltip=charts.tooltip(p, [shown], x_unit),
        media=charts.fitting(
            {"legend": {**LEGEND, "top": 4}, "grid": {"top": 34}},
            {"legend": {**LEGEND_ALONE, "top": 8 + LINE_PX}, "grid": {"top": 34 + LINE_PX}},
        ),
        title=charts.title(p, f"{what}, {shown}", 8), grid=charts.grid(right=24, bottom=48), series=series, dataZoom=zoom,
        xAxis=charts.logarithmic(p, xs, x_name), toolbox=charts.BOX, units=[shown],
        yAxis=charts.logarithmic(p, [v for v in ys if v > 1e-4 * highest]),
    )  # fmt: skip


def _spread(curve: Curve, rows: list[list[float]]) -> list[list[float]]:
    """The intervals that hold more than one value."""
    return [row for row, low, high in zip(rows, curve.low, curve.high, strict=True) if high > low] if rows else []


def _mark(p: Palette, x: float, words: str) -> Options:
    return {"xAxis": x, "label": {"formatter": words, "color": p.bad, "position": "insideEndTop"}}


def _ticks(about: int, plots: int) -> list[Options]:
    """About so many intervals on the vertical axis of each plot, so that their numbers stand apart."""
    return [{"splitNumber": about}] * plots


def _zoom(grids: int) -> list[Options]:
    return [{"type": "inside", "xAxisIndex": list(range(grids)), "filterMode": "none"}]


def _pairs(*values: Any) -> list[list[float]]:
    columns = (np.asarray(v, float).round(9).tolist() for v in values)
    return [list(pair) for pair in zip(*columns, strict=True)]
