"""What is fixed to the table's angle is told in orders, on every axis, and named where several rates show that it is."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import meets
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.levels import Cleaned
from gyrocal.effects.base import effect, table_angle_rad
from gyrocal.effects.order_tone import spectrum_over_turns
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.simulation.simulate import simulate
from known import ON_X, ON_Z, add_measured
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers", "tests_alone")]
Planted = dict[str, Array]


def with_terms(session: Session, terms: Callable[[Run], Planted]) -> Session:
    """The session with further terms in deg/s by axis."""

    def run_of(run: Run) -> Run:
        columns = {f"g{a}_dps": pl.Series(run.gyro_dps[:, AXES.index(a)] + term) for a, term in terms(run).items()}
        return replace(run, frame=run.table.with_columns(**columns))

    return session.with_runs(map(run_of, session.runs))


def paper(*effects: str, seed: int = 4) -> Session:
    return simulate(None, "paper", effects, seed, scenarios=6, seconds=20.0)[0]


def full(*effects: str, seed: int = 3) -> Session:
    return simulate(None, "full", effects, seed, scenarios=2, seconds=15.0)[0]


@pytest.mark.wide
def test_a_wave_once_per_turn_across_the_table_is_told_by_its_angle() -> None:
    """It was told as 90.2 mdps between 0.25 and 0.41 Hz. Its size and its common phase are those of the residual."""
    waves = {"x": 0.0, "y": np.pi / 2}
    session = with_terms(paper(), lambda r: {a: 0.156 * np.cos(table_angle_rad(r) - p) for a, p in waves.items()})
    comparison = compare(session)
    for axis in "xy":
        first = next(f for f in comparison.where if f.axis == axis)
        assert first.against == "table_angle"
        assert first.amplitude_dps == pytest.approx(0.156, rel=0.2)
        assert first.note.endswith("once per turn, of the same phase in each run")
        assert not [f for f in comparison.where if f.axis == axis and f.against == "frequency"]
        of_runs = Cleaned.of(comparison.fit, axis).by_run
        seen = np.array([2 * np.mean(of_runs[r.index] * np.exp(1j * table_angle_rad(r))) for r in session.runs])
        assert first.amplitude_dps == pytest.approx(float(np.sqrt(np.mean(np.abs(seen) ** 2))), rel=0.2)
        assert abs(seen.sum()) > 0.9 * np.abs(seen).sum()


@pytest.mark.wide
def test_waves_that_begin_anywhere_are_of_another_phase() -> None:
    comparison = compare(paper("table_ripple"))
    first = comparison.where[0]
    assert first.note.endswith("once per turn, of another phase in each run")
    of_runs = Cleaned.of(comparison.fit, "z").by_run
    seen = np.array([2 * np.mean(of_runs[b.run.index] * np.exp(1j * table_angle_rad(b.run))) for b in comparison.fit.blocks])
    assert abs(seen.sum()) < 0.9 * np.abs(seen).sum()
    assert first.amplitude_dps == pytest.approx(float(np.sqrt(np.mean(np.abs(seen) ** 2))), rel=0.2)


@pytest.mark.wide
def test_a_sawtooth_once_per_turn_is_told_per_turn_and_not_in_hertz() -> None:
    """Its fifth harmonic was called a vibration's tone of 1.08301 Hz, which is 5 times 78/360."""
    session = with_terms(paper(), lambda r: {"z": 0.06 * ((table_angle_rad(r) / (2 * np.pi)) % 1.0 - 0.5)})
    found = diagnose(session, ON_Z)
    assert {f.against for f in found.comparison.where if "Hz" in f.note} == set()
    assert any("once per turn" in f.note for f in found.comparison.where)
    named = {c.effect.id for c in found.candidates if c.decision == "add"}
    assert "vibration_tone" not in named
    assert found.best is not None


@pytest.mark.parametrize("order", [pytest.param(5.0, marks=pytest.mark.wide), 8.5])
def test_an_order_tone_is_named_at_several_rates(order: float) -> None:
    session = full(f"order_tone:order={order},A_dps=0.05")
    found = diagnose(session, ON_Z)
    assert found.best is not None
    assert (found.best.effect.id, found.best.axis, found.best.group) == ("order_tone", "z", ("order_tone",))
    assert found.best.values["order"] == pytest.approx(order, abs=0.01)
    assert found.best.values["A_dps"] == pytest.approx(0.05, rel=0.1)
    assert next(f for f in found.comparison.where if f.axis == "z").against == ("table_angle" if order == 5.0 else "order")
    before, after, _ = add_measured(session, ON_Z, "order_tone")
    assert after.per_axis["z"].excess_dps < 0.7 * before.per_axis["z"].excess_dps


@pytest.mark.wide
def test_at_one_rate_an_order_and_a_vibration_are_one_group() -> None:
    found = diagnose(paper("order_tone:order=5,A_dps=0.05"), ON_Z)
    assert found.best is not None
    assert found.verdict == "ambiguous"
    assert set(found.best.group) == {"order_tone", "vibration_tone"}


@pytest.mark.wide
def test_at_several_rates_a_ripple_is_no_tone_and_a_tone_no_ripple() -> None:
    """A ripple of the speed grows with the rate, a tone of the angle does not."""
    for effect_id, spec in (("table_ripple", "table_ripple"), ("order_tone", "order_tone:order=2,A_dps=0.05")):
        named = {c.effect.id for c in diagnose(full(spec), ON_Z).candidates if c.decision == "add"}
        assert named == {effect_id}


@pytest.mark.wide
@pytest.mark.parametrize("seed", [3, pytest.param(5, marks=pytest.mark.wide)])
def test_a_ripple_at_one_rate_is_named_and_not_the_tone_of_the_same_shape(seed: int) -> None:
    """A second line that noise explains had the tone judged on single samples, where nothing else can be compared with it."""
    session, _ = simulate(None, "paper", ["table_ripple"], seed, scenarios=3, seconds=20.0)
    found = diagnose(session, ON_Z)
    assert found.best is not None
    assert (found.verdict, found.best.effect.id, found.best.axis) == ("add", "table_ripple", "z")
    assert [c.effect.id for c in found.candidates if c.decision == "add"] == ["table_ripple"]


@pytest.mark.wide
def test_at_one_rate_a_tone_too_small_for_a_ripple_of_any_table_is_told_with_it() -> None:
    """The ripple of the same shape is simpler, and was left as the only one although no table's is as small."""
    found = diagnose(simulate(None, "paper", ["order_tone:order=2,A_dps=0.003"], 3, scenarios=6, seconds=60.0)[0], ON_Z)
    assert found.best is not None
    assert found.verdict == "ambiguous"
    assert set(found.best.group) >= {"order_tone", "table_ripple"}


@pytest.mark.wide
def test_runs_of_less_than_two_turns_tell_an_order_from_a_frequency() -> None:
    """Only the runs at 150 deg/s make two turns in 8 s, so that the spectrum over turns is of one rate."""
    session = simulate(None, "full", ["order_tone:order=4.25,A_dps=0.03"], 3, scenarios=2, seconds=8.0)[0]
    best = diagnose(session, ON_Z).best
    assert best is not None
    assert (best.effect.id, best.axis, best.group) == ("order_tone", "z", ("order_tone",))
    assert best.values["order"] == pytest.approx(4.25, abs=0.01)


@pytest.mark.wide
@pytest.mark.parametrize("order", [1.0, pytest.param(7.0, marks=pytest.mark.wide)])
def test_a_tone_of_the_table_is_named_though_no_run_makes_two_turns(order: float) -> None:
    """Turns by hand at a known angle sweep about a turn, over which there is no spectrum."""
    rng = np.random.default_rng(4)
    t_s = np.arange(round(20 * 50.0)) / 50.0
    runs = []
    for cycle in range(5):
        phase, speed = rng.uniform(0, 6), 2 * np.pi * 0.2
        angle_deg = 200 * np.sin(speed * t_s + phase)
        rate = 200 * speed * np.cos(speed * t_s + phase)
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.03, (t_s.size, 3))
        gyro[:, 2] += 1.002 * rate
        gyro[:, 0] += 0.04 * np.sin(order * np.radians(angle_deg) + 1.0)
        known = {"rate_ref_dps": rate, "table_angle_deg": np.mod(angle_deg, 360)}
        runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", day=1 + cycle % 2, rate_hz=50.0, **known))
    best = diagnose(make_session(*runs), ON_X).best
    assert best is not None
    assert best.effect.id == "order_tone"
    assert best.values["order"] == pytest.approx(order, abs=0.05)
    assert best.values["A_dps"] == pytest.approx(0.04, rel=0.1)


def test_slow_errors_hide_no_wave_of_the_table() -> None:
    """An asymmetry of a swinging table, a scale that drifts and a delay, each larger than the wave, hid its line."""
    rng, t_s = np.random.default_rng(21), np.arange(6000) / 50.0
    rate = 90 * np.sin(2 * np.pi * t_s / 30) + 30
    angle_deg = np.cumsum(rate) / 50
    slow = 1.5e-3 * np.abs(rate) + 2e-3 * rate * t_s / 120 + 5e-3 * np.gradient(rate, t_s)
    gyro = rng.normal(0, 0.03, (t_s.size, 3))
    gyro[:, 2] += rate + slow + 0.015 * np.sin(4.25 * np.radians(angle_deg))
    run = make_run(t_s, gyro, rate_hz=50.0, rate_ref_dps=rate, table_angle_deg=np.mod(angle_deg, 360))
    assert spectrum_over_turns([run], 2).peaks(1)[0].order == pytest.approx(4.25, abs=0.1)


@pytest.mark.wide
@pytest.mark.parametrize(("line_hz", "meets_it"), [(11.0, True), (2.0, False)])
def test_a_line_beyond_the_order_at_the_fastest_turn_is_another_cause(line_hz: float, meets_it: bool) -> None:
    """Order 5 at 150 deg/s is 2.1 Hz. A strong line of 11 Hz, as the host's polling makes of a vibration, is not its part."""
    session, _ = simulate(None, "full", ["order_tone:order=5,A_dps=0.02"], 4, scenarios=2, seconds=8.0)
    comparison = measure(session)
    line = Finding("z", "frequency", 500.0, 0.0, 0.1, "a line", band_hz=(line_hz, line_hz))
    tone = Candidate(effect("order_tone"), "z", "suggest", {"order": 5.0, "A_dps": 0.02, "phase_deg": 0.0}, gain=1000.0)
    assert meets(tone, replace(comparison, where=[line])) is meets_it


def test_one_run_at_one_rate_leaves_open_whether_a_line_turns_with_the_table() -> None:
    """A line of 4.25 per turn was named a vibration."""
    rng, t_s = np.random.default_rng(5), np.arange(9000) / 100
    gyro = rng.normal(0, 0.04, (t_s.size, 3))
    gyro[:, 2] += 120.0
    gyro[:, 0] += 0.03 * np.sin(4.25 * np.radians(120 * t_s) + rng.uniform(0, 6))
    best = diagnose(make_session(make_run(t_s, gyro, table_rate_dps=120.0)), ON_X).best
    assert best is not None
    assert set(best.group) == {"order_tone", "vibration_tone"}


@pytest.mark.wide
@pytest.mark.parametrize(
    ("size_dps", "latitude_deg", "named"),
    [(0.004, None, False), *(pytest.param(*of, True, marks=pytest.mark.wide) for of in ((0.004, 75.0), (0.012, None)))],
)
def test_what_the_earth_may_make_once_per_turn_across_the_table_is_no_tone(
    size_dps: float, latitude_deg: float | None, named: bool
) -> None:  # fmt: skip
    """The Earth's horizontal rate, 4.18 mdps times the cosine of the latitude, was named a tone of the table's drive."""
    session = simulate(None, "full", (), 3, scenarios=3, seconds=60.0)[0]
    session = with_terms(session, lambda r: {"x": size_dps * np.cos(table_angle_rad(r)) * bool(np.any(r.rate_dps))})
    session = session.with_runs(replace(r, latitude_deg=latitude_deg) for r in session.runs)
    found = diagnose(session, ON_X)
    tones = [c for c in found.candidates if c.effect.id == "order_tone" and c.decision == "add"]
    assert bool(tones) == named
    hints = [f for f in found.comparison.where if "the Earth's rate makes" in f.note]
    assert bool(hints) == (not named)


def tilted(size_g: float = 0.0126, seconds: float = 60.0) -> Session:
    """A table that is not level: what lies in its plane turns once per turn through gravity."""
    session, rng = simulate(None, "full", (), 3, scenarios=3, seconds=seconds)[0], np.random.default_rng(1)

    def run_of(run: Run) -> Run:
        angle_rad = table_angle_rad(run)
        level_g = np.array([size_g * np.cos(angle_rad), size_g * np.sin(angle_rad), np.full(len(run), run.face_sign)])
        x, y, z = level_g + rng.normal(0.0, 0.003, level_g.shape)
        return replace(run, frame=run.table.with_columns(ax_g=x, ay_g=y, az_g=z))

    return session.with_runs(map(run_of, session.runs))


@pytest.mark.wide
def test_gravity_in_the_plane_of_a_tilted_table_is_no_tone() -> None:
    """Only the component along the table's axis was tried, and the rest of the same effect was named a tone of order 1."""
    sizes = {"gx_dps_per_g": 0.11, "gy_dps_per_g": -0.2, "gz_dps_per_g": -0.065}
    session = tilted(seconds=20.0)
    session = with_terms(session, lambda r: {"z": r.acc_g @ np.array(list(sizes.values())) if r.acc_g is not None else 0.0})
    named = {c.effect.id: c for c in diagnose(session, ON_Z).candidates if c.named}
    assert set(named) == {"g_sensitivity"}
    for name, size in sizes.items():
        assert named["g_sensitivity"].values[name] == pytest.approx(size, abs=4 * named["g_sensitivity"].se[name])


@pytest.mark.wide
@pytest.mark.parametrize("known", [pytest.param(True, marks=pytest.mark.wide), False])
def test_the_earth_s_rate_across_a_tilted_table_is_no_sensitivity_to_gravity(known: bool) -> None:
    """Both are waves once per turn, 40 degrees apart. Two components of gravity together have any phase."""
    session = tilted()
    angles = (np.rad2deg(table_angle_rad(r)) for r in session.runs)
    if known:
        session = session.with_runs(
            replace(r, frame=r.table.with_columns(table_angle_deg=a)) for r, a in zip(session.runs, angles, strict=True)
        )
    session = with_terms(session, lambda r: {"x": 0.0035 * np.cos(table_angle_rad(r) - np.deg2rad(40.0))})
    assert not [c for c in diagnose(session, ON_X).candidates if c.decision == "add"]


@pytest.mark.wide
@pytest.mark.parametrize("aligned", [True, False])
def test_a_wide_pulse_once_a_turn_is_no_ripple(aligned: bool) -> None:
    """Its orders fall like those of a ripple, but all have their crests at one angle, as of a magnet beside the table."""
    width_rad = np.deg2rad(20.0)
    sizes = 0.02 * np.exp(-((np.arange(1, 6) * width_rad) ** 2) / 2)
    phases = np.arange(1, 6) * 2.0 if aligned else np.array([0.3, 4.0, 2.2, 1.0, 5.5])

    def wave(run: Run) -> Planted:
        angle_rad = table_angle_rad(run)
        return {"z": sum(a * np.cos((k + 1) * angle_rad - p) for k, (a, p) in enumerate(zip(sizes, phases, strict=True)))}

    found = diagnose(with_terms(paper(), wave), ON_Z)
    named = {c.effect.id for c in found.candidates if c.decision == "add"}
    assert ("table_ripple" in named) != aligned
    assert found.comparison.where


@pytest.mark.wide
@pytest.mark.parametrize(
    ("spec", "named"),
    [("order_tone:order=3,A_dps=0.03", "order_tone"), pytest.param("table_ripple", "table_ripple", marks=pytest.mark.wide)],
)
def test_over_less_than_two_turns_of_unknown_angle_sizes_tell_a_tone_from_a_ripple(spec: str, named: str) -> None:
    """A tone was not looked for there, so that a ripple was named in its place."""
    session, _ = simulate(None, "full", [spec], 4, seconds=4.5)
    turns = [abs(run.table_rate_dps) * run.duration_s / 360 for run in session.runs if run.table_rate_dps is not None]
    assert max(turns) < 2
    assert [c.effect.id for c in diagnose(session, ON_Z).candidates if c.named] == [named]


def test_where_the_table_turns_more_than_once_between_samples_no_order_is_looked_for() -> None:
    """Times in milliseconds that are read as seconds made a spectrum of thousands of turns."""
    t_s, rng = np.arange(400) * 10.0, np.random.default_rng(0)
    runs = [
        make_run(t_s, rng.normal((0, 0, rate), 0.05, (t_s.size, 3)), table_rate_dps=rate, scenario=f"s{k}")
        for k, rate in enumerate((78.0, 60.0, 78.0, 60.0))
    ]
    tone = effect("order_tone")
    assert tone.variants(runs, 2) == [{"order": 1.0, "A_dps": 0.0}]
    assert tone.tried_on(runs, 2, 0.0) is None
