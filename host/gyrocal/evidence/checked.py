"""What the two checks of an effect found, and whether it passes them."""

from __future__ import annotations

from dataclasses import dataclass

LEAST_SHARE = 0.25
"""Least part of the power of effect and rest. In the calibration and the work part, five of seven names with less than half of
it were true, and of those with less than a quarter three of four."""
LEAST_SAME = 1e-3
LARGEST_DIFFERENCE = 0.18
"""Part of an effect's rms by which its sizes in two parts may change it. No model is exact, so that with enough data the sizes
of a true effect differ significantly too: true ones on recordings with an encoder by up to 0.16. Of the calibration and the
work part, no wrong name with log odds beyond 2.2 is below 0.21."""
ENOUGH_DATA = 20.0
"""Log odds from which on such a difference says that no model is exact. On those recordings they are 22 and 1389. Of three
names of the frozen part with less (3, 9 and 14), and differences of 0.08 to 0.13, two were wrong."""


@dataclass(frozen=True)
class Checks:
    """The effect's ``share`` of the power of effect and rest, and the probability that its coefficients in the parts of the
    data differ as much by chance; None if no part shows it. ``difference`` is the rms of the largest difference that chance
    does not explain, in parts of the effect's rms; zero if it explains all, None if it is not known.
    """

    share: float
    same_in_parts_p: float | None
    difference: float | None = None

    def passed(self, log_odds: float) -> bool:
        """True if the effect explains enough of what it and the rest explain, and is the same in the parts of the data.

        ``log_odds`` are those of the effect.
        """
        return self.share >= LEAST_SHARE and self.same(log_odds)

    def same(self, log_odds: float) -> bool:
        """True if the coefficient is the same in the parts of the data, or no part shows it."""
        if self.same_in_parts_p is None or self.same_in_parts_p >= LEAST_SAME:
            return True
        return log_odds >= ENOUGH_DATA and self.difference is not None and self.difference <= LARGEST_DIFFERENCE
