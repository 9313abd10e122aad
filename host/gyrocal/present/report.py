"""Comparison and diagnosis as text on the terminal, and as a self-contained page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.answer.explain import REPEAT
from gyrocal.diagnosis.naming.candidate import Candidate, number_tested
from gyrocal.diagnosis.naming.decision import in_range, proven
from gyrocal.diagnosis.residual import angles
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.levels import explained
from gyrocal.diagnosis.residual.parameter_moved import Moved
from gyrocal.digits import UNKNOWN, pair, percentage, places, rounded
from gyrocal.effects.base import Effect, title_of
from gyrocal.effects.optional import InWords
from gyrocal.inference.blocks import BLOCK_S
from gyrocal.plausibility import absent
from gyrocal.policy import POLICY
from gyrocal.present import probability
from gyrocal.present.output import plus_minus, stdout, table
from gyrocal.present.verdict import adequate, first_sentence, high_floor, nothing_found, stands_on
from gyrocal.units import RateUnit, to_read, unit_of
from gyrocal.warning import Warning, by_weight, line

LIST_WIDTH = 120
"""Characters of a line of a list of names."""
REJECTED_SHOWN = 3
BLOCKED = (
    "The session's own axis is not judged, because it has a blocking warning. Correct what the warnings describe, or "
    "overrule them with accept in session.toml."
)

UNTIMED = (
    "Nothing was found, but the times are in doubt, and so is everything that changes with time. Correct what the note "
    "(sample_rate) says, and repeat this."
)


def print_warnings(warnings: Iterable[Warning]) -> None:
    """One paragraph for each warning, blocking ones first."""
    for told in by_weight(warnings):
        kind = "" if told.blocking else "note: "
        stdout.print(kind + line(told), style="bold red" if told.blocking else None, markup=False)


def headline(c: Comparison) -> str:
    """The verdict in one sentence."""
    if c.verdict == "implausible":
        return BLOCKED
    if c.verdict == "adequate":
        return UNTIMED if _is_untimed(c) else adequate(c.to_json())
    first = c.where[0]
    if c.moved is not None:
        return f"The model no longer holds: on {first.axis}, against {first.against.replace('_', ' ')} ({first.note})."
    return f"The model does not fit: on {first.axis}, against {first.against.replace('_', ' ')} ({first.note})."


def _is_untimed(c: Comparison) -> bool:
    return any(w.code == "sample_rate" for w in c.warnings)


def axis_names(c: Comparison) -> tuple[dict[str, str], str]:
    """Names of each axis and of all together in tables, where an axis with a blocking warning is marked."""
    blocked = [axis for axis in c.per_axis if axis not in c.judged]
    names = {axis: f"{axis} (not judged)" if axis in blocked else axis for axis in c.per_axis}
    gone = absent(c.warnings) & names.keys()
    counted = [axis for axis in blocked if axis not in gone]
    told = [f"{word} {', '.join(axes)}" for word, axes in (("with", counted), ("without", sorted(gone))) if axes]
    return names, f"all ({', '.join(told)})" if told else "all"


def level_unit(c: Comparison) -> RateUnit:
    """The unit of the levels of a comparison."""
    return unit_of(v for level in (*c.per_axis.values(), c.pooled) for v in (level.rms_dps, level.floor_dps))


def level_unit_name(c: Comparison) -> str:
    """The unit of :func:`level_rows`."""
    return level_unit(c).name if c.angles is None else "deg"


def level_rows(c: Comparison) -> list[list[str]]:
    """Axis, rms, floor, excess, its standard error and the excess within power cycles; the last row is all axes.

    They are to the second digit of the excess's standard error. Angles have no excess within power cycles.
    """
    names, everything = axis_names(c)
    if c.angles is not None:
        of_axes = [(names[axis], c.angles.level(axis)) for axis in c.per_axis]
        return [[*angle_row(*of), UNKNOWN] for of in (*of_axes, (everything, c.angles.level()))]
    unit = level_unit(c)
    return [
        [name, *(unit.text(x, 2, v.excess_se_dps) for x in told)]
        for name, v in (*((names[axis], v) for axis, v in c.per_axis.items()), (everything, c.pooled))
        for told in [(v.rms_dps, v.floor_dps, v.excess_dps, v.excess_se_dps, v.excess_within_dps)]
    ]


def judged_by(c: Comparison) -> str:
    """The title of the levels of a session that is judged by angle; empty for one that is judged by rate."""
    if c.angles is None:
        return ""
    return "Angles of the samples" if c.angles.of_samples else "Net angles of the runs"


def level_columns(c: Comparison) -> list[str]:
    """The columns of :func:`judged_rows`."""
    if c.angles is not None:
        return ANGLES
    return ["axis:", *(f"{of} {level_unit(c).name}" for of in ("rms", "floor", "excess", "±", "within cycles"))]


WHERE = ["axis:", "against:", "sigma", "what:"]


def where_rows(c: Comparison) -> list[list[str]]:
    """Axis, variable, strength and words of each finding."""
    return [[f.axis, f.against.replace("_", " "), f"{f.strength:.1f}", f.note] for f in c.where]


ANGLES = ["", "rms deg", "floor deg", "excess deg", "± deg"]


def deg(value: float | None, error: float | None = None) -> str:
    """An angle in deg to the second digit of its error, or with four decimals; ``-`` for None."""
    return rounded(value, error, 4)


def angle_row(name: str, v: angles.Level) -> list[str]:
    """The level of net angles or of movements, in deg."""
    return [name, *(deg(x, v.excess_se_deg) for x in (v.rms_deg, v.floor_deg, v.excess_deg, v.excess_se_deg))]


def judged_rows(c: Comparison) -> list[list[str]]:
    """The levels by which the comparison is judged, as :func:`level_rows` or in deg; the last row is all axes."""
    return [row[: len(level_columns(c))] for row in level_rows(c)]


def print_comparison(c: Comparison) -> None:
    """Print the levels, findings and parameters of a comparison."""
    print_warnings(c.warnings)
    rows = judged_rows(c)
    table(judged_by(c), level_columns(c), rows[: len(c.per_axis)] if len(c.per_axis) == 1 else rows)
    stdout.print(f"model: {', '.join(c.ids)}; held out: {c.held_out}")
    print_note(reference_words(c))
    print_note(stand_in_words(c))
    if c.where:
        table("Where it fails", WHERE, where_rows(c))
    if c.moved is not None:
        table("What has moved", MOVED, moved_rows(c.moved))
        print_note(c.note)
    print_note(high_floor(c.to_json()))
    print_note(stands_on(c.to_json()))
    stdout.print(headline(c), style="bold")


def reference_words(c: Comparison) -> str:
    """What the session shows of its reference's frame and clock, with standard errors; empty if it has neither of its own."""
    found = [f"{p.effect} {p.name} {plus_minus(p.value, p.se)}" for p in c.registration]
    return f"reference: {', '.join(found)}" if found else ""


def stand_in_words(c: Comparison) -> str:
    """Which effects of the model the session cannot tell from others, whose values then hold both; empty if there are none."""
    axes: dict[tuple[str, str], list[str]] = {}
    for axis, fit in c.fit.axes.items():
        for left_out, kept in fit.stand_ins:
            axes.setdefault((left_out.title.lower(), kept.title.lower()), []).append(axis)
    return "\n".join(
        f"On {', '.join(on)}, this session does not tell the {left_out} from the {kept}: the {kept} is stated as if there were "
        f"no {left_out}, and its error allows for one of typical size."
        for (left_out, kept), on in axes.items()
    )


MOVED = ["parameter:", "axis:", "file", "this session", "moved by", "±", "z", "unit:"]


def moved_rows(moved: Sequence[Moved]) -> list[list[str]]:
    """One row for each parameter of the file; a dash where this session does not show it."""
    return [
        [f"{m.effect} {m.name}", m.axis, f"{m.file:.6g}", "-" if m.session is None else f"{m.session:.6g}",
         "-" if m.session is None else f"{m.session - m.file:+.3g}", "-" if m.se is None else f"{m.se:.2g}",
         "-" if m.z is None else f"{m.z:+.1f}", "" if m.unit == "fraction" else to_read(m.unit)]
        for m in moved
    ]  # fmt: skip


def print_note(note: str) -> None:
    """Print a note as a line of its own, unless it is empty."""
    if note:
        stdout.print(note, markup=False)


def print_diagnosis(d: Diagnosis, session: Path, model: str | None) -> None:
    """Print the candidates and the verdict of a diagnosis. ``session`` and ``model`` stand in the next command."""
    print_warnings(d.comparison.warnings)
    passed = [c for c in d.candidates if c.decision in ("add", "suggest")]
    rejected = [c for c in d.candidates if c.decision == "reject"]
    rows = [
        [c.effect.id, c.axis, c.decision, probability.short(c.probability),
         "-" if c.explained is None else percentage(c.explained), "-" if c.gain is None else plus_minus(c.gain, c.gain_se),
         sizes(c)]
        for c in (*passed, *rejected[:REJECTED_SHOWN])
    ]  # fmt: skip
    table("", ["effect:", "axis:", "decision:", "probability", "explained", "held-out gain", "size:"], rows)
    if rejected[REJECTED_SHOWN:]:
        stdout.print("\n".join(wrap(f"rejected too: {by_effect(rejected[REJECTED_SHOWN:])}", LIST_WIDTH)))
    unseen = [c for c in d.candidates if c.decision == "not_measurable"]
    nowhere = {c.effect.id for c in unseen} - {c.effect.id for c in (*passed, *rejected)}
    on_table = [c for c in unseen if c.effect.id in nowhere and c.axis == d.comparison.fit.session.axis]
    if on_table:
        rows = [[c.effect.id, c.next_measurement] for c in on_table]
        table("What this session cannot show", ["effect:", "what would show it:"], rows)
    alternatives = [a.to_json() for a in d.alternatives]
    if probability.set_rows(alternatives):
        table("What explains each axis together", list(probability.SETS), probability.set_rows(alternatives))
    stdout.print(verdict_text(d), style="bold")
    for c in passed:
        print_note(probability.sentence(c.to_json()) if c.decision == "add" else "")
    print_note(probability.left_over(alternatives))
    target = model if model and model.endswith(".toml") else "model.toml"
    best = sure(d) if d.verdict in ("add", "ambiguous") else None
    if best is not None and best.together:
        stdout.print(f"{', '.join(best.together)} are certain only together")
        stdout.print(f"next: gyrocal explain {session} --model {target}")
    elif best is not None:
        stdout.print(f"next: gyrocal add {best.effect.id} {session} --model {target}")
    elif d.verdict == "ambiguous":
        stdout.print(f"next: gyrocal plan {session} --out plan.toml")
    if d.verdict == "unknown" and not unproven(d):
        stdout.print(
            f"next: gyrocal keep {session} --model {target} finds a formula for it and keeps it as an effect of your own"
        )


def by_effect(candidates: Iterable[Candidate]) -> str:
    """Effects with their axes: "drift (x, y), warmup (z)"."""
    axes: dict[str, list[str]] = {}
    for c in candidates:
        axes.setdefault(c.effect.id, []).append(c.axis)
    return ", ".join(f"{effect_id} ({', '.join(on)})" for effect_id, on in axes.items())


def verdict_text(d: Diagnosis, called: Callable[[str], str] = str) -> str:
    """The diagnosis in one or two sentences; ``called`` gives the name of an effect from its id.

    What is sure comes before a question: with it in the model, the question often has an answer.
    """
    best, one = d.best, sure(d)
    if d.verdict == "implausible":
        return BLOCKED
    if one is not None and d.verdict in ("add", "ambiguous"):
        named = {c.axis for c in d.candidates if c.decision == "add" and c.effect.id == one.effect.id}
        cause = first_sentence(one.effect.cause_in(d.comparison.fit.session.runs))
        return f"Missing: {one.effect.title.lower()} on {', '.join(sorted(named))}. {cause}{_also(d, one)}"
    if d.verdict == "ambiguous" and best is not None:
        group = ", ".join(map(called, best.group))
        return f"One of {group}; this session cannot tell which. To tell them apart: {best.next_measurement}."
    if d.verdict == "unknown" and d.unknown is not None:
        u = d.unknown
        where = f"on {u['axis']}, against {u['against'].replace('_', ' ')}: {u['shape']}"
        suggested, large = unproven(d), too_large(d)
        if large is not None and (large.gain or 0.0) > max((c.gain or 0.0 for c in suggested), default=float("-inf")):
            return (
                f"Something is there {where}. It has the course of {called(large.effect.id)} ({sizes(large)}), but is more "
                f"than {POLICY.range_factor:g} times the largest size that is usual, so that it is not named. Check the rates "
                "and units that session.toml states."
            )
        if suggested:
            ids = " or ".join(called(c.effect.id) for c in suggested)
            proof = REPEAT if d.comparison.held_out == "none" else suggested[0].next_measurement
            return f"Something is there {where}. It may be {ids}, but this session cannot prove it. To prove it: {proof}."
        if d.comparison.where[0].of_sets:
            return f"Something is there {where}. This session cannot prove what it is."
        return f"Something is there that no effect of the library explains: {where}."
    return UNTIMED if _is_untimed(d.comparison) else nothing_found(d.candidates, d.comparison.to_json())


def sure(d: Diagnosis) -> Candidate | None:
    """The first candidate that is sure by itself; None if there is none."""
    return next((c for c in d.candidates if c.named), None)


def _also(d: Diagnosis, best: Candidate) -> str:
    """The other effects that a diagnosis names, beside the one of its headline; empty if there are none."""
    axes: dict[str, set[str]] = {}
    for c in d.candidates:
        if c.decision == "add" and c.effect.id not in best.group and c.effect.id != best.effect.id:
            axes.setdefault(" or ".join(title_of(i).lower() for i in sorted(c.group) or [c.effect.id]), set()).add(c.axis)
    told = "; ".join(f"{titles} on {', '.join(sorted(on))}" for titles, on in axes.items())
    return f" Also: {told}." if told else ""


def too_large(d: Diagnosis) -> Candidate | None:
    """The likeliest effect on the axis of the unknown misfit that is certain, but larger than any sensor has it."""
    tested = number_tested(d.candidates)
    found = (c for c in d.candidates if d.unknown is not None and c.axis == d.unknown["axis"] and c.values)
    large = [c for c in found if not in_range(c) and not c.contradicted and proven(c, tested)]
    return max(large, key=lambda c: c.gain or 0.0, default=None)


def unproven(d: Diagnosis) -> list[Candidate]:
    """The candidates that a diagnosis suggests on the axis of the unknown misfit; a slow effect makes no line and no band."""
    if d.unknown is None:
        return []
    band_hz = d.comparison.where[0].band_hz
    slow_hz = 0.0 if band_hz is None else band_hz[0]
    found = (c for c in d.candidates if c.decision == "suggest" and c.axis == d.unknown["axis"])
    return [c for c in found if c.effect.fast or slow_hz <= 0.5 / BLOCK_S]


WHOLE = {
    ("poles", 0.0): "a pure delay", ("poles", 1.0): "a first-order low-pass",
}  # fmt: skip
"""Words for whole numbers among the parameters, by unit and value."""


def sizes(c: Candidate) -> str:
    """A candidate's parameters with their standard errors, as text."""
    return sized(c.effect, c.values, c.se)


def sized(effect: Effect, values: Mapping[str, float], se: Mapping[str, float]) -> str:
    """The values of an effect's parameters, as text; a fraction is told in percent."""
    units = {p.name: to_read(p.unit) for p in effect.parameters}
    shown: dict[str, str] = {}
    for name, value in values.items():
        error, (factor, unit) = se.get(name), in_percent(units.get(name, units.get(name.removesuffix("_sd"), "")))
        shown[name] = plus_minus(factor * value, None if error is None else factor * error, unit)
    named = (WHOLE.get((units.get(name, ""), values[name]), f"{name} {text}") for name, text in shown.items())
    in_words = effect.told(values, shown) if isinstance(effect, InWords) else ""
    return in_words or ", ".join(named)


NOT_KEPT = "not kept (-o model.toml keeps it)"


def kept_in(target: Path | str | None, ids: Iterable[str], verdict: str) -> str:
    """Where the model of these effects is kept, or why ``explain`` writes none."""
    if verdict == "implausible":
        return f"{target or 'the model'} is not written, because the session contradicts itself; see its warnings"
    return f"{target or NOT_KEPT}: {', '.join(ids)}"


def print_before_after(before: Comparison, after: Comparison, model: Path | None) -> None:
    """Print the levels before and after an effect was added, and the file of the new model."""
    print_warnings(before.warnings)
    if before.note:
        stdout.print(before.note, style="bold")
    if before.angles is not None and after.angles is not None:
        levels = [angle_row("before", before.angles.level()), angle_row("after", after.angles.level())]
        table("Held-out angles, deg", ANGLES, levels)
        stdout.print(f"{model or NOT_KEPT}: {', '.join(after.fit.model.ids)}")
        stdout.print(headline(after), style="bold")
        return
    names, everything = axis_names(after)
    old, new = before.pooled, after.pooled
    pairs = [(names[axis], before.per_axis[axis], after.per_axis[axis]) for axis in after.per_axis]
    figures = [
        (name, b.excess_se_dps, [a.floor_dps, b.excess_dps, a.excess_dps])
        for name, b, a in [*pairs, (everything, old, new)]
    ]  # fmt: skip
    unit = unit_of(v for *_, values in figures for v in values)
    rows = [[name, *(unit.text(v, 2, error) for v in values)] for name, error, values in figures]
    table(f"Held-out excess error over the noise floor, {unit.name}", ["axis:", "floor", "before", "after"], rows)
    stdout.print(f"{model or NOT_KEPT}: {', '.join(after.fit.model.ids)}")
    part = explained(before.pooled, after.pooled, before.cycles)
    if part is not None:
        few = before.cycles < POLICY.few_cycles
        where = ", within power cycles" if few else ""
        told = (v.excess_within_dps if few else v.excess_dps for v in (new, old))
        a, b = (unit.text(v, 2, old.excess_within_se_dps if few else old.excess_se_dps) for v in told)
        stdout.print(f"{percentage(part, 1)} of the squared excess of all axes explained{where}: 1 - ({a} / {b})²")
    stdout.print(headline(after), style="bold")


def write_page(path: Path, c: Comparison) -> None:
    """Write the comparison as one self-contained HTML page. Raises InputError if the file cannot be written."""
    from gyrocal.present import page, pictures

    drawn = [(title, pictures.png_data(figure)) for title, figure in pictures.of_comparison(c).values()]
    text = page.render(
        "present/report.html", page.name_of(c.fit.session), headline(c), c.verdict == "adequate", c.warnings,
        model=", ".join(c.fit.model.ids), held_out=c.held_out, levels=judged_rows(c), level_columns=level_columns(c),
        judged_by=judged_by(c), stands_on=stands_on(c.to_json()), high_floor=high_floor(c.to_json()),
        where=where_rows(c), where_columns=WHERE, pictures=drawn, parameters=parameter_rows(c), parameter_columns=PARAMETERS,
        moved=moved_rows(c.moved or ()), moved_columns=MOVED, note=c.note,
    )  # fmt: skip
    page.write(path, text)


PARAMETERS = ["effect:", "axis:", "parameter:", "value", "± se", "unit:"]


def parameter(value: float, se: float | None, unit: str) -> list[str]:
    """A parameter to the second digit of its standard error, that error, and the unit; five digits and a dash without one.

    A fraction is told in percent, as it is in the words of an effect.
    """
    factor, unit = in_percent(unit)
    told = pair(value, se, factor, 0) if places(se, -1) >= 0 else (f"{factor * value:.5g}", UNKNOWN)
    return [*told, unit]


def in_percent(unit: str) -> tuple[float, str]:
    """What a number in a unit is multiplied by to be told, and its unit then."""
    return (100.0, unit.replace("fraction", "%", 1)) if unit.startswith("fraction") else (1.0, unit)


def parameter_rows(c: Comparison) -> list[list[Any]]:
    """The rows below ``PARAMETERS``."""
    rows = []
    for listed in c.fit.model.lines():
        units = {p.name: to_read(p.unit) for p in listed.kind.parameters}
        for name, value in listed.values.items():
            se = listed.se.get(name)
            unit = units.get(name, units.get(name.removesuffix("_sd"), ""))
            rows.append([listed.id, listed.axis, name, *parameter(value, se, unit)])
    return rows
