"""The curve from evidence to stated probability, from results of the frozen part of ``gyrocal benchmark edge``.

    gyrocal benchmark edge --part frozen --stop 300 --workers 2 --out frozen.jsonl
    python benchmarks/edge_curve.py frozen.jsonl

It prints the constants of ``host/gyrocal/evidence/curve.py``. Log odds in each of :data:`EDGES` have a share of true names, and
neighbours are pooled until the shares rise (isotonic regression). The last one is the lower 95 % bound of its share. Checks and
limits of the held-out gain are today's (``edge_table.decided_today``), so that results of an earlier version serve as well.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import edge_table
from benchmarks.edge_table import Row

from gyrocal.evidence.curve import sure

EDGES = (-14.0, -4.0, -2.2, -0.85, 0.0, 1.4, 2.2, 4.6, 10.0, np.inf)
MOST = 20.0
"""Log odds beyond this count as this in the means."""
LEADS = 0.0
LIKELY_NOISE = 0.3
Knots = list[tuple[float, float]]


def pairs(rows: Sequence[Row], passed: bool) -> list[tuple[float, bool]]:
    """Log odds of every candidate that passes its checks (or that does not), and whether it acts on its axis."""
    out = []
    for row in rows:
        right = {tuple(name) for name in row["truth"]["right"]}
        for c in row["candidates"]:
            if row["error"] is not None or c.get("log_odds") is None:
                continue
            checks = edge_table.checks_of(c)
            if (checks is None or checks.passed(c["log_odds"])) is passed:
                out.append((min(float(c["log_odds"]), MOST), (c["effect"], c["axis"]) in right))
    return out


def rising(groups: Sequence[tuple[float, int, int]]) -> list[tuple[float, int, int]]:
    """Sums of log odds, true names and names, neighbours pooled until the share of true names rises."""
    out: list[tuple[float, int, int]] = []
    for group in groups:
        out.append(group)
        while len(out) > 1 and out[-1][1] * out[-2][2] <= out[-2][1] * out[-1][2]:
            last = out.pop()
            out[-1] = (out[-1][0] + last[0], out[-1][1] + last[1], out[-1][2] + last[2])
    return out


def curve(rows: Sequence[Row]) -> tuple[Knots, float]:
    """The knots, and the share of true names among those of which a check fails."""
    passed, failed = (np.array(pairs(rows, of) or [(0.0, False)]) for of in (True, False))
    groups = []
    for low, high in pairwise(EDGES):
        inside = (passed[:, 0] >= low) & (passed[:, 0] < high)
        if inside.any():
            groups.append((float(passed[inside, 0].sum()), int(passed[inside, 1].sum()), int(inside.sum())))
    *lower, (total, true, n) = rising(groups)
    top = 1 - float(edge_table.upper(n - true, n) or 0.0)
    knots = [*((total / n, min(true / n, top)) for total, true, n in lower), (total / n, top)]
    led = failed[failed[:, 0] >= LEADS]
    return [(round(x, 4), round(y, 3)) for x, y in knots], round(float(led[:, 1].mean()) if len(led) else 0.0, 3)


def named(today: Sequence[Row]) -> tuple[list[bool], list[bool]]:
    """Of the names that the evidence can judge: is each true? Those that are sure, then those of the tests alone."""
    kept, taken = [], []
    for row in today:
        right = {tuple(name) for name in row["truth"]["right"]}
        judged = {(c["effect"], c["axis"]) for c in row["candidates"] if c.get("log_odds") is not None}
        names = set(edge_table.sure(row))
        kept += [name in right for name in names & judged]
        taken += [name in right for name in (set(edge_table.sure(edge_table.of_tests(row))) - names) & judged]
    return kept, taken


def unnamed(today: Sequence[Row]) -> list[bool]:
    """Of the effects of which the evidence is sure, and which are no sure names: is each true?"""
    found = []
    for row in today:
        right, named = {tuple(name) for name in row["truth"]["right"]}, edge_table.sure(row)
        for c in row["candidates"]:
            name = (c["effect"], c["axis"])
            if c["log_odds"] is not None and name not in named and sure(c["log_odds"], edge_table.checks_of(c)):
                found.append(name in right)
    return found


def of_noise(rows: Sequence[Row]) -> list[tuple[float, bool]]:
    """The log odds of noise alone on each axis of which they are told, and whether nothing acts there."""
    found = []
    for row in rows:
        truth, told = row["truth"], row.get("alternatives") or []
        acts = {axis for _, axis in truth["right"]} | ({truth["disturbance"]["axis"]} if truth["disturbance"] else set())
        for one in told:
            if not one["effects"] and not one["unnamed"] and "log_odds" in one:
                found.append((float(one["log_odds"]), one["axis"] not in acts))
    return found


def noise_alone(rows: Sequence[Row]) -> tuple[float, float]:
    """The likeliest addition to the log odds of noise alone, and the lower 95 % bound of the share among the likely ones."""
    odds, true = (np.array(column) for column in zip(*of_noise(rows), strict=True))

    def cost(added: float) -> float:
        sign = np.where(true, -1.0, 1.0)
        return float(np.logaddexp(0.0, sign * (odds + added)).sum())

    likely = true[odds >= LIKELY_NOISE]
    bound = edge_table.upper(int((~likely).sum()), likely.size)
    return round(float(minimize_scalar(cost).x), 2), 0.0 if bound is None else round(1 - bound, 3)


def main() -> None:
    rows = [row for path in sys.argv[1:] for row in edge_table.read(Path(path))]
    knots, failed = curve(rows)
    print(f"KNOTS = {tuple(knots)}")
    print(f"FAILED = {failed}")
    today = [edge_table.decided_today(row) for row in rows if row["error"] is None]
    counts = edge_table.names(today)
    print(f"sure names today: {counts['sure']}, wrong {counts['wrong']}, reached {counts['reached']['count']}")
    kept, taken = named(today)
    bound = edge_table.upper(kept.count(False), len(kept))
    print(f"NAMED = {0.0 if bound is None else round(1 - bound, 3)}")
    if of_noise(rows):
        added, most = noise_alone(rows)
        print(f"NOISE, SUREST_NOISE = {added}, {most}")
    refused = unnamed(today)
    print(f"UNNAMED = {round(sum(refused) / max(len(refused), 1), 3)}")
    print(f"effects of which the evidence is sure, without a sure name: {sum(refused)} of {len(refused)} true")
    print(f"sure names that the evidence can judge: {sum(kept)} of {len(kept)} true")
    print(f"those of the tests alone that it does not support: {sum(taken)} of {len(taken)} true")
    for passed in (True, False):
        found = pairs(rows, passed)
        for least in EDGES[-3:-1]:
            said = [true for log_odds, true in found if log_odds >= least]
            word = "passed" if passed else "failed"
            print(f"checks {word}: {sum(said)} of {len(said)} names with log odds of {least:g} and more are true")


if __name__ == "__main__":
    main()
