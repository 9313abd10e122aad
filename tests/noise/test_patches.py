"""Patches of a spectrogram: what is planted in noise is found at its frequency, and noise makes none."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from gyrocal.noise.patches import Patch, patch

RATE_HZ = 150.0
RUN_S, RUNS = 30.0, 6
SAMPLES = round(RUN_S * RATE_HZ)

Noise = Callable[[np.random.Generator], np.ndarray]


def low_passed(rng: np.random.Generator, cutoff_hz: float = 30.0) -> np.ndarray:
    """White noise of density 1 behind a low-pass of second order, sampled at four times the rate and read every fourth time."""
    b, a = butter(2, cutoff_hz, fs=4 * RATE_HZ)
    return lfilter(b, a, rng.normal(0.0, np.sqrt(2 * RATE_HZ), 4 * SAMPLES))[::4]


def low_passed_by_the_logger(rng: np.random.Generator) -> np.ndarray:
    """White noise behind a digital low-pass at the sample rate, which bends the more the nearer to half of that rate."""
    b, a = butter(2, 0.29 * RATE_HZ, fs=RATE_HZ)
    return np.round(lfilter(b, a, rng.normal(0.0, np.sqrt(RATE_HZ / 2), SAMPLES)))


def tails(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_t(3, SAMPLES)


def levels(rng: np.random.Generator) -> np.ndarray:
    """Low-passed noise that is three times as large for a part of the run."""
    begin = rng.integers(SAMPLES)
    return low_passed(rng) * np.where(np.arange(SAMPLES) > begin, 3.0, 1.0)


def flicker(rng: np.random.Generator) -> np.ndarray:
    hz = np.maximum(np.fft.rfftfreq(SAMPLES, 1 / RATE_HZ), 1 / RUN_S)
    slow = np.fft.irfft(np.fft.rfft(rng.normal(size=SAMPLES)) * np.sqrt(5.0 / hz), SAMPLES)
    return rng.normal(size=SAMPLES) + slow


NOISES = [low_passed, lambda rng: low_passed(rng, 10.0), low_passed_by_the_logger, tails, levels, flicker]


@pytest.mark.parametrize("noise", NOISES)
def test_noise_makes_no_patch(noise: Noise) -> None:
    """Of 24 sessions of noise, at most four have a chance below 0.05 (probability 0.03) and none one below 0.001."""
    rng = np.random.default_rng(7)
    chances = [patch([noise(rng) for _ in range(RUNS)], RATE_HZ).chance for _ in range(24)]
    assert sum(c < 0.05 for c in chances) <= 4
    assert min(chances) > 1e-3


def found(extra: Callable[[np.random.Generator, np.ndarray], np.ndarray], seed: int) -> Patch:
    rng = np.random.default_rng(seed)
    t_s = np.arange(SAMPLES) / RATE_HZ
    best = patch([low_passed(rng) + extra(rng, t_s) for _ in range(RUNS)], RATE_HZ)
    assert best is not None
    assert best.chance < 1e-4
    return best


def resonance(rng: np.random.Generator, t_s: np.ndarray) -> np.ndarray:
    """A mount that rings at 25 Hz with a bandwidth of 2 Hz, at its peak as dense as the noise (0.67 behind the low-pass)."""
    radius, step_s = np.exp(-np.pi * 2.0 / RATE_HZ), 1 / RATE_HZ
    a = [1.0, -2 * radius * np.cos(2 * np.pi * 25.0 * step_s), radius**2]
    ring = lfilter([1.0], a, rng.normal(size=t_s.size + 500))[500:]
    return ring / ring.std() * np.sqrt(0.67 * np.pi / 2 * 2.0)


def bursts(rng: np.random.Generator, t_s: np.ndarray) -> np.ndarray:
    """A pump that runs for a second from time to time, at about 40 Hz."""
    hum = np.zeros(t_s.size)
    for begin in np.arange(1.0, RUN_S - 2, 3.0):
        on = (t_s >= begin) & (t_s < begin + 1.0)
        hum[on] = np.sin(2 * np.pi * (40.0 * rng.uniform(0.9, 1.1) * t_s[on] + rng.random()))
    return 2.5 * hum


def sweep(rng: np.random.Generator, t_s: np.ndarray) -> np.ndarray:
    """A fan that speeds up from 15 to 45 Hz."""
    return 3.0 * np.sin(2 * np.pi * (15.0 * t_s + 0.5 * t_s**2 + rng.random()))


@pytest.mark.parametrize("seed", range(4))
def test_a_faint_resonance_is_louder_than_both_sides(seed: int) -> None:
    best = found(resonance, seed)
    assert (best.seconds, best.low_hz <= 26 and best.high_hz >= 24) == (None, True)
    # the band holds most of the resonance, whose rms is that of a sine of 1.41 times as much
    assert best.amplitude_dps == pytest.approx(np.sqrt(2 * 0.67 * np.pi / 2 * 2.0), rel=0.35)


@pytest.mark.parametrize("seed", range(4))
def test_interference_that_comes_and_goes_is_found(seed: int) -> None:
    best = found(bursts, seed)
    assert best.low_hz <= 44
    assert best.high_hz >= 36
    assert best.unsteady or best.seconds is not None


@pytest.mark.parametrize("seed", range(4))
def test_a_fan_that_speeds_up_is_found(seed: int) -> None:
    best = found(sweep, seed)
    assert best.low_hz <= 45
    assert best.high_hz >= 15
    assert best.unsteady or best.seconds is not None


def test_one_tone_of_three_seconds_is_found_where_it_is() -> None:
    rng = np.random.default_rng(3)
    runs = [low_passed(rng) for _ in range(RUNS)]
    t_s = np.arange(SAMPLES) / RATE_HZ
    runs[4] += np.where((t_s >= 12) & (t_s < 15), 5.0 * np.sin(2 * np.pi * 33.0 * t_s), 0.0)
    best = patch(runs, RATE_HZ)
    assert best is not None
    assert best.chance < 1e-6
    assert best.seconds is not None
    assert (best.run, best.low_hz <= 33 <= best.high_hz) == (4, True)
    assert 11 <= best.from_s <= 13
    assert best.amplitude_dps == pytest.approx(5.0, rel=0.2)


def test_a_known_line_is_no_patch() -> None:
    rng = np.random.default_rng(5)
    t_s = np.arange(SAMPLES) / RATE_HZ
    runs = [low_passed(rng) + 3.0 * np.sin(2 * np.pi * 33.0 * t_s) for _ in range(RUNS)]
    with_line, without = patch(runs, RATE_HZ), patch(runs, RATE_HZ, [33.0])
    assert with_line is not None
    assert without is not None
    assert with_line.chance < 1e-6 < 0.01 < without.chance


def test_short_slow_and_constant_residuals_have_no_patch() -> None:
    rng = np.random.default_rng(1)
    assert patch([rng.normal(size=600)], RATE_HZ) is None
    assert patch([rng.normal(size=6000)], 20.0) is None
    assert patch([np.zeros(SAMPLES)], RATE_HZ) is None
