"""Noise that is not the same in all blocks, or not independent from block to block: levels that change, and colour.

Both are taken from the residuals of a first fit, and kept where the likelihood of the session rises.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gyrocal.inference.blocks import BLOCK_S, Blocks, known_dps
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import fit_noise, likeliest_start, white_start, with_noise
from gyrocal.inference.turns import with_errors_of_turns
from gyrocal.noise.color import MOST_ALIKE, WHITE, Color
from gyrocal.noise.steady import relative_levels
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

COLORS = np.linspace(-0.8, MOST_ALIKE, 151)
LOWEST_HZ = 1.0
"""Frequency above which block means show the colour of the fast noise. Below it are drift and effects of a turning table."""
SEARCHED = 3.0
"""Of the logarithm of an angle's noise, either side of where the residuals put it."""
WINDOWS = 4
"""So often the search goes on where it has ended at an edge."""
BANDS = 8
LEAST_IN_BAND = 12
"""Bands, each with so many values of the periodogram at the least, whose medians are compared. A median ignores lines."""
OF_ENDS = 1.0
"""Angle per block, rad, below which the noise of an angle at the ends of blocks rises, whatever smooths the angle."""


def shaped(current: AxisFit) -> AxisFit:
    """The fit with the level of the noise in each block, and its colour, as the residuals show them.

    Of a turn of known angle the mean alone is fitted, which says nothing of its level. On the other axes the scatter of its
    samples does, unless the means contradict it; about its own axis that scatter is the course of the turn.
    """
    weighted = _weighted(current)
    if weighted is not None:
        turned = {b.run.axis_index for b in current.design.blocks if b.run.rate_is_mean}
        of_turns = bool(turned) and current.design.axis not in turned
        current = _better(current, weighted, -POLICY.noise_level_loss if of_turns else POLICY.noise_shape_gain)
    if of_angle(current):
        return _better(current, _with_noise_of_angle(current))
    color = _color(current)
    if color:
        colored = _refitted(current, Color(color))
        current = _better(current, colored) if _shown_by_samples(colored) else current
    return with_errors_of_turns(current)


def reshaped(current: AxisFit, blocks: Sequence[Blocks]) -> AxisFit:
    """The fit with level and colour of the noise estimated anew in ``blocks``, after terms have explained a part of either."""
    design = current.design
    if not design.color.neighbours and all(b.weight is None for b in design.given):
        return current
    return shaped(fit_noise(design.over(blocks).colored(WHITE)))


def _shown_by_samples(colored: AxisFit) -> bool:
    """True if the samples within blocks scatter as little as the colour says, or if the colour is as faint as flicker noise's.

    A low-pass that correlates means over a tenth of a second leaves little scatter within them. White samples whose means are
    correlated hold an error of the model, which is no noise. The scatter is that of an Ornstein-Uhlenbeck process.
    """
    design, color = colored.design, colored.design.color.neighbours
    count = sum(b.within_n for b in design.blocks)
    if color <= POLICY.faint_color or count < POLICY.least_scatter:
        return True
    scatter = sum(b.within_ss[design.axis] for b in design.blocks) / count
    samples = float(np.median(np.concatenate([b.n for b in design.blocks])))
    x = -float(np.log(color))  # length of a block in correlation times
    within = colored.noise.white_sd_dps**2 * x / (2 * samples) * (1 - 2 * (x - 1 + color) / x**2)
    return bool(scatter <= POLICY.of_samples * within)


def of_angle(current: AxisFit) -> bool:
    """True if the true rate about the axis is the slope of one measured angle."""
    about = [b.run.measured_rates for b in current.design.blocks if b.run.axis_index == current.design.axis]
    return any(m is not None and m.left_deg is not None for m in about)


def of_slopes(current: AxisFit) -> bool:
    """True if the true rate about the axis is the slope of one measured angle or of orientations."""
    runs = [b.run for b in current.design.blocks if b.run.axis_index == current.design.axis or b.run.three_axes]
    return any(r.measured_rates is not None and r.measured_rates.derived for r in runs)


def beyond_color(current: AxisFit) -> float:
    """The variance of one sample's noise by which block means exceed the colour of the fit, dps^2; negative if they have less.

    The noise of a smoothed slope has a spectrum that no autoregression and no angle at the ends of blocks describes exactly.
    Lines do not count, and below ``LOWEST_HZ`` only a lack does: more is there drift or an effect that the model lacks.
    """
    return _beyond_color(current)[0]


def less_than_color(current: AxisFit) -> float:
    """The variance of one sample's noise that block means lack of the fit's colour, dps^2; 0 within one of its errors.

    No low-pass is an autoregression, whose level at low frequencies is then too high. Each value of a periodogram scatters by
    its expectation. More than the colour of the fit is left alone: it may be an effect.
    """
    found, error = _beyond_color(current)
    return found if found < -error else 0.0


def _beyond_color(current: AxisFit) -> tuple[float, float]:
    """The variance of :func:`beyond_color` with its standard error, dps^2; zero if there are too few values."""
    angle, power = _without_lines(current)
    if angle.size < BANDS * LEAST_IN_BAND:
        return 0.0, 0.0
    modelled, slow = _modelled(current, angle), angle < 2 * np.pi * LOWEST_HZ * BLOCK_S
    beyond, each = power - modelled, _usual_level(current) / angle.size
    found = float(beyond[~slow].sum() + min(0.0, beyond[slow].sum())) * each
    return found, float(np.sqrt((modelled**2).sum())) * each


def noise_of_means(current: AxisFit, seconds: float) -> float:
    """Standard deviation of one sample's noise as means over some ``seconds`` show it, deg/s.

    Above ``LOWEST_HZ`` it is that of the residuals without lines, below that of the fit, or of the residuals if they have
    less: more is there drift or a misfit. Beside a measured angle it is that of the smooth rate, which is less than that of the
    angles at the ends of blocks, with which the fit works.
    """
    angle, power = _without_lines(current)
    if angle.size < BANDS * LEAST_IN_BAND:
        return current.noise.white_sd_dps * _usual_level(current) ** 0.5
    slow, modelled = angle < 2 * np.pi * LOWEST_HZ * BLOCK_S, _modelled(current, angle)
    power = np.where(slow, modelled * min(1.0, float(power[slow].sum() / modelled[slow].sum())), power)
    turns = angle / (2 * np.pi)
    passed = (np.sinc(turns * seconds / BLOCK_S) / np.sinc(turns)) ** 2
    level = float(np.sqrt((power * passed).sum() / passed.sum() * _usual_level(current)))
    return level * _smoothed_part(current, int(np.ceil(seconds / BLOCK_S))) if of_angle(current) else level


def _smoothed_part(current: AxisFit, blocks: int) -> float:
    """How much the means of residuals over some ``blocks`` scatter against the smooth rate, over that against the angles."""
    powers = []
    for i, b in enumerate(current.design.blocks):
        several = b.t_s.size // blocks * blocks
        if several and not b.run.rate_is_mean:
            pair = (b.mean(_residual_dps(current, b)[:, None])[:, 0], current.block_residuals(i))
            powers.append([several * float(np.var(r[:several].reshape(-1, blocks).mean(axis=1))) for r in pair])
    smooth_power, power = np.sum(powers, axis=0) if powers else (1.0, 1.0)
    return min(1.0, float(np.sqrt(smooth_power / max(power, 1e-300))))


def _usual_level(current: AxisFit) -> float:
    """The mean over the blocks of the noise's variance over that to which their weights refer."""
    return float(np.mean(np.concatenate([b.n / b.precision for b in current.design.blocks])))


def _modelled(current: AxisFit, angle: Array) -> Array:
    """The power of the fit's white and coloured noise, dps^2, at angles [k] per block."""
    return current.noise.white_sd_dps**2 * current.design.color.density(angle)


def _without_lines(current: AxisFit) -> tuple[Array, Array]:
    """Angles [k] per block and the power [k] of the residuals there, dps^2, as :func:`_periodogram` has them, without lines."""
    angle, power = _periodogram(current, np.ones, 0.0)
    for band in np.array_split(np.argsort(angle), BANDS) if angle.size >= BANDS else ():
        level = float(np.median(power[band])) / np.log(2)
        power[band] = np.where(power[band] > level * np.log(angle.size / POLICY.floor_line_chance), level, power[band])
    return angle, power


def _with_noise_of_angle(current: AxisFit) -> AxisFit:
    """The fit with the likeliest noise of the angle at the ends of the blocks.

    The search begins where the residuals' spectrum puts it: the noise of an angle rises with the square of the frequency, and
    white noise is what is left at the lowest. A smooth curve through the angles takes of the highest.
    """
    from scipy.optimize import minimize_scalar

    angle, power = _periodogram(current, lowest_hz=0.0)
    order = np.argsort(angle)[: np.count_nonzero(angle < OF_ENDS)]
    if order.size < LEAST_IN_BAND:
        return current
    rising, low = np.array_split(order, 2)[1], order[: max(LEAST_IN_BAND // 2, order.size // 16)]
    of_angle, white = np.median(power[rising] / (2 - 2 * np.cos(angle[rising]))), np.median(power[low])
    start = float(np.log(np.clip(of_angle / max(white, 1e-300), 1e-3, 1e6)))
    fits: dict[float, AxisFit] = {}

    def cost(x: float) -> float:
        design = current.design.colored(Color(of_angle=float(np.exp(x))))
        noise = replace(current.noise, white_sd_dps=white_start(design))
        fits[x] = fit_noise(design, start=with_noise(design, noise, current.spreads))
        return -fits[x].loglik

    for _ in range(WINDOWS):
        found = minimize_scalar(cost, bounds=(start - SEARCHED, start + SEARCHED), method="bounded", options={"xatol": 0.1})
        if abs(found.x - start) < 0.9 * SEARCHED:
            break
        start = float(found.x)
    return fits[float(found.x)]


def _better(current: AxisFit, trial: AxisFit, least_gain: float = POLICY.noise_shape_gain) -> AxisFit:
    return trial if trial.loglik > current.loglik + least_gain else current


def _refitted(current: AxisFit, color: Color) -> AxisFit:
    design = current.design.colored(color)
    return fit_noise(design, start=likeliest_start(design, with_noise(design, current.noise, current.spreads)))


def _weighted(current: AxisFit) -> AxisFit | None:
    """The fit with blocks weighted by the level of the noise at their time; None if the level does not change."""
    design, axis = current.design, current.design.axis
    residuals = []
    for b in design.blocks:
        y_dps = _residual_dps(current, b)
        rows, apart_dps = b.strays[axis]
        y_dps[rows] -= apart_dps
        residuals.append(y_dps)
    levels = relative_levels(residuals, count_dps=max(b.run.count_dps(axis) for b in design.blocks))
    if levels.of_residual is None:
        return None
    power = [b.mean(level[:, None] ** 2)[:, 0] for b, level in zip(design.blocks, levels.of_residual, strict=True)]
    usual = float(np.mean(np.concatenate(power)))
    blocks = [replace(b, weight=usual / p) for b, p in zip(design.blocks, power, strict=True)]
    heavier = design.over(blocks)
    return fit_noise(heavier, start=with_noise(heavier, current.noise, current.spreads))


def _residual_dps(current: AxisFit, b: Blocks) -> Array:
    """What a run reads beside the true rate and the terms that all runs share, at each sample, shape [n], deg/s."""
    axis = current.design.axis
    return np.asarray(b.run.gyro_dps[:, axis] - known_dps(b.run, axis) - _explained_dps(current, b))


def _explained_dps(current: AxisFit, b: Blocks) -> Array:
    """What the terms that all runs share make of a run, shape [n], deg/s. A scale error of a fast motion is no noise."""
    columns = current.design.sample_columns(b)
    parts = (beta * columns[t][:, j] for beta, (t, j) in zip(current.solution.beta, current.design.layout.fixed, strict=True))
    return np.asarray(sum(parts, np.zeros(len(b.run))))


def _color(current: AxisFit) -> float:
    """Correlation of the white noise of neighbouring blocks; 0 if they are too few to show one.

    The autoregression whose spectrum is parallel to the periodogram of the residuals above ``LOWEST_HZ``.
    """
    angle, power = _periodogram(current)
    if angle.size < BANDS * LEAST_IN_BAND:
        return 0.0
    order = np.argsort(angle)
    bands = np.array_split(order, BANDS)
    power = np.maximum(power, np.finfo(np.float64).tiny)
    level = np.array([np.log(np.median(power[band])) for band in bands])
    middle = np.array([float(np.mean(np.cos(angle[band]))) for band in bands])
    off = level[:, None] + np.log(1 + COLORS**2 - 2 * COLORS * middle[:, None])
    color = float(COLORS[int(np.argmin(off.var(axis=0)))])
    return color if abs(color) > POLICY.color_errors / np.sqrt(2 * angle.size) else 0.0


def _periodogram(
    current: AxisFit, window_of: Callable[[int], Array] = np.hanning, lowest_hz: float = LOWEST_HZ
) -> tuple[Array, Array]:  # fmt: skip
    """Angles [k] per block, rad, above ``lowest_hz``, and the power [k] of the residuals there of all runs.

    The power of white noise is the variance of one sample, dps^2.
    """
    angles: list[Array] = []
    powers: list[Array] = []
    for i, b in enumerate(current.design.blocks):
        m = b.t_s.size
        if m < 2 * BANDS or np.ptp(b.n) > 0 or b.run.rate_is_mean:
            continue
        step_s = float(b.t_s[-1] - b.t_s[0]) / (m - 1)
        residual = current.block_residuals(i) * np.sqrt(b.precision)
        window = window_of(m)
        power = np.abs(np.fft.rfft((residual - residual.mean()) * window)) ** 2 / (window @ window)
        angle = 2 * np.pi * np.fft.rfftfreq(m)
        fast = (angle > 2 * np.pi * lowest_hz * step_s) & (angle < 0.98 * np.pi)
        angles.append(angle[fast].astype(np.float64))
        powers.append(power[fast].astype(np.float64))
    return np.concatenate([*angles, np.zeros(0)]), np.concatenate([*powers, np.zeros(0)])
