"""By how many standard errors an effect stands out in a session."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from .case import AXES, Array, Truth
from .chip import Chip

ORDER = 12


def _signal(truth: Truth, effect: str | None) -> list[Array]:
    """What was injected into each run, [3, n]: one effect, or all together."""
    zero = np.zeros((3, len(truth.runs[0].t_s)))
    return [
        sum((signal for name, signal in run.injected_dps.items() if effect in (None, name)), zero) for run in truth.runs
    ]


def whitened(truth: Truth, columns: Array) -> Array:
    """Columns [..., n] through the filter that turns the true noise into unit white noise.

    White noise as the low-pass leaves it is whitened by its autoregressive predictor. Where it is white at the polls, this
    is a factor alone. Drift noise (OU) is far slower than the predictor, whose gain at zero frequency it keeps; the exact
    Kalman filter takes it out.
    """
    case = truth.case
    predictor, variance = _predictor(truth)
    columns = lfilter(predictor, [1.0], columns - columns[..., :1], axis=-1) + columns[..., :1] * np.sum(predictor)
    if case.ou_sd_dps == 0.0:
        return columns / np.sqrt(variance)
    pole = np.exp(-1 / (case.poll_hz * case.ou_tau_s))
    ou_variance = (case.ou_sd_dps * np.sum(predictor)) ** 2
    spread, state = ou_variance, np.zeros(columns.shape[:-1])
    out = np.empty_like(columns)
    for i in range(columns.shape[-1]):
        innovation = columns[..., i] - state
        total = spread + variance
        out[..., i] = innovation / np.sqrt(total)
        state = pole * (state + spread / total * innovation)
        spread = pole**2 * spread * variance / total + ou_variance * (1 - pole**2)
    return out


def _predictor(truth: Truth) -> tuple[Array, float]:
    """The autoregressive whitening filter of the fast noise, and the variance of what it leaves."""
    white = truth.lsb_dps**2 / 12 + truth.case.reference_sd_dps**2
    covariance = Chip(truth.case).noise_covariance(truth.case.poll_hz, ORDER)
    covariance[0] += white
    if np.all(np.abs(covariance[1:]) < 0.05 * covariance[0]):
        return np.ones(1), truth.white_sd_dps**2 + white
    predictor = np.concatenate([[1.0], -solve_toeplitz(covariance[:-1], covariance[1:])])
    return predictor, float(predictor @ covariance)


def detectability(truth: Truth, effect: str | None = None) -> float:
    """Standard errors by which the effect's size stands out for one who knows its shape and the noise.

    The norm of the injected signal after projecting out scale (table's axis) and bias (every axis), in the metric of
    the true noise: white and quantisation, OU, and the turn-on bias as a random offset of each power cycle. Without
    `effect`, of all that was injected together.
    """
    signals = _signal(truth, effect)
    constant = np.ones_like(truth.runs[0].t_s)
    total = 0.0
    for i, axis in enumerate(AXES):
        if not any(np.any(signal[i]) for signal in signals):
            continue
        shown = [[signal[i], constant] for signal in signals]
        if axis == truth.case.table_axis:
            shown = [[*columns, run.rate_dps] for columns, run in zip(shown, truth.runs, strict=True)]
        columns = whitened(truth, np.array(shown))
        information = np.zeros((columns.shape[1],) * 2)
        for scenario in dict.fromkeys(run.scenario for run in truth.runs):
            mine = np.concatenate([columns[k] for k, run in enumerate(truth.runs) if run.scenario == scenario], axis=1)
            information += mine @ mine.T
            if truth.case.turn_on_sd_dps > 0.0:
                # the whitened constant is also the turn-on offset's column
                offset = mine @ mine[1]
                information -= np.outer(offset, offset) / (mine[1] @ mine[1] + truth.case.turn_on_sd_dps**-2)
        known = information[1:, 1:]
        size = np.sqrt(np.diag(known))
        solved = np.linalg.lstsq(known / np.outer(size, size), information[0, 1:] / size, rcond=1e-10)[0]
        total += max(0.0, information[0, 0] - float(solved @ (information[0, 1:] / size)))
    return float(np.sqrt(total))


def white_detectability(truth: Truth, effect: str | None = None) -> float:
    """The plainer figure: norm of the injected signal over the white noise of a sample.

    Scale, and a free bias for each power cycle, are projected out. It ignores drift noise, and is blind to what is
    constant within a power cycle (in the full protocol: g_sensitivity, misalignment, every function of the rate).
    """
    signals = _signal(truth, effect)
    scenarios = list(dict.fromkeys(run.scenario for run in truth.runs))
    total = 0.0
    for i, axis in enumerate(AXES):
        centred = []
        for scenario in scenarios:
            runs = [k for k, run in enumerate(truth.runs) if run.scenario == scenario]
            pair = np.array(
                [np.concatenate([signals[k][i] for k in runs]), np.concatenate([truth.runs[k].rate_dps for k in runs])]
            )
            centred.append(pair - pair.mean(axis=1, keepdims=True))
        signal, rate = np.concatenate(centred, axis=1)
        power = rate @ rate
        if axis == truth.case.table_axis and power > 1e-12:
            signal = signal - rate * (rate @ signal) / power
        total += signal @ signal
    return float(np.sqrt(total) / truth.white_sd_dps)
