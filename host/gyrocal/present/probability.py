"""The sentences and rows of probabilities: of an effect, of the sets that explain an axis, and of what has no name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gyrocal.evidence.checked import PAIRS
from gyrocal.policy import POLICY

SHOWN = 3
"""Number of sets of an axis that are shown at most."""
WORTH = 0.05
"""Sets of at least this probability are shown, and always the first of an axis."""
LEFT_OVER = 0.5
"""Probability from which on it is told that something without a name is left over."""
SETS = ("axis:", "what explains it:", "of 100")
"""The header of :func:`set_rows`."""

Judged = Mapping[str, Any]


def of_100(probability: float) -> str:
    """A stated probability in words: of such answers, how many are right."""
    if probability < 0.01:
        return "fewer than 1 of 100 such answers is right"
    return f"{100 * probability:.0f} of 100 such answers are right"


def short(probability: float | None) -> str:
    """A probability for a column of a table."""
    return "-" if probability is None else f"{100 * probability:.0f} %"


def checks(judged: Judged) -> list[tuple[str, str]]:
    """The two checks of a candidate of ``gyrocal diagnose --json`` as rows of a name and a text; none where it has none."""
    made = judged.get("checks")
    if made is None:
        return []
    share, same_p = made["share"], made["same_in_parts_p"]
    enough = "" if share >= POLICY.least_share else ": so little that it may be part of something without a name"
    rows = [("its share", f"{100 * share:.0f} % of what it and a disturbance without a name describe together{enough}")]
    if same_p is None:
        return rows
    pairs = [PAIRS[part] for part in made.get("parts", ())]
    by = made.get("difference")
    if same_p >= POLICY.different_chance:
        all_of = _listed(pairs) or "the parts that were compared"
        return [*rows, ("the same in parts", f"the same between {all_of}, as far as the recordings show (p = {same_p:.2g})")]
    size = "" if by is None else f" by {100 * by:.0f} % of itself"
    differs = f"differs between {pairs[0] if pairs else 'parts of the data'}{size}, more than chance (p = {same_p:.1g})"
    if by is not None and by <= POLICY.largest_difference and made.get("passed", True):
        nearly = f"{differs}, and less than the {100 * POLICY.largest_difference:.0f} % that a model may be off"
        return [*rows, ("nearly the same in parts", nearly)]
    return [*rows, ("not the same in parts", f"{differs}: another cause may look like it")]


def _listed(names: Sequence[str]) -> str:
    """Names that themselves have an *and*, in one list."""
    return ", ".join(names[:-1]) + (", and " if len(names) > 1 else "") + "".join(names[-1:])


def probability_rows(judged: Judged) -> list[tuple[str, str]]:
    """The probability of a candidate of ``gyrocal diagnose --json`` and its checks, as rows of a name and a text.

    There are none where it has none, or was kept by a version that gave none.
    """
    stated = judged.get("probability")
    return [] if stated is None else [("probability", of_100(stated)), *checks(judged)]


def sentence(judged: Judged) -> str:
    """The probability of a candidate of ``gyrocal diagnose --json`` and its checks in one line; empty if it has none."""
    rows = probability_rows(judged)
    if not rows:
        return ""
    told = [text if name == "probability" else f"{name}: {text}" if name == "its share" else text for name, text in rows]
    return f"{judged['effect']} on {judged['axis']}: {'; '.join(told)}."


def set_rows(alternatives: Sequence[Judged], called: Callable[[str], str] = str) -> list[list[str]]:
    """The likeliest sets of each axis of ``gyrocal diagnose --json`` in words; ``called`` names an effect by its id.

    Axes whose first set is noise alone are left out.
    """
    rows: list[list[str]] = []
    for axis in dict.fromkeys(a["axis"] for a in alternatives):
        own = sorted((a for a in alternatives if a["axis"] == axis), key=lambda a: -a["probability"])
        if not own[0]["effects"] and not own[0]["unnamed"]:
            continue
        shown = [own[0], *(a for a in own[1:SHOWN] if a["probability"] >= WORTH)]
        rows += [[axis, in_words(a, called), f"{100 * a['probability']:.0f}"] for a in shown]
    return rows


def in_words(found: Judged, called: Callable[[str], str] = str) -> str:
    """A set in words: its effects, and against which variable something without a name is left over."""
    parts = [called(id_) for id_ in found["effects"]]
    parts += [f"something without a name, against {against.replace('_', ' ')}" for against in found["unnamed"]]
    return " and ".join(parts) or "noise alone"


def left_over(alternatives: Sequence[Judged]) -> str:
    """The sentence about axes on which something without a name is left over; empty if there are none."""
    told = []
    for axis in dict.fromkeys(a["axis"] for a in alternatives):
        unnamed = [a for a in alternatives if a["axis"] == axis and a["unnamed"]]
        if sum(a["probability"] for a in unnamed) >= LEFT_OVER:
            first = max(unnamed, key=lambda a: a["probability"])
            told.append(f"on {axis}, against {first['unnamed'][0].replace('_', ' ')}")
    return f"Something is left over that no effect describes: {'; '.join(told)}." if told else ""
