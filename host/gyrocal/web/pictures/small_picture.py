"""The picture of an effect in small, as an SVG."""

from __future__ import annotations

import html
from collections.abc import Sequence

from gyrocal.web.values.views import Halves


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


ROW_PX, NAMES_PX, SCALE_PX = 17, 190, 150


def checks_svg(share: float | None, halves: Sequence[Halves]) -> str:
    """The two checks of an effect: its share of what it and an unnamed rest describe, and its size in halves of the recordings.

    The vertical line is its size in all of them; a whisker is two standard errors. Empty if neither is known.
    """
    if share is None and not halves:
        return ""
    marks: list[str] = []
    words: list[str] = []
    left, y = NAMES_PX + 8.0, 12.0

    def text(x: float, told: str, anchor: str = "end") -> None:
        marks.append(f'<text x="{x:.0f}" y="{y + 4:.0f}" text-anchor="{anchor}">{html.escape(told)}</text>')

    if share is not None:
        text(NAMES_PX, "its share, beside an unnamed rest")
        marks.append(f'<rect class="rest" x="{left}" y="{y - 5}" width="{SCALE_PX}" height="10"/>')
        marks.append(f'<rect class="own" x="{left}" y="{y - 5}" width="{SCALE_PX * min(1.0, share):.1f}" height="10"/>')
        text(left + SCALE_PX + 5, f"{100 * share:.0f} %", "start")
        words.append(f"share {100 * share:.0f} %")
        y += ROW_PX + 3
    ends = [size + k * se for h in halves for size, se in zip(h.sizes, h.se, strict=True) for k in (-2, 2)]
    low, high = min([0.5, *ends]), max([1.5, *ends])
    top = y - 8

    def place(value: float) -> float:
        return left + (value - low) / (high - low) * SCALE_PX

    for of in halves:
        text(NAMES_PX, " / ".join(of.names))
        for k, (size, se) in enumerate(zip(of.sizes, of.se, strict=True)):
            at = y + (-3 if k == 0 else 3)
            marks.append(f'<line x1="{place(size - 2 * se):.1f}" x2="{place(size + 2 * se):.1f}" y1="{at}" y2="{at}"/>')
            marks.append(f'<circle cx="{place(size):.1f}" cy="{at}" r="2.6"/>')
        words.append(f"{of.names[0]} {of.sizes[0]:.2f}, {of.names[1]} {of.sizes[1]:.2f}")
        y += ROW_PX
    if halves:
        marks.insert(0, f'<line class="all" x1="{place(1):.1f}" x2="{place(1):.1f}" y1="{top}" y2="{y - 8}"/>')
    label = html.escape("; ".join(words), quote=True)
    return (
        f'<svg class="checks" viewBox="0 0 {left + SCALE_PX + 45:g} {y - 4:g}" width="{left + SCALE_PX + 45:g}" role="img" '
        f'aria-label="checks: {label}">{"".join(marks)}</svg>'
    )
