"""One recording in memory: how the sensor moved, what it read, and the folder that is written of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator
AXES = "xyz"
LSB_G = 61e-6
ACCELEROMETER_NOISE_G = 1e-3


@dataclass(frozen=True)
class Sensor:
    """Scale, bias and noise of one sensor, the same on all axes but for scale and bias."""

    rate_hz: float
    scale: Array
    bias_dps: Array
    density_dps: float  # per sqrt(Hz), one-sided
    cutoff_hz: float | None
    ou_sd_dps: float
    ou_tau_s: float
    turn_on_sd_dps: float
    lsb_dps: float = 0.00875
    full_scale_dps: float = 250.0

    @property
    def white_sd_dps(self) -> float:
        """Standard deviation of one sample before the digital low-pass."""
        return float(self.density_dps * np.sqrt(self.rate_hz / 2))


@dataclass
class Run:
    """One run. Arrays [n], or [3, n] over the sensor's axes; ``w_at`` gives the true rates [3, n] at any times."""

    scenario: int
    day: int
    face: str
    axis: int  # of the rotation
    t_s: Array
    start_s: float  # since the session began
    power_on_s: float  # of the first sample, since power-on
    cycle_s: float  # of the first sample, since the power cycle's first sample
    w_at: Callable[[Array], Array]
    angle_deg: Array
    temp_c: Array
    acc_g: Array
    stated_dps: float | None = None  # the table's constant rate
    turn_deg: float | None = None  # the known net angle
    segments: tuple[tuple[slice, bool], ...] = ()  # (rows, is only the net angle known?); empty: all rates are known
    w: Array = field(init=False)
    ref_error: Array = field(init=False)
    """What the reference's rates are off, [3, n] in the sensor's frame."""

    def __post_init__(self) -> None:
        self.w = self.w_at(self.t_s)
        self.ref_error = np.zeros_like(self.w)

    @property
    def rate(self) -> Array:
        """The true rate about the axis of rotation, in the sensor's sign."""
        return np.asarray(self.w[self.axis])

    @property
    def moves(self) -> bool:
        return self.stated_dps is None and self.turn_deg is None

    @property
    def side(self) -> float:
        return 1.0 if self.face == "up" else -1.0


@dataclass
class Recording:
    """A session: its runs, what columns its files have, and its reference."""

    protocol: str
    sensor: Sensor
    runs: list[Run]
    axis: int
    reference: str  # "stated", "rate", "angle", "three", "turns" or "gravity"
    ref_noise_dps: float = 0.0
    turn_se_deg: float = 0.0
    angle_step_deg: float = 1e-5  # of an encoder's angle
    has_temp: bool = True
    temp_step_c: float = 1 / 256
    has_acc: bool = True
    has_angle: bool = False
    offset_s: float = 0.0  # of the reference's own clock
    turned: Array = field(default_factory=lambda: np.eye(3))  # from the sensor's frame to the reference's
    varies: bool = False  # does the temperature turn round within a run?

    @property
    def samples(self) -> int:
        return sum(run.t_s.size for run in self.runs)


def coloured(sensor: Sensor, random: Random, n: int) -> Array:
    """White noise [3, n] behind the low-pass."""
    from scipy.signal import butter, lfilter

    if sensor.cutoff_hz is None:
        return np.asarray(sensor.white_sd_dps * random.standard_normal((3, n)))
    b, a = butter(2, sensor.cutoff_hz, fs=sensor.rate_hz)
    warm = int(3 * sensor.rate_hz / sensor.cutoff_hz) + 20
    return np.asarray(lfilter(b, a, sensor.white_sd_dps * random.standard_normal((3, n + warm)), axis=1)[:, warm:])


def wander(sensor: Sensor, random: Random, runs: list[Run]) -> list[Array]:
    """Drift noise (Ornstein and Uhlenbeck) of the runs of one power cycle, [3, n] each, going on across the gaps."""
    from scipy.signal import lfilter

    out: list[Array] = []
    at, end_s = sensor.ou_sd_dps * random.standard_normal(3), runs[0].start_s
    for run in runs:
        keep = np.exp(-(run.start_s - end_s) / sensor.ou_tau_s)
        at = keep * at + sensor.ou_sd_dps * np.sqrt(1 - keep**2) * random.standard_normal(3)
        pole = np.exp(-1 / (sensor.rate_hz * sensor.ou_tau_s))
        kicks = sensor.ou_sd_dps * np.sqrt(1 - pole**2) * random.standard_normal((3, run.t_s.size))
        kicks[:, 0] = at
        out.append(lfilter([1.0], [1.0, -pole], kicks, axis=1))
        at, end_s = out[-1][:, -1], run.start_s + run.t_s[-1]
    return out


def refer(made: Recording, random: Random) -> None:
    """Draw the errors of the reference, and give the sensor a range that holds the motion."""
    fastest = 1.1 * max(float(np.abs(run.w).max()) for run in made.runs)
    ranges = [made.sensor.full_scale_dps, *(r for r in (250.0, 500.0, 1000.0, 2000.0) if r > made.sensor.full_scale_dps)]
    full_scale = next(r for r in ranges if r > fastest)
    sensor = made.sensor  # no count is coarser than the noise, so that rounding adds noise alone
    noise_dps = sensor.white_sd_dps * (1.0 if sensor.cutoff_hz is None else np.sqrt(2.2 * sensor.cutoff_hz / sensor.rate_hz))
    made.sensor = replace(sensor, full_scale_dps=full_scale, lsb_dps=min(35e-6 * full_scale, round(noise_dps, 5)))
    for run in made.runs:
        error = made.ref_noise_dps * random.standard_normal(run.w.shape)
        if made.reference == "three":
            run.ref_error = error
        elif made.reference == "rate":
            run.ref_error[run.axis] = error[run.axis]


def analogue(made: Recording, random: Random) -> list[Array]:
    """What an ideal converter would read without any effect, [3, n] of each run."""
    found: list[Array] = []
    for scenario in dict.fromkeys(run.scenario for run in made.runs):
        runs = [run for run in made.runs if run.scenario == scenario]
        turn_on = made.sensor.turn_on_sd_dps * random.standard_normal(3)
        drifts = wander(made.sensor, random, runs)
        for run, drift in zip(runs, drifts, strict=True):
            w = (1 + made.sensor.scale)[:, None] * run.w + (made.sensor.bias_dps + turn_on)[:, None]
            found.append(w + drift + coloured(made.sensor, random, run.t_s.size))
    return found


def counts(made: Recording, readings: list[Array]) -> list[Array]:
    """Readings clipped at full scale and rounded to counts."""
    lsb, most = made.sensor.lsb_dps, made.sensor.full_scale_dps
    return [lsb * np.round(np.clip(reading, -most, most) / lsb) for reading in readings]


def _held(run: Run, rate_hz: float, random: Random, step_c: float) -> Array:
    """A thermometer with its own noise, output rate (10 Hz) and steps."""
    every = max(1, int(rate_hz / 10))
    source = np.arange(run.t_s.size) // every * every
    measured = run.temp_c + 0.02 * random.standard_normal(run.t_s.size)
    return np.asarray(step_c * np.round(measured[source] / step_c))


def _columns(made: Recording, run: Run, reading: Array, random: Random) -> dict[str, Array]:
    n = run.t_s.size
    columns = {"t_s": run.t_s} | {f"g{a}_dps": reading[i] for i, a in enumerate(AXES)}
    if made.has_acc:
        g = run.acc_g + ACCELEROMETER_NOISE_G * random.standard_normal((3, n))
        columns |= {f"a{a}_g": LSB_G * np.round(g[i] / LSB_G) for i, a in enumerate(AXES)}
    if made.has_temp:
        columns["temp_c"] = _held(run, made.sensor.rate_hz, random, made.temp_step_c)
    if made.has_angle:
        columns["table_angle_deg"] = run.angle_deg
    if made.reference == "rate" and run.moves:
        columns["rate_ref_dps"] = run.rate + run.ref_error[run.axis]
    if made.reference == "angle" and run.moves:
        columns["ref_angle_deg"] = made.angle_step_deg * np.round(run.side * run.angle_deg / made.angle_step_deg)
    if made.reference == "three":
        seen = made.turned @ (run.w_at(run.t_s + made.offset_s) + run.ref_error)
        columns |= {f"ref_{a}_dps": seen[i] for i, a in enumerate(AXES)}
    return columns


def write(made: Recording, readings: list[Array], folder: Path, random: Random) -> None:
    """Write the session of these readings, [3, n] of each run."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [
        'format = "gyrocal-session/1"', 'sensor = "simulated"', f'axis = "{AXES[made.axis]}"',
        f"sample_rate_hz = {made.sensor.rate_hz}", f"full_scale_dps = {made.sensor.full_scale_dps}",
        f"lsb_dps = {made.sensor.lsb_dps}",
    ]  # fmt: skip
    reference = {"three": ['clock = "own"'], "gravity": ['kind = "gravity"']}.get(made.reference, [])
    if made.ref_noise_dps and made.reference in ("rate", "three"):
        reference = [*reference, f"ref_noise_dps = {made.ref_noise_dps:.6g}"]
    lines += ["", "[reference]", *reference] if reference else []
    for i, (run, reading) in enumerate(zip(made.runs, readings, strict=True)):
        name = f"{i:03d}_{run.face}.parquet"
        pl.DataFrame(_columns(made, run, reading, random)).write_parquet(folder / name)
        lines += ["", "[[run]]", f'file = "{name}"', f'scenario = "s{run.scenario:03d}"', f'face = "{run.face}"']
        if run.axis != made.axis:
            lines.append(f'axis = "{AXES[run.axis]}"')
        if run.stated_dps is not None:
            lines.append(f"table_rate_dps = {run.stated_dps!r}")
        if run.turn_deg is not None:
            lines += [f"turn_deg = {run.turn_deg!r}", f"turn_se_deg = {made.turn_se_deg!r}"]
        lines += [f"day = {run.day}", f"power_on_s = {run.power_on_s:.3f}"]
    (folder / "session.toml").write_text("\n".join([*lines, ""]), encoding="utf-8")
