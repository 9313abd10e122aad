"""The level of a spectrum against closed forms, and the chances of lines, on noise as sensors have it."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, freqz, lfilter
from scipy.stats import kstest

from gyrocal.noise.spectrum import PAD, spectrum
from gyrocal.noise.steady import relative_levels

WHITE_DPS = 0.044


def low_passed(rng: np.random.Generator, n: int, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    settling = round(10 * rate_hz / cutoff_hz)
    return lfilter(*butter(2, cutoff_hz, fs=rate_hz), rng.normal(0, WHITE_DPS, n + settling))[settling:]


@pytest.mark.parametrize(("rate_hz", "cutoff_hz"), [(50.0, 5.0), (104.0, 12.0), (104.0, 33.0), (1000.0, 42.0)])
def test_the_level_behind_a_low_pass_is_that_of_its_frequency_response(rate_hz: float, cutoff_hz: float) -> None:
    rng = np.random.default_rng(1)
    found = spectrum([low_passed(rng, round(60 * rate_hz), rate_hz, cutoff_hz) for _ in range(12)], rate_hz)
    _, response = freqz(*butter(2, cutoff_hz, fs=rate_hz), found.frequency_hz, fs=rate_hz)
    expected = WHITE_DPS**2 / (rate_hz / 2) * np.abs(response) ** 2
    inside = np.abs(response) ** 2 > 1e-3  # far below, the window's leakage shows
    off = np.log(found.level[inside] / expected[inside])
    assert abs(np.mean(off)) < 0.03
    assert np.std(off) < 0.06
    assert np.max(np.abs(off)) < 0.35  # at the lowest frequencies, of which there are few


def _bursts(rng: np.random.Generator) -> np.ndarray:
    y = rng.normal(0, WHITE_DPS, 2080)
    for start in rng.integers(0, 2000, 2):
        y[start : start + 60] *= 6.0
    return y


NOISES: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "white": lambda g: g.normal(0, WHITE_DPS, 2080),
    "low-pass": lambda g: low_passed(g, 2080, 104.0, 12.0),
    "level of each run": lambda g: g.normal(0, WHITE_DPS, 2080) * np.exp(g.normal(0, 0.5)),
    "bursts": _bursts,
    "t5": lambda g: g.standard_t(5, 2080) * WHITE_DPS,
}


@pytest.mark.parametrize("kind", NOISES)
def test_chances_of_noise_are_uniform(kind: str) -> None:
    """The values at distant frequencies of several spectra, each by itself, and the strongest line of each."""
    chances, strongest = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        found = spectrum([NOISES[kind](rng) for _ in range(8)], 104.0)
        chances.append(found.tail[:: 4 * PAD])
        peak = found.peak()
        assert peak is not None
        strongest.append(peak.chance)
        assert found.bump() is None or found.bump().chance > 1e-3
    assert kstest(np.concatenate(chances), "uniform").pvalue > 1e-3
    assert min(strongest) > 0.01 / len(strongest)


def test_a_knee_is_no_bump_and_a_band_above_a_falling_level_is_one() -> None:
    rng = np.random.default_rng(3)
    knee = [low_passed(rng, 6240, 208.0, 20.0) for _ in range(10)]
    found = spectrum(knee, 208.0).bump()
    assert found is None or found.chance > 1e-3
    t_s = np.arange(6240) / 208.0
    sweep = 0.012 * np.sin(2 * np.pi * (35 + 4 * t_s / t_s[-1]) * t_s)  # 35 to 43 Hz, in the filter's slope
    bump = spectrum([y + sweep for y in knee], 208.0).bump()
    assert bump is not None
    assert bump.chance < 1e-6
    assert (bump.low_hz, bump.high_hz) == pytest.approx((35, 43), abs=3)


def test_a_constant_level_is_constant_and_a_changing_one_is_followed() -> None:
    rng = np.random.default_rng(5)
    steady = [low_passed(rng, 3000, 104.0, 12.0) for _ in range(8)]
    assert relative_levels(steady).of_residual is None
    truth = np.where(np.arange(3000) < 1500, 1.0, 3.0)
    levels = relative_levels([y * truth for y in steady]).of_residual
    assert levels is not None
    ratio = [level[1700:].mean() / level[:1300].mean() for level in levels]
    np.testing.assert_allclose(ratio, 3.0, rtol=0.2)


def test_rests_may_be_far_quieter_than_turns_and_a_run_of_constant_noise_has_one_level() -> None:
    """The noise of some sensors grows with the rate. A least level of a tenth made the rests five times too loud in power."""
    rng = np.random.default_rng(7)
    sizes = [0.18, 0.18, 0.009, 0.18, 0.009, 0.18]
    levels = relative_levels([size * rng.standard_normal(320) for size in sizes]).of_residual
    assert levels is not None
    for level, other in zip(levels, sizes, strict=True):
        assert np.ptp(level) == 0.0
        assert level[0] / levels[0][0] == pytest.approx(other / sizes[0], rel=0.35)  # two levels of four windows each
    still = relative_levels([*(0.18 * rng.standard_normal(320) for _ in range(4)), np.zeros(320)]).of_residual
    assert still is not None
    assert still[-1][0] / still[0][0] == pytest.approx(0.1, rel=0.3)  # a reading that repeats shows no noise


def test_a_tone_that_sweeps_slowly_is_a_bump_and_noise_has_the_chance_that_is_told() -> None:
    """Neighbouring positions of a band share most of their values. All counted as looks, a sweep over 18 Hz was not seen."""
    t_s, chances = np.arange(8192) / 100, []
    for seed in range(30):
        bump = spectrum([np.random.default_rng([6, seed]).standard_normal(t_s.size)], 100.0).bump()
        chances.append(1.0 if bump is None else bump.chance)
    assert np.count_nonzero(np.array(chances) < 0.1) <= 7  # of 30, more by chance once in 100
    sweep = 0.4 * np.sin(2 * np.pi * (10 * t_s + 0.5 * 8 / 82 * t_s**2))
    seen = spectrum([np.random.default_rng(3).standard_normal(t_s.size) + sweep], 100.0).bump()
    assert seen is not None
    assert seen.chance < 1e-4


@pytest.mark.parametrize(("low_hz", "high_hz"), [(10.0, 14.0), (20.0, 28.0)])
@pytest.mark.parametrize("segments", [1, 10])
def test_a_band_of_noise_is_told_by_its_edges_and_its_amplitude(low_hz: float, high_hz: float, segments: int) -> None:
    """As large as a wave of the same mean square: the square root of two times the rms. A median tells a few percent less."""
    rng, n, rms_dps = np.random.default_rng(4), 60_000, 0.1
    lines, frequency_hz = np.fft.rfft(rng.standard_normal(n)), np.fft.rfftfreq(n, 0.01)
    band = np.fft.irfft(np.where((frequency_hz >= low_hz) & (frequency_hz <= high_hz), lines, 0), n)
    noise = rng.standard_normal(n) * 0.1 + band * rms_dps / band.std()
    bump = spectrum(list(noise.reshape(segments, -1)), 100.0).bump()
    assert bump is not None
    assert (bump.low_hz, bump.high_hz) == pytest.approx((low_hz, high_hz), abs=0.3)
    assert 0.9 * np.sqrt(2) * rms_dps < bump.amplitude_dps < 1.03 * np.sqrt(2) * rms_dps


@pytest.mark.parametrize("apart_hz", [0.06, 0.17])
def test_lines_within_a_tenth_of_a_hertz_are_one(apart_hz: float) -> None:
    rng = np.random.default_rng(3)
    t_s = np.arange(16384) / 100.0  # bins of 6 mHz
    y = rng.normal(0, 0.05, t_s.size) + 0.02 * np.sin(2 * np.pi * 20 * t_s) + 0.01 * np.sin(2 * np.pi * (20 + apart_hz) * t_s)
    found = spectrum([y], 100.0)
    first = found.peak()
    assert first is not None
    assert first.frequency_hz == pytest.approx(20, abs=0.01)
    other = found.without_line(first.frequency_hz).peak()
    assert other is not None
    assert (other.chance < 1e-6) == (apart_hz > 0.1)


@pytest.mark.parametrize("width_hz", [2.0, 4.0, 8.0])
def test_a_band_is_told_with_its_width(width_hz: float) -> None:
    rng = np.random.default_rng(5)
    n, rate_hz = 16384, 100.0
    frequency_hz = np.fft.rfftfreq(n, 1 / rate_hz)
    inside = np.abs(frequency_hz - 25) < width_hz / 2
    runs = []
    for _ in range(3):
        white = np.fft.rfft(rng.normal(0, 0.05, n))
        runs.append(np.fft.irfft(np.where(inside, 3 * white, white), n))
    bump = spectrum(runs, rate_hz).bump()
    assert bump is not None
    assert bump.high_hz - bump.low_hz == pytest.approx(width_hz, rel=0.1)
    assert (bump.low_hz + bump.high_hz) / 2 == pytest.approx(25, abs=width_hz / 4)
