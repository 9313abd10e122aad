"""ECharts options and colours: those of Okabe and Ito, which colour-blind people can distinguish, in light and dark shades."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gyrocal.web.views import Bar

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
METHODS = ("baseline", "network", "model at first", "model now")
SYMBOLS = ("rect", "triangle", "diamond", "circle")


def palette(dark: bool) -> Palette:
    return DARK if dark else LIGHT


def base(p: Palette, **more: Any) -> Options:
    return {
        "animation": False,
        "backgroundColor": "transparent",
        "textStyle": {"fontFamily": "inherit", "color": p.ink},
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


def line(name: str, data: Points, colour: str, *, on: int = 0, style: Options | None = None, **more: Any) -> Options:
    """A line in the grid ``on``."""
    return {
        "type": "line", "name": name, "data": data, "showSymbol": False, "animation": False, "silent": True,
        "xAxisIndex": on, "yAxisIndex": on, "lineStyle": {"color": colour, "width": 1, **(style or {})},
        "itemStyle": {"color": colour}, **more,
    }  # fmt: skip


def grid(**place: Any) -> Options:
    """The fixed place of a plot in the chart."""
    return {"outerBoundsMode": "none", "left": 62, "right": 18, **place}


def title(p: Palette, text: str, top: Any, left: Any = 62) -> Options:
    style = {"color": p.dim, "fontSize": 12, "fontWeight": "normal"}
    return {"text": text, "left": left, "top": top, "padding": 0, "textStyle": style}


def legend(p: Palette, names: Sequence[str], **more: Any) -> Options:
    return {
        "data": list(names), "textStyle": {"color": p.dim, "fontSize": 11}, "itemWidth": 16, "itemHeight": 8,
        "selectedMode": False, "icon": "roundRect", **more,
    }  # fmt: skip


def tooltip(p: Palette) -> Options:
    text = {"color": p.ink, "fontSize": 12}
    return {"trigger": "axis", "backgroundColor": p.face, "borderColor": p.line, "textStyle": text, "confine": True}


def marks(p: Palette, data: Sequence[Options], colour: str, kind: str = "dotted") -> Options:
    """Vertical lines with labels."""
    style = {"color": colour, "type": kind, "width": 1}
    return {"silent": True, "symbol": "none", "animation": False, "lineStyle": style, "data": list(data)}


@dataclass(frozen=True)
class Block:
    """One bar of the waterfall as it is drawn, from ``low`` to ``high``."""

    label: str
    low: float
    high: float
    colour: str
    text: str


def blocks(p: Palette, bars: Sequence[Bar]) -> list[Block]:
    """The excess of the first model, the reduction by each step, and the remaining excess."""
    if not bars:
        return []
    out = [Block(bars[0].label, 0.0, bars[0].after, p.bad, f"{bars[0].after:.2f}")]
    for b in bars[1:]:
        low, high = sorted((b.before, b.after))
        colour = p.good if b.after <= b.before else p.bad
        out.append(Block(b.label, low, high, colour, f"{b.after - b.before:+.2f}".replace("-", "−")))
    if len(bars) > 1:
        out.append(Block("left over", 0.0, bars[-1].after, p.axes["z"], f"{bars[-1].after:.2f}"))
    return out


def waterfall(p: Palette, bars: Sequence[Bar]) -> Options:
    """Excess error step by step above the floor (zero). The last bar is the remaining excess."""
    drawn = blocks(p, bars)
    wrapped = {"color": p.ink, "interval": 0, "lineHeight": 13, "width": max(64, 420 // len(drawn)), "overflow": "break"}
    shown = [
        {
            "value": b.high - b.low,
            "itemStyle": {"color": b.colour, "borderRadius": 3},
            "label": {"show": True, "position": "top", "color": p.ink, "fontWeight": "bold", "formatter": b.text},
        }
        for b in drawn
    ]
    return base(
        p,
        animation=True, animationDuration=700, animationEasing="cubicOut",
        grid=grid(left=54, right=16, top=18, bottom=40),
        xAxis=axis(p, kind="category", data=[b.label for b in drawn], axisTick={"show": False}, label=wrapped),
        yAxis=axis(p, "excess error, mdps", nameGap=38, scale=False, min=0, boundaryGap=[0, "12%"]),
        series=[
            {"type": "bar", "stack": "s", "silent": True, "data": [b.low for b in drawn],
             "itemStyle": {"color": "transparent"}, "animation": False},
            {"type": "bar", "stack": "s", "barMaxWidth": 74, ":animationDelay": "(i) => i * 450", "data": shown},
        ],
    )  # fmt: skip


def calibration(p: Palette, errors: Mapping[str, Mapping[float, tuple[float, float]]]) -> Options:
    """Mean difference between the first seconds and the whole recording, one line for each method; scale left, bias right."""
    order = [m for m in METHODS if m in errors]
    seconds = sorted({s for by in errors.values() for s in by})
    labels = [f"{s:g}" for s in seconds]
    series = []
    for k, factor in ((0, 100.0), (1, 1e3)):
        for m in order:
            colour, symbol = p.methods[METHODS.index(m)], SYMBOLS[METHODS.index(m)]
            series.append({
                "type": "line", "name": m, "xAxisIndex": k, "yAxisIndex": k, "symbol": symbol, "symbolSize": 8,
                "data": [[f"{s:g}", round(errors[m][s][k] * factor, 6)] for s in seconds if s in errors[m]],
                "lineStyle": {"color": colour, "width": 3 if m == order[-1] else 1.5}, "itemStyle": {"color": colour},
            })  # fmt: skip
    first = "first seconds of each face"
    return base(
        p,
        legend=legend(p, order, top=0), tooltip=tooltip(p),
        grid=[grid(left=58, right="56%", top=44, bottom=36), grid(left="59%", right=14, top=44, bottom=36)],
        title=[title(p, "scale, %", 26, 58), title(p, "bias, mdps", 26, "59%")],
        xAxis=[axis(p, first, kind="category", data=labels, gridIndex=k, nameGap=22) for k in (0, 1)],
        yAxis=[axis(p, gridIndex=k, min=0) for k in (0, 1)],
        series=series,
    )  # fmt: skip


def signature_svg(dots: Sequence[tuple[float, float]], curve: Sequence[tuple[float, float]], label: str) -> str:
    """A small plot of the residual (dots) and the fitted effect (line), in the colours of the page."""
    width, height = 220.0, 76.0
    everything = [*dots, *curve]
    if not everything:
        return ""
    xs, ys = [x for x, _ in everything], [y for _, y in everything]
    low, high = min(ys), max(ys)
    across, up = (max(xs) - min(xs)) or 1.0, (high - low) or 1.0

    def place(point: tuple[float, float]) -> tuple[float, float]:
        return 2 + (point[0] - min(xs)) / across * (width - 4), height - 4 - (point[1] - low) / up * (height - 8)

    circles = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="1.4"/>' for x, y in map(place, dots))
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(place, curve))
    return (
        f'<svg class="signature" viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}" '
        f'preserveAspectRatio="none"><g class="dots">{circles}</g><polyline class="curve" points="{path}"/></svg>'
    )
