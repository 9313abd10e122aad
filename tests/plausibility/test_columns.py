"""Times and acceleration: any time a reader accepts is judged, and gravity may lie across the table's axis."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.quantities import acceleration_g, pose_changes
from gyrocal.plausibility import check
from gyrocal.recording.session import Session
from gyrocal.recording.stamps import period_s
from make_runs import Array, make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")


def pair(t_s: Array, rate_dps: float = 72.0, rate_hz: float = 100.0, acc_unit: float = 1.0, across: bool = True) -> Session:
    """Two turning runs, face up and face down; ``across``: the table's axis lies level, and gravity turns about it."""
    rng = np.random.default_rng(4)
    runs = []
    for face, sign in (("up", 1.0), ("down", -1.0)):
        gyro = rng.normal([0.3, -0.2, 0.4 + sign * rate_dps * 1.004], 0.05, (t_s.size, 3))
        angle = np.deg2rad(rate_dps * np.arange(t_s.size) / rate_hz)
        gravity = (
            np.array([np.cos(angle), -sign * np.sin(angle), 0 * angle]) if across else np.outer([0, 0, sign], 1 + 0 * angle)
        )
        acc = (gravity + rng.normal(0, 0.003, gravity.shape) + [[0.01], [-0.01], [0.008]]) * acc_unit
        columns = dict(zip(("ax_g", "ay_g", "az_g"), acc, strict=True))
        runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, face=face, rate_hz=rate_hz, **columns))
    return make_session(*runs)


def with_gap(seconds: float) -> Array:
    t_s = np.arange(1500) / 100.0
    t_s[700:] += seconds
    return t_s


@pytest.mark.parametrize(
    ("t_s", "rate_hz"),
    [
        (np.arange(1500) * 10.0, 100.0), (np.arange(300) * 10.0, 0.1), (with_gap(3600.0), 100.0),
        pytest.param(with_gap(86400.0), 100.0, marks=pytest.mark.wide),
    ],
    ids=["ms", "0.1 Hz", "a gap of an hour", "a gap of a day"],
)  # fmt: skip
def test_slow_and_broken_times_are_judged(t_s: Array, rate_hz: float) -> None:
    session = pair(t_s, rate_hz=rate_hz, across=False)
    compared, found = compare(session), diagnose(session)
    assert [w.code for w in compared.warnings] == ["sample_rate"]
    assert found.to_json()["warnings"] == compared.to_json()["warnings"]
    assert "ms?" in compared.warnings[0].text
    steps_s = np.diff(t_s)
    gap = f"as that of {steps_s.max():.4g} s after 6.99 s, it has 100: then make a run of each part"
    assert (gap in compared.warnings[0].text) == (steps_s.max() > 10 * np.median(steps_s))


@pytest.mark.parametrize("samples", [60, 80, 600])
@pytest.mark.parametrize("burst", [4, 8, 16, 32])
def test_bursts_do_not_change_the_rate(samples: int, burst: int) -> None:
    number = np.arange(samples)
    t_s = number // burst * burst / 10.0 + number % burst * 2e-4
    assert check(pair(t_s, rate_hz=10.0, across=False)) == []
    assert [w.code for w in check(pair(t_s * 1.1, rate_hz=10.0, across=False))] == ["sample_rate"]


@pytest.mark.parametrize("burst", [1, 5])
@pytest.mark.parametrize("part", [0.001, 0.01, 0.05, 0.2, 0.4])
@pytest.mark.parametrize("jitter_s", [0.0, 0.0005])
def test_lost_samples_are_counted(part: float, burst: int, jitter_s: float) -> None:
    """Times that skip sampling intervals drew no warning, and a loss of 5 % now and then one of a wrong sample rate."""
    rng = np.random.default_rng(2)
    kept = np.ones(6000, dtype=bool)
    for first in np.flatnonzero(rng.random(6000) < part / burst):
        kept[max(1, first) : first + burst] = False
    kept[-1] = True
    t_s = (np.arange(6000) / 100.0 + rng.uniform(0, jitter_s, 6000))[kept]
    (told,) = check(pair(t_s, rate_hz=100.0, across=False))
    assert (told.code, told.axis, told.file, told.blocking) == ("samples_lost", None, None, False)
    assert told.text.startswith(f"{2 * (6000 - t_s.size)} of 12000 samples in 2 runs are missing")


def test_one_gap_longer_than_a_part_beside_it_may_be_a_pause() -> None:
    """A logger that stood still for 47 s had lost "235 of 362 samples", and only its FIFO was to be read."""
    t_s = np.concatenate([np.arange(600) / 100.0, 20 + np.arange(600) / 100.0])
    run = make_run(t_s, np.random.default_rng(1).normal(0, 0.05, (1200, 3)), table_rate_dps=0.0, rate_hz=100.0)
    (told,) = check(make_session(run))
    assert told.code == "samples_lost"
    assert told.text.startswith("For 14 s after 5.99 s there is no sample, the time of 1400 of 2600 (53.85%). If the logger")
    kept = np.abs(t_s - 3.0) > 0.1  # a second gap, which is short
    (told,) = check(make_session(make_run(t_s[kept], run.gyro_dps[kept], table_rate_dps=0.0, rate_hz=100.0)))
    assert "samples are missing" in told.text


def test_pauses_that_are_long_against_the_recordings_lie_between_recordings() -> None:
    """Of four recordings of 2 to 14 s in six minutes, 89 % of the samples had been lost, and the FIFO was to be read."""
    lasts = [100, 500, 640, 660]
    starts_s = [0.0, 5.5, 194.0, 333.0]
    t_s = np.concatenate([start + np.arange(n) / 50.0 for start, n in zip(starts_s, lasts, strict=True)])
    y_dps = np.random.default_rng(1).normal(0, 0.05, (t_s.size, 3))
    (told,) = check(make_session(make_run(t_s, y_dps, table_rate_dps=0.0, rate_hz=50.0)))
    assert told.code == "samples_lost"
    assert told.text.startswith("For 308.3 s in 3 pauses, most 179 s after 15.48 s, there is no sample")
    cuts = re.findall(r"--run \w:([\d.]*)s?:([\d.]*)s?", told.text)
    found = [int(np.sum((t_s >= float(a)) & (t_s < float(b or np.inf)))) for a, b in cuts]
    assert found == lasts
    few = np.ones(t_s.size, dtype=bool)
    few[120:580] = False  # what the link let through now and then is no recording
    (told,) = check(make_session(make_run(t_s[few], y_dps[few], table_rate_dps=0.0, rate_hz=50.0)))
    assert "in 3 pauses" not in told.text


@pytest.mark.parametrize("gap_s", [0.0, 6.28])
def test_a_gap_between_bursts_is_told_and_makes_no_other_rate(gap_s: float) -> None:
    """Four samples 1 ms apart every 22 ms: the rate that import wrote was called wrong, and the gap was not told."""
    number = np.arange(4000)
    t_s = number // 4 * 0.022 + number % 4 * 0.00104
    t_s[800:] += gap_s
    y_dps = np.random.default_rng(1).normal(0, 0.05, (t_s.size, 3))
    rate_hz = float(f"{1 / period_s(t_s):.5g}")
    told = check(make_session(make_run(t_s, y_dps, table_rate_dps=0.0, rate_hz=rate_hz)))
    assert [w.code for w in told] == ["samples_lost"] * (gap_s > 0)
    assert all("6.3 s after 4.381 s" in w.text for w in told)


@pytest.mark.parametrize("kind", ["ms", "jitter", "ticks", "late"])
def test_uneven_stamps_are_no_lost_samples(kind: str) -> None:
    rng = np.random.default_rng(4)
    rate_hz = 100.0 if kind == "ticks" else 145.0
    true_s = np.arange(6000) / rate_hz
    late = rng.random(6000) < 0.01
    t_s = {
        "ms": np.round(true_s, 3), "jitter": true_s + rng.uniform(-0.3, 0.3, 6000) / rate_hz,
        "ticks": np.floor(true_s / 0.008 + 1e-9) * 0.008, "late": true_s + np.where(late, 0.7, 0.0) / rate_hz,
    }[kind]  # fmt: skip
    assert check(pair(t_s, rate_hz=rate_hz, across=False)) == []


@pytest.mark.parametrize("rate_dps", [30.0, 72.0, 150.0])
@pytest.mark.parametrize("seconds", [5.0, 10.0, 33.0])
def test_gravity_that_turns_about_the_axis_contradicts_nothing(rate_dps: float, seconds: float) -> None:
    t_s = np.arange(int(seconds * 100)) / 100.0
    assert check(pair(t_s, rate_dps)) == []


@pytest.mark.parametrize("across", [True, False])
def test_the_unit_of_a_turning_acceleration(across: bool) -> None:
    told = check(pair(np.arange(1000) / 100.0, acc_unit=9.80665, across=across))
    assert [w.code for w in told] == ["accel_unit"]
    assert "9.8" in told[0].text


@pytest.mark.parametrize(("pause_s", "scale", "told"), [(1.0, 1.0, 0), (1.0, 1.4, 1), (0.0, 1.4, 0), (1.0, 9.80665, 1)])
def test_acceleration_is_judged_where_a_moving_sensor_is_quiet(pause_s: float, scale: float, told: int) -> None:
    """A hand shakes the sensor so that |a| is far from gravity, with a pause in each run or without any."""
    rng, t_s = np.random.default_rng(3), np.arange(2000) / 100.0
    moves = t_s > pause_s
    rate = np.where(moves, 200 * np.sin(8 * t_s) + 150 * np.sin(13 * t_s), 0.0)
    acc = scale * (np.array([0.0, 0.0, 1.0]) + 0.9 * moves[:, None] * np.sin(np.outer(t_s, [20.0, 27.0, 31.0])))
    gyro = np.column_stack([0 * rate, 0 * rate, rate]) + rng.normal(0, 0.05, (2000, 3))
    columns = {f"a{axis}_g": acc[:, i] + rng.normal(0, 0.003, 2000) for i, axis in enumerate("xyz")}
    run = make_run(t_s, gyro, rate_ref_dps=rate + rng.normal(0, 0.02, 2000), **columns)
    assert [w.code for w in check(make_session(run))] == ["accel_unit"] * told


@pytest.mark.parametrize(("size_g", "told"), [(38.0, ["accel_unit"]), (2.0, [])])
def test_an_acceleration_beyond_any_motion_is_told_of_a_rest_that_moved(size_g: float, told: list[str]) -> None:
    """38 g in a run declared at rest, in which the sensor turned, were no contradiction."""
    rng, t_s = np.random.default_rng(3), np.arange(2000) / 100.0
    gyro = np.column_stack([0 * t_s, 47 + 30 * np.sin(3 * t_s), 80 * np.sin(2 * t_s)]) + rng.normal(0, 0.05, (2000, 3))
    acc = size_g * np.column_stack([np.sin(2 * t_s), np.cos(2 * t_s), 0 * t_s]) + rng.normal(0, 0.01, (2000, 3))
    run = make_run(t_s, gyro, table_rate_dps=0.0, **dict(zip(("ax_g", "ay_g", "az_g"), acc.T, strict=True)))
    codes = [w.code for w in check(make_session(run))]
    assert "not_at_rest" in codes
    assert [code for code in codes if code == "accel_unit"] == told


def test_a_face_that_gravity_contradicts_in_another_unit() -> None:
    session = pair(np.arange(1000) / 100.0, acc_unit=9.80665, across=False)
    rest = replace(session.runs[0], table_rate_dps=0.0, face="down", index=2, file="rest.csv")
    rest = replace(rest, frame=rest.table.with_columns(gz_dps=rest.table["gz_dps"] - 72.0 * 1.004))
    told = check(session.with_runs([*session.runs, rest]))
    assert [(w.code, w.file) for w in told] == [("face_wrong", "rest.csv"), ("accel_unit", None)]


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us")])
@pytest.mark.parametrize("stated", ["true", "by the times"])
def test_times_in_another_unit_are_told_by_that_unit(factor: float, unit: str, stated: str) -> None:
    t_s = np.arange(800) / 100.0 * factor
    (told,) = (w for w in check(pair(t_s, rate_hz=100.0 if stated == "true" else 100.0 / factor)) if w.code == "sample_rate")
    assert f"Is t_s in {unit}?" in told.text
    assert f"--map t_s=COLUMN:{unit}" in told.text
    assert ("session.toml says" in told.text) == (stated == "true")


def test_a_log_of_once_a_second_by_a_slow_clock_is_in_seconds() -> None:
    """PX4 logs its gyroscope so by default; it was asked for as milliseconds where its clock was 0.015 % slow."""
    t_s = np.arange(60) * 1.00015
    assert not [w for w in check(pair(t_s, rate_hz=1 / 1.00015, across=False)) if w.code == "sample_rate"]
    slow_s = np.arange(60) * 2.0
    assert [w for w in check(pair(slow_s, rate_hz=0.5, across=False)) if w.code == "sample_rate"]


@pytest.mark.parametrize("rates", [(100.0, 10.0), (25.0, 100.0), (100.0, 20.0, 100.0)])
@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_a_logger_that_takes_another_rate_is_told(rates: tuple[float, ...], jitter: float) -> None:
    steps_s = np.concatenate([np.full(300, 1 / hz) for hz in rates])
    steps_s *= 1 + jitter * np.random.default_rng(1).uniform(-1, 1, steps_s.size)
    t_s = np.concatenate([[0.0], np.cumsum(steps_s)])
    (told,) = check(pair(t_s, rate_hz=steps_s.size / t_s[-1], across=False))
    assert told.code == "sample_rate"
    named = re.search(r"took (\S+) samples a second up to (\S+) s, and (\S+) after that(, and changes 1 times)?", told.text)
    assert named is not None
    assert abs(float(named[1]) / rates[0] - 1) < 0.02
    assert abs(float(named[3]) / rates[1] - 1) < 0.02
    assert abs(float(named[2]) - t_s[300]) < 1.5 / min(rates)
    assert bool(named[4]) == (len(rates) > 2)


def polled(rng: np.random.Generator, hz: float, count: int) -> Array:
    """Steps [count], s, of a program that samples when it comes to it, ``hz`` times a second in the mean."""
    steps_s = rng.gamma(2.0, size=count) + 0.3
    return np.asarray(steps_s / steps_s.mean() / hz)


@pytest.mark.parametrize(
    ("early_hz", "late_hz", "early"), [(75.0, 9.7, 2500), (380.0, 86.6, 600), (20.0, 60.0, 1000), (80.0, 65.0, 2000)]
)
def test_a_program_whose_steps_scatter_is_told_to_have_gone_over_to_another_rate(
    early_hz: float, late_hz: float, early: int
) -> None:
    """A rate of 19 Hz was stated as sure for one of 75 Hz at first and 9.7 Hz later."""
    rng = np.random.default_rng(3)
    t_s = np.concatenate([[0.0], np.cumsum(np.concatenate([polled(rng, early_hz, early), polled(rng, late_hz, 1800)]))])
    told = [w.text for w in check(pair(t_s, rate_hz=(t_s.size - 1) / t_s[-1], across=False)) if w.code == "sample_rate"]
    if max(early_hz, late_hz) < 1.5 * min(early_hz, late_hz):
        assert not told
        return
    named = re.search(r"took (\S+) samples a second up to (\S+) s, and (\S+) after that\.", told[0])
    assert named is not None
    assert float(named[1]) == pytest.approx(early_hz, rel=0.1)
    assert float(named[3]) == pytest.approx(late_hz, rel=0.1)
    assert abs(float(named[2]) - t_s[early]) < 20 / min(early_hz, late_hz)


def test_a_damaged_packet_of_the_accelerometer_is_told_and_no_effect_sees_it() -> None:
    """Three packets of 26 g turned gravity in the means of their seconds; a motion as large is none."""
    rng = np.random.default_rng(2)
    t_s = np.arange(3000) / 100.0
    acc_g = {name: g + rng.normal(0, 0.01, t_s.size) for name, g in (("ax_g", 0.0), ("ay_g", 0.0), ("az_g", 1.0))}
    gyro_dps = rng.normal(0, 0.05, (t_s.size, 3))
    damaged = {name: values.copy() for name, values in acc_g.items()}
    for name, size_g in (("ax_g", -26.0), ("az_g", 26.0)):
        damaged[name][1200:1203] = size_g
    run = make_run(t_s, gyro_dps, table_rate_dps=0.0, **damaged)
    (told,) = [w for w in check(make_session(run)) if w.code == "line_damaged"]
    assert told.text.startswith("3 accelerations stand alone out of those beside, by up to 26")
    seen = acceleration_g(run)
    assert seen is not None
    assert np.abs(seen - [0.0, 0.0, 1.0]).max() < 0.1
    assert not pose_changes([run])
    shaken = acc_g | {"ax_g": acc_g["ax_g"] + 9.0 * np.sin(40 * t_s) * (np.abs(t_s - 12) < 1)}
    assert not [w for w in check(make_session(make_run(t_s, gyro_dps, **shaken))) if w.code == "line_damaged"]


@pytest.mark.parametrize(("rate_hz", "slow"), [(0.935, True), (0.98, False)])
def test_a_log_of_less_than_once_a_second_is_told(rate_hz: float, slow: bool) -> None:
    """One of 0.935 Hz was not, and numpy's own warnings reached the user."""
    rng = np.random.default_rng(3)
    t_s = np.arange(354) / rate_hz + rng.uniform(0, 0.1, 354)
    gyro = (np.array([0.05, -0.05, -0.1]) + rng.normal(0, 0.05, (354, 3)) // 0.061) * 0.061
    gyro[:, 0] = 0.061
    gyro[::50, 0] = 0.122
    session = make_session(make_run(t_s, gyro, table_rate_dps=0.0, rate_hz=rate_hz))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told = [w.text for w in check(session) if w.code == "sample_rate"]
    assert len(told) == slow
    assert all("ms?" in text for text in told)
