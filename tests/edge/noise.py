"""The true noise as a metric: inner products of signals in units of its standard deviation.

Noise white behind a low-pass is whitened by its autoregressive predictor. Drift and turn-on bias act on sums over blocks that
are short beside the drift. What is known of a turn by its net angle alone is one number.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_toeplitz
from scipy.signal import butter, lfilter

from .recording import Array, Recording, Run

ORDER = 12
BLOCKS_PER_TAU = 20
Columns = list[Array]
"""Of each run, [k, n]."""


class Metric:
    """Inner products on one axis by the inverse of the noise's covariance."""

    def __init__(self, made: Recording, axis: int) -> None:
        self.made = made
        self.predictor, self.variance = _predictor(made, axis)
        self.scenarios = [
            [k for k, run in enumerate(made.runs) if run.scenario == s] for s in dict.fromkeys(r.scenario for r in made.runs)
        ]

    def gram(self, shared: Columns, own: Columns | None = None) -> Array:
        """Products of ``shared`` columns, and of ``own`` ones with a coefficient in each run, which follow run by run."""
        k = shared[0].shape[0]
        m = own[0].shape[0] if own else 0
        out = np.zeros((k + m * len(shared),) * 2)
        for members in self.scenarios:
            parts = []
            for place, j in enumerate(members):
                full = np.zeros((k + m * len(members), shared[j].shape[1]))
                full[:k] = shared[j]
                if own:
                    full[k + m * place : k + m * (place + 1)] = own[j]
                parts.append(self._reduced(self.made.runs[j], full))
            found = self._product(members, parts)
            index = np.concatenate([np.arange(k), *(np.arange(k + m * j, k + m * (j + 1)) for j in members)])
            out[np.ix_(index, index)] += found
        return out

    def _reduced(self, run: Run, columns: Array) -> tuple[Array, Array, Array]:
        """Whitened columns and the whitened constant in its last row, the blocks' first rows, and their times."""
        every = np.vstack([columns, np.ones(columns.shape[1])])
        first = every[:, :1]
        white = lfilter(self.predictor, [1.0], every - first, axis=1) + first * np.sum(self.predictor)
        white /= np.sqrt(self.variance)
        step = max(1, int(self.made.sensor.rate_hz * self.made.sensor.ou_tau_s / BLOCKS_PER_TAU))
        pieces, starts, times, at = [], [], [], 0
        for rows, net in run.segments or ((slice(0, run.t_s.size), False),):
            part = white[:, rows]
            if net:
                n, length_s = part.shape[1], part.shape[1] / self.made.sensor.rate_hz
                part = part.sum(axis=1, keepdims=True) / np.sqrt(n)
                spread = part[-1, 0] * self.made.turn_se_deg / length_s
                part /= np.sqrt(1 + spread**2)
            edges = np.arange(0, part.shape[1], step)
            pieces.append(part)
            starts.append(at + edges)
            middle = rows.start + np.minimum(edges + step // 2, part.shape[1] - 1)
            if net:
                middle = np.array([(rows.start + rows.stop) // 2])
            times.append(run.start_s + run.t_s[middle])
            at += part.shape[1]
        return np.concatenate(pieces, axis=1), np.concatenate(starts), np.concatenate(times)

    def _product(self, members: list[int], parts: list[tuple[Array, Array, Array]]) -> Array:
        sensor = self.made.sensor
        total, sums, weights, times = None, [], [], []
        for white, starts, at_s in parts:
            columns, constant = white[:-1], white[-1]
            product = columns @ columns.T
            total = product if total is None else total + product
            sums.append(np.add.reduceat(columns * constant, starts, axis=1))
            weights.append(np.add.reduceat(constant**2, starts))
            times.append(at_s)
        each, d, t = np.concatenate(sums, axis=1), np.concatenate(weights), np.concatenate(times)
        apart_s = np.abs(t[:, None] - t[None])
        covariance = sensor.ou_sd_dps**2 * np.exp(-apart_s / sensor.ou_tau_s) + sensor.turn_on_sd_dps**2
        means = each / d
        factor = cho_factor(covariance + np.diag(1 / d))
        assert total is not None
        return np.asarray(total - means @ each.T + means @ cho_solve(factor, means.T))


def _predictor(made: Recording, axis: int) -> tuple[Array, float]:
    """The whitening filter of the fast noise, and the variance of what it leaves."""
    sensor = made.sensor
    referred = made.reference == "three" or axis == made.axis
    more = sensor.lsb_dps**2 / 12 + (made.ref_noise_dps**2 if referred else 0.0)
    if sensor.cutoff_hz is None:
        return np.ones(1), sensor.white_sd_dps**2 + more
    b, a = butter(2, sensor.cutoff_hz, fs=sensor.rate_hz)
    impulse = lfilter(b, a, np.eye(1, 2048)[0])
    covariance = sensor.white_sd_dps**2 * np.correlate(impulse, impulse, "full")[len(impulse) - 1 :][: ORDER + 1]
    covariance[0] += more
    predictor = np.concatenate([[1.0], -solve_toeplitz(covariance[:-1], covariance[1:])])
    return predictor, float(predictor @ covariance)


def beside(gram: Array, target: int, known: list[int], rcond: float = 1e-9) -> tuple[float, Array]:
    """Norm of a column beside the ``known`` ones, and their coefficients in its best imitation."""
    if not known:
        return float(np.sqrt(max(0.0, gram[target, target]))), np.zeros(0)
    size = np.sqrt(np.maximum(np.diag(gram)[known], 1e-300))
    size[size < 1e-12] = 1.0
    inner = gram[np.ix_(known, known)] / np.outer(size, size)
    outer = gram[known, target] / size
    solved = np.linalg.lstsq(inner, outer, rcond=rcond)[0]
    return float(np.sqrt(max(0.0, gram[target, target] - outer @ solved))), solved / size
