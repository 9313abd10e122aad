"""An error model: which effects make the reading of each axis, with their parameters; the TOML file a person edits."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomli_w

from gyrocal.effects import base
from gyrocal.effects.base import Effect, Values
from gyrocal.error_model.formula import FormulaEffect, effect_or_formula
from gyrocal.errors import InputError
from gyrocal.files import replace_text
from gyrocal.recording.session import AXES, Run

FORMAT = "gyrocal-model/1"
BASE = ("scale", "bias")
RANDOM = ("turn_on_bias", "colored_noise")
"""What the built-in ``default`` has beyond ``paper``: reported with their sizes, never called missing."""

HEADER = """\
# A gyrocal error model: what each axis reads beyond the true rate. One line an effect; to undo an effect, remove its line.
# `calibrate` and `export` use the values; `compare`, `diagnose` and `add` fit them anew to their session.
# Values are as fitted, NAME_se their standard errors, NAME_sd their spread from run to run or power cycle to power cycle.
"""


@dataclass(frozen=True)
class Term:
    """One effect on one axis. ``values`` holds its parameters (none yet where it has not been fitted), ``se`` their errors."""

    effect_id: str
    axis: str
    values: Values = field(default_factory=dict)
    se: Values = field(default_factory=dict)
    own: Effect | None = field(default=None, repr=False, compare=False)
    """An effect that is not in the library: a user's, or a probe of the comparison."""
    of_run: Mapping[int, Values] = field(default_factory=dict, repr=False)
    """Nonlinear parameters that a fit has found to be a run's own, by the run's index."""

    @staticmethod
    def of(kind: Effect, axis: str, values: Values | None = None) -> Term:
        """A term of an effect that may be a user's own."""
        own = None if base.effects().get(kind.id) is kind else kind
        return Term(kind.id, axis, {} if values is None else values, own=own)

    @property
    def effect(self) -> Effect:
        return self.own or base.effect(self.effect_id)

    def values_in(self, run: Run) -> Values:
        """The values that hold in one run."""
        return {**self.values, **self.of_run.get(run.index, {})}

    @property
    def spreadable(self) -> str | None:
        """The nonlinear parameter that may differ from run to run: that of an effect with one column of each run's own."""
        kind = self.effect
        if kind.scope != "run" or len(kind.groups(self.values)) != 1:
            return None
        return next((name for name in kind.nonlinear if name in self.values), None)


@dataclass(frozen=True)
class Model:
    """Terms for each axis, and the level of the white noise, deg/s a sample."""

    name: str
    terms: tuple[Term, ...]
    white_sd_dps: Values = field(default_factory=dict)

    @staticmethod
    def builtin(name: str) -> Model:
        """``paper``: scale, bias and white noise, eq. (4) to the letter. ``default``: also turn-on bias and coloured noise."""
        ids = {"paper": BASE, "default": BASE + RANDOM}
        if name not in ids:
            raise InputError(f"--model {name}: neither a file nor one of {', '.join(ids)}")
        return Model(name, tuple(Term(i, axis) for i in ids[name] for axis in AXES))

    @staticmethod
    def open(source: str | Path | Model | None = None) -> Model:
        """A built-in by name, or a TOML file; ``default`` when nothing is given."""
        if isinstance(source, Model):
            return source
        if source is None:
            return Model.builtin("default")
        path = Path(source)
        if str(source) in ("paper", "default"):
            return Model.builtin(str(source))
        if path.suffix != ".toml" and not path.is_file():
            return Model.builtin(str(source))
        try:
            raw = tomllib.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InputError(
                f"{path}: no such model; `gyrocal add` makes one, `default` and `paper` are built in"
            ) from None
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"{path}: {error}") from None
        return _parse(raw, path)

    @property
    def ids(self) -> list[str]:
        """Effect ids, each once, in order."""
        return list(dict.fromkeys(t.effect_id for t in self.terms))

    def on(self, axis: str) -> list[Term]:
        return [t for t in self.terms if t.axis == axis]

    def term(self, effect_id: str, axis: str) -> Term | None:
        return next((t for t in self.terms if t.effect_id == effect_id and t.axis == axis), None)

    def value(self, effect_id: str, axis: str, name: str, default: float = 0.0) -> float:
        """One parameter's value, or ``default`` where the model has no such term."""
        term = self.term(effect_id, axis)
        return default if term is None else term.values.get(name, default)

    def with_term(self, term: Term) -> Model:
        """The model with a term added, or replaced where effect and axis are there."""
        if self.term(term.effect_id, term.axis) is None:
            return replace(self, name=self._name(add=term.effect_id), terms=(*self.terms, term))
        same = (term.effect_id, term.axis)
        return replace(self, terms=tuple(term if (t.effect_id, t.axis) == same else t for t in self.terms))

    def add(self, effect_id: str, axis: str = "z") -> Model:
        """The model with an effect (or a formula) on one axis, not fitted yet: ``compare`` and ``fit`` find its parameters."""
        if axis not in AXES:
            raise InputError(f"axis is {axis!r}, not x, y or z")
        return self.with_term(Term.of(effect_or_formula(effect_id), axis))

    def without(self, effect_id: str, axis: str | None = None) -> Model:
        """The model without an effect, on one axis or all."""
        kept = tuple(t for t in self.terms if not (t.effect_id == effect_id and axis in (None, t.axis)))
        return replace(self, terms=kept)

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
        """Raises InputError where a file does not hold this model: what it was to replace is then kept."""
        read = _parse(tomllib.loads(partial.read_text(encoding="utf-8")), partial)
        if read.name != self.name or [_shape(t) for t in read.terms] != [_shape(t) for t in self._in_order()]:
            raise InputError(f"the model {self.name!r} cannot be written so that it reads back; the file is left as it was")

    def _in_order(self) -> list[Term]:
        """Terms as the file has them: effect by effect."""
        return [t for effect_id in self.ids for t in self.terms if t.effect_id == effect_id]

    def toml(self) -> str:
        """The file's text: one line an effect, the equation above it."""
        lines = [HEADER + f'format = "{FORMAT}"', f"name = {_quoted(self.name)}"]
        if self.white_sd_dps:
            levels = ", ".join(f"{axis} = {_number(sd)}" for axis, sd in self.white_sd_dps.items())
            lines.append(f"white_sd_dps = {{ {levels} }}  # one sample's white noise")
        lines.append("effects = [")
        for effect_id in self.ids:
            kind = next(t.effect for t in self.terms if t.effect_id == effect_id)
            lines.append(f"  # {_one_line(kind.title)}: {_one_line(kind.equation)}")
            for term in self.terms:
                if term.effect_id == effect_id:
                    numbers = {**term.values, **{f"{n}_se": se for n, se in term.se.items() if math.isfinite(se)}}
                    parts = [f"id = {_quoted(term.effect_id)}", f"axis = {_quoted(term.axis)}"]
                    if isinstance(term.own, FormulaEffect):
                        parts.append(f"formula = {_quoted(term.own.equation)}")
                    parts += [f"{name} = {_number(value)}" for name, value in numbers.items()]
                    lines.append("  { " + ", ".join(parts) + " },")
        return "\n".join([*lines, "]", ""])


def _quoted(text: str) -> str:
    """A TOML string."""
    return tomli_w.dumps({"text": text}).removeprefix("text = ").rstrip("\n")


def _one_line(text: str) -> str:
    """A text fit for a comment: no line breaks, nothing that cannot be printed."""
    return "".join(c if c.isprintable() else " " for c in text)


def _shape(term: Term) -> tuple[str, str, str, dict[str, str], dict[str, str]]:
    """What a file holds of a term, numbers to the digits that it keeps."""
    formula = term.own.equation if isinstance(term.own, FormulaEffect) else ""
    se = {n: _number(v) for n, v in term.se.items() if math.isfinite(v)}
    return term.effect_id, term.axis, formula, {n: _number(v) for n, v in term.values.items()}, se


def _number(value: float) -> str:
    text = f"{value:.9g}"
    return text if any(c in text for c in ".einf") else text + ".0"


def _parse(raw: Mapping[str, Any], path: Path) -> Model:
    if raw.get("format") != FORMAT:
        raise InputError(f"{path}: format is {raw.get('format')!r}, this version reads {FORMAT!r}")
    entries = raw.get("effects")
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise InputError(f"{path}: effects must be a list of {{ id = ..., axis = ... }}")
    terms: list[Term] = []
    for number, entry in enumerate(entries, start=1):
        where = f"{path}: effect {number}"
        formula = entry.get("formula")
        own: Effect | None = None
        try:
            if formula is not None:
                own = FormulaEffect(str(formula), str(entry.get("id")))
            kind = own or base.effect(str(entry.get("id")))
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        axis = entry.get("axis")
        if axis not in AXES:
            raise InputError(f"{where} ({kind.id}): axis is {axis!r}, not x, y or z")
        known = {p.name for p in kind.parameters} | {f"{p.name}_sd" for p in kind.parameters}
        values: Values = {}
        se: Values = {}
        for name, value in entry.items():
            if name in ("id", "axis", "formula"):
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(f"{where} ({kind.id}): {name} is {value!r}, not a finite number")
            positive = name in kind.nonlinear or name.endswith(("_sd", "_se")) or name == "sd_dps"
            if positive and (value < 0 or (name.endswith("tau_s") and value == 0)):
                raise InputError(f"{where} ({kind.id}): {name} is {value:g}, must be positive")
            if name in known:
                values[name] = float(value)
            elif name.removesuffix("_se") in known and name.endswith("_se"):
                se[name.removesuffix("_se")] = float(value)
            else:
                raise InputError(f"{where} ({kind.id}): no parameter {name!r}; it has {', '.join(sorted(known))}")
        if any(t.effect_id == kind.id and t.axis == axis for t in terms):
            raise InputError(f"{where} ({kind.id}): stands twice for axis {axis}")
        terms.append(Term(kind.id, axis, values, se, own))
    if not terms:
        raise InputError(f"{path}: no effects; a model has scale and bias at least")
    strange = sorted(set(raw) - {"format", "name", "white_sd_dps", "effects"})
    if strange:
        raise InputError(f"{path}: no key {strange[0]!r}; a model has format, name, white_sd_dps and effects")
    white = raw.get("white_sd_dps", {})
    if not isinstance(white, dict) or not all(
        a in AXES and isinstance(v, int | float) and v >= 0 for a, v in white.items()
    ):
        raise InputError(f"{path}: white_sd_dps must give a level for x, y or z")
    return Model(str(raw.get("name", path.stem)), tuple(terms), {a: float(v) for a, v in white.items()})
