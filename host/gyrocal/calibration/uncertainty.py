"""The error of a face's answer from noise, drift, and effects of typical size that a few seconds cannot exclude.

A face at true rate w measures ``u = bias + scale * w``. Its means over blocks of 0.25 s are
``y_b - w = u + sum_j c_j x_j(t_b) + o_b + e_b``: white noise e (its level at long times, so that a low-pass's correlation
counts), an Ornstein-Uhlenbeck drift o, and effects c, ripple of the table and a transient. Whether an effect acts is not known.
Bayesian model averaging weights 44 hypotheses by their evidence: ripple once and twice a turn or not, and a transient of some
size and time constant or none. Under each hypothesis c is Gaussian with a typical size, so that everything has a closed form.
What a few seconds cannot show, the rest of the run may: its last whole turn is held against the answer.
``gc_trust`` is the twin on the device (docs/details/device.md).

Arrays hold many sensors at once: N sensors, B blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from gyrocal.calibration.estimator import BLOCK_US
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

Index = np.ndarray[Any, np.dtype[np.int64]]

BLOCK_S = BLOCK_US * 1e-6
SHORT_HZ = 16.0
"""Noise at long times is estimated from means over 1/16 s, longer than a low-pass's correlation and shorter than an effect."""
CORRELATED = 2.5
"""Number of standard errors by which the level at long times must exceed the white one for the noise to be correlated."""

DRIFT_SD_DPS, DRIFT_TAU_S = 0.0007, 30.0
"""Standard deviation and correlation time of the drift in a few seconds, chosen for sensors with a bias instability of up to
3 deg/h. That is the largest Allan deviation of a drift of 1.35 mdps; half of it errs least between none and that."""
SHORT_S, LONG_DRIFT_SD_DPS = 6.0, 0.0023
"""In longer runs it is larger, by the root of their length, up to what minutes show: 1.5 to 3 mdps. The device has none."""
RIPPLE = 0.0018
"""Amplitude of a table's ripple, once or twice a turn, as a fraction of its rate. Typical values are 0.0005 to 0.005."""
SPIN_UP = (0.0009, 0.0065)
"""Sizes of a table's spin-up as fractions of its rate. Typical values are 0.0005 to 0.01."""
WARMUP_DPS = 0.02
"""Size of the sensor's own transient, in the middle of the typical range of a warm-up."""
TRANSIENT_TAU_S = (0.6, 1.15, 2.2, 4.2, 8.0)
PRESENT = 0.1
"""Prior probability that an effect acts: a table in order, on which one in ten has it at a typical size."""
SMALLEST_SD_DPS = 1e-6
"""Lower bound of the noise of a reading."""
LATEST_US = 60_000_000
"""Time into a run after which its readings are not held against the answer of its first seconds."""
STOPS_US = 1_000_000
"""Time before a run's end, in which the table may have been stopped, of which the same is true."""


@dataclass(frozen=True)
class FaceSums:
    """Block means of measured minus true rate of one face, [N, B], and sums from which their noise is estimated.

    ``number`` [B] counts blocks from the run's first sample, ``n`` [B] the samples in each. ``first_sq`` [N, B] are sums of
    squares of ``first_n`` [B] successive differences of samples, ``second_sq`` [N, B] of ``second_n`` [B] second differences
    of sums over ``short`` samples.
    """

    mean_dps: Array
    number: Array
    n: Array
    first_sq: Array
    first_n: Array
    second_sq: Array
    second_n: Array
    short: int
    rate_hz: float

    @staticmethod
    def of(residual_dps: Array, t_us: Index, rate_hz: float) -> FaceSums:
        """The sums of samples [N, n] at times [n] since the first one. A block with fewer than half its samples is left out."""
        y = np.atleast_2d(residual_dps)
        block = t_us // BLOCK_US
        number, first, n = np.unique(block, return_index=True, return_counts=True)
        means = np.add.reduceat(y, first, axis=1) / n
        short = max(1, int(rate_hz / SHORT_HZ + 0.5))
        sums = y[:, : y.shape[1] // short * short].reshape(len(y), -1, short).sum(2)
        second = np.diff(sums, 2, axis=1)
        ends = block[short * np.arange(2, sums.shape[1]) + short - 1]
        first_sq, first_n = _by_block(np.diff(y, axis=1) ** 2, block[1:], number)
        second_sq, second_n = _by_block(second**2, ends, number)
        full = 2e6 * n >= rate_hz * BLOCK_US
        return FaceSums(
            means[:, full], number[full].astype(float), n[full].astype(float), first_sq[:, full], first_n[full],
            second_sq[:, full], second_n[full], short, rate_hz,
        )  # fmt: skip


def _by_block(squares: Array, block: Index, number: Index) -> tuple[Array, Array]:
    """Sums [N, B] of squares [N, k] over the blocks to which they belong, and their numbers [B]."""
    start, stop = np.searchsorted(block, number, "left"), np.searchsorted(block, number, "right")
    padded = np.column_stack([squares, np.zeros(len(squares))])
    sums = np.add.reduceat(padded, np.column_stack([start, stop]).ravel(), axis=1)[:, ::2]
    return np.where(stop > start, sums, 0.0), (stop - start).astype(float)


def _median_of_mean(dof: float) -> float:
    """Median of a chi-square over its mean (Wilson and Hilferty, 1931)."""
    return float((1 - 2 / (9 * dof)) ** 3)


FIRST_DOF, SECOND_DOF = 2 / 3, 0.52
"""Effective degrees of freedom of a squared difference of white noise."""
SECOND_SPREAD = 1.35
"""Standard deviation of the noise's level by second differences, times the root of the number of blocks."""
LOWPASS, MOST_LACKING = 5 / 9, 0.4
"""The part that a mean of L samples removes from second differences, times n/(L - 1/L), and the largest part corrected for."""


def white_variance(faces: Sequence[FaceSums]) -> Array:
    """Variance [N] of one sample's noise at long times; the variance of a mean of n samples is the n-th part.

    It is a median over blocks, which a spike does not move. Successive differences show white noise most precisely, but
    underestimate noise behind a low-pass. Means over 1/16 s show both and are used if they show significantly more. The part
    that a low-pass removes from these is corrected as for a mean of L samples. Their ratio is then L^2, and second
    differences of sums over n samples lack the part 5/9 (L - 1/L)/n.
    """
    first = np.concatenate([_of_one(f.first_sq, f.first_n) for f in faces], axis=1)
    second = np.concatenate([_of_one(f.second_sq, f.second_n) for f in faces], axis=1)
    block, short = faces[0].rate_hz * BLOCK_S, faces[0].short
    white = np.median(first, axis=1) / (2 * _median_of_mean(FIRST_DOF * block))
    if second.shape[1]:
        slow = np.median(second, axis=1) / (6 * short * _median_of_mean(SECOND_DOF * block / short))
        limit = 1 + CORRELATED * SECOND_SPREAD / np.sqrt(second.shape[1])
        excess, most = LOWPASS * (slow - white), MOST_LACKING * short * np.sqrt(slow * white)  # L^2 = slow / white
        lacking = MOST_LACKING * np.divide(excess, most, where=excess < most, out=np.ones_like(most))
        white = np.where(slow > limit * white, slow / (1 - lacking), white)
    return white


def _of_one(squares: Array, count: Array) -> Array:
    return squares[:, count > 0] / count[count > 0]


class Under(NamedTuple):
    """Logarithm of the evidence for some effects; mean (dps) and variance (dps^2) of u if they act: [N] each."""

    log_evidence: Array
    u_dps: Array
    variance: Array


@dataclass(frozen=True)
class FacePosterior:
    """The estimate of u by a face under each hypothesis, [N, H]; the first one has neither ripple nor transient.

    ``chi2`` is at u's best value, ``log_evidence`` is up to a constant. ``blocks`` counts the observations.
    ``white`` [N] is the variance of u by white noise alone, ``standing`` [N] the part of every variance by rounding.
    """

    u_dps: Array
    variance: Array
    chi2: Array
    log_evidence: Array
    blocks: int
    white: Array
    standing: Array

    def under(self, effects: slice) -> Under:
        """The average over the hypotheses in which some effects act."""
        log_evidence, u, variance = self.log_evidence[:, effects], self.u_dps[:, effects], self.variance[:, effects]
        top = log_evidence.max(1, keepdims=True)
        weight = np.exp(log_evidence - top)
        total = weight.sum(1, keepdims=True)
        weight /= total
        mean = (weight * u).sum(1)
        spread = (weight * (variance + (u - mean[:, None]) ** 2)).sum(1)
        return Under((top + np.log(total / weight.shape[1]))[:, 0], mean, spread)

    def excess(self) -> Array:
        """Chi-square per degree of freedom [N] that the likeliest hypothesis leaves, at least 1 (Birge's ratio)."""
        best = self.log_evidence.argmax(1)[:, None]
        return np.maximum(1.0, np.take_along_axis(self.chi2, best, 1)[:, 0] / max(1, self.blocks - 1))

    def chi2_at(self, u_dps: Array, of: slice) -> Array:
        """Chi-square [N] of the residuals of an answer ``u_dps`` [N] under the likeliest of some hypotheses."""
        variance = self.variance[:, of]
        more = (u_dps[:, None] - self.u_dps[:, of]) ** 2 / variance
        best = (self.log_evidence[:, of] - 0.5 * (more + np.log(variance))).argmax(1)[:, None]
        chi2: Array = np.take_along_axis(self.chi2[:, of] + more, best, 1)[:, 0]
        return chi2


TRANSIENTS = len(SPIN_UP) * len(TRANSIENT_TAU_S)
EFFECTS = tuple(product((False, True), repeat=3))
"""All combinations of the effects that may act: ripple twice a turn, ripple once a turn, transient."""
FIRST_ORDER = slice(0, 2 * (1 + TRANSIENTS))
"""The hypotheses without ripple twice a turn, which the network's training data do not contain."""


def _of_effects(which: int) -> slice:
    """The hypotheses under which those effects act: one, or one for each size and time constant of the transient."""
    start = which // 2 * (1 + TRANSIENTS)
    return slice(start + 1, start + 1 + TRANSIENTS) if which % 2 else slice(start, start + 1)


def face_posterior(face: FaceSums, variance: Array, w_dps: float, step_dps: float = 0.0) -> FacePosterior:
    """The estimate of u from the blocks of a face at true rate ``w_dps``.

    ``variance`` [N] is that of the white noise of a sample. If it is too small to average over the reading's steps of
    ``step_dps``, a mean keeps the error of a step.
    """
    variance, standing = _with_steps(variance, step_dps)
    t_s = (face.number + 0.5) * BLOCK_S
    angle = np.deg2rad(abs(w_dps) * t_s)
    ripple_dps = abs(w_dps) * RIPPLE / np.sqrt(2.0)
    columns = np.array([
        *(ripple_dps * wave for wave in (np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle))),
        *(np.hypot(w_dps * size, WARMUP_DPS) * np.exp(-t_s / tau_s) for size, tau_s in product(SPIN_UP, TRANSIENT_TAU_S)),
        np.ones_like(t_s),
    ])  # fmt: skip
    origin = face.mean_dps[:, :1]  # avoids rounding errors of chi-square at a large bias
    gram: Array = _whitened_gram(columns, face.mean_dps - origin, face, variance)
    found = []
    for twice, once, transient in product((0.0, 1.0), (0.0, 1.0), range(-1, TRANSIENTS)):
        acts = np.array([once, once, twice, twice, float(transient >= 0), 1.0])
        rows = np.array([0, 1, 2, 3, 4 + max(transient, 0), len(columns) - 1])
        root = np.linalg.cholesky(gram[:, rows[:, None], rows] * (acts[:, None] * acts) + np.diag([1.0] * 5 + [0.0]))
        v: Array = np.linalg.solve(root, (gram[:, rows, -1] * acts)[..., None])[..., 0]
        chi2 = np.maximum(gram[:, -1, -1] - (v**2).sum(1), 0.0)
        diagonal = np.einsum("nii->ni", root)
        pivot = diagonal[:, 5]
        log_evidence = -0.5 * chi2 - np.log(diagonal).sum(1)
        found.append((v[:, 5] / pivot + origin[:, 0], 1 / pivot**2 + standing, chi2, log_evidence))
    u, spread, chi2s, evidence = (np.stack(x, axis=1) for x in zip(*found, strict=True))
    return FacePosterior(u, spread, chi2s, evidence, face.number.size, variance / face.n.sum(), standing)


def _with_steps(variance: Array, step_dps: float) -> tuple[Array, Array]:
    """Variance [N] of a sample's noise with that of rounding, and the part of rounding that no mean reduces."""
    standing = np.where(4 * variance < step_dps**2, step_dps**2 / 12, 0.0)
    return np.maximum(variance, max(step_dps**2 / 12, SMALLEST_SD_DPS**2)), standing


def drift_sd_dps(seconds: float) -> float:
    """Standard deviation of the drift that is presumed in runs of so many seconds."""
    return min(LONG_DRIFT_SD_DPS, DRIFT_SD_DPS * max(1.0, seconds / SHORT_S) ** 0.5)


def _whitened_gram(columns: Array, y_dps: Array, face: FaceSums, variance: Array) -> Array:
    """``C V^-1 C'`` [N, q, q] of ``columns`` [q - 1, B] and ``y_dps`` [N, B], V the covariance of noise and drift.

    A Kalman filter of the drift computes it, because its innovations are the values whitened by the Cholesky factor of V.
    """
    sensors, q = len(y_dps), len(columns) + 1
    gram = np.zeros((sensors, q, q))
    drift_variance = drift_sd_dps((float(face.number[-1]) + 1) * BLOCK_S) ** 2
    drift, spread = np.zeros((sensors, q)), np.full(sensors, drift_variance)
    for i, n in enumerate(face.n):
        if i:
            decay = np.exp(-(face.number[i] - face.number[i - 1]) * BLOCK_S / DRIFT_TAU_S)
            drift, spread = decay * drift, decay**2 * spread + drift_variance * (1 - decay**2)
        row = np.column_stack([np.broadcast_to(columns[:, i], (sensors, q - 1)), y_dps[:, i]]) - drift
        total = spread + variance / n
        gram += row[:, :, None] * row[:, None, :] / total[:, None, None]
        drift, spread = drift + (spread / total)[:, None] * row, spread * (variance / n) / total
    return gram


@dataclass(frozen=True)
class Combined:
    """Scale and bias [N] from all faces together, with their variances [N].

    ``chi2`` [N] is that of the faces about their line, of ``dof`` degrees of freedom: none of two faces.
    """

    scale: Array
    bias_dps: Array
    scale_variance: Array
    bias_variance: Array
    chi2: Array
    dof: int

    @staticmethod
    def of(faces: Sequence[FacePosterior], w_dps: Sequence[float]) -> Combined:
        """Least squares of two or more faces at two or more true rates, averaged over the effects that may act.

        All faces were on one table: an effect acts in all of them or in none. Its size, phase and time constant may differ.
        Faces that scatter about their line by more than their errors widen the variances (:attr:`scatter`).
        """
        w = np.array(w_dps)
        excess = [face.excess() for face in faces]
        log_weights, means, spreads, chi2s = [], [], [], []
        for which, act in enumerate(EFFECTS):
            some = _of_effects(which)
            under = [face.under(some) for face in faces]
            prior = float(np.sum(np.log(np.where(act, PRESENT, 1 - PRESENT))))
            log_weights.append(prior + sum(one.log_evidence for one in under))
            u = np.stack([one.u_dps for one in under], 1)
            precision = np.stack([1 / (one.variance * more) for one, more in zip(under, excess, strict=True)], 1)
            s0, s1, s2 = precision.sum(1), (precision * w).sum(1), (precision * w**2).sum(1)
            t0, t1 = (precision * u).sum(1), (precision * w * u).sum(1)
            det = s0 * s2 - s1**2
            scale, bias_dps = (s0 * t1 - s1 * t0) / det, (s2 * t0 - s1 * t1) / det
            means.append((scale, bias_dps))
            spreads.append((s0 / det, s2 / det))
            chi2s.append((precision * (u - bias_dps[:, None] - scale[:, None] * w) ** 2).sum(1))
        log_weight = np.array(log_weights)
        weight = np.exp(log_weight - log_weight.max(0))
        weight /= weight.sum(0)
        mean = np.einsum("en,ekn->kn", weight, means)
        chi2, dof = np.einsum("en,en->n", weight, chi2s), len(faces) - 2
        spread = np.einsum("en,ekn->kn", weight, spreads * _scatter(chi2, dof) + (np.array(means) - mean) ** 2)
        return Combined(mean[0], mean[1], spread[0], spread[1], chi2, dof)

    @property
    def scatter(self) -> Array:
        """By how much [N] the faces widen the variances: chi-square per degree of freedom, at least 1 (Birge's ratio)."""
        return _scatter(self.chi2, self.dof)

    def errors_of(self, scale: Array, bias_dps: Array) -> tuple[Array, Array]:
        """Standard errors [N] of another answer from the same faces: root of its expected squared error."""
        return (
            np.sqrt(self.scale_variance + (scale - self.scale) ** 2),
            np.sqrt(self.bias_variance + (bias_dps - self.bias_dps) ** 2),
        )


def _scatter(chi2: Array, dof: int) -> Array:
    return np.maximum(1.0, chi2 / dof) if dof > 0 else np.ones_like(chi2)


def misfit(faces: Sequence[FacePosterior], fit: Combined | None = None) -> Array:
    """Root of chi-square per degree of freedom [N] of the blocks about their face's mean, and of the faces about ``fit``."""
    between, dof = (0.0, 0) if fit is None else (fit.chi2, fit.dof)
    dof += sum(f.blocks - 1 for f in faces)
    chi2 = sum(f.chi2[:, 0] for f in faces) + between
    return np.sqrt(chi2 / dof) if dof > 0 else np.full(len(faces[0].chi2), np.nan)


def misfit_of(faces: Sequence[FacePosterior], u_dps: Sequence[Array]) -> Array:
    """The same [N] for the network's answer, ``u_dps`` [N] of each face, under the distribution of its training data."""
    chi2 = sum(f.chi2_at(u, FIRST_ORDER) for f, u in zip(faces, u_dps, strict=True))
    return np.sqrt(chi2 / sum(f.blocks for f in faces))


class LastTurn(NamedTuple):
    """Mean [N] of measured minus true rate over the last whole turn of the table, and its number of samples."""

    mean_dps: Array
    samples: int


def last_turn(residual_dps: Array, t_us: Index, w_dps: float, after_us: int) -> LastTurn | None:
    """The last whole turn of a run's samples [N, n], or the one before if that is over too late; None if it is too early.

    It is over within ``LATEST_US``, and ``STOPS_US`` before the last sample, and begins at ``after_us`` or later. ``t_us`` [n]
    counts from the first sample. A ripple of the table cancels over a turn.
    """
    if not w_dps:
        return None
    turn_us, latest_us = 360e6 / abs(w_dps), min(int(t_us[-1]), LATEST_US)
    turns = int(latest_us / turn_us)
    turns += int((turns + 1) * turn_us) <= latest_us
    turns -= int(turns * turn_us) + STOPS_US > int(t_us[-1])
    begin_us, end_us = int((turns - 1) * turn_us), int(turns * turn_us)
    first, last = np.searchsorted(t_us, [begin_us, end_us])
    if turns < 1 or end_us + STOPS_US > int(t_us[-1]) or begin_us < after_us or first == last:
        return None
    return LastTurn(np.atleast_2d(residual_dps)[:, first:last].mean(1), int(last - first))


def moved(fit: Combined, turn: LastTurn, w_dps: float, variance: Array, seconds: float, step_dps: float = 0.0) -> Array:
    """Standard errors [N] between what ``fit`` says of a run and the run's last turn.

    A warm-up, or a table that settles slowly, moves the readings by more than first seconds can show, and with them what the
    second run shows. ``variance`` [N] is that of the white noise of a sample, and the fit is from so many ``seconds``.
    """
    variance, standing = _with_steps(variance, step_dps)
    expected = fit.bias_variance + w_dps**2 * fit.scale_variance
    off_dps = turn.mean_dps - (fit.bias_dps + fit.scale * w_dps)
    return np.asarray(np.abs(off_dps) / np.sqrt(expected + variance / turn.samples + standing + drift_sd_dps(seconds) ** 2))


def held(misfit: Array, moved: Array, blocks: int) -> Array:
    """The misfit [N]; beyond its limit by as many standard deviations as the readings moved, if they moved too far."""
    return np.where(moved > POLICY.misfit_errors, np.maximum(misfit, 1 + moved / np.sqrt(2 * blocks)), misfit)


def misfit_limit(blocks: int) -> float:
    """Misfit above which an answer from ``blocks`` block means has the flag ``misfit``; the device has the same limit."""
    return 1 + POLICY.misfit_errors / float(np.sqrt(2 * blocks))
