"""The stated probability: what share of names with the same evidence is right beside disturbances outside all shapes.

The evidence would be a probability if the rest of the world were one of its shapes. It is not, so that the evidence is too
sure. Sessions of the frozen part of ``gyrocal benchmark edge``, to which no limit had been fitted, tell by how much:
:data:`KNOTS` are their log odds and the shares of true names among them, for effects that pass both checks or were not checked.
Of those that fail a check, whatever their evidence, the share :data:`FAILED` was true. Of the sure names, at least the share
:data:`NAMED` is. Of the others of which the evidence is sure, but not held-out data, the share :data:`UNNAMED` was true. All
come from ``python benchmarks/edge_curve.py FROZEN.jsonl...``, which pools neighbours until the shares rise; the last knot and
:data:`NAMED` are lower 95 % bounds, and nothing above them is stated.

Noise alone is more probable than its log odds say: half of all axes were expected to hold an effect, and most hold none. On the
sessions of the calibration part, :data:`NOISE` is the likeliest addition to its log odds, and :data:`SUREST_NOISE` the lower
95 % bound of the share of true ones among the likely ones.
"""

from __future__ import annotations

import numpy as np

from gyrocal.evidence.checked import Checks
from gyrocal.policy import POLICY

KNOTS = (
    (-4.4032, 0.006), (-3.2215, 0.009), (-1.7486, 0.052), (-0.4641, 0.211), (0.5771, 0.381), (1.7931, 0.647), (3.456, 0.86),
    (7.0503, 0.895), (17.6452, 0.895),
)  # fmt: skip
FAILED = 0.293
NAMED = 0.952
UNNAMED = 0.481
NOISE = 1.24
SUREST_NOISE = 0.876


def supported(log_odds: float, checks: Checks | None, gain: float | None, gain_se: float | None) -> bool:
    """True if the evidence is sure of a name of the other tests, or does not contradict a large gain on held-out data."""
    large = gain is not None and gain_se is not None and gain > POLICY.supported_gain_errors * gain_se
    enough = POLICY.supporting_log_odds if large else POLICY.sure_log_odds
    return log_odds >= enough and (checks is None or checks.passed(log_odds))


def sure(log_odds: float, checks: Checks | None) -> bool:
    """True if the evidence is sure of an effect, which passes its checks if it has any."""
    return log_odds >= POLICY.sure_log_odds and (checks is None or checks.passed(log_odds))


def beyond(log_odds: float) -> bool:
    """True for log odds that are larger than all of which the curve knows."""
    return log_odds > KNOTS[-1][0]


def of_set(log_odds: float) -> float:
    """The probability to be told of a set of effects of these log odds."""
    known, shares = np.transpose(KNOTS)
    return float(np.interp(log_odds, known, shares))


def of_noise(log_odds: float) -> float:
    """The probability to be told of noise alone, which has these log odds."""
    from scipy.special import expit

    return min(float(expit(log_odds + NOISE)), SUREST_NOISE)


def stated(log_odds: float, checks: Checks | None = None, named: bool = False) -> float:
    """The probability to be told of an effect of these log odds; ``checks`` is None for one that does not lead.

    ``named`` is True for a sure name.
    """
    found = of_set(log_odds)
    if checks is not None and not checks.passed(log_odds):
        return min(found, FAILED)
    if named:
        return max(found, NAMED)
    return min(found, UNNAMED) if log_odds >= POLICY.sure_log_odds else found
