"""The benchmarks that run from a checkout: pinned keys, and figures that hold together. A few scenarios only."""

import importlib
import random
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from answers import check
from gyrocal import benchmark
from gyrocal.errors import InputError
from known import add_measured

pytestmark = pytest.mark.slow
RIPPLES = ("ripple of order 2, 0.1 %", "ripple of order 3, 0.1 %")
HIDDEN = ("none", *RIPPLES, "offset of 50 mdps")
METHODS = ["baseline", "prior", "shrunk", "model", "paper", "gyrocal", "limit"]


@pytest.fixture(scope="module")
def paper() -> Iterator[dict[str, Any]]:
    """One campaign, learned from the third day and judged on the first, and the paper's split.

    Of the hidden signals those that a test asks for, at one size; the models that are learned come from shorter runs.
    """
    module = benchmark._module("paper")
    hidden = importlib.import_module("benchmarks.paper_hidden")
    draw = hidden._hidden_signals
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hidden, "_hidden_signals", lambda *of: {kind: f for kind, f in draw(*of).items() if kind in HIDDEN})
        patch.setattr(hidden, "SIGMAS", (5,))
        patch.setattr(hidden, "LEARN_S", 15.0)
        patch.setattr(hidden, "add", add_measured)
        every = list(module.folds())
        patch.setattr(module, "SAMPLE_SEEDS", 1)
        patch.setattr(module, "folds", lambda: [(s, known[-12:], tested) for s, known, tested in (every[0], every[3])])
        yield benchmark.benchmark("paper", sample=True, quiet=True)


@pytest.mark.wide
def test_paper_has_the_pinned_keys(paper: dict[str, Any]) -> None:
    check("benchmark", paper)
    assert {row["hidden"] for row in paper["misfit"]} == set(HIDDEN)
    assert paper["scenarios"] == 13
    assert [(r["seconds"], r["method"]) for r in paper["table2"]] == [(s, m) for s in (2.0, 4.0, 6.0) for m in METHODS]
    assert {"scale_mae", "bias_mae_dps", "scale_over_limit", "bias_over_limit"} <= set(paper["table2"][0])
    for key in ("improvement_percent", "time_saving_percent"):
        assert list(paper[key]) == METHODS
        assert all({"scale", "bias", "mean"} <= set(v) for v in paper[key].values())
    assert len(paper["table2_against_labels"]) == len(paper["table2_paper_split"]) == 21


@pytest.mark.wide
def test_papers_figures_hold_together(paper: dict[str, Any]) -> None:
    at = {(r["seconds"], r["method"]): r for r in paper["table2"]}
    for seconds in (2.0, 4.0, 6.0):
        assert at[seconds, "limit"]["scale_over_limit"] == 1.0
        for method in ("baseline", "paper"):
            assert at[seconds, method]["bias_mae_dps"] > at[seconds, "limit"]["bias_mae_dps"]
    six = {m: at[6.0, m] for m in METHODS}
    for method in METHODS:
        gain = 100 * (1 - six[method]["scale_mae"] / six["baseline"]["scale_mae"])
        assert paper["improvement_percent"][method]["scale"] == pytest.approx(gain)
    assert all(paper["improvement_percent"][m]["mean"] > 60 for m in ("model", "gyrocal", "limit"))
    error = np.array([row["bias_dps"] for row in paper["baseline_mae"]])
    assert error.size == 70
    first = int(np.flatnonzero(error <= six["model"]["bias_mae_dps"])[0]) + 1
    assert paper["convergence_s"]["model"]["bias"] == first
    assert np.all(error[: first - 1] > six["model"]["bias_mae_dps"])


@pytest.mark.wide
def test_the_misfit_speaks_of_what_can_be_seen(paper: dict[str, Any]) -> None:
    """Typical effects: at least 95 % of those beyond five standard errors; noise alone hardly ever; an offset never."""
    at = {(r["hidden"], r["seconds"]): r for r in paper["misfit"]}
    assert all(at["none", s]["flagged"] <= 0.03 for s in (2.0, 4.0, 6.0))
    for kind in RIPPLES:
        assert at[kind, 6.0]["flagged_of_those"] >= 0.95
        assert at[kind, 6.0]["beyond_five_se"] > 0.9
    assert at["offset of 50 mdps", 6.0]["beyond_five_se"] < 0.01
    assert at["offset of 50 mdps", 6.0]["flagged"] < 0.05


@pytest.mark.wide
def test_a_hidden_effect_that_is_added_comes_near_the_limit(paper: dict[str, Any]) -> None:
    at = {(r["seconds"], r["method"]): r for r in paper["hidden_effect"]["answers"]}
    for seconds in (4.0, 6.0):
        assert at[seconds, "model after"]["bias_over_limit"] < 1.2 < 2.0 < at[seconds, "model before"]["bias_over_limit"]
        assert at[seconds, "model before"]["flagged"] >= 0.95
        assert at[seconds, "model after"]["flagged"] < 0.06


@pytest.mark.wide
def test_inference_has_the_pinned_keys(require_tool: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> None:
    require_tool("arm-none-eabi-gcc")
    require_tool("qemu-system-arm")
    module = benchmark._module("inference")
    monkeypatch.setattr(module, "GENERATOR", "a-generator-that-is-not-there")
    found = benchmark.benchmark("inference", quiet=True)
    check("benchmark", found)
    assert found["peers"] == []
    assert found["absent"] == ["a-generator-that-is-not-there"]
    assert found["best_peer_ratio"] == {"instructions": None, "ram": None, "flash": None}
    for part, most_instructions in (("ours", 100_000), ("gyrocal", 400_000)):
        assert 5_000 < found[part]["instructions"] < most_instructions
        assert 500 < found[part]["ram_bytes"] < 10_000
        assert 1_000 < found[part]["flash_bytes"] < 20_000


def test_truths_of_real_recordings_recover_what_was_planted() -> None:
    """The numpy fits that grade real recordings, on a swing and a rotation with known answers."""
    module = benchmark._module("real")
    t_s = np.arange(0, 60, 0.01)
    angle = 90 * np.sin(0.5 * t_s)
    rate = 45 * np.cos(0.5 * (t_s - 0.012))
    scale, bias, lag_s = module.swing_fit(t_s, angle, 0.985 * rate - 0.04)
    assert (scale, bias, lag_s) == pytest.approx((-0.015, -0.04, 0.012), abs=1e-3)
    half = np.deg2rad(30.0 * t_s) / 2
    quaternion = np.column_stack([np.cos(half), 0.6 * np.sin(half), 0.0 * half, 0.8 * np.sin(half)])
    body = module.body_rate_dps(quaternion, 100.0)[1:-1]
    assert body == pytest.approx(np.tile([18.0, 0.0, 24.0], (len(body), 1)), abs=1e-6)
    tone = np.random.default_rng(1).normal(0, 0.05, 40_000) + 0.05 * np.sin(2 * np.pi * 17.3 * np.arange(40_000) / 100)
    assert module.lines_hz(tone, 100.0) == pytest.approx([17.3], abs=0.02)


def test_the_truth_of_a_recording_by_hand_is_of_its_rests_and_in_the_accelerometer_s_frame() -> None:
    benchmark._module("real")  # puts the checkout on the path
    module = importlib.import_module("benchmarks.real_gravity")
    rng = np.random.default_rng(3)
    gyro_dps = rng.normal([0.1, -0.2, 0.3], 0.02, (3050, 3))
    gyro_dps[1000:2000] += 50 * np.sin(np.arange(1000) / 30)[:, None]
    still = module.still_dps(gyro_dps)
    assert still.shape == (20, 3)
    assert still.mean(axis=0) == pytest.approx([0.1, -0.2, 0.3], abs=0.003)
    turn = module.kept_x(module.ACC_AXES)
    assert turn @ turn.T == pytest.approx(np.eye(3))
    assert np.triu(module.ACC_AXES @ turn.T, 1) == pytest.approx(np.zeros((3, 3)))


def test_real_recordings_that_are_absent_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(benchmark._module("real"), "REALDATA", tmp_path)
    found = benchmark.benchmark("real", quiet=True)
    check("benchmark", found)
    assert (found["of"], set(found["absent"])) == (0, set(benchmark._module("real").RECORDINGS))


def test_soak_accounts_for_every_sample_and_trusts_nothing_wrong(require_tool: Callable[[str], str]) -> None:
    """Seeds without `garbled`, whose damage depends on timing. A sample is kept, counted as lost, or behind an unheard end."""
    require_tool("cc")
    found = benchmark.benchmark("soak", quiet=True, hours=0.1, seed=25)
    check("benchmark", found)
    assert found["device_hours"] >= 0.1
    assert (found["unaccounted"], found["wrong"]) == ([], [])
    behind = sum(one["samples"] for one in found["unheard"])
    assert found["sent"] == found["kept"] + found["left_out"] + found["lost"] + behind
    assert found["lost"] > 0
    assert min(found["clock_wraps"], found["sequence_wraps"], found["trusted"]) > 0


def test_soak_sees_a_sample_that_vanishes(require_tool: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> None:
    require_tool("cc")
    module = benchmark._module("soak")
    play = module._play

    def forgetful(*arguments: Any) -> Any:
        sent, report = play(*arguments)
        report.runs[0].samples -= 1
        return sent, report

    monkeypatch.setattr(module, "_play", forgetful)
    found = benchmark.benchmark("soak", quiet=True, hours=0.01, seed=3)
    check("benchmark", found)
    assert [one["samples"] for one in found["unaccounted"]] == [1]


def test_a_benchmark_that_there_is_not() -> None:
    there = "paper, robustness, inference, population, coverage, real, fleet, soak, field, references, edge, strangers, blind"
    with pytest.raises(InputError, match=f"there are {there}"):
        benchmark.benchmark("nothing")


@pytest.mark.wide
def test_field_counts_names_alarms_and_errors_and_resumes(tmp_path: Path) -> None:
    results = tmp_path / "field.jsonl"
    part = {"kinds": ["coarse", "temp_missing"], "limit": 1, "results": results, "seed": 403}
    found = benchmark.benchmark("field", quiet=True, **part)
    check("benchmark", found)
    null, planted = found["rows"]
    assert (null["kind"], null["sessions"]) == ("coarse", 1)
    assert (null["false_names"], null["alarms"], null["contradictions"]) == (0, 0, 0)
    assert (planted["kind"], planted["named"], planted["z"]["n"]) == ("temp_missing", 1, 1)
    assert planted["z"]["largest"] < 4
    assert benchmark.benchmark("field", quiet=True, **part) == found
    assert len(results.read_text(encoding="utf-8").splitlines()) == 2


def test_field_sessions_know_nothing_of_the_library() -> None:
    for name in ("field_sessions", "field_planted"):
        assert "gyrocal." not in (benchmark.ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8")


@pytest.mark.wide
def test_references_count_errors_and_names_and_resume(tmp_path: Path) -> None:
    results = tmp_path / "references.jsonl"
    part = {"kinds": ["second_file", "encoder_effect"], "limit": 1, "results": results, "seed": 3}
    found = benchmark.benchmark("references", quiet=True, **part)
    check("benchmark", found)
    second, encoder = found["rows"]
    assert (second["kind"], second["sessions"], second["adequate"]) == ("second_file", 1, 1)
    assert second["parameters"]["offset_s"]["z_largest"] < 4
    assert second["parameters"]["scale"]["z_largest"] < 4
    assert sum(of for _, of in encoder["by_effect"].values()) == 1
    assert encoder["named"] == 1
    assert benchmark.benchmark("references", quiet=True, **part) == found
    assert len(results.read_text(encoding="utf-8").splitlines()) == 2


def test_strangers_are_few_of_a_repository_and_half_of_them_sealed_by_the_lot() -> None:
    listed = the_truth().recordings()
    assert max(Counter(one.repository["name"] for one in listed).values()) <= 4
    drawn = [one for one in listed if one.half]
    lot = random.Random(20261126).sample(range(len(drawn)), len(drawn) // 2)
    assert {k for k, one in enumerate(drawn) if one.half == "sealed"} == set(lot)


def test_the_truth_of_a_strangers_file_needs_no_gyrocal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "gyrocal" not in {line.split()[1].split(".")[0] for line in imports_of("strangers_truth")}
    module = the_truth()
    monkeypatch.setattr(module, "STRANGERS", tmp_path)
    rows = [f"{10 * k},{k % 7 - 3},0,0,0,0,1000" for k in range(100)]
    rows[50:50] = [rows[49], "a word,,,,,,"]
    (tmp_path / "log.csv").write_text("\n".join(["t,gx,gy,gz,ax,ay,az", *rows]))
    one = module.Recording("rest", {"name": "."}, "log.csv", (1e-3, 2.0), at=(0, 1, 2, 3), skip=1, acc=(4, 5, 6), g=1e-3)
    truth = module.truth_of(one)
    assert truth.t_s == pytest.approx(0.01 * np.arange(100))
    assert (truth.names, truth.moves, truth.step_s) == (("gx", "gy", "gz"), False, pytest.approx(0.01))
    assert np.abs(truth.rates_dps).max() == 6.0
    assert np.all(truth.acc_g[:, 2] == 1.0)


def the_truth() -> Any:
    benchmark._module("strangers")  # which makes the folder a package that is found
    return importlib.import_module("benchmarks.strangers_truth")


def imports_of(name: str) -> list[str]:
    text = (benchmark.ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line.startswith(("import ", "from "))]
