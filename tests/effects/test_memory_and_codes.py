"""Laws of effects that no formula expresses: a dead band, a hysteresis, and codes that are put together wrongly."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.naming.judge import contradicts
from gyrocal.effects.base import Objection, effect
from gyrocal.effects.byte_fault import carried, lost_carry
from gyrocal.effects.dead_band import outliers_of
from gyrocal.effects.optional import is_left_of_a_line
from gyrocal.effects.order_tone import spectrum_over_turns, told_from_frequency
from gyrocal.effects.single_bits import single_power
from gyrocal.effects.thermal_hysteresis import play_c
from gyrocal.recording.session import Run, following
from make_runs import make_run as make
from make_runs import make_session

from .conftest import Array, MakeRun

CONTRADICTED = Objection.CONTRADICTED
LSB_DPS = 0.00875


def swinging(make_run: MakeRun, reading: Array, w_dps: Array) -> Run:
    gyro = np.zeros((w_dps.size, 3))
    gyro[:, 2] = reading
    return make_run(np.arange(w_dps.size) / 100, gyro, rate_ref_dps=w_dps)


def test_rates_in_the_dead_band_read_as_zero_and_others_as_they_are(make_run: MakeRun) -> None:
    w_dps = np.linspace(-3.0, 3.0, 601)
    run = swinging(make_run, w_dps, w_dps)
    reads = w_dps + effect("dead_band").term(run, 2, {"width_dps": 0.995, "depth": 1.0})
    np.testing.assert_allclose(reads, np.where(np.abs(w_dps) < 0.995, 0.0, w_dps), atol=1e-12)
    assert not np.any(effect("dead_band").term(run, 0, {"width_dps": 0.995, "depth": 1.0}))


def test_what_a_dead_band_swallows_is_no_outlier(make_run: MakeRun) -> None:
    """The table passes quickly through zero, so that a few readings at a time are lost. A reading lost at a high rate stays."""
    rng = np.random.default_rng(3)
    w_dps = 60 * np.sin(2 * np.pi * 0.3 * np.arange(6000) / 100)
    lost = np.where(np.abs(w_dps) < 1.5, 0.0, w_dps) + rng.normal(0, 0.03, w_dps.size)
    lost[40] += 5.0
    run = swinging(make_run, lost, w_dps)
    assert outliers_of(run, 2, lost - w_dps)[0].tolist() == [40]


def test_the_two_branches_of_a_hysteresis_are_its_width_apart(make_run: MakeRun) -> None:
    """Warming reads +A, cooling -A, whatever the speed. After a turn, the way to the other branch is the width."""
    amplitude, width_c = 0.1, 4.0
    for period_s in (600.0, 1800.0):
        t_s = np.arange(0.0, 2 * period_s, 0.1)
        temp_c = 25 + 20 * np.sin(2 * np.pi * t_s / period_s)
        values = {"amplitude_dps": amplitude, "width_c": width_c}
        term = effect("thermal_hysteresis").term(make_run(t_s, temp_c=temp_c), 2, values)
        down, up = np.searchsorted(t_s, [1.5 * period_s, 2.0 * period_s - 0.2])
        np.testing.assert_allclose([term[up], term[down]], [amplitude, -amplitude], rtol=1e-6)
        top = int(np.argmax(temp_c[: t_s.size // 2]))
        crossed = top + int(np.argmax(term[top:] <= -0.99 * amplitude))
        assert temp_c[top] - temp_c[crossed] == pytest.approx(width_c, rel=0.05)


def test_a_hysteresis_stays_while_the_temperature_rests(make_run: MakeRun) -> None:
    t_s = np.arange(0.0, 300.0, 0.1)
    temp_c = 20 + np.clip(0.2 * t_s, 0.0, 20.0)
    term = effect("thermal_hysteresis").term(make_run(t_s, temp_c=temp_c), 2, {"amplitude_dps": -0.05, "width_c": 3.0})
    np.testing.assert_allclose(term[t_s > 50], -0.05, rtol=1e-6)
    assert term[0] == pytest.approx(0.0, abs=1e-3)


def test_a_hysteresis_remembers_over_the_runs_of_a_power_cycle(make_run: MakeRun) -> None:
    """A recording that is cut in three reads as it does in one piece: what creeps in glue does not know where a file ends."""
    t_s = np.arange(0.0, 900.0, 0.1)
    whole = make_run(t_s, temp_c=25 + 12 * np.sin(2 * np.pi * t_s / 500) + 2 * np.sin(2 * np.pi * t_s / 130))
    values = {"amplitude_dps": 0.1, "width_c": 5.0}
    expected = effect("thermal_hysteresis").term(whole, 2, values)
    parts = following([whole.part(first, first + 3000) for first in (0, 3000, 6000)])
    for k, part in enumerate(parts):
        term = effect("thermal_hysteresis").term(part, 2, values)
        np.testing.assert_allclose(term, expected[3000 * k : 3000 * (k + 1)], atol=0.002)
    assert effect("thermal_hysteresis").missing(parts[1:2], 2) is None


def test_a_play_follows_at_its_distance() -> None:
    np.testing.assert_allclose(play_c(np.array([0.0, 1.0, 3.0, 2.5, -2.0, -1.0]), 1.0), [0.0, 0.0, 2.0, 2.0, -1.0, -1.0])


def test_a_table_at_rest_has_no_order_tone(make_run: MakeRun) -> None:
    kind, values = effect("order_tone"), {"order": 3.0, "A_dps": 0.1, "phase_deg": 40.0}
    assert not np.any(kind.term(make_run(np.arange(100) / 10, table_rate_dps=0.0), 2, values))
    run = make_run(np.arange(3600) / 100, table_rate_dps=20.0)  # two turns
    term = kind.term(run, 0, values)
    assert term[0] == pytest.approx(0.1 * np.sin(np.deg2rad(40.0)))
    np.testing.assert_allclose(term[:1800], term[1800:], atol=1e-12)
    assert np.count_nonzero(np.diff(np.sign(term[:1800]))) == 6


def broken(make_run: MakeRun, w_dps: Array, bit: int, fraction: float, seed: int = 0) -> Run:
    rng = np.random.default_rng(seed)
    bare = swinging(make_run, np.zeros_like(w_dps), w_dps)
    sound = np.round((bare.gyro_dps + rng.normal(0, 0.03, (w_dps.size, 3)) + np.outer(w_dps, [0, 0, 1])) / LSB_DPS) * LSB_DPS
    kind = effect("byte_fault")
    values = kind.draw({"bit": bit, "step_dps": -(2**bit) * LSB_DPS, "fraction": fraction}, rng)
    fault = kind.fault_of(values)
    assert fault is not None
    return swinging(make_run, fault.distort(bare, sound, values, rng)[:, 2], w_dps)


@pytest.mark.parametrize("bit", [6, 7, 8])
def test_a_lost_carry_is_found_at_its_bit(make_run: MakeRun, bit: int) -> None:
    w_dps = 12 * np.sin(2 * np.pi * 0.05 * np.arange(6000) / 100)
    run = broken(make_run, w_dps, bit, 1.0)
    carry = lost_carry([run], 2)
    assert carry is not None
    assert (carry.bit, carry.below, carry.fraction) == (bit, 0.5, 1.0)
    term = effect("byte_fault").columns(run, 2, {"bit": float(bit), "below": 0.5, "fraction": 1.0})[:, 0] * -(2**bit) * LSB_DPS
    assert np.std(run.gyro_dps[:, 2] - term - w_dps) < 0.04


def test_the_bias_of_a_power_cycle_is_no_lost_carry() -> None:
    """Two power cycles whose biases differ by about 2^7 counts lacked a carry into bit 7."""
    rng, t_s = np.random.default_rng(3), np.arange(1500) / 100
    biases_dps, runs = (45 * LSB_DPS, (128 + 50.5) * LSB_DPS), []
    for cycle, bias_dps in enumerate(biases_dps):
        for _ in range(4):
            gyro = bias_dps + rng.normal(0, 0.005, (t_s.size, 3))
            codes_dps = np.round(gyro / LSB_DPS) * LSB_DPS
            runs.append(make(t_s, codes_dps, table_rate_dps=0.0, scenario=f"s{cycle}", lsb_dps=LSB_DPS))
    assert lost_carry(make_session(*runs, lsb_dps=LSB_DPS).runs, 2) is None
    together = make_session(*(replace(run, scenario="s0") for run in runs), lsb_dps=LSB_DPS).runs
    assert lost_carry(together, 2) is not None


@pytest.mark.parametrize("bit", [7, 8])
def test_a_low_part_that_is_added_as_a_signed_number_is_a_lost_carry(make_run: MakeRun, bit: int) -> None:
    """``(high << 8) + (int8_t)low`` takes 2^bit off every code in the upper half of the low bits."""
    w_dps = 12 * np.sin(2 * np.pi * 0.05 * np.arange(6000) / 100)
    codes = np.rint((w_dps + np.random.default_rng(bit).normal(0, 0.03, w_dps.size)) / LSB_DPS).astype(int)
    joined = np.where(codes % 2**bit >= 2 ** (bit - 1), codes - 2**bit, codes)
    run = swinging(make_run, joined * LSB_DPS, w_dps)
    carry = lost_carry([run], 2)
    assert carry is not None
    assert (carry.bit, carry.below, carry.fraction, carry.signed) == (bit, 0.5, 1.0, True)
    term = effect("byte_fault").columns(run, 2, {"bit": float(bit), "below": 0.5, "fraction": 1.0})[:, 0] * 2**bit * LSB_DPS
    assert np.std(run.gyro_dps[:, 2] - term - w_dps) < 0.04


def test_single_readings_without_a_carry_are_told_from_other_outliers(make_run: MakeRun) -> None:
    w_dps = 12 * np.sin(2 * np.pi * 0.05 * np.arange(6000) / 100)
    found = single_power([broken(make_run, w_dps, 7, 0.01)], 2)
    assert found is not None
    assert found[0] == 7
    rng = np.random.default_rng(2)
    spikes = w_dps + rng.normal(0, 0.03, w_dps.size)
    spikes[rng.integers(0, w_dps.size, 30)] += rng.choice((-1.0, 1.0), 30) * rng.uniform(0.7, 1.6, 30)
    assert single_power([swinging(make_run, np.round(spikes / LSB_DPS) * LSB_DPS, w_dps)], 2) is None


def torn(make_run: MakeRun, bit: int) -> Run:
    """Noise of a count and more, and now and then the upper part of the sample before."""
    rng = np.random.default_rng(6)
    codes = np.rint(2.0 + rng.normal(0, 1.4, 60_000)).astype(np.int64)
    before = np.concatenate([codes[:1], codes[:-1]])
    part = 1 << bit
    wrong = np.where(rng.random(codes.size) < 0.04, before - before % part + codes % part, codes)
    return swinging(make_run, wrong * LSB_DPS, np.zeros(codes.size))


def test_low_bits_show_a_torn_reading_whose_step_is_few_times_the_noise(make_run: MakeRun) -> None:
    """The step of bit 4 is eleven times the noise. Such readings were called outliers of a jumping bias."""
    assert (single_power([torn(make_run, 4)], 2) or (None,))[0] == 4
    rng = np.random.default_rng(7)
    spikes = rng.normal(0, 1.4, 40_000) + rng.choice([0.0, -16.0, 16.0], 40_000, p=[0.999, 0.0005, 0.0005])
    assert single_power([swinging(make_run, np.rint(spikes) * LSB_DPS, np.zeros(40_000))], 2) is None


def polled(chip: Array, every: float, repeats: float, rng: np.random.Generator) -> Array:
    """What a host reads that takes the newest of the chip's samples [m, 3] at each poll, in counts of 0.00875 dps."""
    newest = np.floor(np.arange(int(len(chip) / every)) * every).astype(np.intp)
    again = rng.random(newest.size) < repeats
    again[0] = False
    newest = newest[np.maximum.accumulate(np.where(again, 0, np.arange(newest.size)))]
    return np.asarray(np.rint(chip[newest] / LSB_DPS) * LSB_DPS)


def test_neighbours_that_chance_makes_equal_are_no_repeated_samples(make_run: MakeRun) -> None:
    """Polls at 0.6 of the chip's rate are one or two smooth samples apart, in turn, and the counts are coarse."""
    rng = np.random.default_rng(8)
    smooth = np.apply_along_axis(np.convolve, 0, rng.normal(0, 1.0, (100_000, 3)), np.hanning(9), "same")
    chip = 2.0 * LSB_DPS * smooth / smooth.std()
    fault = effect("sampling_fault").fault
    assert fault is not None
    for repeats, found in ((0.0, False), (0.02, True)):
        gyro = polled(chip, 1.666, repeats, np.random.default_rng(9))
        run = make_run(np.arange(len(gyro)) / 1000, gyro, table_rate_dps=0.0)
        assert (fault.detect([run], 0) is not None) is found


def test_a_narrow_dead_band_shows_in_turns_by_hand(make_run: MakeRun) -> None:
    """Steps of the readings from sample to sample are mostly motion, which was taken for noise."""
    rng = np.random.default_rng(10)
    w_dps = 70 * np.sin(2 * np.pi * 0.3 * np.arange(6000) / 100)
    noisy = w_dps + rng.normal(0, 0.0125, w_dps.size)
    lost = np.where(np.abs(w_dps) < 0.6, noisy - w_dps, noisy)
    assert effect("dead_band").tried_on([swinging(make_run, lost, w_dps)], 2, 1.0) == "samples"
    assert effect("dead_band").tried_on([swinging(make_run, noisy, w_dps)], 2, 1.0) is None


def test_a_dead_band_takes_small_rates_away_and_not_a_part_of_them() -> None:
    for width_dps, depth, objections in ((12.0, 0.008, [CONTRADICTED]), (0.2, 1.7, [CONTRADICTED]), (0.6, 0.8, [])):
        assert list(effect("dead_band").objections({"width_dps": width_dps, "depth": depth}, [], 2, ())) == objections


@pytest.mark.parametrize("repeats", [0, 3])
def test_few_repeated_readings_of_a_moving_rate_are_repeated_readings_and_no_outliers(make_run: MakeRun, repeats: int) -> None:
    """Three of 20000 readings: too few to be counted beside chance, but each stands out of the motion."""
    rng = np.random.default_rng(11)
    w_dps = 200 * np.sin(2 * np.pi * 0.5 * np.arange(20_000) / 400)
    chip = np.outer(w_dps, [0.01, 0.0, 1.0]) + rng.normal(0, 0.05, (w_dps.size, 3))
    for row in (2411, 8015, 15_203)[:repeats]:
        chip[row] = chip[row - 1]
    run = make_run(np.arange(len(chip)) / 400, np.round(chip / 0.0175) * 0.0175, rate_ref_dps=w_dps)
    sampling, jumps = effect("sampling_fault").fault, effect("bias_jumps").fault
    assert sampling is not None
    assert jumps is not None
    assert (sampling.detect([run], 2) is not None) is bool(repeats)
    assert jumps.detect([run], 2) is None


def test_readings_that_stand_out_without_being_repeated_are_no_repeated_ones(make_run: MakeRun) -> None:
    rng = np.random.default_rng(12)
    w_dps = 200 * np.sin(2 * np.pi * 0.5 * np.arange(20_000) / 400)
    chip = np.outer(w_dps, [0.01, 0.0, 1.0]) + rng.normal(0, 0.05, (w_dps.size, 3))
    chip[[2411, 8015, 15_203], 2] += 1.0
    run = make_run(np.arange(len(chip)) / 400, np.round(chip / 0.0175) * 0.0175, rate_ref_dps=w_dps)
    sampling, jumps = effect("sampling_fault").fault, effect("bias_jumps").fault
    assert sampling is not None
    assert jumps is not None
    assert sampling.detect([run], 2) is None
    assert jumps.detect([run], 2) is not None


def test_a_reading_that_leads_is_no_lag_unless_that_is_the_main_cause(make_run: MakeRun) -> None:
    """A reading cannot precede the rate. A late reference looks like that, and then explains nearly all of the error."""
    run = make_run(np.arange(2000) / 100, np.random.default_rng(0).normal(0, 0.05, (2000, 3)))

    def contradicted(tau_s: float, explained: float | None) -> bool:
        return contradicts(list(effect("lag").objections({"tau_s": tau_s, "order": 0.0}, [run], 2, ())), explained)

    assert contradicted(-3e-4, None)
    assert not contradicted(-3e-3, 0.95)
    assert not contradicted(3e-4, None)


def test_a_small_tone_of_a_ripples_own_order_is_what_the_ripple_left(make_run: MakeRun) -> None:
    """Readings are later than the table's angle, so that a ripple keeps a small part where the table reverses."""
    run = make_run(np.arange(2000) / 100, rate_ref_dps=150 * np.sign(np.sin(np.arange(2000) / 300)))
    ripple = [(effect("table_ripple"), {"amplitude_3": 0.0016, "phase_3_deg": 20.0})]
    tone = effect("order_tone")
    for order, amplitude_dps, objections in ((2.996, 0.008, [Objection.REPEATS]), (2.996, 0.2, []), (5.0, 0.008, [])):
        assert list(tone.objections({"order": order, "A_dps": amplitude_dps}, [run], 2, ripple)) == objections


def test_readings_that_keep_the_carry_which_their_neighbours_lack_are_of_the_same_fault(make_run: MakeRun) -> None:
    """Just below the border a few readings lack the carry. Just above it most of them do, and the few others stand out."""
    border_dps = 2**7 * LSB_DPS
    runs = [broken(make_run, np.full(3000, border_dps + off), 7, 1.0, seed) for seed, off in enumerate((-0.065, 0.065))]
    apart_dps = [outliers_of(run, 2, run.gyro_dps[:, 2] - run.rate_dps)[1] for run in runs]
    assert np.all(apart_dps[0] < 0)
    assert np.all(apart_dps[1] > 0)
    found = single_power(runs, 2)
    assert found is not None
    assert found == (7, sum(map(len, apart_dps)))


def test_a_motion_that_nobody_recorded_is_no_lost_carry(make_run: MakeRun) -> None:
    """The sign bits of the code follow the motion, but the readings cross every border smoothly."""
    t_s = np.arange(6000) / 100
    hidden = 2.0 * np.sin(2 * np.pi * 0.7 * t_s) + np.random.default_rng(1).normal(0, 0.03, t_s.size)
    assert lost_carry([swinging(make_run, np.round(hidden / LSB_DPS) * LSB_DPS, 0.0 * t_s)], 2) is None


def test_carries_are_counted_from_zero_up() -> None:
    codes = np.array([0, 63, 64, 127, 128, -1, -128]) * LSB_DPS
    assert carried(codes, LSB_DPS, 7, 0.5).tolist() == [True, True, False, False, True, False, True]


def test_a_line_of_the_vibration_is_in_its_square(make_run: MakeRun) -> None:
    """The gyroscope's low-pass weakens the line, so that the fit leaves a part of it, which is of no other cause."""
    t_s = np.arange(4000) / 100
    shaken = 0.3 * np.sin(2 * np.pi * 8.0 * t_s) * (1 + 0.5 * np.sin(2 * np.pi * 0.05 * t_s))
    noise = np.random.default_rng(11).normal(0, 1e-3, (3, t_s.size))
    run = make_run(t_s, table_rate_dps=0.0, ax_g=noise[0], ay_g=1 + shaken + noise[1], az_g=noise[2])
    g2 = effect("g2_sensitivity")
    values = {"ky_dps_per_g2": -0.03}
    size_dps = 2 * 0.3 * 0.03 * np.sqrt(1 + 0.5**2 / 2)
    assert g2.line_dps([run], 2, values, 8.01, 8.01) == pytest.approx(size_dps, rel=0.02)
    assert g2.line_dps([run], 2, values, 5.0, 9.0) == pytest.approx(size_dps, rel=0.02)
    assert g2.line_dps([run], 2, values, 11.0, 11.0) == 0
    assert g2.line_dps([run], 2, {}, 8.01, 8.01) == 0  # it was not measurable
    sizes = ((8.0, 1.5 * size_dps), (8.0, 2.5 * size_dps), (11.0, 0.1 * size_dps))
    assert [is_left_of_a_line([(g2, values)], [run], 2, hz, size) for hz, size in sizes] == [True, False, False]


@pytest.mark.parametrize(("rate", "told"), [(np.sign, True), (np.ones_like, False)])
def test_a_table_that_turns_back_tells_an_order_from_a_frequency(make_run: MakeRun, rate, told: bool) -> None:  # type: ignore[no-untyped-def]
    t_s = np.arange(4000) / 100
    w_dps = 150 * rate(np.sin(2 * np.pi * 0.025 * t_s) + 1e-6)
    run = make_run(t_s, rate_ref_dps=w_dps, table_angle_deg=np.cumsum(w_dps) / 100)
    assert told_from_frequency([run]) is told


def test_rests_do_not_hide_a_tone_of_an_order(make_run: MakeRun) -> None:
    """All samples at rest have one angle. What they leave there spreads over all orders."""
    rng = np.random.default_rng(12)
    t_s = np.arange(5000) / 50
    w_dps = 150.0 * np.repeat([0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0], 500)
    angle_deg = np.cumsum(w_dps) / 50
    reading = w_dps + 0.03 * (w_dps == 0) + 0.03 * np.sin(np.deg2rad(4.25 * angle_deg)) + rng.normal(0, 0.03, t_s.size)
    gyro = np.column_stack([np.zeros((t_s.size, 2)), reading])
    run = make_run(t_s, gyro, rate_ref_dps=w_dps, table_angle_deg=angle_deg)
    (peak, *_) = spectrum_over_turns([run], 2).peaks(1)
    assert peak.order == pytest.approx(4.25, abs=0.1)
    assert peak.chance < 1e-6


def steps_dps(samples: int) -> Array:
    """Constant rates between ramps of 0.3 s."""
    levels = np.array([0, 50, -50, 100, -100, 200, -200, 150, -150, 30, -30, 0.0])
    at = np.arange(samples) / samples * (levels.size - 1)
    return (
        np.interp(at % 1, [0.0, 1 - 30 * (levels.size - 1) / samples, 1.0], [0.0, 0.0, 1.0]) * np.diff(levels)[at.astype(int)]
        + levels[at.astype(int)]
    )


def of_two_samples(make_run: MakeRun, w_dps: Array, bit: int, share: float, late: int, rng: np.random.Generator) -> Run:
    """Some readings have the upper part of the sample before (``late`` 1) or of the sample after (-1)."""
    codes = np.rint((w_dps + rng.normal(0, 0.15, w_dps.size)) / LSB_DPS).astype(np.int64)
    joined = np.roll(codes, late) >> bit << bit | codes % (1 << bit)
    mixed = rng.random(w_dps.size) < share
    mixed[[0, -1]] = False
    return swinging(make_run, np.where(mixed, joined, codes) * LSB_DPS, w_dps)


@pytest.mark.parametrize("late", [1, -1])
@pytest.mark.parametrize(("motion", "share"), [("swing", 0.05), ("slow", 0.05), ("steps", 0.1)])
def test_an_upper_byte_of_another_sample_is_told_at_any_rate(make_run: MakeRun, motion: str, share: float, late: int) -> None:
    """Where the rate moves, such readings are off by any multiple of 256 counts. They were called bias_jumps."""
    t_s = np.arange(9000) / 100
    w_dps = {"swing": 50 * np.sin(3 * t_s), "slow": 20 * np.sin(0.7 * t_s), "steps": steps_dps(t_s.size)}[motion]
    found = single_power([of_two_samples(make_run, w_dps, 8, share, late, np.random.default_rng(3))], 2)
    assert found is not None
    assert found[0] == 8


@pytest.mark.parametrize("size", [256.0, -512.0, 400.0, 0.0])
def test_outliers_of_another_cause_have_no_byte_of_another_sample(make_run: MakeRun, size: float) -> None:
    """Spikes of one size, even of a power of two of counts, and (0) of any size."""
    t_s = np.arange(9000) / 100
    for w_dps in (50 * np.sin(3 * t_s), 20 * np.sin(0.7 * t_s), steps_dps(t_s.size), np.full(t_s.size, 78.0)):
        rng = np.random.default_rng(4)
        at = rng.random(t_s.size) < 0.01
        spike = rng.choice((-1.0, 1.0), t_s.size) * (size or rng.uniform(200, 2000, t_s.size))
        codes = np.rint((w_dps + rng.normal(0, 0.15, t_s.size)) / LSB_DPS + at * spike)
        assert single_power([swinging(make_run, codes * LSB_DPS, w_dps)], 2) is None


@pytest.mark.parametrize("digits", [4, 5, 6])
def test_the_digits_of_a_log_make_no_clipping(make_run: MakeRun, digits: int) -> None:
    """The top code has fewer readings than the one below. A band of codes lost one where the last digit was rounded down."""
    counted = {-9: 60, -8: 110, -7: 170, -6: 300, -5: 330, -4: 300, -3: 145, -2: 61, -1: 22, 0: 17}
    codes = np.random.default_rng(9402).permutation(np.repeat(list(counted), list(counted.values())))
    fault = effect("saturation").fault
    assert fault is not None
    for top in range(40, 140):
        y_dps = np.round((top + codes) * 250 / 32768, digits)
        run = make_run(np.arange(y_dps.size) / 100, y_dps[:, None] * [0.0, 0.0, 1.0], table_rate_dps=0.0)
        assert fault.detect([run], 2) is None, top


@pytest.mark.parametrize(("limit_dps", "white_counts"), [(101.5, 10.0), (1000.0, 10.0), (1000.0, 0.2)])
def test_a_table_that_holds_a_rate_beyond_the_range_comes_to_the_limit_once(
    make_run: MakeRun, limit_dps: float, white_counts: float
) -> None:
    """A quiet sensor stays at one code as well while the table holds its rate, but it does so between other codes, too."""
    w_dps = np.clip(900 * np.sin(2 * np.pi * np.arange(6000) / 6000), -100.0, 100.0)
    noise = np.random.default_rng(3).normal(0, white_counts * LSB_DPS, w_dps.size)
    clipped = np.clip(1.002 * w_dps + 3.4 + noise, -limit_dps, limit_dps)
    fault = effect("saturation").fault
    assert fault is not None
    run = replace(swinging(make_run, np.rint(clipped / LSB_DPS) * LSB_DPS, w_dps), lsb_dps=LSB_DPS)
    found = fault.detect([run], 2)
    assert (found is not None) is (limit_dps < 1000)
    assert found is None or found.values["full_scale_dps"] == pytest.approx(limit_dps, abs=LSB_DPS)


@pytest.mark.parametrize("limit_dps", [150.0, 1000.0])
@pytest.mark.parametrize("unit", [1.0, 4.0])
def test_a_reference_of_another_unit_clips_nothing(make_run: MakeRun, unit: float, limit_dps: float) -> None:
    """Clipping is what the reference says beyond what its slower rates say. The readings were corrected after it."""
    rng, t_s = np.random.default_rng(5), np.arange(20000) / 100
    turns = [np.sin(2 * np.pi * f * t_s + rng.uniform(0, 6)) for f in (0.11, 0.37, 0.73, 1.1)]
    w_dps = 80 * np.sum(turns, axis=0)
    y_dps = np.clip(w_dps + rng.normal(0, 0.1, t_s.size), -limit_dps, limit_dps) * 0.98 + 0.3 + rng.normal(0, 0.3, t_s.size)
    fault = effect("saturation").fault
    assert fault is not None
    found = fault.detect([swinging(make_run, y_dps, unit * w_dps)], 2)
    assert (found is not None) is (limit_dps < 200)
    assert found is None or found.values["full_scale_dps"] == pytest.approx(0.98 * 150.0, rel=0.03)
