"""The picture of an effect: the residual against the variable that the effect depends on, and the effect's curve through it.

The variable is one of the effect's equation if the effect's own signal is nearly a function of it over these recordings, else
the one of which the signal is most nearly a function. An effect whose phase differs from run to run is a function of nothing
over all runs; it is shown in the run where it varies most.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gyrocal.present.bins import cells, plateaus
from gyrocal.recording.session import Array
from gyrocal.web.values.residual_plots import Panel, panels
from gyrocal.web.values.views import Picture

BINS = 40
LEAST = 2
"""Fewest block means in a bin, so that it has a standard error."""
A_FUNCTION = 0.6
"""Part of the signal's variance that a variable describes over all runs, from which on all runs are shown."""
ALIKE = 0.02
"""Parts that differ by less than this are equal; the variable that takes more values is then shown."""

WITHIN = 0.05
"""Part of the signal's variance, for each run, that the run which is shown has within it at least."""
CONSTANT = 1e-12
"""Part of the signal's square that is rounding."""

Points = Mapping[str, Array]


def picture(
    axis: str, signal: Array, points: Points, files: Mapping[int, str], against: str = "", equation: str = ""
) -> Picture | None:
    """The picture of an effect on an axis.

    ``signal`` [blocks] is the fitted effect in block means, deg/s, NaN where it is not known, and ``points`` the residual's
    block means with every variable, as :func:`gyrocal.web.worker.prepare.points` gives them. ``against`` is the only variable
    to be tried, if given; those of the ``equation`` come first. None if no variable has values.
    """
    there = np.isfinite(points[axis]) & np.isfinite(signal)
    own = [panel for panel in panels() if panel.in_equation(equation)]
    best = _best(axis, signal, points, there, against, own)
    if best is None or best[1] < A_FUNCTION:
        best = _best(axis, signal, points, there, against)
    if best is None:
        return None
    panel, part = best
    run = None
    if part < A_FUNCTION:
        known = there & np.isfinite(signal)
        of_run, count, s = points["run"][known], np.bincount(points["run"][known]), signal[known]
        mean = np.bincount(of_run, s) / np.maximum(count, 1)
        power = np.bincount(of_run, (s - mean[of_run]) ** 2)
        run = int(np.argmax(power))
        if power[run] < WITHIN * float(np.sum((s - s.mean()) ** 2)) / np.count_nonzero(count):
            return None  # it differs between recordings and not within them, and no variable tells how
        mine = there & (points["run"] == run)
        panel, _ = _best(axis, signal, points, mine, against) or best
    return _drawn(axis, signal, points, panel, run, "" if run is None else files[run])


def left_now(shown: Picture, points: Points) -> list[float]:
    """The residual's means in the picture's bins with another model, mdps. A bin without values is at zero."""
    panel = next(p for p in panels() if p.name == shown.view)
    x, y = points[panel.key(shown.axis)], points[shown.axis]
    use = np.isfinite(x) & np.isfinite(y) & _of_run(points, shown.run)
    place = np.searchsorted(np.asarray(shown.edges), x[use], side="right") - 1
    inside = (place >= 0) & (place < len(shown.edges) - 1)
    values = y[use] - (y[use].mean() if shown.run is not None and use.any() else 0.0)
    count = np.bincount(place[inside], minlength=len(shown.edges) - 1)
    total = np.bincount(place[inside], values[inside], len(shown.edges) - 1)
    kept = np.asarray(shown.centres)
    bins = np.searchsorted(np.asarray(shown.edges), kept, side="right") - 1
    return (1e3 * total[bins] / np.maximum(count[bins], 1)).tolist()


def of_each_run(shown: Picture, points: Points) -> list[tuple[float, float]]:
    """The mean of each run at each value of a variable that takes a few values only: value and mdps. Else empty."""
    if shown.run is not None or not shown.few:
        return []
    panel = next(p for p in panels() if p.name == shown.view)
    x, y, run = points[panel.key(shown.axis)], points[shown.axis], points["run"]
    use = np.isfinite(x) & np.isfinite(y)
    place = np.searchsorted(np.asarray(shown.edges), x, side="right")
    cells = np.unique(np.stack([place[use], run[use]]), axis=1).T
    means = ((use & (place == k) & (run == i)) for k, i in cells)
    return [(float(x[m].mean()), 1e3 * float(y[m].mean())) for m in means]


def _of_run(points: Points, run: int | None) -> Any:
    return np.ones(points["run"].size, dtype=bool) if run is None else points["run"] == run


def _best(
    axis: str, signal: Array, points: Points, there: Any, against: str, among: Sequence[Panel] | None = None
) -> tuple[Panel, float] | None:
    """The panel of which the signal is most nearly a function, and the part of its variance that this describes.

    It is one of all panels, or ``among`` some.
    """
    parts: list[tuple[float, int, Panel]] = []
    for panel in panels() if among is None else among:
        if panel.variable.name == "reading" or against not in ("", panel.variable.name):  # a reading holds the effect itself
            continue
        x = points[panel.key(axis)]
        use = there & np.isfinite(x) & np.isfinite(signal)
        if np.count_nonzero(use) < 0.9 * np.count_nonzero(there) or np.count_nonzero(use) < 4 * LEAST or np.ptp(x[use]) == 0:
            continue
        place = _places(x[use], _edges(x[use], panel))
        s = signal[use]
        count = np.bincount(place)
        seen = count > 0
        mean = np.bincount(place, s)[seen] / count[seen]
        total = float(np.sum((s - s.mean()) ** 2))
        if total <= CONSTANT * float(s @ s):  # it acts in rows without a residual, as those of turns of known angle
            continue
        between = float(np.sum(count[seen] * (mean - s.mean()) ** 2))
        spare = (s.size - 1) / max(s.size - np.count_nonzero(seen), 1)
        parts.append((1 - (1 - between / total) * spare, int(np.count_nonzero(seen)), panel))
    if not parts:
        return None
    top = max(part for part, _, _ in parts)
    part, _, panel = max((p for p in parts if p[0] > top - ALIKE), key=lambda p: (min(p[1], BINS // 2), p[0]))
    return panel, part


def _edges(x: Array, panel: Panel) -> Array:
    if panel.variable.period is not None:
        return np.linspace(0, panel.variable.period, BINS + 1)
    low, high = float(x.min()), float(x.max())
    few = plateaus(x)
    if few is not None:
        return few
    return np.linspace(low, high + 1e-6 * (high - low), BINS + 1)


def _places(x: Array, edges: Array) -> Any:
    return np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)


def _moved(difference: Array, *rate_dps: Array) -> Array:
    """The part of a difference [blocks] that bias and scale take up: both move when an effect is added."""
    known = [r for r in rate_dps if np.isfinite(r).all()]
    columns = np.stack([np.ones(difference.size), *known], axis=1)
    return np.asarray(columns @ np.linalg.lstsq(columns, difference, rcond=None)[0])


def _drawn(axis: str, signal: Array, points: Points, panel: Panel, run: int | None, file: str) -> Picture:
    x, y = points[panel.key(axis)], points[axis]
    use = np.isfinite(x) & np.isfinite(y) & np.isfinite(signal) & _of_run(points, run)  # a run may lack the effect's data
    x, y, s = (np.asarray(v[use], dtype=float) for v in (x, y, signal))
    of_run = points["run"][use]
    if run is not None:  # the offset of a run is not the effect's
        y, s = y - y.mean(), s - s.mean()
    s = s + _moved(y - s, *(np.asarray(points[p.key(axis)][use], dtype=float) for p in panels() if p.name == "rate"))
    edges = _edges(x, panel)
    place = _places(x, edges)
    count = np.bincount(place, minlength=edges.size - 1)
    kept = np.flatnonzero(count >= LEAST)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(place, values, edges.size - 1)[kept] / count[kept])

    se = cells(place, y - s, of_run, edges.size - 1).se[kept]
    edges, centres, left, se, curve = (c.tolist() for c in (edges, mean(x), 1e3 * mean(y), 1e3 * se, 1e3 * mean(s)))
    shown = Picture(
        panel.name, axis, panel.label, run, file, edges, centres, left, se, curve,
        few=plateaus(x) is not None, marks=dict(panel.variable.marks),
    )  # fmt: skip
    each = [mean for _, mean in of_each_run(shown, points)]
    return replace(shown, reach=(min(each), max(each))) if each else shown
