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


def sure(log_odds: float, checks: Checks | None) -> bool:
    """True if the evidence is sure of an effect, which passes its checks if it has any."""
    return log_odds >= SURE_LOG_ODDS and (checks is None or checks.passed)


def stated(log_odds: float, checks: Checks | None = None, named: bool = False) -> float:
    """The probability to be told of an effect of these log odds; ``checks`` is None for one that does not lead.

    ``named`` is True if the tests of the diagnosis are sure of it.
    """
    known, shares = np.transpose(KNOTS)
    found = float(np.interp(log_odds, known, shares))
    if checks is not None and not checks.passed:
        return min(found, FAILED)
    return max(found, NAMED) if named and sure(log_odds, checks) else found
