"""The exact posterior against brute force, against one dense least-squares problem, and against its own claims."""

import numpy as np
import pytest

from gyrocal.calibration import estimator, limit
from gyrocal.calibration.estimator import Calibration, Column, estimate
from gyrocal.calibration.scenarios import Protocol, answers, regressors
from gyrocal.effects import base
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Run
from gyrocal.simulation.simulate import paper_windows, simulate

SMALL = Protocol(rate_hz=8.0, table_dps=78.0)


def small(taus_s: list[float], white_sd_dps: float = 0.1) -> Calibration:
    """A ripple and a transient in two seconds of sixteen readings."""
    ripple, spin_up = base.effect("table_ripple"), base.effect("spin_up")
    columns = [Column(ripple, {"amplitude_1": 0.0}, i, 0.0, 0.001) for i in range(2)]
    columns += [Column(spin_up, {"A": 0.0, "tau_s": tau_s}, 0, 0.0005, 0.002) for tau_s in taus_s]
    noise = Noise(white_sd_dps, 0.02, 1.5)
    return Calibration("small", "z", tuple(columns), (), (-0.05, 0.04), (0.004, 0.0005), noise, len(taus_s))


def covariance(run: Run, noise: Noise) -> np.ndarray:
    t_s = run.t_s - run.t_s[0]
    lag = np.abs(np.subtract.outer(t_s, t_s))
    return noise.ou_sd_dps**2 * np.exp(-lag / noise.ou_tau_s) + noise.white_sd_dps**2 * np.eye(len(run))


def draw(calibration: Calibration, n: int, rng: np.random.Generator) -> tuple[list[np.ndarray], np.ndarray]:
    """Both faces' signals without noise [n, samples], and the truth [n, 2] (scale, bias)."""
    bias = rng.normal(*calibration.bias_dps, n)
    scale = rng.normal(*calibration.scale, n)
    k, a = len(calibration.run_columns), calibration.alternatives
    signals = []
    for run in SMALL.runs(2.0):
        c = rng.normal([x.mean for x in calibration.run_columns], [x.sd for x in calibration.run_columns], (n, k))
        chosen = rng.integers(0, a, n)
        c[:, k - a :] *= np.arange(a) == chosen[:, None]
        signals.append(np.column_stack([c, bias, scale]) @ regressors(calibration, run))
    return signals, np.column_stack([scale, bias])


def test_posterior_mean_is_that_of_brute_force() -> None:
    """Importance sampling: two million scenarios drawn from the prior, weighed by how well they explain the readings."""
    calibration = small([0.3, 0.8, 2.0])
    rng = np.random.default_rng(1)
    signals, truth = draw(calibration, 1, rng)
    runs = SMALL.runs(2.0)
    inverse = [np.linalg.inv(covariance(run, calibration.noise)) for run in runs]
    read = [
        s[0] + np.linalg.cholesky(covariance(run, calibration.noise)) @ rng.normal(size=len(run))
        for s, run in zip(signals, runs, strict=True)
    ]
    moments = np.zeros(5)
    for _ in range(20):
        drawn, values = draw(calibration, 100_000, rng)
        off = [y - s for y, s in zip(read, drawn, strict=True)]
        weight = np.exp(-0.5 * sum(np.einsum("ni,ij,nj->n", o, v, o) for o, v in zip(off, inverse, strict=True)))
        moments += [weight.sum(), *(weight @ values), *(weight @ (values - truth) ** 2)]
    mean = moments[1:3] / moments[0]
    sd = np.sqrt(moments[3:] / moments[0] - (mean - truth[0]) ** 2)
    found = answers(calibration, read[0][None], read[1][None], 2.0, SMALL, by_sample=True)
    assert found.scale[0] == pytest.approx(mean[0], abs=0.02 * sd[0])
    assert found.bias_dps[0] == pytest.approx(mean[1], abs=0.02 * sd[1])
    assert found.scale_se[0] == pytest.approx(sd[0], rel=0.02)
    assert found.bias_se_dps[0] == pytest.approx(sd[1], rel=0.02)


def test_linear_case_is_one_gaussian_in_closed_form() -> None:
    """One time constant: everything is Gaussian, and the mean is a conditional expectation."""
    calibration = small([0.8])
    rng = np.random.default_rng(2)
    signals, _ = draw(calibration, 5, rng)
    runs = SMALL.runs(2.0)
    x = [regressors(calibration, run) for run in runs]
    k = len(calibration.run_columns)
    design = np.zeros((2 * k + 2, sum(len(r) for r in runs)))
    n = len(runs[0])
    design[:k, :n], design[k : 2 * k, n:] = x[0][:k], x[1][:k]
    design[2 * k :] = np.column_stack([x[0][k:], x[1][k:]])
    own = [c.mean for c in calibration.run_columns], [c.sd for c in calibration.run_columns]
    mean = np.array([*own[0], *own[0], calibration.bias_dps[0], calibration.scale[0]])
    prior = np.diag(np.array([*own[1], *own[1], calibration.bias_dps[1], calibration.scale[1]]) ** 2)
    noise = np.zeros((2 * n, 2 * n))
    noise[:n, :n] = noise[n:, n:] = covariance(runs[0], calibration.noise)
    gain = prior @ design @ np.linalg.inv(design.T @ prior @ design + noise)
    sd = np.sqrt(np.diag(prior - gain @ design.T @ prior))
    y = np.column_stack(signals)
    want = mean + (y - mean @ design) @ gain.T
    found = answers(calibration, signals[0], signals[1], 2.0, SMALL, by_sample=True)
    np.testing.assert_allclose(found.scale, want[:, -1], atol=1e-9 * sd[-1])
    np.testing.assert_allclose(found.bias_dps, want[:, -2], atol=1e-9 * sd[-2])
    np.testing.assert_allclose(found.scale_se, sd[-1], rtol=1e-9)
    np.testing.assert_allclose(found.bias_se_dps, sd[-2], rtol=1e-9)


def test_evidence_is_the_density_of_the_readings() -> None:
    """Against the Gaussian density of the readings, averaged over what each face's time constant may be."""
    from scipy.special import logsumexp
    from scipy.stats import multivariate_normal

    calibration = small([0.3, 2.0])
    rng = np.random.default_rng(3)
    signals, _ = draw(calibration, 3, rng)
    runs = SMALL.runs(2.0)
    n, k = len(runs[0]), len(calibration.run_columns)
    x = [regressors(calibration, run) for run in runs]
    common = np.column_stack([x[0][k:], x[1][k:]])
    terms = []
    for first in (2, 3):
        for second in (2, 3):
            mean = common.T @ [calibration.bias_dps[0], calibration.scale[0]]
            cov = common.T @ np.diag([calibration.bias_dps[1] ** 2, calibration.scale[1] ** 2]) @ common
            for half, (run, columns, chosen) in enumerate(zip(runs, x, (first, second), strict=True)):
                own = slice(half * n, half * n + n)
                cov[own, own] += covariance(run, calibration.noise)
                for j in (0, 1, chosen):
                    column = calibration.run_columns[j]
                    mean[own] += column.mean * columns[j]
                    cov[own, own] += column.sd**2 * np.outer(columns[j], columns[j])
            terms.append(multivariate_normal(mean, cov).logpdf(np.column_stack(signals)))
    want = logsumexp(terms, axis=0) - np.log(4)
    found = answers(calibration, signals[0], signals[1], 2.0, SMALL, by_sample=True).log_evidence
    constant = want - found  # of the noise alone
    np.testing.assert_allclose(constant, constant[0], atol=1e-6)


def test_intervals_cover_and_nothing_simple_does_better() -> None:
    n = 1500
    data = paper_windows(n, 77)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    before = np.array([np.inf, np.inf])
    for seconds in (2.0, 4.0, 6.0):
        found = limit.limit(data["up"], data["down"], seconds, grid=12)
        error = np.abs(np.column_stack([found.scale, found.bias_dps]) - truth)
        inside = np.mean(error < np.column_stack([found.scale_se, found.bias_se_dps]), axis=0)
        assert np.all(np.abs(inside - 0.683) < 0.05), (seconds, inside)
        assert np.all(error.mean(0) < before)
        before = error.mean(0)
        blocks = answers(limit.table2(8), data["up"], data["down"], seconds, limit.PROTOCOL)
        device = np.abs(np.column_stack([blocks.scale, blocks.bias_dps]) - truth).mean(0)
        assert np.all(device < 1.03 * error.mean(0)), "block means and eight alternatives hardly lose"


def test_the_grid_is_fine_enough() -> None:
    data = paper_windows(200, 5)
    coarse = limit.limit(data["up"], data["down"], 6.0)
    fine = limit.limit(data["up"], data["down"], 6.0, grid=2 * limit.GRID)
    assert np.sqrt(np.mean((coarse.bias_dps - fine.bias_dps) ** 2)) < 0.02 * fine.bias_se_dps.mean()
    assert coarse.bias_se_dps == pytest.approx(fine.bias_se_dps, rel=0.05)


def test_arrays_are_the_estimator() -> None:
    """One scenario by its session and as arrays; a scenario's answer does not depend on its company."""
    session, _ = simulate(None, "table2", seed=3, scenarios=3, seconds=4.0)
    calibration = limit.table2(6)
    up, down = (np.array([r.gyro_dps[:, 2] - r.rate_dps for r in session.runs if r.face == face]) for face in ("up", "down"))
    together = answers(calibration, up, down, 4.0, limit.PROTOCOL)
    for i, (_, runs) in enumerate(session.by_scenario()):
        alone = estimate(calibration, runs)
        assert alone is not None
        assert alone.scale == pytest.approx(together.scale[i], abs=1e-9)
        assert alone.bias_dps == pytest.approx(together.bias_dps[i], abs=1e-7)
        assert alone.scale_se == pytest.approx(together.scale_se[i], rel=1e-6)


def test_alternatives_that_are_left_out_matter_little(monkeypatch: pytest.MonkeyPatch) -> None:
    data = paper_windows(50, 9)
    everything = answers(limit.table2(12), data["up"], data["down"], 6.0, limit.PROTOCOL)
    monkeypatch.setattr(estimator, "MOST_HYPOTHESES", 64)
    likeliest = answers(limit.table2(12), data["up"], data["down"], 6.0, limit.PROTOCOL)
    assert not np.array_equal(likeliest.bias_dps, everything.bias_dps)
    off = (likeliest.bias_dps - everything.bias_dps) / everything.bias_se_dps
    assert np.sqrt(np.mean(off**2)) < 0.15
