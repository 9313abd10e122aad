"""The waterfall of the excess error as it is drawn, on the page and in the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gyrocal.diagnosis.rate_unit import RateUnit
from gyrocal.web import charts
from gyrocal.web.charts import Options, Palette

if TYPE_CHECKING:
    from gyrocal.web.fall import Bar


@dataclass(frozen=True)
class Block:
    """One bar of the waterfall as it is drawn, from ``low`` to ``high``."""

    label: str
    low: float
    high: float
    colour: str
    text: str


def blocks(p: Palette, bars: Sequence[Bar], unit: RateUnit) -> list[Block]:
    """The excess of the first model, the reduction by each step, and the remaining excess, in ``unit``."""
    if not bars:
        return []

    def block(label: str, low: float, high: float, colour: str, told: float, sign: str = "") -> Block:
        text = sign + unit.text(1e-3 * abs(told), 2)
        return Block(label, 1e-3 * unit.per_dps * low, 1e-3 * unit.per_dps * high, colour, text)

    out = [block(bars[0].label, 0.0, bars[0].after, p.bad, bars[0].after)]
    for b in bars[1:]:
        low, high = sorted((b.before, b.after))
        fell = b.after <= b.before
        out.append(block(b.label, low, high, p.good if fell else p.bad, high - low, "−" if fell else "+"))
    if len(bars) > 1:
        out.append(block("left over", 0.0, bars[-1].after, p.axes["z"], bars[-1].after))
    return out


def waterfall(p: Palette, bars: Sequence[Bar], unit: RateUnit) -> Options:
    """Excess error step by step above the floor (zero). The last bar is the remaining excess."""
    drawn = blocks(p, bars, unit)
    wrapped = {"color": p.ink, "interval": 0, "lineHeight": 13, "width": max(64, 420 // len(drawn)), "overflow": "break"}
    shown = [
        {
            "value": [k, b.high - b.low],
            "itemStyle": {"color": b.colour, "borderRadius": 3},
            "label": {"show": True, "position": "top", "color": p.ink, "fontWeight": "bold", "formatter": b.text},
        }
        for k, b in enumerate(drawn)
    ]
    return charts.base(
        p,
        animationDuration=700, animationEasing="cubicOut", **charts.MOTION,
        grid=charts.grid(left=54, right=16, top=18, bottom=40),
        xAxis=charts.axis(p, kind="category", data=[b.label for b in drawn], axisTick={"show": False}, label=wrapped),
        yAxis=charts.axis(p, f"excess, {unit.name} rms", nameGap=38, scale=False, min=0, boundaryGap=[0, "12%"]),
        tooltip=charts.tooltip(p, [unit.name]), toolbox=charts.BOX, units=[unit.name],
        series=[
            {"type": "bar", "stack": "s", "part": True, "silent": True, "data": [[k, b.low] for k, b in enumerate(drawn)],
             "itemStyle": {"color": "transparent"}, "animation": False},
            {"type": "bar", "stack": "s", "name": "height of the bar", "barMaxWidth": 74, "data": shown,
             ":animationDelay": "(i) => i * 450"},
        ],
    )  # fmt: skip
