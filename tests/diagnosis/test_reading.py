"""Faults that show in the reading's own code: a stuck bit, told from a bit that noise never reaches."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import proven, without_unphysical
from gyrocal.diagnosis.residual.reading_tests import _never, reading_fault
from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model, Term
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate
from known import without_evidence
from make_runs import make_run, make_session

LSB_DPS = 0.00875


@pytest.mark.parametrize(("bit", "state"), [(3, 0), (3, 1), (4, 0), (6, 1)])
def test_the_chance_of_a_quiet_bit_is_that_of_a_gaussian_reading(bit: int, state: int) -> None:
    rng = np.random.default_rng(bit)
    y_dps = rng.normal(0.31, 0.044, 400_000)
    kept = float(np.mean((np.rint(y_dps / LSB_DPS).astype(int) >> bit) & 1 == state))
    few = y_dps[:12]
    expected = kept**few.size
    sd, mean = 0.044, 0.31
    shaped = (few - few.mean()) / np.sqrt(np.mean(np.diff(few) ** 2) / 2) * sd + mean  # just that mean and noise
    assert _never([shaped], LSB_DPS, bit, state) == pytest.approx(expected, rel=0.05, abs=1e-6)


def test_a_fault_without_a_sure_gain_needs_codes_beyond_doubt() -> None:
    """Clipping was named from a gain of 1.3 of its standard errors and codes that one of some hundred sound axes has."""
    weak = Candidate(effect("saturation"), "y", "suggest", {"full_scale_dps": 0.61}, gain=4.7, gain_se=3.7, chance=3e-5)
    assert not proven(weak, tested=60)
    assert proven(replace(weak, chance=1e-12), tested=60)
    assert proven(replace(weak, gain=9.0), tested=60)


def test_a_grid_that_the_codes_show_is_there_however_little_it_lets_predict() -> None:
    """Nine values in 26 000 readings, and a step nine times the noise: a held-out loss of 2747 had made it a rejected one."""
    grid = Candidate(effect("quantization"), "y", "suggest", {"lsb_dps": 1.952}, gain=-2747.0, gain_se=900.0, chance=1e-300)
    assert proven(grid, tested=60)
    assert without_unphysical([grid])[0].decision == "suggest"
    loss = Candidate(effect("saturation"), "y", "suggest", {"full_scale_dps": 0.61}, gain=-2747.0, gain_se=900.0, chance=1e-300)
    assert not proven(loss, tested=60)
    assert without_unphysical([loss])[0].decision == "reject"


def stuck(session: Session, bit: int, state: int) -> Session:
    def reading(run: Run) -> np.ndarray:
        codes = np.rint(run.gyro_dps[:, 0] / LSB_DPS).astype(int)
        return (codes | (1 << bit) if state else codes & ~(1 << bit)) * LSB_DPS

    return session.with_runs(replace(r, frame=r.table.with_columns(gx_dps=reading(r))) for r in session.runs)


@pytest.mark.parametrize(("bit", "state"), [(0, 1), (2, 0), (3, 1), (3, 0)])
def test_a_stuck_bit_is_seen_and_a_sound_reading_is_not_blamed(bit: int, state: int) -> None:
    session = simulate(None, "paper", [], 4, scenarios=3, seconds=20)[0]
    assert all(reading_fault(session, axis, 1e-3) is None for axis in "xyz")
    found = reading_fault(stuck(session, bit, state), "x", 1e-3)
    assert found is not None
    assert found.note.startswith(f"bit {bit} of the reading is {state}")


def test_a_calibration_leaves_clipped_readings_out() -> None:
    """A range of less than the table swings by: what reads the limit says nothing of the scale."""
    session = simulate(None, "swing", [], 3, scenarios=2, seconds=20)[0]
    full_scale_dps = 0.8 * min(float(np.abs(r.gyro_dps[:, 2]).max()) for r in session.runs)
    clipped = session.with_runs(
        replace(r, frame=r.table.with_columns(gz_dps=np.clip(r.gyro_dps[:, 2], -full_scale_dps, full_scale_dps)))
        for r in session.runs
    )
    model = Model.builtin("paper").with_term(Term("saturation", "z", {"full_scale_dps": full_scale_dps}))
    for spoilt, sound in zip(*(calibrate(s, [20.0], ["model"], model=model) for s in (clipped, session)), strict=True):
        assert abs(spoilt.scale - sound.scale) < 4 * spoilt.scale_se
        assert sound.scale_se < spoilt.scale_se
    blind = calibrate(clipped, [20.0], ["model"], model=Model.builtin("paper"))[0]
    assert abs(blind.scale - sound.scale) > 100 * blind.scale_se


def test_runs_far_beyond_the_range_are_clipped_although_no_reading_lies_just_below_it() -> None:
    """Where the whole noise is clipped, nothing below the limit predicts its count, and it passed for noise."""
    rng = np.random.default_rng(6)
    made = []
    for i, rate_dps in enumerate((0.0, 60.0, -60.0, 150.0, -150.0) * 2):
        turned = np.column_stack([np.zeros((400, 2)), np.full(400, rate_dps)]) + rng.normal(0, 0.03, (400, 3))
        gyro = np.rint(np.clip(turned, -125.0, 125.0) / LSB_DPS) * LSB_DPS
        made.append(make_run(np.arange(400) / 50.0, gyro, table_rate_dps=rate_dps, scenario=f"s{i}", day=1 + i % 2))
    found = diagnose(make_session(*made))
    assert found.best is not None
    assert (found.verdict, found.best.effect.id, found.best.axis) == ("add", "saturation", "z")
    assert found.best.values["full_scale_dps"] == pytest.approx(125.0, abs=LSB_DPS)


def test_a_reading_that_dwells_everywhere_is_not_clipped() -> None:
    """Coarse counts stay at one value for many samples, at the largest one as at any other."""
    rng = np.random.default_rng(8)
    slow_dps = np.cumsum(rng.normal(0, 0.002, (3000, 3)), axis=0)
    run = make_run(np.arange(3000) / 50.0, np.rint(slow_dps / 0.1) * 0.1, table_rate_dps=0.0)
    assert effect("saturation").fault is not None
    assert all(effect("saturation").fault.detect([run], axis) is None for axis in range(3))


@pytest.mark.wide
@pytest.mark.parametrize("step_dps", [pytest.param(0.05, marks=pytest.mark.wide), 0.1])
def test_a_log_with_few_decimals_is_named_quantization(step_dps: float) -> None:
    """Steps that are no whole number of counts were told as a bit of the reading, and named by nothing."""
    sound, _ = simulate(None, "full", [], 5, scenarios=2, seconds=15.0)
    session = sound.with_runs(
        replace(r, frame=r.table.with_columns(**{
            f"g{axis}_dps": pl.Series(np.rint(r.gyro_dps[:, i] / step_dps) * step_dps) for i, axis in enumerate("xyz")
        }))
        for r in sound.runs
    )  # fmt: skip
    with without_evidence():  # which weighs no fault of the reading
        found = diagnose(session)
    assert not any("bit" in f.note for f in found.comparison.where)
    assert any(f"whole multiples of {step_dps:g} dps" in f.note for f in found.comparison.where)
    named = [c for c in found.candidates if c.decision == "add"]
    assert {c.effect.id for c in named} == {"quantization"}
    assert all(c.values["lsb_dps"] == pytest.approx(step_dps) for c in named)


def test_coarse_counts_that_stay_longest_at_the_largest_value_are_not_clipped() -> None:
    """A run whose noise is below a count leaves its largest value in the last part alone, and another one never does."""
    rng = np.random.default_rng(9)
    made = []
    for i, (rate_dps, slow_dps) in enumerate(((150.0, -0.07), (60.0, -0.07), (150.0, 0.0))):
        level_dps = 0.94 * rate_dps - 4.08 + np.where(np.arange(6000) < 4000, 0.0, slow_dps)[:, None]
        gyro = np.rint((level_dps + rng.normal(0, 0.01, (6000, 3))) / 0.14) * 0.14
        made.append(make_run(np.arange(6000) / 100.0, gyro, table_rate_dps=rate_dps, scenario=f"s{i}"))
    fault = effect("saturation").fault
    assert fault is not None
    for runs in (made[:1], made):
        assert all(found is None or found.chance > 1e-4 for found in (fault.constant(runs, axis) for axis in range(3)))  # type: ignore[attr-defined]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("at", [0, 700])
def test_one_wild_reading_stops_no_bit(seed: int, at: int) -> None:
    """A first reading that was 57 deg/s off made the noise look so large that bit 8 should have toggled."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(1450) / 145
    runs = []
    for i in range(6):
        gyro = rng.normal(0.3, 0.05, (t_s.size, 3))
        gyro[at, 0] += 57.0 * (i == 3)
        runs.append(make_run(t_s, np.rint(gyro / LSB_DPS) * LSB_DPS, table_rate_dps=0.0, scenario=f"s{i // 2}"))
    assert reading_fault(make_session(*runs, lsb_dps=LSB_DPS), "x", 1e-4) is None
