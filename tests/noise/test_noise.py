"""The whitening filter against dense linear algebra; Allan deviation against allantools."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gyrocal.noise.allan import allan_deviation, model_deviation
from gyrocal.noise.color import Color
from gyrocal.noise.drift import ou_noise
from gyrocal.noise.spectrum import evenly_spaced, spectrum
from gyrocal.noise.whitening import Noise, Summed, normal_equations


def dense(t_s: np.ndarray, n: np.ndarray, noise: Noise) -> np.ndarray:
    drift = noise.ou_sd_dps**2 * np.exp(-np.abs(t_s[:, None] - t_s) / noise.ou_tau_s)
    return drift + np.diag(noise.white_sd_dps**2 / n)


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("noise", [Noise(0.04), Noise(0.04, 0.003, 20.0), Noise(0.04, 0.3, 2.0)])
def test_normal_equations_are_those_of_the_dense_covariance(noise: Noise, gap: bool) -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(300) * 0.1
    n = np.full(300, 14.0)
    if gap:
        t_s[150:] += 3.0
        n[10] = 7.0
    columns = rng.normal(size=(2, 3, 300))
    columns[:, 1] = t_s
    gram, logdet = normal_equations(columns, t_s, n, noise)
    v = dense(t_s, n, noise)
    for got, c in zip(gram, columns, strict=True):
        np.testing.assert_allclose(got, c @ np.linalg.solve(v, c.T), rtol=1e-9)
    assert logdet == pytest.approx(np.linalg.slogdet(v)[1], abs=1e-8)


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("noise", [Noise(0.04), Noise(0.04, 0.003, 20.0), Noise(0.04, 0.3, 0.5)])
def test_of_a_columns_own_white_noise_whitening_leaves_the_trace_of_the_inverse_covariance(noise: Noise, gap: bool) -> None:
    rng = np.random.default_rng(2)
    t_s, n = np.arange(300) * 0.1 + 3.0 * gap * (np.arange(300) > 150), np.full(300, 14.0)
    columns, variance = rng.normal(size=(1, 2, 300)), 0.25
    v = np.linalg.inv(dense(t_s, n, noise))
    owed = np.diag([0.0, 300 * 14 * variance])[None]
    summed = Summed.of(columns, t_s, n)
    taken = summed.near(noise, ())[0][0] - summed.less(owed).near(noise, ())[0][0]
    np.testing.assert_allclose(taken[0], np.diag([0.0, variance * np.trace(v)]), rtol=1e-6, atol=1e-6)
    assert summed.left_white(noise) == pytest.approx(np.trace(v) / (300 * 14 / 0.04**2))


@pytest.mark.parametrize("color", [Color(), Color(0.3)])
@pytest.mark.parametrize("cell_s", [0.0, 0.5])
def test_runs_that_are_summed_together_are_the_same_as_one_by_one(cell_s: float, color: Color) -> None:
    """300 runs of 40 blocks are more than are multiplied at once."""
    rng = np.random.default_rng(3)
    t_s, n, columns = np.arange(40) * 0.1, rng.integers(5, 15, 40).astype(float), rng.normal(size=(300, 4, 40))
    together = Summed.of(columns, t_s, n, cell_s, color)
    each = [Summed.of([one], t_s, n, cell_s, color) for one in columns]
    assert len(together.gram) == 300
    for part in ("gram", "within", "means"):
        found, wanted = getattr(together, part), np.concatenate([getattr(one, part) for one in each])
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("size", "rate"), [(1.0002, 1.0), (1.0, 1.0002), (1.0001, 0.9997)])
def test_normal_equations_beside_a_noise_are_those_of_the_other_noise_to_first_order(size: float, rate: float) -> None:
    rng = np.random.default_rng(5)
    t_s, n = np.cumsum(rng.uniform(0.05, 0.15, 300)), rng.integers(1, 15, 300).astype(float)
    columns = rng.normal(size=(3, 4, 300)) + np.array([50.0, 1.0, 0.0, 78.0])[None, :, None]
    columns[:, 1] = 1.0
    summed = Summed.of(list(columns), t_s, n, cell_s=0.3)
    here, there = Noise(0.04, 0.002, 30.0), Noise(0.04, 0.002 * size, 30.0 / rate)
    (grams, near), logdets = summed.near(here, [there])
    exact, logdet = summed.normal_equations(there)
    assert near == pytest.approx(exact, abs=1e-3 * float(np.abs(exact - grams).max()))
    assert logdets[1] == pytest.approx(logdet, rel=1e-14)


@pytest.mark.parametrize("gap", [False, True])
def test_color_is_the_covariance_of_an_autoregression(gap: bool) -> None:
    """Its level is the density at low frequencies: the variance is ``level (1 - c) / (1 + c)``, the correlation c per block."""
    rng = np.random.default_rng(6)
    t_s, n, color, noise = np.arange(80) * 0.1, np.full(80, 10.0), 0.3, Noise(0.04)
    lag = np.abs(np.arange(80)[:, None] - np.arange(80))
    v = noise.white_sd_dps**2 / 10 * (1 - color) / (1 + color) * color**lag
    if gap:
        t_s[30:] += 2.0
        v[:30, 30:] = v[30:, :30] = 0.0
    columns = rng.normal(size=(1, 3, 80))
    gram, logdet = Summed.of(columns, t_s, n, color=Color(color)).normal_equations(noise)
    np.testing.assert_allclose(gram[0], columns[0] @ np.linalg.solve(v, columns[0].T), rtol=1e-9)
    assert logdet == pytest.approx(np.linalg.slogdet(v)[1], abs=1e-8)


def test_a_run_of_one_block_is_one_equation() -> None:
    columns, noise = np.array([[[2.0], [1.0]]]), Noise(0.04, 0.003, 20.0)
    gram, logdet = normal_equations(columns, np.zeros(1), np.full(1, 2000.0), noise)
    variance = dense(np.zeros(1), np.full(1, 2000.0), noise)[0, 0]
    np.testing.assert_allclose(gram[0], columns[0] @ columns[0].T / variance)
    assert logdet == pytest.approx(np.log(variance))


def test_drift_that_is_slow_against_the_white_noise_may_stand_still_for_a_while() -> None:
    """Cells of a second, in which this drift has a hundredth of the white noise's density and less."""
    rng = np.random.default_rng(5)
    noise, t_s, n = Noise(0.044, 0.004, 20.0), np.arange(700) * 0.1, np.full(700, 14.5)
    t_s[300:] += 4.0
    drift = np.linalg.cholesky(dense(t_s, n, replace(noise, white_sd_dps=1e-9)) + 1e-12 * np.eye(700)) @ rng.normal(size=700)
    y = drift + rng.normal(0, noise.white_sd_dps / np.sqrt(n))
    columns = np.stack([y, np.ones(700), t_s, np.cos(t_s), np.exp(-t_s / 2)])[None]
    exact, logdet = normal_equations(columns, t_s, n, noise)
    summed = Summed.of(columns, t_s, n, cell_s=1.0)
    assert summed.t_s.size == 70
    coarse, coarse_logdet = summed.normal_equations(noise)
    np.testing.assert_allclose(np.diagonal(coarse[0])[1:], np.diagonal(exact[0])[1:], rtol=0.01)
    np.testing.assert_allclose(coarse_logdet + coarse[0, 0, 0], logdet + exact[0, 0, 0], atol=0.5)
    beta, same = (np.linalg.solve(g[0, 1:, 1:], g[0, 1:, 0]) for g in (exact, coarse))
    error = np.sqrt(np.diag(np.linalg.inv(exact[0, 1:, 1:])))
    np.testing.assert_array_less(np.abs(same - beta), 0.05 * error)


def test_allan_deviation_is_allantools(require_module: Callable[[str], None]) -> None:
    require_module("allantools")
    import allantools

    rng = np.random.default_rng(2)
    y = rng.normal(0, 0.05, 5000) + ou_noise(5000, 0.01, 0.02, 5.0, 1, rng)[:, 0]
    tau_s, ours = allan_deviation([y], 100.0)
    _, theirs, _, _ = allantools.oadev(y, rate=100.0, data_type="freq", taus=tau_s)
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


def test_allan_deviation_of_the_model_is_that_of_its_noise() -> None:
    noise = Noise(0.044, 0.02, 3.0)
    rng = np.random.default_rng(3)
    series = [
        rng.normal(0, noise.white_sd_dps, 20000) + ou_noise(20000, 0.01, 0.02, 3.0, 1, rng)[:, 0] for _ in range(10)
    ]
    tau_s, measured = allan_deviation(series, 100.0)
    use = tau_s < 20
    np.testing.assert_allclose(measured[use], model_deviation(tau_s, noise, 100.0)[use], rtol=0.08)


def test_white_noise_has_no_line_and_a_tone_has_its_own() -> None:
    rng = np.random.default_rng(4)
    t_s = np.arange(10150) / 145
    quiet = [rng.normal(0, 0.044, t_s.size) for _ in range(4)]
    assert spectrum(quiet, 145.0).peak().chance > 0.01
    level = np.sqrt(np.median(spectrum(quiet, 145.0).level))
    assert level == pytest.approx(0.044 / np.sqrt(72.5), rel=0.03)
    phases = rng.uniform(0, 6.28, 4)
    loud = [q + 0.01 * np.sin(2 * np.pi * 23.4 * t_s + p) for q, p in zip(quiet, phases, strict=True)]
    peak = spectrum(loud, 145.0).peak()
    assert peak.frequency_hz == pytest.approx(23.4, abs=0.02)
    assert peak.amplitude_dps == pytest.approx(0.01, rel=0.1)
    assert peak.chance < 1e-10
    assert spectrum(loud, 145.0).line_power(1e-3) == pytest.approx(0.01**2 / 2, rel=0.2)


@pytest.mark.parametrize("cell_s", [0.0, 0.8])
def test_a_bias_far_above_the_noise_does_not_round_the_likelihood(cell_s: float) -> None:
    """What is left beside a constant column does not depend on the constant, to the rounding of one tridiagonal solution.

    Its largest part is that of the solution by ``Q + N``: a part ``eps·cond(Q + N)`` of the product that the constant enters,
    where Q is at most ``4 / (variance that a cell adds)`` and N the precision of a cell's mean. It depends neither on the
    processor nor on the number of blocks, and is far below 2e-6, to which numerical slopes need the likelihood.
    """
    rng, t_s, noise = np.random.default_rng(9), np.arange(20_000) * 0.2, Noise(0.0075, 0.0146, 6200.0)
    y, one = rng.normal(0, 0.0075, t_s.size), np.ones(t_s.size)
    columns = np.array([[y, one], [y + 3.0, one]])
    without, beside = Summed.of(columns, t_s, np.ones(t_s.size), cell_s).normal_equations(noise)[0]
    left = [g[0, 0] - g[0, 1] ** 2 / g[1, 1] for g in (without, beside)]
    blocks = max(1.0, round(cell_s / 0.2))
    added = 2 * noise.ou_sd_dps**2 * blocks * 0.2 / noise.ou_tau_s
    rounding = np.finfo(float).eps * (1 + 4 * noise.white_sd_dps**2 / (blocks * added)) * beside[0, 0]
    assert left[1] == pytest.approx(left[0], abs=rounding)
    assert rounding < 2e-6


def test_a_tone_keeps_its_frequency_where_samples_are_missing() -> None:
    """Their times tell it: counted without the gaps, 3 % of missing samples raise 7.4 Hz to 7.6 Hz."""
    rng = np.random.default_rng(6)
    t_s = np.round(np.arange(20_000) / 145, 5)
    kept = np.sort(rng.choice(t_s.size, 19_400, replace=False))
    y_dps = 0.03 * np.sin(2 * np.pi * 7.404 * t_s) + rng.normal(0, 0.03, t_s.size)
    (even,), rate_hz = evenly_spaced([y_dps[kept]], [t_s[kept]], 145.0)
    assert even.size == kept[-1] - kept[0] + 1
    assert even.var() == pytest.approx(y_dps[kept].var(), rel=0.03)
    peak = spectrum([even], rate_hz).peak()
    assert peak is not None
    assert peak.frequency_hz == pytest.approx(7.404, abs=0.01)


def test_readings_without_a_gap_or_with_times_that_jitter_stay_as_they_are() -> None:
    rng = np.random.default_rng(7)
    y_dps, t_s = rng.normal(0, 0.03, 3000), np.round(np.arange(3000) / 145, 5)
    for times_s in (t_s, np.cumsum(rng.uniform(0.002, 0.018, 3000)), np.cumsum(rng.exponential(0.01, 3000))):
        (same,), rate_hz = evenly_spaced([y_dps], [times_s], 144.0)
        assert same is y_dps
        assert rate_hz == 144.0
