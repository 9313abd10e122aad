"""ECharts options and colours: those of Okabe and Ito, which colour-blind people can distinguish, in light and dark shades."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gyrocal.units import unit_of

if TYPE_CHECKING:
    from gyrocal.web.values.views import Picture

Options = dict[str, Any]
Points = Sequence[Any]


@dataclass(frozen=True)
class Palette:
    ink: str
    dim: str
    line: str
    axes: Mapping[str, str]
    good: str
    bad: str
    methods: tuple[str, ...]
    face: str


LIGHT = Palette(
    "#1b1f24", "#5c6570", "#e4e8ec", {"x": "#C77E00", "y": "#009E73", "z": "#0072B2"}, "#009E73", "#D55E00",
    ("#8a929b", "#B0568C", "#E69F00", "#0072B2"), "#ffffff",
)  # fmt: skip
DARK = Palette(
    "#e8eaed", "#a0a8b3", "#333a43", {"x": "#E69F00", "y": "#2BC79B", "z": "#56B4E9"}, "#2BC79B", "#FF8A4C",
    ("#9aa3ad", "#E29AC4", "#E69F00", "#56B4E9"), "#1c2026",
)  # fmt: skip
FONT = "Roboto, system-ui, sans-serif"
METHODS = ("plain average", "network", "model at first", "model now")
SYMBOLS = ("rect", "triangle", "diamond", "circle")


def palette(dark: bool) -> Palette:
    return DARK if dark else LIGHT


def base(p: Palette, **more: Any) -> Options:
    """Options that all charts share. Its ``units``, one for each plot, are for the export; ECharts does not know them."""
    return {
        "animation": False,
        "backgroundColor": "transparent",
        "textStyle": {"fontFamily": FONT, "color": p.ink},
        **more,
    }


def axis(p: Palette, name: str = "", *, kind: str = "value", label: Options | None = None, **more: Any) -> Options:
    small = {"color": p.dim, "fontSize": 11, "hideOverlap": True}
    return {
        "type": kind, "name": name, "nameLocation": "middle", "nameGap": 26, "scale": True,
        "nameTextStyle": {"color": p.dim, "fontSize": 11}, "axisLabel": {**small, **(label or {})},
        "axisLine": {"onZero": False, "lineStyle": {"color": p.dim}}, "splitLine": {"lineStyle": {"color": p.line}},
        "axisTick": {"lineStyle": {"color": p.line}}, **more,
    }  # fmt: skip


PLAIN = "v => String(+Number(v).toPrecision(4))"
"""A tick's number in JavaScript, without digits that only a division has produced."""


def logarithmic(p: Palette, values: Sequence[float], name: str = "", **more: Any) -> Options:
    """A logarithmic axis that begins and ends at 1, 2 or 5 times a power of ten around the positive ``values``."""
    there = [v for v in values if v > 0] or [1.0, 10.0]
    ends = {"min": _plain(min(there), down=True), "max": _plain(max(there), down=False)}
    return axis(p, name, kind="log", scale=False, label={":formatter": PLAIN}, **ends, **more)


def _plain(value: float, *, down: bool) -> float:
    """The next number at or beyond ``value`` that is 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    steps = [m * power for m in (0.5, 1.0, 2.0, 5.0, 10.0)]
    fits = [s for s in steps if (s <= value * (1 + 1e-9) if down else s >= value * (1 - 1e-9))]
    return float(f"{(max(fits) if down else min(fits)):.3g}")


def line(name: str, data: Points, colour: str, *, on: int = 0, style: Options | None = None, **more: Any) -> Options:
    """A line in the grid ``on``."""
    return {
        "type": "line", "name": name, "data": data, "showSymbol": False, "animation": False, "silent": True,
        "xAxisIndex": on, "yAxisIndex": on, "lineStyle": {"color": colour, "width": 1, **(style or {})},
        "itemStyle": {"color": colour}, **more,
    }  # fmt: skip


INTERVAL = """(params, api) => {
    const low = api.coord([api.value(0), api.value(2)]), high = api.coord([api.value(1), api.value(3)]);
    const x = Math.round(low[0]), y = Math.round(high[1]);
    return {type: "rect", style: {fill: api.visual("color"), opacity: %g}, shape: {
        x, y, width: Math.max(1, Math.round(high[0]) - x), height: Math.max(1, Math.round(low[1]) - y)}};
}"""


def band(name: str, data: Points, colour: str, opacity: float, *, on: int = 0) -> Options:
    """Filled intervals [x from, x to, lowest, highest] in the grid ``on``. Nothing joins one interval to the next."""
    return {
        "type": "custom", "name": name, "data": data, "silent": True, "animation": False, "clip": True,
        "xAxisIndex": on, "yAxisIndex": on, "encode": {"x": [0, 1], "y": [2, 3]}, "tooltip": {"show": False},
        "itemStyle": {"color": colour}, "z": 1, ":renderItem": INTERVAL % opacity,
    }  # fmt: skip


def script(value: Any) -> str:
    """A chart's options as JavaScript. The value of a key that begins with a colon is JavaScript already."""
    if isinstance(value, dict):
        parts = (
            f"{json.dumps(k[1:])}:({v})" if k.startswith(":") and isinstance(v, str) else f"{json.dumps(k)}:{script(v)}"
            for k, v in value.items()
        )
        return "{" + ",".join(parts) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(map(script, value)) + "]"
    return json.dumps(value)


def words(lines: Sequence[str]) -> str:
    """Lines of text as one quoted property of an element of the page."""
    return json.dumps(", ".join(lines), ensure_ascii=False)


GAP = 2.5
"""Widths of a bin by which two means must be apart for the line between them to be left out."""


def strokes(pairs: Sequence[Sequence[float]], width: float, *, alone: bool) -> list[Any]:
    """A line through the means of bins of a ``width``, without strokes over stretches that hold no values.

    With ``alone``, a mean without neighbours, which no line reaches, is a stroke of its bin's width.
    """
    out: list[Any] = []
    for k, pair in enumerate(pairs):
        first = k == 0 or pair[0] - pairs[k - 1][0] > GAP * width
        last = k == len(pairs) - 1 or pairs[k + 1][0] - pair[0] > GAP * width
        if first and k:
            out.append([(pair[0] + pairs[k - 1][0]) / 2, None])
        single = alone and first and last
        out += [[pair[0] + end * width / 2, *pair[1:]] for end in (-1, 1)] if single else [list(pair)]
    return out


def grid(**place: Any) -> Options:
    """The fixed place of a plot in the chart."""
    return {"outerBoundsMode": "none", "left": 62, "right": 18, **place}


def title(p: Palette, text: str, top: Any, left: Any = 62) -> Options:
    style = {"color": p.dim, "fontSize": 12, "fontWeight": "normal"}
    return {"text": text, "left": left, "top": top, "padding": 0, "textStyle": style}


ICONS = {
    "line": "path://M0 0h16v2h-16z", "thick": "path://M0 0h16v4h-16z", "dashed": "path://M0 0h6v2h-6z M10 0h6v2h-6z",
    "dots": "circle", "band": "roundRect",
}  # fmt: skip


def entry(name: str, kind: str, opacity: float = 1.0) -> Options:
    """A legend's entry that looks as what it names: one of :data:`ICONS`, as faint as it is drawn."""
    return {"name": name, "icon": ICONS[kind], "itemStyle": {"opacity": opacity}}


def legend(p: Palette, entries: Sequence[Options], **more: Any) -> Options:
    """A legend of entries from :func:`entry`. Entries that find no room are reached by its arrows."""
    small = {"color": p.dim, "fontSize": 11, "lineHeight": 15}  # a lower line would cut the letters where it scrolls
    return {
        "type": "scroll", "data": list(entries), "textStyle": small, "itemWidth": 16, "itemHeight": 8,
        "inactiveColor": p.line, "pageIconColor": p.ink, "pageIconInactiveColor": p.line, "pageTextStyle": small,
        "pageIconSize": 10, **more,
    }  # fmt: skip


NARROW = 560
"""Width of a chart in px below which its legend has a line of its own."""


LEGEND_LINE_PX = 20
SHORT_LEGEND = 3
"""Methods whose names stand on one line on a phone."""


def fitting(wide: Options, narrow: Options) -> list[Options]:
    """The parts of a chart's options that depend on its width, which ECharts chooses by itself whenever that changes."""
    return [{"query": {"maxWidth": NARROW}, "option": narrow}, {"option": wide}]


def named(marks: Mapping[float, str]) -> str:
    """JavaScript that gives the word for a value that has one, and nothing for others."""
    return f"v => ({json.dumps({f'{value:g}': word for value, word in marks.items()})})[v] ?? ''"


def tooltip(p: Palette, units: Sequence[str] = (), x_unit: str = "", marks: Mapping[float, str] | None = None) -> Options:
    """A crosshair with the values of all lines at its place, each with the unit of its plot, or the only one of ``units``.

    ``marks`` are the words for values of the horizontal axis that have no number.
    """
    text = {"color": p.ink, "fontSize": 12}
    shown: Options = {"trigger": "axis", "backgroundColor": p.face, "borderColor": p.line, "textStyle": text, "confine": True}
    if units:
        x_unit, word = ("", named(marks)) if marks else (x_unit, "v => ''")
        label = {"backgroundColor": p.dim, ":formatter": f"o => ({word})(o.value) || {NUMBER} + ' {x_unit}'"}
        shown["axisPointer"] = {"type": "line", "label": label, "lineStyle": {"color": p.dim}}
        shown[":formatter"] = TOLD % (json.dumps(list(units)), word, x_unit)
    return shown


NUMBER = "(isNaN(o.value) ? o.value : String(+Number(o.value).toPrecision(5)))"
TOLD = """items => {
    const lines = items.filter(i => i.seriesType !== "custom" && i.value && i.value[1] !== null && i.color !== "transparent");
    if (!lines.length) return "";
    const units = %s, unit = i => units[i.axisIndex] || units[0], word = %s;
    const number = v => `<b>${+Number(v).toPrecision(4)}</b>`, own = i => i.value.length > 2 ? ` ± ${number(i.value[2])}` : "";
    const alike = i => lines.filter(o => o.seriesName === i.seriesName && o.axisIndex === i.axisIndex).map(o => o.value[1]);
    const told = lines.map(i => {
        const all = alike(i), many = all.length > 1 && Math.min(...all) < Math.max(...all);
        const value = many ? `(${all.length}) ${number(Math.min(...all))} to ${number(Math.max(...all))}` : number(i.value[1]);
        return `${i.marker}${i.seriesName} ${value}${own(i)} ${unit(i)}`;
    });
    const x = lines[0].name || word(lines[0].value[0]) || `${+Number(lines[0].value[0]).toPrecision(6)} %s`;
    return [x, ...new Set(told)].join("<br>");
}"""
"""The text beside the crosshair; a third number of a point is its error. What is transparent is not told. Of several lines of
one name their number and range are told."""


def unit_in(label: str) -> str:
    """The unit that an axis's label ends with; empty for a label that has none, or that lists values in its place."""
    parts = label.split(", ")
    return parts[1] if len(parts) == 2 else ""


def _box(y: bool) -> Options:
    zoom = {"filterMode": "none", "brushStyle": {"color": "rgba(128,128,128,0.25)"}, **({} if y else {"yAxisIndex": "none"})}
    return {"left": -60, "top": -60, "itemSize": 1, "feature": {"dataZoom": zoom}}


BOX, BOX_OF_TIME = _box(True), _box(False)
"""ECharts' box zoom. Its own icons lie outside of the chart, because a keyboard cannot reach them; buttons call it."""


def marks(p: Palette, data: Sequence[Options], colour: str, kind: str = "dotted") -> Options:
    """Vertical lines with labels."""
    style = {"color": colour, "type": kind, "width": 1}
    return {"silent": True, "symbol": "none", "animation": False, "lineStyle": style, "data": list(data)}


MOTION: Options = {":animation": "!matchMedia('(prefers-reduced-motion: reduce)').matches"}
"""Animation, unless the person has asked for none."""


FEW = 8
"""A picture against fewer values than this has room beside them."""
DASH: Options = {"showSymbol": True, "symbol": "rect", "symbolSize": [22, 3]}
"""A value of a curve between whose values nothing was measured."""


def hero(
    p: Palette, shown: Picture, left: Sequence[float], curve: Sequence[float], lines: Sequence[str],
    each: Sequence[tuple[float, float]] = (), added: bool = False,
) -> Options:  # fmt: skip
    """The residual's means and the effect's curve against the accused variable, with the band where the means should lie.

    ``lines`` are the words above the picture, and ``each`` the means of single recordings, mdps. With ``added`` the model has
    the effect, and the curve is where the means should lie now. The vertical
    axis is that of the residual without the effect, so that the picture shows the residual flatten when the effect is added.
    """
    factor = 1e-3 * (unit := unit_of(1e-3 * v for v in (*shown.left, *shown.curve))).per_dps
    left, curve, se = ([factor * v for v in values] for values in (left, curve, shown.se))
    each = [(x, factor * y) for x, y in each]
    low, high, step = _extent(shown, factor)
    moved: Options = {"animationDurationUpdate": 1100, "animationEasingUpdate": "cubicInOut", **MOTION}
    halves = [(b - a) / 2 for a, b in zip(shown.edges, shown.edges[1:], strict=False)]
    half = 0.02 * (shown.centres[-1] - shown.centres[0]) or 0.5 if shown.few else min(halves, default=0.5)
    filled = [
        [round(x - half, 6), round(x + half, 6), round(y - 2 * s, 6), round(y + 2 * s, 6)]
        for x, y, s in zip(shown.centres, curve, se, strict=True)
    ]
    names = [LEFT, AFTER if added else EFFECT, WITHIN_SE]
    through = [[round(x, 6), round(y, 6)] for x, y in zip(shown.centres, curve, strict=True)]
    through = through if shown.few else strokes(through, 2 * half, alone=True)
    dashes = DASH if shown.few else {}
    own = [_dots("each recording", each, p.dim, 0.5, z=1, **moved)] if each else []
    were = [(x, factor * y) for x, y in zip(shown.centres, shown.left, strict=True)] if added else []
    entries = [entry(names[0], "dots"), entry(names[1], "thick"), entry(names[2], "band", 0.35)]
    entries += [entry(s["name"], "dots", 0.5) for s in own]
    entries += [{**entry(BEFORE, "dots"), "itemStyle": {"color": p.bad, "opacity": 0.6}}] if added else []
    ends: Options = {"min": shown.edges[0], "max": shown.edges[-1]}
    if shown.few:
        space = 1 if shown.marks else 0.1 * (shown.centres[-1] - shown.centres[0])  # the ticks begin at the end of the axis
        ends = {"min": shown.centres[0] - space, "max": shown.centres[-1] + space, **({"interval": 1} if shown.marks else {})}
    formatter = named(shown.marks) if shown.marks else PLAIN
    plain: Options = {":formatter": formatter, "showMinLabel": False, "showMaxLabel": False}
    broken = [lines[0], *(part for text in lines[1:] for part in text.split(" · "))]
    return base(
        p, **moved,
        legend=legend(p, entries, left=54, right=12, type="plain", itemGap=8),
        media=fitting(_headed(p, lines, 1 + bool(own or were), len(broken)), _headed(p, broken, len(entries))),
        tooltip=tooltip(p, [unit.name], unit_in(shown.x_label), shown.marks), toolbox=BOX, units=[unit.name],
        grid=grid(left=54, right=16, bottom=40),
        xAxis=axis(p, shown.x_label, nameGap=22, label=plain, **ends),
        yAxis=axis(p, unit.name, nameGap=36, min=low, max=high, interval=step, scale=False, label={":formatter": PLAIN}),
        series=[
            {**line(names[1], through, p.axes[shown.axis], style={"width": 0 if shown.few else 2.5}), **moved, **dashes},
            _dots(names[0], list(zip(shown.centres, left, strict=True)), p.ink, symbolSize=6, **moved),
            band(names[2], filled, p.axes[shown.axis], 0.25),
            _dots(BEFORE, were, p.bad, 0.6, z=1, animation=False),
            *own,
        ],
    )  # fmt: skip


def _dots(name: str, pairs: Sequence[tuple[float, float]], colour: str, opacity: float = 1.0, **more: Any) -> Options:
    style = {"color": colour, "opacity": opacity}
    data = [[round(x, 6), round(y, 6)] for x, y in pairs]
    return {"type": "scatter", "name": name, "data": data, "symbolSize": 5, "silent": True, "itemStyle": style, **more}


LEFT, EFFECT, WITHIN_SE = "left over, means", "the effect, less what bias and scale take up", "± 2 standard errors"
AFTER, BEFORE = "where the means should lie now", "before it was added"
"""Names in the legend of an effect's picture, on the page and in the report."""


def _headed(p: Palette, lines: Sequence[str], named: int, count: int = 0) -> Options:
    """Words above the picture, the first as a heading, and the places below them. Empty lines fill them up to ``count``.

    ``named`` is the most lines that the legend takes.
    """
    bold = {"textStyle": {"color": p.ink, "fontSize": 14, "fontWeight": "bold"}}
    titles = [title(p, text, 4 + 17 * k, 12) | ({} if k else bold) for k, text in enumerate(lines)]
    empty = [title(p, "", 4, 12)] * (count - len(lines))
    places: Options = {"legend": {"top": 4 + 17 * len(lines)}, "grid": {"top": 12 + 17 * len(lines) + 22 * named}}
    return {"title": [*titles, *empty], **places}


def _extent(shown: Picture, factor: float) -> tuple[float, float, float]:
    """Ends and ticks of the vertical axis, ``factor`` times mdps: all means, the curve with its band, and zero."""
    values = [0.0, *shown.left, *shown.reach]
    values += [y + k * se for y, se in zip(shown.curve, shown.se, strict=True) for k in (-2, 2)]
    low, high = factor * min(values), factor * max(values)
    step = _step((high - low) or 1.0)
    return math.floor(low / step) * step, math.ceil(high / step) * step, step


def _step(reach: float) -> float:
    """The distance of the ticks, 1, 2 or 5 times a power of ten, of which three to eight lie in ``reach``."""
    power = 10.0 ** math.floor(math.log10(reach))
    return float(f"{next(m * power for m in (0.2, 0.5, 1.0, 2.0) if reach <= 7 * m * power):.3g}")


def calibration(p: Palette, errors: Mapping[str, Mapping[float, tuple[float, float]]]) -> Options:
    """Mean difference between the first seconds and the whole recording, one line for each method; scale left, bias right."""
    order = [m for m in METHODS if m in errors]
    seconds = sorted({s for by in errors.values() for s in by})
    labels = [f"{s:g}" for s in seconds]
    series = []
    unit = unit_of(bias_dps for by in errors.values() for _, bias_dps in by.values())
    for k, factor in ((0, 100.0), (1, unit.per_dps)):
        for m in order:
            colour, symbol = p.methods[METHODS.index(m)], SYMBOLS[METHODS.index(m)]
            series.append({
                "type": "line", "name": m, "xAxisIndex": k, "yAxisIndex": k, "symbol": symbol, "symbolSize": 8,
                "data": [[f"{s:g}", round(errors[m][s][k] * factor, 6)] for s in seconds if s in errors[m]],
                "lineStyle": {"color": colour, "width": 3 if m == order[-1] else 1.5}, "itemStyle": {"color": colour},
            })  # fmt: skip
    first = "first seconds of each face"

    def below(legend_px: int) -> Options:
        return {"title": [{"top": 6 + legend_px}] * 2, "grid": [{"top": 24 + legend_px}] * 2}

    lines = 2 if len(order) > SHORT_LEGEND else 1

    return base(
        p,
        legend={**legend(p, [{"name": m} for m in order], top=0, type="plain"), "itemWidth": 24},
        media=fitting(below(LEGEND_LINE_PX), below(lines * LEGEND_LINE_PX)), tooltip=tooltip(p, ["%", unit.name], "s"),
        toolbox=BOX, units=["%", unit.name], axisPointer={"link": [{"xAxisIndex": "all"}]},
        grid=[grid(left=58, right="56%", top=44, bottom=36), grid(left="59%", right=14, top=44, bottom=36)],
        title=[title(p, "scale, %", 26, 58), title(p, f"bias, {unit.name}", 26, "59%")],
        xAxis=[axis(p, first, kind="category", data=labels, gridIndex=k, nameGap=22) for k in (0, 1)],
        yAxis=[axis(p, gridIndex=k, min=0) for k in (0, 1)],
        series=series,
    )  # fmt: skip
