"""What each effect adds to the rate that the sensor senses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter, lfilter_zi

from .case import AXES, Array


@dataclass
class World:
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
    vibration_g: Array  # along the table's axis, part of the acceleration
    cycle_temp: tuple[Array, Array]  # t_s and temperature, from the power cycle's first sample to the run's end
    random: np.random.Generator


def _orders(p: Mapping[str, float], angle_deg: Array) -> Array:
    orders = [name.removeprefix("amplitude_") for name in p if name.startswith("amplitude_")]
    angle = np.radians(angle_deg)
    return np.sum(
        [p[f"amplitude_{k}"] * np.cos(float(k) * angle + np.radians(p[f"phase_{k}_deg"])) for k in orders], axis=0
    )


def _bias_temperature(p: Mapping[str, float], world: World) -> Array:
    dt = world.temp_c - 25.0
    return sum((p.get(f"k{n}_dps_per_c{n if n > 1 else ''}", 0.0) * dt**n for n in (1, 2, 3)), np.zeros_like(dt))


def _g_sensitivity(p: Mapping[str, float], world: World) -> Array:
    return np.array([p.get(f"g{axis}_dps_per_g", 0.0) for axis in AXES]) @ world.acceleration_g


def _vibration_tone(p: Mapping[str, float], world: World) -> Array:
    return p["A_dps"] * np.sin(2 * np.pi * (p["f_hz"] * world.t_s + world.random.random()))


def _lag(p: Mapping[str, float], world: World) -> Array:
    """First-order lag, discretised so that a ramp lags by exactly tau."""
    double = 2 * p["tau_s"] / np.diff(world.t_s[:2])[0]
    pole = (double - 1) / (double + 1)
    b, a = np.array([1.0, 1.0]) / (double + 1), np.array([1.0, -pole])
    lagged, _ = lfilter(b, a, world.rate_dps, zi=lfilter_zi(b, a) * world.rate_dps[0])
    return lagged - world.rate_dps


def _clock_error(p: Mapping[str, float], world: World) -> Array:
    """The table's programme is looked up at the device's wrong time."""
    return world.rate_dps - world.reference_dps


def _stick_slip(p: Mapping[str, float], world: World) -> Array:
    """The drive winds up and lets go: a sawtooth of the rate whose cycles differ in length."""
    cycles = int(4 * (world.seconds + 4) / p["period_s"])
    lengths = p["period_s"] * world.random.lognormal(0.0, p["spread"], size=cycles)
    edges = world.t_s[0] - p["period_s"] * world.random.random() + np.concatenate([[0.0], np.cumsum(lengths)])
    cycle = np.searchsorted(edges, world.t_s, side="right") - 1
    return world.rate_dps * p["amplitude"] * (0.5 - (world.t_s - edges[cycle]) / lengths[cycle])


def _gear_ripple(p: Mapping[str, float], world: World) -> Array:
    """Ripple of a gear whose ratio to the table is no whole number; its position is not the table's."""
    phase = 2 * np.pi * world.random.random()
    return world.rate_dps * p["amplitude"] * np.cos(np.radians(p["order"] * world.table_angle_deg) + phase)


def _mount_resonance(p: Mapping[str, float], world: World) -> Array:
    """The mount rings, driven by the floor: narrow-band noise."""
    step = np.diff(world.t_s[:2])[0]
    radius = np.exp(-np.pi * p["bandwidth_hz"] * step)
    a = [1.0, -2 * radius * np.cos(2 * np.pi * p["f_hz"] * step), radius**2]
    settle = int(3 / (np.pi * p["bandwidth_hz"] * step))
    ringing = lfilter([1.0], a, world.random.standard_normal(settle + len(world.t_s)))[settle:]
    # variance of an AR(2) process driven by unit noise
    gain = np.sqrt((1 + a[2]) / ((1 - a[2]) * ((1 + a[2]) ** 2 - a[1] ** 2)))
    return p["sd_dps"] / gain * ringing


def _fan_sweep(p: Mapping[str, float], world: World) -> Array:
    """A fan that speeds up through the run."""
    sweep = (p["f_end_hz"] - p["f_start_hz"]) / world.seconds
    start = p["f_start_hz"] + world.random.uniform(-2.0, 2.0)
    cycles = start * world.t_s + 0.5 * sweep * world.t_s**2 + world.random.random()
    return p["A_dps"] * np.sin(2 * np.pi * cycles)


def _order_tone(p: Mapping[str, float], world: World) -> Array:
    return p["A_dps"] * np.sin(np.radians(p["order"] * world.table_angle_deg + p["phase_deg"]))


def _dead_band(p: Mapping[str, float], world: World) -> Array:
    return np.where(np.abs(world.rate_dps) < p["width_dps"], -world.rate_dps, 0.0)


def play(temp_c: Array, width_c: float) -> Array:
    """Where the temperature came from, -1 to 1: the play operator, a loop of the given width, from its middle."""
    middle, at = np.empty_like(temp_c), temp_c[0]
    for i, now in enumerate(temp_c):
        at = min(max(at, now - width_c / 2), now + width_c / 2)
        middle[i] = at
    return (temp_c - middle) / (width_c / 2)


def _thermal_hysteresis(p: Mapping[str, float], world: World) -> Array:
    t_s, temp_c = world.cycle_temp
    return p["amplitude_dps"] * np.interp(world.t_s, t_s, play(temp_c, p["width_c"]))


def _two_point_control(p: Mapping[str, float], world: World) -> Array:
    """A heater's switch pulls the supply: on and off in turn, each time for a little longer or shorter."""
    halves = int(4 * (world.seconds + 4) / p["period_s"])
    edges = world.t_s[0] + np.cumsum(p["period_s"] / 2 * world.random.uniform(0.7, 1.3, halves))
    return p["A_dps"] * (-1.0) ** np.searchsorted(edges, world.t_s)


def _friction(p: Mapping[str, float], world: World) -> Array:
    """The mount gives way against its friction: an offset with the sign of the angular acceleration, held at rest."""
    slope = np.gradient(world.rate_dps, world.t_s)
    sign = np.where(np.abs(slope) > 0.5, np.sign(slope), 0.0)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return p["A_dps"] * sign[last]


def _periodic_nonlinearity(p: Mapping[str, float], world: World) -> Array:
    """The converter's integral nonlinearity: a wave over the rate."""
    return p["A_dps"] * np.sin(2 * np.pi * world.rate_dps / p["period_dps"] + p["phase"])


def _hum_bursts(p: Mapping[str, float], world: World) -> Array:
    """A pump nearby that runs for a while and stops, its frequency a little different each time."""
    hum, at_s = np.zeros_like(world.t_s), world.t_s[0]
    while at_s < world.t_s[-1]:
        at_s += world.random.exponential(2 * p["burst_s"])
        length_s, f_hz = world.random.exponential(p["burst_s"]), p["f_hz"] * world.random.uniform(0.85, 1.15)
        on = (world.t_s >= at_s) & (world.t_s < at_s + length_s)
        hum[on] = np.sin(2 * np.pi * (f_hz * world.t_s[on] + world.random.random()))
        at_s += length_s
    return p["A_dps"] * hum


SIGNALS: dict[str, Callable[[Mapping[str, float], World], Array]] = {
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
    "thermal_hysteresis": _thermal_hysteresis,
    "dead_band": _dead_band,
    "order_tone": _order_tone,
    "g2_sensitivity": lambda p, world: p["k_dps_per_g2"] * np.sum(world.acceleration_g**2, axis=0),
    "two_point_control": _two_point_control,
    "friction": _friction,
    "periodic_nonlinearity": _periodic_nonlinearity,
    "hum_bursts": _hum_bursts,
    "stick_slip": _stick_slip,
    "gear_ripple": _gear_ripple,
    "mount_resonance": _mount_resonance,
    "fan_sweep": _fan_sweep,
}
