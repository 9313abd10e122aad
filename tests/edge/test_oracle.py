"""The oracle's probabilities against an integral that is done by hand, and against what is planted."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from .apart import Judge
from .drawn import Case
from .oracle import PRIOR_ODDS, Oracle, Variant, scales, typical_of
from .recording import AXES


def test_the_evidence_is_that_of_the_normal_distribution() -> None:
    """Two shapes in 40 readings of unit noise, beside a free constant, against the density of the readings themselves."""
    random = np.random.default_rng(3)
    constant, a, b = np.ones(40), random.standard_normal(40), random.standard_normal(40)
    reading = 0.02 * a + random.standard_normal(40) + 5.0
    rows = np.array([reading, constant, a, b])
    variants = {name: [Variant((k,), typical_of("warmup", 1))] for name, k in (("a", 2), ("b", 3))}
    oracle = Oracle(rows @ rows.T, 0, [1], variants, frozenset("a"))
    wide = 1e8 * np.outer(constant, constant) + np.eye(40)
    base = multivariate_normal(np.zeros(40), wide).logpdf(reading)
    sizes = scales(variants["a"][0])[:, 0]
    each = [multivariate_normal(np.zeros(40), wide + s**2 * np.outer(a, a)).logpdf(reading) - base for s in sizes]
    assert oracle.log_posterior(["a"]) == pytest.approx(np.log(PRIOR_ODDS) + logsumexp(each) - np.log(len(each)), abs=1e-3)
    assert oracle.log_posterior([]) == 0.0
    assert np.isnan(oracle.log_posterior(["c"]))
    report = oracle.report()
    assert report["none"] + sum(p for names, p in report["sets"] if names) == pytest.approx(1.0)


def test_what_is_planted_is_found_where_it_is_far_from_its_rivals(misspecified: Case) -> None:
    seen = misspecified.seen[0]
    assert seen.nearest > 8
    oracle = Judge(misspecified.made, misspecified.ideal).oracle(
        AXES.index(seen.axis), misspecified.planted, misspecified.disturbance, misspecified.readings
    )
    report = oracle.report()
    assert report["effects"][misspecified.planted[0].id] > 0.99
    assert oracle.behind(report["best"]) == 0.0
    assert oracle.behind([]) > 10
