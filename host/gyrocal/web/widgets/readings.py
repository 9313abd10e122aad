"""The live readings of the device: the latest values, and the last seconds of all axes as a strip chart."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

from nicegui import background_tasks, ui

from gyrocal.digits import UNKNOWN
from gyrocal.units import CELSIUS
from gyrocal.web.device.samples import SHOWN_S, Frame
from gyrocal.web.pictures import charts
from gyrocal.web.widgets.tools import tools

if TYPE_CHECKING:
    from gyrocal.web.device.live import Live
    from gyrocal.web.page import Tab

FRAME_S = 0.033
READ_S = 0.15
"""Time between two updates of the numbers, so that they can be read."""
MOST_IN_FLIGHT = 3
READINGS = (("x", "dps"), ("y", "dps"), ("z", "dps"), ("a x", "g"), ("a y", "g"), ("a z", "g"), ("temp.", CELSIUS))
COLUMNS = ("t_s", "gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g", "temp_c")
"""Columns of the saved table, named as in a session's files."""
STRIPS = ("rate x, dps", "rate y, dps", "rate z, dps", "acceleration, g", f"temperature, {CELSIUS}")
UNITS = ("dps", "dps", "dps", "g", CELSIUS)
"""The unit of each strip."""
STRIP_OF = (0, 1, 2, 3, 3, 3, 4)
RATES = 3
WINDOWS_S = {5.0: "5 s", SHOWN_S: "10 s", 30.0: "30 s", 60.0: "60 s"}


class Readings:
    """The two sections of a page that show one sensor of the board."""

    def __init__(self, live: Live, tab: Tab) -> None:
        self._live, self._tab, self._imu = live, tab, 0
        self._sent = (0, 0.0)
        self._read = 0.0
        self._drawn_s = 0.0
        """Time of the newest sample that was drawn."""
        self._in_flight = 0
        self._paused = False
        self._limits: dict[int, tuple[float, float]] = {}
        """The vertical range that the user gave each strip."""
        with ui.element("section").classes("face readings").props('aria-label="readings"'):
            self._values = [self._value(name, unit) for name, unit in READINGS]
        with ui.element("section").classes("face grow column strips").style("padding: 6px 6px; gap: 2px"):
            with ui.row().classes("tight").style("padding: 0 8px; width: 100%"):
                self._controls()
                bar = ui.element("div").classes("tools")
            self._chart = ui.echart(self._whole()).classes("chart grow")
            self._chart.props('role="img" aria-label="the last seconds of all axes and the temperature"')
            with bar:
                tools(self._chart, lambda: f"live_{self._imu}", self._csv)
        samples = live.sensors.get(self._imu)
        if samples is not None and len(rows := samples.latest(self._window.value)):
            self._numbers(rows[:, 1:])
        ui.timer(FRAME_S, self._frame)

    def show(self, imu: int) -> None:
        """Show another sensor of the board."""
        self._imu = imu
        self.redraw()

    def redraw(self) -> None:
        """Draw the whole chart anew, in the colours of the page."""
        options = self._whole()
        self._chart.options.clear()
        self._chart.options.update(options)
        self._chart.run_chart_method(":setOption", charts.script(options), "({notMerge: true})")
        self._again()

    def _value(self, name: str, unit: str) -> tuple[ui.html, ui.label]:
        with ui.element("div").classes("reading"):
            value = ui.html(f"<b>{UNKNOWN}</b>", sanitize=False)
            ui.label(f"{name}, {unit}")
            scatter = ui.label("")
        return value, scatter

    def _controls(self) -> None:
        self._pause = ui.button("Pause", icon="pause", on_click=self._hold, color=None).props("flat dense no-caps")
        self._window = ui.select(WINDOWS_S, value=SHOWN_S, label="window", on_change=self._again).props("outlined dense")
        self._window.style("width: 110px")
        self._statistics = ui.checkbox("mean and scatter of the window", on_change=self._again).props("dense")
        with ui.element("details").classes("fold"):
            with ui.element("summary"):
                ui.label("vertical range")
            with ui.row().classes("tight"):
                self._strip = ui.select(dict(enumerate(STRIPS)), value=2, label="strip").props("outlined dense")
                self._low = ui.number("from").props("outlined dense").style("width: 80px")
                self._high = ui.number("to").props("outlined dense").style("width: 80px")
                ui.button("Set", on_click=self._set_range, color=None).props("outline dense no-caps")
                ui.button("Automatic", on_click=self._free_range, color=None).props("flat dense no-caps")

    def _csv(self) -> str:
        """Every sample of the window as it was drawn last."""
        samples = self._live.sensors.get(self._imu)
        kept = [] if samples is None else samples.latest(math.inf).tolist()
        rows = [row for row in kept if self._drawn_s - self._window.value <= row[0] <= self._drawn_s]
        return "\n".join([",".join(COLUMNS), *(",".join(f"{v:.9g}" if v == v else "" for v in row) for row in rows), ""])

    def _hold(self) -> None:
        self._paused = not self._paused
        self._pause.text, self._pause.icon = ("Go on", "play_arrow") if self._paused else ("Pause", "pause")
        self._pause.update()
        self._again()

    def _set_range(self) -> None:
        low, high = self._low.value, self._high.value
        if low is None or high is None or not low < high:
            ui.notify("Give two numbers, the smaller one first.")
            return
        self._limits[self._strip.value] = (float(low), float(high))
        self._again()

    def _free_range(self) -> None:
        self._limits.pop(self._strip.value, None)
        self._again()

    def _again(self) -> None:
        """Draw anew, also if nothing has come."""
        self._sent, self._read = (0, 0.0), 0.0

    def _whole(self) -> charts.Options:
        """The strips with what has come so far: a page that is opened after the last sample gets no other."""
        whole = self._strips()
        samples = self._live.sensors.get(self._imu)
        if samples is not None:
            frame = samples.frame(self._window.value)
            self._drawn_s = frame.newest_s
            for name, parts in self._options(frame).items():
                for mine, part in zip(whole[name], parts, strict=False):
                    mine.update(part)
        return whole

    def _strips(self) -> charts.Options:
        p = self._tab.palette
        tops = [f"{5.8 + 17.4 * k:g}%" for k in range(5)]  # the rest is for the words of the last axis
        x: list[charts.Options] = []
        for k in range(5):
            last = k == 4
            without = {"show": last, "showMinLabel": False, "showMaxLabel": False}
            name = "time of the device, s; line: mean, band: lowest to highest" if last else ""
            across: charts.Options = {"min": 0, "max": SHOWN_S, "scale": False, "axisTick": {"show": False}, "nameGap": 20}
            x.append(charts.axis(p, name, gridIndex=k, label=without, **across))
        acceleration = [charts.entry(READINGS[i][0], "line") for i, strip in enumerate(STRIP_OF) if strip == 3]
        colours = [p.axes[a] for a in "xyzxyz"] + [p.ink]
        return charts.base(
            p,
            grid=[charts.grid(top=top, height="11.2%", right=12, left=58) for top in tops],
            title=[charts.title(p, name, f"{0.6 + 17.4 * k:g}%", 58) for k, name in enumerate(STRIPS)],
            legend=charts.legend(p, acceleration, right=12, top="52.6%"), toolbox=charts.BOX,
            tooltip=charts.tooltip(p, UNITS, "s"), axisPointer={"link": [{"xAxisIndex": "all"}]},
            dataZoom=[{"type": "inside", "disabled": True, "xAxisIndex": list(range(5)), "filterMode": "none"}],
            xAxis=x,
            yAxis=[charts.axis(p, gridIndex=k, splitNumber=1, label={"fontSize": 10}) for k in range(5)],
            series=[
                *(charts.line(READINGS[i][0], [], colours[i], on=strip) for i, strip in enumerate(STRIP_OF)),
                *(_bound(colours[i], i) for i in range(RATES)), *(_bound(colours[i], i, fill=0.3) for i in range(RATES)),
            ],
        )  # fmt: skip

    def _frame(self) -> None:
        """Send new samples to the chart, unless the browser has not yet drawn the previous ones."""
        samples = self._live.sensors.get(self._imu)
        if samples is None and self._drawn_s:  # another device, which has sent nothing yet
            self._empty()
        if samples is None or self._live.newest == self._sent or self._in_flight >= MOST_IN_FLIGHT:
            return
        if self._paused and self._sent[0]:
            return
        self._sent = self._live.newest
        frame = samples.frame(self._window.value)
        self._drawn_s = frame.newest_s
        if time.monotonic() - self._read > READ_S:
            self._read = time.monotonic()
            self._numbers(samples.latest(self._window.value)[:, 1:])
        background_tasks.create(self._send(self._options(frame)))

    def _empty(self) -> None:
        """Take the readings of the device before away."""
        self._drawn_s = 0.0
        for element, scatter in self._values:
            element.content, scatter.text = f"<b>{UNKNOWN}</b>", ""
        self.redraw()

    def _numbers(self, rows: Any) -> None:
        """The latest values, or mean and scatter of the window."""
        import numpy as np

        statistics = bool(self._statistics.value) and len(rows) > 1
        shown = rows.mean(axis=0) if statistics else rows[-1]
        scatters = rows.std(axis=0, ddof=1) if statistics else [np.nan] * len(READINGS)
        for (element, scatter), value, within, (_, unit) in zip(self._values, shown, scatters, READINGS, strict=True):
            digits = 2 if unit == CELSIUS else 3
            element.content = f"<b>{UNKNOWN}</b>" if value != value else f"<b>{round(value, digits) + 0.0:.{digits}f}</b>"
            scatter.text = "" if within != within else f"scatter {within:.{digits + 1}f}"

    def _options(self, frame: Frame) -> charts.Options:
        seconds = self._window.value
        last = max(frame.newest_s, frame.first_s + seconds)  # the first seconds fill the chart from the left
        limits = [self._limits.get(k, (None, None)) for k in range(len(STRIPS))]
        return {
            "xAxis": [{"min": round(last - seconds, 3), "max": round(last, 3)}] * len(STRIPS),
            "yAxis": [{"min": low, "max": high} for low, high in limits],
            "series": [{"data": curve} for curve in (*frame.means, *frame.lows, *frame.widths)],
        }

    async def _send(self, options: charts.Options) -> None:
        self._in_flight += 1
        try:
            if self._chart.is_deleted:  # the panel was left meanwhile
                return
            how = {"silent": True, "lazyUpdate": True}
            await self._chart.run_chart_method("setOption", options, how, timeout=2.0)
        except TimeoutError:  # a browser that was busy may have missed it, and nothing else may come
            if not self._paused:
                self._again()
        finally:
            self._in_flight -= 1


def _bound(colour: str, strip: int, fill: float = 0.0) -> charts.Options:
    """The lower bound of a strip's band, or with ``fill`` its width, which is stacked on it and filled."""
    return charts.line(
        "", [], colour, on=strip, style={"width": 0}, stack=f"band {strip}", stackStrategy="all", z=1,
        areaStyle={"color": colour, "opacity": fill}, itemStyle={"color": "transparent"},
    )  # fmt: skip
