"""An explanation as text on the terminal, and as a self-contained page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyrocal.diagnosis.answer.explain import Explanation, Open, Step
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.drawn_size import described, most_visible_of
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.probes import of_session
from gyrocal.effects.base import Role, with_role
from gyrocal.inference import heldout
from gyrocal.inference.fit import Fit
from gyrocal.present import page, report
from gyrocal.present.output import stdout, table
from gyrocal.present.verdict import left_over
from gyrocal.recording.session import AXES, Array
from gyrocal.units import RateUnit, number_of, unit_of
from gyrocal.variables.base import variables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOO_SMALL = "certain, but too small to change the error noticeably"


def print_explanation(e: Explanation, session: Path, model: Path | None) -> None:
    """Print the steps with the excess after each, what stays open, and the verdict."""
    report.print_warnings(e.last.comparison.warnings)
    if e.steps:
        unit = unit_of_steps(e.steps)
        rows = [["(start)", "", unit.text(e.steps[0].excess_before, 2), ""]]
        rows += [[named(s), ", ".join(s.axes), unit.text(s.excess_after, 2), remark(s)] for s in e.steps]
        table("Held-out excess error over the noise floor", ["added:", "axis:", f"excess {unit.name}", "remark:"], rows)
    for one in e.left:
        stdout.print(open_words(one))
    stdout.print(conclusion(e), style="bold")
    if without := scale_unknown(e):
        stdout.print(without)
    stdout.print(report.kept_in(model, e.model.ids, e.verdict))
    if e.verdict == "unknown" and not report.unproven(e.last):
        keep = f"gyrocal keep {session} --model {model or 'model.toml'}"
        stdout.print(f"next: {keep} finds a formula for it and keeps it as your own effect")


def scale_unknown(e: Explanation) -> str:
    """A sentence for a session that turns and cannot tell scale from bias on its own axis; empty for any other."""
    session = e.last.comparison.fit.session
    axis, term = session.axis, e.model.term(with_role(Role.SCALE).id, session.axis)
    if term is None or term.values or not any(np.any(run.rate_dps) for run in session.runs):
        return ""
    return (
        f"No scale on {axis}: all runs turn at one rate, so that scale and bias are one number, and the bias is unsure by what "
        "the scale may be. Record the other direction or face too, or a rest."
    )


DEG = RateUnit("deg", 1.0, 2)


def unit_of_steps(steps: Sequence[Step]) -> RateUnit:
    """The unit of the excess of steps: that of rates, or deg for a session judged by angle."""
    if steps[0].before.angles is not None:
        return DEG
    return unit_of(value for s in steps for value in (s.excess_before, s.excess_after))


def named(step: Step) -> str:
    """The ids of the effects of a step."""
    return " + ".join(step.effects)


def remark(step: Step) -> str:
    """Remarks on a step; empty if there is nothing special."""
    parts = [] if step.matters else [TOO_SMALL]
    if step.removed:
        parts.append(f"replaces {', '.join(step.removed)}")
    if step.within:
        unit = unit_of_steps([step])
        parts.append(f"within power cycles, from {unit.text(step.excess_before, 2)} {unit.name}")
    return "; ".join(parts)


def open_words(one: Open) -> str:
    """The effects that the session cannot distinguish, and the measurement that would."""
    if len(one.group) == 1:
        fits = f"On {one.axis} {one.group[0]} fits the readings, but this session cannot prove it."
        return f"{fits} To prove it: {one.next_measurement}."
    group = ", ".join(one.group[:-1]) + f" or {one.group[-1]}"
    return f"On {one.axis} this session cannot tell which acts: {group}. To tell them apart: {one.next_measurement}."


def conclusion(e: Explanation) -> str:
    """The verdict on the final model in one or two sentences."""
    if e.verdict == "add" and e.last.best is not None:
        best = f"{e.last.best.effect.id} on {e.last.best.axis}"
        steps = number_of(len(e.steps), "step")
        if e.limited:
            return f"Stopped after {steps}, as many as were allowed; {best} is still missing."
        left = "What is left over is not noise alone."
        return f"{left} It resembles {best}, but adding it does not lower the error of held-out data."
    if e.verdict == "adequate" and e.steps:
        compared = e.last.comparison.to_json()
        return left_over(compared, "With these effects the model is adequate", "With these effects no test finds a misfit")
    return report.verdict_text(e.last)


def words(e: Explanation) -> str:
    """The conclusion, what was added with the excess before and after, and what stays open."""
    lines = [f"{e.verdict}; {conclusion(e)}"]
    for step in e.steps:
        unit = unit_of_steps([step])
        fell = f"{unit.text(step.excess_before, 2)} to {unit.text(step.excess_after, 2)} {unit.name}"
        lines.append(f"added {named(step)} on {', '.join(step.axes)}: excess from {fell}")
    return "\n".join([*lines, *map(open_words, e.left)])


def write_explanation(path: Path, e: Explanation) -> None:
    """Write the explanation as one self-contained HTML page. Raises InputError if the file cannot be written."""
    from gyrocal.present import pictures

    start = e.first.comparison
    overview = ""
    if e.steps:
        labels = ["given model", *(f"+ {named(s)}" for s in e.steps)]
        levels = [e.steps[0].before.pooled, *(s.after.pooled for s in e.steps)]
        overview = _data(pictures.waterfall(labels, [v.excess_dps or 0.0 for v in levels], levels[-1].floor_dps))
    steps = [
        {"title": f"{named(s)} on {', '.join(s.axes)}", "before": unit.text(s.excess_before, 2),
         "after": unit.text(s.excess_after, 2), "unit": unit.name, "remark": remark(s), "causes": _causes(s),
         "shown": shown(removed(s)), "picture": _data(evidence(s))}
        for s in e.steps for unit in [unit_of_steps([s])]
    ]  # fmt: skip
    last = e.last.comparison
    remains = last.where[0] if last.where else None
    text = page.render(
        "present/explanation.html", page.name_of(start.fit.session), conclusion(e), e.verdict == "adequate",
        e.last.comparison.warnings, overview=overview, counted=counted(e.steps),
        steps=steps, left=[open_words(one) for one in e.left],
        levels=report.judged_rows(last), level_columns=report.level_columns(last), judged_by=report.judged_by(last),
        parameters=report.parameter_rows(last), parameter_columns=report.PARAMETERS,
        model=", ".join(e.model.ids), remains=shown(remains), remains_picture=_data(picture(last, remains)),
    )  # fmt: skip
    page.write(path, text)


def counted(steps: Sequence[Step]) -> str:
    """How the excess errors of the steps are counted, in a sentence; empty if it is by angle or not the same in all steps."""
    sides = [side for s in steps for side in (s.before, s.after)]
    floors = {round(side.pooled.floor_dps, 9) for side in sides if side.angles is None}
    if len(floors) != 1 or any(s.within for s in steps):
        return ""
    unit, floor_dps = unit_of_steps(steps), floors.pop()
    return (
        "Excess errors are the rms of all axes on unseen data, beyond the noise floor of the final model, "
        f"{unit.text(floor_dps, 2)} {unit.name}. `gyrocal compare` takes the floor of the one model that it compares."
    )


def _causes(step: Step) -> list[str]:
    """The physical cause of each effect of a step."""
    runs = step.after.fit.session.runs
    kinds = {t.effect_id: t.effect for t in step.after.fit.model.terms}
    return [f"{kinds[i].title}: {kinds[i].cause_in(runs)}" for i in step.effects if i in kinds]


def evidence(step: Step) -> Figure | None:
    """The residual before and after a step, against the variable that what the step removed follows."""
    return picture(step.before, removed(step), step.after)


def picture(before: Comparison, finding: Finding | None, after: Comparison | None = None) -> Figure | None:
    """The picture of a finding; None without one."""
    from gyrocal.present import pictures

    if finding is None:
        return None
    if variables()[finding.against].picture == "spectrum":
        return pictures.spectra(before, finding.against)
    return pictures.residual_against(before, finding, after)


def shown(finding: Finding | None) -> str:
    """A finding as a sentence; empty without one."""
    if finding is None:
        return ""
    return f"The residual on {finding.axis} shows it against {variables()[finding.against].quantity}: {finding.note}."


def removed(step: Step) -> Finding | None:
    """What a step removed from the residual as it is drawn, on its axis with most of it; without a variable, as a finding.

    A variable of the effects' equations comes before one that happens to follow the same course, such as the time.
    """
    old, new = step.before.fit, step.after.fit
    taken = {axis: _difference(old.on(axis), new.on(axis)) for axis in step.axes if axis in old.axes and axis in new.axes}
    if not taken:
        return removed_finding(step)
    axis = max(taken, key=lambda a: float(np.var(taken[a])))
    on_axis = of_session(step.before.fit.session, AXES.index(axis))
    shapes = [(against, shape) for against, some in on_axis for shape in some]
    equations = " ".join(t.effect.equation for t in step.after.fit.model.terms if t.effect_id in step.effects)
    own = [(against, shape) for against, shape in shapes if variables()[against].in_equation(equations)]
    followed = most_visible_of(old.axes[axis], taken[axis], own) or most_visible_of(old.axes[axis], taken[axis], shapes)
    if followed is None:
        return removed_finding(step)
    against, shape = followed
    amplitude_dps, note = described(old.axes[axis], shape)
    return Finding(axis, against, 0.0, 1.0, amplitude_dps, note, shape)


def _difference(old: Fit, new: Fit) -> Array:
    """What two fits of one axis predict differently, in the blocks of the first; a delay gives the second other blocks."""
    before, after = ({p.run.index: p.modelled_dps for p in heldout.fitted(fit, net=True)} for fit in (old, new))
    (axis,) = old.axes.values()
    return np.concatenate([b.mean((after[b.run.index] - before[b.run.index])[:, None])[:, 0] for b in axis.design.blocks])


def removed_finding(step: Step) -> Finding | None:
    """The strongest finding on the step's axes that is weaker afterwards; None if there is none."""
    after = {(f.axis, f.against): f.strength for f in reversed(step.after.where)}
    weaker = [f for f in step.before.where if f.axis in step.axes and after.get((f.axis, f.against), 0.0) < f.strength]
    return max(weaker, key=lambda f: f.strength, default=None)


def _data(figure: Figure | None) -> str:
    from gyrocal.present import pictures

    return "" if figure is None else pictures.png_data(figure)
