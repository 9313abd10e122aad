"""What the two checks of an effect found, and whether it passes them."""

from __future__ import annotations

from dataclasses import dataclass

LEAST_SHARE = 0.5
LEAST_SAME = 1e-3


@dataclass(frozen=True)
class Checks:
    """The effect's ``share`` of the power of effect and rest, and the probability that its coefficients in the parts of the
    data differ as much by chance; None if no part shows it.
    """

    share: float
    same_in_parts_p: float | None

    @property
    def passed(self) -> bool:
        """True if the effect explains most of what it and the rest explain, and is the same in the parts of the data."""
        return self.share >= LEAST_SHARE and (self.same_in_parts_p is None or self.same_in_parts_p >= LEAST_SAME)
