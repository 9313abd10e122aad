"""Probabilities without scipy.stats: those of scipy.stats, and no import of it by a diagnosis."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from gyrocal import tails
from gyrocal.simulation.simulate import simulate

X = np.array([-1.0, 0.0, 0.3, 2.0, 9.0, 40.0])


def test_they_are_those_of_scipy_stats() -> None:
    close = {"rtol": 1e-11, "atol": 0.0}
    np.testing.assert_allclose(tails.normal(X), stats.norm.sf(X), **close)
    np.testing.assert_allclose(tails.normal_z([1e-300, 0.2, 0.9]), stats.norm.isf([1e-300, 0.2, 0.9]), **close)
    np.testing.assert_allclose(tails.chi_square(X, 3), stats.chi2.sf(X, 3), **close)
    np.testing.assert_allclose(tails.chi_square_value(1e-6, 1), stats.chi2.isf(1e-6, 1), **close)
    np.testing.assert_allclose(tails.f_ratio(X, 4, 7.5), stats.f.sf(X, 4, 7.5), **close)
    np.testing.assert_allclose(tails.student(X, 3), stats.t.sf(X, 3), **close)
    np.testing.assert_allclose(tails.student_value([1e-6, 0.25], 3), stats.t.isf([1e-6, 0.25], 3), rtol=1e-9)
    np.testing.assert_allclose(tails.student_log_density(X, 3), stats.t.logpdf(X, 3), **close)


@pytest.mark.parametrize("least", [-2, 0, 1, 4, 20, 21])
def test_counts_are_those_of_scipy_stats(least: int) -> None:
    assert tails.binomial(least, 20, 0.3) == pytest.approx(stats.binom.sf(least - 1, 20, 0.3), rel=1e-11)
    assert tails.poisson(least, 3.3) == pytest.approx(stats.poisson.sf(least - 1, 3.3), rel=1e-11)


@pytest.mark.wide
def test_a_comparison_does_not_wait_for_scipy_stats(tmp_path: Path) -> None:
    """Its import takes longer than many a diagnosis."""
    simulate(tmp_path / "s", "paper", [], 1, scenarios=3, seconds=4.0)
    program = (
        "import sys\n"
        "from gyrocal.diagnosis.answer.compare import compare\n"
        "from gyrocal.recording.session import Session\n"
        f"compare(Session.open({str(tmp_path / 's')!r}))\n"
        "print('scipy.stats' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout == "False\n"
