"""Texts about the evidence of a diagnosis."""

from __future__ import annotations

from typing import Any

from gyrocal.present.output import plus_minus
from gyrocal.web.views import Card


def evidence(card: Card) -> list[tuple[str, str]]:
    """The evidence for an effect as rows of text: a name and a value."""
    judged: dict[str, Any] = card.judged
    rows = [("size", card.size)]
    if judged["explained"] is not None:
        rows.append(("explains", f"{judged['explained']:.0%} of the excess error on {judged['axis']}"))
    if judged["heldout_gain"] is not None:
        gain = plus_minus(judged["heldout_gain"], judged["heldout_gain_se"])
        rows.append(("on unseen data", f"held-out gain {gain} in log-likelihood"))
    if judged["q_value"] is not None:
        rows.append(("by chance", "practically impossible" if judged["q_value"] < 1e-9 else f"q = {judged['q_value']:.2g}"))
    if card.looks_like:
        rows.append(("cannot be told from", ", ".join(card.looks_like)))
        rows.append(("to part them", judged["next_measurement"]))
    elif judged["decision"] == "suggest" and judged["next_measurement"]:
        rows.append(("to be sure", judged["next_measurement"]))
    return rows
