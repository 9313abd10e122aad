"""Campaigns: the runs that are recorded, in order. ``paper`` and ``full`` never change; the others show further effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.header import Axis, Face
from gyrocal.recording.plan_file import PlannedRuns
from gyrocal.recording.session import AXES

TABLE_RATE_DPS = 78.0
RIPPLE, TRANSIENT = "table_ripple", "spin_up"
"""The effects in each run of the campaign ``table2``. The first is also the effect that a demonstration hides by default."""
OFF_S = 10.0
"""Time without power between power cycles, s."""
PAUSE_S = 600.0
PAUSE_EVERY = 5
"""Number of power cycles from one pause to the next."""


@dataclass(frozen=True)
class Swing:
    """The table swings: its rate is a sine of ``peak_dps`` whose frequency goes from ``from_hz`` to ``to_hz`` over the run."""

    peak_dps: float
    from_hz: float
    to_hz: float


@dataclass(frozen=True)
class Planned:
    """One run of a campaign before it is simulated. With a ``swing`` the table's rate and angle are recorded."""

    scenario: str
    day: int
    face: Face
    table_rate_dps: float
    power_on_s: float
    seconds: float
    axis: Axis = "z"
    swing: Swing | None = None
    shake_g: float = 0.0
    """Root mean square of a vibration along each of the sensor's axes, g."""
    air_c: float | None = None
    """The air of a chamber that holds its temperature, degC; None = the room."""


@dataclass(frozen=True)
class Campaign:
    """A plan from the number of scenarios (or days) and the length of a run, None for its own; how a chamber heats the part."""

    about: str
    plan: Callable[[int | None, float | None], list[Planned]]
    chamber_c: float = 0.0


def paper_plan(scenarios: int | None, seconds: float | None) -> list[Planned]:
    """Three days of 13, 7 and 28 scenarios; each one power cycle, face up then face down at 78 deg/s."""
    total = 48 if scenarios is None else _at_least_one(scenarios)
    length_s = 70.0 if seconds is None else seconds
    rng = np.random.default_rng(2025)
    plan = []
    for number in range(total):
        day = 1 + int(np.searchsorted(np.cumsum([13, 7, 28]) * total / 48, number, side="right"))
        up_s = _hand(rng, 3.0)
        for face, power_on_s in (("up", up_s), ("down", up_s + length_s + _hand(rng, 9.0))):
            plan.append(Planned(f"s{number:03d}", day, face, TABLE_RATE_DPS, round(power_on_s, 1), length_s))  # type: ignore[arg-type]
    return plan


def full_plan(days: int | None, seconds: float | None) -> list[Planned]:
    """Three days; each run a power cycle; both faces at rest and at 30, 78 and 150 deg/s in both directions, each rate off by
    a few percent that the session file states."""
    rng, hands = np.random.default_rng(2024), np.random.default_rng(2025)
    plan: list[Planned] = []
    for day in _days(days):
        for face in ("up", "down"):
            for nominal in (0.0, 30.0, -30.0, 78.0, -78.0, 150.0, -150.0):
                rate = round(nominal * (1 + rng.uniform(-0.03, 0.03)), 3)
                plan.append(Planned(f"s{len(plan):03d}", day, face, rate, _hand(hands, 3.0), seconds or 40.0))
    return plan


def swing_plan(days: int | None, seconds: float | None) -> list[Planned]:
    """Three days; each run a power cycle; both faces, the table swinging at 40, 80 and 140 deg/s, faster towards the end."""
    hands = np.random.default_rng(2025)
    plan: list[Planned] = []
    for day in _days(days):
        for face in ("up", "down"):
            for peak_dps in (40.0, 80.0, 140.0):
                swing = Swing(peak_dps, 0.05, 0.3)
                plan.append(Planned(f"s{len(plan):03d}", day, face, 0.0, _hand(hands, 3.0), seconds or 60.0, swing=swing))
    return plan


def bench_plan(days: int | None, seconds: float | None) -> list[Planned]:
    """Three days; each run a power cycle; each axis up and down, at rest and at 78 deg/s in both directions."""
    rng, hands = np.random.default_rng(2024), np.random.default_rng(2025)
    plan: list[Planned] = []
    for day in _days(days):
        poses = [(a, f, r) for a in AXES for f in ("up", "down") for r in (0.0, TABLE_RATE_DPS, -TABLE_RATE_DPS)]
        for axis, face, rate in (poses[i] for i in rng.permutation(len(poses))):
            plan.append(Planned(f"s{len(plan):03d}", day, face, rate, _hand(hands, 3.0), seconds or 30.0, axis))
    return plan


def shaker_plan(days: int | None, seconds: float | None) -> list[Planned]:
    """Three days; each run a power cycle; both faces, at rest and at 78 deg/s, the shaker off and at 0.5 and 1 g."""
    hands = np.random.default_rng(2025)
    plan: list[Planned] = []
    for day in _days(days):
        for face in ("up", "down"):
            for rate in (0.0, TABLE_RATE_DPS):
                for shake_g in (0.0, 0.5, 1.0):
                    number = f"s{len(plan):03d}"
                    plan.append(Planned(number, day, face, rate, _hand(hands, 3.0), seconds or 30.0, shake_g=shake_g))
    return plan


def chamber_plan(days: int | None, seconds: float | None) -> list[Planned]:
    """Three days, each a power cycle at rest, face up, through the temperatures of a chamber and back, twice and a half."""
    hands = np.random.default_rng(2025)
    return [Planned(f"s{day:03d}", day, "up", 0.0, _hand(hands, 3.0), seconds or 1500.0) for day in _days(days)]


def hands_plan(poses: int | None, seconds: float | None) -> list[Planned]:
    """One run without a table; :mod:`gyrocal.simulation.hands` simulates it, ``poses`` rests long (None: 30)."""
    if seconds is not None:
        raise InputError("--seconds: hands draws the length of each movement; give the number of rests (--scenarios)")
    return [Planned("s000", 1, "up", 0.0, 3.0, float(30 if poses is None else _at_least_one(poses)))]


CAMPAIGNS = {
    "paper": Campaign("48 power cycles of three days, face up and down at 78 dps", paper_plan),
    "table2": Campaign("paper with effects that give the errors of the paper's Table 2", paper_plan),
    "full": Campaign("rest and three rates, both directions and faces", full_plan),
    "swing": Campaign("the table swings, with an encoder", swing_plan),
    "bench": Campaign("six positions in a chamber at 25 +- 20 °C", bench_plan, chamber_c=20.0),
    "shaker": Campaign("at rest and turning on a shaker, off and at two levels", shaker_plan),
    "chamber": Campaign("at rest in a chamber that goes up and down by 20 °C", chamber_plan, chamber_c=20.0),
    "hands": Campaign("no table: 30 rests of a phone-grade part, turned by hand between", hands_plan),
}
HANDS = "hands"
"""The campaign without a table."""


def of_plan(planned: PlannedRuns) -> list[Planned]:
    """The runs of a plan file, to the letter; a person takes some seconds before each."""
    hands = np.random.default_rng(2025)
    out: list[Planned] = []
    for run in planned.runs:
        first = not out or out[-1].scenario != run.scenario
        power_on_s = _hand(hands, 3.0) if first else out[-1].power_on_s + out[-1].seconds + _hand(hands, 9.0)
        out.append(Planned(
            run.scenario, planned.day or 1, run.face, run.table_rate_dps, round(power_on_s, 1), run.seconds, run.axis,
            air_c=run.temp_c,
        ))  # fmt: skip
    return out


def _days(days: int | None) -> range:
    return range(1, 1 + (3 if days is None else _at_least_one(days)))


def _at_least_one(count: int) -> int:
    if count < 1:
        raise InputError("--scenarios: at least 1")
    return count


def _hand(rng: np.random.Generator, least_s: float) -> float:
    """Time until somebody has pressed the button, s."""
    return round(least_s + float(rng.uniform(0.0, 9.0)), 1)
