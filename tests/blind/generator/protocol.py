"""Which runs the operator records, and when; in which of them the bias jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .case import Case, random_of

RUNS_A_DAY = {"staircase": 1, "hand": 2, "chamber": 1}
MOVING = tuple(RUNS_A_DAY)


@dataclass
class Plan:
    """One run as the operator does it; times of day in seconds."""

    scenario: int
    face: str
    day: int
    table_rate_dps: float
    power_on_time_s: float
    start_time_s: float
    swing_hz: float = 0.0
    moves: bool = False  # the rate changes through the run, and the session has a reference of it


def plans_of(case: Case) -> list[Plan]:
    random = random_of(case, "protocol")
    days = np.array_split(np.arange(case.scenarios), 3)
    plans: list[Plan] = []
    scenario = 0
    for day in (1, 2, 3):
        clock_s = 60.0
        if case.protocol == "paper":
            cycles = [[("up", 78.0, 0.0), ("down", 78.0, 0.0)] for _ in days[day - 1]]
        elif case.protocol == "full":
            signed = [0.0, *(sign * rate for rate in case.rates_dps for sign in (1, -1))]
            spread = case.rate_spread
            cycles = [
                [(face, round(rate * (1 + random.uniform(-spread, spread)), 4), 0.0)]
                for face in ("up", "down")
                for rate in signed
            ]
        elif case.protocol == "swing":
            cycles = [[(face, 10.0, random.uniform(0.05, 0.12))] for face in ("up", "down") for _ in range(3)]
        elif case.protocol == "long":
            cycles = [[("up", case.rates_dps[-1], 0.0)]] if day == 1 else []
        elif case.protocol in MOVING:
            cycles = [[(face, case.rates_dps[-1], 0.0)] for face in ("up", "down")[: RUNS_A_DAY[case.protocol]]]
        else:
            raise ValueError(f"{case.name}: unknown protocol {case.protocol!r}")
        for cycle in cycles:
            power_on_time_s = clock_s
            clock_s += random.uniform(2.0, 4.0)
            for face, rate, swing_hz in cycle:
                moves = bool(swing_hz) or case.protocol in MOVING
                plans.append(Plan(scenario, face, day, rate, power_on_time_s, clock_s, swing_hz, moves))
                clock_s += case.seconds + random.uniform(15.0, 30.0)
            clock_s += random.uniform(10.0, 25.0)
            scenario += 1
    return plans


def jumps_of(case: Case, plans: list[Plan]) -> list[tuple[int, float, float]]:
    """(run, time in run, step) of every planted step; no two in one run, none within a fifth of its ends."""
    planted = [effect for effect in case.effects if effect.id == "bias_jumps"]
    if not planted:
        return []
    random = random_of(case, "jumps")
    n, size_dps = int(planted[0].parameters["n"]), planted[0].parameters["size_dps"]
    runs = random.permutation(len(plans))[:n]
    return [
        (int(run), case.seconds * random.uniform(0.2, 0.8), size_dps * random.choice([-1.0, 1.0]))
        for run in sorted(runs)
    ]
