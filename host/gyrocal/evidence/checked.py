"""What the two checks of an effect found, and whether it passes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gyrocal.policy import POLICY

PAIRS = {
    "time": "the first and the last half of the runs", "speed": "slow and fast", "direction": "both directions",
    "temperature": "cold and warm", "cycle_time": "early and late in the power cycles",
    "power_cycle": "the first and the last power cycles",
}  # fmt: skip
"""The pairs of parts in which an effect is held against itself, in words that follow *between*."""


@dataclass(frozen=True)
class Checks:
    """The effect's ``share`` of the power of effect and rest, and the probability that its coefficients in the parts of the
    data differ as much by chance; None if no part shows it. ``difference`` is the rms of the largest difference that chance
    does not explain, in parts of the effect's rms; zero if it explains all, None if it is not known. ``parts`` are the pairs of
    parts that were compared (see :data:`PAIRS`), the one with that difference first.
    """

    share: float
    same_in_parts_p: float | None
    difference: float | None = None
    parts: Sequence[str] = ()

    def passed(self, log_odds: float) -> bool:
        """True if the effect explains enough of what it and the rest explain, and is the same in the parts of the data.

        ``log_odds`` are those of the effect.
        """
        return self.share >= POLICY.least_share and self.same(log_odds)

    def same(self, log_odds: float) -> bool:
        """True if the coefficient is the same in the parts of the data, or no part shows it."""
        if self.same_in_parts_p is None or self.same_in_parts_p >= POLICY.different_chance:
            return True
        small = self.difference is not None and self.difference <= POLICY.largest_difference
        enough = POLICY.main_log_odds if self.share >= POLICY.main_share else POLICY.exact_log_odds
        return log_odds >= enough and small
