"""Two pages of the site that are made from the code: the help of every command, and what :mod:`gyrocal.api` offers."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import click
from typer.main import get_command

from gyrocal import api
from gyrocal.cli import about, app, command_modules

QUOTED = re.compile(r"(: |-> )'([^']*)'")
"""An annotation in a signature, which stands there as a string."""
ROLE = re.compile(r":(?:func|class|mod|meth|data|attr):(?=`)")


def commands() -> str:
    """The help of every command, one section each, as the command itself prints it."""
    group = get_command(app)
    parent = click.Context(group, info_name="gyrocal")
    parts = ["# Commands", "", "This is what `gyrocal VERB --help` prints.", ""]
    for verb, module in command_modules().items():
        command = group.get_command(parent, verb)  # type: ignore[attr-defined]
        parts += [f"## {verb}", "", about(module), "", "```text", *_help(command, parent, verb), "```", ""]
    return "\n".join(parts)


def _help(command: click.Command, parent: click.Context, verb: str) -> list[str]:
    context = click.Context(command, info_name=verb, parent=parent, terminal_width=100, max_content_width=100)
    lines = command.get_help(context).splitlines()
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            lines += ["", *_help(inner, context, name)]
    return lines


def python() -> str:
    """The signature and docstring of everything in :mod:`gyrocal.api`, with the fields and methods of its classes."""
    parts = ["# Python, in full", "", "Import it from `gyrocal.api`. [The Python interface](../api.md) is shorter.", ""]
    for name in sorted(api.__all__, key=str.lower):
        thing = getattr(api, name)
        parts += [f"## {name}", "", *_described(name, thing)]
        if inspect.isclass(thing):
            for member, inner, text in _members(thing):
                parts += [f"### {name}.{member}", "", *_described(member, inner, text)]
    return "\n".join(parts)


def _described(name: str, thing: Any, text: str | None = None) -> list[str]:
    """Signature, if there is one to call, and docstring."""
    lines = []
    if callable(thing) and not (inspect.isclass(thing) and issubclass(thing, Exception)):
        signature = QUOTED.sub(r"\1\2", str(inspect.signature(thing)).replace("gyrocal.", ""))
        lines += ["```python", *textwrap.wrap(f"{name}{signature}", 110, subsequent_indent="    "), "```", ""]
    doc = text if text is not None else inspect.getdoc(thing) or ""
    return [*lines, *_markdown(doc), ""]


def _members(kind: type) -> Iterator[tuple[str, Any, str | None]]:
    """Fields with a docstring, properties, and methods of a class, its own and those that it inherits from the project."""
    fields = {f.name for f in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    yield from ((name, None, text) for name, text in _field_docs(kind) if name in fields)
    for name, member in inspect.getmembers_static(kind):
        if name.startswith("_") or name in fields or not _of_project(kind, name):
            continue
        member = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if inspect.isfunction(member) or isinstance(member, property):
            yield name, member, None


def _of_project(kind: type, name: str) -> bool:
    return next((base.__module__ for base in kind.__mro__ if name in vars(base)), "").startswith("gyrocal")


def _field_docs(kind: type) -> list[tuple[str, str]]:
    """Name and docstring (the string that follows it) of each annotated field in a class's source."""
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body  # type: ignore[attr-defined]
    return [
        (field.target.id, inspect.cleandoc(text.value.value))
        for field, text in itertools.pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    ]


def _markdown(doc: str) -> list[str]:
    """A docstring with roles as plain code and its sections (Args, Returns, Raises) as lists."""
    lines = ROLE.sub("", doc).replace("``", "`").replace("`~", "`").splitlines()
    section = False
    for i, line in enumerate(lines):
        if line.rstrip() in ("Args:", "Returns:", "Raises:", "Yields:"):
            lines[i], section = f"\n**{line.strip(' :')}**\n", True
        elif section and line.startswith("    ") and not line.startswith("     ") and ":" in line:
            lines[i] = f"- {line.strip()}"
        elif section:
            lines[i] = line.strip() if not line.startswith("     ") else f"  {line.strip()}"
    return lines
