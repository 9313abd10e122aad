"""300 sensors of `gyrocal benchmark population`: errors are honest and sound sensors trusted."""

from pathlib import Path
from typing import Any

import pytest

from answers import check
from gyrocal.benchmark import _module, benchmark

Row = dict[str, Any]


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    found = benchmark("population", sample=True, quiet=True)
    check("benchmark", found)
    kept: list[Row] = found["rows"]
    return kept


def of(rows: list[Row], kind: str, *seconds: float) -> list[Row]:
    found = [r for r in rows if r["effects"] == kind and r["seconds"] in (seconds or (2, 4, 6))]
    assert {r["method"] for r in found} == {"baseline", "cnn", "model"}
    return found


def test_sound_sensors_anywhere_are_trusted_and_their_errors_honest(rows: list[Row]) -> None:
    for r in of(rows, "none", 4, 6):
        assert r["trusted"] >= 0.9, r["method"]
        assert 0.85 <= r["scale_sd_all"] <= 1.2, r["method"]
        assert 0.85 <= r["bias_sd_all"] <= 1.2, r["method"]
    assert all(r["trusted_and_far"] == 0 for r in of(rows, "none"))


def test_two_seconds_allow_for_a_transient_that_they_cannot_exclude(rows: list[Row]) -> None:
    for r in of(rows, "none", 2):
        assert min(r["scale_sd_all"], r["bias_sd_all"]) >= 0.65
        assert max(r["scale_sd_all"], r["bias_sd_all"]) <= 1.1


def test_trusted_answers_are_as_far_off_as_they_say_on_tables_with_effects(rows: list[Row]) -> None:
    for r in of(rows, "typical"):
        assert 0.65 <= r["scale_sd"] <= 1.2, (r["seconds"], r["method"])
        assert 0.65 <= r["bias_sd"] <= 1.2, (r["seconds"], r["method"])
        assert min(r["scale_95"], r["bias_95"]) >= 0.85
        assert r["trusted_and_far"] <= 1


def test_a_warm_up_between_the_faces_is_not_trusted(rows: list[Row]) -> None:
    """Its errors are many times those stated, and six seconds do not show it; the rest of the first run does."""
    for r in of(rows, "warm-up", 6):
        assert r["scale_sd_all"] > 5
        assert r["trusted"] <= 0.02
    assert sum(r["trusted_and_far"] for r in of(rows, "warm-up")) == 0


def test_finished_rows_are_not_computed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = _module("population")
    monkeypatch.setattr(module, "SENSORS", 20)
    first = benchmark("population", quiet=True, results=tmp_path / "rows.jsonl")
    monkeypatch.setattr(module, "rows_of", None)
    assert benchmark("population", quiet=True, results=tmp_path / "rows.jsonl") == first
