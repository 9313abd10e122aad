"""The drawn cases: their physics against closed forms, the rule that tells effects apart, and how they are drawn."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from edge import frozen
from gyrocal.cli import main
from gyrocal.errors import InputError

from . import benchmark
from .conftest import PLAIN, noise_left, reading_of, with_effect
from .drawn import CONFOUNDED, EFFECTS, UNKNOWN, Draw, draws
from .generator.case import Effect
from .generator.chip import badly_joined
from .generator.detectability import whitened
from .generator.session import make
from .generator.signals import SIGNALS, play
from .generator.told_apart import power, told_apart
from .outcome import Answer, Outcome

NAMED = {
    "bias_temperature", "scale_temperature", "thermal_lag", "warmup", "drift", "table_ripple", "vibration_tone", "spin_up",
    "g_sensitivity", "misalignment", "scale_nonlinearity", "scale_asymmetry", "centripetal", "lag", "quantization",
    "saturation", "sampling_fault", "clock_error", "bias_jumps", "thermal_hysteresis", "dead_band", "order_tone",
    "g2_sensitivity", "byte_fault",
}  # fmt: skip
"""Every effect of the documented table that is ever called missing."""


def test_hysteresis_is_a_loop_of_its_width():
    up = np.linspace(20.0, 40.0, 201)
    loop = play(np.concatenate([up, up[::-1]]), 4.0)
    assert loop[0] == 0
    np.testing.assert_allclose(loop[21:201], 1.0)  # half its width further, the loop's upper branch is reached
    np.testing.assert_allclose(loop[242:], -1.0)  # and its lower one a whole width after the turn
    assert abs(loop[221]) < 0.06


def test_a_torn_code_has_the_upper_part_of_the_sample_before():
    codes = np.array([0x01FF, 0x0200, 0x0201, -1])
    torn = badly_joined(codes, {"bit": 8, "fraction": 1.0}, np.random.default_rng(1))
    assert torn.tolist() == [0x01FF, 0x0100, 0x0201, 0x02FF]


def test_a_lost_carry_takes_one_step_off_the_upper_half():
    codes = np.array([0x017F, 0x0180, 0x01FF, 0x0200, -0x0080])
    assert badly_joined(codes, {"bit": 8}, np.random.default_rng(1)).tolist() == [0x017F, 0x0080, 0x00FF, 0x0200, -0x0180]


def test_dead_band_order_tone_and_vibration_follow_their_laws(tmp_path):
    effects = (
        Effect("dead_band", {"width_dps": 2.0}, "z"),
        Effect("order_tone", {"order": 4.25, "A_dps": 0.05, "phase_deg": 30.0}, "x"),
        Effect("g2_sensitivity", {"k_dps_per_g2": 0.2}, "y"),
    )
    case = replace(PLAIN, protocol="staircase", seconds=40.0, effects=effects, vibration_g=0.3, rates_dps=(20.0,))
    for run in make(case, tmp_path).runs:
        still = np.abs(run.rate_dps) < 1.9
        settled = np.abs(np.gradient(run.rate_dps, run.t_s)) < 0.1
        np.testing.assert_allclose(run.injected_dps["dead_band"][2][still & settled], -run.rate_dps[still & settled], atol=1e-6)
        assert np.abs(run.injected_dps["dead_band"][2][settled & ~still]).max() < 1e-6
        wave = 0.05 * np.sin(np.radians(4.25 * run.table_angle_deg + 30.0))
        np.testing.assert_allclose(run.injected_dps["order_tone"][0], wave, atol=1e-3)
        squared = 0.2 * np.sum(run.acceleration_g**2, axis=0)
        assert np.mean(run.injected_dps["g2_sensitivity"][1]) == pytest.approx(np.mean(squared), rel=1e-3)
        assert 0.2 * 1.01 < np.mean(squared) < 0.2 * 1.2


@pytest.mark.parametrize("protocol", ["staircase", "hand", "chamber"])
def test_moving_protocols_state_the_rate_that_turns_the_table(tmp_path, protocol):
    case = replace(PLAIN, protocol=protocol, seconds=30.0, rates_dps=(80.0,), climate="ramp")
    truth = make(case, tmp_path)
    for run in truth.runs:
        side = 1.0 if run.face == "up" else -1.0
        turned = np.concatenate([[0.0], np.cumsum(np.diff(run.t_s) * (run.rate_dps[1:] + run.rate_dps[:-1]) / 2)])
        np.testing.assert_allclose(side * turned, run.table_angle_deg - run.table_angle_deg[0], atol=0.5)
        assert 60.0 < np.abs(run.rate_dps).max() <= 80.1
        assert np.min(np.abs(run.rate_dps)) < 0.1
    white = np.hypot(truth.white_sd_dps, truth.lsb_dps / np.sqrt(12))
    np.testing.assert_allclose(np.std(noise_left(tmp_path, truth), axis=(1, 2)), white, rtol=0.03)


def test_whitening_takes_out_the_low_pass(tmp_path):
    case = replace(PLAIN, seconds=20.0, poll_hz=400.0, odr_hz=833.0, cutoff_hz=83.0, turn_on_sd_dps=0.0)
    truth = make(case, tmp_path)
    for run, noise in zip(truth.runs, noise_left(tmp_path, truth).swapaxes(0, 1), strict=True):
        assert abs(np.corrcoef(noise[:, 1:].ravel(), noise[:, :-1].ravel())[0, 1]) > 0.3, run.file
        white = whitened(truth, noise)[:, 20:]
        assert np.std(white) == pytest.approx(1.0, rel=0.03)
        assert abs(np.corrcoef(white[:, 1:].ravel(), white[:, :-1].ravel())[0, 1]) < 0.05


@pytest.mark.parametrize(("protocol", "alike"), [("paper", True), ("full", False)])
def test_one_rate_tells_neither_gravity_from_misalignment_nor_a_tone_from_an_order(tmp_path, protocol, alike):
    effects = (Effect("misalignment", {"m": 0.002}, "x"), Effect("order_tone", {"order": 7, "A_dps": 0.1, "phase_deg": 0}, "y"))
    truth = make(replace(PLAIN, protocol=protocol, seconds=6.0, effects=effects), tmp_path)
    for effect, rival in (("misalignment", "g_sensitivity"), ("order_tone", "vibration_tone")):
        alone, beside = told_apart(truth, effect)
        assert alone > 8.0
        assert (beside[rival] < 0.1 * alone) == alike
        assert (beside[rival] > 0.7 * alone) == (not alike)


def test_a_faster_warm_up_is_told_from_a_drift_and_a_drift_holds_its_own(tmp_path):
    truth = make(with_effect("warmup", "x", A_dps=0.3, tau_s=3.0), tmp_path)
    alone, beside = told_apart(truth, "warmup")
    assert 8.0 < beside["drift"] < alone
    truth = make(with_effect("drift", "x", k_dps_per_s=0.01), tmp_path / "drift")
    assert "warmup" not in told_apart(truth, "drift")[1]


def test_every_effect_of_the_table_is_drawn_and_has_a_signal():
    assert set(EFFECTS) == NAMED
    digital = {"quantization", "saturation", "sampling_fault", "byte_fault"}
    assert NAMED - digital <= set(SIGNALS)
    assert set(UNKNOWN) <= set(SIGNALS) - NAMED
    assert {id_ for id_, _, _ in CONFOUNDED} <= NAMED


@pytest.mark.parametrize("name", ["work", "frozen", "unseen"])
def test_all_sets_hold_the_same_kinds_of_cases(name):
    each = draws(name)
    assert Counter(draw.kind for draw in each) == {"effect": 200, "set": 60, "confounded": 60, "unknown": 60, "null": 200}
    assert len({draw.name for draw in each}) == len(each)


def test_unseen_cases_are_drawn_from_the_code_that_they_judge(monkeypatch):
    case = []
    for tree in ("a" * 40, "b" * 40):
        monkeypatch.setenv(frozen.TREE, tree)
        case.append(Draw("unseen", "null", 1).case())
    assert case[0].seed != case[1].seed
    assert case[1] == Draw("unseen", "null", 1).case()


def test_no_seed_is_in_both_sets():
    seeds = [draw.seed for name in ("work", "frozen") for draw in draws(name)]
    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize("draw", [Draw("work", "effect", 9), Draw("work", "confounded", 0), Draw("work", "unknown", 5)])
def test_a_draw_is_the_same_each_time_and_is_what_its_kind_says(draw):
    case = draw.case()
    assert case == draw.case()
    assert bool(case.rivals) == (case.kind == "confounded")
    assert case.expected == (() if case.kind == "unknown" else (case.effects[0].id,))


def test_sensors_spread_as_the_population_does(tmp_path):
    found = [make(replace(draw.case(), seconds=0.5), tmp_path / draw.name) for draw in draws("work")[4 :5 * 40 : 5]]
    assert {truth.case.kind for truth in found} == {"null"}
    scale, bias = (np.concatenate([getattr(t, name) for t in found]) for name in ("scale", "bias_dps"))
    assert np.std(scale) == pytest.approx(0.03 / np.sqrt(3), rel=0.2)
    assert np.std(bias) == pytest.approx(10 / np.sqrt(3), rel=0.2)
    assert len({truth.case.poll_hz for truth in found}) >= 5
    assert len({truth.case.protocol for truth in found}) == 7


def test_a_stated_reference_noise_is_in_the_reference(tmp_path):
    truth = make(replace(PLAIN, protocol="hand", seconds=5.0, rates_dps=(50.0,), reference_sd_dps=0.02), tmp_path)
    assert "ref_noise_dps = 0.02" in (tmp_path / "session.toml").read_text()
    assert reading_of(tmp_path, truth.runs[0].file).shape[0] == 3


def _outcome(case, verdict: str = "adequate") -> Outcome:
    return Outcome(case, 0.0, {"gyrocal": Answer(verdict, (("drift", "x"),), ("drift",), ("add",), 0.1)}, "said")


def test_finished_cases_of_the_same_code_are_not_run_again(tmp_path):
    draw, file = Draw("work", "null", 3), tmp_path / "results.jsonl"
    done = _outcome(Draw("work", "effect", 9).case())
    assert Outcome.from_row(json.loads(json.dumps(done.to_row()))) == done
    outcome = _outcome(draw.case())
    rows = [{"code": benchmark.code_state(), **outcome.to_row()}, {"code": "other", **done.to_row()}]
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert benchmark.run([draw], results=file) == [outcome]
    assert set(benchmark._finished(file)) == {draw.name}


def test_a_part_is_the_first_cases_of_the_kinds():
    part = benchmark.chosen(False, "work", ["null", "set"], 3)
    assert Counter(draw.kind for draw in part) == {"null": 3, "set": 3}
    assert max(draw.number for draw in part) == 2
    assert len(benchmark.chosen(True, "frozen", [], None)) == 5
    with pytest.raises(InputError, match="no cases of kind 'storm'"):
        benchmark.chosen(False, "work", ["storm"], None)
    with pytest.raises(InputError, match="there are fixed, work, frozen, unseen"):
        benchmark.chosen(False, "other", [], None)


def test_other_benchmarks_have_no_parts(capsys):
    assert main(["benchmark", "inference", "--limit", "2"]) == 2
    assert "has no parts" in capsys.readouterr().err


def test_bounds_are_clopper_and_pearsons():
    cases = [_outcome(replace(PLAIN, name=str(i)), "adequate" if i else "unknown") for i in range(10)]
    found = benchmark.bounds(cases)["false_alarm_rate"]
    assert found["n"] == 10
    # their table for one of ten
    assert found["within"] == pytest.approx([0.0025, 0.4450], abs=5e-5)


def test_the_power_of_a_known_line_and_of_noise_is_what_their_coefficients_hold(tmp_path):
    """A line of amplitude A in n samples of noise s holds n A^2 / 2 s^2 in two coefficients a run."""
    case = with_effect("vibration_tone", "x", f_hz=30.0, A_dps=0.02)
    case = replace(case, turn_on_sd_dps=0.0)
    truth = make(case, tmp_path)
    runs, n = len(truth.runs), len(truth.runs[0].t_s)
    size = np.std([run.injected_dps["vibration_tone"][0] for run in truth.runs]) ** 2 / (truth.white_sd_dps**2)
    found = power(truth, "vibration_tone")
    assert 0.5 < found / (runs * n * size / np.sqrt(2 * 2 * runs)) <= 1.05  # a line between two bins leaks into its neighbours
