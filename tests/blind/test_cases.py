"""The fixed cases: how far their effects stand out, and which protocols show them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from .cases import CASES, FULL, IDENTIFIED_IN, PAPER, SWING
from .conftest import LENGTH_S, PLAIN, with_effect
from .generator.case import Effect
from .generator.detectability import detectability, white_detectability
from .generator.session import make

BANDS = {"small": (8.0, 14.0), "large": (24.0, 42.0)}
SIZED_OTHERWISE = ("bias_jumps", "quantization", "saturation", "sampling_fault")


def test_detectability_equals_dense_generalised_least_squares(tmp_path):
    case = replace(PLAIN, ou_sd_dps=0.02, ou_tau_s=0.5, turn_on_sd_dps=0.03, seconds=0.6)
    effects = (Effect("spin_up", {"A": 0.002, "tau_s": 0.3}, "z"), Effect("drift", {"k_dps_per_s": 0.01}, "x"))
    truth = make(replace(case, effects=effects), tmp_path)
    runs, n = truth.runs, len(truth.runs[0].t_s)
    lags = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / 145.0
    one = 0.02**2 * np.exp(-lags / 0.5) + (truth.white_sd_dps**2 + truth.lsb_dps**2 / 12) * np.eye(n)
    same = np.equal.outer([run.scenario for run in runs], [run.scenario for run in runs])
    covariance = np.kron(np.eye(len(runs)), one) + np.kron(same, np.full((n, n), 0.03**2))
    inverse = np.linalg.inv(covariance)
    total = 0.0
    for effect, columns in (("spin_up", ["rate", "bias"]), ("drift", ["bias"])):
        axis = 2 if effect == "spin_up" else 0
        signal = np.concatenate([run.injected_dps[effect][axis] for run in runs])
        known = {"rate": np.concatenate([run.rate_dps for run in runs]), "bias": np.ones_like(signal)}
        x = np.array([known[name] for name in columns]).T
        projected = inverse @ x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse @ signal)
        expected = signal @ (inverse @ signal - projected)
        assert detectability(truth, effect) == pytest.approx(np.sqrt(expected), rel=1e-6)
        total += expected
    assert detectability(truth) == pytest.approx(np.sqrt(total), rel=1e-6)


def test_without_drift_and_turn_on_both_detectabilities_agree_on_a_zero_mean_signal(tmp_path):
    case = replace(with_effect("vibration_tone", "x", f_hz=30.0, A_dps=0.01), turn_on_sd_dps=0.0)
    truth = make(case, tmp_path)
    n = sum(len(run.t_s) for run in truth.runs)
    assert white_detectability(truth) == pytest.approx(detectability(truth), rel=0.02)
    amplitude = 0.01 / np.sqrt(1 + (30 / 136) ** 4)
    assert white_detectability(truth) == pytest.approx(amplitude * np.sqrt(n / 2) / truth.white_sd_dps, rel=0.03)


@pytest.mark.parametrize("id_", [id_ for id_ in IDENTIFIED_IN if id_ != "misalignment"])
def test_protocols_show_what_the_cases_claim(tmp_path, id_):
    """Thirty times the small size: many standard errors where the protocol shows it, under one where it does not."""
    planted = FULL.get(id_) or SWING.get(id_) or PAPER[id_]
    factor = 10.0 if id_ == "sampling_fault" else 30.0
    settings = {**(planted.settings or {}), "effects": (planted.on("z", factor),)}
    for protocol in ("paper", "full", "swing"):
        case = replace(PLAIN, protocol=protocol, seconds=LENGTH_S[protocol], file_format="parquet", **settings)
        seen = detectability(make(case, tmp_path / protocol))
        assert (seen > 3.0) == (protocol in IDENTIFIED_IN[id_]), f"{protocol}: {seen:.2f}"
        assert seen > 3.0 or seen < 1.0


@pytest.mark.parametrize(("protocol", "told_apart"), [("paper", False), ("full", True)])
def test_one_rate_cannot_tell_misalignment_from_gravity(tmp_path, protocol, told_apart):
    effects = (Effect("misalignment", {"m": 0.001}, "x"), Effect("g_sensitivity", {"gz_dps_per_g": 0.05}, "x"))
    truth = make(replace(PLAIN, protocol=protocol, effects=effects), tmp_path)
    rate, gravity = (np.array([run.injected_dps[effect.id][0].mean() for run in truth.runs]) for effect in effects)
    cosine = rate @ gravity / np.linalg.norm(rate) / np.linalg.norm(gravity)
    assert cosine < 0.1 if told_apart else cosine > 0.9999


def test_the_list_of_cases_is_complete_and_fixed():
    kinds = Counter(case.kind for case in CASES)
    assert kinds == {"null": 72, "effect": 76, "pair": 10, "confounded": 12, "unknown": 10}
    assert len({case.name for case in CASES}) == len({case.seed for case in CASES}) == len(CASES)
    sized = Counter((case.expected[0], case.name.split("_")[-2]) for case in CASES if case.kind == "effect")
    assert sized == {(id_, size): 2 for id_ in IDENTIFIED_IN for size in ("small", "large")}
    assert all(len(case.expected) == 2 for case in CASES if case.kind == "pair")
    assert len({case.effects[0].id for case in CASES if case.kind == "unknown"}) == 5
    for case in CASES:
        if case.kind in ("effect", "pair"):
            assert case.protocol in case.identified_in, case.name
        if case.kind == "confounded":
            assert case.protocol not in case.identified_in, case.name
        if case.kind == "unknown":
            assert case.effects[0].id not in IDENTIFIED_IN


@pytest.mark.parametrize("id_", list(IDENTIFIED_IN))
def test_sizes_are_what_the_cases_claim(tmp_path, id_):
    """The first of each two cases; the benchmark names those of all that are too faint."""
    for case in CASES:
        if case.kind == "effect" and case.expected == (id_,) and case.name.endswith("_0"):
            seen = detectability(make(replace(case, file_format="parquet"), tmp_path / case.name))
            low, high = BANDS[case.name.split("_")[-2]]
            assert low <= seen, case.name
            assert seen <= high or id_ in SIZED_OTHERWISE, case.name
