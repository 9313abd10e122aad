"""Errors that no effect of the library describes, or that two of them describe alike, and that were given one wrong name."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.sets import choose
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.power_band import hump
from gyrocal.effects import base
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Array, Session
from known import ON_X, ON_Y, ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

RATE_HZ = 50.0


def swings(error_dps: float, clock: float = 0.0) -> Session:
    """Turns by hand with an encoder; the mount gives way against its friction by ``error_dps``."""
    rng = np.random.default_rng(3)
    t_s = np.arange(round(20 * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(5):
        phase = rng.uniform(0, 6)
        rate, seen = (
            60 * np.sin(2 * np.pi * 0.23 * at_s + phase) + 30 * np.sin(2 * np.pi * 0.41 * at_s + 2 * phase)
            for at_s in (t_s, (1 + clock) * t_s)
        )
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.03, (t_s.size, 3))
        gyro[:, 2] += 1.003 * seen + error_dps * np.sign(np.gradient(rate, t_s))
        runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", day=1 + cycle % 2, rate_hz=RATE_HZ, rate_ref_dps=rate))
    return make_session(*runs)


def test_friction_of_the_mount_is_unknown_and_no_error_of_a_clock() -> None:
    """It follows the sign of the acceleration, where a lag follows the acceleration."""
    found = diagnose(swings(-0.1), ON_Z)
    assert found.verdict == "unknown"
    assert found.comparison.where[0].against == "direction"
    assert found.comparison.where[0].amplitude_dps / np.sqrt(2) == pytest.approx(0.1, rel=0.1)


def test_friction_beside_an_error_of_the_clock_brings_no_lag_into_the_set() -> None:
    """A set was chosen by its gain alone, and a lag that friction outdoes came in with the error of the clock."""
    session = swings(0.05, clock=1e-3)
    current = Current.of(measure(session, ON_Z), "z")
    assert [e.id for e in choose(current, [base.effect("clock_error"), base.effect("lag")], 20).certain] == ["clock_error"]


@pytest.mark.parametrize("times_rate", [False, True])
def test_a_bump_in_each_run_is_no_ripple_of_the_table(times_rate: bool) -> None:
    """A free phase in each run of a turn and a half follows any course, and the bump comes at the same time in each."""
    rng = np.random.default_rng(11)
    t_s = np.arange(round(7 * RATE_HZ)) / RATE_HZ
    runs = []
    for k in range(8):
        rate_dps = 78.0 if k % 2 else -78.0
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.03, (t_s.size, 3))
        bump = 0.06 * np.exp(-(((t_s - 3) / 1.2) ** 2))
        gyro[:, 2] += rate_dps + bump * (np.sign(rate_dps) if times_rate else 1.0)
        face = "up" if k % 2 else "down"
        runs.append(make_run(t_s, gyro, scenario=f"s{k // 2}", rate_hz=RATE_HZ, table_rate_dps=78.0, face=face))
    found = diagnose(make_session(*runs), ON_Z)
    assert found.verdict == "unknown"
    assert [c.effect.id for c in found.candidates if c.decision == "add"] == []


def at_one_rate(leak: float) -> Session:
    """Each power cycle face up and face down at 78 deg/s, without an accelerometer."""
    rng = np.random.default_rng(5)
    t_s = np.arange(round(10 * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(5):
        offset = rng.normal(0, 0.01, 3)
        for face, rate in (("up", 78.0), ("down", -78.0)):
            gyro = rng.normal(offset, 0.03, (t_s.size, 3)) + np.array([leak * rate, 0.0, 1.002 * rate])
            runs.append(make_run(t_s, gyro, face=face, scenario=f"s{cycle}", day=1 + cycle % 2, rate_hz=RATE_HZ))
    return make_session(*runs)


def test_a_leak_that_changes_with_the_face_may_be_gravity_s() -> None:
    best = diagnose(at_one_rate(0.002), ON_X).best
    assert best is not None
    assert (best.axis, set(best.group)) == ("x", {"misalignment", "g_sensitivity"})


def test_a_leak_too_large_for_gravity_is_misalignment_alone() -> None:
    """2 % of 78 deg/s would be 1.6 deg/s per g."""
    found = diagnose(at_one_rate(0.02), ON_X)
    assert found.verdict == "add"
    assert found.best is not None
    assert found.best.effect.id == "misalignment"


def test_one_run_cannot_tell_a_table_that_spins_up_from_a_sensor_that_warms_up() -> None:
    rng = np.random.default_rng(6)
    t_s = np.arange(round(90 * RATE_HZ)) / RATE_HZ
    gyro = rng.normal(0, 0.02, (t_s.size, 3))
    gyro[:, 2] += 1.002 * 78.0 + 0.1 * np.exp(-(3.0 + t_s) / 5)
    best = diagnose(make_session(make_run(t_s, gyro, power_on_s=3.0, rate_hz=RATE_HZ)), ON_Z).best
    assert best is not None
    assert {"warmup", "spin_up"} <= set(best.group)


def sawtooth(t_s: Array, rng: np.random.Generator, period_s: float) -> Array:
    """From a half to minus a half in cycles of random length, [n]."""
    edges = np.cumsum(period_s * rng.lognormal(0, 0.3, int(4 * t_s[-1] / period_s))) - period_s
    cycle = np.searchsorted(edges, t_s, side="right")
    return 0.5 - (t_s - np.concatenate([[-period_s], edges])[cycle]) / np.diff(edges, prepend=-period_s, append=1e9)[cycle]


def test_a_drive_that_sticks_and_slips_is_no_colour_of_the_noise() -> None:
    """Behind a low-pass that correlates means over 0.1 s, samples would hardly scatter within 0.1 s."""
    rng = np.random.default_rng(7)
    t_s = np.arange(round(120 * 100.0)) / 100.0
    gyro = rng.normal(0, 0.09, (t_s.size, 3))
    gyro[:, 2] += 78.0 + 0.08 * sawtooth(t_s, rng, 0.9)
    fitted = fit(make_session(make_run(t_s, gyro, rate_hz=100.0)), Model.builtin("default"))
    assert not fitted.axes["z"].design.color.neighbours
    found = hump(fitted.axes["z"], "z", alarm=1e-4)
    assert found is not None
    assert found.band_hz is not None
    assert found.band_hz[0] < 1 / 0.9 < 1.2 * found.band_hz[1]
    assert hump(fitted.axes["x"], "x", alarm=1e-3) is None


def ringing(t_s: Array, rng: np.random.Generator) -> Array:
    """Noise in a band of 1.5 Hz about 41 Hz, rms 0.03."""
    step = t_s[1] - t_s[0]
    radius = np.exp(-np.pi * 1.5 * step)
    ring = lfilter([1], [1, -2 * radius * np.cos(2 * np.pi * 41 * step), radius**2], rng.normal(size=4000 + t_s.size))[4000:]
    return 0.03 * ring / np.std(ring)


def steady(t_s: Array, rng: np.random.Generator) -> Array:
    return 0.02 * np.sin(2 * np.pi * 41 * t_s + rng.uniform(0, 6))


def decaying(t_s: Array, rng: np.random.Generator) -> Array:
    """A mount that rings after each start of the table."""
    return 0.06 * np.exp(-t_s / 1.2) * np.sin(2 * np.pi * 41 * t_s + rng.uniform(0, 6))


@pytest.mark.parametrize(
    ("wave", "verdict", "name"), [(ringing, "unknown", None), (decaying, "unknown", None), (steady, "add", "vibration_tone")]
)
def test_a_line_is_a_vibration_only_if_it_keeps_its_phase_and_size(
    wave: Callable[[Array, np.random.Generator], Array], verdict: str, name: str | None
) -> None:
    """Runs are so short that a resonance has a line in their spectrum, and it was named a vibration."""
    rng = np.random.default_rng(8)
    t_s = np.arange(round(4 * 200.0)) / 200.0
    runs = []
    for cycle in range(12):
        gyro = rng.normal(0, 0.02, (t_s.size, 3))
        gyro[:, 2] += 78.0 + wave(t_s, rng)
        runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", day=1 + cycle % 2, rate_hz=200.0))
    found = diagnose(make_session(*runs), ON_Z)
    assert (found.verdict, found.best and found.best.effect.id) == (verdict, name)
    assert (found.comparison.where[0].axis, found.comparison.where[0].against) == ("z", "frequency")


def switching(t_s: Array, rng: np.random.Generator) -> Array:
    """A heater's two-point control: on and off for times that differ by up to 40 %."""
    edges = np.cumsum(0.8 * rng.uniform(0.6, 1.4, 60)) - rng.uniform(5, 10)
    return 0.04 * (-1.0) ** np.searchsorted(edges, t_s)


def third_of_a_turn(t_s: Array, rng: np.random.Generator) -> Array:
    return 0.04 * np.cos(np.radians(3 * 78 * t_s) + rng.uniform(0, 6))


@pytest.mark.parametrize(("wave", "verdict"), [(switching, "unknown"), (third_of_a_turn, "add")])
def test_a_wave_of_the_table_keeps_its_phase(wave: Callable[[Array, np.random.Generator], Array], verdict: str) -> None:
    """At one rate and an unknown angle, switching with nearly the period of a whole order was named a tone of the table."""
    rng, t_s, runs = np.random.default_rng(15), np.arange(14 * 50) / 50, []
    for cycle in range(9):
        gyro = rng.normal(0, 0.03, (t_s.size, 3))
        gyro[:, 2] += 78.0 + wave(t_s, rng)
        runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", day=1 + cycle % 3, rate_hz=50.0))
    found = diagnose(make_session(*runs), ON_Z)
    assert found.verdict == verdict
    assert verdict == "unknown" or (found.best is not None and found.best.effect.id in ("table_ripple", "order_tone"))


def test_a_drift_within_each_run_excludes_a_leak_of_the_rate() -> None:
    """Face down always comes later, so that both change with the face. A drift also shows in each run."""
    rng = np.random.default_rng(9)
    t_s = np.arange(round(14 * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(9):
        offset = rng.normal(0, 0.002, 3)
        for start_s, face, rate in ((0.0, "up", 78.0), (16.0, "down", -78.0)):
            gyro = rng.normal(offset, 0.03, (t_s.size, 3)) + np.array([0.0, 0.0, 1.002 * rate])
            gyro[:, 0] += 5e-4 * (start_s + t_s)
            of = {"face": face, "scenario": f"s{cycle}", "day": 1 + cycle % 3, "power_on_s": 10.0 + start_s}
            runs.append(make_run(t_s, gyro, rate_hz=RATE_HZ, **of))
    best = diagnose(make_session(*runs), ON_X).best
    assert best is not None
    assert best.group == ("drift",)


def test_what_a_better_one_explains_is_not_named_beside_it() -> None:
    """The error |rate| contains a square of the rate. The candidate with the largest gain, a tone, says nothing of either."""
    rng = np.random.default_rng(21)
    t_s, runs = np.arange(round(8 * RATE_HZ)) / RATE_HZ, []
    for cycle, rate in enumerate([-150.0, -78.0, -30.0, 0.0, 30.0, 78.0, 150.0] * 2):
        gyro = rng.normal(0, 0.03, (t_s.size, 3))
        tone = 0.1 * np.cos(2 * np.pi * 17 * t_s + rng.uniform(0, 6))
        gyro[:, 2] += 1.002 * rate + 0.001 * abs(rate) + tone
        runs.append(make_run(t_s, gyro, table_rate_dps=rate, scenario=f"s{cycle}", day=1 + cycle % 3, rate_hz=RATE_HZ))
    named = {c.effect.id for c in diagnose(make_session(*runs), ON_Z).candidates if c.decision == "add"}
    assert named == {"vibration_tone", "scale_asymmetry"}


def turned(wave: Callable[[Array], Array], count: int = 10, length_s: float = 40.0, axis: int = 2) -> Session:
    """Runs at 78 deg/s, of almost nine turns each, with an error over the table's angle, radians, that begins anywhere."""
    rng = np.random.default_rng(5)
    t_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
    runs = []
    for k in range(count):
        face = "down" if k % 2 else "up"
        rate_dps = -78.0 if k % 2 else 78.0
        gyro = rng.normal(rng.normal(0, 0.005, 3), 0.03, (t_s.size, 3))
        gyro[:, 2] += rate_dps
        gyro[:, axis] += wave(np.deg2rad(78.0 * t_s + rng.uniform(0, 360)))
        runs.append(make_run(t_s, gyro, scenario=f"s{k // 2}", rate_hz=RATE_HZ, face=face))
    return make_session(*runs)


def harmonics(sizes_dps: dict[float, float]) -> Callable[[Array], Array]:
    def wave(angle: Array) -> Array:
        return np.sum([size * np.cos(k * angle + 2.0 * k * k) for k, size in sizes_dps.items()], axis=0)

    return wave


@pytest.mark.parametrize("width_deg", [8.0, pytest.param(15.0, marks=pytest.mark.wide)])
def test_a_pulse_once_a_turn_is_no_ripple_and_its_harmonics_are_no_vibration(width_deg: float) -> None:
    """A magnet beside the table has lines at many whole numbers per turn; a ripple of four orders took the first of them."""

    def pulse(angle: Array) -> Array:
        return np.asarray(0.1 * np.exp(-0.5 * ((np.mod(np.rad2deg(angle), 360) - 180) / width_deg) ** 2))

    found = diagnose(turned(pulse), ON_Z)
    assert found.verdict == "unknown"
    assert found.unknown is not None
    assert found.unknown["against"] in ("table_angle", "order")
    assert [c.effect.id for c in found.candidates if c.decision in ("add", "suggest")] == []


@pytest.mark.parametrize(
    ("count", "length_s", "size_dps"), [(2, 160.0, 0.015), pytest.param(4, 75.0, 0.012, marks=pytest.mark.wide)]
)
def test_a_weak_pulse_once_a_turn_is_no_tone_of_one_order(count: int, length_s: float, size_dps: float) -> None:
    """None of its lines but the first stands out among all orders."""

    def pulse(angle: Array) -> Array:
        return np.asarray(size_dps * np.exp(-0.5 * ((np.mod(np.rad2deg(angle), 360) - 180) / 15.0) ** 2))

    found = diagnose(turned(pulse, count, length_s, axis=1), ON_Y)
    assert [c.effect.id for c in found.candidates if c.decision == "add"] == []


@pytest.mark.parametrize(("order", "named"), [(1.0, True), pytest.param(2.0, True, marks=pytest.mark.wide), (1.08, False)])
def test_at_one_rate_a_wave_beside_a_whole_number_per_turn_is_not_fixed_to_the_table(order: float, named: bool) -> None:
    found = diagnose(turned(harmonics({order: 0.012}), 12, 17.0, axis=1), ON_Y)
    assert ("order_tone" in [c.effect.id for c in found.candidates if c.decision == "add"]) is named


@pytest.mark.parametrize(("amplitude", "named"), [(2e-5, False), (2e-4, True)])
def test_a_wave_smaller_than_any_table_makes_is_suggested(amplitude: float, named: bool) -> None:
    """A quiet sensor shows it, but its size says that something else is there."""
    rng, t_s, runs = np.random.default_rng(6), np.arange(40 * 50) / 50, []
    for k in range(10):
        gyro = rng.normal(rng.normal(0, 0.005, 3), 0.01 if named else 0.001, (t_s.size, 3))
        gyro[:, 2] += 78.0 * (1 + amplitude * np.cos(np.deg2rad(78.0 * t_s + rng.uniform(0, 360))))
        runs.append(make_run(t_s, gyro, scenario=f"s{k}", rate_hz=50.0))
    ripple = next(c for c in diagnose(make_session(*runs), ON_Z).candidates if c.effect.id == "table_ripple")
    assert ripple.decision == ("add" if named else "suggest")


@pytest.mark.wide
@pytest.mark.parametrize(
    "sizes_dps", [pytest.param(dict.fromkeys((1, 2, 3, 4), 0.02), marks=pytest.mark.wide), {1: 0.03, 5: 0.03}]
)
def test_a_ripple_of_many_orders_is_named_also_beside_the_teeth_of_a_gear(sizes_dps: dict[float, float]) -> None:
    found = diagnose(turned(harmonics(sizes_dps)), ON_Z)
    assert "table_ripple" in [c.effect.id for c in found.candidates if c.named]


@pytest.mark.wide
def test_a_vibration_between_the_orders_is_named_beside_a_ripple() -> None:
    """Its frequency is no whole number per turn, also where the table turns at one rate only."""
    found = diagnose(turned(harmonics({1: 0.03, 7.4: 0.03})), ON_Z)
    assert {c.effect.id for c in found.candidates if c.decision == "add"} >= {"table_ripple", "vibration_tone"}


def test_a_course_that_repeats_in_each_run_is_not_taken_for_a_drift() -> None:
    """A drift of four seconds was fitted to a sawtooth of ten periods a run, and the model was adequate beside it."""
    rng = np.random.default_rng(8)
    t_s = np.arange(round(83 * RATE_HZ)) / RATE_HZ
    runs = []
    for k in range(5):
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.045, (t_s.size, 3))
        gyro[:, 2] += 0.087 * (np.mod(t_s / 8.45, 1.0) - 0.5)
        runs.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{k}", rate_hz=RATE_HZ))
    found = measure(make_session(*runs))
    assert (found.where[0].axis, found.where[0].against) == ("z", "time")
    assert "in the same course in each run" in found.where[0].note
    # cosines of 48 half periods hold two harmonics of the sawtooth, whose powers fall as 1/k^2
    expected_dps = 0.087 / np.sqrt(12) * np.sqrt((1 + 1 / 4) / (np.pi**2 / 6))
    assert found.where[0].amplitude_dps / np.sqrt(2) == pytest.approx(expected_dps, rel=0.05)
