"""The library of effects in the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from gyrocal.effects.base import Effect
from gyrocal.effects.packages import package_of
from gyrocal.present.output import stdout, table


def listed(found: Iterable[Effect]) -> list[dict[str, Any]]:
    """Each effect as plain data, with its parameters and the package that brings it (empty: gyrocal, or the user)."""
    return [
        {
            "effect": kind.id, "title": kind.title, "cause": kind.cause, "equation": kind.equation,
            "parameters": [
                {"name": p.name, "unit": p.unit, "typical": list(p.typical), "source": p.source} for p in kind.parameters
            ],
            "looks_like": kind.looks_like, "next_measurement": kind.measure_next, "on_device": kind.on_device,
            "package": package_of(kind),
        }
        for kind in found
    ]  # fmt: skip


def print_library(found: Iterable[Effect]) -> None:
    """A line for each effect: id, title and equation."""
    table("", ["effect:", "title:", "equation:"], [[kind.id, kind.title, kind.equation] for kind in found])
    stdout.print("More of one: gyrocal effects ID")


def print_effect(kind: Effect) -> None:
    """What an effect is, its parameters with their usual sizes, and what looks like it."""
    stdout.print(f"{kind.id}: {kind.title}", style="bold")
    stdout.print(f"{kind.cause}\n{kind.equation}")
    rows = [[p.name, p.unit, f"{p.typical[0]:g} to {p.typical[1]:g}", p.source] for p in kind.parameters]
    table("", ["parameter:", "unit:", "usually:", "source:"], rows)
    stdout.print(f"Looks like: {kind.looks_like}\nMeasure next: {kind.measure_next}")
