"""The live readings of the device: the latest values, and the last ten seconds of all axes as a strip chart."""

from __future__ import annotations

import contextlib
import time
from typing import TYPE_CHECKING

from nicegui import background_tasks, ui

from gyrocal.web import charts
from gyrocal.web.samples import SHOWN_S

if TYPE_CHECKING:
    from gyrocal.web.live import Live

FRAME_S = 0.033
READ_S = 0.15
"""Time between two updates of the numbers, so that they can be read."""
MOST_IN_FLIGHT = 3
READINGS = (("x", "deg/s"), ("y", "deg/s"), ("z", "deg/s"), ("a x", "g"), ("a y", "g"), ("a z", "g"), ("temp.", "°C"))
STRIPS = ("rate x, deg/s", "rate y, deg/s", "rate z, deg/s", "acceleration, g", "temperature, °C")
STRIP_OF = (0, 1, 2, 3, 3, 3, 4)


class Readings:
    """The two sections of a page that show one sensor of the board."""

    def __init__(self, live: Live, palette: charts.Palette) -> None:
        self._live, self._palette, self._imu = live, palette, 0
        self._sent = (0, 0.0)
        self._read = 0.0
        self._in_flight = 0
        with ui.element("section").classes("face readings"):
            self._values = [self._value(name, unit) for name, unit in READINGS]
        with ui.element("section").classes("face grow").style("padding: 4px 6px"):
            self._chart = ui.echart(self._strips()).classes("chart")
            self._chart.props('role="img" aria-label="the last ten seconds of all axes and the temperature"')
        ui.timer(FRAME_S, self._frame)

    def show(self, imu: int) -> None:
        """Show another sensor of the board."""
        self._imu, self._sent = imu, (0, 0.0)

    def _value(self, name: str, unit: str) -> ui.html:
        with ui.element("div").classes("reading"):
            value = ui.html("<b>–</b>", sanitize=False)
            ui.label(f"{name}, {unit}")
        return value

    def _strips(self) -> charts.Options:
        p = self._palette
        tops = [f"{5 + 18.5 * k}%" for k in range(5)]
        x: list[charts.Options] = []
        for k in range(5):
            last = k == 4
            without = {"show": last, "showMinLabel": False, "showMaxLabel": False}
            x.append(charts.axis(p, gridIndex=k, label=without, min=0, max=SHOWN_S, scale=False, axisTick={"show": False}))
        colours = [p.axes[a] for a in "xyzxyz"] + [p.ink]
        return charts.base(
            p,
            grid=[charts.grid(top=top, height="12.5%", right=12, left=58) for top in tops],
            title=[charts.title(p, name, f"{1 + 18.5 * k}%", 58) for k, name in enumerate(STRIPS)],
            xAxis=x,
            yAxis=[charts.axis(p, gridIndex=k, splitNumber=1, label={"fontSize": 10}) for k in range(5)],
            series=[charts.line(READINGS[i][0], [], colours[i], on=strip) for i, strip in enumerate(STRIP_OF)],
        )

    def _frame(self) -> None:
        """Send new samples to the chart, unless the browser has not yet drawn the previous ones."""
        samples = self._live.sensors.get(self._imu)
        if samples is None or self._live.newest == self._sent or self._in_flight >= MOST_IN_FLIGHT:
            return
        self._sent = self._live.newest
        t_s, curves = samples.frame()
        if time.monotonic() - self._read > READ_S:
            self._read = time.monotonic()
            for element, value, (_, unit) in zip(self._values, samples.latest(0.0)[-1, 1:], READINGS, strict=True):
                element.content = "<b>–</b>" if value != value else f"<b>{value:.{2 if unit == '°C' else 3}f}</b>"
        options = {
            "xAxis": [{"min": round(t_s - SHOWN_S, 3), "max": round(t_s, 3)}] * len(STRIPS),
            "series": [{"data": curve} for curve in curves],
        }
        background_tasks.create(self._send(options))

    async def _send(self, options: charts.Options) -> None:
        self._in_flight += 1
        try:
            with contextlib.suppress(TimeoutError):
                how = {"silent": True, "lazyUpdate": True}
                await self._chart.run_chart_method("setOption", options, how, timeout=2.0)
        finally:
            self._in_flight -= 1
