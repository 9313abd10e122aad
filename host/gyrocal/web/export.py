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
    link.download = "%s.png";
    link.click();
}"""
"""Saves the chart with this id under this name."""
BOX = """() => {
    const chart = getElement(%d)?.chart, act = on => chart.dispatchAction(
        {type: "takeGlobalCursor", key: "dataZoomSelect", dataZoomSelectActive: on});
    if (!chart) return;
    const once = () => { chart.off("datazoom", once); setTimeout(() => act(false), 0); };
    act(true);
    chart.on("datazoom", once);
}"""
"""Lets the next drag in the chart with this id draw a box, to which it zooms."""


def as_csv(options: dict[str, Any]) -> str:
    """The lines and filled intervals of a chart's options as CSV text, with a row for each point and its unit."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(["series", "x", "x_to", "y", "y_lowest", "y_highest", "unit"])
    for series in options["series"]:
        name, unit = series["name"].strip(), options["units"][series["yAxisIndex"]]
        for point in series["data"]:
            if isinstance(point, dict):
                point = point["value"]
            if series["type"] == "custom":
                low_x, high_x, low, high = point
                rows.writerow([name, low_x, high_x, "", low, high, unit])
            elif point[1] is not None:
                rows.writerow([name, point[0], "", point[1], "", "", unit])
    return out.getvalue()
