"""Effects to be planted: where they act, with which parameters, and what they add to the reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from blind.generator.chip import badly_joined

from . import library
from .library import DIGITAL, TYPICAL
from .protocols import log_uniform
from .recording import AXES, Array, Random, Recording

Parameters = dict[str, float]
Signal = list[Array]

SIZES = {
    "bias_temperature": ("k1_dps_per_c", "k2_dps_per_c2"), "scale_temperature": ("k_per_c",), "thermal_lag": ("k_dps_s_per_c",),
    "warmup": ("A_dps",), "drift": ("k_dps_per_s",), "table_ripple": tuple(f"amplitude_{k}" for k in (1, 2, 3, 4)),
    "vibration_tone": ("A_dps",), "order_tone": ("A_dps",), "spin_up": ("A",),
    "g_sensitivity": tuple(f"g{a}_dps_per_g" for a in AXES), "misalignment": tuple(f"m_{a}" for a in AXES),
    "scale_nonlinearity": ("k3",), "scale_asymmetry": ("k",), "centripetal": ("k",), "bias_jumps": ("size_dps",),
    "thermal_hysteresis": ("amplitude_dps",), "g2_sensitivity": ("k_dps_per_g2",), "lag": ("tau_s",), "clock_error": ("e",),
    "dead_band": ("width_dps",), "saturation": ("beyond_dps",), "quantization": ("lsb_dps",), "sampling_fault": ("fraction",),
    "byte_fault": ("fraction",),
}  # fmt: skip
"""The parameters that make an effect larger. All others shape it."""
PROPORTIONAL = frozenset(SIZES) - {"dead_band", *DIGITAL, "lag", "clock_error"}
ON_TABLE = (
    "scale_temperature", "table_ripple", "spin_up", "scale_nonlinearity", "scale_asymmetry", "lag", "clock_error", "dead_band",
    "saturation",
)  # fmt: skip
LIMITS = {
    "dead_band": (0.03, 3.0), "saturation": (0.02, 30.0), "quantization": (2.0, 16.0), "sampling_fault": (5e-5, 0.1),
    "byte_fault": (2e-4, 0.3), "lag": (5e-5, 0.05), "clock_error": (2e-6, 0.02),
}  # fmt: skip
"""Least and largest size of what does not grow in proportion; quantization in the chip's own counts."""


@dataclass(frozen=True)
class Planted:
    """One effect in a recording. ``axes`` are the axes that show it, ``signal`` what it adds to each run, [3, n]."""

    id: str
    axes: str
    parameters: Parameters
    seed: int = 0

    @property
    def size(self) -> float:
        return max(abs(self.parameters[name]) for name in SIZES[self.id] if name in self.parameters)

    @property
    def unit(self) -> float:
        """What one unit of the library's coefficient is of this effect; 1 for a shape of fixed size."""
        return self.size if self.id in PROPORTIONAL else 1.0

    def times(self, factor: float) -> Planted:
        """The effect, larger by a factor."""
        own = SIZES[self.id]
        return replace(self, parameters={n: v * factor if n in own else v for n, v in self.parameters.items()})


def draw(id_: str, made: Recording, random: Random) -> Planted:
    """An effect of typical size, log-uniform within the typical range, on an axis that can show it."""
    off = [j for j in range(3) if any(np.any(run.w[k]) for run in made.runs for k in range(3) if k != j)]
    axis = int(random.integers(3))
    if id_ in ON_TABLE:
        axis = made.axis if made.protocol not in ("cube", "turns", "mocap", "by_hand") else axis
    elif id_ == "misalignment":
        axis = int(random.choice(off or [0]))
    axes = AXES if id_ in ("quantization", "sampling_fault") else AXES[axis]
    sign = float(random.choice([-1.0, 1.0]))
    low, high = TYPICAL[id_][0]
    size = sign * log_uniform(random, low, high)
    return Planted(id_, axes, _parameters(id_, made, random, axis, size), int(random.integers(2**31)))


def _parameters(id_: str, made: Recording, random: Random, axis: int, size: float) -> Parameters:
    if id_ == "bias_temperature":
        return {"k1_dps_per_c": size} | ({"k2_dps_per_c2": size * random.uniform(-0.05, 0.05)} if random.random() < 0.3 else {})
    if id_ == "table_ripple":
        orders = random.choice([1, 2, 3, 4], random.choice([1, 1, 2]), replace=False)
        return {
            name: float(value)
            for k in orders
            for name, value in ((f"amplitude_{k}", abs(size)), (f"phase_{k}_deg", random.uniform(0, 360)))
        }
    if id_ == "g_sensitivity":
        return {f"g{AXES[made.runs[0].axis if random.random() < 0.7 else random.integers(3)]}_dps_per_g": size}
    if id_ == "misalignment":
        others = [j for j in range(3) if j != axis and any(np.any(run.w[j]) for run in made.runs)]
        return {f"m_{AXES[int(random.choice(others or [axis]))]}": size}
    if id_ in LIMITS:
        low, high = LIMITS[id_]
        size = (np.sign(size) if id_ == "clock_error" else 1.0) * log_uniform(random, low, high)
        size = float(round(size)) if id_ == "quantization" else size
    return {SIZES[id_][0]: float(size)} | _shape_of(id_, made, random)


def _shape_of(id_: str, made: Recording, random: Random) -> Parameters:
    """The parameters that do not make it larger."""
    longest_s = max(float(run.t_s[-1]) for run in made.runs)
    fastest_hz = 0.4 * min(made.sensor.rate_hz, 2 * (made.sensor.cutoff_hz or made.sensor.rate_hz))
    ranges: dict[str, Callable[[], Parameters]] = {
        "warmup": lambda: {"tau_s": log_uniform(random, 8.0, 120.0)},
        "spin_up": lambda: {"tau_s": log_uniform(random, 0.4, max(0.5, longest_s / 4))},
        "vibration_tone": lambda: {"f_hz": log_uniform(random, 2.0, fastest_hz)},
        "order_tone": lambda: {"order": float(random.choice([0.5, 1, 2, 3, 4.25, 5, 7])), "phase_deg": random.uniform(0, 360)},
        "thermal_hysteresis": lambda: {"width_c": random.uniform(2.0, 9.0)},
        "bias_jumps": lambda: {"n": float(random.integers(1, 6))},
        "byte_fault": lambda: {"bit": float(random.choice([4, 6, 8]))},
    }
    return ranges[id_]() if id_ in ranges else {}


def signal(planted: Planted, made: Recording) -> list[Array]:
    """What an effect of the analogue side adds to each run, [3, n]."""
    out = [np.zeros((3, run.t_s.size)) for run in made.runs]
    for name in planted.axes:
        axis = AXES.index(name)
        for total, one in zip(out, _on_axis(planted, made, axis), strict=True):
            total[axis] = one
    return out


def _on_axis(planted: Planted, made: Recording, axis: int) -> Signal:
    p, runs = planted.parameters, made.runs
    random = np.random.default_rng(planted.seed)
    laws: dict[str, Callable[[], Signal]] = {
        "bias_temperature": lambda: [
            p["k1_dps_per_c"] * (r.temp_c - 25) + p.get("k2_dps_per_c2", 0.0) * (r.temp_c - 25) ** 2 for r in runs
        ],
        "scale_temperature": lambda: [p["k_per_c"] * (r.temp_c - 25) * r.w[axis] for r in runs],
        "thermal_lag": lambda: [p["k_dps_s_per_c"] * library.temp_slope(r) for r in runs],
        "warmup": lambda: [p["A_dps"] * np.exp(-library.since_on(r) / p["tau_s"]) for r in runs],
        "drift": lambda: [p["k_dps_per_s"] * library.since_first(r) for r in runs],
        "table_ripple": lambda: [r.w[axis] * _ripple(p, r.angle_deg) for r in runs],
        "vibration_tone": lambda: [p["A_dps"] * np.sin(2 * np.pi * (p["f_hz"] * r.t_s + random.random())) for r in runs],
        "order_tone": lambda: [p["A_dps"] * np.sin(np.radians(p["order"] * r.angle_deg + p["phase_deg"])) for r in runs],
        "spin_up": lambda: [-p["A"] * r.w[axis] * np.exp(-r.t_s / p["tau_s"]) for r in runs],
        "g_sensitivity": lambda: [sum(p.get(f"g{a}_dps_per_g", 0.0) * r.acc_g[i] for i, a in enumerate(AXES)) for r in runs],
        "g2_sensitivity": lambda: [p["k_dps_per_g2"] * np.sum(r.acc_g**2, axis=0) for r in runs],
        "misalignment": lambda: [sum(p.get(f"m_{a}", 0.0) * r.w[i] for i, a in enumerate(AXES)) for r in runs],
        "scale_nonlinearity": lambda: [p["k3"] * r.w[axis] ** 3 for r in runs],
        "scale_asymmetry": lambda: [p["k"] * np.abs(r.w[axis]) for r in runs],
        "centripetal": lambda: [p["k"] * r.rate**2 for r in runs],
        "lag": lambda: library.late(made, axis, p["tau_s"]),
        "clock_error": lambda: library.misclocked(made, axis, p["e"]),
        "thermal_hysteresis": lambda: [p["amplitude_dps"] * branch for branch in library.loop(made, p["width_c"])],
        "dead_band": lambda: [np.where(np.abs(r.w[axis]) < p["width_dps"], -r.w[axis], 0.0) for r in runs],
        "bias_jumps": lambda: _jumps(p, made, random),
    }  # fmt: skip
    return [np.asarray(one, dtype=float) for one in laws[planted.id]()]


def _ripple(p: Parameters, angle_deg: Array) -> Array:
    total = np.zeros_like(angle_deg)
    for k in (1, 2, 3, 4):
        if f"amplitude_{k}" in p:
            total += p[f"amplitude_{k}"] * np.cos(np.radians(k * angle_deg + p[f"phase_{k}_deg"]))
    return total


def _jumps(p: Parameters, made: Recording, random: Random) -> Signal:
    """Steps that stay until the power cycle ends; none within a fifth of its run's ends."""
    runs = made.runs
    at = sorted(random.choice(len(runs), min(int(p["n"]), len(runs)), replace=False).tolist())
    out = [np.zeros(run.t_s.size) for run in runs]
    for k in at:
        after_s = runs[k].start_s + runs[k].t_s[-1] * random.uniform(0.2, 0.8)
        step = p["size_dps"] * random.choice([-1.0, 1.0])
        for j in range(k, len(runs)):
            if runs[j].scenario == runs[k].scenario:
                out[j] += step * (runs[j].start_s + runs[j].t_s >= after_s)
    return out


def damaged(planted: Planted, made: Recording, readings: list[Array]) -> list[Array]:
    """Readings [3, n] of each run after a fault of the digital side."""
    lsb, p, random = made.sensor.lsb_dps, planted.parameters, np.random.default_rng(planted.seed)
    out = []
    for reading in readings:
        if planted.id == "quantization":
            coarse = p["lsb_dps"] * lsb
            out.append(coarse * np.round(reading / coarse))
        elif planted.id == "saturation":
            most = lsb * np.round(stated_full_scale(planted, made) / lsb)
            out.append(np.clip(reading, -most, most))
        elif planted.id == "sampling_fault":
            repeats = random.random(reading.shape[1]) < p["fraction"]
            repeats[0] = False
            out.append(reading[:, np.maximum.accumulate(np.where(repeats, 0, np.arange(reading.shape[1])))])
        else:
            axis, torn = AXES.index(planted.axes), reading.copy()
            codes = np.round(reading[axis] / lsb).astype(np.int64)
            torn[axis] = lsb * badly_joined(codes, p, random)
            out.append(torn)
    return out


def stated_full_scale(planted: Planted, made: Recording) -> float:
    """The full scale lies so far below the fastest rate that the recording holds."""
    axis = AXES.index(planted.axes[0])
    fastest = max(float(np.abs((1 + made.sensor.scale[axis]) * run.w[axis]).max()) for run in made.runs)
    return float(max(fastest - planted.parameters["beyond_dps"], 1.0))


def truth_of(planted: Planted, made: Recording) -> dict[str, object]:
    """Effect, axes and parameters as the library names them."""
    p = dict(planted.parameters)
    if planted.id == "quantization":
        p["lsb_dps"] *= made.sensor.lsb_dps
    if planted.id == "saturation":
        p = {"full_scale_dps": stated_full_scale(planted, made)}
    return {"effect": planted.id, "axes": planted.axes, "parameters": p}
