"""Small disturbances of sensors and rigs that are outside the shapes of the library. Each is a signal on one axis, [n] a run.

All are of size one or so; ``drawn`` takes scale and bias out of them and gives them their size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from . import library
from .protocols import log_uniform
from .recording import Array, Random, Recording, Run

Signal = list[Array]


def _temp(run: Run) -> Array:
    return np.asarray(run.temp_c - 25.0)


def _part(run: Run) -> Array:
    """Time within the run from 0 to 1."""
    return np.asarray(run.t_s / run.t_s[-1])


def _settling(run: Run, tau_s: float) -> Array:
    return np.asarray(np.exp(-run.t_s / tau_s))


def _walk(random: Random, run: Run, low_hz: float, high_hz: float, power: float) -> Array:
    """A Gaussian process whose spectral density falls as 1 / f^power between two frequencies."""
    step_s = float(run.t_s[1])
    f_hz = np.fft.rfftfreq(4 * run.t_s.size, step_s)
    band = (f_hz > low_hz) & (f_hz < high_hz)
    size = np.where(band, np.maximum(f_hz, 1e-9) ** (-power / 2), 0.0)
    phasors = size * (random.standard_normal(f_hz.size) + 1j * random.standard_normal(f_hz.size))
    found = np.fft.irfft(phasors, 4 * run.t_s.size)[: run.t_s.size]
    return np.asarray(found / max(float(np.std(found)), 1e-300))


def _relaxed(run: Run, signal: Array, tau_s: float) -> Array:
    """A switched signal as it is seen behind a first-order low-pass: no step is left in it."""
    pole = np.exp(-run.t_s[1] / tau_s)
    return np.asarray(lfilter([1 - pole], [1, -pole], signal - signal[0]))


def time_by_temperature(m: Recording, axis: int, r: Random) -> Signal:
    """A temperature coefficient that ages through each power cycle."""
    return [library.since_first(run) * _temp(run) for run in m.runs]


def rate_by_settling(m: Recording, axis: int, r: Random) -> Signal:
    """The scale settles in each run to another value at every speed."""
    tau_s = log_uniform(r, 2, 15)
    return [run.w[axis] ** 2 * _settling(run, tau_s) for run in m.runs]


def direction_by_settling(m: Recording, axis: int, r: Random) -> Signal:
    """A cover that is wound up by the start: an offset of the direction's sign that decays."""
    tau_s = log_uniform(r, 2, 20)
    return [np.sign(np.mean(run.rate)) * _settling(run, tau_s) for run in m.runs]


def bump(m: Recording, axis: int, r: Random) -> Signal:
    """One bump in each run, elsewhere in each, of its own sign and size."""
    out = []
    for run in m.runs:
        at, width = r.uniform(0.15, 0.85), r.uniform(0.03, 0.1)
        out.append(r.normal() * np.exp(-0.5 * ((_part(run) - at) / width) ** 2))
    return out


def own_slopes(m: Recording, axis: int, r: Random) -> Signal:
    """Every run drifts with a slope of its own."""
    return [r.normal() * (_part(run) - 0.5) for run in m.runs]


def rate_wave(m: Recording, axis: int, r: Random) -> Signal:
    """The converter's integral nonlinearity: a wave over the rate."""
    top = max(float(np.abs(run.w[axis]).max()) for run in m.runs)
    period, phase = max(top, 1.0) * r.uniform(0.25, 0.6), r.uniform(0, 6.28)
    return [np.sin(2 * np.pi * run.w[axis] / period + phase) for run in m.runs]


def stick_slip(m: Recording, axis: int, r: Random) -> Signal:
    """The drive winds up and lets go, in cycles of differing length."""
    period_s, out = r.uniform(0.4, 2.0), []
    for run in m.runs:
        lengths = period_s * r.lognormal(0.0, 0.3, int(6 * run.t_s[-1] / period_s) + 10)
        edges = np.concatenate([[0.0], np.cumsum(lengths)]) - lengths[0] * r.random()
        at = np.searchsorted(edges, run.t_s, side="right") - 1
        out.append(run.rate * (0.5 - (run.t_s - edges[at]) / lengths[at]))
    return out


def settling_scale(m: Recording, axis: int, r: Random) -> Signal:
    """The scale settles after power-on."""
    tau_s = log_uniform(r, 8, 60)
    return [run.w[axis] * np.exp(-library.since_on(run) / tau_s) for run in m.runs]


def scale_lag(m: Recording, axis: int, r: Random) -> Signal:
    """The scale follows the temperature's slope: a thermal lag of the scale."""
    return [run.w[axis] * library.temp_slope(run) for run in m.runs]


def kinked_temperature(m: Recording, axis: int, r: Random) -> Signal:
    """A stress that lets go above a temperature: a kink that no polynomial of third order follows."""
    at = float(np.quantile(np.concatenate([run.temp_c for run in m.runs]), r.uniform(0.4, 0.8)))
    return [np.maximum(run.temp_c - at, 0.0) for run in m.runs]


def temperature_wave(m: Recording, axis: int, r: Random) -> Signal:
    """Steps of a compensation table over temperature: a sawtooth whose edges are smoothed over seconds."""
    span = float(np.ptp(np.concatenate([run.temp_c for run in m.runs])))
    step, start = max(span, 0.05) * r.uniform(0.08, 0.25), r.random()
    return [_relaxed(run, np.mod(run.temp_c / step + start, 1.0), 3.0) for run in m.runs]


def speed_by_power_on(m: Recording, axis: int, r: Random) -> Signal:
    """An asymmetry that grows with the time since power-on."""
    return [np.abs(run.rate) * library.since_on(run) for run in m.runs]


def flicker(m: Recording, axis: int, r: Random) -> Signal:
    """Flicker noise beyond the drift."""
    return [_walk(r, run, 0.02, 2.0, 1.0) for run in m.runs]


def loop_hunting(m: Recording, axis: int, r: Random) -> Signal:
    """The drive's phase-locked loop hunts: a slow wave whose period wanders by a fifth."""
    period_s, out = r.uniform(3, 9), []
    for run in m.runs:
        pace = np.exp(0.3 * _walk(r, run, 0.01, 0.2, 2.0))
        out.append(np.sin(np.cumsum(2 * np.pi * pace / period_s * run.t_s[1]) + r.uniform(0, 6.28)))
    return out


def cable_at_one_face(m: Recording, axis: int, r: Random) -> Signal:
    """A cable pulls with the table's angle, with the face up alone; it is unwound before each run."""
    one = float(r.choice([-1.0, 1.0]))
    return [(run.side == one) * np.tanh((run.angle_deg - run.angle_deg[0]) / 360.0 / r.uniform(0.5, 3)) for run in m.runs]


def magnet(m: Recording, axis: int, r: Random) -> Signal:
    """A magnet beside the table: a narrow pulse of the reading once a turn."""
    at_deg, width_deg = r.uniform(0, 360), r.uniform(8, 25)
    return [np.exp(-0.5 * ((np.mod(run.angle_deg - at_deg + 180, 360) - 180) / width_deg) ** 2) for run in m.runs]


def gravity_by_rate(m: Recording, axis: int, r: Random) -> Signal:
    """The scale depends on gravity."""
    return [run.acc_g[run.axis] * run.w[axis] + 0.3 * run.acc_g[(run.axis + 1) % 3] * run.rate for run in m.runs]


def stepped_compensation(m: Recording, axis: int, r: Random) -> Signal:
    """The chip compensates by a thermometer of coarse steps, and smooths what it corrects."""
    step_c = r.choice([0.25, 0.5, 1.0])
    out = []
    for run in m.runs:
        seen = np.round(run.temp_c / step_c) * step_c
        out.append(run.temp_c - run.temp_c[0] - _relaxed(run, seen, 2.0))
    return out


def gradient(m: Recording, axis: int, r: Random) -> Signal:
    """A temperature gradient over the board: the difference of two first-order lags of the temperature."""
    fast_s, slow_s = r.uniform(5, 12), r.uniform(40, 120)
    out = []
    for run in m.runs:
        step_s, lagged = float(run.t_s[1]), []
        for tau_s in (fast_s, slow_s):
            pole = np.exp(-step_s / tau_s)
            lagged.append(lfilter([1 - pole], [1, -pole], run.temp_c - run.temp_c[0]))
        out.append(lagged[0] - lagged[1])
    return out


def mode_change(m: Recording, axis: int, r: Random) -> Signal:
    """The chip changes its mode several times, and relaxes to the other level within seconds."""
    tau_s, out = r.uniform(1.0, 4.0), []
    for run in m.runs:
        edges = np.cumsum(r.exponential(max(run.t_s[-1] / 8, 2 * tau_s), 40))
        out.append(_relaxed(run, (np.searchsorted(edges, run.t_s) % 2).astype(float), tau_s))
    return out


def slow_beat(m: Recording, axis: int, r: Random) -> Signal:
    """Interference aliased to below 1 Hz, whose strength beats, with another frequency in each run."""
    f_hz, out = r.uniform(0.15, 0.8), []
    for run in m.runs:
        own_hz, beat_hz = f_hz * r.uniform(0.8, 1.2), r.uniform(0.02, 0.08)
        wave = np.sin(2 * np.pi * own_hz * run.t_s + r.uniform(0, 6.28))
        out.append(wave * (1 + np.cos(2 * np.pi * beat_hz * run.t_s + r.uniform(0, 6.28))))
    return out


def bursts(m: Recording, axis: int, r: Random) -> Signal:
    """Bursts of low-frequency noise that swell and fade."""
    out = []
    for run in m.runs:
        total, noise = np.zeros(run.t_s.size), _walk(r, run, 0.05, 2.0, 1.0)
        for _ in range(max(2, r.poisson(run.t_s[-1] / 12))):
            at, length = r.uniform(0, run.t_s[-1]), r.uniform(1.0, 4.0)
            total += np.exp(-0.5 * ((run.t_s - at) / length) ** 2)
        out.append(total * noise)
    return out


def scale_step(m: Recording, axis: int, r: Random) -> Signal:
    """The scale steps once and stays, as after a knock. At one rate that were a step of the bias."""
    if not any(run.moves for run in m.runs):
        return [np.zeros(run.t_s.size) for run in m.runs]
    last = m.runs[-1]
    at_s = r.uniform(0.3, 0.7) * (last.start_s + last.t_s[-1])
    return [run.w[axis] * (run.start_s + run.t_s >= at_s) for run in m.runs]


def backlash(m: Recording, axis: int, r: Random) -> Signal:
    """Play of the gear: a pulse after each reversal or start, with the new direction's sign."""
    tau_s, out = r.uniform(0.2, 1.0), []
    for run in m.runs:
        sign = np.sign(run.rate) * (np.abs(run.rate) > 1.0)
        pole = np.exp(-run.t_s[1] / tau_s)
        out.append(lfilter([1.0, -1.0], [1.0, -pole], sign))
    return out


def mount_creep(m: Recording, axis: int, r: Random) -> Signal:
    """The mount creeps with the logarithm of the time since it was turned over."""
    tau_s = r.uniform(0.5, 3.0)
    return [run.side * np.log1p(run.t_s / tau_s) for run in m.runs]


def friction(m: Recording, axis: int, r: Random) -> Signal:
    """An offset with the sign of the angular acceleration, held until the next. Few reversals would leave mere jumps."""
    if m.protocol not in ("hand", "swing", "mocap"):
        return [np.zeros(run.t_s.size) for run in m.runs]
    out = []
    for run in m.runs:
        slope = np.gradient(run.rate, run.t_s)
        sign = np.where(np.abs(slope) > 0.5, np.sign(slope), 0.0)
        out.append(sign[np.maximum.accumulate(np.where(sign != 0, np.arange(sign.size), 0))])
    return out


def supply_sag(m: Recording, axis: int, r: Random) -> Signal:
    """The supply sags when the motor draws current: an offset by the angular acceleration's size."""
    return [np.sqrt(np.abs(np.gradient(run.rate, run.t_s))) for run in m.runs]


def two_point_heater(m: Recording, axis: int, r: Random) -> Signal:
    """A heater is switched on and off in turn, each time for a little longer or shorter, and warms the board."""
    period_s, out = r.uniform(2, 12), []
    for run in m.runs:
        edges = np.cumsum(period_s / 2 * r.uniform(0.6, 1.4, int(4 * run.t_s[-1] / period_s) + 8)) - period_s * r.random()
        out.append(_relaxed(run, (-1.0) ** np.searchsorted(edges, run.t_s), period_s / 4))
    return out


def ambient_shaking(m: Recording, axis: int, r: Random) -> Signal:
    """The floor shakes in a broad band of low frequencies, more strongly at times."""
    return [_walk(r, run, 0.3, 3.0, 0.5) * (1 + np.sin(2 * np.pi * run.t_s / r.uniform(15, 60))) for run in m.runs]


def broad_quintic(m: Recording, axis: int, r: Random) -> Signal:
    """A nonlinearity of fifth order."""
    return [run.w[axis] ** 5 for run in m.runs]


def run_offsets(m: Recording, axis: int, r: Random) -> Signal:
    """An offset of each run within its power cycle: handling between the runs changes the stress on the board."""
    return [np.full(run.t_s.size, r.standard_t(3)) for run in m.runs]


def second_harmonic_of_slope(m: Recording, axis: int, r: Random) -> Signal:
    """The scale depends on the angular acceleration: w times dw/dt."""
    return [run.w[axis] * np.gradient(run.rate, run.t_s) for run in m.runs]


KINDS: dict[str, Callable[[Recording, int, Random], Signal]] = {
    law.__name__: law
    for law in (
        time_by_temperature, rate_by_settling, direction_by_settling, bump, own_slopes, rate_wave, stick_slip, settling_scale,
        scale_lag, kinked_temperature, temperature_wave, speed_by_power_on, flicker, loop_hunting, cable_at_one_face, magnet,
        gravity_by_rate, stepped_compensation, gradient, mode_change, slow_beat, bursts, scale_step, backlash, mount_creep,
        friction, supply_sag, two_point_heater, ambient_shaking, broad_quintic, run_offsets, second_harmonic_of_slope,
    )
}  # fmt: skip


def without_scale_and_bias(made: Recording, axis: int, raw: Signal) -> Signal:
    """The part of a signal that is orthogonal to scale and bias over all samples of the recording."""
    known = np.concatenate(library.nuisance(made, axis), axis=1)
    flat = np.concatenate(raw)
    size = np.linalg.norm(known, axis=1, keepdims=True)
    left = flat - (known / size).T @ np.linalg.lstsq((known / size).T, flat, rcond=None)[0]
    return np.split(left, np.cumsum([run.t_s.size for run in made.runs])[:-1])
