"""The stated probability: what share of names with the same evidence is right beside disturbances outside all shapes.

The evidence would be a probability if the rest of the world were one of its shapes. It is not, so that the evidence is too
sure. The calibration part of ``gyrocal benchmark edge`` tells by how much: :data:`KNOTS` are its log odds and the shares of
true names among them, for effects that pass both checks or were not checked. Of those that fail a check, whatever their
evidence, the share :data:`FAILED` was true. Of the sure names, at least the share :data:`NAMED` is. All come from
``python benchmarks/edge_curve.py CALIBRATION.jsonl``, which pools neighbours until the shares rise; the last knot and
:data:`NAMED` are lower 95 % bounds, and nothing above them is stated.
"""

from __future__ import annotations

import numpy as np

from gyrocal.evidence.checked import Checks

KNOTS = (
    (-9.5352, 0.006), (-3.1879, 0.008), (-1.7478, 0.047), (-0.4659, 0.235), (1.0136, 0.588), (5.6433, 0.911), (18.4564, 0.911),
)  # fmt: skip
FAILED = 0.444
NAMED = 0.922
SURE_LOG_ODDS = 3.0
"""Log odds (a probability of 0.95, as the evidence has it) from which on an effect may be named: by the evidence alone where
other tests cannot tell it from its rivals, and by those tests. With less, three of eight of the latter names were wrong."""

SUPPORTING_LOG_ODDS, SUPPORTED_GAIN_ERRORS = 1.5, 4.0
"""Log odds, and standard errors of the held-out gain, from which on both together suffice: of six such names five were true, of
those with less of either seven of twelve (the calibration and the work part, and eighty blind sessions)."""


def supported(log_odds: float, checks: Checks | None, gain: float | None, gain_se: float | None) -> bool:
    """True if the evidence is sure of a name of the other tests, or does not contradict a large gain on held-out data."""
    large = gain is not None and gain_se is not None and gain > SUPPORTED_GAIN_ERRORS * gain_se
    return sure(log_odds, checks) or (large and log_odds >= SUPPORTING_LOG_ODDS and (checks is None or checks.passed(log_odds)))


def sure(log_odds: float, checks: Checks | None) -> bool:
    """True if the evidence is sure of an effect, which passes its checks if it has any."""
    return log_odds >= SURE_LOG_ODDS and (checks is None or checks.passed(log_odds))


def stated(log_odds: float, checks: Checks | None = None, named: bool = False) -> float:
    """The probability to be told of an effect of these log odds; ``checks`` is None for one that does not lead.

    ``named`` is True for a sure name.
    """
    known, shares = np.transpose(KNOTS)
    found = float(np.interp(log_odds, known, shares))
    if checks is not None and not checks.passed(log_odds):
        return min(found, FAILED)
    return max(found, NAMED) if named else found
