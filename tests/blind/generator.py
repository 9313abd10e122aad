"""Sessions with hidden effects, made by a sensor chain of its own.

Nothing here comes from the tool under test: the physics is written again from the contract's effect table and the
LSM6DSO's data sheet, so that an error shared by the tool's simulator and its fit cannot hide.

The chain, run by run: true rate of the table -> effects on a time base four times the chip's -> the chip's second-order
low-pass with the white noise -> chip samples by the chip's own clock -> polled at 145 Hz, newest sample -> clipped and
rounded to counts -> a `gyrocal-session/1` folder. What was planted comes back as a `Truth` and is never written.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

Array = NDArray[np.float64]

AXES = "xyz"
POLL_HZ = 145.0
POLL_JITTER_S = 30e-6
ODR_HZ = 416.0
OVERSAMPLING = 4
CUTOFF_HZ = 136.0
PREROLL_S = 0.05
NOISE_DENSITY_DPS = 3.8e-3  # per sqrt(Hz), one-sided, before the low-pass
LSB_PER_FULL_SCALE = 35e-6  # 8.75 mdps at 250 dps
ACCELEROMETER_NOISE_G = 1e-3
ACCELEROMETER_LSB_G = 61e-6
TEMPERATURE_LSB_C = 1 / 256
TEMPERATURE_NOISE_C = 0.02
TEMPERATURE_ODR_HZ = 52.0
SELF_HEATING_C = 1.5
SELF_HEATING_TAU_S = 60.0
EARTH_RATE_DPS = 15.041 / 3600


@dataclass(frozen=True)
class Effect:
    """One planted effect: its id, its parameters named as in the contract, the axes of the sensor that show it."""

    id: str
    parameters: Mapping[str, float]
    axes: str


@dataclass(frozen=True)
class Case:
    """One session to be made. `expected` are the ids to be named, `rivals` those hardly told from them by it.

    Kinds: "null" (nothing to name), "effect", "pair", "confounded" (real, but this protocol cannot show it apart from
    `rivals`), "unknown" (outside the contract's table). Protocols: "paper", "full" and "swing" (rate_ref_dps, a slow
    sinusoidal rate; constant rates can show neither lag nor clock error). `seconds` is the length of one run.
    """

    name: str
    kind: str
    protocol: str
    seed: int
    seconds: float
    effects: tuple[Effect, ...] = ()
    expected: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    identified_in: tuple[str, ...] = ()
    scenarios: int = 9
    table_axis: str = "z"
    ou_sd_dps: float = 0.0
    ou_tau_s: float = 30.0
    turn_on_sd_dps: float = 0.0
    climate: str = "room"
    full_scale_dps: float = 250.0
    rates_dps: tuple[float, ...] = (30.0, 78.0, 150.0)
    rate_spread: float = 0.03
    latitude_deg: float | None = None
    accelerometer: bool = True
    table_angle: bool = False
    file_format: str = "csv"


@dataclass(frozen=True)
class RunTruth:
    """What one run held. Arrays over samples are [n], over axes and samples [3, n]; axes in the order x, y, z.

    `injected_dps[id]` is what the effect added to the reading, through the low-pass; for a fault of the digital side
    (quantization, saturation, sampling_fault, stuck_bit) the reading with the fault minus the reading without.
    `bias_dps` [3] is the bias of this power cycle, turn-on offset included.
    """

    file: str
    scenario: str
    face: str
    day: int
    power_on_s: float
    table_rate_dps: float | None
    t_s: Array
    rate_dps: Array
    temp_c: Array
    table_angle_deg: Array
    scale: Array
    bias_dps: Array
    drift_dps: Array
    earth_dps: Array
    injected_dps: dict[str, Array]


@dataclass(frozen=True)
class Truth:
    """What `make` planted: `scale` and `bias_dps` are [3] at 25 degC; `white_sd_dps` is of one polled sample."""

    case: Case
    scale: Array
    bias_dps: Array
    white_sd_dps: float
    lsb_dps: float
    runs: list[RunTruth] = field(default_factory=list)

    @property
    def effect_ids(self) -> tuple[str, ...]:
        return tuple(effect.id for effect in self.case.effects)

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        return {effect.id: dict(effect.parameters) for effect in self.case.effects}


def _random(case: Case, *keys: str | int) -> np.random.Generator:
    """A stream of its own for each purpose: the noise of a seed stays the same whatever effect is planted."""
    return np.random.default_rng([case.seed, *(zlib.crc32(str(key).encode()) for key in keys)])


# --- what happens in the world -------------------------------------------------------------------------------------


@dataclass
class _World:
    """One run on the fine time base, all arrays [n]: the quantities that an effect may depend on."""

    t_s: Array  # since the run's first sample
    power_on_s: Array  # since power-on
    cycle_s: Array  # since the first sample of the power cycle
    rate_dps: Array  # about the sensor's sensed axis
    reference_dps: Array  # the rate that the session states
    table_angle_deg: Array
    temp_c: Array
    temp_slope_c_s: Array
    acceleration_g: Array  # [3, n]
    seconds: float
    jumps_dps: Array  # steps planted in this power cycle so far, [n]
    random: np.random.Generator


def _orders(p: Mapping[str, float], angle_deg: Array) -> Array:
    orders = [name.removeprefix("amplitude_") for name in p if name.startswith("amplitude_")]
    angle = np.radians(angle_deg)
    return np.sum(
        [p[f"amplitude_{k}"] * np.cos(float(k) * angle + np.radians(p[f"phase_{k}_deg"])) for k in orders], axis=0
    )


def _bias_temperature(p: Mapping[str, float], world: _World) -> Array:
    dt = world.temp_c - 25.0
    return sum((p.get(f"k{n}_dps_per_c{n if n > 1 else ''}", 0.0) * dt**n for n in (1, 2, 3)), np.zeros_like(dt))


def _g_sensitivity(p: Mapping[str, float], world: _World) -> Array:
    return np.array([p.get(f"g{axis}_dps_per_g", 0.0) for axis in AXES]) @ world.acceleration_g


def _vibration_tone(p: Mapping[str, float], world: _World) -> Array:
    return p["A_dps"] * np.sin(2 * np.pi * (p["f_hz"] * world.t_s + world.random.random()))


def _lag(p: Mapping[str, float], world: _World) -> Array:
    """First-order lag, discretised so that a ramp lags by exactly tau."""
    double = 2 * p["tau_s"] / np.diff(world.t_s[:2])[0]
    pole = (double - 1) / (double + 1)
    b, a = np.array([1.0, 1.0]) / (double + 1), np.array([1.0, -pole])
    lagged, _ = lfilter(b, a, world.rate_dps, zi=lfilter_zi(b, a) * world.rate_dps[0])
    return lagged - world.rate_dps


def _clock_error(p: Mapping[str, float], world: _World) -> Array:
    """The table's programme is looked up at the device's wrong time."""
    return world.rate_dps - world.reference_dps


def _stick_slip(p: Mapping[str, float], world: _World) -> Array:
    """The drive winds up and lets go: a sawtooth of the rate whose cycles differ in length."""
    cycles = int(4 * (world.seconds + 4) / p["period_s"])
    lengths = p["period_s"] * world.random.lognormal(0.0, p["spread"], size=cycles)
    edges = world.t_s[0] - p["period_s"] * world.random.random() + np.concatenate([[0.0], np.cumsum(lengths)])
    cycle = np.searchsorted(edges, world.t_s, side="right") - 1
    return world.rate_dps * p["amplitude"] * (0.5 - (world.t_s - edges[cycle]) / lengths[cycle])


def _gear_ripple(p: Mapping[str, float], world: _World) -> Array:
    """Ripple of a gear whose ratio to the table is no whole number; its position is not the table's."""
    phase = 2 * np.pi * world.random.random()
    return world.rate_dps * p["amplitude"] * np.cos(np.radians(p["order"] * world.table_angle_deg) + phase)


def _mount_resonance(p: Mapping[str, float], world: _World) -> Array:
    """The mount rings, driven by the floor: narrow-band noise."""
    step = np.diff(world.t_s[:2])[0]
    radius = np.exp(-np.pi * p["bandwidth_hz"] * step)
    a = [1.0, -2 * radius * np.cos(2 * np.pi * p["f_hz"] * step), radius**2]
    settle = int(3 / (np.pi * p["bandwidth_hz"] * step))
    ringing = lfilter([1.0], a, world.random.standard_normal(settle + len(world.t_s)))[settle:]
    # variance of an AR(2) process driven by unit noise
    gain = np.sqrt((1 + a[2]) / ((1 - a[2]) * ((1 + a[2]) ** 2 - a[1] ** 2)))
    return p["sd_dps"] / gain * ringing


def _fan_sweep(p: Mapping[str, float], world: _World) -> Array:
    """A fan that speeds up through the run."""
    sweep = (p["f_end_hz"] - p["f_start_hz"]) / world.seconds
    start = p["f_start_hz"] + world.random.uniform(-2.0, 2.0)
    cycles = start * world.t_s + 0.5 * sweep * world.t_s**2 + world.random.random()
    return p["A_dps"] * np.sin(2 * np.pi * cycles)


SIGNALS: dict[str, Callable[[Mapping[str, float], _World], Array]] = {
    "bias_temperature": _bias_temperature,
    "scale_temperature": lambda p, world: p["k_per_c"] * (world.temp_c - 25.0) * world.rate_dps,
    "thermal_lag": lambda p, world: p["k_dps_s_per_c"] * world.temp_slope_c_s,
    "warmup": lambda p, world: p["A_dps"] * np.exp(-world.power_on_s / p["tau_s"]),
    "drift": lambda p, world: p["k_dps_per_s"] * world.cycle_s,
    "table_ripple": lambda p, world: world.rate_dps * _orders(p, world.table_angle_deg),
    "vibration_tone": _vibration_tone,
    "spin_up": lambda p, world: -world.rate_dps * p["A"] * np.exp(-np.maximum(world.t_s, 0.0) / p["tau_s"]),
    "g_sensitivity": _g_sensitivity,
    "misalignment": lambda p, world: p["m"] * world.rate_dps,
    "scale_nonlinearity": lambda p, world: p["k3"] * world.rate_dps**3,
    "scale_asymmetry": lambda p, world: p["k"] * np.abs(world.rate_dps),
    "centripetal": lambda p, world: p["k"] * world.rate_dps**2,
    "lag": _lag,
    "clock_error": _clock_error,
    "bias_jumps": lambda p, world: world.jumps_dps,
    "stick_slip": _stick_slip,
    "gear_ripple": _gear_ripple,
    "mount_resonance": _mount_resonance,
    "fan_sweep": _fan_sweep,
}
DIGITAL = ("saturation", "quantization", "stuck_bit", "sampling_fault")


# --- protocols -----------------------------------------------------------------------------------------------------


@dataclass
class _Plan:
    """One run as the operator does it; times of day in seconds."""

    scenario: int
    face: str
    day: int
    table_rate_dps: float
    power_on_time_s: float
    start_time_s: float
    swing_hz: float = 0.0


def _plans(case: Case) -> list[_Plan]:
    random = _random(case, "protocol")
    days = np.array_split(np.arange(case.scenarios), 3)
    plans: list[_Plan] = []
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
        else:
            raise ValueError(f"{case.name}: unknown protocol {case.protocol!r}; use paper, full or swing")
        for cycle in cycles:
            power_on_time_s = clock_s
            clock_s += random.uniform(2.0, 4.0)
            for face, rate, swing_hz in cycle:
                plans.append(_Plan(scenario, face, day, rate, power_on_time_s, clock_s, swing_hz))
                clock_s += case.seconds + random.uniform(15.0, 30.0)
            clock_s += random.uniform(10.0, 25.0)
            scenario += 1
    return plans


class _Climate:
    """The die's temperature: the room of each day, the die's own heat, and in a "chamber" a heater that cycles."""

    def __init__(self, case: Case, plans: list[_Plan]) -> None:
        random = _random(case, "climate")
        self.base_c = {day: random.uniform(23.0, 27.0) for day in (1, 2, 3)}
        self.slow = [(random.uniform(0.3, 0.8), random.uniform(900, 2400), random.random()) for _ in range(2)]
        self.heater = (3.0 if case.climate == "chamber" else 0.0, random.uniform(60.0, 80.0), random.random())
        # heat left from the power cycles before, at each power-on
        self.heat_c: dict[int, float] = {}
        heat_c, last_day, last_on_s, last_off_s = 0.0, 0, 0.0, 0.0
        for plan in plans:
            if plan.day != last_day:
                heat_c, last_day, last_on_s, last_off_s = 0.0, plan.day, plan.power_on_time_s, plan.power_on_time_s
            if plan.scenario not in self.heat_c:
                warm = np.exp(-(last_off_s - last_on_s) / SELF_HEATING_TAU_S)
                heat_c = SELF_HEATING_C + (heat_c - SELF_HEATING_C) * warm
                heat_c *= np.exp(-(plan.power_on_time_s - last_off_s) / SELF_HEATING_TAU_S)
                self.heat_c[plan.scenario] = heat_c
                last_on_s = plan.power_on_time_s
            last_off_s = plan.start_time_s + case.seconds

    def __call__(self, plan: _Plan, t_s: Array) -> tuple[Array, Array]:
        """Temperature and its slope at times `t_s` of the run."""
        time_s = plan.start_time_s + t_s
        temp_c, slope = np.full_like(t_s, self.base_c[plan.day]), np.zeros_like(t_s)
        for amplitude_c, period_s, phase in (*self.slow, self.heater):
            angle = 2 * np.pi * (time_s / period_s + phase)
            temp_c += amplitude_c * np.sin(angle)
            slope += amplitude_c * 2 * np.pi / period_s * np.cos(angle)
        left = (self.heat_c[plan.scenario] - SELF_HEATING_C) * np.exp(
            -(time_s - plan.power_on_time_s) / SELF_HEATING_TAU_S
        )
        return temp_c + SELF_HEATING_C + left, slope - left / SELF_HEATING_TAU_S


def _in_sensor_frame(table_axis: str, face: str, in_plane: float, along: float, angle_deg: Array) -> Array:
    """A vector fixed in the room, [3, n] in the sensor turning with the table: `in_plane` across the axis, `along` it.

    "down" is the sensor turned by 180 deg about its first in-plane axis.
    """
    axis = AXES.index(table_axis)
    flip = 1.0 if face == "up" else -1.0
    angle = np.radians(angle_deg)
    vector = np.empty((3, len(angle_deg)))
    vector[axis] = flip * along
    vector[(axis + 1) % 3] = in_plane * np.cos(angle)
    vector[(axis + 2) % 3] = -flip * in_plane * np.sin(angle)
    return vector


def _jumps(case: Case, plans: list[_Plan]) -> list[tuple[int, float, float]]:
    """(run, time in run, step) of every planted step; no two in one run, none within a fifth of its ends."""
    planted = [effect for effect in case.effects if effect.id == "bias_jumps"]
    if not planted:
        return []
    random = _random(case, "jumps")
    n, size_dps = int(planted[0].parameters["n"]), planted[0].parameters["size_dps"]
    runs = random.permutation(len(plans))[:n]
    return [
        (int(run), case.seconds * random.uniform(0.2, 0.8), size_dps * random.choice([-1.0, 1.0]))
        for run in sorted(runs)
    ]


# --- the chip ------------------------------------------------------------------------------------------------------


class _Chip:
    """Low-pass, clock and polling: from the fine time base to the samples that the host reads."""

    def __init__(self, case: Case) -> None:
        self.odr_hz = ODR_HZ * (1 + _random(case, "chip").normal(0.0, 0.01))
        self.fine_hz = OVERSAMPLING * self.odr_hz
        # the cut-off moves with the chip's own clock
        self.b, self.a = butter(2, CUTOFF_HZ / ODR_HZ / OVERSAMPLING * 2)
        self.zi = lfilter_zi(self.b, self.a)
        self.noise_sd_dps = NOISE_DENSITY_DPS * np.sqrt(self.fine_hz / 2)
        impulse = lfilter(self.b, self.a, np.eye(1, 4096)[0])
        self.white_sd_dps = float(self.noise_sd_dps * np.sqrt(np.sum(impulse**2)))

    def times(self, seconds: float) -> Array:
        return np.arange(int((seconds + 2 * PREROLL_S) * self.fine_hz)) / self.fine_hz - PREROLL_S

    def newest(self, poll_s: Array) -> NDArray[np.int64]:
        """Index on the fine base of the newest chip sample at each poll."""
        return OVERSAMPLING * np.floor((poll_s + PREROLL_S) * self.odr_hz).astype(np.int64)

    def low_pass(self, signal: Array) -> Array:
        return lfilter(self.b, self.a, signal, zi=self.zi * signal[0])[0]

    def noise(self, random: np.random.Generator, n: int, index: NDArray[np.int64]) -> Array:
        white = random.standard_normal((3, n))
        return self.noise_sd_dps * lfilter(self.b, self.a, white, axis=1)[:, index]


def _digitise(
    case: Case, analogue_dps: Array, lsb_dps: float, random: np.random.Generator
) -> tuple[Array, dict[str, Array]]:
    """Counts as the host turns them back into deg/s, [3, n], and what each digital fault changed."""
    planted = {effect.id: effect for effect in case.effects if effect.id in DIGITAL}
    changes: dict[str, Array] = {}
    clipped = np.clip(analogue_dps, -case.full_scale_dps, case.full_scale_dps)
    if "saturation" in planted:
        changes["saturation"] = clipped - analogue_dps
    reading = lsb_dps * np.round(clipped / lsb_dps)
    if "quantization" in planted:
        coarse_dps = planted["quantization"].parameters["lsb_dps"]
        coarse = coarse_dps * np.round(clipped / coarse_dps)
        changes["quantization"] = coarse - reading
        reading = coarse
    if "stuck_bit" in planted:
        stuck = reading.copy()
        for axis in planted["stuck_bit"].axes:
            counts = np.round(reading[AXES.index(axis)] / lsb_dps).astype(np.int64)
            stuck[AXES.index(axis)] = lsb_dps * (counts | 1 << int(planted["stuck_bit"].parameters["bit"]))
        changes["stuck_bit"] = stuck - reading
        reading = stuck
    if "sampling_fault" in planted:
        repeats = random.random(reading.shape[1]) < planted["sampling_fault"].parameters["fraction"]
        repeats[0] = False
        source = np.maximum.accumulate(np.where(repeats, 0, np.arange(reading.shape[1])))
        changes["sampling_fault"] = reading[:, source] - reading
        reading = reading[:, source]
    return reading, changes


def _ornstein_uhlenbeck(case: Case, random: np.random.Generator, n: int, before: Array, gap_s: float) -> Array:
    """OU noise [3, n] at the poll rate, going on from the values `before` [3] across `gap_s` (inf: a fresh start)."""
    if case.ou_sd_dps == 0.0:
        return np.zeros((3, n))
    keep = np.exp(-gap_s / case.ou_tau_s)
    start = keep * before + case.ou_sd_dps * np.sqrt(1 - keep**2) * random.standard_normal(3)
    pole = np.exp(-1 / (POLL_HZ * case.ou_tau_s))
    kicks = case.ou_sd_dps * np.sqrt(1 - pole**2) * random.standard_normal((3, n))
    kicks[:, 0] = start
    return lfilter([1.0], [1.0, -pole], kicks, axis=1)


def make(case: Case, folder: str | Path) -> Truth:
    """Writes the session of `case` into `folder` (made if absent) and returns what was planted."""
    import polars as pl

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    chip = _Chip(case)
    plans = _plans(case)
    climate = _Climate(case, plans)
    sensor = _random(case, "sensor")
    scale = np.clip(sensor.normal(0.0, 0.004, 3), -0.01, 0.01)
    bias_dps = sensor.uniform(-0.7, 0.7, 3)
    tilt_deg = sensor.uniform(0.1, 0.5)
    axis = AXES.index(case.table_axis)
    lsb_dps = LSB_PER_FULL_SCALE * case.full_scale_dps
    truth = Truth(case, scale, bias_dps, chip.white_sd_dps, lsb_dps)
    clock_error = next((effect.parameters["e"] for effect in case.effects if effect.id == "clock_error"), 0.0)
    jumps = _jumps(case, plans)
    fine_s = chip.times(case.seconds * (1 + clock_error))
    n = int(case.seconds * POLL_HZ)
    turn_on, drift = np.zeros(3), np.zeros((3, 1))
    first: _Plan | None = None
    entries = []

    for run, plan in enumerate(plans):
        random = _random(case, "run", run)
        gap_s = np.inf
        if first is None or plan.scenario != first.scenario:
            first = plan
            turn_on = case.turn_on_sd_dps * _random(case, "turn_on", plan.scenario).standard_normal(3)
        else:
            gap_s = plan.start_time_s - plans[run - 1].start_time_s - case.seconds
        drift = _ornstein_uhlenbeck(case, random, n, drift[:, -1], gap_s)

        # the host's clock reads t_s; the world is at (1 + e) t_s
        t_s = np.arange(n) / POLL_HZ + np.abs(random.normal(0.0, POLL_JITTER_S, n))
        t_s = np.round(t_s - t_s[0], 6)
        index = chip.newest(t_s * (1 + clock_error))

        side = 1.0 if plan.face == "up" else -1.0
        start_deg = random.uniform(0.0, 360.0)
        if plan.swing_hz:
            omega, phase = 2 * np.pi * plan.swing_hz, 2 * np.pi * random.random()
            rate_dps = side * plan.table_rate_dps * np.sin(omega * fine_s + phase)
            reference = side * plan.table_rate_dps * np.sin(omega * fine_s / (1 + clock_error) + phase)
            swept_deg = plan.table_rate_dps / omega * (np.cos(phase) - np.cos(omega * fine_s + phase))
        else:
            rate_dps = np.full_like(fine_s, side * plan.table_rate_dps)
            reference = rate_dps
            swept_deg = plan.table_rate_dps * fine_s
        angle_deg = start_deg + swept_deg
        temp_c, temp_slope = climate(plan, fine_s)
        gravity = _in_sensor_frame(
            case.table_axis, plan.face, np.sin(np.radians(tilt_deg)), np.cos(np.radians(tilt_deg)), angle_deg
        )
        jumps_dps = np.zeros_like(fine_s)
        for at_run, at_s, size_dps in jumps:
            if at_run <= run and plans[at_run].scenario == plan.scenario:
                jumps_dps += size_dps * (fine_s + plan.start_time_s >= at_s + plans[at_run].start_time_s)
        world = _World(
            t_s=fine_s,
            power_on_s=fine_s + plan.start_time_s - plan.power_on_time_s,
            cycle_s=fine_s + plan.start_time_s - first.start_time_s,
            rate_dps=rate_dps,
            reference_dps=reference,
            table_angle_deg=angle_deg,
            temp_c=temp_c,
            temp_slope_c_s=temp_slope,
            acceleration_g=gravity,
            seconds=case.seconds,
            jumps_dps=jumps_dps,
            random=_random(case, "effects", run),
        )

        injected: dict[str, Array] = {}
        for effect in case.effects:
            if effect.id in DIGITAL:
                continue
            signal = chip.low_pass(SIGNALS[effect.id](effect.parameters, world))[index]
            added = injected.setdefault(effect.id, np.zeros((3, n)))
            for name in effect.axes:
                added[AXES.index(name)] += signal

        rate = chip.low_pass(reference)[index]
        earth = np.zeros((3, n))
        if case.latitude_deg is not None:
            latitude = np.radians(case.latitude_deg)
            north, vertical = EARTH_RATE_DPS * np.cos(latitude), EARTH_RATE_DPS * np.sin(latitude)
            earth = _in_sensor_frame(case.table_axis, plan.face, north, vertical, angle_deg[index])
        power_cycle_bias = bias_dps + turn_on
        analogue = power_cycle_bias[:, None] + earth + drift + chip.noise(random, len(fine_s), index)
        analogue[axis] += (1 + scale[axis]) * rate
        for added in injected.values():
            analogue += added
        reading, changes = _digitise(case, analogue, lsb_dps, random)
        injected |= changes

        columns = {"t_s": t_s} | {f"g{name}_dps": reading[i] for i, name in enumerate(AXES)}
        if case.accelerometer:
            measured_g = gravity[:, index] + ACCELEROMETER_NOISE_G * random.standard_normal((3, n))
            counts = np.round(measured_g / ACCELEROMETER_LSB_G)
            columns |= {f"a{name}_g": ACCELEROMETER_LSB_G * counts[i] for i, name in enumerate(AXES)}
        held = np.searchsorted(t_s, np.floor(t_s * TEMPERATURE_ODR_HZ) / TEMPERATURE_ODR_HZ)
        measured_c = (temp_c[index] + TEMPERATURE_NOISE_C * random.standard_normal(n))[held]
        columns["temp_c"] = TEMPERATURE_LSB_C * np.round(measured_c / TEMPERATURE_LSB_C)
        if plan.swing_hz:
            columns["rate_ref_dps"] = rate
        if case.table_angle:
            columns["table_angle_deg"] = angle_deg[index]
        file = f"{run:03d}_{plan.face}.{case.file_format}"
        frame = pl.DataFrame(columns)
        if case.file_format == "parquet":
            frame.write_parquet(folder / file)
        else:
            frame.write_csv(folder / file, float_precision=6)

        power_on_s = round(plan.start_time_s - plan.power_on_time_s, 3)
        entry = [f'file = "{file}"', f'scenario = "s{plan.scenario:03d}"', f'face = "{plan.face}"']
        if not plan.swing_hz:
            entry.append(f"table_rate_dps = {plan.table_rate_dps!r}")
        entries.append("\n".join(["", "[[run]]", *entry, f"day = {plan.day}", f"power_on_s = {power_on_s!r}"]))
        truth.runs.append(
            RunTruth(
                file=file,
                scenario=f"s{plan.scenario:03d}",
                face=plan.face,
                day=plan.day,
                power_on_s=power_on_s,
                table_rate_dps=None if plan.swing_hz else plan.table_rate_dps,
                t_s=t_s,
                rate_dps=rate,
                temp_c=temp_c[index],
                table_angle_deg=angle_deg[index],
                scale=scale,
                bias_dps=power_cycle_bias,
                drift_dps=drift,
                earth_dps=earth,
                injected_dps=injected,
            )
        )

    head = [
        'format = "gyrocal-session/1"',
        'sensor = "LSM6DSO"',
        f'axis = "{case.table_axis}"',
        f"sample_rate_hz = {POLL_HZ!r}",
        f"full_scale_dps = {case.full_scale_dps!r}",
        f"lsb_dps = {lsb_dps:.6f}",
    ]
    if case.latitude_deg is not None:
        head.append(f"latitude_deg = {case.latitude_deg!r}")
    (folder / "session.toml").write_text("\n".join([*head, *entries, ""]), encoding="utf-8")
    return truth


# --- what the data can tell ----------------------------------------------------------------------------------------


def _signal(truth: Truth, effect: str | None) -> list[Array]:
    """What was injected into each run, [3, n]: one effect, or all together."""
    zero = np.zeros((3, len(truth.runs[0].t_s)))
    return [
        sum((signal for name, signal in run.injected_dps.items() if effect in (None, name)), zero) for run in truth.runs
    ]


def _whitened(truth: Truth, columns: Array) -> Array:
    """Columns [..., n] through the filter that turns the true white + OU noise into unit white noise (exact Kalman)."""
    case = truth.case
    variance = truth.white_sd_dps**2 + truth.lsb_dps**2 / 12
    if case.ou_sd_dps == 0.0:
        return columns / np.sqrt(variance)
    pole = np.exp(-1 / (POLL_HZ * case.ou_tau_s))
    spread, state = case.ou_sd_dps**2, np.zeros(columns.shape[:-1])
    out = np.empty_like(columns)
    for i in range(columns.shape[-1]):
        innovation = columns[..., i] - state
        total = spread + variance
        out[..., i] = innovation / np.sqrt(total)
        state = pole * (state + spread / total * innovation)
        spread = pole**2 * spread * variance / total + case.ou_sd_dps**2 * (1 - pole**2)
    return out


def detectability(truth: Truth, effect: str | None = None) -> float:
    """Standard errors by which the effect's size stands out for one who knows its shape and the noise.

    The norm of the injected signal after projecting out scale (table's axis) and bias (every axis), in the metric of
    the true noise: white and quantisation, OU, and the turn-on bias as a random offset of each power cycle. Without
    `effect`, of all that was injected together.
    """
    signals = _signal(truth, effect)
    constant = np.ones_like(truth.runs[0].t_s)
    total = 0.0
    for i, axis in enumerate(AXES):
        if not any(np.any(signal[i]) for signal in signals):
            continue
        shown = [[signal[i], constant] for signal in signals]
        if axis == truth.case.table_axis:
            shown = [[*columns, run.rate_dps] for columns, run in zip(shown, truth.runs, strict=True)]
        columns = _whitened(truth, np.array(shown))
        information = np.zeros((columns.shape[1],) * 2)
        for scenario in dict.fromkeys(run.scenario for run in truth.runs):
            mine = np.concatenate([columns[k] for k, run in enumerate(truth.runs) if run.scenario == scenario], axis=1)
            information += mine @ mine.T
            if truth.case.turn_on_sd_dps > 0.0:
                # the whitened constant is also the turn-on offset's column
                offset = mine @ mine[1]
                information -= np.outer(offset, offset) / (mine[1] @ mine[1] + truth.case.turn_on_sd_dps**-2)
        known = information[1:, 1:]
        size = np.sqrt(np.diag(known))
        solved = np.linalg.lstsq(known / np.outer(size, size), information[0, 1:] / size, rcond=1e-10)[0]
        total += max(0.0, information[0, 0] - float(solved @ (information[0, 1:] / size)))
    return float(np.sqrt(total))


def white_detectability(truth: Truth, effect: str | None = None) -> float:
    """The plainer figure: norm of the injected signal over the white noise of a sample.

    Scale, and a free bias for each power cycle, are projected out. It ignores drift noise, and is blind to what is
    constant within a power cycle (in the full protocol: g_sensitivity, misalignment, every function of the rate).
    """
    signals = _signal(truth, effect)
    scenarios = list(dict.fromkeys(run.scenario for run in truth.runs))
    total = 0.0
    for i, axis in enumerate(AXES):
        centred = []
        for scenario in scenarios:
            runs = [k for k, run in enumerate(truth.runs) if run.scenario == scenario]
            pair = np.array(
                [np.concatenate([signals[k][i] for k in runs]), np.concatenate([truth.runs[k].rate_dps for k in runs])]
            )
            centred.append(pair - pair.mean(axis=1, keepdims=True))
        signal, rate = np.concatenate(centred, axis=1)
        power = rate @ rate
        if axis == truth.case.table_axis and power > 1e-12:
            signal = signal - rate * (rate @ signal) / power
        total += signal @ signal
    return float(np.sqrt(total) / truth.white_sd_dps)
