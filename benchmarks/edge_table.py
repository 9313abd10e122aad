"""The figures of ``gyrocal benchmark edge``: are sure names right, how many effects are reached, do probabilities hold?

A name is sure if its decision is ``add`` and it stands alone in its group. Every function takes rows of the results' file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.sessions_by_seed import bounds
from scipy.stats import binomtest

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import evident_gain
from gyrocal.effects.base import effects
from gyrocal.evidence.checked import Checks
from gyrocal.present.output import stdout, table

Row = dict[str, Any]
NEAREST = (0.0, 2.0, 4.0, 8.0, 12.01, np.inf)
DISTURBED = (0.0, 3.0, 10.0, 30.0, np.inf)
PROBABILITY = (0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.93, 1.0)
ONE_SIDED = 0.05


def sure(row: Row) -> list[tuple[str, str]]:
    """Effect and axis of every sure name."""
    return [(c["effect"], c["axis"]) for c in row["candidates"] if c["decision"] == "add" and len(c["group"]) <= 1]


def wrong(row: Row) -> list[tuple[str, str]]:
    """The sure names that were not planted on their axis."""
    right = {tuple(name) for name in row["truth"]["right"]}
    return [name for name in sure(row) if name not in right]


def reached(row: Row) -> list[bool]:
    """Of each planted effect: is it a sure name on an axis that shows it?"""
    names = set(sure(row))
    return [bool(names & {tuple(name) for name in effect["right"]}) for effect in row["truth"]["effects"]]


def grouped(row: Row) -> list[bool]:
    """Of each planted effect: is it a sure name, or shown in a group that is added or suggested, by itself or by its equal?"""
    told = [c for c in row["candidates"] if c["decision"] in ("add", "suggest") and len(c["group"]) > 1]
    shown, names = {(id_, c["axis"]) for c in told for id_ in c["group"]}, set(sure(row))
    found = []
    for effect in row["truth"]["effects"]:
        right = {tuple(name) for name in effect["right"]}
        equal = {(id_, axis) for _, axis in right for id_ in effect["equivalents"]}
        found.append(bool(names & right or shown & (right | equal)))
    return found


def of_tests(row: Row) -> Row:
    """A row with the decisions of the tests alone, without the evidence of sets."""
    said = [dict(c, decision=c["by_tests"][0], group=c["by_tests"][1]) for c in row["candidates"]]
    return dict(row, candidates=said)


def decided_today(row: Row) -> Row:
    """A row with the sure names that today's checks and limits of the held-out gain let stand; the others are suggested."""

    def stands(c: dict[str, Any]) -> bool:
        again = Candidate(
            effects()[c["effect"]], c["axis"], c["decision"], log_odds=c["log_odds"], checks=checks_of(c),
            gain=c["heldout_gain"], gain_se=c["heldout_gain_se"],
        )  # fmt: skip
        return again.supported and (c["by_tests"][0] == "add" or evident_gain(again))

    kept: list[dict[str, Any]] = [
        c if c["decision"] != "add" or len(c["group"]) > 1 or stands(c) else dict(c, decision="suggest", group=[])
        for c in row["candidates"]
    ]  # fmt: skip
    return dict(row, candidates=kept)


def checks_of(c: dict[str, Any]) -> Checks | None:
    """The checks of a candidate of a row."""
    said = c.get("checks")
    return None if said is None else Checks(**{k: v for k, v in said.items() if k != "passed"})


def raised(rows: Sequence[Row]) -> dict[str, Any] | None:
    """The tests alone, as they are, and with a limit raised until they are wrong as seldom as the tool.

    The limits are the held-out gain of a name, and that gain in its standard errors. The one that reaches more is told.
    None for rows of a version that did not keep the decisions of the tests.
    """
    if not all("by_tests" in c for row in rows for c in row["candidates"]):
        return None
    allowed = sum(len(wrong(row)) for row in rows)
    tested = [of_tests(row) for row in rows]
    tested = [dict(row, candidates=[c for c in row["candidates"] if (c["effect"], c["axis"]) in sure(row)]) for row in tested]
    best: dict[str, Any] | None = None
    for name, by in (("heldout_gain", lambda c: c["heldout_gain"]), ("gain_errors", _gain_errors)):
        limits = sorted({float(by(c)) for row in tested for c in row["candidates"] if c["heldout_gain"] is not None})
        for limit in [-np.inf, *limits, np.inf]:
            kept = [dict(row, candidates=[c for c in row["candidates"] if _above(c, by, limit)]) for row in tested]
            if sum(len(wrong(row)) for row in kept) <= allowed:
                found = {"limit": name, "at": limit} | names(kept)
                if best is None or found["reached"]["count"] > best["reached"]["count"]:
                    best = found
                break
    return {"as_they_are": names([of_tests(row) for row in rows]), "raised": best}


def _gain_errors(c: dict[str, Any]) -> float:
    return float(c["heldout_gain"] / c["heldout_gain_se"]) if c["heldout_gain_se"] else np.inf


def _above(c: dict[str, Any], by: Callable[[dict[str, Any]], float], limit: float) -> bool:
    return limit == -np.inf or (c["heldout_gain"] is not None and by(c) > limit)


def counted(count: int, n: int) -> dict[str, Any]:
    """A share with the exact two-sided 95 % interval of Clopper and Pearson."""
    return {"count": count, "of": n, "share": count / n if n else None, "within": bounds(count, n) if n else None}


def upper(count: int, n: int) -> float | None:
    """The exact one-sided 95 % upper bound of a share (Clopper and Pearson)."""
    from scipy.stats import beta

    if not n:
        return None
    return 1.0 if count == n else float(beta.ppf(1 - ONE_SIDED, count + 1, n - count))


def names(rows: Sequence[Row]) -> dict[str, Any]:
    """Sure names, those that are wrong, and what was reached of the planted effects."""
    said, false = sum(len(sure(row)) for row in rows), sum(len(wrong(row)) for row in rows)
    effects = sum(len(row["truth"]["effects"]) for row in rows)
    return {
        "cases": len(rows),
        "sure": said,
        "wrong": false,
        "wrong_share": false / said if said else None,
        "wrong_upper": upper(false, said),
        "reached": counted(sum(map(sum, map(reached, rows))), effects),
        "in_group": counted(sum(map(sum, map(grouped, rows))), effects),
    }


def table_of(rows: Sequence[Row]) -> dict[str, Any]:
    """All figures of the rows, as ``--json`` prints them."""
    done = [row for row in rows if row["error"] is None]
    nulls = [row for row in done if row["kind"] in ("null", "unknown")]
    cost = [row["seconds"] for row in done]
    kinds = list(dict.fromkeys(row["kind"] for row in done))
    with_effect = [row for row in done if len(row["truth"]["effects"]) == 1]
    return {
        "cases": len(rows),
        "failed": [{"case": row["case"], "error": row["error"]} for row in rows if row["error"] is not None],
        "all": names(done),
        "by_kind": {kind: names([row for row in done if row["kind"] == kind]) for kind in kinds},
        "by_nearest_sigma": _binned(with_effect, NEAREST, lambda row: row["truth"]["effects"][0]["nearest_sigma"]),
        "by_disturbance_sigma": {"none": names([row for row in done if row["truth"]["disturbance"] is None])}
        | _binned([r for r in done if r["truth"]["disturbance"]], DISTURBED, lambda row: row["truth"]["disturbance"]["sigma"]),
        "nulls_named": {
            kind: counted(sum(bool(sure(row)) for row in part), len(part))
            for kind, part in {
                "plain": [row for row in nulls if row["truth"]["disturbance"] is None],
                "disturbed": [row for row in nulls if row["truth"]["disturbance"] is not None],
            }.items()
        },
        "reliability": reliability(done),
        "behind_oracle": behind(done),
        "tests_alone": raised(done),
        "seconds": {"median": float(np.median(cost)), "mean": float(np.mean(cost)), "largest": max(cost)} if done else None,
        "wrong_names": [
            {"case": row["case"], "said": [list(name) for name in wrong(row)], "planted": row["truth"]["right"]}
            for row in done if wrong(row)
        ],
    }  # fmt: skip


def _binned(rows: Sequence[Row], edges: Sequence[float], value: Callable[[Row], float]) -> dict[str, Any]:
    return {
        f"{low:g}-{high:g}": names([row for row in rows if low <= value(row) < high])
        for low, high in pairwise(edges)
    }


def reliability(rows: Sequence[Row]) -> dict[str, Any] | None:
    """Of the candidates with a probability: how many in each bin, how many are true; None where none has one.

    ``capped`` is the highest probability that was given, with the share of true names among those that have it.
    """
    pairs = [
        (c["probability"], (c["effect"], c["axis"]) in {tuple(name) for name in row["truth"]["right"]})
        for row in rows for c in row["candidates"] if c.get("probability") is not None
    ]  # fmt: skip
    if not pairs:
        return None
    p, true = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])
    bins = []
    for low, high in pairwise(PROBABILITY):
        inside = (p >= low) & ((p < high) | (high == 1.0))
        n = int(inside.sum())
        mean = float(p[inside].mean()) if n else None
        bins.append({"from": low, "to": high, "mean_probability": mean, **counted(int(true[inside].sum()), n)})
    most = float(p.max())
    return {"bins": bins, "capped": {"probability": most, **counted(int(true[p == most].sum()), int((p == most).sum()))}}


def behind(rows: Sequence[Row]) -> dict[str, Any] | None:
    """The oracle's log posterior of its best set less that of the answered set, over the axes that were judged."""
    values = [v for row in rows for v in row["behind"].values() if v is not None]
    if not values:
        return None
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.9])
    far = int(np.sum(np.array(values) > np.log(100)))
    return {
        "axes": len(values), "quarter": float(low), "median": float(middle), "nine_tenths": float(high),
        "beyond_100": counted(far, len(values)),
    }  # fmt: skip


def compared(before: Sequence[Row], after: Sequence[Row]) -> dict[str, Any]:
    """Exact one-sided McNemar tests of the cases in both: fewer cases with a wrong name, and more effects reached, after.

    A case of one name that another generator made, with another truth, is left out.
    """
    old = {row["case"]: row for row in before if row["error"] is None}
    both = [(old[row["case"]], row) for row in after if row["error"] is None and row["case"] in old]
    pairs = [(a, b) for a, b in both if a["truth"] == b["truth"]]
    mistaken = [(bool(wrong(a)), bool(wrong(b))) for a, b in pairs]
    found = [hit for a, b in pairs for hit in zip(reached(a), reached(b), strict=True)]
    return {"cases": len(pairs), "wrong": _mcnemar(mistaken, fewer=True), "reached": _mcnemar(found, fewer=False)}


def _mcnemar(pairs: Sequence[tuple[bool, bool]], fewer: bool) -> dict[str, Any]:
    lost, gained = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    better = lost if fewer else gained
    p = float(binomtest(better, lost + gained, 0.5, alternative="greater").pvalue) if lost + gained else 1.0
    return {
        "before": sum(a for a, _ in pairs), "after": sum(b for _, b in pairs), "only_before": lost, "only_after": gained,
        "p": p,
    }  # fmt: skip


def read(path: Path) -> list[Row]:
    """The rows of a results' file; an unfinished last line is left out."""
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.is_file() else []
    return [json.loads(line) for line in lines if line]


def _share(found: dict[str, Any]) -> str:
    if not found["of"]:
        return "-"
    low, high = found["within"]
    return f"{found['count']}/{found['of']} {found['share']:.1%} ({low:.1%}-{high:.1%})"


def _row(label: str, found: dict[str, Any]) -> list[str]:
    bound = "-" if found["wrong_upper"] is None else f"{found['wrong_share']:.2%} (< {found['wrong_upper']:.2%})"
    numbers = [str(found[key]) for key in ("cases", "sure", "wrong")]
    return [label, *numbers, bound, _share(found["reached"]), _share(found["in_group"])]


def show(found: dict[str, Any]) -> None:
    """Print the figures as tables."""
    parts = {"all": found["all"]} | found["by_kind"]
    parts |= {f"nearest {k} sigma": v for k, v in found["by_nearest_sigma"].items() if v["cases"]}
    parts |= {f"disturbed {k}": v for k, v in found["by_disturbance_sigma"].items() if v["cases"]}
    header = ["cases:", "n", "sure", "wrong", "wrong share (95 % bound)", "reached", "in a group"]
    if found["tests_alone"] is not None:
        alone = found["tests_alone"]
        parts["the tests alone"] = alone["as_they_are"]
        parts[f"{alone['raised']['limit']} > {alone['raised']['at']:.3g}"] = alone["raised"]
    table(f"{found['cases']} cases, {len(found['failed'])} failed", header, [_row(k, v) for k, v in parts.items()])
    for kind, each in found["nulls_named"].items():
        stdout.print(f"nulls named, {kind}: {_share(each)}", markup=False)
    if found["reliability"] is not None:
        bins = found["reliability"]["bins"]
        means = ["-" if b["mean_probability"] is None else f"{b['mean_probability']:.3f}" for b in bins]
        listed = [[f"{b['from']:g}-{b['to']:g}", mean, _share(b)] for b, mean in zip(bins, means, strict=True)]
        table("are the probabilities right?", ["probability:", "mean", "true"], listed)
        capped = found["reliability"]["capped"]
        stdout.print(f"highest probability {capped['probability']:.4f}: true {_share(capped)}", markup=False)
    if found["behind_oracle"] is not None:
        b = found["behind_oracle"]
        text = f"log posterior behind the oracle's best: median {b['median']:.2f}, nine tenths below {b['nine_tenths']:.1f}"
        stdout.print(f"{text}; beyond ln 100: {_share(b['beyond_100'])}", markup=False)
    for one in found["wrong_names"]:
        said, planted = (", ".join(f"{id_} on {axis}" for id_, axis in one[key]) or "nothing" for key in ("said", "planted"))
        stdout.print(f"wrong {one['case']}: said {said}; planted {planted}", markup=False)
    if found.get("compared"):
        for key, c in found["compared"].items():
            if key != "cases":
                stdout.print(f"{key}: {c['before']} before, {c['after']} after, one-sided p {c['p']:.3g}", markup=False)
