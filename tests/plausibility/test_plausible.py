"""A user's slip is told by its code and never called adequate; sound sessions are left in peace."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.effects.base import effects
from gyrocal.error_model.model import Model
from gyrocal.plausibility import check
from gyrocal.plausibility.header import CODES
from gyrocal.present.report import headline, level_rows, verdict_text
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import LSB_DPS, simulate
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
SLOPES = {"unit_rad_s", "axes_swapped", "sign_flipped", "face_wrong", "rate_wrong", "scale_implausible"}
DEG = 180 / np.pi


@cache
def sound(campaign: str = "full", scenarios: int = 1, seconds: float = 6.0, effect: str = "") -> Session:
    return simulate(None, campaign, [effect] if effect else [], 3, scenarios=scenarios, seconds=seconds)[0]


def paper() -> Session:
    return sound("paper", 4, 8.0)


def changed(run: Run, **columns: Any) -> Run:
    """The run with other columns."""
    return replace(run, frame=run.table.with_columns(**{n: pl.Series(np.asarray(v, dtype=float)) for n, v in columns.items()}))


def everywhere(session: Session, change: Callable[[Run], Run]) -> Session:
    return session.with_runs(map(change, session.runs))


def one(session: Session, number: int, change: Callable[[Run], Run]) -> Session:
    return session.with_runs(change(r) if i == number else r for i, r in enumerate(session.runs))


def scaled(factor: float, offset: float = 0.0) -> Callable[[Run], Run]:
    return lambda run: changed(run, gz_dps=run.gyro_dps[:, 2] * factor + offset)


def in_rad(run: Run) -> Run:
    return changed(run, **{f"g{a}_dps": run.gyro_dps[:, i] / DEG for i, a in enumerate("xyz")})


def swapped(run: Run) -> Run:
    return changed(run, gx_dps=run.gyro_dps[:, 2], gz_dps=run.gyro_dps[:, 0])


def turned_over(run: Run) -> Run:
    return replace(run, face="down" if run.face == "up" else "up")


def cycles_apart(sd: float) -> Callable[[Session], Session]:
    def change(session: Session) -> Session:
        rng = np.random.default_rng(1)
        offsets = {name: rng.normal(0, sd) for name in session.scenarios}
        return everywhere(session, lambda r: changed(r, gz_dps=r.gyro_dps[:, 2] + offsets[r.scenario]))

    return change


def without_gravity(session: Session) -> Session:
    return everywhere(session, lambda r: replace(r, frame=r.table.drop("ax_g", "ay_g", "az_g")))


def first_turning(session: Session) -> int:
    return next(i for i, r in enumerate(session.runs) if r.table_rate_dps and abs(r.table_rate_dps) > 50)


def first_rest(session: Session) -> int:
    return next(i for i, r in enumerate(session.runs) if r.table_rate_dps == 0)


BLOCKING: list[tuple[str, Callable[[Session], Session]]] = [
    ("unit_rad_s", lambda s: everywhere(s, in_rad)),
    ("unit_rad_s", lambda s: everywhere(s, lambda r: replace(r, table_rate_dps=(r.table_rate_dps or 0.0) / DEG))),
    ("axes_swapped", lambda s: everywhere(s, swapped)),
    ("sign_flipped", lambda s: everywhere(s, scaled(-1.0))),
    ("face_wrong", lambda s: one(s, first_turning(s), turned_over)),
    ("face_wrong", lambda s: one(without_gravity(s), first_turning(s), turned_over)),
    ("rate_wrong", lambda s: one(s, first_turning(s), lambda r: replace(r, table_rate_dps=(r.table_rate_dps or 0.0) * 1.05))),
    ("scale_implausible", lambda s: everywhere(s, scaled(1.28))),
    ("bias_implausible", lambda s: everywhere(s, scaled(1.0, 60.0))),
    ("turn_on_implausible", cycles_apart(15.0)),
    ("constant_reading", lambda s: one(s, first_turning(s), lambda r: changed(r, gz_dps=np.full(len(r), r.gyro_dps[0, 2])))),
    ("constant_reading", lambda s: everywhere(s, lambda r: changed(r, gz_dps=np.zeros(len(r))))),
]


@pytest.mark.parametrize("session", [sound, paper], ids=["full", "paper"])
@pytest.mark.parametrize(("code", "slip"), BLOCKING, ids=[f"{c}-{i}" for i, (c, _) in enumerate(BLOCKING)])
def test_a_slip_is_told_by_its_code_alone(
    code: str, slip: Callable[[Session], Session], session: Callable[[], Session]
) -> None:
    told = check(slip(session()))
    assert {w.code for w in told} == {code}
    assert all(w.blocking and w.axis == "z" and w.text for w in told)


OF_ALL, OF_ONE_RUN, FURTHER = BLOCKING[-1], BLOCKING[4], (BLOCKING[0], BLOCKING[9])


@pytest.mark.parametrize(
    ("code", "slip"), [OF_ALL, OF_ONE_RUN, *(pytest.param(*slip, marks=pytest.mark.wide) for slip in FURTHER)]
)
def test_a_slip_is_never_adequate(code: str, slip: Callable[[Session], Session]) -> None:
    session = slip(sound())
    compared, found = compare(session), diagnose(session)
    assert (compared.verdict, found.verdict) == ("implausible", "implausible")
    assert code in {w["code"] for w in compared.to_json()["warnings"]}
    assert compared.to_json()["warnings"] == found.to_json()["warnings"]
    assert "z" in compared.per_axis
    assert not [c for c in found.candidates if c.axis == "z"]
    assert not [f for f in compared.where if f.axis == "z"]


def test_a_blocked_axis_is_marked_where_its_figures_stand() -> None:
    """Also among those of all axes together, and a reading that stands still is not said to contradict anything."""
    blocked = measure(everywhere(sound(), lambda r: changed(r, gz_dps=np.zeros(len(r)))))
    assert [row[0] for row in level_rows(blocked)] == ["x", "y", "z (not judged)", "all (with z)"]
    assert [row[0] for row in level_rows(measure(sound()))] == ["x", "y", "z", "all"]
    assert "axis is not judged" in headline(blocked)
    assert "contradict" not in headline(blocked)


def test_times_in_milliseconds_leave_nothing_adequate_in_words() -> None:
    slow = diagnose(everywhere(sound(), lambda r: changed(r, t_s=r.t_s * 1e3)), ON_Z)
    (told,) = slow.comparison.warnings
    assert told.text.startswith("Is t_s in ms?")
    assert told.text.count("onvert it to seconds") == 1
    assert "orrect" not in told.text
    for words in (headline(slow.comparison), verdict_text(slow)):
        assert "times are in doubt" in words
        assert "noise" not in words


def test_what_a_user_asks_for_is_done_and_the_warnings_are_told() -> None:
    session = everywhere(sound(), scaled(-1.0))
    before, after, _ = add(session, None, "scale_asymmetry")
    assert (before.verdict, after.verdict) == ("implausible", "implausible")
    assert [w.code for w in before.warnings] == ["sign_flipped"]


def test_one_run_alone_is_named() -> None:
    session = sound()
    number = first_turning(session)
    for change in (turned_over, lambda r: replace(r, table_rate_dps=100.0)):
        (told,) = check(one(session, number, change))
        assert told.file == session.runs[number].file


def test_a_wrong_rate_says_the_likely_one() -> None:
    session = sound()
    number = first_turning(session)
    true = session.runs[number].table_rate_dps
    (told,) = check(one(session, number, lambda r: replace(r, table_rate_dps=(true or 0.0) * 1.3)))
    assert f"{true:.4g}"[:4] in told.text


@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_rest_that_is_none(axis: str) -> None:
    session = sound()
    column = f"g{axis}_dps"
    told = check(one(session, first_rest(session), lambda r: changed(r, **{column: r.table[column] + 5.0})))
    assert [(w.code, w.axis, w.blocking) for w in told] == [("not_at_rest", axis, True)]
    assert all(w.file == session.runs[first_rest(session)].file for w in told)


@pytest.mark.parametrize(("apart_dps", "same_cycle", "told"), [(1.5, True, 1), (3.0, False, 0), (7.0, False, 1)])
def test_rests_differ_by_one_dps_in_a_power_cycle_and_by_five_between(apart_dps: float, same_cycle: bool, told: int) -> None:
    """Rests of a sensor whose bias was 1.3 dps off in one power cycle were said to move."""
    rng, t_s = np.random.default_rng(4), np.arange(1000) / 50
    cycles = ("s0", "s0", "s0", "s0") if same_cycle else ("s0", "s1", "s2", "s3")
    offs_dps = (0.0, 0.1, -0.1, apart_dps)
    runs = [
        make_run(t_s, rng.normal(0, 0.05, (t_s.size, 3)) + off_dps, table_rate_dps=0.0, scenario=cycle)
        for cycle, off_dps in zip(cycles, offs_dps, strict=True)
    ]  # fmt: skip
    warned = [w for w in check(make_session(*runs), Model.builtin("default")) if w.code == "not_at_rest" and w.axis == "z"]
    assert [w.file for w in warned] == ["003_up.csv"] * told


def test_gravity_turns_in_a_rest() -> None:
    session = sound()

    def tipped(run: Run) -> Run:
        angle = np.linspace(0, np.pi / 2, len(run))
        return changed(run, ax_g=np.sin(angle), az_g=run.face_sign * np.cos(angle))

    (told,) = check(one(session, first_rest(session), tipped))
    assert told.code == "not_at_rest"
    assert "gravity" in told.text


def test_a_few_wrong_packets_turn_no_gravity() -> None:
    rng, t_s = np.random.default_rng(1), np.arange(20000) / 50
    acc_g = rng.normal([0.0, 0.0, 1.0], 0.002, (t_s.size, 3))
    acc_g[9000:9003] = [-26.0, -11.0, 26.0]
    columns = {f"a{axis}_g": acc_g[:, i] for i, axis in enumerate("xyz")}
    still = make_run(t_s, rng.normal(0, 0.05, (t_s.size, 3)), table_rate_dps=0.0, **columns)
    assert "not_at_rest" not in {w.code for w in check(make_session(still))}


def test_a_face_at_rest_that_gravity_contradicts() -> None:
    session = sound()
    (told,) = check(one(session, first_rest(session), turned_over))
    assert (told.code, told.file) == ("face_wrong", session.runs[first_rest(session)].file)


def test_an_accelerometer_of_another_sign_is_no_contradiction() -> None:
    assert check(everywhere(sound(), lambda r: changed(r, az_g=-r.table["az_g"], ax_g=-r.table["ax_g"]))) == []


def test_a_reading_that_stands_still_for_half_a_second() -> None:
    session = sound()

    def hangs(run: Run) -> Run:
        y = run.gyro_dps[:, 2].copy()
        y[200:290] = y[200]
        return changed(run, gz_dps=y)

    (told,) = check(one(session, first_turning(session), hangs))
    assert (told.code, told.axis, told.blocking) == ("constant_reading", "z", True)


def test_a_dead_axis_that_nobody_turns_about_is_left_out() -> None:
    session = everywhere(sound(), lambda r: changed(r, gx_dps=np.zeros(len(r))))
    (told,) = check(session)
    assert (told.code, told.axis, told.blocking) == ("axis_absent", "x", False)
    found = diagnose(session)
    assert found.verdict == "adequate"
    assert {c.axis for c in found.candidates} == {"y", "z"}
    compared = found.comparison
    assert [row[0] for row in level_rows(compared)] == ["x (not judged)", "y", "z", "all (without x)"]
    assert compared.pooled.rms_dps == pytest.approx(np.hypot(*(compared.per_axis[a].rms_dps for a in "yz")) / 2**0.5, rel=1e-3)


@pytest.mark.parametrize("noise_counts", [0.0, 0.2])
def test_coarse_counts_may_hide_the_noise(noise_counts: float) -> None:
    """A range of 2000 dps at rest: 0.07 dps a count, and less noise than half of it."""
    rng = np.random.default_rng(0)

    def coarse(run: Run) -> Run:
        y = rng.normal(0.02, noise_counts * 0.07, (len(run), 3))
        return changed(run, **{f"g{a}_dps": np.round(y[:, i] / 0.07) * 0.07 for i, a in enumerate("xyz")})

    session = replace(
        sound().with_runs([r for r in sound().runs if r.table_rate_dps == 0]), lsb_dps=0.07, full_scale_dps=2000.0
    )
    assert [w.code for w in check(everywhere(session, coarse)) if w.blocking] == []


@pytest.mark.parametrize(
    ("code", "slip"),
    [
        ("accel_unit", lambda r: changed(r, **{f"a{a}_g": r.table[f"a{a}_g"] * 9.80665 for a in "xyz"})),
        ("temp_unit", lambda r: changed(r, temp_c=r.table["temp_c"] + 273.15)),
        ("sample_rate", lambda r: changed(r, t_s=r.t_s * 1.1)),
        ("sample_rate", lambda r: changed(r, t_s=r.t_s * 1e3)),
        ("first_sample", lambda r: changed(r, gz_dps=np.concatenate([[r.gyro_dps[0, 2] + 9.0], r.gyro_dps[1:, 2]]))),
        ("clipped", lambda r: changed(r, gz_dps=np.clip(r.gyro_dps[:, 2], -125.0, 125.0))),
    ],
    ids=["m/s2", "kelvin", "rate", "ms", "first", "clipped"],
)  # fmt: skip
def test_what_is_told_and_does_not_block(code: str, slip: Callable[[Run], Run]) -> None:
    told = check(everywhere(sound(), slip))
    assert {(w.code, w.blocking) for w in told} == {(code, False)}
    assert code != "sample_rate" or ("ms?" in told[0].text) == ("0.145" in told[0].text)


def test_a_model_that_knows_the_limit_is_not_warned() -> None:
    session = everywhere(sound(), lambda r: changed(r, gz_dps=np.clip(r.gyro_dps[:, 2], -125.0, 125.0)))
    assert check(session, Model.builtin("default").add("saturation", "z")) == []


def rests_in(unit: float) -> Session:
    session = sound()
    rests = session.with_runs([r for r in session.runs if r.table_rate_dps == 0])
    return everywhere(
        replace(rests, lsb_dps=None),
        lambda r: changed(r, **{f"g{a}_dps": r.gyro_dps[:, i] / unit for i, a in enumerate("xyz")}),
    )


def test_nothing_turns_and_the_noise_is_57_times_too_small() -> None:
    assert check(rests_in(1.0)) == []
    (told,) = check(rests_in(DEG))
    assert (told.code, told.blocking) == ("unit_unsure", False)


def test_keys_that_nobody_reads(tmp_path: Path) -> None:
    sound().save(tmp_path / "s")
    header = tmp_path / "s" / "session.toml"
    text = header.read_text().replace("table_rate_dps = 0.0", "table_rate = 0.0\ntable_rate_dps = 0.0", 1)
    header.write_text('sampling_rate_hz = 3\nboard = "b7"\nmade_on = 2026-01-02\n' + text)
    told = check(Session.open(tmp_path / "s"))
    assert [w.code for w in told] == ["unknown_key"] * 2
    assert "sample_rate_hz" in told[0].text
    assert "table_rate_dps" in told[1].text
    assert told[1].file is not None


@pytest.mark.parametrize("accept", ["sign_flipped", "sign_flipped:z"])
def test_an_accepted_warning_stays_and_does_not_block(tmp_path: Path, accept: str) -> None:
    everywhere(sound(), scaled(-1.0)).save(tmp_path / "s")
    header = tmp_path / "s" / "session.toml"
    header.write_text(f'accept = ["{accept}"]\n' + header.read_text())
    session = Session.open(tmp_path / "s")
    assert [(w.code, w.blocking) for w in check(session)] == [("sign_flipped", False)]
    again = session.save(tmp_path / "again")
    assert Session.open(tmp_path / "again").accept == again.accept == (accept,)


@pytest.mark.parametrize(
    ("entry", "nearest"),
    [("rate_wrang", "'rate_wrong'"), ("bias_implausable:x", "'bias_implausible:x'"), ("face_wrong:w", "'face_wrong:z'")],
)
def test_accepting_what_is_no_warning(entry: str, nearest: str) -> None:
    (told,) = check(replace(sound(), accept=(entry, "not_at_rest", "face_wrong:y")))
    assert (told.code, told.blocking) == ("unknown_key", False)
    assert nearest in told.text


def test_the_documentation_has_every_code_and_no_other() -> None:
    page = (Path(__file__).parents[2] / "docs" / "warnings.md").read_text()
    assert set(re.findall(r"^\| `(\w+)`", page, re.MULTILINE)) == set(CODES)


def test_exchanged_axes_say_what_each_follows() -> None:
    (told,) = check(everywhere(sound(), swapped))
    figure = re.search(r"z follows its rate with 0\.0\d* and x with (\d\.\d+)", told.text)
    assert figure is not None
    assert float(figure[1]) == pytest.approx(1.0, abs=0.031)  # sensors differ by up to 3 %


def test_accepting_another_axis_is_no_acceptance() -> None:
    session = replace(everywhere(sound(), scaled(-1.0)), accept=("sign_flipped:x", "face_wrong"))
    assert [w.blocking for w in check(session)] == [True]


CAMPAIGNS = (("paper", 4), ("full", 1), ("swing", 1), ("bench", 1), ("table2", 4))


@pytest.mark.parametrize(("campaign", "effect"), list(product(CAMPAIGNS, ["", *effects()])))
def test_sound_sessions_are_left_in_peace(campaign: tuple[str, int], effect: str) -> None:
    told = check(sound(*campaign, 6.0, effect))
    assert {w.code for w in told} <= ({"clipped"} if effect == "saturation" else set())


@pytest.mark.parametrize("noise_dps", [0.0005, 0.3])
def test_other_grades_of_sensor(noise_dps: float) -> None:
    rng = np.random.default_rng(2)

    def noisy(run: Run) -> Run:
        rate = np.column_stack([np.zeros((len(run), 2)), run.rate_dps])
        y = rate + rng.normal(0, noise_dps, rate.shape)
        return changed(run, **{f"g{a}_dps": y[:, i] for i, a in enumerate("xyz")})

    for session in (sound(), paper(), sound("swing", 1, 10.0)):
        assert check(everywhere(replace(session, lsb_dps=None), noisy)) == []


@pytest.mark.parametrize("kept", [(0,), (0, 1), (0, 3), (3,), (3, 4), (0, 0)])
def test_few_runs(kept: Sequence[int]) -> None:
    session = sound()
    assert check(session.with_runs([session.runs[i] for i in sorted(set(kept))])) == []


def test_a_turn_by_hand() -> None:
    """One turn of 360 degrees known by its angle, beside a rest."""
    session = sound()
    rest = session.runs[first_rest(session)]
    rate = 72.0 * (1 - np.cos(np.linspace(0, 2 * np.pi, len(rest), endpoint=False)))
    turn = changed(rest, gz_dps=np.round((rate * 1.004 + rest.gyro_dps[:, 2]) / LSB_DPS) * LSB_DPS)
    angle = float(rate.mean()) * rest.duration_s
    turn = replace(turn, file="turn.csv", index=1, table_rate_dps=None, turn_deg=angle, turn_se_deg=0.0)
    assert check(session.with_runs([rest, turn])) == []
    (told,) = check(session.with_runs([rest, replace(turn, turn_deg=-angle)]))
    assert told.code == "sign_flipped"
    slow = everywhere(session.with_runs([rest, turn]), lambda r: changed(r, t_s=r.t_s * 1e3))
    assert [w.code for w in check(slow)] == ["sample_rate"]  # a turn takes a thousand times as long: no matter of the scale


def test_spreads_of_power_cycles_do_not_absorb_a_mistake() -> None:
    found = compare(cycles_apart(56.0)(sound()))
    assert found.fit.axes["z"].turn_on_sd_dps <= 5.0 * (1 + 1e-12)  # the bound is held in the logarithm
    assert found.per_axis["z"].floor_dps < 5.1


def test_gains_of_faults_of_the_reading_are_bounded_by_what_the_data_hold() -> None:
    """A reading without noise and a few outliers: no reading tells more than the logarithm of its range over its step."""
    rng = np.random.default_rng(0)

    def silent(run: Run) -> Run:
        y = np.full(len(run), 0.35) + 0.07 * (run.index % 3)
        y[rng.integers(30, len(run), 4)] += 3.5
        return changed(run, gz_dps=np.round(y / 0.07) * 0.07)

    session = sound()
    rests = replace(session.with_runs([r for r in session.runs if r.table_rate_dps == 0]), lsb_dps=LSB_DPS)
    found = diagnose(replace(everywhere(rests, silent), accept=("constant_reading",)))
    gains = [c.gain for c in found.candidates if c.gain is not None and c.effect.fault_of(c.values) is not None]
    assert gains
    assert max(map(abs, gains)) < sum(map(len, rests.runs)) * np.log(10.0 / 0.07)
