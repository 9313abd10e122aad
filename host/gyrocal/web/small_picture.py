"""The picture of an effect in small, as an SVG."""

from __future__ import annotations

import html
from collections.abc import Sequence


def signature_svg(
    dots: Sequence[tuple[float, float]], curve: Sequence[tuple[float, float]], label: str,
    band: Sequence[tuple[float, float, float]] = (), few: bool = False,
) -> str:  # fmt: skip
    """A small plot of the residual (dots) and the fitted effect (line), in the colours of the page.

    ``band`` is filled between its lowest and highest values at each x. With ``few``, nothing was measured between the values,
    and each has a dash.
    """
    width, height = 220.0, 76.0
    everything = [*dots, *curve, *((x, y) for x, *both in band for y in both)]
    if not everything:
        return ""
    xs, ys = [x for x, _ in everything], [y for _, y in everything]
    low, high = min(ys), max(ys)
    across, up = (max(xs) - min(xs)) or 1.0, (high - low) or 1.0

    def place(point: tuple[float, float]) -> tuple[float, float]:
        return 6 + (point[0] - min(xs)) / across * (width - 12), height - 6 - (point[1] - low) / up * (height - 12)

    def path(points: Sequence[tuple[float, float]]) -> str:
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in map(place, points))

    radius = 4 if few else 1.6
    drawn = f'<polyline class="curve" points="{path(curve)}"/>'
    if few:
        dashes = (f"{x - 8:.1f},{y:.1f} {x + 8:.1f},{y:.1f}" for x, y in map(place, curve))
        drawn = "".join(f'<polyline class="curve" points="{points}"/>' for points in dashes)
    circles = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"/>' for x, y in map(place, dots))
    at = [(place((x, low)), place((x, high))) for x, low, high in band]
    outlines = [[*(low for low, _ in at), *(high for _, high in reversed(at))]] if at else []
    if few:
        outlines = [[(x - 8, low), (x + 8, low), (x + 8, high), (x - 8, high)] for (x, low), (_, high) in at]
    filled = "".join(
        f'<polygon class="band" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in outline)}"/>' for outline in outlines
    )
    return (
        f'<svg class="signature" viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{html.escape(label, quote=True)}" '
        f'preserveAspectRatio="none">{filled}{drawn}'
        f'<g class="dots">{circles}</g></svg>'
    )
