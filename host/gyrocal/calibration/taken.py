"""What an answer was calculated from: how many recordings, and how much of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gyrocal.recording.session import Run


@dataclass(frozen=True)
class Taken:
    """The recordings of an answer: ``first`` beginnings of ``seconds`` s, and ``whole`` recordings.

    ``shortest_s`` and ``longest_s`` are the lengths of the whole ones. ``everything`` is true if no recording is left out.
    """

    first: int = 0
    seconds: float = 0.0
    whole: int = 0
    shortest_s: float = 0.0
    longest_s: float = 0.0
    everything: bool = False

    @staticmethod
    def of(used: Sequence[Run], recordings: int, seconds: float | None) -> Taken:
        """What ``used`` takes of so many ``recordings`` of a session by their first ``seconds``, or whole if that is None."""
        whole = [run for run in used if seconds is None or run.rate_is_mean]  # a turn by hand is known as a whole only
        lengths = [run.duration_s for run in whole] or [0.0]
        ends = min(lengths), max(lengths)
        return Taken(len(used) - len(whole), seconds or 0.0, len(whole), *ends, len(used) == recordings)
