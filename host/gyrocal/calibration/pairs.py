"""Pairs of runs at opposite true rates, which baseline and network calibrate from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.calibration.network_answer import suits_network
from gyrocal.recording.session import AXES, Run, Session

STEADY = 0.03
"""Largest relative variation of a rate that counts as constant. The device has the same limit."""


def pairs(runs: Sequence[Run]) -> list[tuple[Run, Run]]:
    """For each axis the first two runs that turn steadily in opposite true directions: (positive, negative true rate)."""
    out = []
    for axis in AXES:
        steady = [r for r in runs if r.axis == axis and is_steady(r)]
        positive = [r for r in steady if r.rate_dps[0] > 0]
        negative = [r for r in steady if r.rate_dps[0] < 0]
        # opposite rates of one size first, else any two
        match = sorted(
            ((p, n) for p in positive for n in negative),
            key=lambda pair: abs(abs(pair[0].rate_dps[0]) - abs(pair[1].rate_dps[0])) > STEADY * abs(pair[0].rate_dps[0]),
        )
        if match:
            out.append(match[0])
    return out


def is_steady(run: Run) -> bool:
    """True if the run turns at one known rate all the time."""
    rate_dps = run.rate_dps
    return not run.rate_is_mean and rate_dps[0] != 0 and bool(np.ptp(rate_dps) <= STEADY * abs(rate_dps[0]))


def network_suits(session: Session) -> bool:
    """True if the session has a pair of runs that the shipped network was trained for."""
    return any(all(map(suits_network, pair)) for _, runs in session.by_scenario() for pair in pairs(runs))
