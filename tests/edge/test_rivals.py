"""Columns, grading and page of the rivals, with a rival that needs no package: least squares on all columns, t beyond 5."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal import benchmark
from gyrocal.errors import InputError
from gyrocal.inference.blocks import reduce_session
from gyrocal.recording.session import Session

from . import recording
from .apart import Judge
from .drawn import Case, truth

benchmark._module("edge")  # puts the checkout on the path
edge_table = importlib.import_module("benchmarks.edge_table")
rivals = importlib.import_module("benchmarks.edge_rivals")

RIVAL = "least squares, one bias"
Row = dict[str, Any]


def least_squares(problem: Any) -> list[str]:
    """The effects of columns whose coefficient in a fit of all columns has a t beyond 5."""
    x, y = problem.columns, problem.y
    beta, square = np.linalg.lstsq(x, y, rcond=None)[0], np.linalg.pinv(x.T @ x)
    variance = np.sum((y - x @ beta) ** 2) / (y.size - problem.known - beta.size)
    return list(problem.named(np.flatnonzero(np.abs(beta) > 5 * np.sqrt(variance * np.diag(square))).tolist()))


@pytest.fixture(scope="module")
def session(edge: Case, tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The case of a bias over temperature, which is 300 times as large as drawn."""
    folder = tmp_path_factory.mktemp("rivals") / "session"
    readings = Judge(edge.made, edge.ideal).readings([one.times(300.0) for one in edge.planted], None)
    recording.write(edge.made, readings, folder, np.random.default_rng(1))
    return Session.open(folder)


def test_a_large_effect_is_named_on_its_axis(edge: Case, session: Session) -> None:
    found = rivals.answer(session, truth(edge), {"least squares": least_squares})
    assert found["left_out"] is None
    assert set(found["names"]) == {f"least squares, {bias}" for bias in rivals.BIAS}
    for names in found["names"].values():
        assert truth(edge)["right"][0] in names
        assert all(effect != "bias_temperature" for effect, axis in names if axis != truth(edge)["right"][0][1])


def test_columns_are_beside_scale_and_bias_and_standardised(session: Session) -> None:
    blocks = reduce_session(session, rivals.BLOCK_S)
    shared, of_cycles = (rivals.problem_on(blocks, 0, cycles) for cycles in (False, True))
    assert of_cycles.known > shared.known
    for one in (shared, of_cycles):
        assert {"bias_temperature", "warmup", "thermal_lag"} <= set(one.effect_of)
        assert np.allclose(np.mean(one.columns**2, axis=0), 1.0)
        assert np.allclose(np.mean(one.columns, axis=0), 0.0, atol=1e-6)
        assert {j for _, columns, _ in one.forms for j in columns} == set(range(one.columns.shape[1]))
        assert all({one.effect_of[j] for j in columns} == {effect} for effect, columns, _ in one.forms)


def test_criteria_are_those_of_least_squares(session: Session) -> None:
    one = rivals.problem_on(reduce_session(session, rivals.BLOCK_S), 0, False)
    x, n = one.columns[:, [0, 3]], one.y.size
    left = one.y - x @ np.linalg.lstsq(x, one.y, rcond=None)[0]
    assert one.squares([0, 3]) == pytest.approx(left @ left)
    assert one.bic([0, 3]) == pytest.approx(n * np.log(left @ left) + 2 * np.log(n))


def test_rivals_by_bic_name_the_only_cause() -> None:
    """One of two columns acts, the other is like it but for a tenth; a third is only noise."""
    random = np.random.default_rng(3)
    first, apart, third, noise = random.standard_normal((4, 400))
    columns = np.column_stack([first, np.sqrt(0.99) * first + 0.1 * apart, third])
    columns /= np.sqrt(np.mean(columns**2, axis=0))
    ids = ("drift", "warmup", "lag")
    forms = tuple((id_, (j,), 1) for j, id_ in enumerate(ids))
    strong, weak = (rivals.Problem(size * columns[:, 0] + noise, columns, ids, forms, 1) for size in (20.0, 0.5))
    for rival in (rivals.best_single, rivals.best_single_apart, rivals.stepwise, rivals.stepwise_sure):
        assert rival(strong) == ["drift"]
    assert len(rivals.best_single(weak)) == 1
    assert rivals.best_single_apart(weak) == []
    nothing = rivals.Problem(noise, columns, ids, forms, 1)
    assert rivals.best_single(nothing) == rivals.stepwise_sure(nothing) == []


def _row(case: str, right: list[list[str]], names: list[list[str]], left_out: str | None = None) -> Row:
    effects = [{"effect": id_, "right": [[id_, axis]], "equivalents": []} for id_, axis in right]
    known = {"effects": effects, "right": right, "disturbance": None if right else {"sigma": 9.0}}
    kind = "edge" if right else "null"
    return {"case": case, "kind": kind, "truth": known, "error": None, "left_out": left_out, "names": {RIVAL: names}}


ROWS = [
    _row("a", [["drift", "z"]], [["drift", "z"], ["warmup", "z"]]),
    _row("b", [["drift", "z"]], [["drift", "x"]]),
    _row("c", [], [["lag", "z"]]),
    _row("d", [["order_tone", "z"]], [], "an effect without a column"),
    {**_row("e", [["drift", "z"]], []), "error": "ValueError: no"},
]


def test_rivals_are_graded_beside_gyrocal_on_the_same_cases() -> None:
    own = [
        {**row, "candidates": [{"effect": "drift", "axis": "z", "decision": "add", "group": ["drift"]}] * (row["case"] < "c")}
        for row in ROWS
    ]
    found = rivals.answers(ROWS, own)
    assert [row["case"] for row in found[RIVAL]] == [row["case"] for row in found["gyrocal"]] == ["a", "b", "c"]
    said = edge_table.names(found[RIVAL])
    assert (said["sure"], said["wrong"], said["reached"]["count"], said["reached"]["of"]) == (4, 3, 1, 2)
    lines = rivals.page(found).splitlines()
    assert lines[0] == "3 sessions: 2 edge, 1 null."
    gyrocal, rival = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines[4:6])
    assert gyrocal == ["gyrocal", "2", "0", "0.0% (< 77.6%)", "2 of 2", "", ""]
    assert rival == [RIVAL, "4", "3", "75.0% (< 98.7%)", "1 of 2", "0.12", "0.5"]
    assert lines[-1] == f"| {RIVAL} | 2 of 3; 1 of 2 | 1 of 1 | 1 of 1 |"


def test_cases_of_another_truth_are_left_out_and_no_answers_make_no_row() -> None:
    other = [{**ROWS[0], "truth": {**ROWS[0]["truth"], "right": []}, "candidates": []}]
    assert rivals.answers(ROWS, other) == {"gyrocal": []}
    assert list(rivals.answers(ROWS, None)) == [RIVAL]


def test_the_tables_are_written_between_the_marks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- rivals -->\nold\n<!-- end of rivals -->\nafter\n", encoding="utf-8")
    for _ in range(2):
        rivals.write_into(page, "new")
    assert page.read_text(encoding="utf-8") == "before\n<!-- rivals -->\n\nnew\n\n<!-- end of rivals -->\nafter\n"
    page.write_text("nothing", encoding="utf-8")
    with pytest.raises(InputError, match="no line"):
        rivals.write_into(page, "new")
