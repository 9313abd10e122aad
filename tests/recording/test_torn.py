"""Torn readings within the noise: a planted share is found at its bit, and no kind of noise passes for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from gyrocal.recording.session import Array
from gyrocal.recording.torn import Codes, expected_shift, torn

RUNS, SAMPLES, SPREAD = 6, 4000, 8.0
Random = np.random.Generator


def _white(random: Random) -> Array:
    return SPREAD * random.standard_normal(SAMPLES)


def _low_pass(random: Random) -> Array:
    b, a = butter(2, 0.3)
    y: Array = lfilter(b, a, random.standard_normal(SAMPLES))
    return SPREAD * y / y.std()


def _heavy(random: Random) -> Array:
    return 0.6 * SPREAD * random.standard_t(3, SAMPLES)


def _repeated(random: Random) -> Array:
    old = random.random(SAMPLES) < 0.1
    old[0] = False
    return _white(random)[np.maximum.accumulate(np.where(old, 0, np.arange(SAMPLES)))]


def _coarse(random: Random) -> Array:
    return 8 * np.round(_white(random) / 8)


def _bursts(random: Random) -> Array:
    return _white(random) * (1 + 3 * (np.sin(np.arange(SAMPLES) / 300) > 0.7))


def _swing(random: Random) -> Array:
    return _white(random) + 3 * SPREAD * np.sin(np.arange(SAMPLES) / 40)


def _switched(random: Random) -> Array:
    """A heater that switches on and off: two levels, half a part from each other, with noise of one count."""
    return 1.3 * random.standard_normal(SAMPLES) + 7 * (np.arange(SAMPLES) // 37 % 2)


NOISES = (_switched, _white, _low_pass, _heavy, _repeated, _coarse, _bursts, _swing)


def _session(noise: Callable[[Random], Array], random: Random) -> tuple[list[Codes], list[Array]]:
    rests = [noise(random) for _ in range(RUNS)]
    codes = [np.rint(r + random.uniform(-3000, 3000)).astype(np.int64) for r in rests]
    return codes, [c - c.mean() for c in codes]


def _tear(codes: Codes, bit: int, share: float, random: Random) -> Codes:
    before = np.concatenate([codes[:1], codes[:-1]])
    joined = (before >> bit << bit) + codes % (1 << bit)
    return np.where(random.random(codes.size) < share, joined, codes)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("seed", range(4))
def test_noise_is_not_torn(noise: Callable[[Random], Array], seed: int) -> None:
    found = torn(*_session(noise, np.random.default_rng([11, seed])))
    assert found is None or found.gain < 8


def test_an_offset_that_moves_over_a_border_is_not_torn() -> None:
    """A temperature moved the offset by two spreads in hours, and single readings kept to one side of a border."""
    random, samples = np.random.default_rng(5), 60_000
    offset = -1040 + 5 * np.cos(np.arange(samples) * np.pi / samples)
    codes = [np.rint(offset + 5 * random.standard_normal(samples)).astype(np.int64) for _ in range(2)]
    found = torn(codes, [c - c.mean() for c in codes])
    assert found is None or found.gain < 8


@pytest.mark.parametrize("noise", [_white, _low_pass, _heavy, _swing])
@pytest.mark.parametrize(("bit", "share"), [(4, 0.05), (5, 0.03), (4, 0.2)])
def test_torn_readings_are_found_at_their_bit(noise: Callable[[Random], Array], bit: int, share: float) -> None:
    random = np.random.default_rng(bit)
    sound, _ = _session(noise, random)
    codes = [_tear(c, bit, share, random) for c in sound]
    found = torn(codes, [c - c.mean() for c in codes])
    assert found is not None
    assert found.bit == bit
    assert found.gain > 15
    assert 0.4 < found.share / share < 1.6  # a heavy tail hides some


def test_the_expected_shift_is_right_on_average_and_removes_power() -> None:
    random = np.random.default_rng(7)
    sound, _ = _session(_white, random)
    off, kept = np.zeros(0), np.zeros(0)
    for c in sound:
        codes = _tear(c, 4, 0.1, random)
        shift = expected_shift(codes, codes - codes.mean(), 4, 0.1)
        off, kept = np.append(off, codes - c), np.append(kept, codes - c - shift)
    assert np.mean(kept**2) < 0.8 * np.mean(off**2)
    assert abs(kept.mean()) < 4 * off.std() / np.sqrt(off.size)


@pytest.mark.parametrize("step", [1.43, 2.5, 5.714, 11.43, 32.9, 400.0])
@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0, 8.0, 60.0])
def test_rounded_readings_are_not_torn(step: float, spread: float) -> None:
    """Values with one decimal at a count of 0.00875 deg/s are 11 or 12 codes apart."""
    random = np.random.default_rng(3)
    for samples in (70, 4000):
        values = [spread * random.standard_normal(samples) + random.uniform(-3000, 3000) for _ in range(3)]
        codes = [np.rint(np.round(v / step) * step).astype(np.int64) for v in values]
        found = torn(codes, [c - c.mean() for c in codes])
        assert found is None or found.gain < 8


def test_readings_that_jump_are_not_torn() -> None:
    """No reading has the upper part of the one before."""
    codes = np.random.default_rng(4).integers(-30, 30, 4000) * 1000 + np.arange(4000) % 2
    assert torn([codes], [codes - codes.mean()]) is None


def test_few_readings_say_nothing() -> None:
    assert torn([np.arange(5)], [np.zeros(5)]) is None
    assert not np.any(expected_shift(np.arange(5), np.zeros(5), 4, 0.1))
