"""What the evidence says of sessions whose truth is known."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gyrocal.evidence import answer, weights
from gyrocal.evidence.answer import Evidence, _Weighing, weigh
from gyrocal.evidence.checked import PAIRS
from gyrocal.evidence.curve import KNOTS
from gyrocal.evidence.discrepancy import shapes
from gyrocal.evidence.hypotheses import options
from gyrocal.evidence.matrix import Matrix, runs_of
from gyrocal.recording.session import following
from make_runs import make_run

from .sessions import RATES_DPS, fitted, session

EVEN, SURE = 0.0, float(np.log(99))


def evidence(made) -> Evidence:  # type: ignore[no-untyped-def]
    fit = fitted(made)
    found = weigh(fit, [t.effect_id for t in fit.terms])
    assert found is not None
    return found


def test_noise_alone_names_nothing() -> None:
    for seed in range(2):
        found = evidence(session(seed))
        assert max(found.log_odds.values()) < EVEN
        first = found.alternatives[0]
        assert (first.effects, first.unnamed) == ((), ())


def test_the_probabilities_of_sets_add_up_to_one_at_most() -> None:
    found = evidence(session(11, lambda t, c, w, k: 0.001 * (c - 25)))
    assert 0.9 < sum(a.probability for a in found.alternatives) <= 1 + 1e-9


def test_what_is_left_over_by_nothing_changes_no_probability(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of no size, a rest against one variable and rests against all of them together explain what the effects alone do."""
    monkeypatch.setattr(weights, "AMPLITUDES", (1e-9, 1e-9))
    fit = fitted(session(2, lambda t, c, w, k: 4e-4 * abs(w)))
    runs, axis = runs_of(fit), fit.design.axis
    matrix = Matrix.of(fit, options(runs, axis, [t.effect_id for t in fit.terms]), shapes(runs))
    found = _Weighing.of(matrix)
    assert found is not None
    assert found.scales.rests
    assert len(found.sets) > 5
    np.testing.assert_allclose(found.forms[1], found.forms[0], atol=0.01)


def test_an_effect_that_is_planted_is_certain_and_passes_both_checks() -> None:
    found = evidence(session(2, lambda t, c, w, k: 4e-4 * abs(w)))
    assert found.log_odds["scale_asymmetry"] > SURE
    assert max(p for e, p in found.log_odds.items() if e != "scale_asymmetry") < EVEN
    checks = found.checks["scale_asymmetry"]
    assert checks.share > 0.5
    assert (checks.same_in_parts_p or 0.0) > 1e-3
    assert set(checks.parts) == PAIRS.keys() - {"direction"}  # as one direction has more of it than the other, so has a scale


def test_only_parts_that_the_session_has_are_compared() -> None:
    made = session(2, lambda t, c, w, k: 0.02 * c)
    assert {"temperature", "direction"} < set(evidence(made).checks["bias_temperature"].parts)
    made = session(2, lambda t, c, w, k: 4e-4 * abs(w))
    bare = replace(made, runs=tuple(replace(run, frame=run.table.drop("temp_c")) for run in made.runs))
    assert "temperature" not in evidence(bare).checks["scale_asymmetry"].parts
    made = session(2, lambda t, c, w, k: 0.02 * c, rates_dps=(0.0, 60.0, 120.0))
    assert "direction" not in evidence(made).checks["bias_temperature"].parts


def test_two_effects_that_hide_each_other_are_found_together() -> None:
    """What grows with the square of the rate and what grows with its size overlap; the set of both is the answer."""
    rates_dps = (0.0, 30.0, -30.0, 75.0, -75.0, 130.0, -130.0)
    found = evidence(session(3, lambda t, c, w, k: 1e-3 * abs(w) - 1e-5 * w**2, cycles=4, rates_dps=rates_dps))
    assert found.alternatives[0].effects == ("centripetal", "scale_asymmetry")


def test_what_no_effect_describes_is_a_rest_against_its_variable() -> None:
    """A wave over the temperature has no name."""
    found = evidence(session(4, lambda t, c, w, k: 0.02 * np.sin(2.2 * c)))
    assert max(found.log_odds.values()) < np.log(9)
    best = found.alternatives[0]
    assert "temperature" in best.unnamed


def test_an_effect_in_half_of_the_data_is_not_the_same_in_parts() -> None:
    """An asymmetry that only the later power cycles have is no property of the sensor."""
    found = evidence(session(5, lambda t, c, w, k: 8e-4 * abs(w) * (k >= 3)))
    checks = found.checks.get("scale_asymmetry")
    assert checks is None or (checks.same_in_parts_p is not None and checks.same_in_parts_p < 1e-3)
    assert checks is None or checks.parts[0] == "power_cycle"


def test_the_order_of_the_runs_changes_nothing() -> None:
    made = session(6, lambda t, c, w, k: 1.5e-4 * abs(w))
    turned = replace(made, runs=tuple(made.runs[::-1]))
    one, other = evidence(made).log_odds, evidence(turned).log_odds
    assert one == pytest.approx(other, abs=0.02)


def test_a_creeping_bias_is_a_rival_of_the_temperature_without_the_time_since_power_on() -> None:
    """The runs of a power cycle follow each other; with the time in each run alone, the temperature would explain it all."""
    made = session(7, cycles=3, seconds=30.0)
    rng, runs = np.random.default_rng(7), []
    for i, run in enumerate(made.runs):
        on_s = 30.0 * (i % len(RATES_DPS)) + run.t_s
        gyro = run.gyro_dps + 5e-4 * on_s[:, None]
        temp_c = 20 + 0.03 * on_s + 0.3 * np.sin(on_s / 40) + rng.normal(0, 0.002, on_s.size)
        runs.append(make_run(run.t_s, gyro, table_rate_dps=run.table_rate_dps, scenario=run.scenario, temp_c=temp_c))
    found = evidence(replace(made, runs=tuple(following(runs))))
    assert found.log_odds["drift"] > found.log_odds["bias_temperature"]
    assert found.log_odds["bias_temperature"] < EVEN


def odds_against_noise(found: Evidence) -> float:
    """Logarithm of the odds that anything is there."""
    (alone,) = (a.probability for a in found.alternatives if a.noise_alone)
    return float(np.log((1 - alone) / max(alone, 1e-300)))


@pytest.mark.parametrize("seed", range(3))
def test_a_random_walk_that_goes_on_from_run_to_run_is_noise(seed: int) -> None:
    """Each run is much shorter than the walk, which is as smooth over the power cycle as the temperature."""
    made = session(seed, cycles=1, seconds=30.0, rates_dps=(0.0, 20.0, 50.0, 90.0, -20.0, -50.0, -90.0, 0.0))
    rng, runs = np.random.default_rng(20 + seed), []
    walk_dps = np.cumsum(rng.normal(0, 0.004 / 20**0.5, (len(made.runs) * len(made.runs[0]), 3)), axis=0)
    for i, run in enumerate(made.runs):
        gyro = run.gyro_dps + walk_dps[i * len(run) : (i + 1) * len(run)]
        runs.append(make_run(run.t_s, gyro, table_rate_dps=run.table_rate_dps, scenario="s0", temp_c=run.temp_c))
    found = evidence(replace(made, runs=tuple(following(runs))))
    assert odds_against_noise(found) < np.log(20)
    assert max(found.log_odds.values()) < SURE


@pytest.mark.parametrize("seed", range(3))
def test_a_drift_that_goes_on_from_run_to_run_is_no_course_of_the_temperature(seed: int) -> None:
    """The temperature rises all the time, and each power cycle has a part of its range: what drifts in it followed it."""
    made = session(seed, cycles=3, seconds=20.0, rates_dps=(0.0, 20.0, 50.0, -20.0, -50.0, 0.0, 30.0, -30.0, 60.0, -60.0))
    rng, runs, of_cycle = np.random.default_rng(40 + seed), [], 10
    dt_s = float(np.median(np.diff(made.runs[0].t_s)))
    kept, drift_dps = np.exp(-dt_s / 100.0), np.zeros(3)
    for i, run in enumerate(made.runs):
        if i % of_cycle == 0:
            drift_dps = rng.normal(0, 0.004, 3)
        course = np.empty((len(run), 3))
        for k, step in enumerate(rng.normal(0, 0.004 * np.sqrt(1 - kept**2), course.shape)):
            course[k] = drift_dps = kept * drift_dps + step
        temp_c = 20 + 0.01 * (20.0 * i + run.t_s) + rng.normal(0, 0.01, run.t_s.size)
        known = {"table_rate_dps": run.table_rate_dps, "scenario": run.scenario, "temp_c": temp_c}
        runs.append(make_run(run.t_s, run.gyro_dps + course, **known))
    assert odds_against_noise(evidence(replace(made, runs=tuple(following(runs))))) < 1.0


def test_noise_alone_is_told_however_improbable() -> None:
    assert odds_against_noise(evidence(session(2, lambda t, c, w, k: 4e-4 * abs(w)))) > KNOTS[-1][0]


def test_a_run_without_a_thermometer_hides_no_effect_of_temperature() -> None:
    """Its bias is its own, and the others still show the coefficient."""
    made = session(8, lambda t, c, w, k: 0.02 * (c - 25))
    runs = [
        replace(run, frame=run.table.drop("temp_c")) if i in (3, 12) else run for i, run in enumerate(made.runs)
    ]  # fmt: skip
    assert evidence(replace(made, runs=tuple(runs))).log_odds["bias_temperature"] > SURE


def test_where_measured_columns_leave_nothing_the_columns_stay_as_they_are() -> None:
    """More of the noise of a reference was taken out than is there, and the noise of samples was a root of less than zero."""
    matrix, states = SimpleNamespace(white_sd_dps=0.1), SimpleNamespace(degrees=9)
    scales = SimpleNamespace(matrix=matrix, chi2=lambda best: -3.0, states=states)
    assert answer._finer(cast(Any, SimpleNamespace(scales=scales, best=None))) is None
