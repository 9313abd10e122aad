"""Standard errors against references that are not ours: scipy's least squares, Cramer-Rao bounds, dense matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit, minimize

from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Spreads
from gyrocal.inference.spread_errors import _information
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from make_runs import make_run, make_session

WHITE_DPS, RATE_HZ, RATE_DPS, BIAS_DPS = 0.03, 50.0, 60.0, -0.05
Array = np.ndarray


def white_session(
    seconds: float, term: Callable[[int, Array], Array], runs: int = 4, seed: int = 0, **columns: object
) -> Session:
    """Runs at both directions with white noise alone; ``term(i, t_s)`` is what the reading shows beyond scale and bias."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    made = []
    for i in range(runs):
        rate_dps = RATE_DPS * (-1) ** i
        gyro = np.zeros((t_s.size, 3))
        gyro[:, 2] = 1.002 * rate_dps + BIAS_DPS + term(i, t_s) + rng.normal(0, WHITE_DPS, t_s.size)
        own = {name: of(t_s) if callable(of) else of for name, of in columns.items()}
        made.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario=f"s{i}", power_on_s=4.0, **own))
    return make_session(*made)


def fitted(session: Session, effect_id: str, **values: float) -> AxisFit:
    return fit(session, Model.builtin("paper").with_term(Term(effect_id, "z", values)), axes=["z"]).axes["z"]


def least_squares(session: Session, model: Callable[..., Array], start: list[float]) -> tuple[Array, Array]:
    """Values and standard errors of scale, bias and the model's parameters, by scipy from all samples."""
    y = np.concatenate([r.gyro_dps[:, 2] - r.rate_dps for r in session.runs])
    rate_dps, t_s = (np.concatenate([of(r) for r in session.runs]) for of in (lambda r: r.rate_dps, lambda r: r.t_s))

    def every(_: Array, scale: float, bias: float, *values: float) -> Array:
        return scale * rate_dps + bias + model(t_s, rate_dps, *values)

    found, cov = curve_fit(every, t_s, y, [0.0, 0.0, *start])
    return found, np.sqrt(np.diag(cov))


def test_warmup_has_the_joint_error_of_size_and_time_constant() -> None:
    def warmup(t_s: Array, _: Array, a: float, log_tau: float) -> Array:
        return a * np.exp(-(4.0 + t_s) / np.exp(log_tau))

    session = white_session(40.0, lambda i, t_s: warmup(t_s, t_s, 0.05, np.log(15.0)))
    values, errors = least_squares(session, warmup, [0.04, np.log(12.0)])
    term = fitted(session, "warmup").terms[-1]
    assert term.values["A_dps"] == pytest.approx(values[2], rel=0.01)
    assert term.se["A_dps"] == pytest.approx(errors[2], rel=0.05)
    assert term.se["tau_s"] == pytest.approx(term.values["tau_s"] * errors[3], rel=0.05)
    bias = next(t for t in fitted(session, "warmup").terms if t.effect_id == "bias")
    assert bias.se["bias_dps"] == pytest.approx(errors[1], rel=0.05)


def test_ripple_of_known_phase_has_the_error_of_amplitude_and_phase() -> None:
    def ripple(t_s: Array, rate_dps: Array, amplitude: float, phase_deg: float) -> Array:
        return rate_dps * amplitude * np.cos(np.deg2rad(RATE_DPS * t_s + phase_deg))

    session = white_session(
        20.0, lambda i, t_s: ripple(t_s, RATE_DPS * (-1) ** i, 0.0005, 40.0), table_angle_deg=lambda t_s: RATE_DPS * t_s
    )
    values, errors = least_squares(session, ripple, [0.0004, 30.0])
    term = fitted(session, "table_ripple", amplitude_1=0.0).terms[-1]
    assert [term.values["amplitude_1"], term.values["phase_1_deg"]] == pytest.approx(values[2:], rel=0.02)
    assert [term.se["amplitude_1"], term.se["phase_1_deg"]] == pytest.approx(errors[2:], rel=0.05)


@pytest.mark.parametrize("amplitude", [0.0005, 0.00005])
def test_ripple_of_unknown_phase_has_the_wave_s_own_error(amplitude: float) -> None:
    """A strong wave's amplitude has the error sigma sqrt(2 / N) / w whatever its phases are; a weak one's spread is wider."""
    phases = np.random.default_rng(1).uniform(0, 360, 12)

    def ripple(i: int, t_s: Array) -> Array:
        return RATE_DPS * (-1) ** i * amplitude * np.cos(np.deg2rad(RATE_DPS * t_s + phases[i]))

    session = white_session(18.0, ripple, runs=12)
    term = fitted(session, "table_ripple", amplitude_1=0.0).terms[-1]
    one_run = WHITE_DPS * np.sqrt(2 / (18.0 * RATE_HZ)) / RATE_DPS  # of each cosine and sine
    variance = (4 * amplitude**2 / 2 * one_run**2 + 2 * one_run**4) / (2 * 12)  # of the mean of 24 squares
    assert term.se["amplitude_1"] == pytest.approx(np.sqrt(2) * np.sqrt(variance) / (2 * amplitude / np.sqrt(2)), rel=0.1)
    assert abs(term.values["amplitude_1"] - amplitude) < 4 * term.se["amplitude_1"]


def test_a_tone_attains_the_cramer_rao_bound() -> None:
    """That of a sine with another phase in each run (Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974) 591)."""
    a_dps, f_hz, runs, phases = 0.02, 3.3, 6, np.random.default_rng(2).uniform(0, 2 * np.pi, 6)
    session = white_session(12.0, lambda i, t_s: a_dps * np.sin(2 * np.pi * f_hz * t_s + phases[i]), runs=runs)
    n = round(12.0 * RATE_HZ)
    term = fitted(session, "vibration_tone").terms[-1]
    of_amplitude = WHITE_DPS * np.sqrt(2 / (n * runs))
    of_frequency = np.sqrt(12 * (WHITE_DPS / a_dps) ** 2 * 2 / (4 * np.pi**2 * n * (n**2 - 1) * runs)) * RATE_HZ
    assert term.se["A_dps"] == pytest.approx(of_amplitude, rel=0.05)
    assert term.se["f_hz"] == pytest.approx(of_frequency, rel=0.1)
    assert abs(term.values["f_hz"] - f_hz) < 4 * of_frequency
    assert abs(term.values["A_dps"] - a_dps) < 4 * of_amplitude


def test_bias_over_temperature_has_the_error_of_least_squares() -> None:
    def temp_c(t_s: Array) -> Array:
        return 35 + 8 * np.sin(t_s / 7)

    def bias_temperature(t_s: Array, _: Array, k1: float, k2: float) -> Array:
        above_c = temp_c(t_s) - 25
        return k1 * above_c + k2 * above_c**2

    session = white_session(30.0, lambda i, t_s: bias_temperature(t_s, t_s, 0.002, 1e-4), temp_c=temp_c)
    _, errors = least_squares(session, bias_temperature, [0.0, 0.0])
    term = fitted(session, "bias_temperature", k1_dps_per_c=0.0, k2_dps_per_c2=0.0).terms[-1]
    assert [term.se["k1_dps_per_c"], term.se["k2_dps_per_c2"]] == pytest.approx(errors[2:], rel=0.05)


def test_a_lopsided_time_constant_has_half_of_its_profile_interval() -> None:
    """Size and time constant: where the chi-square of numpy's least squares, over a grid of both, is one above its minimum."""

    def warmup(t_s: Array, _: Array, a: float, tau_s: float) -> Array:
        return a * np.exp(-(4.0 + t_s) / tau_s)

    session = white_session(60.0, lambda i, t_s: warmup(t_s, t_s, 0.03, 60.0), seed=2)
    term = fitted(session, "warmup").terms[-1]
    rate_dps, t_s = (np.concatenate([of(r) for r in session.runs]) for of in (lambda r: r.rate_dps, lambda r: r.t_s))
    y = np.concatenate([r.gyro_dps[:, 2] for r in session.runs]) - rate_dps
    shared = np.linalg.qr(np.column_stack([rate_dps, np.ones(y.size)]))[0]
    left = y - shared @ (shared.T @ y)
    tau_s, a_dps = np.geomspace(20.0, 180.0, 200), np.linspace(0.015, 0.06, 200)
    columns = np.exp(-(4.0 + t_s[:, None]) / tau_s)
    columns -= shared @ (shared.T @ columns)
    chi2 = left @ left - 2 * a_dps[:, None] * (left @ columns) + a_dps[:, None] ** 2 * (columns**2).sum(axis=0)
    inside = chi2 / WHITE_DPS**2 < chi2.min() / WHITE_DPS**2 + 1
    assert term.se["tau_s"] == pytest.approx(np.ptp(tau_s[inside.any(axis=0)]) / 2, rel=0.08)
    assert term.se["A_dps"] == pytest.approx(np.ptp(a_dps[inside.any(axis=1)]) / 2, rel=0.08)


def test_what_is_not_there_has_an_error_as_wide_as_its_range() -> None:
    session = white_session(20.0, lambda i, t_s: 0.0 * t_s)
    for term in fitted(session, "warmup").terms:
        assert all(np.isfinite(se) and se > 0 for se in term.se.values())
    assert term.se["tau_s"] > 90.0  # half of 3 to 200 s at least
    assert abs(term.values["A_dps"]) <= term.se["A_dps"]


def test_information_of_the_spreads_is_that_of_dense_matrices() -> None:
    """G = Z'PZ with all random columns, power cycles and drift in one dense covariance."""
    session, _ = simulate(None, "paper", ["table_ripple"], 1, scenarios=4, seconds=6)
    term = Term("table_ripple", "z", {"amplitude_1": 0.0, "amplitude_2": 0.0})
    found = fit(session, Model.builtin("default").with_term(term), axes=["z"]).axes["z"]
    layout, k = found.design.layout, found.spreads.run.size
    sd = np.concatenate([found.spreads.run, found.spreads.scenario])
    sd = np.where(sd > 0, sd, 1e-4)
    found = replace(found, spreads=Spreads(sd[:k], sd[k:]))
    found = replace(found, solution=found.subset(np.ones(len(found.design.blocks), dtype=bool)))
    n_fixed, size = len(layout.fixed), int(found.design.n_blocks.sum())
    noise, x, first = np.zeros((size, size)), np.zeros((size, n_fixed)), 0
    columns: dict[tuple[str, int, int], Array] = {}
    for i, b in enumerate(found.design.blocks):
        own, rows = found.design.columns(i), slice(first, first + b.t_s.size)
        first = rows.stop
        drift = found.noise.ou_sd_dps**2 * np.exp(-np.abs(b.t_s[:, None] - b.t_s) / found.noise.ou_tau_s)
        noise[rows, rows] = np.diag(found.noise.white_sd_dps**2 / b.n) + drift
        x[rows] = own[1 : 1 + n_fixed].T
        for j in range(len(layout.run)):
            columns.setdefault(("run", i, j), np.zeros(size))[rows] = own[1 + n_fixed + j]
        for j, fixed in enumerate(layout.scenario):
            columns.setdefault(("cycle", b.scenario, j), np.zeros(size))[rows] = own[1 + fixed]
    group = np.array([layout.run_group[j] if of == "run" else k + j for of, _, j in columns])
    z = np.column_stack(list(columns.values()))
    inverse = np.linalg.inv(noise + (z * sd[group] ** 2) @ z.T)
    p = inverse - inverse @ x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse)
    g = z.T @ p @ z
    h = (g * np.where(group < k, sd[group] ** 2, 0.0)) @ g
    sums = np.eye(sd.size)[group]
    information, scatter = _information(found, sd, np.arange(sd.size) < k)
    for ours, dense in ((information, sums.T @ g**2 @ sums / 2), (scatter, sums.T @ h**2 @ sums / 2)):
        scale = np.sqrt(np.outer(np.diag(dense), np.diag(dense)))
        np.testing.assert_allclose(ours / scale, dense / scale, atol=1e-8)


def test_the_spread_of_power_cycles_has_an_error_joint_with_the_drift() -> None:
    """Single runs of 50 s, in which a drift of 15 s is hardly told from an offset, against the Hessian of dense matrices."""
    rng, runs, seconds = np.random.default_rng(5), 20, 50.0
    t_s = np.arange(round(seconds * 4)) / 4

    def drift(sd_dps: float, tau_s: float) -> Array:
        return sd_dps**2 * np.exp(-np.abs(t_s[:, None] - t_s) / tau_s)

    root = np.linalg.cholesky(drift(0.003, 15.0) + 1e-12 * np.eye(t_s.size))
    readings = [rng.normal(0, 0.005) + root @ rng.normal(size=t_s.size) + rng.normal(0, 0.01, t_s.size) for _ in range(runs)]
    made = [
        make_run(t_s, np.column_stack([y, y, y]), table_rate_dps=0.0, scenario=f"s{i}") for i, y in enumerate(readings)
    ]
    found = fit(make_session(*made), Model.builtin("default"), axes=["x"])
    axis, line = found.axes["x"], found.model.line("turn_on_bias", "x")
    assert line is not None

    def loglik(x: Array) -> float:
        """REML of all runs with the logarithms of white level, drift's growth and rate, and the offsets' spread."""
        white, growth, rate, sd = np.exp(x)
        v = drift(np.sqrt(growth / rate), 1 / rate) + white**2 * np.eye(t_s.size) + sd**2
        inverse, ones = np.linalg.inv(v), np.ones(t_s.size)
        weight = ones @ inverse @ ones
        mean = np.mean([ones @ inverse @ y for y in readings]) / weight
        squares = sum((y - mean) @ inverse @ (y - mean) for y in readings)
        return float(-0.5 * (runs * np.linalg.slogdet(v)[1] + np.log(runs * weight) + squares))

    noise = axis.noise
    start = np.log([noise.white_sd_dps, noise.ou_sd_dps**2 / noise.ou_tau_s, 1 / noise.ou_tau_s, axis.turn_on_sd_dps])
    at = minimize(lambda x: -loglik(x), start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-5}).x
    steps = np.diag([0.01, 0.1, 0.1, 0.1])
    hessian = np.array([
        [(loglik(at + a + b) - loglik(at + a - b) - loglik(at - a + b) + loglik(at - a - b)) / (4 * a.max() * b.max())
         for b in steps] for a in steps
    ])  # fmt: skip
    joint = np.exp(at[3]) * np.sqrt(np.linalg.inv(-hessian)[3, 3])
    alone = np.exp(at[3]) / np.sqrt(-hessian[3, 3])
    assert joint > 1.1 * alone
    assert line.se["sd_dps"] == pytest.approx(joint, rel=0.12)
