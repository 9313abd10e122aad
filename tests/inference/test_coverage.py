"""Standard errors are honest: 68 % intervals cover what was planted in about 68 % of campaigns (`benchmarks/coverage.py`)."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

SESSIONS = 24
COVERAGE = Path(__file__).parents[2] / "benchmarks" / "coverage.py"


@pytest.fixture(scope="module")
def pulls() -> dict[tuple[str, str], np.ndarray]:
    """(value - truth) / standard error of each parameter, in each campaign."""
    spec = importlib.util.spec_from_file_location("coverage_benchmark", COVERAGE)
    assert spec is not None
    assert spec.loader is not None
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    each = [benchmark.pulls(seed) for seed in range(1000, 1000 + SESSIONS)]  # other campaigns than the benchmark's
    return {key: np.array([p[key] for p in each]) for key in each[0]}


@pytest.mark.parametrize("name", ["scale", "bias_dps", "k1_dps_per_c", "amplitude_1"])
def test_intervals_cover_the_truth_as_often_as_they_say(pulls: dict[tuple[str, str], np.ndarray], name: str) -> None:
    (z,) = [v for (_, parameter), v in pulls.items() if parameter == name]
    inside = int(np.sum(np.abs(z) < 1.0))
    low, high = binom.interval(0.999, SESSIONS, 0.6827)
    assert low <= inside <= high
    assert np.abs(z).max() < 6.0
