"""Answers of several power cycles: how they scatter beside their own errors, in a sentence and in a picture."""

from __future__ import annotations

import html
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gyrocal.diagnosis.rate_unit import rate_text, unit_of
from gyrocal.present.output import plus_minus
from gyrocal.web.words import METHODS

Estimate = dict[str, Any]

ORDER = ("model", "cnn", "baseline")
BEYOND = 2.0
"""The scatter exceeds the errors where it is so many times their root mean square."""
FEWEST = 3
WIDTH, HEIGHT, LEFT = 620.0, 150.0, 110.0


@dataclass(frozen=True)
class Scatter:
    """Mean, scatter between power cycles and root mean square of the answers' own errors, of one method at one time."""

    cycles: int
    mean: float
    sd: float
    error: float

    @property
    def beyond(self) -> bool:
        return self.sd > BEYOND * self.error

    @staticmethod
    def of(found: Sequence[Estimate], name: str, error: str, factor: float) -> Scatter | None:
        """None for fewer than ``FEWEST`` answers with an error."""
        given = [(factor * e[name], factor * e[error]) for e in found if e[name] is not None and e[error] is not None]
        if len(given) < FEWEST:
            return None
        values = [value for value, _ in given]
        root = statistics.fmean(within**2 for _, within in given) ** 0.5
        return Scatter(len(given), statistics.fmean(values), statistics.stdev(values), root)


def longest(found: Sequence[Estimate], axis: str) -> dict[str, list[Estimate]]:
    """The answers of an axis from the longest time, by method, the richest first."""
    mine = [e for e in found if e["axis"] == axis]
    most = max((e["seconds"] for e in mine), default=0.0)
    by = {method: [e for e in mine if e["method"] == method and e["seconds"] == most] for method in ORDER}
    return {method: answers for method, answers in by.items() if answers}


def sentences(found: Sequence[Estimate], axis: str) -> list[str]:
    """What the answers from the longest time say together, and how many are not trusted."""
    by = longest(found, axis)
    told = []
    if by:
        method, answers = next(iter(by.items()))
        unit = unit_of(e["bias_dps"] for e in answers)
        bias = Scatter.of(answers, "bias_dps", "bias_se_dps", 1.0)
        scale = Scatter.of(answers, "scale", "scale_se", 1e2)
        head = f"Axis {axis}, by {METHODS[method]} from the first {answers[0]['seconds']:g} s"
        if bias is not None and scale is not None:
            told.append(
                f"{head}: over {bias.cycles} power cycles the bias scatters by {rate_text(bias.sd)} about "
                f"{unit.text(bias.mean)} {unit.name}, each answer's own error is {rate_text(bias.error)}; the scale scatters "
                f"by {scale.sd:.2g} % about {scale.mean:.4f} %, own error {scale.error:.2g} %."
            )
            parts = [name for name, one in (("bias", bias), ("scale", scale)) if one.beyond]
            if parts:
                told.append(
                    f"The {' and the '.join(parts)} of one power cycle cannot be taken for the next one's: an error holds for "
                    "its own power cycle."
                )
        else:
            one = answers[0]
            if one["bias_dps"] is not None and one["scale"] is not None:
                factors = (("scale_se", 1e2), ("bias_se_dps", unit.per_dps))
                scale_se, bias_se = (None if one[name] is None else f * one[name] for name, f in factors)
                told.append(
                    f"{head}: scale {plus_minus(100 * one['scale'], scale_se, '%')}, "
                    f"bias {plus_minus(unit.per_dps * one['bias_dps'], bias_se, unit.name)}."
                )
    doubted = sum(not e["trusted"] for e in found)
    if doubted:
        are = "is" if doubted == 1 else "are"
        told.append(f"{doubted} of {len(found)} answers {are} not trusted; the last column says why.")
    return told


def meanings(found: Sequence[Estimate]) -> list[str]:
    """The flags that are raised, in words."""
    from gyrocal.calibration.flags import FLAGS

    raised = {flag for e in found for flag in e["flags"]}
    return [f"{name.replace('_', ' ')}: {meaning}" for name, meaning in FLAGS.items() if name in raised]


def picture(found: Sequence[Estimate], axis: str, colours: Sequence[str]) -> str:
    """The biases of all power cycles with their errors as SVG, by method; hollow where not trusted."""
    by = longest(found, axis)
    seconds = next((answers[0]["seconds"] for answers in by.values()), 0.0)
    cycles = list(dict.fromkeys(e["scenario"] for answers in by.values() for e in answers))
    unit = unit_of(e["bias_dps"] for answers in by.values() for e in answers)
    f = unit.per_dps
    points = [
        (cycles.index(e["scenario"]) + 0.22 * (k - 1), f * e["bias_dps"], f * (e["bias_se_dps"] or 0.0), e, k)
        for k, answers in enumerate(by.values()) for e in answers if e["bias_dps"] is not None
    ]  # fmt: skip
    if len(cycles) < 2 or not points:
        return ""
    low, high = min(v - s for _, v, s, _, _ in points), max(v + s for _, v, s, _, _ in points)
    tall = (high - low) or 1.0

    def x(place: float) -> float:
        return LEFT + (place + 0.5) / len(cycles) * (WIDTH - LEFT - 8)

    def y(value: float) -> float:
        return 8 + (high - value) / tall * (HEIGHT - 44)

    drawn = []
    for place, value, error, e, k in points:
        fill = colours[k] if e["trusted"] else "none"
        drawn.append(
            f'<g stroke="{colours[k]}" stroke-width="2"><line x1="{x(place):.1f}" x2="{x(place):.1f}" '
            f'y1="{y(value - error):.1f}" y2="{y(value + error):.1f}"/>'
            f'<circle cx="{x(place):.1f}" cy="{y(value):.1f}" r="3.5" fill="{fill}"/></g>'
        )
    for value in (low, high):
        drawn.append(f'<text x="{LEFT - 8:.0f}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.{unit.decimals}f}</text>')
    middle = y((low + high) / 2)
    drawn.append(f'<text x="0" y="{middle - 4:.1f}">bias, {unit.name},</text>')
    drawn.append(f'<text x="0" y="{middle + 12:.1f}">first {seconds:g} s</text>')
    if len(cycles) <= 12:
        drawn += [
            f'<text x="{x(i):.1f}" y="{HEIGHT - 20:.0f}" text-anchor="middle">{html.escape(name)}</text>'
            for i, name in enumerate(cycles)
        ]
    for k, method in enumerate(by):
        at = LEFT + 150 * k
        drawn.append(f'<circle cx="{at:.0f}" cy="{HEIGHT - 6:.0f}" r="3.5" fill="{colours[k]}"/>')
        drawn.append(f'<text x="{at + 9:.0f}" y="{HEIGHT - 2:.0f}">{METHODS[method]}</text>')
    drawn.append(f'<text x="{WIDTH - 8:.0f}" y="{HEIGHT - 2:.0f}" text-anchor="end">hollow: not trusted</text>')
    told = f"bias of each power cycle in {unit.name}"
    return (
        f'<svg class="scatter" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{told}">'
        f'{"".join(drawn)}</svg>'
    )
