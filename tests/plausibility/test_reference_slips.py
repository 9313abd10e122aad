"""Slips in a recording with a measured orientation, and in one that is said to be at rest: the cause is told, and it alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter
from scipy.spatial.transform import Rotation

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.errors import InputError
from gyrocal.plausibility import check
from gyrocal.recording.header import Reference
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

Array = NDArray[np.float64]
RATE_HZ = 50.0
T_S = np.arange(1000) / RATE_HZ
MIXED = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
"""The tracker's axes against the sensor's."""


def motion(sizes: tuple[float, float, float]) -> Array:
    """Body rates [n, 3], deg/s: sums of sines below 1.2 Hz of the given sizes."""
    rng = np.random.default_rng(4)
    f, p, a = rng.uniform(0.1, 1.2, (6, 3)), rng.uniform(0, 7, (6, 3)), rng.normal(0, 20, (6, 3))
    return np.asarray(np.sum(a * np.sin(2 * np.pi * f * T_S[:, None, None] + p), axis=1) * sizes)


def tracked(gyro_dps: Array, true_dps: Array, t_s: Array = T_S) -> Session:
    """Readings [n, 3] with the orientation whose rates are ``true_dps`` [n, 3] at :data:`T_S`, in the tracker's axes."""
    body = true_dps @ MIXED
    steps = Rotation.from_rotvec(np.deg2rad((body[1:] + body[:-1]) / 2) / RATE_HZ)
    at = [Rotation.identity()]
    for step in steps:
        at.append(at[-1] * step)
    q = Rotation.concatenate(at).as_quat()
    columns = dict(zip(("ref_qx", "ref_qy", "ref_qz", "ref_qw"), q.T, strict=True))
    noisy = gyro_dps + np.random.default_rng(2).normal(0, 0.05, gyro_dps.shape)
    run = replace(make_run(t_s, noisy, table_rate_dps=None, **columns), reference=Reference())
    return make_session(run, reference=Reference())


def told(session: Session) -> set[tuple[str, str | None]]:
    return {(w.code, w.axis) for w in check(session) if w.code not in ("hardly_turned", "noise_unknown")}


@pytest.mark.parametrize("sizes", [(1.0, 1.0, 1.0), (1.0, 0.5, 0.4)])
@pytest.mark.parametrize(("factor", "says"), [(np.pi / 180, "the readings are in rad/s"), (180 / np.pi, "in dps already")])
def test_readings_in_another_unit_are_told_as_that_on_each_axis(
    sizes: tuple[float, float, float], factor: float, says: str
) -> None:
    true_dps = motion(sizes)
    session = tracked(true_dps, true_dps)
    assert told(session) == set()
    wrong = session.with_runs(
        replace(r, frame=r.table.with_columns(**{f"g{a}_dps": r.table[f"g{a}_dps"] * factor for a in "xyz"}))
        for r in session.runs
    )
    assert told(wrong) == {("unit_rad_s", axis) for axis in "xyz"}
    assert all(says in w.text for w in check(wrong) if w.code == "unit_rad_s")


@pytest.mark.parametrize(("factor", "says"), [(1000.0, "Is t_s in ms?"), (1e-3, "Was t_s taken for ms or us?")])
def test_times_in_another_unit_are_told_beside_an_orientation(factor: float, says: str) -> None:
    true_dps = motion((1.0, 1.0, 1.0))
    found = check(tracked(true_dps, true_dps, T_S * factor))
    assert next(w.text for w in found if w.code == "sample_rate").startswith(says)
    assert all("t_s" in w.text for w in found if w.code == "scale_implausible")


@pytest.mark.parametrize("change", [np.diag([-1.0, 1.0, 1.0]), np.eye(3)[[1, 0, 2]]])
def test_a_mirrored_reference_is_told_and_no_slope_against_it(change: Array) -> None:
    true_dps = motion((1.0, 1.0, 1.0))
    assert told(tracked(true_dps @ change.T, true_dps)) == {("sign_flipped", None)}


def test_a_recording_that_is_too_short_for_its_reference_is_not_called_apart_from_it() -> None:
    true_dps = motion((1.0, 1.0, 1.0))
    session = tracked(true_dps, true_dps)
    with pytest.raises(InputError, match="record longer"):
        check(session.with_runs(replace(r, frame=r.table[:20]) for r in session.runs))


def test_a_rest_in_which_the_sensor_turns_is_told_without_an_accelerometer_and_its_motion_is_no_noise() -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(3000) / 100.0
    swing = 30.0 * np.sin(2 * np.pi * t_s / 7.3)[:, None] * (0.2, 1.0, 0.0)
    run = make_run(t_s, swing + rng.normal(0, 0.1, (t_s.size, 3)), table_rate_dps=0.0)
    assert told(make_session(run)) == {("not_at_rest", "x"), ("not_at_rest", "y")}


@pytest.mark.parametrize("seed", range(6))
def test_the_motion_of_a_hand_is_no_noise(seed: int) -> None:
    """A phone at 50 Hz in a hand that is still now and then: neighbouring readings differ by more than a sensor's noise."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(3000) / 50.0
    motion = lfilter(*butter(2, 2.5, fs=50.0), rng.normal(0, 150.0, (t_s.size, 3)), axis=0)
    motion *= np.where(np.sin(2 * np.pi * t_s / 17.0) > 0, 1.0, 0.2)[:, None]
    run = make_run(t_s, motion + rng.normal(0, 0.1, (t_s.size, 3)), table_rate_dps=0.0)
    assert told(make_session(run)) >= {("not_at_rest", "z")}


@pytest.mark.parametrize("kind", ["noisy", "drifting", "jump", "knock", "vibrating"])
def test_a_rest_that_is_one_is_left_in_peace(kind: str) -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(6000) / 100.0
    noise = rng.normal(0, 8.0 if kind == "noisy" else 0.1, (t_s.size, 3))
    moves = {
        "drifting": 3.0 * t_s / t_s[-1],
        "jump": np.where(t_s > 20.0, 5.0, 0.0),
        "knock": 40.0 * np.exp(-(((t_s - 30.0) / 0.3) ** 2)),
        "vibrating": 20.0 * np.sin(2 * np.pi * 17.3 * t_s),
    }.get(kind, np.zeros_like(t_s))
    run = make_run(t_s, noise + moves[:, None], table_rate_dps=0.0)
    assert "not_at_rest" not in {w.code for w in check(make_session(run))}


def test_beside_a_reference_that_its_own_axis_contradicts_the_other_axes_have_no_sure_name() -> None:
    """A reference of another motion, which leaks into y as a misalignment would."""
    rng, t_s, runs = np.random.default_rng(4), np.arange(6000) / 100, []
    for cycle in range(4):
        rate_dps = 60 * np.sin(2 * np.pi * t_s / 11 + cycle) + 20 * np.sin(2 * np.pi * t_s / 3.7)
        gyro = rng.normal(0, 0.05, (t_s.size, 3))
        gyro[:, 1] += 0.02 * rate_dps
        runs.append((gyro, rate_dps, f"s{cycle}"))

    def session(part: float) -> Session:
        made = [(gyro + np.outer(part * rate_dps, [0, 0, 1]), rate_dps, scenario) for gyro, rate_dps, scenario in runs]
        return make_session(*(make_run(t_s, y, table_rate_dps=None, rate_ref_dps=w, scenario=name) for y, w, name in made))

    names = [[(c.effect.id, c.axis) for c in diagnose(session(part)).candidates if c.decision == "add"] for part in (1.0, 0.4)]
    assert names[0] == [("misalignment", "y")]
    assert names[1] == []


@pytest.mark.parametrize("dead", [True, False])
def test_an_axis_that_shows_nothing_of_the_reference_is_unrelated_and_its_scale_is_not_judged(dead: bool) -> None:
    """The sensor turns about z alone and the orientations wander about y; or y turns, and its readings are noise."""
    turned, wandering = motion((0.02, 0.01, 1.0)), motion((0.01, 0.3, 0.0))[::-1]
    session = tracked(turned, turned + wandering)
    if dead:
        full = motion((1.0, 1.0, 1.0))
        session = tracked(full * [1.0, 0.0, 1.0], full)
    found = {(w.code, w.axis): w for w in check(session) if w.blocking}
    assert found.keys() == {("reference_unrelated", "y")}
    assert "show nothing of what the reference says" in found["reference_unrelated", "y"].text


def test_a_sensor_at_rest_beside_noisy_orientations_has_no_scale_and_no_offset() -> None:
    rng = np.random.default_rng(8)
    noisy = Rotation.from_rotvec(np.deg2rad(rng.normal(0, 0.1, (T_S.size, 3)))).as_quat()
    columns = dict(zip(("ref_qx", "ref_qy", "ref_qz", "ref_qw"), noisy.T, strict=True))
    own = Reference(clock="own")
    run = replace(make_run(T_S, rng.normal(0, 0.3, (T_S.size, 3)), table_rate_dps=None, **columns), reference=own)
    codes = {w.code for w in check(make_session(run, reference=own))}
    assert not codes & {"scale_implausible", "offset_ambiguous", "axes_swapped", "unit_rad_s"}


def test_calibration_has_the_frame_of_the_comparison_where_one_axis_hardly_turns() -> None:
    """Clipped readings of x turned the frame: y read a part of the rate about x, and its scale was half."""
    true_dps = motion((6.0, 0.3, 0.3))
    clipped = np.clip(true_dps, -300.0, 300.0) + [0.0, 0.1, 0.1] * np.sin(2 * np.pi * T_S / 3)[:, None]
    session = tracked(clipped, true_dps)
    scales = {p["axis"]: p for p in compare(session).to_json()["parameters"] if p["effect"] == p["name"] == "scale"}
    for e in calibrate(session):
        if e.axis != "x":
            assert e.scale is not None
            assert abs(e.scale) < 0.05
            assert e.scale == pytest.approx(scales[e.axis]["value"], abs=4 * scales[e.axis]["se"])
