"""How the table, or the hand, moves in one run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .case import Array
from .protocol import Plan

Rate = Callable[[Array], Array]

STEP_S = 1.0
"""A table takes so long from one level of a staircase to the next."""


@dataclass(frozen=True)
class Motion:
    """How the table moves in one run, arrays [n] on the fine time base."""

    rate_dps: Array  # about the sensor's sensed axis
    reference_dps: Array  # the rate that the session states
    angle_deg: Array


def motion(
    protocol: str, plan: Plan, t_s: Array, seconds: float, clock_error: float, random: np.random.Generator
) -> Motion:
    """The motion of a run at the true times `t_s`; the reference reads its programme at the device's wrong time."""
    side = 1.0 if plan.face == "up" else -1.0
    start_deg = random.uniform(0.0, 360.0)
    if not plan.moves:
        rate_dps = np.full_like(t_s, side * plan.table_rate_dps)
        return Motion(rate_dps, rate_dps, start_deg + plan.table_rate_dps * t_s)
    if plan.swing_hz:
        omega, phase = 2 * np.pi * plan.swing_hz, 2 * np.pi * random.random()
        rate_dps = side * plan.table_rate_dps * np.sin(omega * t_s + phase)
        reference = side * plan.table_rate_dps * np.sin(omega * t_s / (1 + clock_error) + phase)
        swept_deg = plan.table_rate_dps / omega * (np.cos(phase) - np.cos(omega * t_s + phase))
        return Motion(rate_dps, reference, start_deg + swept_deg)
    if protocol == "hand":
        rate = by_hand(plan.table_rate_dps, seconds, random)
    else:
        rate = staircase(plan.table_rate_dps, seconds, 9 if protocol == "staircase" else 3)
    table_dps = rate(t_s)
    step_s = float(t_s[1] - t_s[0])
    swept_deg = np.concatenate([[0.0], np.cumsum((table_dps[1:] + table_dps[:-1]) / 2 * step_s)])
    return Motion(side * table_dps, side * rate(t_s / (1 + clock_error)), start_deg + swept_deg)


def staircase(highest_dps: float, seconds: float, levels: int) -> Rate:
    """From rest up to the highest rate, down through rest to its negative and back, in equal times and smooth steps."""
    up = np.linspace(0.0, highest_dps, (levels + 1) // 2)
    rates = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    if levels == 3:  # a few times round while the temperature ramps
        rates = np.tile(np.array([0.0, highest_dps, 0.0, -highest_dps]), 3)
    edges_s = np.linspace(0.0, seconds, len(rates) + 1)[1:-1]

    def rate(t_s: Array) -> Array:
        level = np.full_like(t_s, rates[0])
        for at_s, before, after in zip(edges_s, rates[:-1], rates[1:], strict=True):
            part = np.clip((t_s - at_s) / STEP_S + 0.5, 0.0, 1.0)
            level += (after - before) * part**2 * (3 - 2 * part)
        return level

    return rate


def by_hand(highest_dps: float, seconds: float, random: np.random.Generator) -> Rate:
    """Turns to and fro of different lengths and speeds, with a rest after each."""
    moves, at_s, sign = [], random.uniform(0.5, 1.5), 1.0
    while at_s < seconds:
        length_s = random.uniform(1.2, 3.5)
        moves.append((at_s, length_s, sign * highest_dps * random.uniform(0.2, 1.0)))
        at_s += length_s + random.uniform(0.3, 1.2)
        sign = -sign if random.random() < 0.8 else sign

    def rate(t_s: Array) -> Array:
        total = np.zeros_like(t_s)
        for start_s, length_s, peak_dps in moves:
            part = np.clip((t_s - start_s) / length_s, 0.0, 1.0)
            total += peak_dps * np.sin(np.pi * part) ** 2
        return total

    return rate
