"""The sensor: low-pass, clock, polling and counts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

from .case import AXES, Array, Case, random_of

POLL_JITTER_S = 30e-6
OVERSAMPLING = 4
PREROLL_S = 0.05
LSB_PER_FULL_SCALE = 35e-6  # 8.75 mdps at 250 dps
ACCELEROMETER_NOISE_G = 1e-3
ACCELEROMETER_LSB_G = 61e-6
TEMPERATURE_LSB_C = 1 / 256
TEMPERATURE_NOISE_C = 0.02
TEMPERATURE_ODR_HZ = 52.0

DIGITAL = ("saturation", "quantization", "stuck_bit", "byte_fault", "sampling_fault")
"""Effects of the digital side: they change counts, not the rate that is sensed."""


class Chip:
    """Low-pass, clock and polling: from the fine time base to the samples that the host reads."""

    def __init__(self, case: Case) -> None:
        self.odr_hz = case.odr_hz * (1 + random_of(case, "chip").normal(0.0, 0.01))
        self.fine_hz = OVERSAMPLING * self.odr_hz
        # the cut-off moves with the chip's own clock
        self.b, self.a = butter(2, case.cutoff_hz / case.odr_hz / OVERSAMPLING * 2)
        self.zi = lfilter_zi(self.b, self.a)
        self.noise_sd_dps = case.noise_density_dps * np.sqrt(self.fine_hz / 2)
        self.impulse = lfilter(self.b, self.a, np.eye(1, 4096)[0])
        self.white_sd_dps = float(self.noise_sd_dps * np.sqrt(np.sum(self.impulse**2)))

    def times(self, seconds: float) -> Array:
        return np.arange(int((seconds + 2 * PREROLL_S) * self.fine_hz)) / self.fine_hz - PREROLL_S

    def newest(self, poll_s: Array) -> NDArray[np.int64]:
        """Index on the fine base of the newest chip sample at each poll."""
        return OVERSAMPLING * np.floor((poll_s + PREROLL_S) * self.odr_hz).astype(np.int64)

    def noise_covariance(self, poll_hz: float, lags: int) -> Array:
        """Of the white noise behind the low-pass, at 0, 1, ... `lags` polls, in dps^2.

        A poll finds the newest chip sample: the chip samples between two polls are one of two whole numbers, in turn.
        """
        full = np.correlate(self.impulse, self.impulse, "full")[len(self.impulse) - 1 :: OVERSAMPLING]
        return self.noise_sd_dps**2 * np.interp(np.arange(lags + 1) * self.odr_hz / poll_hz, np.arange(len(full)), full)

    def low_pass(self, signal: Array) -> Array:
        return lfilter(self.b, self.a, signal, zi=self.zi * signal[0])[0]

    def noise(self, random: np.random.Generator, n: int, index: NDArray[np.int64]) -> Array:
        white = random.standard_normal((3, n))
        return self.noise_sd_dps * lfilter(self.b, self.a, white, axis=1)[:, index]


def digitise(
    case: Case, analogue_dps: Array, lsb_dps: float, random: np.random.Generator
) -> tuple[Array, dict[str, Array]]:
    """Counts as the host turns them back into deg/s, [3, n], and what each digital fault changed."""
    planted = {effect.id: effect for effect in case.effects if effect.id in DIGITAL}
    changes: dict[str, Array] = {}
    clipped = np.clip(analogue_dps, -case.full_scale_dps, case.full_scale_dps)
    if "saturation" in planted:
        changes["saturation"] = clipped - analogue_dps
    reading = lsb_dps * np.round(clipped / lsb_dps)
    if "quantization" in planted:
        coarse_dps = planted["quantization"].parameters["lsb_dps"]
        coarse = coarse_dps * np.round(clipped / coarse_dps)
        changes["quantization"] = coarse - reading
        reading = coarse
    if "stuck_bit" in planted:
        stuck = reading.copy()
        for axis in planted["stuck_bit"].axes:
            counts = np.round(reading[AXES.index(axis)] / lsb_dps).astype(np.int64)
            stuck[AXES.index(axis)] = lsb_dps * (counts | 1 << int(planted["stuck_bit"].parameters["bit"]))
        changes["stuck_bit"] = stuck - reading
        reading = stuck
    if "byte_fault" in planted:
        torn = reading.copy()
        for axis in planted["byte_fault"].axes:
            counts = np.round(reading[AXES.index(axis)] / lsb_dps).astype(np.int64)
            torn[AXES.index(axis)] = lsb_dps * badly_joined(counts, planted["byte_fault"].parameters, random)
        changes["byte_fault"] = torn - reading
        reading = torn
    if "sampling_fault" in planted:
        repeats = random.random(reading.shape[1]) < planted["sampling_fault"].parameters["fraction"]
        repeats[0] = False
        source = np.maximum.accumulate(np.where(repeats, 0, np.arange(reading.shape[1])))
        changes["sampling_fault"] = reading[:, source] - reading
        reading = reading[:, source]
    return reading, changes


def badly_joined(codes: NDArray[np.int64], p: Mapping[str, float], random: np.random.Generator) -> NDArray[np.int64]:
    """Codes whose part from `bit` upwards is wrong.

    With a `fraction`, that share of the codes has the upper part of the sample before; without, the lower part is read as
    signed and its carry is lost, which takes 2^bit off every code whose lower part is in its upper half.
    """
    size = 1 << int(p["bit"])
    low = codes % size
    if "fraction" not in p:
        return np.where(low >= size // 2, codes - size, codes)
    torn = random.random(len(codes)) < p["fraction"]
    before = np.concatenate([codes[:1], codes[:-1]])
    return np.where(torn, before - before % size + low, codes)


def ornstein_uhlenbeck(case: Case, random: np.random.Generator, n: int, before: Array, gap_s: float) -> Array:
    """OU noise [3, n] at the poll rate, going on from the values `before` [3] across `gap_s` (inf: a fresh start)."""
    if case.ou_sd_dps == 0.0:
        return np.zeros((3, n))
    keep = np.exp(-gap_s / case.ou_tau_s)
    start = keep * before + case.ou_sd_dps * np.sqrt(1 - keep**2) * random.standard_normal(3)
    pole = np.exp(-1 / (case.poll_hz * case.ou_tau_s))
    kicks = case.ou_sd_dps * np.sqrt(1 - pole**2) * random.standard_normal((3, n))
    kicks[:, 0] = start
    return lfilter([1.0], [1.0, -pole], kicks, axis=1)
