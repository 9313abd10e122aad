"""300 sensors of `gyrocal benchmark population`: errors are honest and sound sensors trusted."""

from typing import Any

import pytest

from gyrocal.benchmark import benchmark

Row = dict[str, Any]


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    found: list[Row] = benchmark("population", sample=True, quiet=True)["rows"]
    return found


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


def test_effects_of_typical_size_are_in_the_baselines_errors(rows: list[Row]) -> None:
    """Today's rows of the network are in docs/calibration.md: its own errors know its training's effects alone."""
    for r in (r for r in rows if r["effects"] and r["method"] != "cnn"):
        assert 0.4 <= r["scale_sd"] <= 1.3, r["seconds"]
        assert 0.4 <= r["bias_sd"] <= 1.3, r["seconds"]
        assert r["scale_95"] >= 0.85
        assert r["bias_95"] >= 0.85
