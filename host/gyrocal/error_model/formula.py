"""A user's own effect in one line: ``k1*sin(3*theta) + k2*temp_c*rate``.

A formula is parsed and never executed as Python. It consists of numbers, the variables and functions below, ``+ - * / **`` and
parentheses. Every other name is a parameter. A parameter that multiplies a whole term is linear. A parameter inside a term is
nonlinear and needs a start value: ``A*exp(-t/tau); tau=5``. With ``; each run`` the linear parameters differ in size and sign
from run to run, about zero.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gyrocal.effects.base import Effect, OfEachRun, Parameter, Values, effect, effects
from gyrocal.effects.coding import AboutZero, Coding
from gyrocal.effects.wave import TableWave
from gyrocal.errors import InputError, did_you_mean
from gyrocal.noise.axis import COMPONENTS
from gyrocal.parameter import POSITIVE
from gyrocal.recording.session import Array, Run
from gyrocal.variables.base import symbols

FUNCTIONS: dict[str, Callable[..., Array]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs,
    "tanh": np.tanh, "sign": np.sign, "max": np.maximum, "min": np.minimum,
}  # fmt: skip
PAIRS = ("max", "min")
"""Functions of two arguments; the others take one."""
CONSTANTS = {"pi": np.pi}
EACH_RUN = "each run"
OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
LARGEST = 1e300
"""The largest number in a formula."""
MOST_NODES = 10_000
"""The most elements of a formula: names, numbers, operators and calls."""
SEARCH = 10.0
"""A nonlinear parameter is searched from its start value divided by this factor to its start value times this factor."""


class FormulaEffect(Effect):
    """An effect given by a formula. ``start`` holds the start values of its nonlinear parameters. A file may subclass it."""

    cause, looks_like = "Given by the user as a formula.", "any effect with the same shape in this session"
    measure_next = "vary the quantities on which the formula depends"

    def __init__(self, text: str, name: str = "formula") -> None:
        if not name.isidentifier() or (type(self) is FormulaEffect and (name in effects() or name in COMPONENTS)):
            raise InputError(f"formula {text!r}: {name!r} cannot be its name; use letters, digits and _, and no effect's id")
        self.id = name  # type: ignore[misc]
        self.equation = text  # type: ignore[misc]
        expression, *settings = (part.strip() for part in text.split(";"))
        self.scope = "run" if EACH_RUN in settings else "session"  # type: ignore[misc]
        self.start = dict(_setting(part, text) for part in settings if part not in ("", EACH_RUN))
        taken = self.start.keys() & (symbols().keys() | CONSTANTS.keys() | FUNCTIONS.keys())
        if taken:
            raise InputError(f"formula {text!r}: {sorted(taken)[0]} is not a parameter; give it another name")
        tree = _parse(expression, text)
        self.terms = [_term(node, sign, self.start, text) for node, sign in _summands(tree, 1.0)]
        names = [name for name, _ in self.terms]
        doubled = {n for n in names if names.count(n) > 1}
        if doubled:
            raise InputError(f"formula {text!r}: {sorted(doubled)[0]} multiplies two terms; bracket them together")
        self.linear = tuple(names)
        used = {n for _, node in self.terms for n in _names(node)} - CONSTANTS.keys()
        self.variables = sorted(used & symbols().keys())
        self.nonlinear = tuple(sorted(used - symbols().keys()))  # type: ignore[misc]
        if self.scope == "run":
            self.uncorrected = OfEachRun.uncorrected  # type: ignore[misc]
        elif {"theta", "turn"} & set(self.variables):
            self.uncorrected = TableWave.uncorrected  # type: ignore[misc]
        unset = [n for n in self.nonlinear if n not in self.start]
        if unset:
            raise InputError(f'formula {text!r}: say where {unset[0]} starts, e.g. "{expression}; {unset[0]}=1"')
        self.title = f"your formula {expression}"  # type: ignore[misc]
        searched = {n: (abs(self.start[n]) / SEARCH, abs(self.start[n]) * SEARCH) for n in self.nonlinear}
        self.parameters = (  # type: ignore[misc]
            *(Parameter(n, "", (0.0, np.inf), "the user") for n in names if n not in searched),
            *(Parameter(n, "", r, "the user", bounds=POSITIVE, search=r) for n, r in searched.items()),
        )

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        for name in self.variables:
            symbol = symbols()[name]
            if any(symbol.values(r, axis) is None for r in runs):
                return f"{name} ({symbol.meaning}) in every run"
        return None

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        return [{**dict.fromkeys(self.linear, 0.0), **{n: self.start[n] for n in self.nonlinear}}]

    @property
    def coding(self) -> Coding:
        return AboutZero(self.linear) if self.scope == "run" else super().coding

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        known: dict[str, Any] = {**CONSTANTS, **{n: values.get(n, self.start.get(n)) for n in self.nonlinear}}
        for name in self.variables:
            known[name] = symbols()[name].values(run, axis)
        with np.errstate(all="ignore"):
            columns = [np.broadcast_to(np.asarray(_value(node, known), dtype=np.float64), len(run)) for _, node in self.terms]
        if not all(np.all(np.isfinite(c)) for c in columns):
            raise InputError(f"formula {self.equation!r}: not finite on {run.file}; mind logarithms, roots and divisions")
        return np.column_stack(columns)


def effect_or_formula(text: str) -> Effect:
    """The effect given by an id or by ``[NAME:] FORMULA``, as on the command line. Raises InputError if it is neither."""
    if not any(c in text for c in "*+-/(: "):
        return effect(text)
    name, colon, rest = text.partition(":")
    return FormulaEffect(rest.strip(), name.strip()) if colon else FormulaEffect(text)


def _setting(part: str, text: str) -> tuple[str, float]:
    name, _, value = part.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise InputError(f"formula {text!r}: {part!r} is not name=value with a number") from None


def _parse(expression: str, text: str) -> ast.expr:
    try:
        tree = ast.parse(expression, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise InputError(f"formula {text!r}: cannot be read as a formula") from None
    nodes = list(ast.walk(tree))
    if len(nodes) > MOST_NODES:
        raise InputError(f"formula {text[:40]!r}...: it has {len(nodes)} elements, at most {MOST_NODES} are read")
    for node in nodes:
        _check(node, text)
    return tree


def _check(node: ast.AST, text: str) -> None:
    """Accept only the elements of a formula. Raises InputError, which names the element, for anything else of Python."""
    fine = isinstance(node, ast.Name | ast.Load | ast.UnaryOp | ast.USub | ast.UAdd)
    fine = fine or (isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool))
    fine = fine or (isinstance(node, ast.BinOp) and type(node.op) in OPERATORS) or type(node) in OPERATORS
    if isinstance(node, ast.Call):
        fine = isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and not node.keywords
        fine = fine and len(node.args) == (2 if node.func.id in PAIRS else 1)  # type: ignore[attr-defined]
    if isinstance(node, ast.Constant) and fine and not abs(node.value) <= LARGEST:  # type: ignore[arg-type]
        raise InputError(f"formula {text!r}: a number is too large")
    if not fine:
        raise InputError(
            f"formula {text!r}: {type(node).__name__} is not allowed; use numbers, + - * / **, {', '.join(FUNCTIONS)}, "
            f"pi, {', '.join(symbols())} and names of your own"
        )


def _summands(node: ast.expr, sign: float) -> list[tuple[ast.expr, float]]:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        right = sign if isinstance(node.op, ast.Add) else -sign
        return _summands(node.left, sign) + _summands(node.right, right)
    if isinstance(node, ast.UnaryOp):
        return _summands(node.operand, -sign if isinstance(node.op, ast.USub) else sign)
    return [(node, sign)]


def _factors(node: ast.expr) -> list[ast.expr]:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        return _factors(node.left) + _factors(node.right)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        one = ast.BinOp(ast.Constant(1.0), ast.Div(), node.right)
        return [*_factors(node.left), one]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return [ast.Constant(-1.0), *_factors(node.operand)]
    return [node]


def _term(node: ast.expr, sign: float, start: Mapping[str, float], text: str) -> tuple[str, ast.expr]:
    """The linear parameter of a term and the rest of the term. Exactly one free name must multiply the term."""
    factors = _factors(node)
    fixed = symbols().keys() | CONSTANTS.keys() | start.keys()
    free = [f for f in factors if isinstance(f, ast.Name) and f.id not in fixed]
    if len(free) != 1:
        near = "".join(did_you_mean(f.id, symbols()) for f in free)
        raise InputError(
            f"formula {text!r}: the term {ast.unparse(node)!r} needs exactly one parameter of its own in front, e.g. "
            f"k*(...){near}"
        )
    rest: ast.expr = ast.Constant(sign)
    for factor in factors:
        if factor is not free[0]:
            rest = ast.BinOp(rest, ast.Mult(), factor)
    parameter = free[0]
    assert isinstance(parameter, ast.Name)
    return parameter.id, rest


def _names(node: ast.expr) -> set[str]:
    called = {n.func.id for n in ast.walk(node) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)} - called


def _value(node: ast.expr, known: Mapping[str, Any]) -> Any:
    """The value of the formula, evaluated node by node."""
    if isinstance(node, ast.Constant):
        return np.float64(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return known[node.id]
    if isinstance(node, ast.UnaryOp):
        value = _value(node.operand, known)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp):
        return OPERATORS[type(node.op)](_value(node.left, known), _value(node.right, known))
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    return FUNCTIONS[node.func.id](*(np.asarray(_value(a, known), dtype=np.float64) for a in node.args))
