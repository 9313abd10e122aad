"""300 sensors of `gyrocal benchmark population`: errors are honest and sound sensors trusted."""

from pathlib import Path
from typing import Any

import pytest

from gyrocal.benchmark import _module, benchmark

Row = dict[str, Any]


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    found: list[Row] = benchmark("population", sample=True, quiet=True)["rows"]
    return found


@pytest.mark.slow
def test_sound_sensors_anywhere_are_trusted_and_their_errors_honest(rows: list[Row]) -> None:
    sound = [r for r in rows if not r["effects"] and r["seconds"] == 6]
    assert {r["method"] for r in sound} == {"baseline", "cnn", "model"}
    for r in sound:
        assert r["trusted"] >= 0.9, r["method"]
        assert 0.8 <= r["scale_sd"] <= 1.2, r["method"]
        assert 0.8 <= r["bias_sd"] <= 1.2, r["method"]
        assert r["trusted_and_far"] == 0, r["method"]


def test_a_few_seconds_never_make_a_sound_sensors_errors_too_small(rows: list[Row]) -> None:
    assert max(max(r["scale_sd"], r["bias_sd"]) for r in rows if not r["effects"]) <= 1.1


def test_effects_of_typical_size_are_in_the_errors_of_every_method(rows: list[Row]) -> None:
    """The network's own errors, which know the effects of its training alone, are up to a hundred times too small here."""
    for r in (r for r in rows if r["effects"]):
        assert 0.4 <= r["scale_sd"] <= 1.3, r["seconds"]
        assert 0.4 <= r["bias_sd"] <= 1.3, r["seconds"]
        assert r["scale_95"] >= 0.85
        assert r["bias_95"] >= 0.85


def test_finished_rows_are_not_computed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = _module("population")
    monkeypatch.setattr(module, "SENSORS", 20)
    first = benchmark("population", quiet=True, results=tmp_path / "rows.jsonl")
    monkeypatch.setattr(module, "rows_of", None)
    assert benchmark("population", quiet=True, results=tmp_path / "rows.jsonl") == first
