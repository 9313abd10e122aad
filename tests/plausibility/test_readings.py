"""Readings by themselves: what stands still, what is cut off, how a run begins; at any sample rate and size of a count."""

from dataclasses import replace

import numpy as np
import pytest

from by_hand import turned_by
from gyrocal.calibration.trust import reading_flags
from gyrocal.diagnosis.residual.reading_tests import reading_fault
from gyrocal.effects.bias_jumps import jumps
from gyrocal.plausibility import check
from gyrocal.plausibility.readings import clip_level_dps
from gyrocal.recording.session import AXES, Session
from make_runs import Array, make_run, make_session


def rounded(values: Array, count_dps: float) -> Array:
    return np.round(values / count_dps) * count_dps


def pair(
    rate_hz: float = 100.0, seconds: float = 20.0, rate_dps: float = 78.0, noise_dps: float = 0.05, count_dps: float = 0.00875
) -> list[Array]:
    """Readings of a run face up and one face down, each [n, 3]."""
    rng = np.random.default_rng(5)
    n = int(seconds * rate_hz)
    return [
        rounded(rng.normal([0.3, -0.2, 0.4 + sign * rate_dps * 1.004], noise_dps, (n, 3)), count_dps) for sign in (1.0, -1.0)
    ]


def recorded(readings: list[Array], rate_hz: float = 100.0, rate_dps: float = 78.0, **fields: float | None) -> Session:
    runs = [
        make_run(np.arange(len(y)) / rate_hz, y, table_rate_dps=rate_dps, face=face, rate_hz=rate_hz)
        for y, face in zip(readings, ("up", "down"), strict=False)
    ]
    return make_session(*runs, **fields)


def swing(rate_hz: float, lag_s: float = 0.0, noise_dps: float = 0.05, count_dps: float = 0.01) -> tuple[Array, Array, Array]:
    """Times, true rate and readings about z of a platform that swings; the sensor's filter starts at the first rate."""
    rng = np.random.default_rng(6)
    t_s = np.arange(int(20 * rate_hz)) / rate_hz
    rate = 60 * np.sin(5.5 * t_s + 0.2) + 25 * np.sin(2.1 * t_s + 1.0)
    y = rate.copy()
    for i in range(1, y.size if lag_s else 0):
        y[i] = y[i - 1] + (1 - np.exp(-1 / rate_hz / lag_s)) * (rate[i] - y[i - 1])
    noise = rng.normal(0, noise_dps, (t_s.size, 3))
    return t_s, rate, rounded(np.column_stack([0 * y, 0 * y, y * 1.01 + 0.5]) + noise, count_dps)


@pytest.mark.parametrize(("rate_hz", "standing"), [(10.0, 5), (10.0, 40), (25.0, 21), (50.0, 40), (50.0, 60), (100.0, 55)])
@pytest.mark.parametrize("rate_dps", [0.0, 78.0])
def test_half_a_second_at_any_sample_rate(rate_hz: float, standing: int, rate_dps: float) -> None:
    readings = pair(rate_hz, rate_dps=rate_dps)
    readings[0][30 : 30 + standing] = readings[0][30]
    told = check(recorded(readings, rate_hz, rate_dps))
    expected = 5 if standing == 5 else 0  # five equal readings of noise are too few to exclude chance
    assert [w.code for w in told] == ([] if expected else ["constant_reading"] * 3)


@pytest.mark.parametrize(("rate_hz", "standing"), [(10.0, 9), (25.0, 15), (100.0, 50)])
def test_standing_while_the_rate_moves(rate_hz: float, standing: int) -> None:
    """Counts so coarse that noise does not show: the true rate alone tells."""
    t_s, rate, y = swing(rate_hz, noise_dps=0.01, count_dps=0.1)
    y[40 : 40 + standing, 2] = y[40, 2]
    told = check(make_session(make_run(t_s, y, rate_ref_dps=rate, rate_hz=rate_hz)))
    assert [(w.code, w.axis) for w in told if w.blocking] == [("constant_reading", "z")]


@pytest.mark.parametrize("hung", [False, True])
def test_a_pause_of_a_movement_in_coarse_counts_is_no_hung_sensor(hung: bool) -> None:
    """The movement and the noise of the reference were taken for noise that would show in each count."""
    rng, t_s = np.random.default_rng(8), np.arange(6000) / 50.0
    rate = 60 * np.sin(2.3 * t_s) * np.clip(np.sin(0.35 * t_s), 0.0, None) - 0.3
    y = rounded(np.column_stack([0 * rate, 0 * rate, rate + 1.66]) + rng.normal(0.0, 0.017, (t_s.size, 3)), 0.065)
    if hung:
        y[200:240, 2] = y[200, 2]
    told = check(make_session(make_run(t_s, y, rate_ref_dps=rate + rng.normal(0.0, 0.2, t_s.size), rate_hz=50.0)))
    assert [(w.code, w.axis) for w in told if w.blocking] == ([("constant_reading", "z")] if hung else [])


@pytest.mark.parametrize(
    ("known", "expected"),
    [({"table_rate_dps": 0.0}, []), ({"table_rate_dps": 78.0}, ["z"]), ({"table_rate_dps": None, "turn_deg": 360.0}, ["z"])],
)
def test_an_axis_that_is_dead_on_a_moving_table_is_told_however_coarse_the_counts_are(
    known: dict[str, float | None], expected: list[str]
) -> None:
    """Noise below half a count says nothing: only the known motion contradicts a constant reading."""
    t_s = np.arange(1000) / 100
    runs = [make_run(t_s, 0.0, face=face, rate_hz=100.0, **known) for face in ("up", "down")]
    assert [w.axis for w in check(make_session(*runs, lsb_dps=1.0)) if w.code == "constant_reading"] == expected


@pytest.mark.parametrize("noise_counts", [0.02, 0.1, 0.2, 0.3, 0.45])
@pytest.mark.parametrize("count_dps", [0.07, 0.1])
@pytest.mark.parametrize("rate_dps", [0.0, 45.0, 614.0])
@pytest.mark.parametrize("fields", [{}, {"full_scale_dps": 2000.0}, {"lsb_dps": 0.01}], ids=["", "range", "count"])
def test_coarse_counts_are_sound(noise_counts: float, count_dps: float, rate_dps: float, fields: dict[str, float]) -> None:
    """Drift over the edge of a count, long stretches in its middle, and a third of the readings at the largest value."""
    readings = pair(200.0, 15.0, rate_dps, 1e-9, 1e-9)
    rng = np.random.default_rng(7)
    for y in readings:
        y += np.linspace(-0.8, 1.3, len(y))[:, None] * count_dps + rng.normal(0, noise_counts * count_dps, y.shape)
    assert check(recorded([rounded(y, count_dps) for y in readings], 200.0, rate_dps, **fields)) == []


def test_a_noisy_reference_is_no_noise_of_the_sensor() -> None:
    t_s, rate, y = swing(208.0, noise_dps=0.005, count_dps=0.1)
    still = np.abs(np.sin(0.3 * t_s)) < 0.5  # the platform rests now and then
    rate, y = np.where(still, 0.0, rate), np.where(still[:, None], 0.5, y)
    noisy = rate + np.random.default_rng(8).normal(0, 0.3, rate.size)
    told = check(make_session(make_run(t_s, rounded(y, 0.1), rate_ref_dps=noisy, rate_hz=208.0)))
    assert [w for w in told if w.axis == "z"] == []


@pytest.mark.parametrize("count_dps", [0.00875, 0.1])
@pytest.mark.parametrize("range_dps", [43.21, 60.0])
def test_a_range_that_nobody_states_is_seen_by_the_true_rate(count_dps: float, range_dps: float) -> None:
    t_s, rate, y = swing(100.0, noise_dps=0.02, count_dps=count_dps)
    (told,) = check(make_session(make_run(t_s, np.clip(y, -range_dps, range_dps), rate_ref_dps=rate)))
    assert (told.code, told.axis) == ("clipped", "z")


@pytest.mark.parametrize("count_dps", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("range_dps", [60.0, 75.0])
def test_few_samples_a_period_do_not_hide_a_range(count_dps: float, range_dps: float) -> None:
    """At 10 Hz the motion between samples passes for noise; and an unclipped swing has no range."""
    t_s, rate, y = swing(10.0, noise_dps=0.02, count_dps=count_dps)
    assert [w for w in check(make_session(make_run(t_s, y, rate_ref_dps=rate))) if w.axis == "z"] == []
    told = check(make_session(make_run(t_s, np.clip(y, -range_dps, range_dps), rate_ref_dps=rate)))
    assert [w.code for w in told if w.axis == "z"] == ["clipped"]


@pytest.mark.parametrize("start", [17, 102, 128])
def test_a_run_that_begins_at_the_end_of_the_range_is_clipped_alone(start: int) -> None:
    t_s, rate, y = swing(50.0, noise_dps=0.02)
    readings = np.clip(y[start:], -60.0, 60.0)
    assert abs(readings[0, 2]) == 60.0
    told = check(make_session(make_run(t_s[: len(readings)], readings, rate_ref_dps=rate[start:])))
    assert [w.code for w in told] == ["clipped"]


@pytest.mark.parametrize("range_dps", [250.0, 333.0])
def test_a_stated_range(range_dps: float) -> None:
    readings = [np.clip(y, -range_dps, range_dps) for y in pair(rate_dps=range_dps * 1.1)]
    told = check(recorded(readings, rate_dps=range_dps * 1.1, full_scale_dps=range_dps))
    assert [(w.code, w.axis) for w in told] == [("clipped", "z")]


def steady(rates_dps: tuple[float, ...], noise_dps: float, count_dps: float, end_dps: float, **fields: float | None) -> Session:
    """Two power cycles of runs at ``rates_dps``, face up and face down, clipped at ``end_dps``."""
    rng = np.random.default_rng(3)
    runs = []
    for i, (cycle, rate_dps) in enumerate((c, r) for c in range(2) for r in (*rates_dps, *(-r for r in rates_dps))):
        y = rng.normal([0.3, -0.2, 0.02 + 0.01 * i + rate_dps * 1.002], noise_dps, (800, 3))
        y = np.clip(rounded(y, count_dps), -end_dps, end_dps)
        face = "up" if rate_dps >= 0 else "down"
        runs.append(make_run(np.arange(800) / 100, y, table_rate_dps=abs(rate_dps), face=face, scenario=f"{cycle}"))
    return make_session(*runs, **fields)


@pytest.mark.parametrize("stated_dps", [None, 250.0, 2000.0])
@pytest.mark.parametrize(
    ("rates_dps", "noise_dps", "count_dps", "end_dps"),
    [
        ((20.0, 60.0, 120.0), 0.05, 0.01, 100.0),  # the noise at the fastest rates is cut off as a whole
        ((20.0, 60.0, 120.0), 0.5, 0.01, 120.0),  # and in part
        ((20.0, 60.0, 120.0), 0.02, 0.07, 100.03),  # counts that hide the noise
        ((0.0, 78.0), 0.05, 0.01, 60.0),  # one rate beside the rests
        ((78.0,), 0.05, 0.01, 60.0),  # nothing else
    ],
)
def test_a_range_below_the_stated_one_is_told_by_the_readings(
    rates_dps: tuple[float, ...], noise_dps: float, count_dps: float, end_dps: float, stated_dps: float | None
) -> None:
    """Equal readings at the end of a range were called a sensor that hung, or a wrong rate."""
    told = check(steady(rates_dps, noise_dps, count_dps, end_dps, full_scale_dps=stated_dps))
    assert [(w.code, w.axis) for w in told] == [("clipped", "z")]
    assert f"at {end_dps:.6g} dps or beyond" in told[0].text


@pytest.mark.parametrize("stated_dps", [250.0, 2000.0])
@pytest.mark.parametrize("range_dps", [10.0, 43.21, 60.0])
def test_a_swing_shows_a_range_below_the_stated_one(range_dps: float, stated_dps: float) -> None:
    t_s, rate, y = swing(100.0, noise_dps=0.02, count_dps=0.00875)
    run = make_run(t_s, np.clip(y, -range_dps, range_dps), rate_ref_dps=rate)
    (told,) = check(make_session(run, full_scale_dps=stated_dps))
    assert (told.code, told.axis) == ("clipped", "z")


@pytest.mark.parametrize("hung", [(4, 5), (10, 11), (4, 10)])
def test_a_sensor_that_hangs_is_not_clipped(hung: tuple[int, int]) -> None:
    """It keeps one value in one power cycle, or another value in another, where the range has one end."""
    sound = steady((20.0, 60.0, 120.0), 0.05, 0.01, 1000.0, full_scale_dps=250.0)
    level_dps = np.random.default_rng(1).normal(120.3, 0.1, 12)
    made = [
        make_run(
            r.t_s, np.column_stack([r.gyro_dps[:, :2], np.full(len(r), np.round(level_dps[hung[0] if r.index < 6 else i], 2))])
            if i in hung else r.gyro_dps, table_rate_dps=r.table_rate_dps, face=r.face, scenario=r.scenario, rate_hz=100.0,
        )
        for i, r in enumerate(sound.runs)
    ]  # fmt: skip
    told = {w.code for w in check(make_session(*made, full_scale_dps=250.0))}
    assert "constant_reading" in told
    assert "clipped" not in told


@pytest.mark.parametrize("factor", [2.35, 10.0])
def test_coarse_counts_do_not_hide_a_wrong_scale(factor: float) -> None:
    readings = [y * factor for y in pair(200.0, 15.0, noise_dps=0.02, count_dps=0.07)]
    told = check(recorded(readings, 200.0, lsb_dps=0.07))
    assert [w.code for w in told if w.blocking] == ["scale_implausible"]
    assert "clipped" not in {w.code for w in told}


@pytest.mark.parametrize("value", [0.0, 1.25, 50.0])
def test_a_dead_axis_is_not_cut_off(value: float) -> None:
    readings = pair()
    for y in readings:
        y[:, 2] = value
    assert [(w.code, w.axis) for w in check(recorded(readings))] == [("constant_reading", "z")]


@pytest.mark.parametrize("lag_s", [0.005, 0.02])
@pytest.mark.parametrize("rate_hz", [100.0, 145.0, 416.0])
def test_a_filter_starts_without_its_lag(lag_s: float, rate_hz: float) -> None:
    t_s, rate, y = swing(rate_hz, lag_s)
    assert check(make_session(make_run(t_s, y, rate_ref_dps=rate, rate_hz=rate_hz))) == []
    y[:2, 2] += 40.0
    assert [w.code for w in check(make_session(make_run(t_s, y, rate_ref_dps=rate, rate_hz=rate_hz)))] == ["first_sample"]


@pytest.mark.parametrize(
    ("stated_dps", "end_dps"),
    [(250.0, 32767 * 0.00875), (None, 32767 * 0.00875), (None, 32764 * 0.00875), (250.0, 250.0)],
)  # fmt: skip
def test_the_end_of_the_code_is_the_end_of_the_range(stated_dps: float | None, end_dps: float) -> None:
    """A chip of 250 dps reads up to 286.7 dps. The flag said clipped, no warning did, and a bit of the code was blamed."""
    readings = pair(seconds=8.0)
    readings[0][100:120, 2] = end_dps
    session = recorded(readings, full_scale_dps=stated_dps, lsb_dps=0.00875)
    warned = [w for w in check(session) if w.code == "clipped"]
    assert [w.axis for w in warned] == (["z"] if stated_dps or end_dps > 250 else [])
    assert warned[0].text.startswith(f"20 readings of z are at {end_dps:.6g} dps")
    assert reading_fault(session, "z", 1e-3) is None


@pytest.mark.parametrize("lsb_dps", [1 / 131, None])
def test_both_ends_of_a_word_with_a_sign_are_clipped(lsb_dps: float | None) -> None:
    """The last code above zero is 32767, the first one below is -32768: only the second was counted."""
    t_s = np.arange(4000) / 100
    codes = np.clip(np.rint(131 * 300 * np.sin(t_s)) + np.random.default_rng(5).integers(-3, 4, t_s.size), -32768, 32767)
    y = np.column_stack([np.zeros(t_s.size), np.zeros(t_s.size), codes / 131])
    y[:, :2] += rounded(np.random.default_rng(6).normal(0, 0.1, (t_s.size, 2)), 1 / 131)
    at_ends = int(np.sum(codes == 32767) + np.sum(codes == -32768))
    session = make_session(make_run(t_s, y, rate_ref_dps=300 * np.sin(t_s)), lsb_dps=lsb_dps)
    (told,) = [w for w in check(session) if w.code == "clipped"]
    assert told.text.startswith(f"{at_ends} readings of z are at 250.13 dps")


def test_few_readings_at_the_last_codes_of_a_word_are_clipped_where_nothing_is_stated() -> None:
    """By hand: the rate is not known, and the grid of the readings alone says which word they are of."""
    one_dps, t_s = 250 / 32768, np.arange(4000) / 100
    codes = np.rint(np.random.default_rng(5).normal(0, 20, (t_s.size, 3)) + 30000 * np.sin(t_s)[:, None]).astype(int)
    turning = make_session(make_run(t_s, codes * one_dps, table_rate_dps=0.0))
    assert clip_level_dps(turning, 2) is None
    codes[100:105, 2], codes[300:303, 2] = -32768, 32767
    assert clip_level_dps(make_session(make_run(t_s, codes * one_dps, table_rate_dps=0.0)), 2) == pytest.approx(32767 * one_dps)


@pytest.mark.parametrize("reading_dps", [240.0, 249.98, 249.99625, 250.0, 260.0])
def test_the_warning_and_the_flag_have_one_notion_of_clipping(reading_dps: float) -> None:
    readings = pair(seconds=8.0)
    readings[1][300, 2] = -rounded(np.array(reading_dps), 0.00875)
    session = recorded(readings, full_scale_dps=250.0, lsb_dps=0.00875)
    flagged = "clipped" in reading_flags(session.runs, "z", 250.0)
    assert ("clipped" in {w.code for w in check(session)}) is flagged
    assert flagged is (reading_dps > 249.99)


@pytest.mark.parametrize(("off", "words"), [(1, "Drop the first sample,"), (2, "Drop the first 2 samples,")])
def test_as_many_first_samples_are_to_be_dropped_as_stand_off(off: int, words: str) -> None:
    readings = pair()
    readings[0][:off, 1] = 5.0
    (told,) = check(recorded(readings))
    assert told.code == "first_sample"
    assert words in told.text


@pytest.mark.parametrize(("off", "words"), [(1, "Drop the last sample ("), (2, "Drop the last 2 samples (")])
def test_last_samples_that_stand_off_are_told(off: int, words: str) -> None:
    """A hand that stopped a recording of two hours made a step of the bias."""
    readings = pair()
    readings[0][-off:, 1] = 5.0
    session = recorded(readings)
    (told,) = check(session)
    assert (told.code, told.axis, told.blocking) == ("last_sample", "y", False)
    assert words in told.text
    assert jumps(session.runs[0], 1) == []
    readings[0][-off:, 1] = readings[0][:off, 1]
    assert check(recorded(readings)) == []


@pytest.mark.parametrize("clips", [True, False])
def test_a_swing_by_hand_that_is_cut_off_in_one_sense_is_told(clips: bool) -> None:
    """Five readings of exactly 500 dps, and none near it: a swing that turns back there has them all below it."""
    session = turned_by([("x", 270.0), ("x", -270.0), ("y", 270.0), ("y", -270.0)])
    runs = []
    for run in session.runs:
        y = rounded(np.minimum(run.gyro_dps[:, 0] * 0.5, 490.0 if clips else 499.0), 1 / 16)
        y[np.argsort(y)[-5:]] = 500.0 if clips else 500.0 - np.arange(5) / 4
        runs.append(replace(run, frame=run.table.with_columns(gx_dps=y)) if run is session.runs[0] else run)
    told = check(session.with_runs(runs))
    assert ("clipped", "x") in [(w.code, w.axis) for w in told] if clips else "clipped" not in [w.code for w in told]


@pytest.mark.parametrize("range_dps", [250.1, 500.0, None])
def test_a_turn_by_hand_that_is_cut_off_is_told(range_dps: float | None) -> None:
    """In counts of a tenth, and so fast that few readings lie just below the end of the range."""
    session = turned_by([("x", 270.0), ("x", -270.0), ("y", 270.0), ("y", -270.0)])
    cut = [np.clip(rounded(run.gyro_dps, 0.1), -(range_dps or np.inf), range_dps or np.inf) for run in session.runs]
    columns = [{f"g{a}_dps": y[:, i] for i, a in enumerate(AXES)} for y in cut]
    runs = [replace(r, frame=r.table.with_columns(**c)) for r, c in zip(session.runs, columns, strict=True)]
    told = check(session.with_runs(runs))
    assert [(w.code, w.axis) for w in told] == ([] if range_dps is None else [("clipped", "x"), ("clipped", "y")])
    assert all(f"{range_dps:g} dps" in w.text and "saturation" not in w.text for w in told)


def test_one_reading_that_makes_the_rms_is_told() -> None:
    """One of -16 dps made the rms of an axis 318 mdps, and its floor 320, and was named nowhere."""
    rng = np.random.default_rng(5)
    y_dps = rng.normal(0, 0.05, (3000, 3))
    quiet = make_session(make_run(np.arange(3000) / 50, y_dps, table_rate_dps=0.0, rate_hz=50.0))
    assert not [w for w in check(quiet) if w.code == "line_damaged"]
    y_dps[165, 2] = -16.26
    (told,) = check(make_session(make_run(np.arange(3000) / 50, y_dps, table_rate_dps=0.0, rate_hz=50.0)))
    assert (told.code, told.axis, told.blocking) == ("line_damaged", "z", False)
    assert "one reading of z is -16.26 dps (at 3.3 s)" in told.text
    y_dps[rng.choice(3000, 40), 2] += 16.0  # a bit that is read wrongly is an effect of its own
    many = make_session(make_run(np.arange(3000) / 50, y_dps, table_rate_dps=0.0, rate_hz=50.0))
    assert not [w for w in check(many) if w.code == "line_damaged"]
