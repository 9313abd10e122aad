"""The evidence of a set is the density of the readings, computed here from the whole covariance."""

from itertools import product

import numpy as np
import pytest

from gyrocal.effects.quantities import cycle_time_s
from gyrocal.evidence import discrepancy, hypotheses
from gyrocal.evidence.matrix import Matrix, runs_of
from gyrocal.evidence.states import States
from gyrocal.evidence.weights import AMPLITUDES, LEFT_OVER, Scales
from gyrocal.inference.fitted import AxisFit
from gyrocal.noise.whitening import Noise

from .sessions import fitted, session


@pytest.fixture(scope="module")
def scales() -> Scales:
    fit = fitted(session(1, lambda t, c, w, k: 0.01 * (c - 25), cycles=2, seconds=6.0))
    runs = runs_of(fit)
    matrix = Matrix.of(fit, hypotheses.options(runs, 2, ["scale", "bias"]), discrepancy.shapes(runs))
    return Scales(matrix, States.of(matrix))


def dense_log_density(
    fit: AxisFit, noise: Noise, spreads: tuple[float, ...], terms: np.ndarray, sd: np.ndarray, columns: np.ndarray,
    carried: bool,
) -> float:  # fmt: skip
    """Logarithm of the density, but for a constant, by the covariance of all block means [n, n].

    Drift that is ``carried`` goes on from run to run of a power cycle. ``columns`` [n, p] have free coefficients, of which the
    first ones differ between power cycles with ``spreads``, and ``terms`` [n, k] those of standard deviations ``sd`` [k].
    """
    blocks = fit.design.blocks
    cycle = np.concatenate([np.full(b.t_s.size, b.scenario) for b in blocks])
    run = np.concatenate([np.full(b.t_s.size, i) for i, b in enumerate(blocks)])
    t_s = np.concatenate([b.mean(cycle_time_s(b.run)[:, None])[:, 0] for b in blocks])
    n = np.concatenate([b.n for b in blocks])
    y = np.concatenate([b.y_dps[:, 2] for b in blocks])
    cov = np.diag(noise.white_sd_dps**2 / n) + (terms * sd**2) @ terms.T
    if noise.ou_sd_dps > 0:
        cov += noise.ou_sd_dps**2 * np.exp(-np.abs(t_s[:, None] - t_s) / noise.ou_tau_s) * (
            cycle[:, None] == cycle if carried else run[:, None] == run
        )
    for column, spread in zip(columns.T, spreads, strict=False):
        cov += spread**2 * np.outer(column, column) * (cycle[:, None] == cycle)
    inverse = np.linalg.inv(cov)
    information = columns.T @ inverse @ columns
    beta = np.linalg.solve(information, columns.T @ inverse @ y)
    chi2 = float(y @ inverse @ (y - columns @ beta))
    logdet = np.linalg.slogdet(cov)[1] + np.linalg.slogdet(information)[1]
    return float(-0.5 * logdet - 0.5 * (y.size - columns.shape[1]) * np.log(chi2))


def test_the_evidence_is_the_density_of_the_readings(scales: Scales) -> None:
    """Student's t about free bias and scale, for several states of the noise, sets and rests."""
    matrix, fit = scales.matrix, scales.matrix.fit
    blocks, axis = fit.design.blocks, 2
    ids = [o.effect.id for o in matrix.options]
    free = np.concatenate([fit.design.columns(i)[1 : 1 + len(fit.design.layout.fixed)] for i in range(len(blocks))], axis=1).T
    order = [*fit.design.layout.scenario, *(j for j in range(free.shape[1]) if j not in fit.design.layout.scenario)]
    states = [0, 5, int(np.argmax(scales.states.carried)) + 5, len(scales.states.log_weight) - 1]
    assert [scales.states.carried[s] for s in states] == [False, False, True, True]
    gaps = []
    for chosen in ([], ["bias_temperature"], ["drift", "scale_asymmetry"]):
        forms = {e: (ids.index(e), 1) for e in chosen}
        at, sd = scales._columns(forms)
        found = scales._logs(np.array(states), at, sd)
        terms = [np.concatenate([b.mean(matrix.options[k].columns(b.run, axis)) for b in blocks]) for k, _ in forms.values()]
        units = [matrix.options[k].unit for k, _ in forms.values()]
        dense = np.column_stack([np.zeros((len(free), 0)), *(t * u for t, u in zip(terms, units, strict=True))])
        for state, value in zip(states, found, strict=True):
            noise, spreads = scales.states.noises[state], scales.states.spreads[state]
            prior = _log_prior(scales, state)
            expected = dense_log_density(fit, noise, spreads, dense, sd, free[:, order], scales.states.carried[state])
            gaps.append(float(value) - prior - expected)
    assert np.ptp(gaps) < 0.02  # drift is constant within cells of time


def _log_prior(scales: Scales, state: int) -> float:
    """The logarithm of a state's own probability, which its weight holds."""
    from gyrocal.evidence.states import _drifts, _spreads

    logs = [a + b for (_, _, a), (_, b) in product(_drifts(scales.matrix), _spreads(scales.matrix))]
    return logs[state]


def test_a_rest_is_a_set_of_cosines(scales: Scales) -> None:
    """The short way beside a rest gives what integrating its cosines out as further columns gives."""
    at, sd = scales._columns({})
    states = np.arange(4)
    near = scales._with_rests(states, at, sd)
    for number in (0, 7, len(scales.rests) - 1):
        rest = scales.rests[number]
        left = scales.matrix.left[rest.shape]
        long = scales._logs(states, left, np.full(left.size, rest.amplitude_dps)) + rest.log_prior
        np.testing.assert_allclose(near[:, number], long, atol=1e-6)


def test_the_probabilities_of_what_may_be_left_over_add_up(scales: Scales) -> None:
    assert np.exp([rest.log_prior for rest in scales.rests]).sum() == pytest.approx(LEFT_OVER)
    assert len(scales.rests) % len(AMPLITUDES) == 0


def test_states_are_all_that_the_noise_may_do(scales: Scales) -> None:
    logs = [_log_prior(scales, s) for s in range(len(scales.states.log_weight))]
    assert np.exp(logs).sum() == pytest.approx(1.0)


def test_what_may_be_left_over_is_a_sum_of_cosines() -> None:
    runs = session(1, lambda t, c, w, k: 0.0 * t, cycles=2, seconds=6.0).runs
    found = discrepancy.shapes(runs)
    assert any(shape.times is not None for shape in found)
    for shape, run in product((s for s in found if s.against != "rate"), runs):
        part = np.clip((shape.values(run) - shape.low) / (shape.high - shape.low), 0, 1)
        factor = 1.0 if shape.times is None else shape.times(run)
        for k, column in enumerate(shape.columns(run).T, start=1):
            np.testing.assert_allclose(column, np.cos(k * np.pi * part) / k * factor, atol=1e-13)


def test_what_may_be_left_over_against_the_rate_has_no_part_in_proportion_to_it() -> None:
    """That is the scale, or misalignment, by definition: over the session's rates, bending is all that is left."""
    runs = session(1, lambda t, c, w, k: 0.0 * t, cycles=2, seconds=6.0, rates_dps=(-90.0, -30.0, 0.0, 40.0, 90.0)).runs
    shape = next(s for s in discrepancy.shapes(runs) if s.against == "rate")
    columns = np.concatenate([shape.columns(run) for run in runs])
    rates_dps = np.concatenate([np.full(len(run), run.rate_dps[0]) for run in runs])
    assert np.abs(columns).max() > 0.1
    np.testing.assert_allclose(columns.T @ np.column_stack([rates_dps / 90, np.ones(rates_dps.size)]), 0.0, atol=1e-9)


@pytest.mark.parametrize("tau_s", [2.0, 5.0, 20.0])
def test_an_offset_with_the_sign_of_the_turn_that_settles_may_be_left_over(tau_s: float) -> None:
    """On any axis, also one about which nothing turns: beside such an offset, a warm-up and a misalignment were sure names."""
    runs = session(1, lambda t, c, w, k: 0.0 * t, cycles=2, seconds=60.0, rates_dps=(-78.0, 78.0)).runs
    rates_dps = np.concatenate([np.asarray(run.rate_dps) for run in runs])
    settling = np.sign(rates_dps) * np.concatenate([np.exp(-run.t_s / tau_s) for run in runs])
    known = np.column_stack([np.ones(rates_dps.size), rates_dps])
    power = []
    for shape in discrepancy.shapes(runs):
        columns = np.column_stack([known, np.concatenate([shape.columns(run) for run in runs])])
        left = settling - columns @ np.linalg.lstsq(columns, settling, rcond=None)[0]
        power.append(float(left @ left))
    alone = settling - known @ np.linalg.lstsq(known, settling, rcond=None)[0]
    assert min(power) < 0.02 * float(alone @ alone)
