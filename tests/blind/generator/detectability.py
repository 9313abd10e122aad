"""By how many standard errors an effect stands out in a session."""

from __future__ import annotations

import numpy as np

from .case import AXES, Array, Truth
from .chip import POLL_HZ


def _signal(truth: Truth, effect: str | None) -> list[Array]:
    """What was injected into each run, [3, n]: one effect, or all together."""
    zero = np.zeros((3, len(truth.runs[0].t_s)))
    return [
        sum((signal for name, signal in run.injected_dps.items() if effect in (None, name)), zero) for run in truth.runs
    ]


def _whitened(truth: Truth, columns: Array) -> Array:
    """Columns [..., n] through the filter that turns the true white + OU noise into unit white noise (exact Kalman)."""
    case = truth.case
    variance = truth.white_sd_dps**2 + truth.lsb_dps**2 / 12
    if case.ou_sd_dps == 0.0:
        return columns / np.sqrt(variance)
    pole = np.exp(-1 / (POLL_HZ * case.ou_tau_s))
    spread, state = case.ou_sd_dps**2, np.zeros(columns.shape[:-1])
    out = np.empty_like(columns)
    for i in range(columns.shape[-1]):
        innovation = columns[..., i] - state
        total = spread + variance
        out[..., i] = innovation / np.sqrt(total)
        state = pole * (state + spread / total * innovation)
        spread = pole**2 * spread * variance / total + case.ou_sd_dps**2 * (1 - pole**2)
    return out


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
        columns = _whitened(truth, np.array(shown))
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
