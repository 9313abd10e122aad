"""Each planted effect against its closed form."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter

from .conftest import PLAIN, reading_of, with_effect
from .generator.case import AXES, Case, Effect
from .generator.chip import DIGITAL
from .generator.session import make


def _injected(case: Case, folder: Path, axis: str = "z") -> list[np.ndarray]:
    return [run.injected_dps[case.effects[0].id][AXES.index(axis)] for run in make(case, folder).runs]


@pytest.mark.parametrize(
    "effect",
    [
        Effect("spin_up", {"A": 0.01, "tau_s": 2.0}, "z"),
        Effect("vibration_tone", {"f_hz": 9.0, "A_dps": 0.3}, "x"),
        Effect("stuck_bit", {"bit": 4}, "y"),
        Effect("sampling_fault", {"fraction": 0.1}, "xyz"),
    ],
)
def test_an_effect_changes_the_reading_by_what_was_injected_and_nothing_else(tmp_path, effect):
    case = replace(PLAIN, ou_sd_dps=0.002)
    truth = make(replace(case, effects=(effect,)), tmp_path / "with")
    make(case, tmp_path / "without")
    digital = effect.id in DIGITAL
    for run in truth.runs:
        change = reading_of(tmp_path / "with", run.file) - reading_of(tmp_path / "without", run.file)
        difference = np.abs(change - run.injected_dps[effect.id])
        assert difference.max() <= (1e-6 if digital else truth.lsb_dps + 1e-6)
        assert np.abs(change).max() > 5 * truth.lsb_dps


def test_table_ripple_is_a_wave_of_the_tables_angle_proportional_to_the_rate(tmp_path):
    case = with_effect("table_ripple", protocol="full", amplitude_2=0.003, phase_2_deg=30.0)
    for run in make(case, tmp_path).runs:
        wave = 0.003 * np.cos(np.radians(2 * run.table_angle_deg + 30.0))
        # the low-pass delays the wave by less than two milliseconds
        np.testing.assert_allclose(run.injected_dps["table_ripple"][2], run.rate_dps * wave, atol=0.01 * 0.45)


def test_spin_up_holds_the_rate_back_and_dies_out(tmp_path):
    for run in make(with_effect("spin_up", A=0.01, tau_s=1.5), tmp_path).runs:
        late = run.t_s > 0.1
        expected = -run.rate_dps * 0.01 * np.exp(-run.t_s / 1.5)
        np.testing.assert_allclose(run.injected_dps["spin_up"][2][late], expected[late], rtol=0.01)
        assert np.all(np.sign(run.injected_dps["spin_up"][2]) == -np.sign(run.rate_dps))


def test_warmup_and_drift_run_with_the_time_since_power_on(tmp_path):
    effects = (Effect("warmup", {"A_dps": 0.05, "tau_s": 20.0}, "x"), Effect("drift", {"k_dps_per_s": 1e-3}, "y"))
    truth = make(replace(PLAIN, effects=effects), tmp_path)
    for up, down in zip(truth.runs[0::2], truth.runs[1::2], strict=True):
        for run in (up, down):
            expected = 0.05 * np.exp(-(run.power_on_s + run.t_s) / 20.0)
            np.testing.assert_allclose(run.injected_dps["warmup"][0], expected, rtol=1e-3)
            ramp = 1e-3 * (run.power_on_s - up.power_on_s + run.t_s)
            np.testing.assert_allclose(run.injected_dps["drift"][1], ramp, atol=1e-5)
        assert down.power_on_s > up.power_on_s + up.t_s[-1]


def test_thermal_effects_follow_temperature_its_slope_and_the_rate(tmp_path):
    effects = (
        Effect("bias_temperature", {"k1_dps_per_c": 0.01, "k2_dps_per_c2": 0.002}, "x"),
        Effect("scale_temperature", {"k_per_c": 1e-4}, "z"),
        Effect("thermal_lag", {"k_dps_s_per_c": 0.3}, "y"),
    )
    for run in make(replace(PLAIN, effects=effects, climate="chamber"), tmp_path).runs:
        dt = run.temp_c - 25.0
        np.testing.assert_allclose(run.injected_dps["bias_temperature"][0], 0.01 * dt + 0.002 * dt**2, atol=1e-4)
        np.testing.assert_allclose(run.injected_dps["scale_temperature"][2], 1e-4 * dt * run.rate_dps, atol=1e-4)
        slope = np.gradient(run.temp_c, run.t_s)
        np.testing.assert_allclose(run.injected_dps["thermal_lag"][1][2:-2], 0.3 * slope[2:-2], atol=0.02)
        assert np.mean(slope * run.injected_dps["thermal_lag"][1]) > 0


@pytest.mark.parametrize(
    ("id_", "parameters", "law"),
    [
        ("misalignment", {"m": 0.01}, lambda rate, up: 0.01 * rate),
        ("scale_nonlinearity", {"k3": 1e-7}, lambda rate, up: 1e-7 * rate**3),
        ("scale_asymmetry", {"k": 1e-3}, lambda rate, up: 1e-3 * abs(rate)),
        ("centripetal", {"k": 1e-5}, lambda rate, up: 1e-5 * rate**2),
        ("g_sensitivity", {"gz_dps_per_g": 0.05}, lambda rate, up: 0.05 * up),
    ],
)
def test_terms_of_rate_and_gravity_are_constant_through_a_run(tmp_path, id_, parameters, law):
    rates = set()
    for run in make(with_effect(id_, "x", "full", **parameters), tmp_path).runs:
        expected = law(run.rate_dps[0], 1.0 if run.face == "up" else -1.0)
        np.testing.assert_allclose(run.injected_dps[id_][0], expected, rtol=1e-3, atol=1e-12)
        assert not run.injected_dps[id_][1:].any()
        rates.add(round(float(np.sign(run.rate_dps[0]))))
    assert rates == {-1, 0, 1}


def test_tone_has_its_frequency_and_the_amplitude_that_the_low_pass_leaves(tmp_path):
    case = replace(with_effect("vibration_tone", "x", f_hz=40.0, A_dps=0.2), seconds=20.0)
    phases = []
    for run in make(case, tmp_path).runs:
        phasor = np.mean(run.injected_dps["vibration_tone"][0] * np.exp(-2j * np.pi * 40.0 * run.t_s)) * 2
        assert abs(phasor) == pytest.approx(0.2 / np.sqrt(1 + (40 / 136) ** 4), rel=0.03)
        phases.append(np.angle(phasor))
    assert np.std(phases) > 0.3


def test_lag_and_clock_error_are_their_first_order_forms(tmp_path):
    # the rate is latched at the chip's sample, up to an ODR period before the poll: smooth the slope over 0.3 s
    for run in make(with_effect("lag", protocol="swing", tau_s=0.005), tmp_path / "lag").runs:
        slope = savgol_filter(run.rate_dps, 43, 2, deriv=1, delta=1 / 145)
        assert np.abs(slope).max() > 2.0
        np.testing.assert_allclose(run.injected_dps["lag"][2][20:], -0.005 * slope[20:], atol=0.03 * 0.005 * 8)
    for run in make(with_effect("clock_error", protocol="swing", e=1e-3), tmp_path / "clock").runs:
        expected = 1e-3 * run.t_s * savgol_filter(run.rate_dps, 43, 2, deriv=1, delta=1 / 145)
        assert np.abs(expected).max() > 0.005
        np.testing.assert_allclose(run.injected_dps["clock_error"][2], expected, atol=0.03 * np.abs(expected).max())


def test_jumps_last_until_power_off(tmp_path):
    case = replace(with_effect("bias_jumps", "y", n=3, size_dps=0.2), scenarios=6)
    truth = make(case, tmp_path)
    steps = 0
    for up, down in zip(truth.runs[0::2], truth.runs[1::2], strict=True):
        signal = np.concatenate([run.injected_dps["bias_jumps"][1] for run in (up, down)])
        assert signal[0] == 0.0
        # the low-pass lets a step through within a few samples
        changes = np.diff(signal[np.r_[0 : len(signal) : 20, len(signal) - 1]])
        steps += np.count_nonzero(np.abs(changes) > 0.1)
        assert all(min(abs(change), abs(abs(change) - 0.2)) < 0.02 for change in changes)
    assert steps == 3


def test_digital_faults_do_what_they_say(tmp_path):
    make(with_effect("quantization", "xyz", lsb_dps=0.07), tmp_path / "coarse")
    steps = reading_of(tmp_path / "coarse", "000_up.csv") / 0.07
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-4)
    assert tomllib.loads((tmp_path / "coarse/session.toml").read_text())["lsb_dps"] == 0.00875

    make(with_effect("stuck_bit", "y", bit=3), tmp_path / "stuck")
    counts = np.round(reading_of(tmp_path / "stuck", "001_down.csv") / 0.00875).astype(int)
    assert np.all(counts[1] & 8)
    assert 0.2 < np.mean((counts[0] & 8) > 0) < 0.8

    truth = make(with_effect("sampling_fault", "xyz", fraction=0.2), tmp_path / "repeats")
    repeated = [np.all(np.diff(reading_of(tmp_path / "repeats", run.file), axis=1) == 0, axis=0) for run in truth.runs]
    assert np.mean(repeated) == pytest.approx(0.2, abs=0.02)

    case = replace(with_effect("saturation", protocol="full", full_scale_dps=125.0), full_scale_dps=125.0)
    truth = make(case, tmp_path / "clipped")
    for run in truth.runs:
        reading = reading_of(tmp_path / "clipped", run.file)[2]
        assert np.abs(reading).max() <= 125.0
        if abs(run.table_rate_dps) > 140:
            assert np.ptp(reading) == 0.0
            np.testing.assert_allclose(np.abs(reading), 125.0, atol=truth.lsb_dps)


def test_unknown_effects_are_none_of_the_library(tmp_path):
    """Stick-slip, resonance and sweep hold no line: the strongest bin of a run has a small part of their power."""
    tone = with_effect("vibration_tone", "x", f_hz=24.0, A_dps=0.1)
    sweep = with_effect("fan_sweep", "x", f_start_hz=18.0, f_end_hz=26.0, A_dps=0.1)
    ringing = with_effect("mount_resonance", "x", f_hz=31.0, bandwidth_hz=1.5, sd_dps=0.1)
    slip = with_effect("stick_slip", "x", amplitude=1e-3, period_s=0.8, spread=0.25)

    def share_of_strongest_line(case: Case) -> float:
        shares = []
        for signal in _injected(replace(case, seconds=30.0), tmp_path, "x"):
            power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)))) ** 2
            peak = int(np.argmax(power))
            shares.append(power[max(0, peak - 2) : peak + 3].sum() / power.sum())
        return float(np.mean(shares))

    assert share_of_strongest_line(tone) > 0.9
    assert max(share_of_strongest_line(case) for case in (sweep, ringing, slip)) < 0.4
    ringing_sd = np.std(_injected(replace(ringing, seconds=60.0), tmp_path, "x"))
    assert ringing_sd == pytest.approx(0.1, rel=0.15)


def test_gear_ripple_keeps_its_order_at_every_rate(tmp_path):
    case = replace(with_effect("gear_ripple", "z", "full", order=3.37, amplitude=1e-3), seconds=30.0)
    for run in make(case, tmp_path).runs:
        signal, rate = run.injected_dps["gear_ripple"][2], run.rate_dps[0]
        if rate == 0:
            assert not signal.any()
            continue
        angle = np.radians(run.table_angle_deg)
        at = {order: abs(np.mean(signal * np.exp(-1j * order * angle))) * 2 / abs(rate) for order in (3, 3.37, 4)}
        assert at[3.37] == pytest.approx(1e-3, rel=0.2)
        assert max(at[3], at[4]) < 0.75 * at[3.37]


def test_two_point_control_holds_two_levels_of_uneven_lengths(tmp_path):
    case = replace(with_effect("two_point_control", "x", A_dps=0.1, period_s=1.0), seconds=30.0)
    for signal in _injected(case, tmp_path, "x"):
        assert np.mean(np.abs(np.abs(signal) - 0.1) < 1e-3) > 0.9
        edges = np.flatnonzero(np.diff(np.sign(signal)))
        halves_s = np.diff(edges) / 145.0
        assert 0.33 < halves_s.min() < halves_s.max() < 0.67
