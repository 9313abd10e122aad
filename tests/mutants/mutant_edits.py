"""Careless edits of a source text, each in one place, as by a slip of the pen. Python by its syntax tree, C by its text."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin"}
SCALED_BY = 2.0


@dataclass(frozen=True)
class Edit:
    """A slip: its kind, the place (characters from the start of the text) and what is written there instead."""

    kind: str
    start: int
    stop: int
    new: str

    def of(self, text: str) -> str:
        """The text with the slip."""
        return text[: self.start] + self.new + text[self.stop :]


def python_edits(text: str) -> Iterator[Edit]:
    """The edits of a Python text. Prose, annotations and f-strings stay as they are."""
    rows = text.splitlines(keepends=True)
    starts = [0]
    for row in rows:
        starts.append(starts[-1] + len(row))

    def place(line: int, column: int) -> int:  # the tree counts bytes
        return starts[line - 1] + len(rows[line - 1].encode()[:column].decode())

    for node in _expressions(ast.parse(text)):
        start, stop = place(node.lineno, node.col_offset), place(node.end_lineno or 0, node.end_col_offset or 0)
        for kind, new in _changed(node):
            yield Edit(kind, start, stop, new)


def _expressions(node: ast.AST) -> Iterator[ast.expr]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                if isinstance(child, ast.expr):
                    yield child
                yield from _expressions(child)


def _changed(node: ast.expr) -> Iterator[tuple[str, str]]:
    """Kinds of slips in one expression, each with the expression's new text."""
    if isinstance(node, ast.Constant) and type(node.value) is int:
        yield "off by one", str(node.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value != 0:
        yield "constant scaled", repr(SCALED_BY * node.value)
    elif isinstance(node, ast.Compare):
        others = COMPARISONS.get(type(node.ops[0]), ())
        # the border itself counts for whole numbers alone: no measured number lies on it
        for other in others if len(others) < 2 or _is_whole(node.left) or _is_whole(node.comparators[0]) else others[1:]:
            yield "comparison", ast.unparse(ast.Compare(node.left, [other(), *node.ops[1:]], node.comparators))
    elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC and not isinstance(node.left, ast.JoinedStr):
        yield "arithmetic", _as_it_stands(ast.BinOp(node.left, ARITHMETIC[type(node.op)](), node.right))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield "sign" if isinstance(node.op, ast.USub) else "not", f"({ast.unparse(node.operand)})"
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield "and, or", _as_it_stands(ast.BoolOp(other, node.values))
    elif isinstance(node, ast.Call):
        yield from _changed_call(node)


def _is_whole(node: ast.expr) -> bool:
    """True for what is a whole number by its looks: a constant, a length, a size."""
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id == "len"
    if isinstance(node, ast.Attribute):
        return node.attr == "size"
    return isinstance(node, ast.Constant) and type(node.value) is int


def _as_it_stands(node: ast.expr) -> str:
    """In parentheses, because the new operator may bind less than the old one did."""
    return f"({ast.unparse(node)})"


def _changed_call(node: ast.Call) -> Iterator[tuple[str, str]]:
    called = node.func
    name = called.id if isinstance(called, ast.Name) else called.attr if isinstance(called, ast.Attribute) else ""
    if name in EXTREMES:
        other = EXTREMES[name]
        swapped = ast.Name(other) if isinstance(called, ast.Name) else ast.Attribute(called.value, other)  # type: ignore[union-attr]
        yield "min, max", ast.unparse(ast.Call(swapped, node.args, node.keywords))
    if node.keywords and node.keywords[-1].arg is not None:
        yield "argument dropped", ast.unparse(ast.Call(called, node.args, node.keywords[:-1]))


C_SWAPS = {
    "<=": ("<", ">"), ">=": (">", "<"), "<": ("<=", ">="), ">": (">=", "<="), "==": ("!=",), "!=": ("==",),
    "&&": ("||",), "||": ("&&",), "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "+=": ("-=",), "-=": ("+=",),
    "&": ("|",), "|": ("&",), "<<": (">>",), ">>": ("<<",), "++": ("--",), "--": ("++",),
}  # fmt: skip
C_OPERATOR = re.compile(r"(?<= )(<<|>>|<=|>=|==|!=|&&|\|\||\+=|-=|[-+*/<>&|])(?= )|\+\+|--")
C_NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e-?\d+)?|0x[\dA-F]+|\d+)(?=[uf]?\b)(?![.x])")
C_SIGN = re.compile(r"(?<=[(\[])-(?=[\w(])|(?<=[=,?:] )-(?=[\w(])|(?<=return )-(?=[\w(])")
C_NOT = re.compile(r"!(?=[\w(])")
C_CONDITION = re.compile(r"(?<=\bif \()(?=\w)")
C_EXTREME = re.compile(r"\bf(min|max)\b")
C_ARGUMENT = r"([^(){},\0]+)"
C_ARGUMENTS = re.compile(rf"(?<=\w\(){C_ARGUMENT}, {C_ARGUMENT}(?=[,)])|(?<=, ){C_ARGUMENT}, {C_ARGUMENT}(?=\))")
C_STATEMENT = re.compile(r"^ +(?!return\b|static\b|const\b|break\b|continue\b)[\w.>\[\]-]+(?: [-+*/|&]?= .*|\(.*\));$")


def c_edits(text: str) -> Iterator[Edit]:
    """The edits of the functions of a C text. Comments, strings and directives of the preprocessor stay as they are."""
    start = 0
    for row in _blanked(text).splitlines(keepends=True):
        if row.startswith("    ") and not row.lstrip().startswith("#"):
            for kind, first, last, new in _changed_row(row.rstrip("\n")):
                yield Edit(kind, start + first, start + last, new)
        start += len(row)


def _blanked(text: str) -> str:
    """The text with spaces in place of comments, strings and characters."""
    hidden = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\])*\'', re.DOTALL)
    return hidden.sub(lambda found: re.sub(r"[^\n]", "\x00", found.group()), text)


def _changed_row(row: str) -> Iterator[tuple[str, int, int, str]]:
    """Kind, place and new text of each slip in a row of code."""
    for found in C_OPERATOR.finditer(row):
        for other in C_SWAPS[found.group()]:
            yield "operator", *found.span(), other
    for found in C_NUMBER.finditer(row):
        number = found.group()
        scaled = "." in number
        if scaled:
            new = repr(SCALED_BY * float(number))
        else:
            new = f"{int(number, 16) + 1:#04x}" if number.startswith("0x") else str(int(number) + 1)
        yield "constant scaled" if scaled else "off by one", *found.span(), new
    for found in C_SIGN.finditer(row):
        yield "sign", *found.span(), ""
    for found in C_NOT.finditer(row):
        yield "not", *found.span(), ""
    for found in C_CONDITION.finditer(row):
        yield "not", *found.span(), "!"
    for found in C_ARGUMENTS.finditer(row):
        first, second = (text for text in found.groups() if text is not None)
        if first != second:
            yield "arguments swapped", *found.span(), f"{second}, {first}"
    for found in C_EXTREME.finditer(row):
        yield "min, max", *found.span(), "fmax" if found.group() == "fmin" else "fmin"
    if C_STATEMENT.match(row):
        yield "statement dropped", len(row) - len(row.lstrip()), len(row), ";"
