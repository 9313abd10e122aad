"""Runs known by their net angle alone (the sensor turned by hand, once about), among runs at rest."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.inference.heldout import fitted
from gyrocal.plausibility import check
from gyrocal.recording.session import Run, Session
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
RATE_HZ, WHITE_DPS, TURN_DEG = 104.0, 0.04, 360.0
SCALE, BIAS_DPS = -0.0088, 0.07


@pytest.fixture(scope="module")
def by_hand() -> Session:
    """Six power cycles: a turn, a turn back, some seconds at rest; the drift of each is 5 mdps."""
    rng = np.random.default_rng(8)
    t_s = np.arange(2080) / RATE_HZ
    runs = []
    for cycle in range(6):
        bias = BIAS_DPS + rng.normal(0, 0.01)
        for turn_deg in (TURN_DEG, -TURN_DEG, 0.0):
            profile = np.sin(np.pi * np.clip(t_s * rng.uniform(0.06, 0.09), 0, 1)) ** 2 * rng.uniform(0.9, 1.1, t_s.size)
            rate = turn_deg * profile / np.trapezoid(profile, t_s)
            wander = 0.005 * np.sin(2 * np.pi * (t_s / 20 + rng.random()))
            gyro = rng.normal(0, WHITE_DPS, (t_s.size, 3))
            gyro[:, 2] += (1 + SCALE) * rate + bias + wander
            runs.append(
                make_run(t_s, gyro, table_rate_dps=0.0, turn_deg=turn_deg or None, scenario=f"s{cycle}", rate_hz=RATE_HZ)
            )
    return make_session(*runs)


def test_the_scale_is_found_from_angles_alone(by_hand: Session) -> None:
    scale = next(t for t in fit(by_hand, Model.open("default")).model.terms if (t.effect_id, t.axis) == ("scale", "z"))
    assert abs(scale.values["scale"] - SCALE) < 4 * scale.se["scale"] < 4e-4


@pytest.mark.wide
def test_nothing_is_missing_and_what_cannot_be_measured_says_why(by_hand: Session) -> None:
    found = diagnose(by_hand)
    assert found.verdict == "adequate"
    assert all(np.isfinite(level.rms_dps or np.nan) for level in found.comparison.per_axis.values())
    told = {c.effect.id: c.next_measurement for c in found.candidates if c.axis == "z" and c.decision == "not_measurable"}
    assert "known rate" in told["table_ripple"]


def test_each_power_cycle_is_calibrated(by_hand: Session) -> None:
    estimates = calibrate(by_hand, [20.0], ["model"], model=Model.open("default"))
    assert len(estimates) == 6
    for e in estimates:
        assert abs(e.scale - SCALE) < 4 * e.scale_se


T_S = np.arange(1200) / 100


def by_eye(seed: int, *errors_deg: float, **known: float) -> Session:
    """Two rests, and a turn about z for each of ``errors_deg``, by which it misses 360 degrees."""
    rng = np.random.default_rng(seed)

    def run(turned_deg: float) -> Run:
        gyro = rng.normal(BIAS_DPS, 0.05, (T_S.size, 3))
        gyro[:, 2] += (1 + SCALE) * np.where((T_S >= 2) & (T_S < 10), turned_deg / 8, 0.0)
        run = make_run(T_S, gyro, table_rate_dps=0.0, turn_deg=TURN_DEG if turned_deg else None, scenario="s0")
        return replace(run, **known) if turned_deg else run

    return make_session(run(0.0), run(0.0), *(run(TURN_DEG + error_deg) for error_deg in errors_deg))


def found(session: Session) -> tuple[float, float, float, float]:
    """Scale and bias of z, each with its standard error."""
    terms = fit(session, Model.open("default"), axes="z").axes["z"].terms
    return tuple(of[name] for t, name in zip(terms, ("scale", "bias_dps"), strict=True) for of in (t.values, t.se))  # type: ignore[return-value]


@pytest.mark.wide
def test_the_scatter_of_turns_is_in_the_error_of_the_scale() -> None:
    pulls = []
    for seed in range(10):
        errors_deg = np.random.default_rng(100 + seed).normal(0, 10, 6)
        scale, scale_se, bias, bias_se = found(by_eye(seed, *errors_deg))
        assert scale == pytest.approx(SCALE + float(np.mean(errors_deg)) / TURN_DEG * (1 + SCALE), abs=3e-4)
        # the error of the mean of six, in which Student's t of five degrees of freedom replaces the normal distribution
        assert scale_se == pytest.approx(np.std(errors_deg, ddof=1) / np.sqrt(6) / TURN_DEG * 2.571 / 1.96, rel=0.1)
        pulls.append((scale - SCALE) / scale_se)
        assert abs(bias - BIAS_DPS) < 4 * bias_se < 0.03  # the rests know the bias, and no drift is made of the scatter
    assert max(map(abs, pulls)) < 3


def test_two_turns_that_differ_give_a_wide_error_and_two_that_agree_a_small_one() -> None:
    scale, scale_se, *_ = found(by_eye(0, 8.0, -12.0))
    assert abs(scale - SCALE) < scale_se
    assert scale_se > 0.03
    scale, scale_se, *_ = found(by_eye(0, 0.0, 0.0))
    assert abs(scale - SCALE) < 4 * scale_se < 4e-4


def test_the_stated_error_of_a_single_turn_is_that_of_its_scale() -> None:
    scale, scale_se, bias, bias_se = found(by_eye(0, 5.0, turn_se_deg=5.0))
    assert scale_se == pytest.approx(5 / TURN_DEG, rel=0.02)
    assert abs(scale - SCALE) < 2 * scale_se
    assert abs(bias - BIAS_DPS) < 4 * bias_se < 0.03


def test_a_single_turn_without_a_stated_error_says_that_it_counts_as_exact() -> None:
    (warning,) = check(by_eye(0, 5.0))
    assert (warning.code, warning.axis, warning.blocking) == ("turn_exact", "z", False)
    assert "0.28 %" in warning.text
    assert check(by_eye(0, 5.0, turn_se_deg=5.0)) == []
    assert check(by_eye(0, 5.0, -3.0)) == []


LEAKS_DEG = {"x": (-360.0, -3.0, 4.0), "y": (2.0, -360.0, 3.5), "z": (-2.5, 1.5, -360.0)}
"""The angle that each axis sees of a turn about x, y and z: axes that are not aligned, in a hand that tilts."""


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.wide) for seed in (1, 2, 3))])
def test_what_turns_leak_into_other_axes_does_not_pull_the_bias_that_rests_tell(seed: int) -> None:
    """Six rests and a turn about each axis, as of a calibration by hand. The bias was nearly the mean of all nine runs."""
    rng = np.random.default_rng(200 + seed)
    bias_dps, t_s = rng.uniform(-0.6, 0.6, 3), np.arange(500) / 100
    moving = np.where((t_s >= 1) & (t_s < 4), 1 / 3, 0.0)
    runs = []
    for axis, seen_deg in LEAKS_DEG.items():
        for turned_deg in (None, None, seen_deg):
            gyro = rng.normal(bias_dps, 0.05, (t_s.size, 3))
            if turned_deg is not None:
                gyro += moving[:, None] * np.array(turned_deg)
            run = make_run(t_s, gyro, table_rate_dps=0.0, turn_deg=None if turned_deg is None else -360.0, scenario="s0")
            runs.append(replace(run, axis=axis))
    found = measure(make_session(*runs))
    told = {t.axis: t for t in found.fit.model.terms if t.effect_id == "bias"}
    left_dps = [float(p.residual_dps.mean()) for p in fitted(found.fit)]
    assert len(left_dps) == 18
    assert np.abs(left_dps).max() < 0.02  # what is drawn of the rests is what the table's bias leaves
    for axis, truth_dps in zip("xyz", bias_dps, strict=True):
        assert abs(told[axis].values["bias_dps"] - truth_dps) < 4 * told[axis].se["bias_dps"] < 0.02


@pytest.mark.parametrize("cycles", [1, 3])
def test_turns_of_known_angle_need_no_rest_beside_them(cycles: int) -> None:
    """A session of such turns alone ended in a division by zero, because no block has a neighbour."""
    rng = np.random.default_rng(cycles)
    turning = (T_S >= 2) & (T_S < 10)
    runs = []
    for i in range(4 * cycles):
        turn_deg = TURN_DEG * (-1) ** i
        gyro = rng.normal(BIAS_DPS, 0.05, (T_S.size, 3))
        gyro[:, 2] += (1 + SCALE) * np.where(turning, turn_deg / (np.count_nonzero(turning) / 100), 0.0)
        runs.append(make_run(T_S, gyro, turn_deg=turn_deg, scenario=f"s{i // 4}"))
    session = make_session(*runs)
    assert compare(session).verdict == "adequate"
    assert diagnose(session).verdict == "adequate"
    scale, scale_se, bias, bias_se = found(session)
    assert abs(scale - SCALE) < 3 * scale_se < 3e-3
    assert abs(bias - BIAS_DPS) < 3 * bias_se < 0.1
