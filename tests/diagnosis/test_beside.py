"""Effects that hide each other, an excess that no test names, and what the words say of the residual that is drawn."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.diagnosis.residual.drawn_size import described, most_visible
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.levels import Cleaned
from gyrocal.diagnosis.residual.probes import of_session
from gyrocal.diagnosis.residual.told_once import strongest_first
from gyrocal.effects.thermal_hysteresis import play_c
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.present.explanation import open_words
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

RATE_HZ = 1.0


def ramped() -> Session:
    """One run at rest while a chamber goes from 50 down to -15, up to 70 and back to 40 degC; x has a curve and a loop."""
    rng = np.random.default_rng(4)
    t_s = np.arange(0, 2400, 1 / RATE_HZ)
    temp_c = np.interp(t_s, [0, 800, 1900, 2400], [50, -15, 70, 40])
    loop = (temp_c - play_c(temp_c, 10.0)) / 10.0
    gyro = rng.normal(0, 0.015, (t_s.size, 3)) + np.cumsum(rng.normal(0, 1e-3, (t_s.size, 3)), axis=0)
    gyro[:, 0] += 3e-4 * (temp_c - 25) ** 2 - 0.25 * loop
    gyro[:, 1] += 0.03 * (temp_c - 25)
    return make_session(make_run(t_s, gyro, table_rate_dps=0.0, temp_c=temp_c))


@pytest.fixture(scope="module")
def chamber() -> Session:
    return ramped()


@pytest.mark.wide
def test_a_curve_and_a_hysteresis_that_hide_each_other_are_named_together(chamber: Session) -> None:
    found = diagnose(chamber)
    on_x = {c.effect.id: c for c in found.candidates if c.axis == "x" and c.decision == "add"}
    assert set(on_x) == {"bias_temperature", "thermal_hysteresis"}
    assert all(set(c.together) <= set(on_x) for c in on_x.values())
    assert on_x["thermal_hysteresis"].values["amplitude_dps"] == pytest.approx(-0.25, rel=0.3)
    on_y = [c.effect.id for c in found.candidates if c.axis == "y" and c.decision == "add"]
    assert on_y == ["bias_temperature"]


def test_an_error_over_temperature_is_told_against_temperature_and_as_large_as_drawn(chamber: Session) -> None:
    fitted = fit(chamber, Model.open(None))
    shapes = [(name, s) for name, on_axis in of_session(chamber, 1) for s in on_axis]
    seen = most_visible(fitted.axes["y"], shapes)
    assert seen is not None
    assert seen[0] == "temperature"
    amplitude_dps, words = described(fitted.axes["y"], seen[1])
    drawn = Cleaned.of(fitted, "y").by_run[chamber.runs[0].index]
    assert amplitude_dps == pytest.approx(np.sqrt(2) * np.std(drawn), rel=0.2)
    assert "temperature" not in words  # the finding names the variable itself
    assert words.startswith(f"rms {1e3 * amplitude_dps / np.sqrt(2):.0f} mdps; mostly ")
    assert words.endswith(("°C", "°C up"))


def test_an_excess_that_the_others_hardly_describe_comes_before_them_on_its_axis() -> None:
    band = Finding("x", "frequency", 8.0, 0.0, 0.01, "a band")
    excess = Finding("x", "time", 7.0, 0.0, 0.3, "the excess")
    other = Finding("y", "rate", 7.5, 0.0, 0.1, "another axis")
    assert strongest_first([excess, band, other]) == [other, excess, band]


def test_a_leak_that_one_turn_of_each_axis_shows_is_left_with_what_to_record() -> None:
    """Nothing can be left out, so nothing can be added; it was dropped without a word."""
    rng = np.random.default_rng(8)
    t_s = np.arange(1000) / 100
    profile = np.sin(np.pi * np.clip(t_s * 0.12, 0, 1)) ** 2
    rate_dps = 360 * profile / np.trapezoid(profile, t_s)
    runs = [make_run(t_s, rng.normal(0.1, 0.04, (t_s.size, 3)), table_rate_dps=0.0, scenario="s0")]
    for i, axis in enumerate("xyz"):
        gyro = rng.normal(0.1, 0.04, (t_s.size, 3))
        gyro[:, i] += rate_dps
        gyro[:, 2] += 0.01 * rate_dps * (axis == "x")
        runs.append(make_run(t_s, gyro, table_rate_dps=0.0, turn_deg=360.0, axis=axis, scenario="s0"))
    found = explain(make_session(*runs))
    assert found.steps == []
    (left,) = found.left
    assert (left.axis, left.group) == ("z", ("misalignment",))
    assert "cannot prove it" in open_words(left)
    assert "again" in left.next_measurement


def test_a_wave_over_half_a_turn_is_not_told_larger_than_the_residual() -> None:
    """Over half a turn the waves are nearly the same shape: one of 7.75e6 mdps was told in a residual of 2e3 mdps."""
    rng = np.random.default_rng(2)
    t_s = np.arange(0, 60, 0.05)
    angle_deg = 90 + 90 * np.sin(2 * np.pi * 0.1 * t_s)
    gyro = rng.normal(0, 0.05, (t_s.size, 3))
    rate_dps = np.gradient(angle_deg, t_s)
    gyro[:, 2] += rate_dps + 0.4 * np.sign(angle_deg - 60) * np.abs(np.sin(np.deg2rad(3 * angle_deg)))
    session = make_session(make_run(t_s, gyro, rate_ref_dps=rate_dps, table_angle_deg=angle_deg))
    (waves,) = [s for name, on_axis in of_session(session, 2) if name == "table_angle" for s in on_axis]
    amplitude_dps, words = described(fit(session, Model.open(None)).axes["z"], waves)
    told = [float(w) for w in words.replace(";", "").split() if w[0].isdigit() and "." in w]
    assert max(told, default=0.0) <= 1.001e3 * amplitude_dps
    assert words.startswith("rms")
    assert "phase" not in words  # of one run
