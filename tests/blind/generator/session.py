"""A session folder, made run by run, and what was planted in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from . import chip
from .case import AXES, Array, Case, RunTruth, Truth, random_of
from .chip import Chip
from .climate import Climate
from .motion import Motion, motion
from .protocol import Plan, jumps_of, plans_of
from .signals import SIGNALS, World

EARTH_RATE_DPS = 15.041 / 3600
HISTORY_STEP_S = 0.05


def make(case: Case, folder: str | Path) -> Truth:
    """Writes the session of `case` into `folder` (made if absent) and returns what was planted."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    setup = Setup(case)
    truth = Truth(case, setup.scale, setup.bias_dps, setup.chip.white_sd_dps, setup.lsb_dps)
    n = int(case.seconds * case.poll_hz)
    drift = np.zeros((3, 1))
    entries = []
    for run, plan in enumerate(setup.plans):
        random = random_of(case, "run", run)
        first = setup.first_of_cycle(plan)
        gap_s = np.inf if first is plan else plan.start_time_s - setup.plans[run - 1].start_time_s - case.seconds
        drift = chip.ornstein_uhlenbeck(case, random, n, drift[:, -1], gap_s)
        recorded, columns = _record(setup, run, drift, random)
        _write(pl.DataFrame(columns), folder / recorded.file)
        entries.append(_entry(recorded))
        truth.runs.append(recorded)
    (folder / "session.toml").write_text("\n".join([*_head(case, setup.lsb_dps), *entries, ""]), encoding="utf-8")
    return truth


class Setup:
    """What holds for the whole session: the sensor on its table, the plan of the runs, the climate, the jumps."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.chip = Chip(case)
        self.plans = plans_of(case)
        self.climate = Climate(case, self.plans)
        self.jumps = jumps_of(case, self.plans)
        sensor = random_of(case, "sensor")
        self.scale: Array = np.clip(sensor.normal(0.0, 0.004, 3), -0.01, 0.01)
        if case.largest_scale is not None:
            self.scale = sensor.uniform(-case.largest_scale, case.largest_scale, 3)
        self.bias_dps: Array = sensor.uniform(-case.largest_bias_dps, case.largest_bias_dps, 3)
        self.tilt = np.radians(sensor.uniform(0.1, 0.5))
        self.lsb_dps = chip.LSB_PER_FULL_SCALE * case.full_scale_dps
        self.clock_error = next((e.parameters["e"] for e in case.effects if e.id == "clock_error"), 0.0)
        self.fine_s = self.chip.times(case.seconds * (1 + self.clock_error))

    def first_of_cycle(self, plan: Plan) -> Plan:
        """The first run of the power cycle that `plan` belongs to."""
        return next(other for other in self.plans if other.scenario == plan.scenario)

    def jumps_dps(self, run: int, plan: Plan) -> Array:
        """The steps planted in this power cycle so far, [n] on the fine time base."""
        jumps_dps = np.zeros_like(self.fine_s)
        for at_run, at_s, size_dps in self.jumps:
            if at_run <= run and self.plans[at_run].scenario == plan.scenario:
                jumps_dps += size_dps * (self.fine_s + plan.start_time_s >= at_s + self.plans[at_run].start_time_s)
        return jumps_dps


def _world(setup: Setup, run: int, motion: Motion) -> World:
    plan, t_s = setup.plans[run], setup.fine_s
    temp_c, temp_slope = setup.climate(plan, t_s)
    first = setup.first_of_cycle(plan)
    since_first_s = np.arange(first.start_time_s - plan.start_time_s, t_s[-1] + HISTORY_STEP_S, HISTORY_STEP_S)
    vibration_g = _vibration(setup.case, run, t_s)
    acceleration_g = in_sensor_frame(
        setup.case.table_axis, plan.face, np.sin(setup.tilt), np.cos(setup.tilt), motion.angle_deg
    )
    acceleration_g[AXES.index(setup.case.table_axis)] += vibration_g
    return World(
        t_s=t_s,
        power_on_s=t_s + plan.start_time_s - plan.power_on_time_s,
        cycle_s=t_s + plan.start_time_s - setup.first_of_cycle(plan).start_time_s,
        rate_dps=motion.rate_dps,
        reference_dps=motion.reference_dps,
        table_angle_deg=motion.angle_deg,
        temp_c=temp_c,
        temp_slope_c_s=temp_slope,
        acceleration_g=acceleration_g,
        seconds=setup.case.seconds,
        jumps_dps=setup.jumps_dps(run, plan),
        random=random_of(setup.case, "effects", run),
        vibration_g=vibration_g,
        cycle_temp=(since_first_s, setup.climate(plan, since_first_s)[0]),
    )


def _vibration(case: Case, run: int, t_s: Array) -> Array:
    """A motor's shaking of the run's own strength, which comes and goes over several seconds."""
    if case.vibration_g == 0.0:
        return np.zeros_like(t_s)
    random = random_of(case, "vibration", run)
    f_hz = case.poll_hz * random.uniform(0.08, 0.2)
    strength_g = case.vibration_g * np.sqrt(2) * np.abs(np.sin(np.pi * (t_s / random.uniform(8, 20) + random.random())))
    return strength_g * np.sin(2 * np.pi * (f_hz * t_s + random.random()))


def _record(setup: Setup, run: int, drift: Array, random: np.random.Generator) -> tuple[RunTruth, dict[str, Array]]:
    """One run: its truth and the columns of its file. `drift` [3, n] is in dps."""
    case, plan = setup.case, setup.plans[run]
    n = drift.shape[1]
    # the host's clock reads t_s; the world is at (1 + e) t_s
    t_s = np.arange(n) / case.poll_hz + np.abs(random.normal(0.0, chip.POLL_JITTER_S, n))
    t_s = np.round(t_s - t_s[0], 6)
    index = setup.chip.newest(t_s * (1 + setup.clock_error))
    moved = motion(case.protocol, plan, setup.fine_s, case.seconds, setup.clock_error, random)
    world = _world(setup, run, moved)

    injected = _injected(setup, world, index)
    rate = setup.chip.low_pass(moved.reference_dps)[index]
    earth = _earth(case, plan, moved.angle_deg[index])
    turn_on = case.turn_on_sd_dps * random_of(case, "turn_on", plan.scenario).standard_normal(3)
    power_cycle_bias = setup.bias_dps + turn_on
    analogue = power_cycle_bias[:, None] + earth + drift + setup.chip.noise(random, len(setup.fine_s), index)
    axis = AXES.index(case.table_axis)
    analogue[axis] += (1 + setup.scale[axis]) * rate
    for added in injected.values():
        analogue += added
    reading, changes = chip.digitise(case, analogue, setup.lsb_dps, random)

    # the encoder's rate and angle reach the reading's time through one filter, so that neither shows the chip's delay
    angle_deg = setup.chip.low_pass(moved.angle_deg)[index] if plan.moves else moved.angle_deg[index]
    columns = {"t_s": t_s} | {f"g{name}_dps": reading[i] for i, name in enumerate(AXES)}
    columns |= _other_columns(case, world, t_s, index, random)
    if plan.moves:
        columns["rate_ref_dps"] = rate + case.reference_sd_dps * random_of(case, "reference", run).standard_normal(n)
    if case.table_angle:
        columns["table_angle_deg"] = angle_deg
    return RunTruth(
        file=f"{run:03d}_{plan.face}.{case.file_format}",
        scenario=f"s{plan.scenario:03d}",
        face=plan.face,
        day=plan.day,
        power_on_s=round(plan.start_time_s - plan.power_on_time_s, 3),
        table_rate_dps=None if plan.moves else plan.table_rate_dps,
        t_s=t_s,
        rate_dps=rate,
        temp_c=world.temp_c[index],
        table_angle_deg=angle_deg,
        acceleration_g=world.acceleration_g[:, index],
        cycle_s=world.cycle_s[index],
        scale=setup.scale,
        bias_dps=power_cycle_bias,
        drift_dps=drift,
        earth_dps=earth,
        injected_dps=injected | changes,
    ), columns


def _injected(setup: Setup, world: World, index: NDArray[np.int64]) -> dict[str, Array]:
    """What each effect of the analogue side adds to the reading, [3, n] in dps."""
    injected: dict[str, Array] = {}
    for effect in setup.case.effects:
        if effect.id in chip.DIGITAL:
            continue
        signal = setup.chip.low_pass(SIGNALS[effect.id](effect.parameters, world))[index]
        added = injected.setdefault(effect.id, np.zeros((3, len(index))))
        for name in effect.axes:
            added[AXES.index(name)] += signal
    return injected


def _earth(case: Case, plan: Plan, angle_deg: Array) -> Array:
    """Earth's rotation in the sensor, [3, n] in dps; zero where the session states no latitude."""
    if case.latitude_deg is None:
        return np.zeros((3, len(angle_deg)))
    latitude = np.radians(case.latitude_deg)
    north, vertical = EARTH_RATE_DPS * np.cos(latitude), EARTH_RATE_DPS * np.sin(latitude)
    return in_sensor_frame(case.table_axis, plan.face, north, vertical, angle_deg)


def _other_columns(
    case: Case, world: World, t_s: Array, index: NDArray[np.int64], random: np.random.Generator
) -> dict[str, Array]:
    """The accelerometer, where there is one, and the thermometer, whose output rate is lower."""
    columns = {}
    if case.accelerometer:
        measured_g = world.acceleration_g[:, index] + chip.ACCELEROMETER_NOISE_G * random.standard_normal((3, len(t_s)))
        counts = np.round(measured_g / chip.ACCELEROMETER_LSB_G)
        columns |= {f"a{name}_g": chip.ACCELEROMETER_LSB_G * counts[i] for i, name in enumerate(AXES)}
    held = np.searchsorted(t_s, np.floor(t_s * chip.TEMPERATURE_ODR_HZ) / chip.TEMPERATURE_ODR_HZ)
    measured_c = (world.temp_c[index] + chip.TEMPERATURE_NOISE_C * random.standard_normal(len(t_s)))[held]
    columns["temp_c"] = chip.TEMPERATURE_LSB_C * np.round(measured_c / chip.TEMPERATURE_LSB_C)
    return columns


def in_sensor_frame(table_axis: str, face: str, in_plane: float, along: float, angle_deg: Array) -> Array:
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


def _write(frame: pl.DataFrame, path: Path) -> None:
    if path.suffix == ".parquet":
        frame.write_parquet(path)
    else:
        frame.write_csv(path, float_precision=6)


def _head(case: Case, lsb_dps: float) -> list[str]:
    """The lines of session.toml before its runs."""
    head = [
        'format = "gyrocal-session/1"',
        'sensor = "LSM6DSO"',
        f'axis = "{case.table_axis}"',
        f"sample_rate_hz = {case.poll_hz!r}",
        f"full_scale_dps = {case.full_scale_dps!r}",
        f"lsb_dps = {lsb_dps:.6f}",
    ]
    if case.latitude_deg is not None:
        head.append(f"latitude_deg = {case.latitude_deg!r}")
    if case.reference_sd_dps:
        head += ["", "[reference]", f"ref_noise_dps = {case.reference_sd_dps!r}"]
    return head


def _entry(run: RunTruth) -> str:
    """The lines of session.toml about one run."""
    entry = ["", "[[run]]", f'file = "{run.file}"', f'scenario = "{run.scenario}"', f'face = "{run.face}"']
    if run.table_rate_dps is not None:
        entry.append(f"table_rate_dps = {run.table_rate_dps!r}")
    return "\n".join([*entry, f"day = {run.day}", f"power_on_s = {run.power_on_s!r}"])
