"""The recordings that users bring: tables of every kind, encoders, motion capture, hands, chambers, rests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from blind.generator.motion import by_hand, staircase

from .recording import AXES, Array, Random, Recording, Run, Sensor

RATES_HZ = (50.0, 100.0, 104.0, 145.0, 200.0, 208.0, 400.0)
FEWEST, MEAN_BEYOND, MOST = 20_000, 17_000, 150_000
TOP_DPS = (60.0, 100.0, 150.0, 200.0)
TILT_DEG = (0.1, 0.5)
OfTime = Callable[[Array], Array]


@dataclass(frozen=True)
class Step:
    """One run as it is planned: how it moves about its axis (table's sense), its power cycle and its face."""

    scenario: int
    day: int
    face: str
    axis: int
    stated_dps: float | None = None
    motion: OfTime | None = None
    turn_deg: float | None = None


def log_uniform(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _sensor(random: Random, rate_hz: float) -> Sensor:
    cutoff = float(rate_hz * random.choice([0.1, 0.2, 0.35])) if random.random() < 0.4 else None
    full_scale = float(random.choice([250.0, 500.0]))
    return Sensor(
        rate_hz, random.uniform(-0.02, 0.02, 3), random.uniform(-5.0, 5.0, 3), log_uniform(random, 2e-3, 1.5e-2), cutoff,
        log_uniform(random, 5e-4, 4e-3) if random.random() < 0.7 else 0.0, log_uniform(random, 10.0, 60.0),
        log_uniform(random, 2e-3, 2e-2) if random.random() < 0.8 else 0.0, 35e-6 * full_scale, full_scale,
    )  # fmt: skip


def _pairs(random: Random, axis: int, _: float) -> list[Step]:
    rate = float(random.choice([45.0, 78.0, 90.0, 200.0]))
    cycles, days = int(random.integers(5, 10)), int(random.choice([1, 3]))
    return [Step(c, 1 + c * days // cycles, face, axis, rate) for c in range(cycles) for face in ("up", "down")]


def _full(random: Random, axis: int, _: float) -> list[Step]:
    top = float(random.choice(TOP_DPS))
    rates = [0.0, *(sign * top * part for part in (0.2, 0.5, 1.0) for sign in (1, -1))]
    days = int(random.integers(1, 4))
    said = [(day, face, rate) for day in range(days) for face in ("up", "down") for rate in rates]
    off = 1 + random.uniform(-0.03, 0.03, len(said))
    return [
        Step(k, 1 + day, face, axis, round(float(rate * off[k]), 3)) for k, (day, face, rate) in enumerate(said)
    ]


def _levels(random: Random, axis: int, _: float) -> list[Step]:
    """A few power cycles, in each of which the table turns at several rates."""
    top, cycles = float(random.choice(TOP_DPS)), int(random.integers(3, 7))
    rates = [0.0, -top, top / 3, top, -top / 3]
    each = [(c, "up" if (c + k) % 2 else "down", round(rate, 3)) for c in range(cycles) for k, rate in enumerate(rates)]
    return [Step(c, 1 + c % 2, face, axis, rate) for c, face, rate in each]


def _cube(random: Random, axis: int, _: float) -> list[Step]:
    rate = float(random.choice([45.0, 78.0, 100.0]))
    ways = ((1, "up"), (-1, "up"), (1, "down"))
    return [Step(c, 1, face, a, sign * rate) for c in range(2) for a in range(3) for sign, face in ways]


def _long(random: Random, axis: int, _: float) -> list[Step]:
    rate = float(random.choice([30.0, 78.0, 150.0]))
    faces = ("up",) if random.random() < 0.5 else ("up", "down")
    return [Step(c, 1, face, axis, rate) for c, face in enumerate(faces)]


def _rest(random: Random, axis: int, _: float) -> list[Step]:
    return [Step(c, 1, "up" if c % 2 else "down", axis, 0.0) for c in range(int(random.integers(3, 9)))]


def _moving(levels: int | None, fewest: int, most: int) -> Callable[[Random, int, float], list[Step]]:
    def steps(random: Random, axis: int, seconds: float) -> list[Step]:
        top, runs = float(random.choice(TOP_DPS)), int(random.integers(fewest, most + 1))
        found = []
        for c in range(runs):
            rate = by_hand(top, seconds / runs, random) if levels is None else staircase(top, seconds / runs, levels)
            found.append(Step(c, 1 + c % 2, "up" if c % 2 == 0 else "down", axis, motion=rate))
        return found

    return steps


def _swing(random: Random, axis: int, _: float) -> list[Step]:
    def rate(size: float, hz: float, phase: float) -> OfTime:
        return lambda t: np.asarray(size * np.sin(2 * np.pi * hz * t + phase))

    found = []
    for c in range(int(random.integers(4, 9))):
        law = rate(random.uniform(10.0, 80.0), log_uniform(random, 0.05, 0.5), random.uniform(0, 6.28))
        found.append(Step(c, 1 + c % 2, "up" if c % 2 else "down", axis, motion=law))
    return found


def _turns(random: Random, axis: int, seconds: float) -> list[Step]:
    each = [(a, sign) for _ in range(2) for a in range(3) for sign in (1.0, -1.0)]
    length_s = seconds / (len(each) + 3)

    def hand(degrees: float) -> OfTime:
        def rate(t: Array) -> Array:
            part = np.clip((t - 0.15 * length_s) / (0.7 * length_s), 0.0, 1.0)
            return np.asarray(degrees * 2 * np.sin(np.pi * part) ** 2 / (0.7 * length_s))

        return rate

    rests = [Step(c, 1, "up", axis, 0.0) for c in range(3)]
    turns = [Step(k % 3, 1, "up", a, motion=hand(360.0 * s), turn_deg=360.0 * s) for k, (a, s) in enumerate(each)]
    return sorted([*rests, *turns], key=lambda step: step.scenario)


@dataclass(frozen=True)
class Protocol:
    """How runs are planned; ``least_s`` is the shortest run that still is one, ``reference`` what tells the true rate."""

    steps: Callable[[Random, int, float], list[Step]] | None
    references: tuple[str, ...]
    least_s: float
    weight: float
    climates: tuple[str, ...] = ("room", "room", "heater", "none")


PROTOCOLS = {
    "pairs": Protocol(_pairs, ("stated",), 8.0, 3.0),
    "full": Protocol(_full, ("stated",), 5.0, 2.0),
    "levels": Protocol(_levels, ("stated",), 8.0, 2.0),
    "cube": Protocol(_cube, ("stated",), 8.0, 1.0),
    "long": Protocol(_long, ("stated",), 100.0, 1.0),
    "rest": Protocol(_rest, ("stated",), 20.0, 1.0),
    "staircase": Protocol(_moving(9, 2, 4), ("rate", "rate", "angle"), 45.0, 2.0),
    "hand": Protocol(_moving(None, 4, 8), ("rate", "angle"), 20.0, 2.0),
    "swing": Protocol(_swing, ("rate", "angle"), 15.0, 2.0),
    "chamber": Protocol(_moving(3, 2, 4), ("rate", "rate", "angle"), 90.0, 2.0, ("ramp",)),
    "chamber_rates": Protocol(_levels, ("stated",), 15.0, 1.0, ("heater", "ramp")),
    "mocap": Protocol(None, ("three",), 60.0, 1.5),
    "turns": Protocol(_turns, ("turns",), 8.0, 1.0),
    "by_hand": Protocol(None, ("gravity",), 90.0, 1.0),
}


def climate(random: Random, kind: str, seconds: float) -> OfTime:
    """The die's temperature over the session's time, degC, without its own heat."""
    base, slope = random.uniform(21.0, 28.0), random.uniform(-1.0, 1.0) / 1000
    waves = [(random.uniform(0.2, 0.6), random.uniform(600.0, 2400.0), random.uniform(0, 6.28))]
    if kind == "heater":
        waves.append((random.uniform(1.0, 4.0), random.uniform(50.0, 150.0), random.uniform(0, 6.28)))
    if kind == "ramp":
        size, period, phase = random.uniform(6.0, 20.0), seconds * random.uniform(0.25, 0.45), random.uniform(0, 6.28)
        waves += [(size * 0.81 / k**2, period / k, k * (phase + np.pi / 2)) for k in (1, 3, 5)]
    return lambda s: base + slope * s + sum(a * np.sin(2 * np.pi * s / period + phase) for a, period, phase in waves)


def _gravity(face: str, axis: int, tilt: float, angle_deg: Array) -> Array:
    """Gravity [3, n] in a sensor on a table whose axis is ``tilt`` (rad) off the vertical."""
    side, angle = (1.0 if face == "up" else -1.0), np.radians(angle_deg)
    vector = np.empty((3, angle.size))
    vector[axis] = side * np.cos(tilt)
    vector[(axis + 1) % 3] = np.sin(tilt) * np.cos(angle)
    vector[(axis + 2) % 3] = -side * np.sin(tilt) * np.sin(angle)
    return vector


def draw(random: Random, only: Sequence[str] = ()) -> Recording:
    """A recording of a protocol drawn by its weight (of those in ``only``), without effects."""
    names = [name for name in PROTOCOLS if not only or name in only]
    weights = np.array([PROTOCOLS[name].weight for name in names])
    name = str(random.choice(names, p=weights / weights.sum()))
    protocol = PROTOCOLS[name]
    samples = min(FEWEST + random.exponential(MEAN_BEYOND), MOST)
    axis = int(random.choice([0, 1, 2, 2]))
    reference = str(random.choice(protocol.references))
    planned = random.spawn(1)[0]
    count = len(protocol.steps(random.spawn(1)[0], axis, 100.0)) + 1 if protocol.steps else 1
    fits = [hz for hz in RATES_HZ if samples / hz / count >= protocol.least_s] or [RATES_HZ[0]]
    rate_hz = float(random.choice(fits))
    seconds = samples / rate_hz
    made = Recording(name, _sensor(random, rate_hz), [], axis, reference)
    kind = str(random.choice(protocol.climates))
    made.has_temp, made.varies = kind != "none", kind in ("heater", "ramp")
    made.has_acc = reference == "gravity" or bool(random.random() < 0.6)
    made.temp_step_c = float(random.choice([1 / 256, 1 / 16]))
    warmth = climate(random, kind, 1.5 * seconds)
    if protocol.steps is None:
        from .freehand import freehand

        return freehand(made, random, seconds, warmth)
    steps = protocol.steps(planned, axis, seconds)
    made.ref_noise_dps = float(random.choice([0.0, 0.01, 0.03])) if reference == "rate" else 0.0
    made.turn_se_deg = 0.3 if reference == "turns" else 0.0
    made.has_angle = bool(random.random() < 0.3) and reference in ("stated", "rate")
    if reference == "angle":
        made.angle_step_deg = float(random.choice([1e-5, 5e-4, 2e-3, 1e-2, 5e-2]))
    _record(made, random, steps, seconds / len(steps), warmth)
    return made


def _record(made: Recording, random: Random, steps: list[Step], seconds: float, warmth: OfTime) -> None:
    """The runs of these steps, one after the other; the chip heats itself after each power-on."""
    tilt = np.radians(random.uniform(*TILT_DEG))
    shaken_g = log_uniform(random, 0.1, 1.0) if made.has_acc and random.random() < 0.25 else 0.0
    heat_c, tau_s = random.uniform(0.5, 2.0), random.uniform(30.0, 90.0)
    at_s, on_s, first_s, last = 0.0, 0.0, 0.0, -1
    t_s = np.round(np.arange(int(seconds * made.sensor.rate_hz)) / made.sensor.rate_hz, 6)
    for step in steps:
        if step.scenario != last:
            at_s += random.uniform(20.0, 60.0)
            on_s, last = at_s - random.uniform(2.0, 4.0), step.scenario
            first_s = at_s
        side = 1.0 if step.face == "up" else -1.0
        w_at = _about(step, side)
        start_deg = random.uniform(0.0, 360.0)
        w = side * w_at(t_s)[step.axis]
        swept = np.concatenate([[0.0], np.cumsum((w[1:] + w[:-1]) / 2 * np.diff(t_s))])
        acc_g = _gravity(step.face, step.axis, tilt, start_deg + swept)
        if shaken_g:
            acc_g[step.axis] += _shaking(random, t_s, shaken_g, made.sensor.rate_hz)
        temp_c = warmth(at_s + t_s) + heat_c * (1 - np.exp(-(at_s + t_s - on_s) / tau_s))
        made.runs.append(Run(
            step.scenario, step.day, step.face, step.axis, t_s, at_s, at_s - on_s, at_s - first_s, w_at, start_deg + swept,
            temp_c, acc_g, step.stated_dps, step.turn_deg, ((slice(0, t_s.size), True),) if step.turn_deg else (),
        ))  # fmt: skip
        at_s += seconds + random.uniform(5.0, 20.0)


def _shaking(random: Random, t_s: Array, size_g: float, rate_hz: float) -> Array:
    """A motor's shaking of the run's own strength, which comes and goes over several seconds."""
    f_hz, period_s, phase = rate_hz * random.uniform(0.08, 0.2), random.uniform(8, 20), random.uniform(0, 3.14)
    strength_g = size_g * np.sqrt(2) * np.abs(np.sin(np.pi * t_s / period_s + phase)) * random.uniform(0.3, 1.0)
    return np.asarray(strength_g * np.sin(2 * np.pi * f_hz * t_s + phase))


def _about(step: Step, side: float) -> Callable[[Array], Array]:
    def w_at(t_s: Array) -> Array:
        w = np.zeros((len(AXES), t_s.size))
        w[step.axis] = side * (np.full(t_s.size, step.stated_dps) if step.motion is None else step.motion(t_s))
        return w

    return w_at
