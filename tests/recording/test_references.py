"""References: quaternions, angles, frames and clocks of their own, and what is said of bad ones."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyrocal.calibration.calibrate import calibrate
from gyrocal.cli import main
from gyrocal.effects.bias_jumps import jumps, outliers_of
from gyrocal.error_model.correction import correct
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.plausibility import check, references
from gyrocal.plausibility.runs import Means
from gyrocal.recording.header import Reference
from gyrocal.recording.register import registered
from gyrocal.recording.registration import Registration
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

Array = NDArray[np.float64]
RATE_HZ, SECONDS = 50.0, 20.0
T_S = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
OWN = Reference(clock="own")


def motion(t_s: Array, seed: int = 0) -> Array:
    """Body rates [n, 3], deg/s: sums of sines below 1.5 Hz."""
    rng = np.random.default_rng(seed)
    f, p, a = rng.uniform(0.1, 1.5, (8, 3)), rng.uniform(0, 7, (8, 3)), rng.normal(0, 20, (8, 3))
    return np.asarray(np.sum(a * np.sin(2 * np.pi * f * t_s[:, None, None] + p), axis=1))


def quaternions(t_s: Array, seed: int = 0) -> Array:
    """Orientations w, x, y, z [n, 4] of that motion, integrated in steps of half a millisecond."""
    fine = round(2000 / RATE_HZ)
    middle = t_s[0] + (np.arange((t_s.size - 1) * fine) + 0.5) / (RATE_HZ * fine)
    steps = Rotation.from_rotvec(np.deg2rad(motion(middle, seed)) / (RATE_HZ * fine))
    between = steps[::fine]  # all samples at once
    for k in range(1, fine):
        between = between * steps[k::fine]
    out = [Rotation.identity()]
    for turned in between:
        out.append(out[-1] * turned)
    return np.asarray(Rotation.concatenate(out).as_quat()[:, [3, 0, 1, 2]])


Q = quaternions(T_S[:400])


def with_reference(gyro_dps: Array, reference: Reference = OWN, **columns: Array) -> Session:
    t_s = np.arange(len(gyro_dps)) / RATE_HZ
    run = replace(make_run(t_s, gyro_dps, table_rate_dps=None, **columns), reference=reference)
    return make_session(run, reference=reference)


def rates(ref: Array) -> dict[str, Array]:
    return {f"ref_{a}_dps": ref[:, i] for i, a in enumerate("xyz")}


def orientation(q: Array) -> dict[str, Array]:
    return {name: q[:, i] for i, name in enumerate(("ref_qw", "ref_qx", "ref_qy", "ref_qz"))}


def test_rates_of_orientations_are_those_of_the_motion_whatever_the_sign() -> None:
    flipped = Q * np.where(np.arange(len(Q)) % 7 < 3, -1.0, 1.0)[:, None]
    run = with_reference(np.zeros((len(Q), 3)), Reference(), **orientation(flipped)).runs[0]
    for i, axis in enumerate("xyz"):
        np.testing.assert_allclose(run.about(axis).rate_dps[10:-10], motion(T_S[:400])[10:-10, i], atol=0.1)


@pytest.mark.parametrize("noise_deg", [0.0, 0.09 / 12**0.5])
def test_an_encoders_angle_gives_its_rate(noise_deg: float) -> None:
    angle = 300 * np.sin(2 * np.pi * 0.4 * T_S) + 50 * T_S
    measured = np.round(angle / 0.09) * 0.09 if noise_deg else angle
    run = with_reference(np.zeros((T_S.size, 3)), Reference(), ref_angle_deg=measured).runs[0]
    true = 300 * 2 * np.pi * 0.4 * np.cos(2 * np.pi * 0.4 * T_S) + 50
    off = (run.rate_dps - true)[run.reached]
    assert off.size >= 0.9 * T_S.size
    assert np.std(off) < (0.5 * noise_deg * RATE_HZ * 2**0.5 if noise_deg else 0.05)  # less than that of plain differences
    assert abs(np.mean(off)) < 0.02


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q: orientation(q * np.where(np.arange(len(q)) == 7, 0.8, 1.0)[:, None]), "row 9: .* the length 0.8, not 1"),
        (lambda q: {k: v for k, v in orientation(q).items() if k != "ref_qz"}, "the reference lacks ref_qz"),
    ],
)
def test_bad_quaternions_are_named(change: object, words: str) -> None:
    run = with_reference(np.zeros((len(Q), 3)), **change(Q)).runs[0]  # type: ignore[operator]
    with pytest.raises(InputError, match=words):
        _ = run.rate_dps


def test_zeros_of_a_tracker_that_saw_nothing_are_missing() -> None:
    gone = Q.copy()
    gone[100:120] = 0.0
    run = registered(with_reference(motion(T_S[:400]), **orientation(gone))).runs[0]
    assert run.reached[[50, 110, 200]].tolist() == [True, False, True]
    nothing = with_reference(np.zeros((len(Q), 3)), **orientation(np.zeros_like(Q))).runs[0]
    with pytest.raises(InputError, match="no row has an orientation"):
        _ = nothing.rate_dps


@pytest.mark.parametrize("seed", range(3))
def test_a_motion_about_one_axis_alone_gives_its_direction_and_blocks_no_axis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(rng.normal(0, 30, 3), degrees=True)
    ref = motion(T_S, seed) * [8.0, 0.02, 0.02]
    gyro = turn.apply(ref) * [0.995, 1.003, 1.0] + rng.normal(0, 0.1, ref.shape)
    session = with_reference(gyro, Reference(), **rates(ref + rng.normal(0, 1.0, ref.shape)))
    found = registered(session).registration_fit
    assert found is not None
    assert not found.mirrored
    x = np.array([1.0, 0.0, 0.0])
    assert np.degrees(np.arccos(min(1.0, float((found.registration.matrix @ x) @ turn.apply(x))))) < 1.0
    assert [w.code for w in check(session) if w.blocking] == []


@pytest.mark.parametrize(
    ("mounted_deg", "axis", "reference"),
    [((0.0, 0.0, 0.0), "z", OWN), ((0.0, 90.0, 0.0), "x", Reference()), ((180.0, 0.0, 0.0), "z", OWN)], ids=["z", "x", "down"],
)  # fmt: skip
def test_exactly_one_axis_of_an_odometry_calibrates_the_axis_that_it_turns(
    mounted_deg: tuple[float, float, float], axis: str, reference: Reference
) -> None:
    """Wheel odometry is a pure yaw: the fit was singular, biases were 1e14 dps, or the import ended with a LinAlgError."""
    rng, yaw_dps = np.random.default_rng(3), motion(T_S)[:, 0]
    turn, place = Rotation.from_rotvec(mounted_deg, degrees=True), "xyz".index(axis)
    gyro = 1.01 * turn.apply(np.outer(yaw_dps, [0.0, 0.0, 1.0])) + [0.3, -0.2, 0.5] + rng.normal(0, 0.1, (T_S.size, 3))
    fine_dps = motion((np.arange(20 * T_S.size) + 0.5) / (20 * RATE_HZ))[:, 0]
    half = np.deg2rad(np.concatenate([[0.0], np.cumsum(fine_dps)])[: fine_dps.size : 20]) / (20 * RATE_HZ) / 2
    yaw = np.outer(np.cos(half), [1, 0, 0, 0]) + np.outer(np.sin(half), [0, 0, 0, 1])
    session = with_reference(gyro, reference, **orientation(yaw))
    with np.errstate(all="raise"):
        found, told = registered(session).registration_fit, check(session)
    assert found is not None
    assert not found.mirrored
    assert abs(found.registration.offset_s) < 0.005
    size_deg = float(np.linalg.norm(mounted_deg))
    assert np.linalg.norm(found.registration.rotation_deg) == pytest.approx(size_deg, abs=0.5)
    assert {(w.code, w.axis) for w in told} == {("hardly_turned", other) for other in "xyz" if other != axis}
    (estimate,) = calibrate(session)
    assert (estimate.axis, estimate.flags) == (axis, ())
    assert estimate.scale == pytest.approx(0.01, abs=4 * (estimate.scale_se or 0.0))
    assert estimate.bias_dps == pytest.approx((0.3, -0.2, 0.5)[place], abs=0.03)


@pytest.mark.parametrize("reference", [Reference(), OWN], ids=["same", "own"])
@pytest.mark.filterwarnings("error")
def test_a_reference_that_never_turns_is_unrelated_without_a_warning_of_numpy(reference: Reference) -> None:
    session = with_reference(motion(T_S), reference, **orientation(np.outer(np.ones(T_S.size), [1, 0, 0, 0])))
    assert "reference_unrelated" in {w.code for w in check(session)}
    found = registered(session).registration_fit
    assert found is not None
    assert found.registration.rotation_deg == Registration().rotation_deg


@pytest.mark.parametrize("jitter_s", [0.0, 0.006])
def test_times_that_scatter_are_told_beside_their_noise(jitter_s: float) -> None:
    """The floor was 2.3 deg/s of a part with 0.1 at rest, and the verdict adequate: two chips were read some ms apart."""
    rng = np.random.default_rng(2)
    gyro = motion(T_S + rng.normal(0, jitter_s, T_S.size)) + rng.normal(0, 0.1, (T_S.size, 3))
    told = [w for w in check(with_reference(gyro, **rates(motion(T_S)))) if w.code == "noise_unknown"]
    assert {w.axis for w in told} == (set("xyz") if jitter_s else set())
    assert all("scattered by 6 ms" in w.text or "scattered by 5." in w.text or "scattered by 6." in w.text for w in told)


@pytest.mark.parametrize("ends_dps", [(416.0, -421.0), (300.0, -300.5)])
def test_a_range_whose_end_is_no_single_value_is_clipping(ends_dps: tuple[float, float]) -> None:
    rng = np.random.default_rng(5)
    ref = motion(T_S) * [12.0, 0.5, 0.5]
    gyro = np.clip(ref, ends_dps[1], ends_dps[0]) + 0.4 * np.sin(T_S[:, None]) + rng.normal(0, 0.1, ref.shape)
    session = with_reference(gyro, Reference(), **rates(ref))
    told = {w.code: w for w in check(session)}
    assert told["clipped"].axis == "x"
    assert "scale_implausible" not in told
    sound = with_reference(ref + rng.normal(0, 0.1, ref.shape), Reference(), **rates(ref))
    assert "clipped" not in {w.code for w in check(sound)}


def test_jumps_are_told_and_left_out() -> None:
    jumped = Q.copy()
    turn = Rotation.from_rotvec([0, 0, 0.5])
    jumped[200:] = (turn * Rotation.from_quat(Q[200:][:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]
    session = with_reference(motion(T_S[:400]), **orientation(jumped))
    told = {w.code: w.text for w in references.check(session)}
    assert "jumps 1 times" in told["reference_jumps"]
    run = registered(session).runs[0]
    assert run.reached[[150, 199, 250]].tolist() == [True, False, True]
    np.testing.assert_allclose(run.about("x").rate_dps[230:380], motion(T_S[:400])[230:380, 0], atol=0.3)


def test_steps_of_a_coarse_angle_are_no_jumps_whatever_the_stamps() -> None:
    """Steps were scaled to the usual time before their count was looked for: each was a jump, and nothing moving was left."""
    rng = np.random.default_rng(5)
    t_s = np.cumsum(rng.normal(0.005, 2e-4, 800))
    true_deg = 16 * (1 - np.cos(2 * np.pi * np.clip(t_s - 0.5, 0, None) / 3))
    gyro = np.outer(np.gradient(true_deg, t_s), [0, 0, 1]) + rng.normal(0, 0.1, (800, 3))
    for count_deg in (1.0, 0.1):
        seen = np.floor(true_deg / count_deg) * count_deg
        (run,) = make_session(make_run(t_s, gyro, table_rate_dps=None, ref_angle_deg=seen)).runs
        assert run.measured_rates is not None
        assert run.measured_rates.jumps == 0
        assert run.measured_rates.known.mean() > 0.9


def test_a_tracker_that_loses_the_sensor_is_told_with_its_times() -> None:
    rng = np.random.default_rng(8)
    ref = motion(T_S)
    gyro = ref + rng.normal(0, 0.1, ref.shape)
    lost = (T_S > 5.0) & (T_S < 5.4)
    wrong = np.where(lost[:, None], -2 * ref + 60.0, ref)
    assert [w.code for w in check(with_reference(gyro, Reference(), **rates(ref)))] == []
    told = [w for w in check(with_reference(gyro, Reference(), **rates(wrong))) if w.code == "reference_jumps"]
    assert len(told) == 1
    assert "at 5.0 s" in told[0].text
    run = registered(with_reference(gyro, Reference(), **rates(wrong))).runs[0]
    assert not run.reached[lost].any()
    assert np.mean(run.reached) > 0.95


def test_a_loss_in_which_the_difference_passes_through_zero_is_left_out_to_its_end() -> None:
    """The wrong rate swings about the true one: the samples of each zero crossing agree, and those after it are as wrong."""
    rng = np.random.default_rng(8)
    ref = motion(T_S)
    gyro = ref + rng.normal(0, 0.1, ref.shape)
    lost = (T_S >= 5.0) & (T_S < 5.6)
    swing_dps = np.where(lost, 150.0 * np.sin(2 * np.pi * 5.0 * (T_S - 4.98)), 0.0)
    session = with_reference(gyro, Reference(), **rates(ref + swing_dps[:, None]))
    run = registered(session).runs[0]
    assert not run.reached[np.abs(swing_dps) > 10.0].any()
    (told,) = [w for w in check(session) if w.code == "reference_jumps"]
    assert "in one stretch (at 5.0 s)" in told.text


def test_an_axis_about_which_the_sensor_hardly_turns_is_told() -> None:
    """A mount that bends by 0.2 deg while the sensor turns about z gives x a wrong scale, far outside of its standard error."""
    ref = motion(T_S) * (0.02, 1.0, 1.0)
    bend = np.deg2rad(0.2)
    gyro = ref + bend * np.outer(ref[:, 2], (1.0, 0.0, 0.0)) + np.random.default_rng(8).normal(0, 0.1, ref.shape)
    told = [w for w in check(with_reference(gyro, Reference(), **rates(ref))) if w.code == "hardly_turned"]
    assert [(w.axis, w.blocking) for w in told] == [("x", False)]
    assert not [w for w in check(with_reference(motion(T_S), Reference(), **rates(motion(T_S)))) if w.code == "hardly_turned"]


def test_a_tracker_that_finds_the_sensor_again_slowly_is_left_out_until_then() -> None:
    """After the loss its error decays from 120 dps within a second; what is left in the fit is below the usual difference."""
    rng = np.random.default_rng(8)
    ref = motion(T_S)
    gyro = ref + rng.normal(0, 0.1, ref.shape)
    error_dps = np.where(T_S > 5.0, 120.0 * np.exp(-(T_S - 5.0) / 0.2), 0.0)
    session = with_reference(gyro, Reference(), **rates(ref + error_dps[:, None]))
    run = registered(session).runs[0]
    assert not run.reached[(T_S > 5.0) & (error_dps > 2.0)].any()
    assert np.mean(run.reached) > 0.9
    assert sum(w.code == "reference_jumps" for w in check(session)) == 1


def test_of_a_turn_in_which_the_reference_is_off_for_a_moment_that_moment_alone_is_left_out() -> None:
    """Beside rests, what a scale error makes of a turn is far more than usual: whole turns went with a bad moment in them."""
    rng = np.random.default_rng(8)
    turns = np.floor(T_S / 2) % 3 == 1
    true_dps = 3.0 * motion(T_S) * turns[:, None]
    gyro = 1.02 * true_dps + rng.normal(0, 0.05, true_dps.shape)
    wrong = (T_S > 8.9) & (T_S < 9.1)
    reference = true_dps + np.where(wrong[:, None], [300.0, 0.0, -300.0], 0.0)
    run = registered(with_reference(gyro, Reference(), **rates(reference))).runs[0]
    assert not run.reached[wrong].any()
    assert np.mean(run.reached) > 0.97


def test_a_reference_that_is_often_wrong_is_told_and_kept() -> None:
    """With losses beside nearly every sample of a run, it is not clear whether the tracker or the sensor is wrong."""
    rng = np.random.default_rng(8)
    ref = motion(T_S)
    gyro = ref + rng.normal(0, 0.1, ref.shape)
    n = np.arange(T_S.size)
    lost_dps = np.where(n % 40 < 4, 400.0 * (-1.0) ** (n // 40), 0.0)
    session = with_reference(gyro, Reference(), **rates(ref + lost_dps[:, None]))
    told = [w for w in check(session) if w.code == "reference_jumps"]
    assert [w.blocking for w in told] == [False]
    assert "nothing is left out" in told[0].text
    assert registered(session).runs[0].reached.all()


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 120.0, 180.0])
@pytest.mark.parametrize("offset_s", [-1.9, 0.003, 1.9])
def test_frame_and_clock_are_found_from_the_readings_alone(angle_deg: float, offset_s: float) -> None:
    turn = Rotation.from_rotvec(angle_deg * np.array([2, -1, 2]) / 3, degrees=True)
    rng = np.random.default_rng(3)
    gyro = turn.apply(motion(T_S - offset_s)) * [1.01, 0.99, 1.005] + [1, -2, 3] + rng.normal(0, 0.05, (T_S.size, 3))
    found = registered(with_reference(gyro, **rates(motion(T_S) + rng.normal(0, 0.05, gyro.shape)))).registration_fit
    assert found is not None
    assert np.rad2deg((Rotation.from_matrix(found.registration.matrix) * turn.inv()).magnitude()) < 0.1
    assert found.registration.offset_s == pytest.approx(offset_s, abs=2e-4)
    assert (found.mirrored, found.alternatives_s) == (False, ())


@pytest.mark.parametrize(("late_s", "count_deg"), [(0.26, 1.0), (-0.9, 0.3), (0.1, 0.01)])
def test_the_offset_of_a_coarse_angle_is_found_where_runs_begin_at_rest_and_end_fast(late_s: float, count_deg: float) -> None:
    """Offsets were compared by what each leaves of the samples that it reaches: of the last ones, which hardly move, nothing.

    A rate of an angle in degrees is off by as much as it is large, and was compared without an average.
    """

    def speed(at_s: Array) -> Array:
        return np.asarray((1 - np.exp(-np.maximum(at_s, 0.0) / 0.6)) * np.exp(-np.maximum(at_s, 0.0) / 20))

    rng, runs, t_s, fine_s = np.random.default_rng(1), [], np.arange(900) / 200, np.arange(-800, 3000) / 400
    for k, fastest_dps in enumerate((170.0, 200.0, -260.0, 310.0)):
        angle_deg = np.interp(t_s - late_s, fine_s, np.cumsum(fastest_dps * speed(fine_s)) / 400)
        gyro = rng.normal(0, 0.1, (t_s.size, 3)) + np.outer(fastest_dps * speed(t_s), [0, 0, 1])
        seen_deg = np.floor(angle_deg / count_deg) * count_deg
        runs.append(make_run(t_s, gyro, table_rate_dps=None, scenario=f"s{k}", ref_angle_deg=seen_deg))
    found = registered(make_session(*runs, reference=OWN)).registration_fit
    assert found is not None
    assert found.registration.offset_s == pytest.approx(-late_s, abs=0.005 + 0.065 * count_deg)


def test_nothing_stands_out_and_nothing_jumps_where_the_reference_has_ended() -> None:
    """The readings of the last 1.9 s have no reference, whose last value is no true rate of theirs."""
    rng = np.random.default_rng(3)
    gyro = motion(T_S + 1.9) + rng.normal(0, 0.02, (T_S.size, 3))
    found = registered(with_reference(gyro, **rates(motion(T_S))))
    for axis, name in enumerate("xyz"):
        run = found.runs[0].about(name)
        assert not run.reached[-90:].any()
        assert not np.any(outliers_of(run, axis))
        assert jumps(run, axis) == []


def test_a_reference_later_than_two_seconds_is_refused_with_its_shift() -> None:
    t_s = np.arange(2000) / RATE_HZ
    with pytest.raises(InputError, match=r"shifted by \+3\.50 s, more than 2 s"):
        registered(with_reference(motion(t_s - 3.5), **rates(motion(t_s))))


def test_a_mirrored_reference_blocks() -> None:
    (warning,) = references.check(with_reference(motion(T_S) * [1, 1, -1], **rates(motion(T_S))))
    assert (warning.code, warning.axis, warning.blocking) == ("sign_flipped", None, True)
    assert "mirror image" in warning.text


def test_a_model_corrects_a_session_whose_reference_has_three_axes() -> None:
    values = {"scale": {"scale": 0.01}, "bias": {"bias_dps": 1.0}, "misalignment": {"m_y": 0.02, "m_z": -0.01}}
    terms = [Term(effect, "x", v) for effect, v in values.items()]
    terms += [Term("scale", axis, {"scale": 0.0}) for axis in "yz"]
    true = motion(T_S)
    gyro = true.copy()
    gyro[:, 0] += 0.01 * true[:, 0] + 0.02 * true[:, 1] - 0.01 * true[:, 2] + 1.0
    run = with_reference(gyro, **rates(Rotation.from_rotvec([0.3, 1, 0.2]).apply(true))).runs[0]
    np.testing.assert_allclose(correct(Model("m", tuple(terms)), run).rate_dps, true, atol=1e-6)


def test_each_axis_is_calibrated_by_the_model() -> None:
    turn = Rotation.from_rotvec([0.4, -0.9, 1.3])
    rng = np.random.default_rng(5)
    gyro = turn.apply(motion(T_S - 0.4)) * [1.01, 0.99, 1.005] + [1, -2, 3] + rng.normal(0, 0.05, (T_S.size, 3))
    found = {e.axis: e for e in calibrate(with_reference(gyro, **rates(motion(T_S))))}
    for axis, scale, bias in zip("xyz", (0.01, -0.01, 0.005), (1, -2, 3), strict=True):
        estimate = found[axis]
        assert estimate.scale is not None
        assert estimate.scale_se is not None
        assert abs(estimate.scale - scale) < 4 * estimate.scale_se < 0.002
        assert estimate.bias_dps == pytest.approx(bias, abs=0.05)


def test_the_other_offsets_of_a_periodic_motion_are_told() -> None:
    def swing(t_s: Array) -> Array:
        waves = np.sin(2 * np.pi * t_s[:, None] * np.arange(1, 7) + np.arange(6))
        return np.asarray(waves @ np.random.default_rng(1).normal(0, 20, (6, 3)))

    noise = np.random.default_rng(0).normal(0, 0.05, (T_S.size, 3))
    session = with_reference(swing(T_S - 0.3) + noise, **rates(swing(T_S)))
    fit = registered(session).registration_fit
    assert fit is not None
    offsets = [fit.registration.offset_s, *fit.alternatives_s]
    np.testing.assert_allclose(sorted(offsets), [-1.7, -0.7, 0.3, 1.3], atol=0.002)
    assert [w.code for w in references.check(session)] == ["offset_ambiguous"]


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (orientation(Q * (1 - 0.2 * (np.arange(len(Q)) == 7)[:, None])), "row 9: the quaternion has the length 0.8, not 1"),
        (orientation(Q * 57.3), "row 2: the quaternion has the length 57.3, not 1 (400 such rows)"),
        ({k: v for k, v in orientation(Q).items() if k != "ref_qz"}, "the reference lacks ref_qz"),
        (rates(motion(T_S + 3.5)), "shifted by +3.50 s, more than 2 s. Add 3.50 s to the reference's times"),
    ],
)
@pytest.mark.parametrize("verb", ["compare", "diagnose", "calibrate"])
def test_a_bad_reference_ends_every_verb_with_2_and_one_sentence(
    verb: str, columns: dict[str, Array], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    n = len(next(iter(columns.values())))
    with_reference(motion(T_S[:n]), **columns).save(tmp_path / "s")
    assert main([verb, str(tmp_path / "s")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("shift_s", [None, 3.5])
def test_a_reference_of_another_motion_blocks_and_says_so(shift_s: float | None) -> None:
    """Of another recording, or too late in one that is too short to show by how much."""
    ref = motion(T_S[:400], seed=1) if shift_s is None else motion(T_S[:400] + shift_s)
    (warning,) = references.check(with_reference(motion(T_S[:400]), **rates(ref)))
    assert (warning.code, warning.blocking) == ("reference_unrelated", True)
    assert "differ by less than 2 s" in warning.text


@pytest.mark.parametrize(("seed", "blocks"), [(0, False), (1, True)])
def test_a_reference_that_is_too_slow_for_the_steps_of_a_walk_belongs_to_the_readings_all_the_same(
    seed: int, blocks: bool
) -> None:
    """At 5 Hz it shows the slow third of their power; and one of another motion not even that."""
    t_s, seen = np.arange(3000) / RATE_HZ, np.arange(3000) % 10 == 0
    steps = 2.0 * np.std(motion(t_s)) * np.sin(2 * np.pi * 7.3 * t_s[:, None] + [0.0, 1.0, 2.0])
    ref = np.where(seen[:, None], motion(t_s, seed), np.nan)
    told = {w.code for w in references.check(with_reference(motion(t_s) + steps, **rates(ref))) if w.blocking}
    assert told == ({"reference_unrelated"} if blocks else set())


@pytest.mark.parametrize(
    "change",
    [lambda q: q[:, [1, 2, 3, 0]], lambda q: q * [1.0, -1.0, -1.0, -1.0]], ids=["x, y, z, w", "fixed frame to body"],
)  # fmt: skip
def test_inverted_orientations_block_and_are_told(change: Callable[[Array], Array]) -> None:
    (warning,) = references.check(with_reference(motion(T_S[:400]), **orientation(change(Q))))
    assert (warning.code, warning.blocking) == ("reference_unrelated", True)
    assert "only if its orientations are inverted" in warning.text


def test_an_axis_that_shows_nothing_of_its_reference_blocks_alone() -> None:
    """A drone's tilts of some degrees: scales of -98 % and -78 % were printed."""
    rng = np.random.default_rng(9)
    ref = motion(T_S)
    gyro = ref + rng.normal(0, 0.1, ref.shape)
    gyro[:, 0] = np.convolve(rng.normal(0, 2.5 * ref[:, 0].std(), T_S.size + 8), np.ones(9) / 9, "valid")
    gyro[:, 0] += 0.13 * ref[:, 0]
    told = [w for w in check(with_reference(gyro, **rates(ref))) if w.code == "reference_unrelated"]
    assert [(w.axis, w.blocking) for w in told] == [("x", True)]
    gyro[:, 0] = 0.9 * ref[:, 0] + rng.normal(0, ref[:, 0].std(), T_S.size)
    assert not [w for w in check(with_reference(gyro, **rates(ref))) if w.code == "reference_unrelated"]


def one_axis_at_a_time(together: float) -> tuple[Array, Array]:
    """Body rates [n, 3] and orientations [n, 4] of turns about x, y, z in turn from one position, and ``together`` deg more."""
    t_s = np.arange(0, 60, 1 / RATE_HZ)
    angles = np.array([80 * np.sin(0.314159 * np.clip(t_s - start, 0, 20)) ** 2 for start in (0, 20, 40)]).T
    angles[:, 2] += together * np.sin(2 * np.pi * t_s / 15)
    turned = Rotation.from_euler("XYZ", angles, degrees=True)
    rate = np.rad2deg((turned[:-1].inv() * turned[1:]).as_rotvec()) * RATE_HZ
    between = np.column_stack([np.interp(t_s, t_s[:-1] + 0.5 / RATE_HZ, column) for column in rate.T])
    return between, turned.as_quat()[:, [3, 0, 1, 2]]


@pytest.mark.parametrize(("together", "code"), [(0.0, "sign_flipped"), (6.0, "reference_unrelated")])
def test_inverted_orientations_of_turns_about_one_axis_at_a_time_are_told(together: float, code: str) -> None:
    """A robot's orientations turn the fixed frame to the body: the advice was to negate or exchange columns."""
    gyro, q = one_axis_at_a_time(together)
    gyro = gyro + np.random.default_rng(1).normal(0, 0.05, gyro.shape)
    told = [w for w in references.check(with_reference(gyro, **orientation(q * [1.0, -1.0, -1.0, -1.0]))) if w.blocking]
    assert [w.code for w in told] == [code]
    assert "negate three of them" in told[0].text
    right = references.check(with_reference(gyro, **orientation(q)))
    assert not [w for w in right if w.blocking]


def test_a_gap_in_the_orientations_changes_no_slope() -> None:
    """What lies in the gap is on a straight line, which the readings do not follow."""
    q = quaternions(T_S)
    q[250:650] = np.nan
    means = Means(registered(with_reference(motion(T_S), **orientation(q))))
    assert [mean.slope for (mean,) in means.by_axis.values()] == pytest.approx([1.0] * 3, abs=1e-3)


def test_rests_beside_a_reference_at_rest_are_not_unrelated() -> None:
    noise = np.random.default_rng(0).normal(0, 0.05, (2, T_S.size, 3))
    assert "reference_unrelated" not in {w.code for w in references.check(with_reference(noise[0], **rates(noise[1])))}


@pytest.mark.parametrize("seed", [1, 5])
def test_a_step_of_the_search_beyond_the_readings_ends_no_fit(seed: int) -> None:
    """Swings of seven seconds by a clock of their own: "the reference covers fewer than 8 samples", which it did not."""
    rng, runs, t_s = np.random.default_rng(seed), [], np.arange(760) / 100.0
    for k in range(3 if seed == 1 else 2):
        f_hz, phase = rng.uniform(0.1, 0.6), rng.uniform(0, 6.28)
        read, true = (105 * np.cos(2 * np.pi * f_hz * (t_s - by_s) + phase) for by_s in (0.28, 0.0))
        gyro = rng.normal(0, 0.03, (t_s.size, 3))
        gyro[:, 2] += 0.998 * read + 0.5
        noisy = true + rng.normal(0, 0.1, t_s.size)
        runs.append(make_run(t_s, gyro, table_rate_dps=None, scenario=f"s{k}", rate_hz=100.0, rate_ref_dps=noisy))
    found = {p.name: p.value for p in registered(make_session(*runs, reference=Reference(clock="own"))).registration_parameters}
    assert abs(found["offset_s"]) == pytest.approx(0.28, abs=0.01)
