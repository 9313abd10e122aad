"""Answers that only a few effects have. Such an effect derives from the class of the answer too, and who asks looks for it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from gyrocal.effects.base import Effect, Values
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Run


class OwnLine(ABC):
    """The term may have a line in the spectrum that is no effect of its own."""

    @abstractmethod
    def line_dps(self, runs: Sequence[Run], axis: int, values: Values, low_hz: float, high_hz: float) -> float:
        """Amplitude of the term's own line between these frequencies, deg/s; 0 if it has none.

        It is that of the mean square over the runs. A filter may have weakened and delayed the line in the readings.
        """


class CourseWithoutData(ABC):
    """The course is known in part in runs that cannot show its size."""

    @abstractmethod
    def unmeasured(self, run: Run, axis: int) -> Array | None:
        """The course of the effect as far as it is known in a run without the effect's data, shape [n]; None if unknown."""


class InWords(ABC):
    """The names of the parameters do not say what they mean."""

    @abstractmethod
    def told(self, values: Mapping[str, float], shown: Mapping[str, str]) -> str:
        """The size in words; empty if the values hold none. ``shown`` are the ``values`` as text, with errors and units."""


def is_left_of_a_line(
    known: Sequence[tuple[Effect, Values]], runs: Sequence[Run], axis: int, frequency_hz: float, amplitude_dps: float
) -> bool:
    """True if a line is no larger than what the gyroscope's low-pass and delay leave of a line of a ``known`` term."""
    return any(
        amplitude_dps < POLICY.left_of_line * effect.line_dps(runs, axis, values, frequency_hz, frequency_hz)
        for effect, values in known if isinstance(effect, OwnLine)
    )  # fmt: skip
