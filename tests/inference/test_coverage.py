"""Standard errors are honest: intervals cover the truth as often as they say (`gyrocal benchmark coverage`, in small)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from answers import check
from gyrocal import benchmark

FITS = 20


@pytest.fixture(scope="module")
def coverage() -> Any:
    return benchmark._module("coverage")


@pytest.mark.wide
@pytest.mark.parametrize(
    ("effect_id", "size", "names"),
    [
        pytest.param("warmup", "triple", ["A_dps", "tau_s"], marks=pytest.mark.wide),
        pytest.param("table_ripple", "triple", ["amplitude_1"], marks=pytest.mark.wide),
        ("vibration_tone", "typical", ["A_dps", "f_hz"]),
        pytest.param("spin_up", "typical", ["A", "tau_s"], marks=pytest.mark.wide),
        pytest.param("bias_temperature", "typical", ["k1_dps_per_c"], marks=pytest.mark.wide),
    ],
)
def test_intervals_cover_the_truth_as_often_as_they_say(coverage: Any, effect_id: str, size: str, names: list[str]) -> None:
    found = [coverage.one_fit(effect_id, size, seed) for seed in range(1000, 1000 + FITS)]  # not the benchmark's sessions
    low, high = binom.interval(0.9999, FITS, 0.6827)
    for name in [*names, "scale.scale"]:
        z = np.array([coverage._z(*one[name]) for one in found])
        assert low <= np.count_nonzero(np.abs(z) < 1.0) <= high, name
        assert np.abs(z).max() < 6.0, name
        assert 0.5 < np.sqrt(np.mean(z**2)) < 1.7, name


def test_a_likelihood_with_steps_is_searched_to_its_highest_one(coverage: Any) -> None:
    """A dead band of full depth: a search that stops on another step finds a depth that is many errors below 1."""
    found = coverage.one_fit("dead_band", "triple", 999)
    assert abs(coverage._z(*found["depth"])) < 4.0
    assert abs(coverage._z(*found["width_dps"])) < 12**0.5 / 2 + 1e-6  # the truth is between the nearest samples


@pytest.mark.wide
def test_samples_that_are_equal_by_chance_are_not_counted_as_repeated(coverage: Any) -> None:
    """With noise of five counts, six neighbours of 35 000 are equal by chance: half an error of the smallest fraction."""
    z = [coverage._z(*coverage.one_fit("sampling_fault", "third", seed)["fraction"]) for seed in range(2000, 2016)]
    assert abs(np.mean(z)) < 2.2 / len(z) ** 0.5


def test_fits_are_not_repeated_and_those_of_other_sources_are(coverage: Any, tmp_path: Path) -> None:
    out = tmp_path / "coverage.jsonl"
    done: list[int] = []
    first = coverage.measured(1, ["misalignment"], lambda n, _: done.append(n), out)
    assert done == [1, 2, 3]
    assert coverage.measured(1, ["misalignment"], lambda n, _: done.append(n), out) == first
    assert done == [1, 2, 3]
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    out.write_text("".join(json.dumps({**row, "sources": "others"}) + "\n" for row in rows))
    again = coverage.measured(1, ["misalignment"], lambda n, _: done.append(n), out)
    assert done == [1, 2, 3, 1, 2, 3]
    assert [row["found"] for row in again] == [row["found"] for row in first]


def test_the_band_holds_for_all_cells_together(coverage: Any) -> None:
    """Right intervals of 60 cells are all inside; too narrow ones, missing values and missing errors are outside."""
    rng = np.random.default_rng(4)

    def rows(scale: float, kept: float) -> list[dict[str, Any]]:
        cells = [(f"effect{i}", size) for i in range(20) for size in coverage.SIZES]
        return [
            {"effect": e, "size": size, "seed": seed, "found": {"k": [z, 1.0 if rng.random() < kept else None, 0.0]}}
            for e, size in cells for seed, z in enumerate(scale * rng.normal(size=300))
        ]  # fmt: skip

    honest = coverage.summary(rows(1.0, 1.0))
    check("benchmark", honest)
    assert not any(line["outside"] for line in honest["rows"])
    for wrong in (rows(2.0, 1.0), rows(1.0, 0.6)):
        assert all(line["outside"] for line in coverage.summary(wrong)["rows"])


def test_every_effect_has_cells_or_a_reason(coverage: Any) -> None:
    from gyrocal.effects.base import effects

    left = {i for i, kind in effects().items() if kind.role is None} - set(coverage.covered_effects())
    assert left == set(coverage.LEFT_OUT)
    for effect_id in coverage.covered_effects():
        kind = effects()[effect_id]
        protocol = coverage.protocol_of(kind)
        assert kind.missing(protocol.simulate([], 0)[0].runs, "xyz".index(protocol.axis)) is None, effect_id
        sizes = [coverage.values_of(kind, size)[coverage.sized(kind)] for size in coverage.SIZES]
        assert sizes[1] == pytest.approx(3 * sizes[0])
        assert sizes[2] == pytest.approx(3 * sizes[1])


def test_the_page_has_the_tables_of_the_measurement(coverage: Any) -> None:
    page = (Path(__file__).parents[2] / "docs" / "coverage.md").read_text(encoding="utf-8")
    rows = [
        {"effect": "drift", "size": size, "found": {"k_dps_per_s": [1.1, 1.0, 1.0], "scale.scale": [9.0, 1.0, 0.0]}}
        for size in coverage.SIZES
        for _ in range(40)
    ]
    written = coverage.with_tables(page, coverage.summary(rows))
    assert written.startswith(page[: page.index("## Effects")])
    assert "| drift | k_dps_per_s | typical | 40 | 100 % (outside) | 100 % | 0.10 | 0.00 |" in written
    assert written.endswith("| drift | scale.scale | all | 120 | 0 % (outside) | 0 % (outside) | 9.00 | 0.00 |\n")
    assert written.count("| drift |") == 4
    assert coverage.with_tables(written, coverage.summary(rows)) == written
