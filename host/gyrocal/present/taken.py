"""What an answer was calculated from, in words."""

from __future__ import annotations

from collections.abc import Iterable

from gyrocal.calibration.taken import Taken
from gyrocal.digits import plain


def words(taken: Taken) -> str:
    """As in "the first 6 s of 2 recordings" or "all 42 recordings, 40 s each"."""
    first = f"the first {taken.seconds:g} s of"
    if taken.first and taken.whole:
        whole = "one" if taken.whole == 1 else str(taken.whole)
        return f"{first} {_count(taken.first)} and the whole of {whole}, {_lengths(taken)}"
    count = taken.first + taken.whole
    recordings = f"all {_count(count)}" if taken.everything and count > 2 else _count(count)
    return f"{first} {recordings}" if taken.first else f"{recordings}, {_lengths(taken)}"


def cell(taken: Taken) -> str:
    """As in "2, first 6 s" or "42, 40 s each", for a column named recordings."""
    first = [f"{taken.first}, first {taken.seconds:g} s"] if taken.first else []
    return "; ".join([*first, f"{taken.whole}, {_lengths(taken)}"] if taken.whole else first)


def each(taken: Iterable[Taken]) -> str:
    """What each of several answers was calculated from, as :func:`words`, or without a number where that differs."""
    found = set(taken)
    if len(found) == 1:
        return words(found.pop())
    seconds = {of.seconds for of in found if of.first}
    return f"the first {seconds.pop():g} s of the recordings" if len(seconds) == 1 else "the recordings"


def part(taken: Taken) -> str:
    """How much of each recording, in two words or three."""
    return f"first {taken.seconds:g} s" if taken.first else "whole recordings"


def _count(recordings: int) -> str:
    return "one recording" if recordings == 1 else f"{recordings} recordings"


def _lengths(taken: Taken) -> str:
    low, high = plain(taken.shortest_s), plain(taken.longest_s)
    return f"{low} to {high} s" if low != high else f"{low} s" if taken.whole == 1 else f"{low} s each"
