"""The likelihood of an axis beside a bias that walks on from run to run of a power cycle.

The drift of the noise model begins anew in each run. Where a power cycle is recorded in many runs, the bias of a real sensor
moves on from one to the next, and whatever moves slowly too, such as the temperature, seems to explain it. Here the offsets of
the runs are a random walk over the time since power-on. An offset has the column of the bias in its run, so that the normal
equations of the run hold all its products. The drift within runs is as it was fitted, or forgets what the walk now explains.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.effects.quantities import cycle_time_s
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Equations, Index, Spreads, integrate
from gyrocal.noise.whitening import Noise
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

STEPS = 2.0 ** np.arange(-3.0, 11.5, 0.5)
"""Standard deviations of a walk's usual step that are tried, in standard errors of a run's offset."""
FORGETS = (1.0, 0.25, 0.06)
"""Correlation times of the drift within runs that are tried, of the fitted one; its variance grows as fast."""
UNTOLD = 1e-12
"""Information of a run on its offset, as a part of that of the best run, below which it is rounding."""
FREE = 1e3
"""Of the error of a run's offset, or of the scatter of the readings: a spread that says nothing of the offsets."""


@dataclass(frozen=True)
class Walks:
    """Power cycles whose bias may walk: the runs of each, and the times between them over the usual one.

    ``bias`` is the column of the bias in the normal equations.
    """

    runs: tuple[Index, ...]
    times: tuple[Array, ...]
    bias: int

    @staticmethod
    def of(design: Design) -> Walks | None:
        """None if no power cycle has as many runs as show a walk, or if the model has no bias."""
        terms = design.terms
        bias = [1 + j for j, (t, _) in enumerate(design.layout.fixed) if terms[t].effect.role is Role.BIAS]
        used = design.n_blocks > 0
        runs = [np.flatnonzero((design.scenarios == cycle) & used) for cycle in np.unique(design.scenarios)]
        if not bias or max(map(len, runs)) < POLICY.walking_runs:
            return None
        at_s = [np.array([float(np.mean(cycle_time_s(design.blocks[i].run))) for i in mine]) for mine in runs]
        runs = [mine[np.argsort(t)] for mine, t in zip(runs, at_s, strict=True)]
        between_s = [np.diff(np.sort(t)) for t in at_s]
        usual_s = float(np.median(np.concatenate(between_s)))
        times = (t / usual_s if usual_s > 0 else np.ones(t.size) for t in between_s)
        return Walks(tuple(runs), tuple(times), bias[0])

    @property
    def count(self) -> int:
        """Number of runs."""
        return sum(map(len, self.runs))

    def likeliest(self, fit: AxisFit, noises: Iterable[Noise]) -> tuple[float, float]:
        """Profile log-likelihoods beside a walk of the likeliest size, and with free offsets of all runs; each at the likeliest
        of ``noises``."""
        tried = [_Offsets.of(self, fit, noise) for noise in _forgetting(noises)]
        return max(at.walking()[0] for at in tried), max(at.free() for at in tried)

    def walk(self, fit: AxisFit) -> Walk | None:
        """The likeliest walk of a fit; None if the readings are as likely without one, or with offsets in no order.

        Offsets in no order may be an effect that the model lacks and that differs from run to run.
        """
        tried = [_Offsets.of(self, fit, noise) for noise in _forgetting([fit.noise])]
        found = [(*at.walking(), at) for at in tried]
        loglik, step_dps, at = max(found, key=lambda one: one[0])
        without = max(fit.solution.profile_loglik, *(at.in_no_order() for at in tried))
        if loglik < without + POLICY.noise_shape_gain:
            return None
        covariance = np.zeros((len(fit.design.blocks),) * 2)
        for runs, times in zip(self.runs, self.times, strict=True):
            root = step_dps * _steps(times)
            covariance[np.ix_(runs, runs)] = root @ root.T
        return Walk(at.noise, covariance)


@dataclass(frozen=True)
class Walk:
    """The ``noise`` within runs, and the covariance [runs, runs] of the runs' offsets, dps^2."""

    noise: Noise
    covariance: Array


@dataclass(frozen=True)
class _Offsets:
    """Normal equations ``grams`` [runs, 1 + p, 1 + p] and log-determinants of the runs of a fit at a noise.

    The offsets of the runs are not yet integrated out.
    """

    walks: Walks
    fit: AxisFit
    noise: Noise
    grams: Array
    logdet: Array

    @staticmethod
    def of(walks: Walks, fit: AxisFit, noise: Noise) -> _Offsets:
        layout = fit.design.layout
        grams, logdet = (fit.grams, fit.logdet) if noise == fit.noise else fit.design.grams(noise)
        if layout.run:
            own = 1 + len(layout.fixed) + np.arange(len(layout.run))
            integrated = integrate(grams, own, np.arange(own[0]), fit.spreads.run[list(layout.run_group)])
            grams, logdet = integrated.grams, logdet + integrated.logdet
        return _Offsets(walks, fit, noise, grams, logdet)

    @cached_property
    def _se_dps(self) -> Array:
        """The error [runs] with which each run by itself determines its offset."""
        bias = self.walks.bias
        return np.asarray(np.maximum(self.grams[:, bias, bias], 1e-300) ** -0.5)

    def walking(self) -> tuple[float, float]:
        """Profile log-likelihood beside the likeliest walk, and the standard deviation of its usual step, deg/s."""
        return self._likeliest([_steps(times) for times in self.walks.times])

    def in_no_order(self) -> float:
        """Profile log-likelihood beside independent offsets of the likeliest spread."""
        return self._likeliest([np.eye(runs.size) for runs in self.walks.runs])[0]

    def free(self) -> float:
        """Profile log-likelihood with free offsets of all runs. It does not depend on how wide their spread is."""
        wide_dps = FREE * np.maximum(self._se_dps, float(self.fit.design.column_rms[0]))
        of_runs = [wide_dps[runs] for runs in self.walks.runs]
        beside = self._beside(self._modes([np.diag(wide) for wide in of_runs]), np.ones(1))
        return float(beside[0] + np.log(np.concatenate(of_runs)).sum())

    def _likeliest(self, roots: Sequence[Array]) -> tuple[float, float]:
        """Profile log-likelihood at the likeliest multiple of the roots, and that multiple.

        A run whose own coefficient takes up its offset, as a turn by an angle of unknown error, says nothing of it.
        """
        runs = np.concatenate(self.walks.runs)
        told = self.grams[runs, self.walks.bias, self.walks.bias]
        if not told.any():
            return self.fit.solution.profile_loglik, 0.0
        sizes = float(np.median(self._se_dps[runs[told > UNTOLD * told.max()]])) * STEPS
        logliks = self._beside(self._modes(roots), sizes)
        best = int(np.argmax(logliks))
        return float(logliks[best]), float(sizes[best])

    def _modes(self, roots: Sequence[Array]) -> list[tuple[Array, Array]]:
        """The modes of offsets whose covariance has these roots [r, k], one for each power cycle.

        They are independent, and each has an information in the data [k] and products with the columns [k, q].
        """
        out, bias = [], self.walks.bias
        for runs, root in zip(self.walks.runs, roots, strict=True):
            known, vectors = np.linalg.eigh(root.T @ (self.grams[runs, bias, bias][:, None] * root))
            out.append((np.maximum(known, 0.0), vectors.T @ (root.T @ self.grams[runs, bias])))
        return out

    def _beside(self, modes: Sequence[tuple[Array, Array]], sizes: Array) -> Array:
        """Profile log-likelihoods [s] with the offsets of these modes, times each of ``sizes`` [s], integrated out."""
        design, grams, logdet, squares = self.fit.design, [], [], sizes[:, None] ** 2
        for runs, (known, products) in zip(self.walks.runs, modes, strict=True):
            weights = squares / (1 + squares * known)
            grams.append(self.grams[runs].sum(axis=0) - (products.T * weights[:, None, :]) @ products)
            logdet.append(self.logdet[runs].sum() + np.log1p(squares * known).sum(axis=1))
        n = int(design.n_blocks.sum())
        equations = Equations(design.layout.shared, np.stack(grams, axis=1), np.stack(logdet, axis=1), np.arange(len(grams)), n)
        return equations.profile_logliks(Spreads(np.zeros(0), self.fit.spreads.scenario))


def _steps(times: Array) -> Array:
    """A root [r, r - 1] of the covariance of a walk over times between runs [r - 1] whose usual step is 1."""
    return np.tril(np.ones((len(times) + 1,) * 2), -1)[:, :-1] * np.sqrt(times)


def _forgetting(noises: Iterable[Noise]) -> list[Noise]:
    """The noises, and those whose drift forgets sooner and varies as much less."""
    parts = [(noise, part) for noise in noises for part in (FORGETS if noise.ou_sd_dps > 0 else (1.0,))]
    tried = (replace(one, ou_sd_dps=one.ou_sd_dps * part**0.5, ou_tau_s=one.ou_tau_s * part) for one, part in parts)
    return list(dict.fromkeys(tried))
