"""Time stamps in bursts: the true times come back, lost samples are counted, true uneven times are left alone."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.effects.base import table_angle_rad
from gyrocal.inference.blocks import reduce_run
from gyrocal.plausibility import check
from gyrocal.recording.cut import Cut
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import import_recording, read_recording
from gyrocal.recording.long_steps import misses_samples
from gyrocal.recording.stamps import PART, goes_back, in_bursts, lost, period_s, regression, step_range_s
from gyrocal.warning import Warning
from make_runs import make_run, make_session

PERIOD_S = 0.01


def true_times(lost: int, n: int = 20_000, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    kept = np.ones(n, dtype=bool)
    kept[rng.choice(np.arange(200, n - 200), lost, replace=False)] = False
    return np.arange(n)[kept] * PERIOD_S


def in_packets(true_s: np.ndarray, packet_s: float) -> np.ndarray:
    """Each sample is stamped when the packet that holds it arrives."""
    return np.ceil(true_s / packet_s) * packet_s


@pytest.mark.parametrize("lost", [0, 40])
@pytest.mark.parametrize("packet_s", [0.025, 0.047])
def test_bursts_are_undone_and_lost_samples_counted(packet_s: float, lost: int) -> None:
    true_s = true_times(lost)
    stamps_s = in_packets(true_s, packet_s)
    assert in_bursts(stamps_s)
    assert np.median(np.diff(stamps_s)) < 0.1 * PERIOD_S  # what the median step makes of such a log
    found = regression(stamps_s)
    assert np.std(found.t_s - true_s) < 0.15 * packet_s / 12**0.5
    assert np.diff(found.t_s).min() > 0
    assert found.period_s == pytest.approx(PERIOD_S, rel=3e-4)
    assert found.lost == pytest.approx(lost, abs=8)
    assert found.jitter_s == pytest.approx(np.std(stamps_s - true_s), rel=0.1)


def test_the_median_step_is_not_the_interval() -> None:
    """Stamps of 1 ms resolution and a clock of 998.4 samples in ten seconds: 1 / median step is 0.16 % wrong."""
    stamps_s = np.floor(np.arange(30_000) / 99.84 * 1e3) / 1e3
    assert abs(np.median(np.diff(stamps_s)) * 99.84 - 1) > 1.5e-3
    assert period_s(stamps_s) == pytest.approx(1 / 99.84, rel=1e-6)


def test_a_lost_sample_shifts_the_numbers_of_all_that_follow() -> None:
    t_s = np.delete(np.arange(4000) * PERIOD_S, [1000, 2000, 2001, 3000])
    assert regression(t_s).lost == 4
    assert period_s(t_s) == pytest.approx(PERIOD_S, rel=1e-9)


def test_true_uneven_times_are_no_bursts() -> None:
    rng = np.random.default_rng(1)
    for t_s in (
        np.sort(np.arange(3000) / 145 + rng.uniform(0, 0.003, 3000)),  # a poll that waits
        np.cumsum(rng.uniform(0.004, 0.016, 3000)),
        np.delete(np.arange(3000) / 100, rng.choice(3000, 300, replace=False)),
    ):
        assert not in_bursts(t_s)
        assert make_run(t_s).sample_s is not None
        np.testing.assert_array_equal(make_run(t_s).sample_s, t_s)


def test_a_log_that_starts_again_is_not_repaired() -> None:
    once = np.arange(1000) * PERIOD_S
    assert goes_back(np.concatenate([once, once]))
    assert not goes_back(in_packets(once, 0.05))


def test_angle_and_blocks_of_a_bursty_run_are_those_of_its_true_times() -> None:
    true_s = true_times(0, 3000)
    rate_dps = 80 * np.sin(2 * np.pi * 0.5 * true_s)
    stamps_s = in_packets(true_s, 0.047) + 2e-6 * np.arange(true_s.size)  # each stamp later than the one before
    bursty, even = (make_run(t, rate_ref_dps=rate_dps, rate_hz=100.0) for t in (stamps_s, true_s))
    angles = [np.rad2deg(table_angle_rad(run)) for run in (bursty, even)]
    assert np.max(np.abs(angles[0] - angles[1])) < 0.05
    blocks, want = reduce_run(bursty, 0), reduce_run(even, 0)
    assert blocks.start.size == want.start.size
    np.testing.assert_allclose(np.diff(blocks.t_s), 0.1, atol=1e-3)


def test_a_turn_in_uneven_times_has_the_mean_over_time() -> None:
    """A logger that is slow while the table turns: the mean over samples is 17 % off, the mean over time is the turn's."""
    steps = np.where((np.arange(2000) > 500) & (np.arange(2000) < 900), 0.02, 0.01)
    t_s = np.cumsum(steps)
    rate_dps = 90 * np.exp(-(((t_s - 9.0) / 1.5) ** 2))
    run = make_run(t_s, np.column_stack([0 * t_s, 0 * t_s, rate_dps]), turn_deg=float(90 * 1.5 * np.pi**0.5))
    left = reduce_run(run, 0).y_dps[0, 2]
    assert abs(left) < 1e-3 * rate_dps.mean()
    assert abs(rate_dps.mean() / run.rate_dps[0] - 1) > 0.1


def test_import_repairs_repeated_times_and_tells(tmp_path: Path) -> None:
    true_s = true_times(3, 2000)
    z_dps = 78.0 + 0.01 * np.sin(np.arange(true_s.size))
    frame = pl.DataFrame({"t": in_packets(true_s, 0.047), "x": 0.0, "y": 0.0, "z": z_dps})
    frame.write_csv(tmp_path / "log.csv")
    told: list[Warning] = []
    maps = ["t_s=t", *(f"g{a}_dps={a}" for a in "xyz")]
    session = import_recording(
        tmp_path / "log.csv", tmp_path / "out", maps, defaults={"table_rate_dps": 78.0}, warn=told.append
    )
    assert session.sample_rate_hz == pytest.approx(100, rel=2e-3)
    assert [w.code for w in told] == ["sample_rate"]
    assert "ms rms" in told[0].text
    assert "samples are missing" in told[0].text
    assert np.std(session.runs[0].t_s - true_s) < 3e-3
    assert not [w for w in check(session) if w.code == "sample_rate"]


@pytest.mark.parametrize("n", [3, PART, PART + 1, 2 * PART + 7])
def test_steps_and_interval_part_by_part_are_those_of_the_whole(n: int) -> None:
    t_s = 5.0 + np.arange(n) / 200 + np.random.default_rng(n).normal(0, 2e-4, n)
    steps = np.diff(t_s)
    assert step_range_s(t_s) == (steps.min(), steps.max())
    assert period_s(t_s) == pytest.approx(np.polyfit(np.arange(n), t_s, 1)[0], rel=1e-9)


@pytest.mark.parametrize(("count", "late"), [(1, 10), (5, 10), (20, 100), (1, -300)])
def test_rows_with_the_stamps_of_others_change_no_other_time(count: int, late: int) -> None:
    """A logger that writes some old rows in the place of new ones, or one stamp ahead: the course of all others is known."""
    true_s = np.arange(6000) / 100.0
    t_s = true_s.copy()
    t_s[4000 : 4000 + count] = true_s[4000 - late : 4000 - late + count]
    found = regression(t_s)
    assert found.lost == 0
    np.testing.assert_allclose(found.t_s, true_s, atol=1e-6)
    assert period_s(t_s) == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("part", [0.002, 0.1, 0.5])
def test_rows_that_were_written_twice_count_once(part: float, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    n = 2000
    table = np.column_stack([np.arange(n) / 100.0, rng.normal(0, 1, (n, 3))])
    again = np.sort(rng.choice(n, round(part * n), replace=False))
    written = table[np.sort(np.concatenate([np.arange(n), again]))]
    pl.DataFrame(written, schema=["t_s", "gx_dps", "gy_dps", "gz_dps"]).write_csv(tmp_path / "log.csv")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
    assert found.repaired == {"twice": again.size}
    np.testing.assert_allclose(found.session.runs[0].t_s, table[:, 0], atol=1e-6)
    cut = Options(cuts=[Cut.parse(f"a:0:{len(written)}")], defaults={"table_rate_dps": 0.0})
    assert len(read_recording(tmp_path / "log.csv", cut).session.runs[0]) == n


def test_a_copy_in_the_place_of_a_sample_stays(tmp_path: Path) -> None:
    """The logger took the old reading with its stamp, and the next one after two intervals: no sample is left over."""
    rng = np.random.default_rng(3)
    table = np.column_stack([np.arange(2000) / 100.0, rng.normal(0, 1, (2000, 3))])
    late = np.arange(50, 2000, 97)
    table[late] = table[late - 1]
    pl.DataFrame(table, schema=["t_s", "gx_dps", "gy_dps", "gz_dps"]).write_csv(tmp_path / "log.csv")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
    assert "twice" not in found.repaired
    assert len(found.session.runs[0]) == 2000
    assert found.session.runs[0].sample_rate_hz == pytest.approx(100.0, rel=1e-3)


@pytest.mark.parametrize("coarse", [False, True])
def test_samples_that_share_the_stamp_of_their_arrival_stay(coarse: bool, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    readings = rng.normal(0, 1, (2000, 3))
    readings = np.where(rng.uniform(size=(2000, 1)) < 0.05, 1.0, 0.0) + np.zeros((2000, 3)) if coarse else readings
    table = np.column_stack([np.arange(2000) // 10 / 10.0, readings])
    pl.DataFrame(table, schema=["t_s", "gx_dps", "gy_dps", "gz_dps"]).write_csv(tmp_path / "log.csv")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
    assert len(found.session.runs[0]) == 2000


@pytest.mark.parametrize("after", [0, 1])
def test_a_stale_stamp_loses_no_sample(after: int) -> None:
    """Now and then a stamp is that of the sample before, and the clock catches up at once or a sample later."""
    t_s = np.arange(6000) / 100
    for i in range(500, 5500, 450):
        t_s[i : i + 1 + after] -= 0.01
    found = regression(t_s)
    assert found.lost == 0
    assert found.period_s == pytest.approx(0.01, rel=1e-6)


def test_exchanged_rows_lose_no_sample() -> None:
    true_s = np.arange(6000) / 100.0
    t_s = true_s.copy()
    at = 50 + 37 * np.arange(20)
    t_s[at], t_s[at + 1] = true_s[at + 1], true_s[at]
    found = regression(t_s)
    assert found.lost == 0
    np.testing.assert_allclose(found.t_s, true_s, atol=1e-3)


@pytest.mark.parametrize("back_s", [0.04, 0.3, 2.0])
@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_a_clock_that_was_set_back_costs_no_time(back_s: float, jitter: float) -> None:
    true_s = np.arange(3000) * PERIOD_S
    stamps_s = true_s + np.random.default_rng(2).uniform(-jitter, jitter, 3000) * PERIOD_S
    stamps_s[1200:] -= back_s
    found = regression(stamps_s)
    assert found.period_s == pytest.approx(PERIOD_S, rel=1e-4)
    assert found.lost == 0
    assert np.std(found.t_s - true_s) < 0.1 * PERIOD_S
    ((place, by_s),) = found.set_back
    assert (place, by_s) == (1200, pytest.approx(back_s, abs=PERIOD_S / 4))


@pytest.mark.parametrize("first", [50, 1200, 2700])
@pytest.mark.parametrize("frozen", [20, 100, 200])
def test_a_clock_that_stood_still_costs_no_time(first: int, frozen: int) -> None:
    true_s = np.arange(3000) * PERIOD_S
    stamps_s = true_s.copy()
    stamps_s[first : first + frozen] = stamps_s[first]
    found = regression(stamps_s)
    assert found.period_s == pytest.approx(PERIOD_S, rel=1e-6)
    assert (found.lost, found.set_back) == (0, ())
    assert found.t_s - found.t_s[0] == pytest.approx(true_s, abs=1e-6)
    assert found.jitter_s == pytest.approx(np.std(stamps_s - true_s), rel=1e-3)


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.77])
@pytest.mark.parametrize("seconds", [10, 60])
@pytest.mark.parametrize("rate_hz", [49.7, 100.0, 208.3, 999.1])
def test_whole_seconds_give_the_rate(rate_hz: float, seconds: int, phase: float) -> None:
    """Hundreds of samples share a stamp, so that the steps of the clock are fewer than the gaps that are tolerated."""
    true_s = np.arange(int(rate_hz * seconds)) / rate_hz
    found = regression(np.floor(true_s + phase))
    assert found.lost <= 1
    assert found.period_s * rate_hz == pytest.approx(1, abs=1.5 / true_s.size + 1e-5)
    assert np.std(found.t_s - true_s) < 1 / rate_hz


def test_an_import_says_where_the_clock_was_set_back(tmp_path: Path) -> None:
    t_s = np.arange(2000) * PERIOD_S
    t_s[1000:] -= 0.3
    w = np.random.default_rng(0).normal(0, 0.1, (2000, 3))
    pl.DataFrame({"t_s": t_s, **{f"g{a}_dps": w[:, i] for i, a in enumerate("xyz")}}).write_csv(tmp_path / "log.csv")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
    (warned,) = [w for w in found.warnings if w.code == "sample_rate"]
    assert "log.csv: row 1002: the clock was set back by 0.3 s" in warned.text
    assert found.session.sample_rate_hz == pytest.approx(100.0)


@pytest.mark.parametrize("gap_s", [0.5, 4.4, 60.0])
def test_one_gap_in_a_short_log_is_no_interval(gap_s: float) -> None:
    """Two seconds of a radio link's whole milliseconds, of which some repeat, with a gap after half a second."""
    rng = np.random.default_rng(8)
    true_s = np.arange(2000) * 1e-3
    true_s[468:] += gap_s
    stamps_s = np.floor(1e3 * true_s + rng.normal(0, 0.3, 2000)) / 1e3
    stamps_s = np.maximum.accumulate(stamps_s)
    assert period_s(stamps_s) == pytest.approx(1e-3, rel=0.01)


def test_a_program_that_samples_when_it_comes_to_it_loses_nothing() -> None:
    """Its steps scatter and none catches up: counted as losses, they made the rate too high by half and more."""
    rng = np.random.default_rng(6)
    steps_s = 0.02 * np.clip(rng.gamma(9.0, 1 / 9.0, 6000), 0.45, 4.0)
    slow = np.where(np.arange(6000) % 900 < 60, 2.0, 1.0)  # other work, now and then
    t_s = np.concatenate([[0.0], np.cumsum(steps_s * slow)])
    assert lost(t_s, period_s(t_s)) == 0
    assert period_s(t_s) == pytest.approx(float(np.mean(np.diff(t_s))), rel=0.03)
    even_s = 0.02 * np.delete(np.arange(6001), [500, 2000, 2001]) + 0.006 * rng.random(5998)
    assert lost(even_s, period_s(even_s)) == 3
    assert period_s(even_s) == pytest.approx(0.02, rel=1e-4)


@pytest.mark.parametrize("part", [0.03, 0.08, 0.14])
def test_exact_stamps_with_lost_samples_lie_on_a_grid(part: float) -> None:
    """A tenth of the samples was lost, and half of that was taken for a slower clock."""
    rng = np.random.default_rng(round(1000 * part))
    kept = np.concatenate([[True], rng.random(4998) > part, [True]])
    t_s = np.arange(5000)[kept] * 0.1 + rng.normal(0, 0.0015, kept.sum())
    found = regression(t_s)
    assert found.lost == 5000 - kept.sum()
    assert found.period_s == pytest.approx(0.1, rel=1e-4)
    assert period_s(t_s) == found.period_s


def test_ticks_that_serve_one_sample_or_two_are_no_losses() -> None:
    t_s = np.floor(np.arange(5000) * 1.5) / 1000
    assert regression(t_s).lost == 0
    assert period_s(t_s) == pytest.approx(0.0015, rel=1e-3)


def test_another_rate_for_a_while_is_no_loss() -> None:
    """15 s at 100 Hz and 30 s at 10 Hz: nine of ten samples of the whole were said to be missing."""
    rng = np.random.default_rng(5)
    t_s = np.concatenate([np.arange(1500) * 0.01, 15 + np.arange(300) * 0.1])
    found = regression(t_s)
    assert not found.even
    assert found.lost == 0
    np.testing.assert_array_equal(found.t_s, t_s)
    repeated = t_s.copy()
    repeated[[200, 201, 1600]] = repeated[[199, 199, 1599]]
    mended = regression(repeated)
    assert np.diff(mended.t_s).min() > 0
    assert np.abs(mended.t_s - t_s).max() < 0.1
    run = make_run(t_s, rng.normal(0, 0.05, (t_s.size, 3)), table_rate_dps=0.0, rate_hz=float(1 / period_s(t_s)))
    (told,) = check(make_session(run))
    assert told.code == "sample_rate"
    assert "missing" not in told.text


def test_what_a_program_took_when_it_came_to_it_has_its_mean_rate_and_no_losses() -> None:
    """Its steps grow from 8 to 13 ms; and delays that later samples do not catch up with."""
    rng = np.random.default_rng(6)
    growing = np.cumsum(np.where(np.arange(1500) < 250, 0.0085, 0.0115) + rng.uniform(-0.001, 0.001, 1500))
    assert period_s(growing) == pytest.approx((growing[-1] - growing[0]) / 1499, rel=1e-6)
    delays_s = np.where(rng.random(6000) < 0.07, rng.uniform(0.001, 0.0025, 6000), 0.0)
    delayed = np.cumsum(0.0026 + rng.normal(0, 2e-5, 6000) + delays_s)
    assert regression(delayed).lost == 0
    assert not regression(delayed).even


def test_in_whole_seconds_a_loop_that_wanders_loses_nothing_and_an_exact_sampler_its_losses() -> None:
    """Nineteen samples to a second: 11 of 1927 were said to be missing, and the rate was half a percent too high."""
    rng = np.random.default_rng(8)
    loop_s = 1.7 + 0.05176 * (np.arange(2000) + np.cumsum(rng.normal(0, 0.09, 2000)))
    found = regression(np.floor(loop_s))
    assert (found.lost, found.even) == (0, True)
    assert found.period_s == pytest.approx(np.polyfit(np.arange(2000), loop_s, 1)[0], rel=3e-4)
    for seed in range(6):
        kept = np.delete(np.arange(2000), np.random.default_rng(seed).choice(np.arange(50, 1950), 3, replace=False))
        assert regression(np.floor(0.3 + 0.05176 * kept)).lost == 3
    paused_s = loop_s + np.where(np.arange(2000) < 900, 0.0, 12.0)
    assert regression(np.floor(paused_s)).lost == pytest.approx(232, abs=20)


@pytest.mark.parametrize("first", [5, 90, 470])
@pytest.mark.parametrize(("interval_ms", "off"), [(1.001, 8), (4.995, 1)])
def test_a_long_gap_with_another_loss_right_after_it_is_counted(first: int, interval_ms: float, off: int) -> None:
    """Stamps in whole ms of a logger that stalls just after it began: as many are missing as there is room for."""
    number = np.concatenate([np.arange(first), [first + 73], first + 77 + np.arange(5000)])
    t_s = np.floor(interval_ms * number + np.random.default_rng(0).uniform(0, 1, number.size)) / 1e3
    found = regression(t_s)
    assert found.even
    assert found.lost == pytest.approx(76, abs=off)
    assert found.period_s == pytest.approx(interval_ms / 1e3, rel=2e-3)


def test_a_long_pause_of_a_program_s_loop_is_missing_samples() -> None:
    steps = np.random.default_rng(2).choice([0.005, 0.006, 0.007, 0.008], 4000, p=[0.1, 0.6, 0.2, 0.1])
    t_s = np.cumsum(steps)
    interval_s = float(steps.mean())
    assert lost(t_s, interval_s) == 0
    late = t_s + np.where(np.arange(4000) >= 3987, 0.1, 0.0)
    assert lost(late, interval_s) == pytest.approx(0.1 / interval_s, abs=1)
    assert not regression(late).even


def test_a_poll_that_makes_up_for_long_steps_has_the_mean_rate_and_misses_nothing() -> None:
    """Steps of 10.24 ms and every twentieth of 5.12 ms were 100.19 samples a second, and calibrate missed some."""
    rng = np.random.default_rng(8)
    steps_s = np.full(6000, 10.24e-3)
    steps_s[rng.choice(steps_s.size, 290, replace=False)] = 5.12e-3
    late = rng.choice(np.arange(1, steps_s.size - 1), 20, replace=False)
    steps_s[late], steps_s[late + 1] = 15.8e-3, 4.68e-3
    t_s = np.concatenate([[0.0], np.cumsum(steps_s + rng.normal(0, 5e-5, steps_s.size))])
    true_s = float(t_s[-1]) / (t_s.size - 1)
    assert period_s(t_s) == pytest.approx(true_s, rel=1e-4)
    run = make_run(t_s, np.zeros((t_s.size, 3)), rate_hz=1 / true_s)
    assert np.any(np.diff(t_s) > 1.5 * true_s)
    assert not misses_samples(run)
    paused = make_run(t_s + 0.2 * (t_s > 20), np.zeros((t_s.size, 3)), rate_hz=1 / true_s)
    assert misses_samples(paused)
    assert not misses_samples(paused, 2500)


def slipping(steps: int, period_s: float, seed: int) -> tuple[np.ndarray, int]:
    """Stamps of a loop with so many steps that skips turns of it, and whose phase slips now and then; and how many it skips."""
    rng = np.random.default_rng(seed)
    turns = rng.choice([1.0, 2.0, 0.75], steps, p=[0.885, 0.08, 0.035])
    stamps_s = np.concatenate([[0.0], np.cumsum(period_s * turns + rng.normal(0, 0.005 * period_s, steps))])
    return stamps_s, int(np.sum(turns == 2.0))


@pytest.mark.parametrize("seed", range(3))
def test_what_a_loop_skips_is_missing_also_where_its_phase_slips(seed: int) -> None:
    """5 samples a second of which 46 of 634 were missing were told as 4.63 and none."""
    t_s, skipped = slipping(587, 0.2, seed)
    found = regression(t_s)
    assert (found.lost, found.even) == (skipped, False)
    np.testing.assert_array_equal(found.t_s, t_s)
    assert found.period_s == pytest.approx(0.2, rel=0.015)
    run = make_run(t_s, np.zeros((t_s.size, 3)), rate_hz=1 / period_s(t_s))
    assert misses_samples(run)
    assert lost(t_s, period_s(t_s)) == skipped


def test_one_sample_or_two_to_a_tick_by_chance_have_no_even_course(tmp_path: Path) -> None:
    """Half of the ticks of 0.2 s bring one of the two samples: a line through their numbers was off by 0.15 s rms."""
    rng = np.random.default_rng(3)
    count = rng.choice([1, 2], 120)
    tick_s = 0.2 * np.arange(120) + rng.normal(0, 0.01, 120)
    t_s = np.repeat(tick_s, count) + np.where(np.arange(count.sum()) % 3, 0.0, 0.004)
    found = regression(t_s)
    assert (found.lost, found.even) == (0, False)
    assert np.abs(found.t_s - np.maximum.accumulate(t_s)).max() < 0.25
    pl.DataFrame({"t": t_s, **{a: rng.normal(0, 0.05, t_s.size) for a in "xyz"}}).write_csv(tmp_path / "log.csv")
    maps = ("t_s=t:s", *(f"g{a}_dps={a}:dps" for a in "xyz"))
    read = read_recording(tmp_path / "log.csv", Options(maps=maps, defaults={"table_rate_dps": 0.0}))
    told = [w.text for w in (*read.warnings, *check(read.session)) if w.code in ("sample_rate", "samples_lost")]
    assert len(told) == 1
    assert "missing" not in told[0]
    even = regression(np.floor(np.arange(400) * 0.127 / 0.2) * 0.2)  # an even sampler has one or two to a tick as well
    assert (even.lost, even.even) == (0, True)


def test_a_late_reading_of_an_even_course_is_none_that_is_missing() -> None:
    """Some steps of 18 ms among steps of 11 and 12 ms: calibrate said that samples are missing, and import that none is."""
    steps_s = np.full(6000, 0.01133)
    steps_s[170::466] += 0.0066
    t_s = np.floor(1e3 * np.concatenate([[0.0], np.cumsum(steps_s)])) / 1e3
    run = make_run(t_s, np.zeros((t_s.size, 3)), rate_hz=1 / period_s(t_s))
    assert np.diff(t_s).max() > 1.5 / run.sample_rate_hz
    assert lost(t_s, period_s(t_s)) == 0
    assert not misses_samples(run)
