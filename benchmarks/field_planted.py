"""Sessions as users bring them in which one effect is planted (:mod:`benchmarks.field_sessions` has those that hold none)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from benchmarks.field_sessions import (
    STEP_C,
    Array,
    Recording,
    Rng,
    encoder,
    log_uniform,
    pairs,
    sign,
    staircase,
    swing,
)
from scipy.signal import lfilter

ZERO_C = 25.0


def _heated(made: Recording, low: float, high: float) -> Callable[[Array, Array, Array], Array]:
    """Plants a bias that depends on temperature, of ``low`` to ``high`` dps/degC, and returns it."""
    k1 = sign(made.rng) * log_uniform(made.rng, low, high)
    made.plant("bias_temperature", k1_dps_per_c=k1)
    return lambda t_s, rate_dps, temp_c: k1 * (temp_c - ZERO_C)


def chamber(low_c: float, high_c: float) -> Callable[[Recording], None]:
    def kind(made: Recording) -> None:
        made.part(20.0)
        extra = _heated(made, 0.005, 0.03)
        middle, size = (low_c + high_c) / 2, (high_c - low_c) / 2
        for i in range(4):
            period_s, phase = made.rng.uniform(120, 400), made.rng.uniform(0, 6.28)
            for j, face in enumerate(("up", "down")):

                def temp_c(t: Array, j: int = j, period_s: float = period_s, phase: float = phase) -> Array:
                    return middle + size * np.sin(2 * np.pi * (t + 130 * j) / period_s + phase)

                made.add(120, f"s{i:03d}", face, 78.0, temp_c=temp_c, temp_step_c=STEP_C, extra_dps=extra)

    return kind


def chamber_wide(made: Recording) -> None:
    made.part(20.0)
    extra = _heated(made, 0.003, 0.02)
    points = np.linspace(-10, 60, 8)
    made.rng.shuffle(points)
    for i, point in enumerate(points):
        change = made.rng.uniform(-1, 1, 2)
        for j, face in enumerate(("up", "down")):

            def temp_c(t: Array, point: float = point, change: float = change[j]) -> Array:
                return point + change * t / 60

            made.add(60, f"s{i:03d}", face, 78.0, temp_c=temp_c, temp_step_c=STEP_C, extra_dps=extra)


def ramp(made: Recording) -> None:
    made.part(20.0)
    extra = _heated(made, 0.004, 0.02)
    settles = made.rng.random() < 0.5
    for i, face in enumerate(("up", "down")):
        start, rise, tau_s = made.rng.uniform(20, 30), made.rng.uniform(10, 25), made.rng.uniform(150, 400)

        def temp_c(t: Array, start: float = start, rise: float = rise, tau_s: float = tau_s) -> Array:
            return start + rise * ((1 - np.exp(-t / tau_s)) if settles else t / 600)

        made.add(600, f"s{i:03d}", face, 78.0, temp_c=temp_c, temp_step_c=STEP_C, extra_dps=extra)


def temp_missing(made: Recording) -> None:
    made.part(20.0)
    extra = _heated(made, 0.005, 0.02)
    gone = set(made.rng.choice(8, 2, replace=False).tolist())
    without = "empty" if made.seed % 2 else "absent"
    for i in range(4):
        middle, size = 20 + 25 * made.rng.random(), made.rng.uniform(-8, 8)
        for j, face in enumerate(("up", "down")):

            def temp_c(t: Array, j: int = j, middle: float = middle, size: float = size) -> Array:
                return middle + size * np.sin(2 * np.pi * (t + 130 * j) / 500)

            there = without if 2 * i + j in gone else "there"
            made.add(
                120, f"s{i:03d}", face, 78.0, temp_c=temp_c, temp_step_c=STEP_C, thermometer=there, extra_dps=extra
            )


def stairs_asymmetry(made: Recording) -> None:
    made.part(50.0)
    k = sign(made.rng) * log_uniform(made.rng, 0.0004, 0.003)
    made.plant("scale_asymmetry", k=k)
    sd_dps, step_dps = made.rng.uniform(0.02, 0.05), float(made.rng.choice([0.0, 0.02, 0.05]))
    for i in range(3):
        rate_dps = staircase(made.rng, 200, 50.0)
        reference = encoder(made.rng, rate_dps, sd_dps, step_dps)
        extra = k * np.abs(rate_dps)
        made.add(200, f"s{i:03d}", rate_dps=rate_dps, reference_dps=reference, extra_dps=lambda *_, x=extra: x)


def _filtered(motion: Callable[[Array], Array], n: int, rate_hz: float, tau_s: float) -> Array:
    """The motion behind a first-order low-pass, exact for lines between steps of a twentieth of a sample."""
    fine, before_s = 20, 10
    step_s = 1 / rate_hz / fine
    times = np.arange(-int(before_s * rate_hz) * fine, n * fine) * step_s
    kept = np.exp(-step_s / tau_s)
    first, second = 1 - tau_s / step_s * (1 - kept), tau_s / step_s * (1 - kept) - kept
    return lfilter([first, second], [1, -kept], motion(times))[int(before_s * rate_hz) * fine :: fine][:n]


def late(filtered: bool) -> Callable[[Recording], None]:
    def kind(made: Recording) -> None:
        made.part(50.0)
        tau_s = log_uniform(made.rng, 0.001, 0.3)
        made.plant("lag", tau_s=tau_s)
        sd_dps, step_dps = float(made.rng.choice([0.0, 0.02, 0.05])), float(made.rng.choice([0.0, 0.02]))
        for i in range(2):
            motion = swing(made.rng, int(made.rng.integers(1, 4)))
            t_s = np.arange(10_000) / 50.0
            rate_dps = motion(t_s)
            shown = _filtered(motion, t_s.size, 50.0, tau_s) if filtered else motion(t_s - tau_s)
            reference = encoder(made.rng, rate_dps, sd_dps, step_dps)
            made.add(200, f"s{i:03d}", rate_dps=rate_dps, reference_dps=reference, shown_dps=shown)

    return kind


def clock(made: Recording) -> None:
    made.part(20.0)
    e = sign(made.rng) * log_uniform(made.rng, 1e-4, 2e-2)
    made.plant("clock_error", e=e)
    seconds, sd_dps = made.rng.uniform(200, 1200), float(made.rng.choice([0.0, 0.03]))
    for i in range(2):
        motion = swing(made.rng, int(made.rng.integers(1, 4)))
        t_s = np.arange(int(seconds * 20)) / 20
        rate_dps = motion(t_s)
        reference = encoder(made.rng, rate_dps, sd_dps, 0.0)
        made.add(
            t_s.size / 20, f"s{i:03d}", rate_dps=rate_dps, reference_dps=reference, shown_dps=motion((1 + e) * t_s)
        )


def warmup(made: Recording) -> None:
    made.part(20.0)
    size_dps, tau_s = sign(made.rng) * log_uniform(made.rng, 0.05, 0.3), log_uniform(made.rng, 20, 200)
    made.plant("warmup", A_dps=size_dps, tau_s=tau_s)
    for i in range(7):
        for j, face in enumerate(("up", "down")):
            on_s = 3.0 + j * 75 + float(np.round(made.rng.uniform(0, 5), 1))

            def extra(t: Array, rate_dps: Array, temp_c: Array, on_s: float = on_s) -> Array:
                return size_dps * np.exp(-(t + on_s) / tau_s)

            made.add(60, f"s{i:03d}", face, 78.0, power_on_s=on_s, extra_dps=extra)


def _phase(rng: Rng) -> float:
    return rng.uniform(0, 2 * np.pi)


def ripple(made: Recording) -> None:
    made.part(100.0)
    amplitude = log_uniform(made.rng, 0.0005, 0.004)
    made.plant("table_ripple", amplitude_1=amplitude)
    cycles = int(made.rng.integers(6, 11))

    def once_a_turn(i: int, j: int) -> Any:
        phase = _phase(made.rng)
        return lambda t, rate_dps, temp_c: rate_dps * amplitude * np.cos(phase + np.deg2rad(rate_dps) * t)

    pairs(made, 20, cycles, extra_dps=once_a_turn)


def tone(made: Recording) -> None:
    made.part(100.0)
    size_dps, f_hz = log_uniform(made.rng, 0.006, 0.03), made.rng.uniform(3, 45)
    made.plant("vibration_tone", A_dps=size_dps, f_hz=f_hz)

    def of_run(i: int, j: int) -> Any:
        phase = _phase(made.rng)
        return lambda t, rate_dps, temp_c: size_dps * np.sin(2 * np.pi * f_hz * t + phase)

    pairs(made, 20, None, extra_dps=of_run)
