"""Can the data tell an effect from every other effect of the documented table?

The answer needs no tool. The signal that was planted is projected onto the columns of each rival, with the rival's nonlinear
parameters on a grid, in the metric of the true noise. What is left, in standard errors, is what the best test could see.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .case import AXES, Array, RunTruth, Truth
from .detectability import whitened
from .signals import play

Columns = list[Array]  # of each run, [k, n]
LIMITS = {"drift": ("warmup",), "table_ripple": ("order_tone",)}
"""Rivals that hold an effect as a limit: the simpler is the right name. A warm-up far slower than the recording is a drift, and
at one rate a tone of any order is a ripple where the order is a small whole number."""
LARGEST = {
    "bias_temperature": (0.1, 0.01, 0.001), "thermal_lag": (1.0,), "drift": (5e-3,), "warmup": (0.5,),
    "thermal_hysteresis": (0.3,), "g_sensitivity": (0.3, 0.3, 0.3), "g2_sensitivity": (0.2,), "centripetal": (4e-5,),
    "misalignment": (0.05,), "scale_asymmetry": (5e-3,), "scale_temperature": (1e-3,), "scale_nonlinearity": (5e-7,),
    "spin_up": (0.03,), "lag": (0.03,), "clock_error": (5e-3,),
}  # fmt: skip
"""Ten times the typical size of each rival's coefficients. Beyond, the rival is not physical and passes for no effect."""
LOWEST_TONE_HZ = 1.0
"""Of the documented vibration_tone."""
LAGS_S = (0.5, 1.5, 5.0, 15.0, 50.0, 150.0)


Apart = dict[str, float]
"""Standard errors by which an effect stands out beside each rival."""


def told_apart(truth: Truth, effect: str, physical: bool = False) -> tuple[float, Apart]:
    """Standard errors by which the effect stands out alone, and beside each rival, on the axis that shows it best.

    Scale, bias, turn-on bias and the session's other effects are projected out throughout. Where only ``physical`` rivals
    count, one that would need a size beyond ``LARGEST`` leaves all of the effect.
    """
    shown = [i for i in range(3) if any(np.any(run.injected_dps[effect][i]) for run in truth.runs)]
    each = [_on_axis(truth, effect, axis, physical) for axis in shown]
    return max(each, default=(0.0, {}), key=lambda found: found[0])


def power(truth: Truth, effect: str) -> float:
    """Standard errors by which the power of a shape that nobody knows stands over the noise's.

    Of unit white noise, m squared coefficients sum to m with variance 2 m. m is the participation number of the signal's
    Fourier coefficients, two for each frequency.
    """
    parts = []
    for run in truth.runs:
        white = whitened(truth, run.injected_dps[effect])
        centred = white - white.mean(axis=-1, keepdims=True)
        parts.append((np.abs(np.fft.rfft(centred, norm="ortho")) ** 2).ravel())
    each = 2 * np.concatenate(parts)
    total = float(np.sum(each))
    coefficients = 2 * total**2 / float(np.sum(each**2)) if total else 1.0
    return total / np.sqrt(2 * coefficients)


def _on_axis(truth: Truth, effect: str, axis: int, physical: bool) -> tuple[float, Apart]:
    itself = (effect, *LIMITS.get(effect, ()))
    rivals = [(name, columns, own) for name, columns, own in shapes(truth, axis) if name not in itself]
    others = [id_ for id_ in truth.runs[0].injected_dps if id_ != effect]
    known: list[Array] = []
    slices: list[slice] = []
    at = 0
    for k, run in enumerate(truth.runs):
        one = np.ones_like(run.t_s)
        rows = [run.injected_dps[effect][axis], one, *(run.injected_dps[id_][axis] for id_ in others)]
        if AXES[axis] == truth.case.table_axis:
            rows.append(run.rate_dps)
        stacked = [np.array(rows), *(columns[k] for _, columns, _ in rivals)]
        known.append(whitened(truth, np.concatenate(stacked)))
        at = len(rows)
    for _, columns, _ in rivals:
        slices.append(slice(at, at + columns[0].shape[0]))
        at += columns[0].shape[0]
    base = slice(0, slices[0].start) if slices else slice(0, at)
    alone = _left(truth, [m[base] for m in known])[0]
    beside: Apart = {}
    for (name, _, own), part in zip(rivals, slices, strict=True):
        matrices = [np.concatenate([m[base], m[part]]) for m in known]
        left, sizes = _left(truth, matrices, part.stop - part.start if own else 0)
        count = part.stop - part.start
        if physical and name in LARGEST and np.any(np.abs(sizes[-count:]) > LARGEST[name][:count]):
            left = alone
        beside[name] = min(left, beside.get(name, np.inf))
    return alone, beside


def _left(truth: Truth, matrices: list[Array], own: int = 0) -> tuple[float, Array]:
    """Norm of the first row beside the others, and their coefficients; the last `own` rows have their own in each run."""
    if own:  # projected out run by run
        matrices = [_without(m[:-own], m[-own:]) for m in matrices]
    size = matrices[0].shape[0]
    information = np.zeros((size, size))
    for scenario in dict.fromkeys(run.scenario for run in truth.runs):
        mine = np.concatenate([matrices[k] for k, run in enumerate(truth.runs) if run.scenario == scenario], axis=1)
        information += mine @ mine.T
        if truth.case.turn_on_sd_dps > 0.0:
            offset = mine @ mine[1]  # the second row is the whitened constant
            information -= np.outer(offset, offset) / (mine[1] @ mine[1] + truth.case.turn_on_sd_dps**-2)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scale[scale < 1e-12] = 1.0
    scaled = information / np.outer(scale, scale)
    solved = np.linalg.lstsq(scaled[1:, 1:], scaled[0, 1:], rcond=1e-9)[0]
    left = float(scale[0] * np.sqrt(max(0.0, scaled[0, 0] - scaled[0, 1:] @ solved)))
    return left, solved * scale[0] / scale[1:]


def _without(rows: Array, own: Array) -> Array:
    norm = np.linalg.norm(own, axis=1, keepdims=True)
    basis = np.linalg.qr((own / np.where(norm > 0, norm, 1.0)).T)[0]
    return rows - (rows @ basis) @ basis.T


def shapes(truth: Truth, axis: int) -> Iterator[tuple[str, Columns, bool]]:
    """(effect id, columns of each run, whether each run has coefficients of its own) of every rival on an axis."""
    runs = truth.runs
    on_table = AXES[axis] == truth.case.table_axis
    for name, columns in _slow(truth, on_table):
        yield name, columns, False
    if on_table and any(np.ptp(run.rate_dps) > 1 for run in runs):
        slopes = [np.gradient(run.rate_dps, run.t_s) for run in runs]
        yield "lag", [slope[None] for slope in slopes], False
        yield "clock_error", [(run.t_s * slope)[None] for run, slope in zip(runs, slopes, strict=True)], False
    orders, rates_hz = _planted_waves(truth)
    known = truth.case.table_angle
    for order in orders:
        waves = [_wave(np.radians(order * run.table_angle_deg)) for run in runs]
        yield "order_tone", waves, not known
        if on_table and order == round(order):
            yield "table_ripple", [w * run.rate_dps for w, run in zip(waves, runs, strict=True)], not known
    for f_hz in (f_hz for f_hz in rates_hz if f_hz >= LOWEST_TONE_HZ):
        yield "vibration_tone", [_wave(2 * np.pi * f_hz * _moments_s(run)) for run in runs], True


def _slow(truth: Truth, on_table: bool) -> Iterator[tuple[str, Columns]]:
    runs = truth.runs
    dt = [run.temp_c - 25.0 for run in runs]
    yield "bias_temperature", [np.array([d, d**2, d**3]) for d in dt]
    yield "thermal_lag", [np.gradient(run.temp_c, run.t_s)[None] for run in runs]
    yield "drift", [run.cycle_s[None] for run in runs]
    for tau_s in LAGS_S:
        yield "warmup", [np.exp(-(run.power_on_s + run.t_s) / tau_s)[None] for run in runs]
    for width_c in (2.0, 5.0, 10.0) if truth.case.climate == "ramp" else ():
        yield "thermal_hysteresis", [play(run.temp_c, width_c)[None] for run in runs]
    if truth.case.accelerometer:
        yield "g_sensitivity", [run.acceleration_g for run in runs]
        yield "g2_sensitivity", [np.sum(run.acceleration_g**2, axis=0)[None] for run in runs]
    else:
        yield "g_sensitivity", [np.full((1, len(run.t_s)), 1.0 if run.face == "up" else -1.0) for run in runs]
    yield "centripetal", [run.rate_dps[None] ** 2 for run in runs]
    if not on_table:
        yield "misalignment", [run.rate_dps[None] for run in runs]
        return
    yield "scale_asymmetry", [np.abs(run.rate_dps)[None] for run in runs]
    yield "scale_temperature", [(d * run.rate_dps)[None] for d, run in zip(dt, runs, strict=True)]
    yield "scale_nonlinearity", [run.rate_dps[None] ** 3 for run in runs]
    for tau_s in LAGS_S:
        yield "spin_up", [(run.rate_dps * np.exp(-run.t_s / tau_s))[None] for run in runs]
    for width_dps in (0.2, 0.5, 1.0, 2.0):
        yield "dead_band", [np.where(np.abs(run.rate_dps) < width_dps, run.rate_dps, 0.0)[None] for run in runs]


def _moments_s(run: RunTruth) -> Array:
    """The moments that the samples show (a poll reads the chip's newest sample), from the table's angle at a constant rate."""
    if not run.table_rate_dps:
        return run.t_s
    return (run.table_angle_deg - run.table_angle_deg[0]) / run.table_rate_dps


def _planted_waves(truth: Truth) -> tuple[set[float], set[float]]:
    """The orders and frequencies at which a planted wave could pass for one of another kind."""
    speeds = {round(abs(run.table_rate_dps), 6) for run in truth.runs if run.table_rate_dps}
    orders: set[float] = set()
    tones: set[float] = set()
    for effect in truth.case.effects:
        if effect.id == "order_tone":
            orders.add(effect.parameters["order"])
        elif effect.id == "table_ripple":
            orders |= {float(name.split("_")[1]) for name in effect.parameters if name.startswith("amplitude_")}
        elif effect.id == "vibration_tone":
            tones.add(effect.parameters["f_hz"])
    orders |= {360.0 * f_hz / speed for f_hz in tones for speed in speeds}
    tones |= {order * speed / 360.0 for order in orders for speed in speeds}
    return orders, tones


def _wave(angle: Array) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])
