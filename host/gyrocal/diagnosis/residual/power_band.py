"""The test for a hump: more power about one frequency than white noise, flicker noise and drift have together.

Block means of sound readings have the density ``a + b/f + c/f^2``: white noise, flicker noise and a random walk (IEEE Std
952-1997), behind the sensor's low-pass. A disturbance of irregular period, such as a drive that sticks and slips, adds a hump
to it. The densities are fitted by Whittle's likelihood, once without and once with the hump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.whiteness import HANN_NEIGHBOURS, periodograms
from gyrocal.inference.fitted import AxisFit
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.units import rate_text
from gyrocal.variables.frequency import Frequency

CELLS = 60
"""Values of the periodogram are pooled in at most so many cells, equal in the logarithm of frequency."""
CENTRES, WIDTHS = 10, (0.25, 0.5)
"""Number of frequencies at which a hump is tried, and its widths (standard deviations of the logarithm of frequency)."""
KNEES_HZ = (np.inf, 20.0, 10.0, 7.0, 5.0)
"""Knees of the sensor's low-pass, of second order, that lie beyond the examined frequencies."""
LOW_KNEES_HZ, ORDERS = (5.0, 4.0, 3.0), (1, 2, 4)
"""Knees and orders of a low-pass (Butterworth) within them."""
ALIASES = 2
"""Images of a frequency above the block rate that block means of slow samples fold onto it, on either side."""
STEPS = 300
"""Multiplicative steps of a fit."""


@dataclass(frozen=True)
class _Cells:
    """Pooled periodogram: frequency, power over that of the fitted white noise, and number of independent values, all [f]."""

    frequency_hz: Array
    power: Array
    looks: Array


def hump(fit: AxisFit, axis: str, alarm: float) -> Finding | None:
    """Find a hump in the periodograms of the residual block means; None if noise makes it with a probability above ``alarm``.

    Behind a low-pass, samples scatter less within blocks than block means say. If they scatter much less, no hump is looked
    for. If they scatter less, the knee may lie within the examined frequencies.
    """
    from scipy.integrate import trapezoid

    cells = _pooled(fit)
    scatter = None if cells is None else _scatter(fit, cells)
    if cells is None or scatter is None or scatter <= POLICY.white_beyond:
        return None
    f, block_s = cells.frequency_hz, fit.design.extent_s[1]
    filters = [(knee_hz, 2) for knee_hz in KNEES_HZ]
    if scatter < POLICY.white_within:
        filters += [(knee_hz, order) for knee_hz in LOW_KNEES_HZ for order in ORDERS]
    samples = float(np.median(np.concatenate([b.n for b in fit.design.blocks])))
    low_passes = [of_block_means(f, *one, block_s, round(samples)) for one in filters]
    low_passes += [
        of_block_means(f, *one, block_s, round(samples), digital=True) for one in filters if one[0] < 0.5 * samples / block_s
    ]  # fmt: skip
    noises = np.stack([np.ones_like(f), f[0] / f, (f[0] / f) ** 2]) * np.array(low_passes)[:, None]
    without, _ = _fitted(noises, cells)
    noise = noises[int(np.argmax(without))]
    centres = np.geomspace(f[0], f[-1], CENTRES + 2)[1:-1]
    humps = np.exp(-0.5 * (np.log(f / centres[:, None, None]) / np.array(WIDTHS)[:, None]) ** 2).reshape(-1, f.size)
    gains, sizes = _fitted(np.concatenate([np.broadcast_to(noise, (len(humps), *noise.shape)), humps[:, None]], axis=1), cells)
    best = int(np.argmax(gains))
    gain = float(gains[best] - without.max())
    chance = min(1.0, len(humps) * 0.5 * float(tails.chi_square(2 * gain, 1)))
    if chance >= alarm:
        return None
    centre, width = float(centres[best // len(WIDTHS)]), WIDTHS[best % len(WIDTHS)]
    density = 2 * fit.noise.white_sd_dps**2 / samples * block_s  # of block means of white noise, dps^2/Hz
    amplitude_dps = float(np.sqrt(2 * sizes[best, -1] * density * trapezoid(humps[best], f)))
    band_hz = (centre * float(np.exp(-width)), centre * float(np.exp(width)))
    note = f"{rate_text(amplitude_dps)} beyond noise, most between {band_hz[0]:.2g} and {band_hz[1]:.2g} Hz"
    return Finding(
        axis, Frequency.name, float(tails.normal_z(max(chance, np.finfo(np.float64).tiny))), chance, amplitude_dps, note,
        band_hz=band_hz,
    )  # fmt: skip


def of_block_means(
    frequency_hz: Array, knee_hz: float, order: int, block_s: float, samples: int, *, digital: bool = False
) -> Array:  # fmt: skip
    """The density [f] of block means of ``samples`` samples of white noise behind a Butterworth filter.

    The part's filter is analogue, or runs far faster than the samples are read. A ``digital`` one is applied to the samples,
    and falls to zero at half their rate. Means over few samples weaken what is fast, and fold it onto what is slow.
    """
    rate_hz = samples / block_s
    density = np.zeros_like(frequency_hz)
    for image in range(-ALIASES, ALIASES + 1) if samples > 1 else (0,):
        f = np.abs(frequency_hz + image / block_s)
        inside = f < rate_hz / 2
        at = np.pi * np.minimum(f, 0.499 * rate_hz) / rate_hz
        ratio = np.tan(at) / np.tan(np.pi * knee_hz / rate_hz) if digital else f / knee_hz
        mean = np.sin(samples * at) / (samples * np.sin(at))
        density += np.where(inside, mean**2 / (1 + ratio ** (2 * order)), 0.0)
    return density


def _pooled(fit: AxisFit) -> _Cells | None:
    parts = periodograms(fit, drift=False)
    if not parts:
        return None
    frequency = np.concatenate([p.frequency_hz for p in parts])
    ratio = np.concatenate([p.ratio for p in parts])
    runs = np.concatenate([np.full(p.frequency_hz.size, float(p.runs)) for p in parts])
    edges = np.geomspace(frequency.min(), frequency.max() * (1 + 1e-9), CELLS + 1)
    cell = np.unique(np.searchsorted(edges, frequency, side="right"), return_inverse=True)[1]
    count = np.bincount(cell, runs)
    if count.size < CENTRES:
        return None
    return _Cells(np.bincount(cell, runs * frequency) / count, np.bincount(cell, ratio) / count, count / HANN_NEIGHBOURS)


def _scatter(fit: AxisFit, cells: _Cells) -> float | None:
    """The scatter of samples within blocks over that of white noise with the density of the fastest block means.

    It is None if there are too few samples.
    """
    count = sum(b.within_n for b in fit.design.blocks)
    if count < POLICY.least_scatter:
        return None
    scatter = sum(b.within_ss[fit.design.axis] for b in fit.design.blocks) / count
    fast = cells.frequency_hz > 0.5 * cells.frequency_hz[-1]
    level = float(np.average(cells.power[fast], weights=cells.looks[fast]))
    return float(scatter / (level * fit.noise.white_sd_dps**2))


def _fitted(parts: Array, cells: _Cells) -> tuple[Array, Array]:
    """Log-likelihoods [m] and sizes [m, k] of densities that are sums of ``parts`` [m, k, f] with sizes of zero and more.

    The multiplicative steps are those of Fevotte, Bertin and Durrieu, Neural Comput. 21 (2009) 793.
    """
    power, looks = cells.power, cells.looks
    sizes = np.full(parts.shape[:2], float(np.average(power, weights=looks)) / parts.shape[1])
    for _ in range(STEPS):
        density = np.einsum("mk,mkf->mf", sizes, parts)
        up = np.einsum("mkf,mf->mk", parts, looks * power / density**2)
        down = np.einsum("mkf,mf->mk", parts, looks / density)
        sizes = np.maximum(sizes * np.sqrt(up / down), 1e-12)
    density = np.einsum("mk,mkf->mf", sizes, parts)
    return -np.sum(looks * (np.log(density) + power / density), axis=1), sizes
