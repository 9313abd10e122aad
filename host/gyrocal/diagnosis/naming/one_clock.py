"""Whether all axes of a recording agree on an effect that the whole recording shares, such as the error of its clock.

One clock stamps the readings of all axes. Where the reference measures several axes, each axis that moves has its own estimate
of the clock's error. What resembles it on one axis alone, such as friction of the mount, is contradicted by the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.effects.timing import TimingEffect
from gyrocal.policy import POLICY

Name = tuple[str, str]
"""Effect and axis."""


def refuted(candidates: Sequence[Candidate]) -> set[Name]:
    """The candidates with decision ``add`` or ``suggest`` whose value another axis excludes, as (effect, axis).

    Another axis excludes a value if its own estimate differs by more than ``Policy.clock_errors`` standard errors and is
    farther from it than half of it. Axes that do not move have no estimate.
    """
    shared = [c for c in candidates if isinstance(c.effect, TimingEffect) and c.effect.of_recording and c.values]
    stated = [c for c in shared if c.decision in ("add", "suggest")]
    return {(c.effect.id, c.axis) for c in stated if any(_excludes(other, c) for other in shared)}


def _excludes(other: Candidate, c: Candidate) -> bool:
    if other.effect.id != c.effect.id or other.axis == c.axis:
        return False
    name = c.effect.linear[0]
    value, said = c.values[name], other.values[name]
    error = float(np.hypot(c.se.get(name, np.inf), other.se.get(name, np.inf)))
    far = abs(said - value) > 0.5 * abs(value)
    return far and abs(said - value) > POLICY.clock_errors * error
