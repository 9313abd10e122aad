"""What is pinned of each command's answer, as text in which figures stand with their errors (``compare.py``)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .compare import QUARTER, figure, with_quarters

Answer = Mapping[str, Any]
BLOCK_S = 0.25
"""Of the blocks whose scatter is the misfit."""


def of_compare(said: Answer) -> dict[str, Any]:
    return {
        **_words(said, "verdict", "residual", "held_out"),
        "model": " ".join(said["model"]),
        "levels": {"all": levels(said), **{axis: levels(of) for axis, of in said["per_axis"].items()}},
        "where": _findings(said["where"]),
        "parameters": _parameters(said["parameters"]),
        "warnings": _warnings(said),
    }


def levels(of: Answer) -> str:
    """Rms, floor and excess of one axis or of all.

    The squares of rms and floor differ by the excess's, so one error of the excess is ``excess·error / rms`` of either.
    """
    unit = next(key for key in of if key.startswith("rms_"))[3:]
    rms, floor, excess, error = (of[key + unit] for key in ("rms", "floor", "excess", "excess_se"))
    if error is None:
        return f"rms {figure(rms)}"
    about = max(excess, error) * error
    text = f"rms {figure(rms, about / rms)} floor {figure(floor, about / floor)} excess {figure(excess, error)}"
    within, within_error = (of.get(key + unit) for key in ("excess_within", "excess_within_se"))
    return text if within is None else f"{text} within {figure(within, within_error)}"


def of_diagnose(said: Answer) -> dict[str, Any]:
    looked_at: dict[str, dict[str, str]] = {"reject": defaultdict(str), "not_measurable": defaultdict(str)}
    for c in sorted(said["candidates"], key=lambda c: (c["effect"], c["axis"])):
        if c["decision"] in looked_at:
            looked_at[c["decision"]][c["effect"]] += c["axis"]
    told = [c for c in said["candidates"] if c["decision"] not in looked_at]
    return {
        **_words(said, "verdict", "residual"),
        "first": said["candidates"][0]["effect"] if told else None,
        "candidates": {f"{c['axis']} {c['effect']}": candidate(c) for c in told},
        **{key: " ".join(f"{effect}:{axes}" for effect, axes in of.items()) for key, of in looked_at.items()},
        "unknown": said["unknown"] and _words(said["unknown"], "axis", "against"),
        "warnings": _warnings(said),
    }


def candidate(c: Answer) -> dict[str, str]:
    """A candidate that is named or suggested; of a named one also what it removes.

    The part explained is ``1 - (after / before)^2``, so an error of the drop is at most ``2 error / drop`` of it. The drop of a
    mere suggestion hangs on the noise that its own fit finds, and its error says nothing of that.
    """
    said = {
        "decision": c["decision"],
        "group": " ".join(c["group"]),
        "together": " ".join(c["together"]),
        "parameters": ", ".join(f"{name} {figure(p['value'], p['se'])}" for name, p in c["parameters"].items()),
        "gain": figure(c["heldout_gain"], c["heldout_gain_se"]),
    }
    drop, error = c["excess_drop_dps"], c["excess_drop_se_dps"]
    if c["decision"] == "add" and drop:
        said["drop"] = figure(drop, error)
        if c["explained"] is not None:
            said["explained"] = figure(c["explained"], 2 * error / abs(drop))
    return {key: value for key, value in said.items() if value}


def of_add(said: Answer) -> dict[str, Any]:
    return {"before": levels(said["before"]), "after": of_compare(said["after"])}


def of_explain(said: Answer) -> dict[str, Any]:
    return {
        **_words(said, "verdict", "residual"),
        "model": " ".join(said["model"]),
        "steps": [
            f"{'+'.join(s['effects'])} on {'+'.join(sorted(s['axes']))}{'' if s['matters'] else ', too small to matter'}"
            for s in said["steps"]
        ],
        "left": [f"{'+'.join(one['group'])} on {one['axis']}" for one in said["left"]],
        "parameters": _parameters(said["parameters"]),
        "warnings": _warnings(said),
    }


def of_calibrate(said: Answer) -> dict[str, Any]:
    """The first power cycle's estimates at all times, the last one's at the longest, and the error budget of the first."""
    return _estimates(said["estimates"], said)


def of_calibrate_with_model(said: Answer) -> dict[str, Any]:
    """The same without the baseline, which knows no model."""
    return _estimates([e for e in said["estimates"] if e["method"] != "baseline"], said)


def _estimates(rows: Sequence[Answer], said: Answer) -> dict[str, Any]:
    budget = [row for row in said["budget"] if row["method"] == rows[0]["method"]]
    first, last = rows[0]["scenario"], (rows[-1]["scenario"], rows[-1]["seconds"])
    told = [e for e in rows if e["scenario"] == first or (e["scenario"], e["seconds"]) == last]
    of = ("scenario", "method", "seconds", "axis")
    return {
        "estimates": [f"{e['scenario']} {e['axis']} {e['method']} {e['seconds']:g} s: {estimate(e)}" for e in told],
        "budget": parts([row for row in budget if all(row[key] == budget[0][key] for key in of)]),
        "warnings": _warnings(said),
    }


def parts(budget: Sequence[Answer]) -> dict[str, str]:
    """The parts of one estimate's error, each to a quarter of the whole error."""
    out: dict[str, list[str]] = {row["source"]: [] if row["in_se"] else ["not in se"] for row in budget}
    for name, key in (("scale", "scale"), ("bias", "bias_dps")):
        given = [row for row in budget if row[key] is not None]
        whole = math.hypot(*(row[key] for row in given if row["in_se"]))
        for row in given:
            out[row["source"]].append(f"{name} {figure(row[key], QUARTER * whole)}")
    return {source: " ".join(said) for source, said in out.items()}


def estimate(e: Answer) -> str:
    """Scale, bias and misfit with their errors, and the flags.

    The misfit is the scatter of the blocks of two runs over what the noise predicts: a standard deviation of so many.
    """
    columns = (("scale", "scale", "scale_se"), ("bias", "bias_dps", "bias_se_dps"))
    said = [f"{name} {figure(e[key], e[se])}" for name, key, se in columns if e[key] is not None]
    if e["misfit"] is not None:
        said.append(f"misfit {figure(e['misfit'], e['misfit'] / math.sqrt(2 * 2 * e['seconds'] / BLOCK_S))}")
    flags = e["flags"] if isinstance(e["flags"], str) else "+".join(e["flags"])
    return " ".join([*said, f"({flags})" if flags else "", "" if e["trusted"] else "not trusted"]).strip()


def of_the_device(lines: Iterable[Answer]) -> list[str]:
    """The ``$CAL`` of a replay at the longest time, in their order."""
    said = list(lines)
    longest = max(c["seconds"] for c in said)
    return [f"{c['axis']} {c['method']} {c['first']}-{c['last']}: {estimate(c)}" for c in said if c["seconds"] == longest]


def header(text: str) -> list[str]:
    """The lines of a generated header; its fractions are the model's parameters, most of which have no error there."""
    return with_quarters(text).splitlines()


def _parameters(of: Iterable[Answer]) -> dict[str, str]:
    """By axis and effect.

    The correlation time of the drift has no error, and half of itself is one: near its corner, a few tens of hertz-seconds tell
    the drift from white noise of about the same density.
    """
    out: dict[str, list[str]] = defaultdict(list)
    for p in of:
        error = p["value"] / 2 if (p["effect"], p["name"]) == ("colored_noise", "tau_s") else p["se"]
        out[f"{p['axis']} {p['effect']}"].append(f"{p['name']} {figure(p['value'], error)}")
    return {key: ", ".join(said) for key, said in out.items()}


def _findings(where: Iterable[Answer]) -> list[str]:
    """By axis and variable, the strongest first; a strength is in units of its error."""
    rows = sorted(where, key=lambda w: (w["axis"], w["against"], -w["strength"]))
    return [f"{w['axis']} against {w['against']}: {figure(w['strength'], 1.0)}" for w in rows]


def _warnings(said: Answer) -> list[str]:
    return [
        " ".join([w["code"], w["axis"] or "", w["file"] or "", "blocking" if w["blocking"] else ""]).strip()
        for w in said["warnings"]
    ]


def _words(of: Answer, *keys: str) -> dict[str, Any]:
    return {key: of[key] for key in keys if key in of}
