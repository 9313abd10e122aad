"""The drift that the boards of a fleet share.

A short session hardly determines its own drift, and standard errors with a poorly known drift are a few percent too small. A
thousand boards then show an effect that does not exist. Boards of one kind share the drift, so its likelihood is summed over
boards: over some of them on a wide grid, and with that drift over all of them at three sizes near it, between which both the
likelihood and the normal equations are interpolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import LARGEST_SPREAD, Spreads, solve
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array

SIZES = (0.0, *np.geomspace(0.01, 0.64, 13).tolist())
"""Standard deviation of the drift over that of the white noise of a sample."""
TIMES_S = (10.0, 30.0, 100.0)
PILOT = 40
"""Sessions, evenly spaced in the sorted list, from which the drift is first taken."""
STEP = 1.2
"""Ratio of neighbouring sizes at which all boards are asked: three standard errors of the size from the pilot."""
FURTHEST = 1.5
"""Steps up to which the likelihood and the equations are extrapolated."""


@dataclass(frozen=True)
class FleetDrift:
    """A drift: its standard deviation over that of the white noise of a sample, and its correlation time in s."""

    size: float
    tau_s: float

    def noise(self, own: Noise) -> Noise:
        """A board's noise with the fleet's drift."""
        return replace(own, ou_sd_dps=self.size * own.white_sd_dps, ou_tau_s=self.tau_s)


    @property
    def near(self) -> tuple[FleetDrift, ...]:
        """A smaller drift, this one, and a larger one."""
        return replace(self, size=self.size / STEP), self, replace(self, size=self.size * STEP)

    def refined(self, loglik: Array) -> tuple[FleetDrift, Array]:
        """The likeliest drift from the log-likelihoods [3] of :attr:`near`, and weights [3] that interpolate there."""
        below, here, above = loglik.tolist()
        curvature = below - 2 * here + above
        if self.size == 0 or curvature >= 0:
            return self, np.array([0.0, 1.0, 0.0])
        x = float(np.clip((below - above) / (2 * curvature), -FURTHEST, FURTHEST))
        weights = np.array([x * (x - 1) / 2, 1 - x**2, x * (x + 1) / 2])
        return replace(self, size=self.size * STEP**x), weights


def pilot(paths: Sequence[str]) -> list[str]:
    """The sessions from which the drift is taken."""
    return [paths[i] for i in sorted({int(i) for i in np.linspace(0, len(paths) - 1, min(PILOT, len(paths)))})]


def loglik_of(fitted: AxisFit) -> list[list[float]]:
    """Log-likelihood of a session's axis for each of ``TIMES_S`` and ``SIZES`` (:func:`loglik_at`)."""
    return [loglik_at(fitted, [FleetDrift(size, tau_s) for size in SIZES]) for tau_s in TIMES_S]


def loglik_at(fitted: AxisFit, drifts: Sequence[FleetDrift]) -> list[float]:
    """REML log-likelihood of a session's axis for each drift, at its white level.

    Bias and scale of its power cycles are practically free. With their fitted spreads, which are poorly known from a few
    cycles, the estimated drift would be too small.
    """
    design, n = fitted.design, int(fitted.design.n_blocks.sum())
    roles = [design.terms[design.layout.fixed[j][0]].effect.role for j in design.layout.scenario]
    spreads = Spreads(fitted.spreads.run, np.array([LARGEST_SPREAD[role] for role in roles]))

    def at(drift: FleetDrift) -> float:
        grams, logdet = design.grams(drift.noise(fitted.noise))
        return solve(design.layout, grams, logdet, design.scenarios, n, spreads).loglik

    return [at(drift) for drift in drifts]


def fleet_drifts(said: Iterable[Mapping[str, Sequence[Sequence[float]]]]) -> dict[str, FleetDrift]:
    """The likeliest drift of each axis; the size is interpolated between ``SIZES``."""
    total: dict[str, Array] = {}
    for one in said:
        for axis, loglik in one.items():
            total[axis] = total.get(axis, 0.0) + np.array(loglik, dtype=np.float64)
    return {axis: _likeliest(loglik) for axis, loglik in sorted(total.items())}


def _likeliest(loglik: Array) -> FleetDrift:
    from scipy.interpolate import CubicSpline

    t, k = (int(i) for i in np.unravel_index(int(np.nanargmax(loglik)), loglik.shape))
    if k < 2:  # the size below the smallest one is zero, which has no logarithm to interpolate
        return FleetDrift(SIZES[k], TIMES_S[t])
    course = CubicSpline(np.log(SIZES[1:]), loglik[t, 1:])
    between = np.linspace(np.log(SIZES[k - 1]), np.log(SIZES[min(k + 1, len(SIZES) - 1)]), 401)
    return FleetDrift(float(np.exp(between[int(np.argmax(course(between)))])), TIMES_S[t])
