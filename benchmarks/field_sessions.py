"""Sessions as users bring them, with known truth, written to folders of the session format.

The physics here is written apart from the library, which this file does not import: what both get wrong would stay unseen.
Here are those without an effect; a session is a function of its kind and its seed alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter

Array = np.ndarray
Rng = np.random.Generator
OfTime = Callable[[Array], Any]
AXES = "xyz"
LSB_DPS, LSB_G, STEP_C = 0.00875, 6.1e-5, 1 / 16


def log_uniform(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def sign(rng: Rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


class Part:
    """One sensor: scale and bias of each axis, white noise, a slow drift, offsets of power cycles. z is the table's axis."""

    def __init__(
        self, rng: Rng, rate_hz: float, white_dps: float | None = None, drifts: bool = True, lsb_dps: float = LSB_DPS
    ) -> None:
        self.rng, self.rate_hz, self.lsb_dps = rng, rate_hz, lsb_dps
        self.scale, self.bias_dps = rng.uniform(-0.02, 0.02, 3), rng.uniform(-5, 5, 3)
        density = None if white_dps is not None else log_uniform(rng, 0.004, 0.008)  # dps/sqrt(Hz)
        self.white_dps = white_dps if density is None else density * np.sqrt(rate_hz / 2)
        self.drift_dps = rng.uniform(0.001, 0.004, 3) if drifts else np.zeros(3)
        self.drift_s = log_uniform(rng, 30, 300)
        self.turn_on_dps = np.array([log_uniform(rng, 0.002, 0.020) for _ in AXES])
        self.turn_on_scale = rng.uniform(0, 100e-6)
        self.flicker_dps = 0.0
        """Bias instability B: the one-sided density is B^2 / (2 pi f)."""
        self.low_pass_hz: float | None = None
        self.correlation = 0.0
        self.freedom: float | None = None
        """Degrees of freedom of Student's t, of which the noise is drawn in place of a normal distribution."""
        self.cycles: dict[str, tuple[Array, Array]] = {}

    def cycle(self, name: str) -> tuple[Array, Array]:
        """Offset, deg/s, and scale of a power cycle on each axis."""
        if name not in self.cycles:
            self.cycles[name] = (self.rng.normal(0, self.turn_on_dps), self.rng.normal(0, self.turn_on_scale, 3))
        return self.cycles[name]

    def noise(self, n: int, level: Array | float) -> Array:
        """Noise [n, 3] in deg/s; ``level`` is that of the white part, one value or [n]."""
        rng, rate_hz = self.rng, self.rate_hz
        warm = int(3 * rate_hz / self.low_pass_hz) + 20 if self.low_pass_hz else 0
        shape = (n + warm, 3)
        if self.freedom:
            out = rng.standard_t(self.freedom, shape) / np.sqrt(self.freedom / (self.freedom - 2))
        else:
            out = rng.normal(size=shape)
        if self.correlation:
            cov = np.full((3, 3), self.correlation) + (1 - self.correlation) * np.eye(3)
            out = out @ np.linalg.cholesky(cov).T
        if self.low_pass_hz:
            b, a = butter(2, self.low_pass_hz, fs=rate_hz)
            out = lfilter(b, a, out, axis=0)[warm:]
        out = out * self.white_dps * np.reshape(level, (-1, 1))
        for axis in range(3):
            if self.drift_dps[axis]:
                kept = np.exp(-1 / rate_hz / self.drift_s)
                pushed = rng.normal(size=n) * np.sqrt(1 - kept * kept)
                pushed[0] = rng.normal()
                out[:, axis] += self.drift_dps[axis] * lfilter([1], [1, -kept], pushed)
            if self.flicker_dps:
                out[:, axis] += self._flicker(n)
        return out

    def _flicker(self, n: int) -> Array:
        """Flicker noise [n], deg/s, down to an eighth of the run's lowest frequency."""
        padded = 1 << int(np.ceil(np.log2(n * 8)))
        frequency_hz = np.fft.rfftfreq(padded, 1 / self.rate_hz)
        size = np.zeros(frequency_hz.size)
        size[1:] = np.sqrt(self.flicker_dps**2 / (2 * np.pi) / frequency_hz[1:] * self.rate_hz * padded / 2)
        phasors = self.rng.normal(size=size.size) + 1j * self.rng.normal(size=size.size)
        return np.fft.irfft(size * phasors / np.sqrt(2), padded)[:n]

    def read(self, rate_dps: Array, cycle: str, extra_dps: Array | float, level: Array | float) -> Array:
        """Readings [n, 3], deg/s, of the true rate [n] about z."""
        offset_dps, scale = self.cycle(cycle)
        out = self.bias_dps + offset_dps + self.noise(rate_dps.size, level)
        out[:, 2] += (1 + self.scale[2] + scale[2]) * rate_dps + extra_dps
        return np.round(out / self.lsb_dps) * self.lsb_dps


@dataclass
class Recording:
    """A session in the making: its runs, and what is planted in it (an effect's id and its parameters)."""

    seed: int
    rng: Rng
    effect: str | None = None
    planted: dict[str, float] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)
    runs: list[tuple[dict[str, Array], dict[str, Any]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.accelerometer = bool(self.rng.random() < 0.4)

    def part(self, rate_hz: float, **values: Any) -> Part:
        self.sensor = Part(self.rng, rate_hz, **values)
        return self.sensor

    def plant(self, effect: str, **parameters: float) -> None:
        self.effect, self.planted = effect, parameters

    def add(
        self, seconds: float, cycle: str, face: str = "up", table_dps: float | None = None, *, rate_dps: Array | None = None,
        reference_dps: Array | None = None, shown_dps: Array | None = None, temp_c: OfTime | None = None,
        thermometer: str = "there", temp_step_c: float = 0.0, extra_dps: Callable[[Array, Array, Array], Array] | None = None,
        level: Array | float = 1.0, power_on_s: float | None = None,
    ) -> None:  # fmt: skip
        """A run at the table's rate, or with the true rate [n] (sensor's sign) and the reference's column of it.

        ``shown_dps`` is the rate that the sensor sees, if another; ``extra_dps`` is the planted effect on z, of time,
        rate and temperature. ``thermometer`` is "there", "empty" or "absent".
        """
        rng, hz = self.rng, self.sensor.rate_hz
        t_s = np.arange(round(seconds * hz)) / hz
        if rate_dps is None:
            assert table_dps is not None
            rate_dps = np.full(t_s.size, table_dps * (1 if face == "up" else -1.0))
        true_c = np.full(t_s.size, 25.0) if temp_c is None else np.asarray(temp_c(t_s), float)
        extra = extra_dps(t_s, rate_dps, true_c) if extra_dps else 0.0
        readings = self.sensor.read(rate_dps if shown_dps is None else shown_dps, cycle, extra, level)
        columns = {"t_s": t_s} | {f"g{a}_dps": readings[:, k] for k, a in enumerate(AXES)}
        if self.accelerometer:
            tilt = rng.normal(0, 0.01, 2)
            for a, g in zip(AXES, (tilt[0], tilt[1], 1.0 if face == "up" else -1.0), strict=True):
                columns[f"a{a}_g"] = np.round((g + rng.normal(0, 0.003, t_s.size)) / LSB_G) * LSB_G
        if temp_c is not None:
            measured_c = true_c + rng.normal(0, 0.03, t_s.size)
            if temp_step_c:
                measured_c = np.round(measured_c / temp_step_c) * temp_step_c
            if thermometer != "absent":
                columns["temp_c"] = measured_c if thermometer == "there" else np.full(t_s.size, np.nan)
        if reference_dps is not None:
            columns["rate_ref_dps"] = reference_dps
        said = {"table_rate_dps": None if reference_dps is not None else table_dps, "power_on_s": power_on_s}
        self.runs.append((columns, {"scenario": cycle, "face": face, **said}))

    def write(self, folder: Path) -> dict[str, Any]:
        """Write the session; return its truth. Of a single power cycle, the scale is that of this cycle."""
        folder.mkdir(parents=True, exist_ok=True)
        lines = [
            'format = "gyrocal-session/1"', 'sensor = "simulated"', 'axis = "z"', f"sample_rate_hz = {self.sensor.rate_hz}",
            f"lsb_dps = {self.sensor.lsb_dps}",
        ]  # fmt: skip
        for i, (columns, said) in enumerate(self.runs):
            name = f"{i:03d}_{said['face']}.csv"
            lines += ["", "[[run]]", f'file = "{name}"', f'scenario = "{said["scenario"]}"', f'face = "{said["face"]}"']
            lines += [f"{key} = {float(said[key])}" for key in ("table_rate_dps", "power_on_s") if said[key] is not None]
            cells = [["" if np.isnan(x) else f"{x:.6f}" for x in column.tolist()] for column in columns.values()]
            rows = map(",".join, zip(*cells, strict=True))
            (folder / name).write_text(",".join(columns) + "\n" + "\n".join(rows) + "\n", encoding="utf-8")
        (folder / "session.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        own = [scale for _, scale in self.sensor.cycles.values()]
        scale = float(self.sensor.scale[2] + (own[0][2] if len(own) == 1 else 0.0))
        rows_in_all = sum(columns["t_s"].size for columns, _ in self.runs)
        return {"effect": self.effect, "planted": self.planted, "scale": scale, "notes": self.notes, "rows": rows_in_all}


def pairs(made: Recording, seconds: float, cycles: int | None = None, **each: Any) -> None:
    """Power cycles of a run face up and one face down at 78 deg/s; ``each`` are functions of the cycle's and run's number."""
    for i in range(cycles or int(made.rng.integers(6, 11))):
        for j, face in enumerate(("up", "down")):
            made.add(seconds, f"s{i:03d}", face, 78.0, **{k: of(i, j) if callable(of) else of for k, of in each.items()})


def staircase(rng: Rng, seconds: float, rate_hz: float) -> Array:
    """A staircase of rates both ways, with ramps of 100 deg/s^2."""
    top_dps, dwell_s = rng.choice([60, 100, 200]), rng.uniform(6, 14)
    steps = [0, 0.25, 0.5, 1, 0.5, 0.25, 0, -0.25, -0.5, -1, -0.5, -0.25]
    t_s = np.arange(round(seconds * rate_hz)) / rate_hz
    goal = np.array([steps[int(t // dwell_s) % len(steps)] * top_dps for t in t_s])
    out = np.empty(t_s.size)
    out[0] = goal[0]
    for k in range(1, t_s.size):
        out[k] = out[k - 1] + np.clip(goal[k] - out[k - 1], -100 / rate_hz, 100 / rate_hz)
    return out


def swing(rng: Rng, sines: int = 1) -> Callable[[Array], Array]:
    """A smooth motion, as a function of time."""
    parts = [
        (rng.uniform(30, 100) / sines**0.5, log_uniform(rng, 0.05, 0.4), rng.uniform(0, 2 * np.pi)) for _ in range(sines)
    ]
    return lambda t_s: np.asarray(sum(size * np.sin(2 * np.pi * hz * t_s + phase) for size, hz, phase in parts))


def encoder(rng: Rng, rate_dps: Array, sd_dps: float, step_dps: float) -> Array:
    """A reference's column [n]: the rate with white noise, in steps."""
    noisy = rate_dps + rng.normal(0, sd_dps, rate_dps.size) if sd_dps else rate_dps
    return np.round(noisy / step_dps) * step_dps if step_dps else noisy


def room(rng: Rng) -> Callable[..., Array]:
    """A room's temperature over time, degC."""
    start_c, slope, period_s = rng.uniform(21, 26), rng.uniform(-1, 1), rng.uniform(600, 3000)
    phase = rng.uniform(0, 6.28)
    return lambda t, at=0.0: start_c + slope * (t + at) / 1000 + 0.3 * np.sin(2 * np.pi * (t + at) / period_s + phase)


def in_room(made: Recording) -> Callable[[int, int], OfTime]:
    """The room's temperature in each run, by one clock over the session."""
    temp_c, gap_s = room(made.rng), made.rng.uniform(30, 120)
    return lambda i, j: lambda t: temp_c(t, (2 * i + j) * gap_s)


def any_protocol(made: Recording, level: Callable[[int], Any] = lambda n: 1.0) -> None:
    """Whatever a user may do at 100 Hz: pairs, one long run, a staircase or one static run; ``level`` is that of a run."""
    rng, hz = made.rng, 100.0
    what = str(rng.choice(["pairs", "pairs", "long", "stairs", "static"]))
    made.notes["protocol"] = what
    if what == "pairs":
        temp_c, cycles = in_room(made), int(rng.integers(6, 11))
        seconds = min(25, 45000 / hz / 2 / cycles)
        pairs(made, seconds, cycles, temp_c=temp_c, level=lambda i, j: level(round(seconds * hz)))
    elif what in ("long", "static"):
        temp_c = room(rng)
        made.add(400, "s000", "up", 78.0 if what == "long" else 0.0, temp_c=temp_c, level=level(40000))
    else:
        for i in range(2):
            rate_dps = staircase(rng, 200, hz)
            made.add(200, f"s{i:03d}", rate_dps=rate_dps, reference_dps=rate_dps, level=level(rate_dps.size))


def plain(made: Recording) -> None:
    made.part(100.0)
    any_protocol(made)


def lowpass(made: Recording) -> None:
    hz = float(made.rng.choice([100.0, 145.0, 208.0, 400.0, 500.0]))
    sensor = made.part(hz)
    sensor.low_pass_hz = log_uniform(made.rng, 5, 42)
    cycles = int(made.rng.integers(6, 9))
    pairs(made, min(20, 50000 / hz / 2 / cycles), cycles, temp_c=in_room(made))


def flicker(made: Recording) -> None:
    sensor = made.part(20.0, drifts=False)
    sensor.flicker_dps = log_uniform(made.rng, 0.002, 0.012)
    temp_c, what = room(made.rng), str(made.rng.choice(["static", "long", "pairs"]))
    made.notes["protocol"] = what
    seconds = made.rng.uniform(300, 1200)
    if what == "pairs":
        pairs(made, 300, 3, temp_c=lambda i, j: lambda t: temp_c(t, (2 * i + j) * 320))
        return
    for i in range(2):
        made.add(seconds, f"s{i:03d}", "up", 78.0 if what == "long" else 0.0, temp_c=lambda t, i=i: temp_c(t, i * 1300))


def _encoded(made: Recording, motion: Callable[[], Array]) -> None:
    """Three runs of a motion that a noisy, coarse encoder records."""
    sd_dps, step_dps = made.rng.uniform(0.02, 0.05), float(made.rng.choice([0.02, 0.05]))
    for i in range(3):
        rate_dps = motion()
        made.add(200, f"s{i:03d}", rate_dps=rate_dps, reference_dps=encoder(made.rng, rate_dps, sd_dps, step_dps))


def encoder_stairs(made: Recording) -> None:
    made.part(50.0)
    _encoded(made, lambda: staircase(made.rng, 200, 50.0))


def encoder_swing(made: Recording) -> None:
    made.part(50.0)
    _encoded(made, lambda: swing(made.rng, int(made.rng.integers(1, 3)))(np.arange(10_000) / 50.0))


def exact_swing(made: Recording) -> None:
    made.part(100.0)
    for i in range(2):
        rate_dps = swing(made.rng, int(made.rng.integers(1, 3)))(np.arange(15_000) / 100.0)
        made.add(150, f"s{i:03d}", rate_dps=rate_dps, reference_dps=rate_dps)


def exact_stairs(made: Recording) -> None:
    made.part(100.0)
    for i in range(2):
        rate_dps = staircase(made.rng, 200, 100.0)
        made.add(200, f"s{i:03d}", rate_dps=rate_dps, reference_dps=rate_dps)


def level_in_run(made: Recording) -> None:
    made.part(100.0)
    factor, ramp = made.rng.uniform(1.5, 3), made.rng.random() < 0.5

    def level(n: int) -> Array:
        if ramp:
            return np.geomspace(1, factor, n)
        return np.where(np.arange(n) < n * made.rng.uniform(0.3, 0.7), 1.0, factor)

    any_protocol(made, level)


def level_between(made: Recording) -> None:
    made.part(100.0)
    factor = made.rng.uniform(1.5, 3)
    pairs(made, 20, None, temp_c=in_room(made), level=lambda i, j: float(made.rng.choice([1.0, factor])))


def correlated(made: Recording) -> None:
    made.part(100.0).correlation = made.rng.uniform(0.3, 0.9)
    any_protocol(made)


def heavy_tails(freedom: float) -> Callable[[Recording], None]:
    def kind(made: Recording) -> None:
        made.part(100.0).freedom = freedom
        any_protocol(made)

    return kind


def thermometer(made: Recording) -> None:
    made.part(50.0)
    temp_c = room(made.rng)
    if made.rng.random() < 0.6:
        gap_s = made.rng.uniform(60, 300)
        pairs(made, 40, None, temp_c=lambda i, j: lambda t: temp_c(t, (2 * i + j) * gap_s), temp_step_c=STEP_C)
    else:
        made.add(900, "s000", "up", float(made.rng.choice([0, 78])), temp_c=temp_c, temp_step_c=STEP_C)


def forty_min(made: Recording) -> None:
    made.part(10.0)
    temp_c = room(made.rng)
    if made.rng.random() < 0.5:
        pairs(made, 2400, 1, temp_c=lambda i, j: lambda t: temp_c(t, j * 2500), temp_step_c=STEP_C)
    else:
        made.add(2400, "s000", "up", 78.0, temp_c=temp_c, temp_step_c=STEP_C)


def khz(made: Recording) -> None:
    made.part(1000.0)
    cycles = int(made.rng.integers(3, 6))
    pairs(made, 25 / cycles, cycles)


def ten_hz(made: Recording) -> None:
    made.part(10.0)
    pairs(made, made.rng.uniform(60, 150), None, temp_c=in_room(made))


def coarse(made: Recording) -> None:
    made.part(100.0, white_dps=made.rng.uniform(0.02, 0.06), lsb_dps=float(made.rng.choice([0.0625, 0.07, 0.1])))
    any_protocol(made)


def static_hours(made: Recording) -> None:
    made.part(5.0)
    temp_c, runs = room(made.rng), int(made.rng.integers(1, 4))
    for i in range(runs):
        made.add(9000 / runs, f"s{i:03d}", "up", 0.0, temp_c=lambda t, i=i: temp_c(t, i * 10000 / runs), temp_step_c=STEP_C)
