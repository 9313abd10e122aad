"""The search for the noise of an axis: white level, drift and spreads by restricted maximum likelihood, terms as they are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gyrocal.inference.design import SLOW_S, Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import NO_SPREAD, Equations, Spreads, SpreadScale, fit_spreads, maximise, unknown_spreads
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array

LEAST_WHITE_DPS = 1e-5
"""No reading is less noisy than this: a thousandth of a count."""
BELOW, ABOVE = 0.2, 3.0
"""Logarithms of the ratios by which the white level may be below and above its start: colour raises it."""
ABOVE_OF_TURNS = 2.0
"""The same above the scatter of samples where only net angles are known: no drift is searched for, and a few turns that scatter
more than their samples and their own errors allow are a misfit."""
LEAST_BENDS = 30
"""Second differences of block means from which on they show the noise."""
FAST_S = 20.0
"""Correlation time of the faster drift with which a search begins, s."""
STEP = 1e-4
"""Step of logarithms for numerical gradients, far above the rounding of the likelihood."""


def white_start(design: Design) -> float:
    """White noise of one sample, deg/s: the scatter within blocks or that from block to block, whichever is smaller.

    Behind a low-pass filter the scatter within blocks is smaller. Beside a fast vibration or a fast motion that from block to
    block is, from which the terms' own columns are taken out: a scale error of 1 % leaves as much of a swing as noise does.
    """
    if design.color.of_angle:
        return _of_readings(design)
    ss = sum(b.within_ss[design.axis] for b in design.blocks)
    n = sum(b.within_n for b in design.blocks)
    within = [float(np.sqrt(ss / n))] if n >= 10 else []
    squares = _bends(design) ** 2
    if not within and not squares.size:  # turns of known angle alone
        return _of_readings(design)
    between = [float(np.sqrt(np.mean(squares)))] if squares.size >= LEAST_BENDS or not within else []
    return max(min([*within, *[x for x in between if x > 0]], default=0.0), LEAST_WHITE_DPS)


def _of_readings(design: Design) -> float:
    """White noise of one sample from third differences of the readings alone, deg/s, whatever the reference's noise is."""
    third = [np.diff(b.run.gyro_dps[:, design.axis], 3) for b in design.blocks if len(b.run) > LEAST_BENDS]
    power = float(np.mean(np.concatenate(third) ** 2)) / 20 if third else 0.0
    return max(float(np.sqrt(power)), LEAST_WHITE_DPS)


def _bends(design: Design) -> Array:
    """Second differences of block means beside those of the shared columns, [m], with the standard deviation of one sample."""
    rows = 1 + len(design.layout.fixed)
    bends = [
        np.diff(design.columns(i)[:rows], 2) * np.sqrt(b.n[1:-1] / 6) for i, b in enumerate(design.blocks) if b.t_s.size > 2
    ]  # fmt: skip
    if not bends:
        return np.zeros(0)
    y, *columns = np.concatenate(bends, axis=1)
    if not columns or y.size < LEAST_BENDS * rows:
        return np.asarray(y)
    matrix = np.transpose(columns)
    return np.asarray(y - matrix @ np.linalg.lstsq(matrix, y, rcond=1e-9)[0])


def _drifts(design: Design) -> bool:
    """True if the model has a drift that is searched for, and the runs are long enough to show one."""
    longest_s, block_s = design.extent_s
    drift = design.noise_model.drift
    return drift is not None and drift.known is None and longest_s > 10 * block_s


def _beside_known_drift(design: Design, white_sd_dps: float) -> Noise:
    """White noise with the drift that the noise model knows, or without one."""
    drift = design.noise_model.drift
    if drift is None or drift.known is None:
        return Noise(white_sd_dps)
    size, tau_s = drift.known
    return Noise(white_sd_dps, size * white_sd_dps, tau_s)


def first_noises(design: Design, white0: float) -> list[Noise]:
    """Starts of a search for the noise from a white level: drifts of two sizes, fast ones and ones as slow as runs are long."""
    if not _drifts(design):
        return [_beside_known_drift(design, white0)]
    times_s = (FAST_S, max(FAST_S, design.extent_s[0]))
    return [Noise(white0, white0 / part, tau_s) for tau_s in times_s for part in (10, 40)]


def likeliest_start(design: Design, *others: AxisFit) -> AxisFit:
    """The likeliest of ``others``, fits of this design, and of those at :func:`first_noises`, each at the level that it finds.

    A search that begins elsewhere may end at a lesser maximum: a fast drift explains noise of another colour as well as it can.
    """
    scale = NoiseScale.of(design)
    starts = (_at_its_level(fit, scale.bounds[0]) for fit in _first_fits(design, scale))
    return max([*others, *starts], key=lambda fit: fit.loglik)


def _first_fits(design: Design, scale: NoiseScale) -> list[AxisFit]:
    """The fits of a design at its :func:`first_noises`."""
    return [with_noise(design, noise, unknown_spreads(design)) for noise in first_noises(design, scale.white_sd_dps)]


def _at_its_level(fit: AxisFit, bounds: tuple[float, float]) -> AxisFit:
    """The fit with all noise times the factor that its residuals give, with a white level within its ``bounds``."""
    freedom = int(fit.design.n_blocks.sum()) - fit.solution.beta.size
    if freedom <= 0 or not fit.solution.chi2 > 0:
        return fit
    log_white = float(np.log(fit.noise.white_sd_dps))
    level = float(np.clip(log_white + np.log(fit.solution.chi2 / freedom) / 2, *bounds))
    return with_noise(fit.design, fit.noise.times(float(np.exp(level - log_white))), fit.spreads)


def carry_spreads(old: AxisFit, design: Design) -> Spreads:
    """Spreads to begin with for a design with further terms, or with another part of the samples: those of ``old`` and unknown
    ones for new terms. All are unknown where the samples determine fewer of them.
    """
    fresh = unknown_spreads(design)
    if old.spreads.run.size <= fresh.run.size:
        fresh.run[: old.spreads.run.size] = old.spreads.run
    return Spreads(
        fresh.run, old.spreads.scenario if old.spreads.scenario.size == fresh.scenario.size else fresh.scenario
    )


def with_noise(design: Design, noise: Noise, spreads: Spreads) -> AxisFit:
    """A fit at given noise: spreads by REML on the Grams, no filtering again."""
    grams, logdet = design.grams(noise)
    equations = Equations(design.layout, grams, logdet, design.scenarios, int(design.n_blocks.sum()))
    spreads = fit_spreads(design, equations, spreads)
    return AxisFit(design, noise, spreads, equations.solve(spreads), design.terms, grams, logdet)


def carried(old: AxisFit, design: Design) -> AxisFit:
    """The fit of another design at the noise of ``old``; see :func:`carry_spreads`."""
    return with_noise(design, old.noise, carry_spreads(old, design))


@dataclass(frozen=True)
class NoiseScale:
    """The coordinates in which noise is searched: logarithms of the white level and, with drift, of its growth and its rate.

    The growth is ``sd^2 / tau``, with which the variance of a slow drift grows in time, and the rate is ``1 / tau``. In a short
    recording the growth alone is known, and the log-likelihood is nearly linear in the rate. Sd and tau would have to move
    together, on a ridge along which a search creeps. The drift's size is relative to the white level, so that one factor scales
    all noise.
    """

    white_sd_dps: float
    """The expected white level."""
    growth_unit: float
    """Growth, dps^2/s, of a drift that moves the mean of the longest run as white noise does. Less is not seen."""
    slowest_per_s: float
    """A rate that no run is long enough to tell from zero, 1/s."""
    bounds: tuple[tuple[float, float], ...]
    without_search: Noise
    """The noise at the expected white level if the drift is not searched for."""

    @staticmethod
    def of(design: Design) -> NoiseScale:
        """The coordinates and bounds of the search for one axis's design."""
        white0 = white_start(design)
        longest_s, block_s = design.extent_s
        samples = max(1.0, float(np.median(np.concatenate([b.n for b in design.blocks]))))
        unit = float(white0**2 / (longest_s / block_s * samples)) / longest_s
        above = ABOVE_OF_TURNS if all(b.run.rate_is_mean for b in design.blocks) else ABOVE
        bounds = [(float(np.log(white0)) - BELOW, float(np.log(white0)) + above)]
        slow_s = max(SLOW_S, 5 * block_s)
        least = 1 / max(4 * slow_s, 5 * longest_s)
        if _drifts(design):
            bounds.append((NO_SPREAD, float(np.log1p((150 * white0) ** 2 / SLOW_S / unit))))
            bounds.append((float(np.log(2 * least)), float(np.log(1 / slow_s + least))))
        return NoiseScale(white0, unit, least, tuple(bounds), _beside_known_drift(design, white0))

    @property
    def drift(self) -> bool:
        """True if the search includes a drift."""
        return len(self.bounds) > 1

    def coordinates(self, noise: Noise) -> Array:
        """Coordinates [1 or 3] of a noise, within the bounds."""
        x = [np.log(noise.white_sd_dps)]
        if self.drift:
            size = noise.ou_sd_dps * self.white_sd_dps / noise.white_sd_dps
            growth = float(np.log1p(size**2 / noise.ou_tau_s / self.growth_unit))
            # no drift in the poorer model may be one in the richer
            x += [max(growth, float(np.log(2.0))), np.log(1 / noise.ou_tau_s + self.slowest_per_s)]
        return np.asarray(np.clip(x, *np.transpose(self.bounds)))

    def noise(self, x: Array) -> Noise:
        """The noise at coordinates [1 or 3]."""
        times = float(np.exp(x[0])) / self.white_sd_dps
        if not self.drift:
            return self.without_search.times(times)
        tau_s = 1 / (float(np.exp(x[2])) - self.slowest_per_s)
        sd_dps = times * float(np.sqrt(self.growth_unit * np.expm1(x[1]) * tau_s))
        return Noise(times * self.white_sd_dps, sd_dps, tau_s)


def fit_noise(design: Design, start: AxisFit | None = None) -> AxisFit:
    """The noise of a design by REML: white level, drift and spreads together.

    The search begins at the noise of ``start``, or at the likeliest of :func:`first_noises`.
    """
    noise_scale, n = NoiseScale.of(design), int(design.n_blocks.sum())
    if start is None:
        start = max(_first_fits(design, noise_scale), key=lambda fit: fit.loglik)
    first, spreads = start.noise, start.spreads
    log_white0 = float(np.log(noise_scale.white_sd_dps))
    m, k = len(noise_scale.bounds), spreads.run.size
    scale = SpreadScale.of(design, start.grams)
    cache: dict[bytes, tuple[Array, Array]] = {}

    def grams_near(of_drift: Array) -> tuple[Array, Array]:
        """Normal equations and log-determinants at coordinates [0 or 2] of the drift, and a step of each of them away.

        They are those of the first white level; another one scales them.
        """
        key = of_drift.tobytes()
        if key not in cache:
            if len(cache) > 8:
                cache.clear()
            noise, *others = (
                noise_scale.noise(np.concatenate([[log_white0], of_drift + step]))
                for step in STEP * np.eye(m, m - 1, -1)
            )
            cache[key] = design.grams_near(noise, others)
        return cache[key]

    def equations(grams: Array, logdet: Array) -> Equations:
        return Equations(design.layout, grams, logdet, design.scenarios, n)

    def loglik(x: Array) -> tuple[float, Array]:
        sd, log_times = scale.spreads(x[m:]), float(x[0] - log_white0)
        spreads = Spreads(sd[:k], sd[k:])
        grams, logdet = grams_near(x[1:m])
        grams, logdet = grams * np.exp(-2 * log_times), logdet + 2 * log_times * design.n_blocks
        solution, slopes = equations(grams[0], logdet[0]).solve_with_slopes(spreads)
        # all noise and all spreads times exp(a) multiply chi-square by exp(-2a) and the determinant by exp(2a (n - p))
        of_noise = [solution.chi2 - (n - solution.beta.size) - float(slopes.sum())]
        if m > 1 and np.isfinite(solution.loglik):
            beyond = equations(grams[1:], logdet[1:]).logliks(spreads)
            of_noise += ((beyond - solution.loglik) / STEP).tolist()
        elif m > 1:  # a corner in which rounding leaves no likelihood
            of_noise += [0.0] * (m - 1)
        return solution.loglik, np.concatenate([of_noise, scale.slopes(x[m:], slopes)])

    begin = np.concatenate([
        noise_scale.coordinates(first), scale.coordinates(np.concatenate([spreads.run, spreads.scenario]))
    ])  # fmt: skip
    x = maximise(loglik, begin, [*noise_scale.bounds, *scale.bounds])
    noise, sd = noise_scale.noise(x[:m]), scale.settled(x[m:])
    if noise_scale.drift and x[1] < 10 * NO_SPREAD:
        noise = replace(noise, ou_sd_dps=0.0)
    grams, logdet = design.grams(noise)
    spreads = Spreads(sd[:k], sd[k:])
    return AxisFit(design, noise, spreads, equations(grams, logdet).solve(spreads), design.terms, grams, logdet)
