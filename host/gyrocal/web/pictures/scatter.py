"""Answers of several power cycles: how they scatter beside their own errors, in a sentence and in a picture."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gyrocal.calibration.taken import Taken
from gyrocal.digits import rounded
from gyrocal.present.output import plus_minus
from gyrocal.present.taken import each, part, words
from gyrocal.units import rate_text, unit_of
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.charts import Options, Palette
from gyrocal.web.pictures.words import METHODS

Estimate = dict[str, Any]

ORDER = ("model", "cnn", "baseline")
BEYOND = 2.0
"""The scatter exceeds the errors where it is so many times their root mean square."""
FEWEST = 3


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
    """The answers of an axis from whole recordings, or else from the longest time, by method, the richest first."""
    mine = [e for e in found if e["axis"] == axis]
    whole = [e for e in mine if not e["taken"].first]
    most = max((e["seconds"] for e in mine), default=0.0)
    used = whole or [e for e in mine if e["seconds"] == most]
    by = {method: [e for e in used if e["method"] == method] for method in ORDER}
    return {method: answers for method, answers in by.items() if answers}


def sentences(found: Sequence[Estimate], axis: str) -> list[str]:
    """What the answers from the longest time that are trusted, if any, say together, and how many are not trusted."""
    every = longest(found, axis)
    by = {method: trusted for method, answers in every.items() if (trusted := [e for e in answers if e["trusted"]])} or every
    told = []
    if by:
        method, answers = next(iter(by.items()))
        which = "" if len(answers) == len(every[method]) else "trusted "
        unit = unit_of(e["bias_dps"] for e in answers)
        bias = Scatter.of(answers, "bias_dps", "bias_se_dps", 1.0)
        scale = Scatter.of(answers, "scale", "scale_se", 1e2)
        head = f"Axis {axis}, by {METHODS[method]}"
        if bias is not None and scale is not None:
            told.append(
                f"{head} from {each(e['taken'] for e in answers)}, in each of {bias.cycles} {which}power cycles: the bias "
                f"scatters by {rate_text(bias.sd)} about {unit.text(bias.mean, 1, bias.error)} {unit.name}, each answer's own "
                f"error is {rate_text(bias.error)}; the scale scatters by {rounded(scale.sd, scale.sd, 0)} % about "
                f"{rounded(scale.mean, scale.error, 4)} %, own error {rounded(scale.error, scale.error, 4)} %."
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
                head = head if len(answers) == 1 else f"{head} in power cycle {one['scenario']}"
                told.append(
                    f"{head} from {words(one['taken'])}: scale {plus_minus(100 * one['scale'], scale_se, '%')}, "
                    f"bias {plus_minus(unit.per_dps * one['bias_dps'], bias_se, unit.name)}."
                )
    doubted = sum(not e["trusted"] for e in found)
    if doubted:
        are = "is" if doubted == 1 else "are"
        which = f"{doubted} of {len(found)} answers {are} not" if doubted < len(found) else "No answer is"
        told.append(f"{which} trusted; the last column says why.")
    return told


def meanings(found: Sequence[Estimate]) -> list[str]:
    """The flags that are raised, in words."""
    from gyrocal.calibration.flags import FLAGS

    raised = {flag for e in found for flag in e["flags"]}
    return [f"{name.replace('_', ' ')}: {meaning}" for name, meaning in FLAGS.items() if name in raised]


POINT = """(params, api) => {
    const shift = %g * api.size([1, 0])[0], at = y => { const p = api.coord([api.value(0), y]); return [p[0] + shift, p[1]]; };
    const middle = at(api.value(1)), low = at(api.value(2)), high = at(api.value(3)), colour = api.visual("color");
    return {type: "group", children: [
        {type: "line", shape: {x1: low[0], y1: low[1], x2: high[0], y2: high[1]}, style: {stroke: colour, lineWidth: 2}},
        {type: "circle", shape: {cx: middle[0], cy: middle[1], r: 3},
         style: {fill: api.value(4) ? colour : "%s", stroke: colour, lineWidth: 2}}]};
}"""
"""Draws one answer with its error. The answers of a power cycle by several methods stand beside each other."""
BARS = 2.0
"""Standard errors from an answer to either end of its bar."""
APART = 0.22
"""Distance between the methods, as a part of a power cycle's place."""


def options(p: Palette, found: Sequence[Estimate], axis: str) -> Options:
    """The biases of all power cycles with their errors, by method, hollow where not trusted; empty for one cycle."""
    by = longest(found, axis)
    of = part(next((e["taken"] for answers in by.values() for e in answers), Taken()))
    cycles = list(dict.fromkeys(e["scenario"] for answers in by.values() for e in answers))
    unit = unit_of(e["bias_dps"] for answers in by.values() for e in answers)
    f = unit.per_dps
    known = {method: [e for e in answers if e["bias_dps"] is not None] for method, answers in by.items()}
    if len(cycles) < 2 or not any(known.values()):
        return {}
    colours = dict(zip(ORDER, (p.axes["z"], p.methods[1], p.methods[0]), strict=True))
    series: list[Options] = []
    for k, (method, answers) in enumerate(known.items()):
        rows = [
            [cycles.index(e["scenario"]), f * e["bias_dps"], f * (e["bias_se_dps"] or 0.0), e["trusted"]] for e in answers
        ]  # fmt: skip
        told = {"type": "scatter", "name": METHODS[method], "symbolSize": 0, "silent": True, "data": [r[:3] for r in rows]}
        drawn = [[i, bias, bias - BARS * error, bias + BARS * error, int(trusted)] for i, bias, error, trusted in rows]
        series.append({**told, "itemStyle": {"color": colours[method]}})
        series.append({
            "type": "custom", "name": METHODS[method], "part": True, "data": drawn, "silent": True,
            "animation": False, "clip": True, "encode": {"x": 0, "y": [2, 3]}, "itemStyle": {"color": colours[method]},
            ":renderItem": POINT % (APART * (k - 1), p.face), "tooltip": {"show": False},
        })  # fmt: skip
    ends = [v for s in series[1::2] for r in s["data"] for v in r[2:4]]
    head, key = f"bias, {unit.name}, {of}", f"bars: ± {BARS:g} standard errors; hollow: not trusted"
    space = 0.05 * (max(ends) - min(ends)) or 1.0
    label: Options = {":formatter": charts.PLAIN, "showMinLabel": False, "showMaxLabel": False}
    return charts.base(
        p, series=series, units=[unit.name], toolbox=charts.BOX, tooltip=charts.tooltip(p, [unit.name]),
        legend=charts.legend(p, [charts.entry(METHODS[method], "dots") for method in known], left=8),
        title=charts.title(p, f"{head}; {key}", 2, 12),
        grid=charts.grid(left=58, right=12, bottom=24),
        media=charts.fitting(
            {"title": {"text": f"{head}; {key}"}, "legend": {"top": 20}, "grid": {"top": 46}},
            {"title": {"text": f"{head};\n{key}", "textStyle": {"lineHeight": 15}}, "legend": {"top": 36}, "grid": {"top": 62}},
        ),
        xAxis=charts.axis(p, kind="category", data=cycles, axisTick={"show": False}),
        yAxis=charts.axis(p, label=label, min=min(ends) - space, max=max(ends) + space),
    )  # fmt: skip
