"""What a chart shows, as a CSV file and as a picture."""

from __future__ import annotations

import csv
import io
from typing import Any

PNG = """() => {
    const chart = getElement(%d)?.chart;
    if (!chart) return;  // another picture has taken its place
    const link = document.createElement("a");
    const colour = getComputedStyle(document.body).getPropertyValue("--face").trim();
    link.href = chart.getDataURL({pixelRatio: 2, backgroundColor: colour});
    link.download = %s;
    link.click();
}"""
"""Saves the chart with this id as a file with this name, which is given as JSON."""
BOX = """() => {
    const chart = getElement(%d)?.chart, act = on => chart.dispatchAction(
        {type: "takeGlobalCursor", key: "dataZoomSelect", dataZoomSelectActive: on});
    if (!chart) return;
    const once = () => { chart.off("datazoom", once); setTimeout(() => act(false), 0); };
    act(true);
    chart.on("datazoom", once);
}"""
"""Lets the next drag in the chart with this id draw a box, to which it zooms."""

RESET = """() => getElement(%d)?.chart?.dispatchAction({type: "dataZoom", start: 0, end: 100})"""
"""Shows all of the chart with this id again."""


def as_csv(options: dict[str, Any]) -> str:
    """The lines and filled intervals of a chart's options as CSV text, with a row for each point and its unit."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(["series", "x", "x_to", "y", "y_lowest", "y_highest", "unit"])
    for series in options["series"]:
        if series.get("part"):  # it draws what another series says
            continue
        name, unit = series["name"], options["units"][series.get("yAxisIndex", 0)]
        labels = _labels(options, series)
        for point in series["data"]:
            if isinstance(point, dict):
                point = point["value"]
            if series["type"] == "custom":
                low_x, high_x, low, high = point
                rows.writerow([name, low_x, high_x, "", low, high, unit])
            elif point[1] is not None:
                x = labels[point[0]] if labels and isinstance(point[0], int) else point[0]
                rows.writerow([name, x, "", point[1], "", "", unit])
    return out.getvalue()


def _labels(options: dict[str, Any], series: dict[str, Any]) -> list[str]:
    """The names of a series' places where its horizontal axis has names in place of numbers."""
    axes = options["xAxis"]
    axis = axes[series.get("xAxisIndex", 0)] if isinstance(axes, list) else axes
    return list(axis.get("data", ()))
