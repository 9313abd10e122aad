"""Sessions with runs of which only the net angle is known are judged by angle."""

import warnings
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal import api
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.residual_table import residual_table
from gyrocal.present.report import verdict_text
from gyrocal.recording.session import AXES, Run, Session
from known import ON_Z, add_measured
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

T_S = np.arange(1200) / 100
WHITE_DPS = 0.05


def test_what_turns_leave_within_power_cycles_is_a_number_however_little_their_noise_is() -> None:
    """A free scale of each power cycle left no information on the common one after rounding: "inf deg" was told."""
    rng, runs = np.random.default_rng(3), []
    for cycle in range(2):
        for degrees in (360.0, -360.0, 720.0, -720.0, 0.0):
            rate = np.full(T_S.size, degrees / 12)
            gyro = rng.normal([0.1 * cycle, 0.2, 0.3], 0.01, (T_S.size, 3)) + np.outer(1.005 * rate, [0, 0, 1])
            known = {"turn_deg": degrees} if degrees else {"table_rate_dps": 0.0}
            runs.append(make_run(T_S, gyro, scenario=f"s{cycle}", **known))
    found = measure(make_session(*runs))
    assert found.verdict == "adequate"
    assert found.angles is not None
    assert all(0.05 < one.ratio < 5 for one in found.angles.within.values())


def session(seed: int, leak: float = 0.0, ways: tuple[float, ...] = (1.0, -1.0)) -> Session:
    """Three rests, and a turn both ``ways`` about each axis; z reads ``leak`` of the rate about x."""
    rng = np.random.default_rng(seed)

    def run(sign: float, axis: str, cycle: int) -> Run:
        rate = np.where((T_S > 2) & (T_S < 10), 45.0 * sign, 0.0)
        gyro = rng.normal([1.0, 2.0, 3.0], WHITE_DPS, (T_S.size, 3))
        gyro[:, AXES.index(axis)] += 1.01 * rate
        gyro[:, 2] += leak * rate * (axis == "x")
        angle_deg = float(np.sum(rate)) / 100
        known = {"turn_deg": angle_deg} if sign else {"table_rate_dps": 0.0}
        return make_run(T_S, gyro, axis=axis, scenario=f"s{cycle}", **known)

    turns = [(sign, axis) for axis in AXES for sign in ways]
    return make_session(*(run(0.0, "z", k) for k in range(3)), *(run(*turn, k % 3) for k, turn in enumerate(turns)))


@pytest.mark.parametrize("seeds", [2, pytest.param(4, marks=pytest.mark.wide)])
def test_noise_alone_leaves_the_floor_in_the_net_angles(seeds: int) -> None:
    found = [compare(session(seed)) for seed in range(seeds)]
    for c in found:
        told = c.to_json()
        assert told["residual"] == "angle"
        assert told["verdict"] == "adequate"
        assert set(told) >= {"rms_deg", "floor_deg", "excess_deg", "excess_se_deg"}
        assert "rms_dps" not in told
        assert set(told["per_axis"]["z"]) == {"rms_deg", "floor_deg", "excess_deg", "excess_se_deg"}
    rms, floor = (np.array([c.to_json()[f"{name}_deg"] for c in found]) for name in ("rms", "floor"))
    assert np.mean(rms**2) == pytest.approx(np.mean(floor**2), rel=0.35)
    # white noise of n samples leaves sd·sqrt(n)·period in the angle, and the held-out prediction adds its own error
    assert np.all(floor > WHITE_DPS * np.sqrt(T_S.size) / 100)
    assert np.all(floor < 2.5 * WHITE_DPS * np.sqrt(T_S.size) / 100)


@pytest.mark.wide
def test_a_leak_that_only_turns_show_is_judged_by_the_angle_it_leaves() -> None:
    leaking = session(1, leak=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        before, after, _ = add_measured(leaking, ON_Z, "misalignment")
        explained = explain(leaking, ON_Z)
    assert explained.first.to_json()["residual"] == "angle"
    found = explained.to_json()
    old, new = before.to_json(), after.to_json()
    left_deg = 3.6 * np.sqrt(2 / 9)  # 360 deg of 0.01, in two of nine runs
    assert old["excess_deg"] == pytest.approx(left_deg, rel=0.5)  # held out, the power cycles' own offsets move too
    assert old["floor_deg"] == new["floor_deg"]
    assert new["excess_deg"] < 3 * new["excess_se_deg"]
    (step,) = found["steps"]
    assert found["residual"] == "angle"
    assert step["effects"] == ["misalignment"]
    assert step["matters"]
    assert step["excess_before_deg"] == pytest.approx(old["excess_deg"], rel=0.05)
    assert step["excess_after_deg"] == pytest.approx(new["excess_deg"], abs=0.01)


def test_residuals_have_a_row_for_each_run_and_axis() -> None:
    recorded = session(2)
    table = residual_table(measure(recorded))
    assert table.columns == ["file", "t_s", "axis", "measured_deg", "modelled_deg"]
    assert table.height == 27
    for run in recorded.runs:
        row = table.filter((pl.col("file") == run.file) & (pl.col("axis") == "y")).row(0, named=True)
        assert row["measured_deg"] == pytest.approx(run.gyro_dps[:, 1].sum() / 100, rel=1e-9)
        assert abs(row["measured_deg"] - row["modelled_deg"]) < 0.2


def test_what_one_turn_suggests_is_told_with_what_would_prove_it() -> None:
    found = diagnose(session(3, leak=0.01, ways=(1.0,)))
    assert found.verdict == "unknown"
    assert [c.effect.id for c in found.candidates if c.decision == "suggest" and c.axis == "z"] == ["misalignment"]
    assert "It may be misalignment, but this session cannot prove it" in verdict_text(found)
    assert "record the same runs again" in verdict_text(found)


def test_the_summary_in_python_gives_the_angles_too() -> None:
    found = api.compare(session(0))
    assert f"rms {found.to_json()['rms_deg']:.4f} deg" in found.summary()


def by_hand(seed: int, *, error_deg: float = 0.3, per_c: float = 0.0, last_dps: float = 0.0) -> Session:
    """Fifteen turns in three power cycles, whose stated angles are ``error_deg`` off; the bias of y follows the temperature.

    ``last_dps`` is an offset of y in the last turn alone, which no effect describes.
    """
    rng = np.random.default_rng([7, seed])
    runs = []
    for k in range(15):
        seconds = rng.uniform(6, 12)
        t_s = np.arange(round(100 * seconds)) / 100
        axis, turn_deg = AXES[k % 3], float(rng.choice([180, 360, -360, 720]))
        part = np.clip((t_s / seconds - 0.2) / 0.6, 0, 1)
        rate = 1 - np.cos(2 * np.pi * part)
        rate *= (turn_deg + rng.normal(0, error_deg)) / rate.sum() * 100
        gyro = rng.normal(np.array([1.0, -2.0, 0.5]), 0.05, (t_s.size, 3))
        gyro[:, AXES.index(axis)] += 1.01 * rate
        temp_c = 22.0 + 0.7 * ((7 * k) % 15)
        gyro[:, 1] += per_c * (temp_c - 25) + last_dps * (k == 14)
        seen_c = temp_c + rng.normal(0, 0.01, t_s.size)
        run = make_run(t_s, gyro, axis=axis, scenario=f"s{k // 5}", turn_deg=turn_deg, temp_c=seen_c)
        runs.append(replace(run, turn_se_deg=error_deg))
    return make_session(*runs)


@pytest.mark.wide
@pytest.mark.parametrize("seeds", [6, pytest.param(12, marks=pytest.mark.wide)])
def test_the_stated_error_of_turns_is_in_the_floor_of_their_angles(seeds: int) -> None:
    """The floor was that of the white noise alone, and the excess of turns by hand up to 160 of its errors."""
    found = [measure(by_hand(seed)) for seed in range(seeds)]
    assert [c.verdict for c in found] == ["adequate"] * len(found)
    levels = [c.angles.level(axis) for c in found if c.angles is not None for axis in AXES]
    rms, floor = (np.array([getattr(level, name) for level in levels]) for name in ("rms_deg", "floor_deg"))
    assert np.sum(rms**2) == pytest.approx(np.sum(floor**2), rel=0.35)
    assert floor.mean() > 0.3 / np.sqrt(3)  # a third of the turns is about the axis


def test_an_excess_of_the_angles_beyond_its_errors_is_a_misfit() -> None:
    """The model was adequate beside an excess of 130 errors, because no test of rates sees net angles."""
    found = measure(by_hand(1, last_dps=0.3))
    assert found.verdict == "misfit"
    assert [f.axis for f in found.where] == ["y"]
    assert "than noise leaves" in found.where[0].note
    assert found.angles
    assert found.angles.within["y"].chance < 1e-9


@pytest.mark.wide
@pytest.mark.parametrize("seeds", [(7, 10, 22, 25, 26), pytest.param((4, 6, 15, 24, 27), marks=pytest.mark.wide)])
def test_an_excess_of_few_turns_has_the_error_of_few_squares(seeds: tuple[int, ...]) -> None:
    """A sum of five squares exceeds three of its standard deviations once in fifty times: such turns were a misfit.

    Of thirty sessions these are the ten with the largest excess in its errors, the larger half of them first.
    """
    for seed in seeds:
        found = measure(by_hand(100 + seed))
        assert found.verdict == "adequate"
        assert found.angles is not None
        levels = [found.angles.level(axis) for axis in AXES]
        assert all(x.excess_deg < 3 * x.excess_se_deg for x in levels)
        assert min(found.angles.within[axis].chance for axis in AXES) > 1e-3


def test_turns_name_what_their_errors_do_not_explain_and_nothing_else() -> None:
    """The error of a turn shrank with the noise that a term explained, so that scatter of turns was named g-sensitivity."""
    warm = diagnose(by_hand(2, per_c=0.013))
    assert [(c.effect.id, c.axis) for c in warm.candidates if c.decision == "add"] == [("bias_temperature", "y")]
    named = warm.candidates[0]
    assert abs(named.values["k1_dps_per_c"] - 0.013) < 4 * named.se["k1_dps_per_c"]
    for seed in range(3):
        assert not [c for c in diagnose(by_hand(20 + seed)).candidates if c.decision == "add"]


@pytest.mark.parametrize("name", ["scale_asymmetry", "scale_temperature"])
def test_an_error_in_proportion_to_the_rate_is_named_by_turns(name: str) -> None:
    """Its share of a turn is the same whatever its course; an asymmetry of eleven errors had been not measurable."""
    rng, runs, k = np.random.default_rng(3), [], {"scale_asymmetry": -0.004, "scale_temperature": 6e-4}[name]
    for i in range(12):
        t_s, temp_c, turns = np.arange(450) / 50, 22.0 + 0.7 * ((7 * i) % 12), (-1) ** i * (1 + i // 2 % 2)
        rate = np.where((t_s > 2) & (t_s < 7), (1 - np.cos(2 * np.pi * (t_s - 2) / 5)) * 72.0 * turns, 0.0)
        seen_c = temp_c + rng.normal(0, 0.01, t_s.size)
        gyro = rng.normal([0.3, -0.2, 0.5], 0.05, (t_s.size, 3))
        gyro[:, 2] += (1.01 + (k * (-1) ** i if name == "scale_asymmetry" else k * (temp_c - 25))) * rate
        known = {"turn_deg": 360.0 * turns + rng.normal(0, 0.2), "temp_c": seen_c}
        runs.append(replace(make_run(t_s, gyro, axis="z", scenario=f"s{i // 4}", **known), turn_se_deg=0.2))
    (found,) = (c for c in diagnose(make_session(*runs), ON_Z).candidates if c.named)
    assert found.effect.id == name
    (value,), (se,) = found.values.values(), found.se.values()
    assert value == pytest.approx(k, abs=3 * se)
    assert se < abs(k) / 5


def test_a_vibration_that_rests_show_is_named_beside_turns_by_their_angle() -> None:
    """It has no part in the net angles of the turns, which were counted as runs in which it is small."""
    quiet, shaken = session(3), []
    for k, run in enumerate(quiet.runs):
        gyro = run.gyro_dps.copy()
        gyro[:, 2] += 0.3 * np.cos(2 * np.pi * 13.7 * T_S + k)
        known = {"turn_deg": run.turn_deg} if run.turn_deg is not None else {"table_rate_dps": 0.0}
        shaken.append(make_run(T_S, gyro, axis=run.axis, scenario=run.scenario, **known))
    found = diagnose(make_session(*shaken), ON_Z)
    assert [(c.effect.id, c.axis) for c in found.candidates if c.named] == [("vibration_tone", "z")]
    assert found.candidates[0].values["A_dps"] == pytest.approx(0.3, rel=0.05)


@pytest.mark.filterwarnings("error")
def test_what_rests_show_in_each_leaves_turns_without_a_say_on_a_walk() -> None:
    """Beside a shape that turns cannot show, each has a level of its own: no bias, whose median error was 1e150 dps."""
    rng, runs = np.random.default_rng(0), []
    for cycle in range(3):
        for degrees in (720.0, -720.0, 720.0, -720.0, 0.0):
            rate = (degrees + rng.normal(0, 0.2)) / 12 * np.ones(T_S.size) * (degrees != 0)
            gyro = rng.normal(0.3, WHITE_DPS, (T_S.size, 3)) + np.outer(1.002 * rate, [0, 0, 1])
            gyro[:, 2] += 0.06 * np.cos(np.pi * T_S / 4) * (degrees == 0)
            known = {"turn_deg": degrees} if degrees else {"table_rate_dps": 0.0}
            runs.append(make_run(T_S, gyro, scenario=f"s{cycle}", **known))
    found = compare(make_session(*runs))
    assert [(one.axis, one.note.rpartition(", ")[2]) for one in found.where] == [("z", "in the same course in each run")]
