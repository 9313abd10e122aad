"""Spectrum of residuals over the angle of a table: lines at a fixed number of periods per turn (orders)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal import tails
from gyrocal.noise.steady import as_many
from gyrocal.recording.session import Array

HIGHEST = 64.0
"""Highest order. The poles and gears of tables have up to some tens per turn."""
BINS = 512
"""Points of the grid of angles per turn."""
SPREAD = 4
"""Points of the grid among which a reading is shared, with the weights of a cubic B-spline."""
LEAST_TURNS = 2.0
PAD = 2
MOST_TURNS = 512
MEDIAN_EFFICIENCY = 2 / np.pi
"""Variance of a mean over the variance of a median of the same values."""
NEIGHBOURS = 61
"""Values of the spectrum of which the median is the level between lines."""


@dataclass(frozen=True)
class OrderPeak:
    """The strongest line. ``chance`` is the probability that noise produces such a line anywhere in the spectrum."""

    order: float
    amplitude_dps: float
    chance: float
    resolution: float
    """Orders that are closer than this cannot be told apart."""

    @property
    def whole(self) -> int | None:
        """The whole number of periods per turn that the order is equal to; None if there is none."""
        nearest = round(self.order)
        return nearest if nearest > 0 and abs(self.order - nearest) < self.resolution / 2 else None

    def words(self) -> str:
        """The order in words."""
        return f"{self.order:.4g} per turn" if self.whole is None else f"exactly {self.whole} per turn"


@dataclass(frozen=True)
class OrderSpectrum:
    """Periodograms over the angle, averaged over runs.

    ``power`` [f] is the square of the amplitude (dps^2) at each order, and ``tail`` [f] is the probability that noise alone
    reaches it; for this, each run counts relative to its own level. ``turns`` is the length of the longest run.
    """

    order: Array
    power: Array
    tail: Array
    turns: float

    def peaks(self, count: int) -> list[OrderPeak]:
        """The strongest lines, strongest first, at most ``count``."""
        if not self.order.size:
            return []
        tops = np.flatnonzero((self.power >= np.roll(self.power, 1)) & (self.power >= np.roll(self.power, -1)))
        best = tops[np.lexsort((-self.power[tops], self.tail[tops]))[:count]]
        return [
            OrderPeak(
                float(self.order[k]), float(np.sqrt(self.power[k])), min(1.0, float(self.tail[k]) * self.order.size),
                1.0 / self.turns,
            )
            for k in best
        ]  # fmt: skip


NOTHING = OrderSpectrum(np.zeros(0), np.zeros(0), np.zeros(0), 0.0)


def _amplitudes(y: Array, angle: Array, length: int) -> Array:
    """The sums of y·exp(-2πi·order·angle) [length / 2 + 1] at the orders k·BINS / length, for ``angle`` [n] >= 0 in turns.

    The angles lie on no grid. If each reading counted at the nearest point only, a line above ``HIGHEST`` would show at its
    distance from the number of readings per turn beyond ``BINS``. A cubic B-spline weakens such images below 0.1 %
    (Dutt and Rokhlin, SIAM J. Sci. Comput. 14 (1993) 1368, with a spline for the Gaussian).
    """
    at = angle * BINS
    first = np.floor(at).astype(np.intp)
    u = at - first
    weights = ((1 - u) ** 3, 4 - 3 * u**2 * (2 - u), 4 - 3 * (1 - u) ** 2 * (1 + u), u**3)
    grid = np.zeros(length)
    for k, weight in enumerate(weights):
        grid += np.bincount((first + k - 1) % length, y * weight / 6, minlength=length)
    order = np.arange(length // 2 + 1) / length
    return np.asarray(np.fft.rfft(grid) / np.sinc(order) ** SPREAD)


def strongest_orders(residuals: Sequence[Array], angles_turn: Sequence[Array], count: int) -> list[float]:
    """The orders with the largest power summed over runs, strongest first, for runs of too few turns for a spectrum.

    ``residuals`` [n] are in deg/s and ``angles_turn`` [n], unwrapped, in turns, one of each for a run. No chance is computed.
    The orders begin at one period over the longest run, because less looks like a drift.
    """
    turns = max(float(np.ptp(a)) for a in angles_turn)
    length = 1 << int(np.ceil(np.log2(4 * PAD * turns * BINS)))
    order = np.arange(length // 2 + 1) * BINS / length
    reach = min(HIGHEST, *(0.5 / step for a in angles_turn if (step := float(np.median(np.abs(np.diff(a)))))))
    power = np.zeros(order.size)
    for y, angle in zip(residuals, angles_turn, strict=True):
        power += np.abs(_amplitudes(y - y.mean(), angle - angle.min(), length)) ** 2 / y.size
    inside = (order >= 1 / turns) & (order <= reach)
    tops = np.flatnonzero(inside & (power >= np.roll(power, 1)) & (power >= np.roll(power, -1)))
    return [float(order[k]) for k in tops[np.argsort(-power[tops])][:count]]


def order_spectrum(
    residuals: Sequence[Array], angles_turn: Sequence[Array], *, whole: bool = False, count_dps: float = 0.0,
) -> OrderSpectrum:  # fmt: skip
    """Average periodogram of residuals [n] (deg/s) over unwrapped angles [n] (turns), one of each for a run.

    Runs with fewer than ``LEAST_TURNS`` turns are left out. The spectrum is empty if none remains. It begins where lines can be
    told from slow noise in the shortest of them; ``whole`` begins it at one period in the longest run. ``count_dps`` is a count
    of the readings, whose rounding is noise too.
    """
    from scipy.ndimage import median_filter

    pairs = [(y - y.mean(), a - a.min()) for y, a in zip(residuals, angles_turn, strict=True) if np.ptp(a) >= LEAST_TURNS]
    if not pairs:
        return NOTHING
    turns = min(float(MOST_TURNS), max(float(a.max()) for _, a in pairs))
    length = 1 << int(np.ceil(np.log2(PAD * turns * BINS)))
    order = np.arange(length // 2 + 1) * BINS / length
    reach = min(HIGHEST, *(0.5 / float(np.median(np.abs(np.diff(a)))) for _, a in pairs if np.any(np.diff(a))))
    lowest = 1 / turns if whole else max(0.5, LEAST_TURNS / min(turns, *(float(a.max()) for _, a in pairs)))
    use = (order >= lowest) & (order <= reach)
    if np.count_nonzero(use) < NEIGHBOURS:
        return NOTHING
    power, even = np.zeros((2, int(np.count_nonzero(use))))
    parts = []
    for y, angle in pairs:
        inside = angle < turns
        line = _amplitudes(y[inside], angle[inside], length)[use]
        samples = np.count_nonzero(inside)
        own = np.abs(2 * line / samples) ** 2
        power += own / len(pairs)
        # a noisy run counts as much as a quiet one, unless the quiet one stands at one count
        median = max(float(np.median(own)), np.finfo(np.float64).tiny)
        usual = max(median, np.log(2) * count_dps**2 / (3 * samples))
        even += own / usual
        parts.append(median / usual)
    looks = as_many(np.array(parts))
    level = median_filter(even, NEIGHBOURS, mode="reflect") / (tails.chi_square_value(0.5, 2 * looks) / (2 * looks))
    # the level is itself estimated, from the median of that many independent values of the spectrum
    values = looks * NEIGHBOURS / PAD * MEDIAN_EFFICIENCY
    tail = tails.f_ratio(even / np.maximum(level, np.finfo(np.float64).tiny), 2 * looks, 2 * values)
    tail[-NEIGHBOURS // 2 :] = 1.0  # there, half of the neighbours are missing
    shortest = max(LEAST_TURNS, min(turns, *(float(a.max()) for _, a in pairs)))
    return OrderSpectrum(order[use], power, np.asarray(tail), max(turns, shortest))
