"""Which findings of an axis are told: each cause once, and the one that a picture shows first.

A large misfit shows in every test. A curve over temperature looks like a transient of another size in each run. A wave whose
phase differs from run to run looks like a line of the lowest frequency, because a run ends within a period.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from gyrocal.diagnosis.residual.drawn_size import described, drawn_power
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.levels import Cleaned
from gyrocal.diagnosis.residual.probes import beside, probe, with_curves
from gyrocal.effects.earth_rate import in_plane_dps, may_be_in_plane
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.noise.orders import LEAST_TURNS
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.units import rate_text
from gyrocal.variables.frequency import Frequency
from gyrocal.variables.order import Order
from gyrocal.variables.shapes import Course, Shape, ShapeOfEachRun, Steps, StepsOfRuns, TableWave, Transient, Waves
from gyrocal.variables.table_angle import TableAngle
from gyrocal.variables.time import Time

OfFrequency = Callable[[Fit, str, dict[int, Array], float], list[Finding]]

def leader(current: AxisFit, found: Sequence[Finding]) -> Finding | None:
    """The strongest of the findings that describe nearly as much of the residual, as it is drawn, as any other."""
    parts = [(drawn_power(current, f), f) for f in found]
    most = max((p for p, _ in parts), default=0.0)
    return max((f for p, f in parts if p >= (1 - POLICY.alike) * most), key=lambda f: f.strength, default=None)


def each_once(found: Iterable[Finding]) -> list[Finding]:
    """The findings without those that say the same as one before them: two tests may see one wave."""
    once: dict[tuple[str, str, str], Finding] = {}
    for f in found:
        once.setdefault((f.axis, f.against, f.note), f)
    return list(once.values())


def strongest_first(found: Iterable[Finding]) -> list[Finding]:
    """The findings of all axes, strongest first, but those of an axis not before the one that is listed first of it."""
    listed = list(found)
    limit: dict[str, float] = {}
    for f in listed:
        limit.setdefault(f.axis, f.strength)
    return sorted(listed, key=lambda f: -min(f.strength, limit[f.axis]))


def without_echoes(
    fitted: Fit, axis: str, found: list[Finding], share: float, of_frequency: OfFrequency
) -> list[Finding]:
    """The findings of an axis without those that vanish beside the leading one, which comes first.

    Tested again are findings whose size or phase differs from run to run, and those against the frequency. Beside one that
    itself differs from run to run, all others are. A course that repeats is told where no other shape is found.
    """
    shaped = [f for f in found if f.shape is not None and not isinstance(f.shape, Course)]
    found = [f for f in found if not (shaped and isinstance(f.shape, Course))]
    found = sorted(found, key=lambda f: -f.strength)
    first = leader(fitted.axes[axis], found)
    if first is None:
        return found
    if first.shape is None:
        return [first, *(f for f in found if f is not first)]
    of_runs = isinstance(first.shape, (ShapeOfEachRun, StepsOfRuns, Waves))
    leading = [f for f in found if f is first or (of_runs and type(f.shape) is type(first.shape))]
    rest = [f for f in found if f not in leading]
    doubted = [f for f in rest if f.against == Frequency.name or (f.shape and (of_runs or isinstance(f.shape, ShapeOfEachRun)))]
    if not doubted:
        return [first, *(f for f in found if f is not first)]
    shapes = [f.shape for f in leading if f.shape is not None]
    clean = beside(fitted.axes[axis], axis, shapes if len(shapes) > 1 else with_curves(fitted.axes[axis], shapes, Steps.bends))

    def stays(f: Finding) -> bool:
        if f not in doubted or f.shape is None:
            return f.against != Frequency.name
        again = probe(clean, axis, f.against, f.shape, share)
        return again is not None and again.chance < share

    kept = [f for f in rest if stays(f)]
    if any(f.against == Frequency.name for f in doubted):
        alone = fitted.on(axis, clean)
        kept += of_frequency(alone, axis, Cleaned.of(alone, axis).by_run, share)
    return [first, *(f for f in leading if f is not first), *kept]


def curves_within(
    current: AxisFit, axis: str, probes: Sequence[tuple[str, list[Shape]]], found: Sequence[Finding], share: float
) -> list[Finding]:
    """Stronger findings against a variable whose steps hide what it does within the runs: tested with the curve through them.

    A temperature that moves by less than a step in each run leaves a slope in each, which a transient of another size in each
    run describes, and what differs between the runs is taken for the offsets of power cycles. The words and the picture are
    those of the steps, in which the session shows the whole.
    """
    out = []
    strongest = max(f.strength for f in found)
    for against, shape in ((against, shape) for against, shapes in probes if against != Time.name for shape in shapes):
        if isinstance(shape, Steps) and not shape.times_rate and not any(f.shape is shape for f in found):
            curve = probe(current, axis, against, shape.bends(), share)
            if curve is not None and curve.chance < share and curve.strength > strongest:
                amplitude, note = described(current, shape)
                out.append(replace(curve, shape=shape, amplitude_dps=amplitude, note=note))
    return out


WIDE = 1.5
"""Ratio of the ends of a band above which it is no line."""


def told_once(findings: Sequence[Finding], runs: Sequence[Run], block_s: float) -> list[Finding]:
    """The findings of an axis without those that another one tells in better words.

    A wave in the table's angle is a line in the spectrum too, at another frequency for each rate, unless that line is much
    larger. A line at a higher frequency than means over ``block_s`` show appears in them at a lower one. A transient is told
    with the time constant that fits best.
    """
    transients = [f for f in findings if isinstance(f.shape, Transient)]
    lines = [f for f in findings if f.band_hz is not None and f.band_hz[0] == f.band_hz[1]]
    of_angle = [f for f in findings if f.against == TableAngle.name and _orders(f)]
    of_order = [f for f in findings if f.against == Order.name]

    def same(wave: Finding, band_hz: tuple[float, float]) -> bool:
        """True if a wave of the table's angle is in a band at the rate of one of the runs."""
        at_hz = ((abs(o * float(np.mean(r.rate_dps)) / 360), 2 / r.duration_s) for r in runs for o in _orders(wave))
        return any(band_hz[0] - width <= hz <= band_hz[1] + width for hz, width in at_hz if hz > 0)

    every_s = sum(r.duration_s for r in runs)
    turned_s = sum(r.duration_s for r in runs if float(np.mean(np.abs(r.rate_dps))) * r.duration_s >= 360 * LEAST_TURNS)

    def more_as_line(line: Finding, wave: Finding) -> bool:
        """True if a line, seen in all runs, has more energy than the wave that is seen in those that turn."""
        return line.amplitude_dps**2 * every_s > POLICY.more_as_line * wave.amplitude_dps**2 * turned_s

    def in_means(line: Finding, low_hz: float, high_hz: float) -> bool:
        hz = line.band_hz[0] if line.band_hz else 0.0
        return low_hz <= abs(hz - round(hz * block_s) / block_s) <= high_hz

    def repeated(f: Finding) -> bool:
        if isinstance(f.shape, Transient):
            return any(other.strength > f.strength for other in transients)
        if f in of_order:
            known = {o for wave in of_angle for o in _orders(wave)}
            return known.issuperset(_orders(f)) or any(
                line.band_hz and same(f, line.band_hz) and more_as_line(line, f) for line in lines
            )
        if f.band_hz is None:
            return False
        low_hz, high_hz = f.band_hz
        if high_hz > WIDE * low_hz:  # a wave that the model lacks causes power in a wide band too
            stronger = [other for other in (*lines, *of_angle, *of_order) if other.strength > f.strength]
            return any(_orders(other) or in_means(other, low_hz, high_hz) for other in stronger)
        waves = [*of_angle, *(other for other in of_order if f not in lines or not more_as_line(f, other))]
        return any(same(wave, f.band_hz) for wave in waves if wave.amplitude_dps >= POLICY.as_large * f.amplitude_dps)

    return [f for f in findings if not repeated(f)]


def _orders(finding: Finding) -> tuple[float, ...]:
    if isinstance(finding.shape, TableWave):
        return (finding.shape.order,)
    return tuple(finding.shape.orders) if isinstance(finding.shape, Waves) else ()


def beside_earth(finding: Finding, runs: Sequence[Run]) -> Finding:
    """The finding, with a hint where the Earth's rate makes such a wave: once per turn, on an axis in the table's plane."""
    axis = AXES.index(finding.axis)
    if 1 not in _orders(finding) or not may_be_in_plane(runs, axis, finding.amplitude_dps):
        return finding
    made = rate_text(in_plane_dps(runs, axis))
    return replace(finding, note=f"{finding.note}; the Earth's rate makes {made} once per turn on this axis")
