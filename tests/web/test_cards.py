"""One card for one effect, whatever the number of its axes."""

from __future__ import annotations

from typing import Any

from gyrocal.web.values.views import Card
from gyrocal.web.widgets.cards import evidence_of, grouped


def card(axis: str, gain: float = 9.0, **more: Any) -> Card:
    judged = {
        "effect": "sampling_fault", "axis": axis, "decision": "add", "explained": None, "heldout_gain": gain,
        "heldout_gain_se": 1.0, "q_value": 1e-12, "next_measurement": "",
    } | more  # fmt: skip
    return Card(judged, "Repeated or lost samples", "The bus.", "y(i) = y(i-1)", [], "fraction 5 %", [], within=False)


def test_one_fault_of_all_axes_is_one_card() -> None:
    """Three cards alike stood for one sampling fault."""
    cards = [card("y"), card("x"), card("z"), card("x", effect="lag"), card("y", effect="lag", decision="suggest")]
    assert [[c.judged["axis"] for c in group] for group in grouped(cards)] == [["y", "x", "z"], ["x"], ["y"]]


def test_what_differs_between_the_axes_is_told_of_each() -> None:
    rows = evidence_of([card("y", 7.0), card("x"), card("z")])
    assert rows[0] == ("size", "fraction 5 %")
    better = [text for name, text in rows if "log-likelihood" in text]
    assert [text.split(":")[0] for text in better] == ["on x", "on y", "on z"]
    assert better[1] == "on y: predicts it better by 7.0 ± 1.0 in log-likelihood"
    assert [name for name, _ in rows].count("on unseen data") == 1
    assert evidence_of([card("y")])[1] == ("on unseen data", "predicts it better by 9.0 ± 1.0 in log-likelihood")
