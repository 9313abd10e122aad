"""One sensor over months in the terminal."""

from __future__ import annotations

from pathlib import Path

from gyrocal.errors import InputError
from gyrocal.fleet.history import History, histories
from gyrocal.present.output import emit, plus_minus, stdout, table, working


def show_history(folder: Path, model: str | None, axis: str | None, out: Path | None, as_json: bool) -> None:
    """Join the sessions of a folder, print how the parameters age, and write the model of the latest date to ``out``."""
    with working(as_json) as say:
        found = histories(folder, model, say)
    if out is not None and len(found) > 1:
        raise InputError(f"--out {out}: {folder} has sessions of {len(found)} boards; name a folder with those of one")
    if out is not None:
        found[0].model.save(out)
    if as_json:
        emit({"boards": [h.to_json() | {"parameters": _parameters(h, axis)} for h in found]})
        return
    for each in found:
        print_history(each, axis)
    if out is not None:
        stdout.print(f"{out}: {', '.join(found[0].model.ids)}")


def _parameters(each: History, axis: str | None) -> list[object]:
    return [p for p in each.to_json()["parameters"] if axis in (None, p["axis"])]


def print_history(each: History, axis: str | None) -> None:
    """A line for each parameter: its value at the latest date, its change a year, and whether that counts."""
    rows = [
        [a.effect, a.axis, a.name, plus_minus(a.value, a.se),
         "-" if a.per_year is None else plus_minus(a.per_year, a.per_year_se), f"{a.scatter:.2g}", "yes" if a.ages else "no"]
        for a in each.aging if axis in (None, a.axis)
    ]  # fmt: skip
    title = f"{each.board}: {len(each.dates)} sessions, {each.dates[0]} to {each.dates[-1]}"
    table(title, ["effect:", "axis:", "parameter:", f"on {each.dates[-1]}", "a year", "scatter", "ages:"], rows)
    ageing = [f"{a.effect} on {a.axis}" for a in each.aging if a.ages]
    stdout.print(f"Ageing: {', '.join(dict.fromkeys(ageing))}." if ageing else "Nothing ages beyond its errors.", style="bold")
