"""The benchmark's own arithmetic: scores counted by hand, the F-test against statsmodels, errors in closed form."""

from __future__ import annotations

import json

import numpy as np
import pytest

from answers import check
from gyrocal import benchmark as verb
from gyrocal.cli import main
from gyrocal.inference.heldout import Prediction
from gyrocal.recording.session import Session

from . import benchmark, judge, stepwise
from .benchmark import chosen, score
from .generator.case import Case, Effect
from .generator.session import make
from .judge import error_dps
from .outcome import Answer, Outcome

RIPPLE = Effect("table_ripple", {"amplitude_1": 2e-3, "phase_1_deg": 0.0}, "z")
DRIFT = Effect("drift", {"k_dps_per_s": 1e-3}, "x")


def _outcome(kind: str, answer: Answer, *effects: Effect, rivals=(), seen=20.0, oracle=None) -> Outcome:
    expected = () if kind in ("null", "unknown") else tuple(e.id for e in effects)
    case = Case("case", kind, "paper", 1, 6.0, effects=effects, expected=expected, rivals=rivals)
    return Outcome(case, seen, {"gyrocal": answer, "oracle": oracle or Answer("-")})


def _add(*names: tuple[str, str], group: tuple[str, ...] = (), error: float | None = None) -> Answer:
    group = group or (names[0][0],)
    return Answer("ambiguous" if len(group) > 1 else "add", names, group, ("add",), error)


def test_null_rates_count_everything_but_adequate():
    outcomes = [_outcome("null", Answer(v)) for v in ("adequate", "adequate", "unknown")]
    outcomes.append(_outcome("null", _add(("drift", "x"))))
    assert score(outcomes)["false_alarm_rate"] == 0.5
    assert score(outcomes)["top1_rate"] is None


def test_a_name_is_right_on_the_right_axis_alone():
    right, elsewhere = _outcome("effect", _add(("drift", "x")), DRIFT), _outcome("effect", _add(("drift", "y")), DRIFT)
    assert score([right, elsewhere])["top1_rate"] == 0.5
    assert score([right, elsewhere])["set_contains_rate"] == 0.5
    assert score([right, elsewhere])["misnamed_rate"] == 0.5


def test_truth_second_in_the_group_is_contained_but_not_first_and_not_misnamed():
    outcome = _outcome("effect", _add(("warmup", "x"), group=("warmup", "drift")), DRIFT)
    figures = score([outcome])
    assert (figures["top1_rate"], figures["set_contains_rate"], figures["misnamed_rate"]) == (0, 1, 0)
    assert figures["mean_set_size"] == 2


def test_a_pair_is_right_with_either_first_and_complete_with_both():
    half = _outcome("pair", _add(("drift", "x")), RIPPLE, DRIFT)
    whole = _outcome("pair", _add(("drift", "x"), ("table_ripple", "z")), RIPPLE, DRIFT)
    more = _outcome("pair", _add(("drift", "x"), ("table_ripple", "z"), ("lag", "z")), RIPPLE, DRIFT)
    figures = score([half, whole, more])
    assert figures["top1_rate"] == 1
    assert figures["completed_rate"] == pytest.approx(1 / 3)


def test_what_is_too_faint_does_not_count():
    faint = _outcome("effect", Answer("adequate"), DRIFT, seen=7.9)
    assert score([faint, _outcome("effect", _add(("drift", "x")), DRIFT, seen=8.1)])["top1_rate"] == 1
    assert benchmark.report([faint])["too_faint"] == ["case"]


@pytest.mark.parametrize(
    ("answer", "declared"),
    [
        (Answer("adequate", decisions=("not_measurable",)), True),
        (Answer("adequate", decisions=("reject",)), False),
        (Answer("adequate"), False),
        (_add(("warmup", "x"), group=("warmup", "drift")), True),
        (_add(("warmup", "x"), group=("warmup", "lag")), False),
        (Answer("add", (("warmup", "x"),), ("warmup",), ("not_measurable",)), False),
    ],
)
def test_confounded_is_declared_or_grouped_and_never_another_alone(answer, declared):
    outcome = _outcome("confounded", answer, DRIFT, rivals=("warmup",), seen=0.0)
    assert score([outcome])["confounded_declared_rate"] == declared


def test_unknown_is_right_when_called_so_and_misnamed_when_named():
    outcomes = [_outcome("unknown", a, Effect("stuck_bit", {"bit": 3}, "x")) for a in (Answer("unknown"), _add(("drift", "x")))]
    assert score(outcomes)["unknown_flagged_rate"] == 0.5
    assert score(outcomes)["misnamed_rate"] == 0.5


def test_error_ratio_is_the_median_over_the_oracles():
    outcomes = [
        _outcome("effect", _add(("drift", "x"), error=e), DRIFT, oracle=Answer("add", error_dps=1e-3))
        for e in (1e-3, 2e-3, 9e-3)
    ]
    assert score(outcomes)["error_reduction_ratio"] == pytest.approx(2.0)


def test_f_test_agrees_with_statsmodels():
    sm = pytest.importorskip("statsmodels.api")
    rng = np.random.default_rng(1)
    x = rng.standard_normal((200, 5))
    y = x @ [1.0, 0.3, 0.0, 0.2, 0.0] + rng.standard_normal(200)
    small, large = (sm.OLS(y, x[:, :k]).fit() for k in (2, 5))
    mine = stepwise.f_test((small.ssr, 2, 200), (large.ssr, 5, 200))
    assert mine == pytest.approx(large.compare_f_test(small)[1], rel=1e-9)


def test_least_squares_with_coefficients_of_each_run_is_the_block_diagonal_one():
    rng = np.random.default_rng(2)
    shared, own = [rng.standard_normal((40, 2)) for _ in range(3)], [rng.standard_normal((40, 3)) for _ in range(3)]
    target = [rng.standard_normal(40) for _ in range(3)]
    whole = np.zeros((120, 11))
    for i in range(3):
        rows = slice(40 * i, 40 * i + 40)
        whole[rows, :2], whole[rows, 2 + 3 * i : 5 + 3 * i] = shared[i], own[i]
    expected = np.linalg.lstsq(whole, np.concatenate(target), rcond=None)[1][0]
    left, parameters, n = stepwise._least_squares(target, shared, own)
    assert (parameters, n) == (11, 120)
    assert left == pytest.approx(expected, rel=1e-9)


def test_stepwise_finds_a_large_effect(tmp_path):
    case = Case("large", "effect", "paper", 3, 6.0, effects=(RIPPLE,), scenarios=3)
    make(case, tmp_path)
    # at one rate, a tone of order 1 is the same wave
    assert stepwise.select(Session.open(tmp_path))[0] in (("table_ripple", "z"), ("order_tone", "z"))


def test_error_leaves_out_bias_and_scale_of_a_day_and_keeps_the_rest(tmp_path, monkeypatch):
    case = Case("plain", "effect", "paper", 4, 6.0, effects=(RIPPLE,), scenarios=3)
    truth = make(case, tmp_path)
    predictions, wave = [], 0.02
    for run, truth_of_run in zip(Session.open(tmp_path).runs, truth.runs, strict=True):
        for i, axis in enumerate("xyz"):
            rate = truth_of_run.rate_dps * (axis == "z")
            clean = (1 + truth.scale[i]) * rate + truth.bias_dps[i] + truth_of_run.injected_dps["table_ripple"][i]
            off = 0.1 * run.day + 1e-3 * run.day * rate + wave * np.sin(2 * np.pi * run.t_s / 1.5)
            predictions += [
                Prediction(run, i, rows, (clean + off)[rows])
                for rows in (slice(0, 300), slice(300, len(run)))  # a run may come in parts
            ]
    monkeypatch.setattr(judge.heldout, "folds", lambda _: [])
    monkeypatch.setattr(judge.heldout, "predictions", lambda *_: iter(predictions))
    assert error_dps(None, truth) == pytest.approx(wave / np.sqrt(2), rel=2e-3)


def test_the_verb_prints_one_object_with_the_pinned_keys(tmp_path, monkeypatch, capsys):
    outcomes = [_outcome("null", Answer("adequate")), _outcome("null", Answer("unknown"))]
    for outcome in outcomes:
        outcome.answers["stepwise"] = Answer("adequate")
    monkeypatch.setattr("blind.benchmark.run", lambda *_: outcomes)
    assert main(["benchmark", "blind", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    check("benchmark", found)
    pinned = {
        "false_alarm_rate", "top1_rate", "set_contains_rate", "mean_set_size", "confounded_declared_rate",
        "unknown_flagged_rate", "misnamed_rate", "error_reduction_ratio",
    }  # fmt: skip
    assert pinned <= set(found)
    assert found["false_alarm_rate"] == 0.5
    assert main(["benchmark", "blind"]) == 0
    assert "wrong: case: planted nothing; verdict unknown" in capsys.readouterr().out


def test_an_unknown_benchmark_is_bad_usage(capsys):
    assert main(["benchmark", "weather"]) == 2
    assert "no benchmark 'weather'" in capsys.readouterr().err


def test_without_a_checkout_it_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(verb.BENCHMARKS, "blind", tmp_path / "blind")
    assert main(["benchmark", "blind"]) == 1
    assert "runs from a checkout" in capsys.readouterr().err


def test_cases_can_be_skipped() -> None:
    part = chosen(False, "work", ["null", "set"], 2, 12)
    assert sorted(case.name for case in part) == ["work_null_012", "work_null_013", "work_set_012", "work_set_013"]
