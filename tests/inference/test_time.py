"""Delays, low-passes and clock errors of any size in the joint fit, against planted truth and against scipy's least squares."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from gyrocal.benchmark import _module
from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.inference import design
from gyrocal.inference.fit import fit
from gyrocal.inference.heldout import fitted as in_sample
from gyrocal.inference.noise_search import fit_noise
from gyrocal.inference.timing import settle, started, with_timing
from gyrocal.recording.session import Session
from gyrocal.recording.timing import SYNCHRONOUS
from known import ON_Z
from make_runs import make_run, make_session
from study import study

pytestmark = pytest.mark.usefixtures("tests_alone")

BENCHMARK = study("time_errors")
CELLS = {c.name: c for c in BENCHMARK.CELLS}


@pytest.mark.parametrize("name", [
    "delay 1 ms", "delay 20 ms", "delay 300 ms", "low-pass 50 ms", "clock 0.0001", "clock -0.02", "clock 0.001, delay 12 ms",
    "delay 12 ms, reference noise 0.05 dps",
])  # fmt: skip
def test_errors_are_those_that_the_standard_errors_say(name: str) -> None:
    z = np.array([e[0] for seed in range(100, 103) for e in BENCHMARK.errors(CELLS[name], seed).values()])
    assert np.max(np.abs(z)) < 4
    assert np.sqrt(np.mean(z**2)) < 2.2


def test_smoothing_a_noisy_reference_moves_no_clock() -> None:
    """A long run tells the clock to 1e-8. The part of the motion that smoothing takes must not stay at its own time."""
    rng = np.random.default_rng(3)
    e, t_s, runs = -8e-4, np.arange(0, 300, 0.05), []
    for i, hz in enumerate((0.3, 0.37)):
        gyro = rng.normal(0, 0.02, (t_s.size, 3))
        gyro[:, 2] += 1.004 * 80 * np.sin(2 * np.pi * hz * (1 + e) * t_s)
        reference = 80 * np.sin(2 * np.pi * hz * t_s) + rng.normal(0, 0.06, t_s.size)
        runs.append(make_run(t_s, gyro, scenario=f"s{i}", rate_ref_dps=reference))
    model = with_lag_and_clock(make_session(*runs), "clock_error")
    found = model.term("clock_error", "z")
    assert found is not None
    assert abs(found.values["e"] - e) < 3 * found.se["e"]


@pytest.mark.parametrize("seed", [0, 5])
def test_a_low_pass_that_leaves_little_of_the_run_is_not_tried(seed: int) -> None:
    """A slow low-pass forgets an unknown past late. What is left then fits anything, and no part of it can be held out."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0, 26, 1 / 160)
    reference = 20 * np.exp(-t_s / 6) * np.sin(2 * np.pi * 0.9 * t_s) + rng.normal(0, 0.01, t_s.size)
    gyro = rng.normal(0, 0.05, (t_s.size, 3))
    gyro[:, 2] += rng.normal(0, 4, t_s.size) * np.exp(-t_s / 3)
    run = make_run(t_s, gyro, rate_ref_dps=reference)
    (term,) = started([Term("lag", "z")], [run], 2)
    assert isinstance(term.effect, TimingEffect)
    assert run.motion is not None
    assert np.mean(run.motion.reached(t_s, term.effect.set(SYNCHRONOUS, term.values))) > 0.45


def with_lag_and_clock(session: Session, *effect_ids: str) -> Model:
    model = Model.builtin("paper")
    for effect_id in effect_ids:
        model = model.with_term(Term(effect_id, "z"))
    return fit(session, model, axes="z").model


def test_the_fit_is_scipy_s_least_squares_of_the_exact_model() -> None:
    """The reference in closed form, samples and not blocks, all parameters at once by another optimiser."""
    rng = np.random.default_rng(8)
    cell = CELLS["clock -0.02, delay 100 ms"]
    session = BENCHMARK.session(cell, 8)
    (run,) = session.runs
    t_s, y_dps = run.t_s, run.gyro_dps[:, 2]
    # the sines of the reference, which was recorded without noise
    spectrum = np.abs(np.fft.rfft(run.rate_dps * np.hanning(len(run))))
    start_hz = np.fft.rfftfreq(len(run), 1 / 20.0)[[np.argmax(np.where(own, spectrum, 0)) for own in bands(len(run))]]

    def motion_dps(x: np.ndarray, at_s: np.ndarray) -> np.ndarray:
        return np.sum([x[k] * np.sin(2 * np.pi * x[k + 3] * at_s) + x[k + 6] * np.cos(2 * np.pi * x[k + 3] * at_s)
                       for k in range(3)], axis=0)  # fmt: skip

    sines = np.concatenate([[60, 30, 12], start_hz, rng.normal(0, 1, 3)])
    motion = least_squares(lambda x: motion_dps(x, t_s) - run.rate_dps, sines, x_scale=[9, 9, 9, 1e-4, 1e-4, 1e-4, 9, 9, 9]).x
    assert np.max(np.abs(motion_dps(motion, t_s) - run.rate_dps)) < 1e-3
    used = (t_s > 0.2) & (t_s < 1199)

    def left(x: np.ndarray) -> np.ndarray:
        scale, bias_dps, tau_s, e = x
        return ((1 + scale) * motion_dps(motion, (1 + e) * t_s - tau_s) + bias_dps - y_dps)[used]

    exact = least_squares(left, [0.0, 0.0, 0.1, -0.02], x_scale=[1e-4, 1e-3, 1e-5, 1e-8]).x
    model = with_lag_and_clock(session, "lag", "clock_error")
    found = [model.value(*of) for of in (
        ("scale", "z", "scale"), ("bias", "z", "bias_dps"), ("lag", "z", "tau_s"), ("clock_error", "z", "e")
    )]  # fmt: skip
    lines = [model.line(i, "z") for i in ("scale", "bias", "lag", "clock_error")]
    errors = [next(iter(line.se.values())) for line in lines if line is not None]
    np.testing.assert_array_less(np.abs(np.subtract(found, exact)), 0.5 * np.array(errors))


def bands(samples: int) -> list[np.ndarray]:
    hz = np.fft.rfftfreq(samples, 1 / 20.0)
    return [(hz > low) & (hz < high) for low, high in ((0.1, 0.2), (0.3, 0.6), (0.8, 1.3))]


def test_the_shape_of_the_lag_is_the_likelier_one() -> None:
    for name, order in (("delay 20 ms", 0.0), ("low-pass 50 ms", 1.0), ("low-pass 300 ms", 1.0)):
        model = with_lag_and_clock(BENCHMARK.session(CELLS[name], 3), "lag")
        assert model.value("lag", "z", "order", -1.0) == order


def test_the_scale_is_right_beside_a_large_delay_and_the_rest_is_noise() -> None:
    session = BENCHMARK.session(CELLS["delay 300 ms"], 5)
    found = fit(session, Model.builtin("default").with_term(Term("lag", "z")), axes="z")
    scale = found.model.term("scale", "z")
    assert scale is not None
    assert abs(scale.values["scale"] - BENCHMARK.SCALE) < 4 * scale.se["scale"]
    left = np.concatenate([p.residual_dps - p.residual_dps.mean() for p in in_sample(found)])
    assert np.std(left) == pytest.approx(BENCHMARK.WHITE_DPS, rel=0.03)


def test_a_fitted_model_is_the_start_of_another_session_of_another_delay() -> None:
    model = with_lag_and_clock(BENCHMARK.session(CELLS["delay 300 ms"], 1), "lag")
    again = fit(BENCHMARK.session(CELLS["delay 5 ms"], 1), model, axes="z").model
    assert again.value("lag", "z", "tau_s") == pytest.approx(0.005, abs=3e-5)


def test_a_calibration_by_a_model_with_a_delay_has_the_scale() -> None:
    """Runs of a swinging table that is read late: the delay is the model's, the scale these runs' own."""
    cell = replace(CELLS["delay 100 ms"], runs=6)
    session = BENCHMARK.session(cell, 6)
    model = fit(session, Model.builtin("default").with_term(Term("lag", "z"))).model
    for found in calibrate(session, methods=["model"], model=model):
        assert abs(found.scale - BENCHMARK.SCALE) < 4 * found.scale_se
        assert found.scale_se < 1e-3


@pytest.mark.parametrize(
    ("name", "effect_id"), [("delay 100 ms", "lag"), pytest.param("clock 0.001", "clock_error", marks=pytest.mark.wide)]
)
def test_a_large_error_of_time_is_named_and_nothing_else(name: str, effect_id: str) -> None:
    found = diagnose(BENCHMARK.session(CELLS[name], 2), ON_Z)
    assert found.best is not None
    assert (found.verdict, found.best.effect.id, found.best.axis) == ("add", effect_id, "z")


def test_power_cycles_may_cease_to_show_a_scale_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of the delay moves the true rates, and the least of them may then vary too little within its power cycle."""
    rng, runs = np.random.default_rng(4), []
    for i in range(4):
        t_s = np.arange(0, 8, 0.02)
        gyro = rng.normal(0, 0.05, (t_s.size, 3))
        gyro[:, 2] += 30 * np.sin(2 * np.pi * 0.4 * (t_s - 0.02) + i)
        runs.append(make_run(t_s, gyro, scenario=f"s{i}", rate_ref_dps=30 * np.sin(2 * np.pi * 0.4 * t_s + i)))
    plain = fit(make_session(*runs), Model.builtin("default"), axes="z").axes["z"].design
    unshifted = fit_noise(plain.changed([*plain.terms, Term("lag", "z", {"order": 1.0, "tau_s": 0.0})]))
    assert unshifted.spreads.scenario.size == 2
    monkeypatch.setattr(design, "LEAST_CONTRAST", 10.0)
    late = settle(unshifted)
    assert late.spreads.scenario.size == 1
    assert late.design.terms[-1].values["tau_s"] == pytest.approx(0.02, abs=0.002)


def test_without_an_error_of_time_none_is_found() -> None:
    session = BENCHMARK.session(BENCHMARK.Cell("none"), 4)
    assert diagnose(session).verdict == "adequate"


def test_a_search_for_a_delay_stays_within_the_reference(tmp_path: Path) -> None:
    """A clock error of long swings asks the delay for steps that leave the whole recording."""
    _module("field").write("clock", 401, tmp_path / "s")
    current = fit(Session.open(tmp_path / "s"), Model.builtin("default"), axes="z").axes["z"]
    late = with_timing(current, Term("lag", "z"))
    assert np.isfinite(late.loglik)
    assert late.design.n_blocks.sum() > current.design.n_blocks.sum() / 4


@pytest.mark.wide
@pytest.mark.parametrize("e", [5e-5, pytest.param(-5e-4, marks=pytest.mark.wide)])
def test_a_delay_and_a_clock_that_cancel_within_the_runs_are_named_together(e: float) -> None:
    """Alone, the clock's error would be found a quarter of its size and hundreds of errors off, and the delay not at all."""
    rng = np.random.default_rng(2)
    t_s, tau_s, runs = np.arange(0, 40, 0.02), 20 * e, []
    for i in range(6):
        hz, size, phase = rng.uniform(0.2, 0.9, 6), rng.uniform(5, 20, 6), rng.uniform(0, 2 * np.pi, 6)
        reference, late = (
            np.sin(2 * np.pi * np.outer(at_s, hz) + phase) @ size for at_s in (t_s, (1 + e) * t_s - tau_s)
        )  # fmt: skip
        gyro = rng.normal(0, 0.044, (t_s.size, 3))
        gyro[:, 2] += 1.004 * late + 0.1 + rng.normal(0, 0.005)
        runs.append(make_run(t_s, gyro, scenario=f"s{i}", rate_ref_dps=reference))
    found = diagnose(make_session(*runs), ON_Z)
    assert found.verdict == "add"
    named = {c.effect.id: c for c in found.candidates if c.decision == "add"}
    assert set(named) == {"clock_error", "lag"} == set(named["lag"].together)
    for candidate, name, truth in ((named["clock_error"], "e", e), (named["lag"], "tau_s", tau_s)):
        assert abs(candidate.values[name] - truth) < 3 * candidate.se[name]
        assert candidate.se[name] < 0.01 * abs(truth)
