"""An error model: the effects and the noise of each axis, and the TOML file that a person can edit."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from gyrocal.effects import base, own
from gyrocal.effects.base import Effect, Role, Values
from gyrocal.effects.packages import package_of
from gyrocal.effects.reading_fault import Fault
from gyrocal.error_model import accelerometer
from gyrocal.error_model.accelerometer import AccelerometerModel
from gyrocal.error_model.fitted_on import FittedOn, parsed
from gyrocal.error_model.formula import FormulaEffect, effect_or_formula
from gyrocal.error_model.term import Line, Term
from gyrocal.errors import InputError, did_you_mean
from gyrocal.files import read_toml, replace_text
from gyrocal.noise.axis import COMPONENTS, AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.parameter import NOT_NEGATIVE, Described
from gyrocal.recording.session import AXES
from gyrocal.shown import Shown, exporter

if TYPE_CHECKING:
    from gyrocal.error_model.corrector import Corrector

__all__ = ["FORMAT", "Line", "Model", "Term"]

FORMAT = "gyrocal-model/1"

HEADER = """\
# A gyrocal error model: what each axis reads beyond the true rate. One line an effect; to undo an effect, remove its line.
# `calibrate` and `export` use the values; `compare`, `diagnose` and `add` fit them anew to their session.
# Values are as fitted, NAME_se their standard errors, NAME_sd their spread from run to run or power cycle to power cycle.
"""


@dataclass(frozen=True, repr=False)
class Model(Shown):
    """Terms and noise of each axis, and what they were fitted on."""

    name: str
    terms: tuple[Term, ...]
    noise: Mapping[str, AxisNoise] = field(default_factory=dict)
    fitted_on: FittedOn = field(default_factory=FittedOn)
    accelerometer: AccelerometerModel | None = None

    @staticmethod
    def builtin(name: str) -> Model:
        """The built-in model of this name.

        ``paper`` has scale, bias and white noise, exactly as in eq. (4). ``default`` also has turn-on bias and coloured noise.
        Raises InputError for another name.
        """
        noises = {"paper": AxisNoise(), "default": AxisNoise(drift=Drift(), turn_on_bias=TurnOnBias())}
        if name not in noises:
            near = did_you_mean(name, noises)
            raise InputError(
                f"model {name}: neither a file nor one of {', '.join(noises)}{near}; `gyrocal explain` makes a file"
            )
        ids = [base.with_role(role).id for role in Role]
        return Model(name, tuple(Term(i, axis) for i in ids for axis in AXES), dict.fromkeys(AXES, noises[name]))

    @staticmethod
    def open(source: str | Path | Model | None = None) -> Model:
        """A built-in by name, or a TOML file; ``default`` when nothing is given."""
        if isinstance(source, Model):
            return source
        if source is None:
            return Model.builtin("default")
        if not isinstance(source, str | os.PathLike):
            raise InputError(f"model is a {type(source).__name__}; give a Model, paper, default, or a model file")
        path = Path(source)
        if str(source) in ("paper", "default"):
            return Model.builtin(str(source))
        if path.suffix != ".toml" and not path.is_file():
            return Model.builtin(str(source))
        missing = "no such model; `gyrocal explain` and `gyrocal add` make one, `default` and `paper` are built in"
        return _parse(read_toml(path, missing, "a model, as `gyrocal add` writes it"), path)

    @property
    def ids(self) -> list[str]:
        """Ids of all effects and noise components, in order and without repetition."""
        return list(dict.fromkeys(line.id for line in self.lines()))

    @property
    def axes(self) -> list[str]:
        """The axes on which the model has a term."""
        return [axis for axis in AXES if self.on(axis) or self.noise_on(axis).components]

    def on(self, axis: str) -> list[Term]:
        """The terms on one axis."""
        return [t for t in self.terms if t.axis == axis]

    def about(self, axis: str) -> Model:
        """The terms and the noise of one axis alone."""
        return replace(self, terms=tuple(self.on(axis)), noise={a: noise for a, noise in self.noise.items() if a == axis})

    def noise_on(self, axis: str) -> AxisNoise:
        """The noise of one axis."""
        return self.noise.get(axis, AxisNoise())

    @property
    def effect_ids(self) -> list[str]:
        """Ids of the effects that not every sensor has, in order and without repetition."""
        return list(dict.fromkeys(line.id for line in self.lines() if not line.inherent))

    def faults(self, axis: str) -> list[tuple[Fault, Values]]:
        """The faults of the reading that the model contains on an axis, with their values."""
        return [(t.fault, t.values) for t in self.on(axis) if t.values and t.fault is not None]

    def lines(self) -> Iterator[Line]:
        """The lines of all effects and noise components; noise follows scale and bias."""
        last = max((i for i, t in enumerate(self.terms) if t.effect.role is not None), default=-1)
        for term in self.terms[: last + 1]:
            yield self._line(term)
        for component_id in COMPONENTS:
            for axis in AXES:
                for component in self.noise_on(axis).components:
                    if component.id == component_id:
                        yield Line(component, axis, component.values, component.se)
        for term in self.terms[last + 1 :]:
            yield self._line(term)

    def values_json(self) -> list[dict[str, Any]]:
        """Each value of the lines with its standard error."""
        return [
            {"effect": line.id, "axis": line.axis, "name": name, "value": value, "se": line.se.get(name)}
            for line in self.lines()
            for name, value in line.values.items()
        ]

    def _line(self, term: Term) -> Line:
        """The line of a term; that of the scale also gives its spread over power cycles."""
        spread = self.noise_on(term.axis).turn_on_scale
        if term.effect.role is not Role.SCALE or spread is None:
            return Line(term.effect, term.axis, term.values, term.se, term.held)
        name = _turn_on_scale_name(term.effect)
        se = {} if spread.se is None else {name: spread.se}
        return Line(term.effect, term.axis, {**term.values, name: spread.sd}, {**term.se, **se})

    def term(self, effect_id: str, axis: str) -> Term | None:
        """The term of an effect on one axis, or None if the model lacks it."""
        return next((t for t in self.terms if t.effect_id == effect_id and t.axis == axis), None)

    def line(self, effect_id: str, axis: str) -> Line | None:
        """The line of an effect or a noise component on one axis."""
        return next((line for line in self.lines() if (line.id, line.axis) == (effect_id, axis)), None)

    @property
    def bias_dps(self) -> dict[str, float]:
        """The fitted bias by axis, deg/s, of the axes that have one."""
        terms = [t for t in self.terms if t.effect.role is Role.BIAS and t.values]
        return {t.axis: t.values[t.effect.linear[0]] for t in terms}

    def value(self, effect_id: str, axis: str, name: str, default: float = 0.0) -> float:
        """The value of one parameter of an effect or a noise component; ``default`` if the model does not have it."""
        line = self.line(effect_id, axis)
        return default if line is None else line.values.get(name, default)

    def with_term(self, term: Term) -> Model:
        """The model with a term added, or replaced if the model already has its effect on its axis."""
        if self.term(term.effect_id, term.axis) is None:
            return replace(self, name=self._name(add=term.effect_id), terms=(*self.terms, term))
        same = (term.effect_id, term.axis)
        return replace(self, terms=tuple(term if (t.effect_id, t.axis) == same else t for t in self.terms))

    def holding(self, effect_id: str, axis: str, name: str, value: float | None) -> Model:
        """The model with a parameter of an effect held at a value, or fitted again if ``value`` is None.

        Raises InputError if the model lacks the effect on this axis, or if a fit cannot hold the parameter or the value.
        """
        term = self.term(effect_id, axis)
        if term is None:
            raise InputError(f"the model has no {effect_id} on {axis}; add it first")
        if name not in term.holdable:
            raise InputError(f"{name} of {effect_id} cannot be held{did_you_mean(name, term.holdable)}")
        refusal = None if value is None else term.effect.parameter(name).refusal(value)
        if refusal is not None:
            raise InputError(f"{effect_id}: {refusal}")
        held = tuple(n for n in term.holdable if n in term.held and n != name)
        if value is not None:
            term, held = replace(term, values={**term.values, name: value}), (*held, name)
        return self.with_term(replace(term, held=held))

    def add(self, effect: str | Effect | type[Effect], axis: str = "z") -> Model:
        """The model with an effect, a formula or a noise component on one axis; ``compare`` and ``fit`` determine its size.

        ``effect`` is an id, a formula, or a class of the user's own, whose id is known from then on. Raises InputError for an
        unknown id, an invalid formula or another axis than x, y or z.
        """
        if axis not in AXES:
            raise InputError(f"axis is {axis!r}, not x, y or z")
        effect_id = effect if isinstance(effect, str) else own.known(effect).id
        if effect_id in COMPONENTS:
            noise = {**self.noise, axis: self.noise_on(axis).having(COMPONENTS[effect_id])}
            return replace(self, name=self._name(add=effect_id), noise=noise)
        return self.with_term(Term.of(effect_or_formula(effect_id), axis))

    def without(self, effect_id: str, axis: str | None = None) -> Model:
        """The model without an effect or a noise component, on one axis or on all axes."""
        if effect_id in COMPONENTS:
            changed = {a: n.without(effect_id) if axis in (None, a) else n for a, n in self.noise.items()}
            return replace(self, noise=changed)
        kept = tuple(t for t in self.terms if not (t.effect_id == effect_id and axis in (None, t.axis)))
        return replace(self, terms=kept)

    def correct(self, frame: Any, bias_dps: Mapping[str, float] | None = None, power_on_s: float | None = None) -> Any:
        """Remove the model's effects from a table of readings; see :func:`gyrocal.error_model.correction.correct_frame`."""
        from gyrocal.error_model.correction import correct_frame

        return correct_frame(self, frame, bias_dps, power_on_s)

    def corrector(self, bias_dps: Mapping[str, float] | None = None) -> Corrector:
        """What corrects single samples, or arrays of them, as they come; see :class:`gyrocal.error_model.corrector.Corrector`.

        ``bias_dps`` is this power cycle's bias by axis, deg/s; the model's bias is used on the other axes. Raises InputError if
        the model has no fitted values.
        """
        from gyrocal.error_model.corrector import Corrector

        return Corrector(self, bias_dps)

    def export(self, out: str | Path, form: str = "header", **options: Any) -> Any:
        """Write the model into the folder ``out`` for another program; see :func:`gyrocal.calibration.exported.export`."""
        return exporter()(self, out, form, **options)

    def _name(self, add: str) -> str:
        return self.name if add in self.name.split("+") else f"{self.name}+{add}"

    def save(self, path: str | Path) -> None:
        """Write the file whole or not at all."""
        target = Path(path)
        try:
            replace_text(target, self.toml(), self._check_written)
        except OSError as error:
            raise InputError(f"{target}: {error.strerror}") from None

    def _check_written(self, partial: Path) -> None:
        """Raise InputError if a file does not contain this model. The file that it should replace is then kept."""
        read = _parse(tomllib.loads(partial.read_text(encoding="utf-8")), partial)
        same = (read.name, read.fitted_on, read.accelerometer) == (self.name, self.fitted_on, self.accelerometer)
        if not same or [_shape(line) for line in read.lines()] != [_shape(line) for line in self._grouped()]:
            raise InputError(f"the model {self.name!r} cannot be written so that it reads back; the file is left as it was")

    def _grouped(self) -> list[Line]:
        """The lines in the order of the file, effect by effect."""
        listed = list(self.lines())
        return [line for effect_id in self.ids for line in listed if line.id == effect_id]

    def toml(self) -> str:
        """The text of the file: one line for each effect, with its equation above it."""
        lines = [HEADER + f'format = "{FORMAT}"', f"name = {_quoted(self.name)}"]
        white = {axis: n.white_sd_dps for axis, n in self.noise.items() if n.white_sd_dps is not None}
        if white:
            levels = ", ".join(f"{axis} = {_number(sd)}" for axis, sd in white.items())
            lines.append(f"white_sd_dps = {{ {levels} }}  # one sample's white noise")
        if self.fitted_on.corrected:
            lines.append(f"corrected = {_quoted(self.fitted_on.corrected)}  # this had corrected the readings before the fit")
        if self.fitted_on.ranges:
            ranges = ", ".join(f"{name} = [{low!r}, {high!r}]" for name, (low, high) in self.fitted_on.ranges.items())
            lines.append(f"fitted_on = {{ {ranges} }}  # `apply` counts what lies beyond these ranges")
        lines += [] if self.accelerometer is None else self.accelerometer.toml()
        lines.append("effects = [")
        for _, group in groupby(self._grouped(), key=lambda line: line.id):
            same = list(group)
            lines.append(f"  # {_one_line(same[0].kind.title)}: {_one_line(same[0].kind.equation)}")
            for line in same:
                numbers = {**line.values, **{f"{n}_se": se for n, se in line.se.items() if math.isfinite(se)}}
                parts = [f"id = {_quoted(line.id)}", f"axis = {_quoted(line.axis)}"]
                if line.formula:
                    parts.append(f"formula = {_quoted(line.formula)}")
                if package := package_of(line.kind):
                    parts.append(f"package = {_quoted(package)}")
                parts += [f"{name} = {_number(value)}" for name, value in numbers.items()]
                if line.held:
                    parts.append(f"held = [{', '.join(map(_quoted, line.held))}]")
                lines.append("  { " + ", ".join(parts) + " },")
        return "\n".join([*lines, "]", ""])


def _quoted(text: str) -> str:
    """A TOML string."""
    return tomli_w.dumps({"text": text}).removeprefix("text = ").rstrip("\n")


def _one_line(text: str) -> str:
    """A text without line breaks and unprintable characters, for a comment."""
    return "".join(c if c.isprintable() else " " for c in text)


def _shape(line: Line) -> tuple[str, str, str, dict[str, str], dict[str, str]]:
    """The content of a line as a file stores it, with numbers rounded to the digits of the file."""
    se = {n: _number(v) for n, v in line.se.items() if math.isfinite(v)}
    return line.id, line.axis, line.formula, {n: _number(v) for n, v in line.values.items()}, se


def _number(value: float) -> str:
    text = f"{value:.9g}"
    return text if any(c in text for c in ".einf") else text + ".0"


def _parse(raw: Mapping[str, Any], path: Path) -> Model:
    if raw.get("format") != FORMAT:
        raise InputError(f"{path}: format is {raw.get('format')!r}, this version reads {FORMAT!r}")
    entries = raw.get("effects")
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise InputError(f"{path}: effects must be a list of {{ id = ..., axis = ... }}")
    lines = [_parse_line(entry, f"{path}: effect {number}") for number, entry in enumerate(entries, start=1)]
    for number, line in enumerate(lines, start=1):
        if any((other.id, other.axis) == (line.id, line.axis) for other in lines[: number - 1]):
            raise InputError(f"{path}: effect {number} ({line.id}): stands twice for axis {line.axis}")
    if not lines:
        raise InputError(f"{path}: no effects; a model has scale and bias at least")
    keys = ("format", "name", "white_sd_dps", "corrected", "fitted_on", "accelerometer", "effects")
    strange = sorted(set(raw) - set(keys))
    if strange:
        raise InputError(f"{path}: no key {strange[0]!r}{did_you_mean(strange[0], keys)}; a model has {', '.join(keys)}")
    white = raw.get("white_sd_dps", {})
    if not isinstance(white, dict) or not all(
        a in AXES and isinstance(v, int | float) and v >= 0 for a, v in white.items()
    ):
        raise InputError(f"{path}: white_sd_dps must give a level for x, y or z")
    noise = {axis: AxisNoise(float(white[axis]) if axis in white else None) for axis in AXES}
    terms: list[Term] = []
    for line in lines:
        if isinstance(line.kind, Effect):
            term, spread = _term(line.kind, line)
            terms.append(term)
            noise[line.axis] = noise[line.axis] if spread is None else replace(noise[line.axis], turn_on_scale=spread)
        else:
            noise[line.axis] = noise[line.axis].having(COMPONENTS[line.id].with_values(line.values, line.se))
    fitted_on = parsed(raw.get("fitted_on", {}), raw.get("corrected", ""), str(path))
    acc = accelerometer.parsed(raw.get("accelerometer"), str(path))
    return Model(str(raw.get("name", path.stem)), tuple(terms), noise, fitted_on, acc)


def _term(kind: Effect, line: Line) -> tuple[Term, TurnOnScale | None]:
    """The term of a line, and the spread over power cycles that the line of the scale also contains."""
    name = _turn_on_scale_name(kind) if kind.role is Role.SCALE else ""
    values, se = ({n: v for n, v in given.items() if n != name} for given in (line.values, line.se))
    spread = TurnOnScale(line.values[name], line.se.get(name)) if name in line.values else None
    return replace(Term.of(kind, line.axis, values), se=se, held=line.held), spread


def _turn_on_scale_name(kind: Effect) -> str:
    """The name of the spread over power cycles in the line of the scale."""
    return f"{kind.linear[0]}_sd"


def _parse_line(entry: Mapping[str, Any], where: str) -> Line:
    """One entry of ``effects`` in a model file."""
    name, formula, package = str(entry.get("id")), entry.get("formula"), entry.get("package")
    if package is not None and formula is None and name not in base.effects():
        raise InputError(f"{where}: effect {name!r} is of the package {package}, which is not installed: pip install {package}")
    kind: Described
    try:
        kind = COMPONENTS.get(name) or base.effect(name) if formula is None else FormulaEffect(str(formula), name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    axis = entry.get("axis")
    if axis not in AXES:
        raise InputError(f"{where} ({kind.id}): axis is {axis!r}, not x, y or z")
    values: Values = {}
    se: Values = {}
    numbers = {key: value for key, value in entry.items() if key not in ("id", "axis", "formula", "package", "held")}
    spreads = (replace(p, name=f"{p.name}_sd", bounds=NOT_NEGATIVE) for p in kind.parameters)
    known = {p.name: p for p in (*kind.parameters, *spreads)}
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{where} ({kind.id}): {key} is {value!r}, not a finite number")
        of = key.removesuffix("_se") if key not in known else None
        if of in known:
            se[of] = float(value)
            refusal = f"{key} is {value:g}, must be positive" if value < 0 else None
        elif key in known:
            values[key] = float(value)
            refusal = known[key].refusal(value)
        else:
            near = did_you_mean(key, known)
            raise InputError(f"{where} ({kind.id}): no parameter {key!r}{near}; it has {', '.join(sorted(known))}")
        if refusal is not None:
            raise InputError(f"{where} ({kind.id}): {refusal}")
    return Line(kind, axis, values, se, _parse_held(entry, kind, axis, values, where))


def _parse_held(entry: Mapping[str, Any], kind: Described, axis: str, values: Values, where: str) -> tuple[str, ...]:
    """The names that an entry holds."""
    held = entry.get("held", [])
    can = Term.of(kind, axis, values).holdable if isinstance(kind, Effect) else ()
    strange = next((name for name in held if name not in can), None) if isinstance(held, list) else held
    if strange is not None:
        which = ", ".join(can) or "none"
        raise InputError(f"{where} ({kind.id}): held names {strange!r}; of the parameters with a value it may name {which}")
    return tuple(held)
