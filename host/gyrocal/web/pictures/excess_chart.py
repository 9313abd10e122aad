"""The waterfall of the excess error as it is drawn, on the page and in the report."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gyrocal.units import RateUnit
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.charts import Options, Palette

if TYPE_CHECKING:
    from gyrocal.web.values.excess_by_step import Bar


LETTER_PX = 6.0
"""Mean width of a letter of a label."""
LINE_PX = 13
REPORT_PX = 122
"""Width of a label in the report, whose bars are 130 apart."""


def wrapped(label: str, width_px: float) -> list[str]:
    """A label in lines of a width; a word that is longer than a line is broken."""
    return textwrap.wrap(label, max(4, int(width_px / LETTER_PX))) or [""]


@dataclass(frozen=True)
class Block:
    """One bar of the waterfall as it is drawn, from ``low`` to ``high``."""

    label: str
    low: float
    high: float
    colour: str
    text: str

    @property
    def lines(self) -> list[str]:
        """The label in the lines that the report has room for."""
        return wrapped(self.label, REPORT_PX)


def blocks(p: Palette, bars: Sequence[Bar], unit: RateUnit) -> list[Block]:
    """The excess of the first model, the reduction by each step, and the remaining excess, in ``unit``."""
    if not bars:
        return []

    def block(label: str, low: float, high: float, colour: str, told: float, sign: str = "") -> Block:
        text = unit.text(1e-3 * abs(told), 2)
        text = sign + text if float(text) else text
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
    plain = {"color": p.ink, "interval": 0, "lineHeight": LINE_PX, "hideOverlap": False}
    wide, narrow = (_labelled([b.label for b in drawn], px / len(drawn)) for px in (460, 260))
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
        grid=charts.grid(left=54, right=16, top=18),
        xAxis=charts.axis(p, kind="category", axisTick={"show": False}, label=plain),
        yAxis=charts.axis(p, f"excess, {unit.name} rms", nameGap=38, scale=False, min=0, boundaryGap=[0, "12%"], splitNumber=3),
        media=charts.fitting(wide, narrow), tooltip=charts.tooltip(p, [unit.name]), toolbox=charts.BOX, units=[unit.name],
        series=[
            {"type": "bar", "stack": "s", "part": True, "silent": True, "data": [[k, b.low] for k, b in enumerate(drawn)],
             "itemStyle": {"color": "transparent"}, "animation": False},
            {"type": "bar", "stack": "s", "name": "height of the bar", "barMaxWidth": 74, "data": shown,
             ":animationDelay": "(i) => i * 450"},
        ],
    )  # fmt: skip


def _labelled(labels: Sequence[str], width_px: float) -> Options:
    """The labels below the bars in lines of a width, and the room that they take."""
    lines = [wrapped(label, width_px) for label in labels]
    data = ["\n".join(of) for of in lines]
    return {"xAxis": {"data": data}, "grid": {"bottom": 14 + LINE_PX * max(map(len, lines))}}
