"""The shapes of the documented effects on one axis of a recording, written from their equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from blind.generator.signals import play

from .recording import AXES, Array, Recording, Run

TYPICAL: dict[str, tuple[tuple[float, float], ...]] = {
    "bias_temperature": ((1e-3, 0.03), (1e-5, 1e-3), (1e-7, 1e-5)), "scale_temperature": ((1e-5, 3e-4),),
    "thermal_lag": ((0.05, 1.0),), "warmup": ((5e-3, 0.05),), "drift": ((2e-5, 1e-3),), "table_ripple": ((5e-4, 5e-3),) * 2,
    "vibration_tone": ((2e-3, 0.2),) * 2, "spin_up": ((5e-4, 0.01),), "g_sensitivity": ((5e-3, 0.1),) * 3,
    "misalignment": ((1e-3, 0.02),) * 2, "scale_nonlinearity": ((3e-9, 1e-7),), "scale_asymmetry": ((1e-4, 2e-3),),
    "centripetal": ((1e-8, 3e-6),), "lag": ((5e-4, 0.02),), "clock_error": ((2e-5, 0.02),), "bias_jumps": ((0.01, 0.2),),
    "thermal_hysteresis": ((0.01, 0.3),), "dead_band": ((0.5, 1.0),), "order_tone": ((5e-3, 0.3),) * 2,
    "g2_sensitivity": ((1e-4, 0.01),), "saturation": ((0.5, 2.0),), "quantization": ((0.5, 2.0),),
    "sampling_fault": ((0.5, 2.0),), "byte_fault": ((0.5, 2.0),),
}  # fmt: skip
"""Low and high end of the typical size of each linear coefficient, as the effects' pages state them."""
MOST_TYPICAL = 10.0
UNLIMITED = ("lag", "clock_error", "bias_jumps")
LIMITS = {"drift": ("warmup",), "table_ripple": ("order_tone",)}
"""Effects that hold another as a special case: of two equal explanations, the simpler is the right name."""
TAUS_S = (0.5, 1.5, 5.0, 15.0, 50.0, 150.0)
WIDTHS_C = (1.0, 2.0, 4.0, 8.0, 16.0)
WIDTHS_DPS = (0.1, 0.3, 1.0, 2.0)
LOWEST_TONE_HZ = 1.0
DIGITAL = ("quantization", "saturation", "sampling_fault", "byte_fault")


@dataclass(frozen=True)
class Shape:
    """The columns [k, n] of an effect in each run; with ``own``, every run has coefficients of its own."""

    id: str
    columns: list[Array]
    own: bool = False


def temp_slope(run: Run) -> Array:
    return np.asarray(np.gradient(run.temp_c, run.t_s))


def since_on(run: Run) -> Array:
    return np.asarray(run.power_on_s + run.t_s)


def since_first(run: Run) -> Array:
    return np.asarray(run.cycle_s + run.t_s)


def loop(made: Recording, width_c: float) -> list[Array]:
    """The branch of a hysteresis, -1 to 1, in each run; the temperature is followed from the power cycle's first sample."""
    found = []
    for run in made.runs:
        every = max(1, int(made.sensor.rate_hz / 20))
        sparse = play(run.temp_c[::every], width_c)
        found.append(np.interp(run.t_s, run.t_s[::every], sparse))
    return found


def late(made: Recording, axis: int, tau_s: float) -> list[Array]:
    """The reading behind a pure delay, less the true rate."""
    return [run.w_at(run.t_s - tau_s)[axis] - run.w[axis] for run in made.runs]


def misclocked(made: Recording, axis: int, e: float) -> list[Array]:
    """The reading where the sample clock's time is (1 + e) of the true one, less the reference's rate."""
    return [run.w_at(run.t_s * (1 + e))[axis] - run.w[axis] for run in made.runs]


def nuisance(made: Recording, axis: int) -> list[Array]:
    """The columns of scale and bias, and of a reference's own frame and clock, [k, n] of each run."""
    found = []
    for run in made.runs:
        rows = [np.ones(run.t_s.size)]
        if any(np.ptp(r.w[axis]) > 0 or np.any(r.w[axis]) for r in made.runs):
            rows.append(run.w[axis])
        if made.reference == "three":
            rows += [run.w[j] for j in range(3) if j != axis] + [np.gradient(run.w[axis], run.t_s)]
        found.append(np.array(rows))
    return found


def shapes(made: Recording, axis: int, planted: Mapping[str, Mapping[str, float]]) -> Iterator[Shape]:
    """Every effect that could be named on an axis, with a grid of its nonlinear parameters. ``planted`` gives the waves."""
    yield from _slow(made, axis)
    if any(np.any(run.w[axis]) for run in made.runs):
        yield from _of_rate(made, axis)
    yield from _waves(made, axis, planted)


def _slow(made: Recording, axis: int) -> Iterator[Shape]:
    runs = made.runs
    if made.has_temp:
        yield Shape("bias_temperature", [np.array([(r.temp_c - 25.0) ** n for n in (1, 2, 3)]) for r in runs])
        yield Shape("thermal_lag", [temp_slope(r)[None] for r in runs])
        for width_c in WIDTHS_C if made.varies else ():
            yield Shape("thermal_hysteresis", [branch[None] for branch in loop(made, width_c)])
    yield Shape("drift", [since_first(r)[None] for r in runs])
    for tau_s in TAUS_S:
        yield Shape("warmup", [np.exp(-since_on(r) / tau_s)[None] for r in runs])
    if made.has_acc:
        yield Shape("g_sensitivity", [r.acc_g for r in runs])
        yield Shape("g2_sensitivity", [np.sum(r.acc_g**2, axis=0)[None] for r in runs])
    elif len({r.face for r in runs}) > 1:
        yield Shape("g_sensitivity", [np.full((1, r.t_s.size), r.side) for r in runs])
    if made.reference in ("stated", "rate", "angle"):
        yield Shape("centripetal", [r.rate[None] ** 2 for r in runs])
    others = [j for j in range(3) if j != axis and any(np.any(r.w[j]) for r in runs)]
    if others and made.reference != "three":
        yield Shape("misalignment", [r.w[others] for r in runs])


def _of_rate(made: Recording, axis: int) -> Iterator[Shape]:
    runs = made.runs
    yield Shape("scale_asymmetry", [np.abs(r.w[axis])[None] for r in runs])
    if made.reference not in ("turns", "gravity"):
        yield Shape("scale_nonlinearity", [r.w[axis][None] ** 3 for r in runs])
    if made.has_temp:
        yield Shape("scale_temperature", [((r.temp_c - 25.0) * r.w[axis])[None] for r in runs])
    if made.reference == "stated":
        for tau_s in TAUS_S[:4]:
            yield Shape("spin_up", [(r.w[axis] * np.exp(-r.t_s / tau_s))[None] for r in runs])
    if made.reference in ("rate", "angle"):
        slopes = [np.gradient(r.w[axis], r.t_s) for r in runs]
        yield Shape("lag", [-s[None] for s in slopes])
        yield Shape("clock_error", [(r.t_s * s)[None] for r, s in zip(runs, slopes, strict=True)])
        for width_dps in WIDTHS_DPS:
            yield Shape("dead_band", [np.where(np.abs(r.w[axis]) < width_dps, r.w[axis], 0.0)[None] for r in runs])


def wave(angle_rad: Array) -> Array:
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _waves(made: Recording, axis: int, planted: Mapping[str, Mapping[str, float]]) -> Iterator[Shape]:
    """Waves at the planted orders and frequencies, and at those that equal them at one of the session's speeds."""
    if made.reference not in ("stated", "rate"):
        return
    runs, orders, tones = made.runs, set[float](), set[float]()
    speeds = {round(abs(r.stated_dps), 6) for r in runs if r.stated_dps}
    for id_, parameters in planted.items():
        if id_ == "order_tone":
            orders.add(parameters["order"])
        elif id_ == "table_ripple":
            orders |= {float(name.split("_")[1]) for name in parameters if name.startswith("amplitude_")}
        elif id_ == "vibration_tone":
            tones.add(parameters["f_hz"])
    orders |= {360.0 * f_hz / speed for f_hz in tones for speed in speeds}
    tones |= {order * speed / 360.0 for order in orders for speed in speeds}
    known = made.has_angle
    for order in sorted(orders):
        waves = [wave(np.radians(order * r.angle_deg)) for r in runs]
        yield Shape("order_tone", waves, own=not known)
        if order == round(order) and order <= 4 and any(np.any(r.w[axis]) for r in runs):
            yield Shape("table_ripple", [v * r.w[axis] for v, r in zip(waves, runs, strict=True)], own=not known)
    for f_hz in sorted(f for f in tones if f >= LOWEST_TONE_HZ):
        yield Shape("vibration_tone", [wave(2 * np.pi * f_hz * r.t_s) for r in runs], own=True)


def measurable(made: Recording) -> set[str]:
    """Effects whose data the recording has, on one axis or another."""
    found = {shape.id for axis in range(len(AXES)) for shape in (*_slow(made, axis), *_of_rate(made, axis))}
    if made.reference in ("stated", "rate"):
        found |= {"vibration_tone"}
        if any(np.any(run.rate) for run in made.runs):
            found |= {"table_ripple", "order_tone"}
    if made.reference in ("stated", "rate", "angle", "three"):
        found |= {"bias_jumps", "byte_fault", "sampling_fault", "quantization"}
    return found | ({"saturation"} if any(run.moves for run in made.runs) and made.reference == "rate" else set())
