"""Candidates whose effects of time see other blocks: shifted times have no reference at the ends of a run."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.naming.candidates import findings
from gyrocal.diagnosis.naming.gains import held_out_gain
from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.rivals import cosine
from gyrocal.diagnosis.naming.sets import EffectSet, _same_but_simpler, fitted_together
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.effects.base import effect
from gyrocal.error_model.model import Term
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.inference.noise_search import carry_spreads, with_noise
from make_runs import make_run, make_session

RATE_HZ = 50.0


def swing(delay_s: float, noise_dps: float = 0.3) -> Current:
    """Four power cycles that swing in the middle of a minute alone, where a delay and a clock's error look alike."""
    rng = np.random.default_rng(3)
    t_s = np.arange(round(60 * RATE_HZ)) / RATE_HZ

    def rate_dps(at_s: np.ndarray) -> np.ndarray:
        return np.asarray(60 * np.sin(0.8 * np.pi * at_s) * np.exp(-(((at_s - 30) / 5) ** 2)))

    gyro = [rng.normal(0, noise_dps, (t_s.size, 3)) + np.outer(rate_dps(t_s - delay_s), [0, 0, 1.003]) for _ in range(4)]
    runs = [make_run(t_s, g, scenario=f"s{i}", rate_hz=RATE_HZ, rate_ref_dps=rate_dps(t_s)) for i, g in enumerate(gyro)]
    return Current.of(measure(make_session(*runs)), "z")


@pytest.fixture(scope="module")
def delayed() -> Current:
    return swing(-0.4)


def test_sets_whose_members_see_other_blocks_are_compared(delayed: Current) -> None:
    """It ended in "operands could not be broadcast"."""

    def of(*ids: str) -> EffectSet:
        members = tuple(map(effect, ids))
        fitted = fitted_together(delayed, members)
        assert fitted is not None
        return EffectSet(members, fitted, held_out_gain(delayed.fit, fitted, delayed.folds), len(ids))

    delay, both = of("lag"), of("clock_error", "lag")
    assert delay.fitted.design.n_blocks.sum() < delayed.fit.design.n_blocks.sum()
    assert _same_but_simpler(delay, both, delayed)


def test_candidates_that_see_other_blocks_are_rivals(delayed: Current) -> None:
    """Signals of different length had no similarity, so that a delay was never held against the error of a clock."""
    delay, clock = judge(delayed, effect("lag")), judge(delayed, effect("clock_error"))
    assert cosine(delay.signal, clock.signal) > 0.9


def test_blocks_that_an_effect_does_not_see_are_no_gain_of_likelihood() -> None:
    """Beside a noise of 30 dps, each block that a wrong clock lost added about 4 to its log-likelihood."""
    poorer = swing(0.0, noise_dps=30.0).fit
    design = poorer.design.changed([*poorer.design.terms, Term("clock_error", "z", {"e": 0.03})])
    richer = with_noise(design, poorer.noise, carry_spreads(poorer, design))
    assert design.n_blocks.sum() < poorer.design.n_blocks.sum() - 20
    assert likelihood_ratio(poorer, richer, 1)[0] < 4
    current = swing(0.0, noise_dps=30.0)
    assert held_out_gain(current.fit, richer, current.folds).sum() < 2


def test_a_candidate_that_some_blocks_do_not_show_is_a_finding_of_a_finite_size(delayed: Current) -> None:
    found = replace(judge(delayed, effect("lag")), decision="add")
    assert found.signal is not None
    assert np.isnan(found.signal).any()
    (told,) = findings(delayed.comparison, [found])
    assert 0 < told.amplitude_dps < 60
    assert "nan" not in told.note
