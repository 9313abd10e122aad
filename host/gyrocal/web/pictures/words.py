"""Texts about the evidence of a diagnosis."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from gyrocal.digits import percentage
from gyrocal.inference.blocks import BLOCK_S
from gyrocal.present.output import plus_minus
from gyrocal.present.probability import probability_rows
from gyrocal.web.values.views import Card, Holdable

TINY_Q = 1e-9
RMS = re.compile(r"rms ([\d.]+) (m?dps)")
"""The size of a finding in its words, where it is an rms."""
SYMBOLS = {
    "w": "w is the true rate, dps", "th": "th is the table's angle", "t": "t is the time in the run, s",
    "p": "p is the time since power-on, s", "T": "T is the temperature, °C",
    "dT/dt": "dT/dt is the slope of the temperature, °C/s",
    "y": "y is the reading, dps", "ax": "ax, ay, az are the acceleration, g",
}  # fmt: skip
"""What the symbols mean that stand in the equations of effects beside their parameters."""
METHODS = {
    "model": "the model", "cnn": "the network", "baseline": "the plain average", "turn": "the known turn", "rest": "the rest",
}  # fmt: skip
"""The methods of `gyrocal calibrate` and of the device, in words."""


def method(name: str) -> str:
    """A method for a table: its word, and the name that the command line gives it where that is another."""
    word = METHODS.get(name, name).removeprefix("the ")
    return word if word == name else f"{word} ({name})"


def evidence(card: Card) -> list[tuple[str, str]]:
    """The evidence for an effect as rows of text: a name and a value. What speaks against it comes before what favours it."""
    judged: dict[str, Any] = card.judged
    rows = [("size", card.size)]
    if card.doubts:
        rows.append(("in doubt", "; ".join(card.doubts)))
    if judged["explained"] is not None:
        rows.append(("explains", explains(judged["explained"], judged["axis"], within=card.within, means=card.means)))
    if judged["heldout_gain"] is not None:
        how = "better" if judged["heldout_gain"] > 0 else "worse"
        gain = plus_minus(abs(judged["heldout_gain"]), judged["heldout_gain_se"])
        rows.append(("on unseen data", f"predicts it {how} by {gain} in log-likelihood"))
    if judged["q_value"] is not None:
        q = f"q < {TINY_Q:g}" if judged["q_value"] < TINY_Q else f"q = {judged['q_value']:.2g}"
        rows.append(("not noise alone", f"false-discovery rate {q}; an effect of the same shape would pass too"))
    rows += probability_rows(judged)
    if card.looks_like:
        if not card.doubts:
            rows.append(("cannot be told from", ", ".join(card.looks_like)))
        rows.append(("to tell them apart", judged["next_measurement"]))
    elif judged["decision"] == "suggest" and judged["next_measurement"]:
        rows.append(("to be sure", judged["next_measurement"]))
    return rows


def no_picture(equation: str) -> str:
    """Why the card of an effect of this equation has no picture, or where it is."""
    if "f_hz" in equation:
        return "Its picture is the spectrum of Compare."
    if re.search(r"(?<!\w)y(?!\w)|readings", equation):
        return "It has no picture: it changes single readings, and no curve over a variable describes it."
    return "It has no picture: over these recordings it is a function of no single variable."


def above_excess(where: Sequence[Mapping[str, Any]], per_axis: Mapping[str, Mapping[str, Any]]) -> str:
    """The sentence that findings need of which one has a larger rms than the excess error of its axis; empty if none has.

    ``where`` and ``per_axis`` are those of ``gyrocal compare --json``.
    """
    found = [(f["axis"], RMS.search(f["note"])) for f in where]
    rms_dps = [(axis, float(told[1]) * (1e-3 if told[2] == "mdps" else 1.0)) for axis, told in found if told]
    excess = {axis: level.get("excess_dps") for axis, level in per_axis.items()}  # none where angles are judged
    if not any((of_axis := excess.get(axis)) is not None and size > of_axis for axis, size in rms_dps):
        return ""
    return (
        "A finding can be larger than the excess: the floor contains the noise and what may differ between power "
        "cycles, and the excess is only what lies beyond it."
    )


def held_by_hand(holdable: Sequence[Holdable]) -> str:
    """What a model that does not fit holds by hand; empty if nothing."""
    held = [f"{p.name} of {p.title.lower()} on {p.axis} at {p.value:g} {p.unit}".rstrip() for p in holdable if p.held]
    if not held:
        return ""
    return f"The model holds {'; '.join(held)}. The misfit may be that of this value: Free under Parameters fits it again."


NOTHING = 0.005
"""A part of the squared excess that is none in words."""
CALIBRATION_ERROR = (
    "mean size of the difference between the first 2, 4 and 6 s and the whole recording, whose values are the latest model's"
)


def symbols(equation: str) -> str:
    """What the symbols of an equation mean, as far as it does not say so itself; empty if there are none."""
    found = [
        words for symbol, words in SYMBOLS.items()
        if re.search(rf"(?<!\w){symbol}(?!\w)", equation) and f"where {symbol} " not in equation
    ]  # fmt: skip
    return "; ".join(found)


def explains(part: float, axis: str, *, within: bool, means: bool = False) -> str:
    """The explained part in squares, as ``gyrocal diagnose`` gives it, and what it means for the rms.

    With ``means`` it is the part of what means of 0.1 s show, beside a faster error that no slow effect can explain.
    """
    where = f"on {axis}, within power cycles" if within else f"on {axis}"
    where = f"{where}, as means over {BLOCK_S:g} s show it (a faster one is left)" if means else where
    if part < NOTHING:
        return f"nothing of the excess error {where}"
    squared = f"{percentage(part)} of the squared excess error {where}"
    if part >= 1:
        return f"{squared}: what is left is within the noise floor"
    return f"{squared}, which makes the error itself {percentage(1 - (1 - part) ** 0.5)} smaller"


LEFT_OUT = {
    "day": "each day in turn is", "scenario": "each power cycle in turn is", "run": "each run in turn is",
    "time": "one stretch of time after another is", "session": "the whole session was",
}  # fmt: skip
"""The parts that ``gyrocal compare`` names as held out."""


def unseen(held_out: str) -> str:
    """What the errors are judged on, in a sentence; ``held_out`` as ``gyrocal compare`` gives it."""
    if held_out not in LEFT_OUT:
        return "Nothing could be left out of the fit, so the error on unseen data is not known."
    return f"Errors are those on unseen data: {LEFT_OUT[held_out]} left out of the fit and compared with what the fit predicts."
