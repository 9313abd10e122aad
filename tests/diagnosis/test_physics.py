"""Effects with a memory, a threshold or a code: each is named where a session shows it, and its error falls."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.levels import Cleaned
from gyrocal.plausibility import check
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_X, ON_Z, add_measured
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers", "tests_alone")]
SIZES = {"shaker": (2, 15.0), "swing": (2, 15.0), "chamber": (2, 700.0), "full": (2, 15.0)}


def session_of(campaign: str, *effects: str, seed: int = 3) -> Session:
    scenarios, seconds = SIZES[campaign]
    return simulate(None, campaign, effects, seed, scenarios=scenarios, seconds=seconds)[0]


@pytest.mark.wide
@pytest.mark.parametrize(
    ("campaign", "spec", "name", "value"),
    [
        ("shaker", "g2_sensitivity:k_dps_per_g2=0.01", "k_dps_per_g2", 0.01),
        ("shaker", "g2_sensitivity:k_dps_per_g2=0,kz_dps_per_g2=0.03", "kz_dps_per_g2", 0.03),
        ("swing", "dead_band:width_dps=0.5", "width_dps", 0.5),
        ("chamber", "thermal_hysteresis:amplitude_dps=-0.05,width_c=10", "amplitude_dps", -0.05),
        ("swing", "byte_fault:bit=7,step_dps=-1.12", "step_dps", -1.12),
        ("full", "byte_fault:bit=7,step_dps=-1.12", "step_dps", -1.12),
    ],
)
def test_what_is_planted_is_named_and_its_error_falls(campaign: str, spec: str, name: str, value: float) -> None:
    session, effect_id = session_of(campaign, spec), spec.partition(":")[0]
    model = ON_Z if (campaign, effect_id) != ("full", "byte_fault") else None  # there, other axes cross the bit
    named = [c for c in diagnose(session, model).candidates if c.decision == "add"]
    assert {c.effect.id for c in named} == {effect_id}
    assert named[0].values[name] == pytest.approx(value, rel=0.1)
    before, after, _ = add_measured(session, model, effect_id)
    axis = named[0].axis
    assert after.per_axis[axis].excess_dps < 0.5 * before.per_axis[axis].excess_dps


@pytest.mark.wide
def test_single_readings_that_lack_a_carry_are_no_jumps() -> None:
    found = diagnose(session_of("swing", "byte_fault:bit=7,step_dps=-1.12,fraction=0.02"), ON_Z)
    assert found.best is not None
    assert {c.effect.id for c in found.candidates if c.decision == "add"} == {"byte_fault"}
    assert found.best.values["bit"] == 7
    assert found.comparison.where[0].note.endswith("each by 128 counts: bit 7 lacks a carry or is of another sample")


@pytest.mark.parametrize("campaign", [*(pytest.param(name, marks=pytest.mark.wide) for name in ("shaker", "swing")), "chamber"])
def test_sessions_without_an_effect_are_quiet(campaign: str) -> None:
    found = diagnose(session_of(campaign, seed=1))
    assert found.verdict == "adequate", (found.unknown, [c.effect.id for c in found.candidates if c.decision == "add"])


def test_vibration_at_rest_contradicts_nothing() -> None:
    assert check(session_of("shaker")) == []


def test_a_first_bad_reading_is_a_warning_and_no_effect() -> None:
    """It made three findings in time and a decay of 0.1 s."""
    session = session_of("full", seed=1)

    def begins_badly(run):  # type: ignore[no-untyped-def]
        gx = run.gyro_dps[:, 0].copy()
        gx[0] += 1.3
        return replace(run, frame=run.table.with_columns(gx_dps=pl.Series(gx)))

    spoiled = session.with_runs(map(begins_badly, session.runs))
    assert [(w.code, w.axis) for w in check(spoiled)] == [("first_sample", "x")]
    found = diagnose(spoiled, ON_X)
    assert found.comparison.where == []
    assert [c.effect.id for c in found.candidates if c.decision in ("add", "suggest")] == []


def turned_by_hand(leak: float) -> Session:
    """Six power cycles: a turn of 360 deg about each axis and a rest; z reads a part of the rate about x."""
    rng = np.random.default_rng(8)
    t_s = np.arange(1500) / 100
    runs = []
    for cycle in range(6):
        bias_dps = rng.normal(0.1, 0.01, 3)
        for axis in ("x", "y", "z", None):
            profile = np.sin(np.pi * np.clip(t_s * rng.uniform(0.08, 0.12), 0, 1)) ** 2
            rate_dps = 0.0 * t_s if axis is None else 360 * profile / np.trapezoid(profile, t_s)
            gyro = rng.normal(0, 0.04, (t_s.size, 3)) + bias_dps
            gyro[:, "xyz".index(axis or "z")] += rate_dps
            gyro[:, 2] += leak * rate_dps * (axis == "x")
            turn_deg = None if axis is None else 360.0
            runs.append(make_run(t_s, gyro, table_rate_dps=0.0, turn_deg=turn_deg, axis=axis or "z", scenario=f"s{cycle}"))
    return make_session(*runs)


@pytest.mark.wide
def test_turns_of_known_angle_show_misalignment_and_no_transient() -> None:
    found = diagnose(turned_by_hand(0.01), ON_Z)
    assert found.best is not None
    assert (found.best.effect.id, found.best.axis) == ("misalignment", "z")
    values = found.best.values
    assert values.get("m_x", values.get("m")) == pytest.approx(0.01, rel=0.05)
    assert {f.against for f in found.comparison.where} == {"rate"}
    assert diagnose(turned_by_hand(0.0), ON_Z).verdict == "adequate"


def test_a_step_is_as_large_in_words_as_in_the_residual() -> None:
    """The mean residual of the step that is told, against the mean of all, within a fifth."""
    rng = np.random.default_rng(4)
    t_s = np.arange(4350) / 145
    runs = []
    for cycle in range(6):
        gyro = rng.normal(0, 0.04, (t_s.size, 3))
        gyro[:, 0] += np.where(t_s > 20, 0.03, 0.0)
        runs.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{cycle}"))
    comparison = compare(make_session(*runs))
    first = next(f for f in comparison.where if f.axis == "x" and "most" in f.note)
    words = first.note.split("mostly ")[1].split()
    told_mdps, low = float(words[0]), float(words[words.index("from") + 1]) if "from" in words else 0.0
    high = float(words[words.index("to") + 1]) if "to" in words else np.inf
    drawn = np.concatenate(list(Cleaned.of(comparison.fit, "x").by_run.values())) * 1e3
    t_all = np.tile(t_s, len(runs))
    inside = (t_all >= low) & (t_all < high)
    assert told_mdps == pytest.approx(drawn[inside].mean() - drawn.mean(), rel=0.2)
    assert first.amplitude_dps * 1e3 == pytest.approx(np.sqrt(2) * np.std(np.where(t_all > 20, 30.0, 0.0)), rel=0.2)


def shaken(tone_dps: float) -> Session:
    """Rectified vibration behind a low-pass of 30 Hz, as strong as the motor of each run, and a tone of another cause."""
    from scipy.signal import butter, lfilter

    rng, t_s, made = np.random.default_rng(12), np.arange(2000) / 100, []
    for i, strength_g in enumerate((0.0, 0.5, 1.0, 1.5, 0.3, 0.8)):
        envelope = strength_g * np.abs(np.sin(np.pi * (t_s / 11 + rng.random())))
        acc_g = envelope * np.sin(2 * np.pi * (rng.uniform(8, 11) * t_s + rng.random()))
        gyro = rng.normal(0, 0.01, (t_s.size, 3))
        gyro[:, 2] += tone_dps * np.sin(2 * np.pi * (31 * t_s + rng.random()))
        gyro[:, 2] += lfilter(*butter(2, 30, fs=100), 0.05 * acc_g**2)
        columns = {"ax_g": acc_g, "ay_g": 0.0, "az_g": 1.0}
        made.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{i}", day=1 + i % 3, **columns))
    return make_session(*made)


def test_what_the_low_pass_leaves_of_a_vibration_s_own_line_is_not_unknown() -> None:
    """Beside its rectified part, lines at twice the motor's frequencies stayed unknown. One of another cause is told."""
    model = ON_Z.add("g2_sensitivity", "z")
    assert [f for f in measure(shaken(0.0), model).where if f.against == "frequency"] == []
    lines = [f for f in measure(shaken(0.004), model).where if f.band_hz is not None]
    assert [round(f.band_hz[0]) for f in lines if f.band_hz] == [31]


def test_a_rectified_vibration_is_named_beside_its_own_line() -> None:
    """A low-pass of 12 Hz weakens the line at twice the motor's frequency. What is left is held against no slow effect."""
    from scipy.signal import butter, lfilter

    rng, t_s, made = np.random.default_rng(31), np.arange(4000) / 100, []
    for i, strength_g in enumerate((1.0, 1.8, 0.4)):
        swell = strength_g * np.abs(np.sin(np.pi * (t_s / 13 + rng.random())))
        acc_g = swell * np.sin(2 * np.pi * (14 * t_s + rng.random()))
        gyro = rng.normal(0, 0.02, (t_s.size, 3))
        gyro[:, 2] += lfilter(*butter(2, 12, fs=100), 0.08 * acc_g**2)
        columns = {"ax_g": acc_g, "ay_g": 0.0, "az_g": 1.0}
        made.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{i}", **columns))
    best = diagnose(make_session(*made), ON_Z).best
    assert best is not None
    assert (best.effect.id, best.axis) == ("g2_sensitivity", "z")
    assert best.values[next(iter(best.values))] == pytest.approx(0.08, rel=0.1)


def on_a_sine(seed: int, *, k_dps_per_g2: float = 0.02, tone_dps: float = 0.0, passed: float = 1.0) -> Session:
    """A part at rest on a shaker of 23 Hz, off and at several levels, two runs in each power cycle.

    ``passed`` is the part of the squared acceleration's lines that the low-pass of the readings leaves.
    """
    rng, t_s, made = np.random.default_rng(seed), np.arange(2000) / 100, []
    along = rng.normal(0, 1, 3)
    along /= np.linalg.norm(along)
    for i, strength_g in enumerate((0.0, 2.5, 0.8, 1.6, 2.0, 0.0, 1.2, 2.5)):
        wave = np.sin(2 * np.pi * (23 * t_s + rng.random()))
        acc_g = np.array([0.0, 0.0, 1.0]) + strength_g * wave[:, None] * along + rng.normal(0, 0.002, (t_s.size, 3))
        if i % 2 == 0:
            offset_dps = rng.normal(0, 0.06)
        gyro = rng.normal(0, 0.035, (t_s.size, 3))
        square_g2 = (acc_g**2).sum(axis=1)
        rectified_g2 = square_g2.mean() + passed * (square_g2 - square_g2.mean())
        gyro[:, 2] += offset_dps + k_dps_per_g2 * rectified_g2 + tone_dps * strength_g * np.roll(wave, 7)
        columns = dict(zip(("ax_g", "ay_g", "az_g"), acc_g.T, strict=True))
        made.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{i // 2}", power_on_s=3 + 30.0 * (i % 2), **columns))
    return make_session(*made)


def test_lines_of_a_squared_sine_are_no_tone() -> None:
    """A tone took one of its lines, gained more by its samples than the whole cause by block means, and was named first."""
    found = explain(on_a_sine(1), ON_Z)
    assert [(s.effects, s.axes) for s in found.steps] == [(("g2_sensitivity",), ("z",))]
    assert found.verdict == "adequate"
    term = next(t for t in found.model.on("z") if t.effect_id == "g2_sensitivity")
    assert term.values["k_dps_per_g2"] == pytest.approx(0.02, rel=0.1)


def test_a_tone_of_the_same_shaker_larger_than_the_lines_stays() -> None:
    named = {c.effect.id for c in diagnose(on_a_sine(3, tone_dps=0.3), ON_Z).candidates if c.decision == "add"}
    assert "vibration_tone" in named


@pytest.mark.parametrize("passed", [pytest.param(0.0, marks=pytest.mark.wide), 0.3])
def test_a_vibration_is_rectified_behind_a_low_pass_too(passed: float) -> None:
    """The lines that the reading lacks denied the effect, whose coefficient is that of the slow part."""
    found = explain(on_a_sine(5, passed=passed), ON_Z)
    assert [(s.effects, s.axes) for s in found.steps] == [(("g2_sensitivity",), ("z",))]
    assert found.verdict == "adequate"
    term = next(t for t in found.model.on("z") if t.effect_id == "g2_sensitivity")
    assert abs(term.values["k_dps_per_g2"] - 0.02) < 3 * term.se["k_dps_per_g2"] < 0.006
    assert abs(term.values["lost_dps_per_g2"] - 0.02 * (1 - passed)) < 3 * term.se["lost_dps_per_g2"] < 0.012


def test_a_vibration_that_is_not_rectified_is_none() -> None:
    assert diagnose(on_a_sine(6, k_dps_per_g2=0.0)).verdict == "adequate"


def test_a_tone_that_takes_one_of_two_lines_does_not_explain_both() -> None:
    """The noise of its fit to samples held the other line, and it was said to explain all of the excess."""
    found = next(c for c in diagnose(on_a_sine(1), ON_Z).candidates if c.effect.id == "vibration_tone")
    assert found.explained is not None
    assert found.explained < 0.95
