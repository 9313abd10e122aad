"""The figures on rows that are counted by hand."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from answers import check
from gyrocal import benchmark
from gyrocal.errors import InputError

Row = dict[str, Any]
benchmark._module("edge")  # puts the checkout on the path
edge_table = importlib.import_module("benchmarks.edge_table")
edge = importlib.import_module("benchmarks.edge")


def _said(effect: str, axis: str, decision: str = "add", group: Sequence[str] = (), probability: float | None = None) -> Row:
    return {"effect": effect, "axis": axis, "decision": decision, "group": list(group), "probability": probability}


def _row(
    case: str, planted: str, said: list[Row], kind: str = "edge", nearest: float = 5.0, disturbed: float | None = None
) -> Row:
    right = [[planted, "z"]] if planted else []
    effects = [{"effect": planted, "right": right, "nearest_sigma": nearest, "equivalents": ["order_tone"]}] if planted else []
    disturbance = None if disturbed is None else {"sigma": disturbed}
    truth = {"effects": effects, "right": right, "disturbance": disturbance}
    return {
        "case": case, "kind": kind, "truth": truth, "candidates": said, "error": None, "behind": {"z": 1.0}, "seconds": 2.0,
        "verdict": "add",
    }  # fmt: skip


ROWS = [
    _row("a", "drift", [_said("drift", "z", group=["drift"], probability=0.97)]),
    _row("b", "drift", [_said("warmup", "z", probability=0.97)]),
    _row("c", "lag", [_said("lag", "z", group=["lag", "clock_error"], probability=0.6)], "misspecified", 1.0, 5.0),
    _row("d", "lag", [_said("clock_error", "z", "suggest", ["lag", "clock_error"])], "misspecified", 9.0, 50.0),
    _row("e", "lag", [_said("lag", "x", probability=0.3)], "misspecified", 9.0, 50.0),
    _row("f", "", [], "null"),
    _row("g", "", [_said("drift", "z", probability=0.92)], "null", disturbed=20.0),
]


def test_sure_names_reach_and_groups_are_counted() -> None:
    found = edge_table.table_of([*ROWS, {**ROWS[0], "case": "h", "error": "ValueError: no"}])
    every = found["all"]
    assert (every["cases"], every["sure"], every["wrong"], every["wrong_share"]) == (7, 4, 3, 0.75)
    assert (every["reached"]["count"], every["reached"]["of"], every["in_group"]["count"]) == (1, 5, 3)
    assert found["by_kind"]["misspecified"]["reached"]["count"] == 0
    assert found["by_kind"]["misspecified"]["in_group"]["count"] == 2
    assert found["by_kind"]["misspecified"]["wrong"] == 1
    assert found["by_nearest_sigma"]["4-8"]["sure"] == 2
    assert found["by_disturbance_sigma"]["10-30"]["wrong"] == 1
    assert (found["nulls_named"]["plain"]["count"], found["nulls_named"]["plain"]["of"]) == (0, 1)
    assert found["nulls_named"]["disturbed"]["share"] == 1.0
    assert found["failed"] == [{"case": "h", "error": "ValueError: no"}]
    assert [one["case"] for one in found["wrong_names"]] == ["b", "e", "g"]
    assert found["behind_oracle"]["median"] == 1.0
    edge_table.show(found)


def test_the_tests_alone_are_told_with_a_limit_that_makes_them_as_seldom_wrong() -> None:
    """Three right names with gains of 5, 20 and 40, a wrong one with 20 that the tool does not give: 40 alone stays."""

    def said(id_: str, gain: float, decision: str = "add") -> Row:
        return _said(id_, "z", decision) | {"heldout_gain": gain, "heldout_gain_se": 2.0, "by_tests": ["add", [id_]]}

    rows = [_row(f"r{gain}", "drift", [said("drift", gain)]) for gain in (5.0, 20.0, 40.0)]
    rows.append(_row("w", "lag", [said("warmup", 20.0, "suggest")]))
    found = edge_table.raised(rows)
    assert found is not None
    assert (found["as_they_are"]["sure"], found["as_they_are"]["wrong"], found["as_they_are"]["reached"]["count"]) == (4, 1, 3)
    assert (found["raised"]["wrong"], found["raised"]["reached"]["count"], found["raised"]["at"]) == (0, 1, 20.0)
    assert edge_table.raised(ROWS) is None


def test_an_equal_in_a_group_is_right_and_alone_is_wrong() -> None:
    group = _row("a", "vibration_tone", [_said("order_tone", "z", group=["order_tone", "table_ripple"])], "confounded", 0.1)
    alone = _row("b", "vibration_tone", [_said("order_tone", "z", group=["order_tone"])], "confounded", 0.1)
    assert (edge_table.grouped(group), edge_table.wrong(group)) == ([True], [])
    assert (edge_table.grouped(alone), edge_table.wrong(alone)) == ([False], [("order_tone", "z")])


def test_reliability_counts_true_names_in_each_bin() -> None:
    found = edge_table.reliability(ROWS)
    counts = {(b["from"], b["to"]): (b["count"], b["of"]) for b in found["bins"]}
    assert len(found["bins"]) == 7
    assert counts[0.93, 1.0] == (1, 2)
    assert counts[0.5, 0.8] == (1, 1)
    assert counts[0.2, 0.5] == (0, 1)
    assert counts[0.8, 0.93] == (0, 1)
    assert (found["capped"]["probability"], found["capped"]["count"], found["capped"]["of"]) == (0.97, 1, 2)
    assert edge_table.reliability([_row("a", "drift", [_said("drift", "z")])]) is None


@pytest.mark.parametrize(("count", "n"), [(0, 100), (3, 250), (7, 7)])
def test_bounds_are_those_of_scipy(count: int, n: int) -> None:
    two_sided = binomtest(count, n).proportion_ci(0.95, "exact")
    assert edge_table.counted(count, n)["within"] == pytest.approx([two_sided.low, two_sided.high])
    one_sided = binomtest(count, n, alternative="less").proportion_ci(0.95, "exact")
    assert edge_table.upper(count, n) == pytest.approx(one_sided.high)


def test_two_files_are_compared_case_by_case() -> None:
    better = [{**row, "candidates": [_said(e["effect"], "z") for e in row["truth"]["effects"]]} for row in ROWS]
    found = edge_table.compared(ROWS, better)
    assert found["cases"] == 7
    assert found["wrong"] == {"before": 3, "after": 0, "only_before": 3, "only_after": 0, "p": 0.125}
    assert found["reached"] == {"before": 1, "after": 5, "only_before": 0, "only_after": 4, "p": 0.0625}
    assert edge_table.compared(ROWS, ROWS)["wrong"]["p"] == 1.0
    assert edge_table.compared([_row("a", "lag", [])], ROWS)["cases"] == 0


@pytest.mark.wide
def test_cases_are_run_once_and_resumed(tmp_path: Path) -> None:
    out = tmp_path / "edge.jsonl"
    found = benchmark.benchmark("edge", quiet=True, kinds=["null"], stop=1, workers=1, out=out)
    check("benchmark", found)
    assert (found["cases"], found["failed"]) == (1, [])
    row = edge_table.read(out)[0]
    assert {"verdict", "candidates", "alternatives", "seconds", "truth", "oracle", "behind"} <= set(row)
    assert np.isclose(sum(p for _, p in next(iter(row["oracle"].values()))["sets"]), 1.0, atol=0.05)
    with out.open("a", encoding="utf-8") as file:
        file.write('{"case": "cut off')
    assert len(edge_table.read(out)) == 1
    assert benchmark.benchmark("edge", quiet=True, kinds=["null"], stop=1, workers=1, out=out) == found
    beside = benchmark.benchmark("edge", quiet=True, kinds=["null"], stop=1, workers=1, out=out, against=out)
    check("benchmark", beside)
    assert beside == found | {"compared": edge_table.compared([row], [row])}


def test_an_unknown_part_or_kind_and_code_that_is_not_committed_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def changed() -> str:
        raise ValueError("host/gyrocal has changes that are not committed")

    monkeypatch.setattr("edge.drawn.tree", changed)
    asked = (("other", (), "no part"), ("work", ("storm",), "no cases of kind"), ("frozen", (), "not committed"))
    for part, kinds, words in asked:
        with pytest.raises(InputError, match=words):
            edge.chosen(part, kinds, 0, None)


def test_a_case_that_cannot_be_drawn_is_a_row_that_says_so() -> None:
    row = edge._judged(("work", "no such kind", 0))
    assert (row["case"], row["verdict"]) == ("work_no such kind_0000", "failed")
    found = edge_table.table_of([row])
    assert found["failed"][0]["error"].startswith("ValueError")
    edge_table.show(found)
