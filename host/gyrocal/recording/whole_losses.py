"""Losses of a loop whose phase slips: long steps that are whole numbers of the usual one."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Index = np.ndarray[Any, np.dtype[np.intp]]

SCATTERED = 0.1
"""A step off the median by more than this part of it is none of an even sampler."""
MOSTLY = 0.5
"""Part of the steps that are of one length, and of the long ones that are whole numbers of it, at least."""
LONG = 1.5
"""A step longer than this, in intervals, may hold a lost sample."""
CHANCE_ERRORS = 4.0
"""Standard errors of a number by chance, beyond which it is none."""


def with_whole_losses(t_s: Array) -> tuple[Index, float] | None:
    """The number of each sample [n] of stamps that keep to no course, and the interval, s, where the long steps are losses.

    More than half of the steps are of one length, and more of the longer ones are whole numbers of it than by chance: a loop
    whose phase slips now and then, of which samples are missing. None for any other stamps: a delay has any length.
    """
    steps = np.diff(t_s)
    ratio = steps / float(np.median(steps))
    usual = np.abs(ratio - 1) < SCATTERED
    if np.mean(usual) < MOSTLY:
        return None
    ratio = steps / float(np.mean(steps[usual]))
    whole = np.maximum(np.rint(ratio), 1)
    several = ratio > LONG
    of_whole, count = int(np.sum(np.abs(ratio - whole)[several] < SCATTERED)), int(several.sum())
    by_chance = 2 * SCATTERED * count
    if of_whole < MOSTLY * count or of_whole - by_chance <= CHANCE_ERRORS * (by_chance * (1 - 2 * SCATTERED)) ** 0.5:
        return None
    number = np.concatenate([[0], np.cumsum(whole)]).astype(np.intp)
    return number, float(t_s[-1] - t_s[0]) / int(number[-1])
