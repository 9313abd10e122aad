"""Answers of runs that a warning contradicts, and scenarios that have no answer: neither passes without a word."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.calibrate import Estimate, calibrate, unanswered
from gyrocal.calibration.trust import warning_flags
from gyrocal.cli import main
from gyrocal.plausibility import check
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate
from gyrocal.warning import Warning

METHODS = ["baseline", "cnn", "model"]


@cache
def sound() -> Session:
    return simulate(None, "paper", [], 3, scenarios=4, seconds=7.0)[0]


def changed(change: Callable[[Run], Run], *numbers: int) -> Session:
    """The session with some of its runs changed, of which two by two are a scenario."""
    return sound().with_runs(change(r) if r.index in numbers else r for r in sound().runs)


def at_another_rate(run: Run) -> Run:
    assert run.table_rate_dps is not None
    return replace(run, table_rate_dps=1.05 * run.table_rate_dps)


def test_a_scenario_with_a_wrong_rate_is_not_trusted() -> None:
    """One run of a pair at 5 % more than stated: scale and bias look sound, and are 2.5 % and 2 dps off."""
    wrong = changed(at_another_rate, 2)
    assert [(w.code, w.file) for w in check(wrong)] == [("rate_wrong", wrong.runs[2].file)]
    for e in calibrate(wrong, [6.0], METHODS):
        assert e.trusted == (e.scenario != wrong.runs[2].scenario)
        assert e.scenario != wrong.runs[2].scenario or "implausible" in e.flags


def test_an_accepted_warning_flags_nothing() -> None:
    accepted = replace(changed(at_another_rate, 2), accept=("rate_wrong",))
    (found,) = [e for e in calibrate(accepted, [6.0], ["baseline"]) if e.scenario == accepted.runs[2].scenario]
    assert found.flags == ()


@pytest.mark.parametrize(
    ("code", "flag"),
    [("rate_wrong", "implausible"), ("not_at_rest", "implausible"), ("turn_on_implausible", "implausible"),
     ("scale_implausible", "implausible"), ("face_wrong", "direction"), ("sign_flipped", "direction"),
     ("constant_reading", "constant_reading")],
)  # fmt: skip
def test_a_blocking_warning_flags_the_estimates_of_its_axis_and_file(code: str, flag: str) -> None:
    runs = sound().runs[:2]
    for axis in ("z", None):
        for file in (runs[1].file, None):
            assert warning_flags([Warning(code, axis, file, "", True)], "z", runs) == {flag}
    assert warning_flags([Warning(code, "x", None, "", True)], "z", runs) == set()
    assert warning_flags([Warning(code, "z", sound().runs[2].file, "", True)], "z", runs) == set()
    assert warning_flags([Warning(code, "z", None, "", False)], "z", runs) == set()


def by_scenario(found: list[Estimate], method: str) -> dict[str, Estimate]:
    return {e.scenario: e for e in found if e.method == method}


def test_one_odd_pair_leaves_the_network_to_the_others() -> None:
    def slower(run: Run) -> Run:
        rate_dps = 60.0 * run.face_sign
        y = run.gyro_dps[:, 2] - run.rate_dps + rate_dps
        return replace(run, table_rate_dps=60.0, frame=run.table.with_columns(gz_dps=pl.Series(y)))

    odd = changed(slower, 0, 1)
    found = by_scenario(calibrate(odd, [6.0]), "cnn")
    assert found.keys() == set(odd.scenarios)
    first = found.pop(odd.scenarios[0])
    assert (first.scale, first.bias_dps, first.flags, first.trusted) == (None, None, ("net_range",), False)
    assert all(e.scale is not None for e in found.values())


def test_a_scenario_without_a_pair_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run face down that is said to be up: its scenario has no pair any more, and the others have."""
    wrong = changed(lambda r: replace(r, face="up"), 3)
    wrong.save(tmp_path / "s")
    assert main(["calibrate", str(tmp_path / "s"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    dropped = wrong.runs[3].scenario
    assert {e["scenario"] for e in told["estimates"]} == set(wrong.scenarios) - {dropped}
    (named,) = [w for w in told["warnings"] if w["code"] == "no_answer"]
    assert dropped in named["text"]
    assert wrong.runs[3].file in named["text"]
    assert not named["blocking"]


def test_a_scenario_that_is_too_short_is_named() -> None:
    short = changed(lambda r: r.part(0, 100), 6, 7)
    (told,) = unanswered(short, calibrate(short, [6.0], ["baseline"]))
    assert short.runs[6].scenario in told.text
    assert "0.69 s" in told.text
    assert unanswered(sound(), calibrate(sound(), [6.0], ["baseline"])) == []


def test_times_in_milliseconds_are_the_reason_that_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slow = sound().with_runs(
        replace(r, frame=r.table.with_columns(t_s=pl.Series(r.t_s * 1e3))) for r in sound().runs
    )  # fmt: skip
    slow.save(tmp_path / "s")
    assert main(["calibrate", str(tmp_path / "s")]) == 2
    said = capsys.readouterr().err
    assert "Is t_s in ms?" in said
    assert said.count("\n") == 1


def test_an_answer_without_a_standard_error_is_not_trusted() -> None:
    """Seconds that hold no block: neither error nor misfit is known."""
    for e in calibrate(sound(), [0.1], ["baseline"]):
        assert (e.scale_se, e.misfit, e.trusted) == (None, None, False)


@pytest.mark.parametrize("seed", range(6))
def test_exchanged_axes_are_no_direction(seed: int) -> None:
    """The axis across the table's reads noise and a little of the rate, of either sign."""
    rng = np.random.default_rng(seed)
    misalignment = rng.uniform(-0.02, 0.02)

    def across(run: Run) -> Run:
        y = misalignment * run.rate_dps + 0.3 + rng.normal(0, 0.045, len(run))
        return replace(run, frame=run.table.with_columns(gz_dps=pl.Series(y)))

    for e in calibrate(changed(across, *range(8)), [6.0], ["baseline", "model"]):
        assert "direction" not in e.flags
        assert "implausible" in e.flags


@pytest.mark.parametrize(
    ("seconds", "lacks"), [([2.0, 6.0], []), ([2.0, 1000.0], ["1000 s"]), ([1000.0, 2.0, 50.0], ["1000 s", "50 s"])]
)
def test_seconds_that_no_run_lasts_are_told(seconds: list[float], lacks: list[str]) -> None:
    found = calibrate(sound(), seconds, ["baseline"])
    told = unanswered(sound(), found, seconds)
    assert [w.text.split("the first ")[1].split(":")[0] for w in told] == lacks
    assert all("the longest run lasts 7 s" in w.text and w.code == "no_answer" and not w.blocking for w in told)


def test_seconds_that_one_scenario_does_not_last_are_told_of_it() -> None:
    shorter = changed(lambda r: r.part(0, len(r) // 2), 2, 3)
    told = unanswered(shorter, calibrate(shorter, [2.0, 6.0], ["baseline"]), [2.0, 6.0])
    assert [w.text.split(":")[0] for w in told] == [f"no estimate from the first 6 s for scenario {shorter.runs[2].scenario}"]
