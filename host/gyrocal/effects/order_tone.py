"""A tone that is fixed to the angle of the table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gyrocal.effects.base import (
    Case,
    Effect,
    Law,
    Looks,
    Objection,
    Parameter,
    Refinement,
    Tried,
    Values,
    elapsed_s,
    table_angle_rad,
)
from gyrocal.effects.earth_rate import may_be_in_plane
from gyrocal.effects.quantities import TURNING_AT_ALL, rate_about
from gyrocal.effects.wave import LEAST_RUNS, ONE_RATE, TableWave, Tone
from gyrocal.noise.orders import HIGHEST, LEAST_TURNS, OrderPeak, OrderSpectrum, order_spectrum, strongest_orders
from gyrocal.noise.spectrum import LOWEST_HZ
from gyrocal.parameter import POSITIVE
from gyrocal.policy import POLICY
from gyrocal.recording.once import once
from gyrocal.recording.session import Array, Run

PEAKS = 4
NEAR_WHOLE = 0.05
"""Difference in periods per turn from a whole number within which a fitted order is that number."""
LEFT_OF_RIPPLE = 0.2
"""Amplitude of a tone, as a fraction of a ripple of the same order, below which it may be what a delay leaves of the ripple."""
AT_REST = 0.1
"""Rate, as a fraction of the run's fastest, below which the table passes so slowly that its angle shows noise and no wave."""
BACK = 0.5
"""Fastest turn back, as a fraction of the fastest turn, from which on a run turns both ways."""
FEW_TURNS = 0.5
"""Angle, in turns, from which on a run shows a wave over it."""
WHOLE = (1.0, 2.0, 3.0, 4.0)
"""Orders that are tried there."""
HARMONIC = 0.3
"""Amplitude of a harmonic, as a fraction of the strongest line's, from which on the wave is no tone."""
EXACT = 0.1
"""Distance of a fitted frequency from a whole number of periods per turn, as a part of the resolution of the turns, within
which it is that number."""
NOT_WHOLE = 0.25
"""Distance of a fitted order from a whole number, as a part of that resolution, from which on it is none. The error of the
weakest order that is named is an eighth of the resolution."""
OF_A_PULSE = range(1, 7)
"""Orders of which several stand out in a pulse once a turn."""
SEVERAL, STANDS_OUT = 3, 0.05
"""How many of them make a pulse, and the chance below which one of them stands out."""


def turned_turn(run: Run) -> Array:
    """The table's angle without jumps from one turn to the next, shape [n], turns."""
    angle_rad = table_angle_rad(run)
    return (angle_rad if run.column("table_angle_deg") is None else np.unwrap(angle_rad)) / (2 * np.pi)


@once
def spectrum_over_turns(runs: Sequence[Run], axis: int) -> OrderSpectrum:
    """The spectrum over the table's angle of measured minus true rate on one axis, each run without its slow errors."""
    turning = [r for r in runs if turns(r)]
    return over_turns(turning, [_rest_dps(r, axis) for r in turning], axis)


def waves_per_turn(runs: Sequence[Run], axis: int, orders: Sequence[int]) -> NDArray[np.complex128]:
    """Complex amplitudes [turning runs, orders] of measured minus true rate over whole turns of the table, deg/s."""
    out = []
    for run in runs:
        turn, whole = _whole_turns(run)
        if whole.any():
            rest_dps = _rest_dps(run, axis)[whole]
            out.append([2 * np.mean(rest_dps * np.exp(-2j * np.pi * k * turn[whole])) for k in orders])
    return np.array(out, dtype=complex).reshape(len(out), len(orders))


def mean_wave_per_turn(run: Run, values: Array) -> list[NDArray[np.complex128]]:
    """Complex amplitudes [k] once per turn of ``values`` [n, k], in a list; none of a run of less than a turn."""
    turn, whole = _whole_turns(run)
    return [2 * np.mean(values[whole] * np.exp(-2j * np.pi * turn[whole])[:, None], axis=0)] if whole.any() else []


def _whole_turns(run: Run) -> tuple[Array, NDArray[np.bool_]]:
    """The angle from the start of a run, shape [n], turns, and where it is within whole turns of a table that turns."""
    turn = turned_turn(run) - turned_turn(run)[0] if turns(run) else np.zeros(len(run))
    return turn, np.abs(turn) < np.floor(np.abs(turn[-1:]).sum())


def over_turns(turning: Sequence[Run], residuals: Sequence[Array], axis: int) -> OrderSpectrum:
    """The spectrum over the table's angle of an axis's residuals [n] in runs that turn, without samples at rest."""
    moves = [np.abs(r.rate_dps) > AT_REST * np.abs(r.rate_dps).max() for r in turning]
    turned = [turned_turn(r)[m] for r, m in zip(turning, moves, strict=True)]
    count_dps = max((r.count_dps(axis) for r in turning), default=0.0)
    return order_spectrum([y[m] for y, m in zip(residuals, moves, strict=True)], turned, count_dps=count_dps)


def _rest_dps(run: Run, axis: int) -> Array:
    """Measured minus true rate [n] of one run without what smooth functions of time, of the rate and of its slope explain.

    An asymmetry, a delay or a scale that changes with the temperature would hide a wave of their size.
    """
    w, t = run.rate_dps / max(float(np.abs(run.rate_dps).max()), 1e-9), elapsed_s(run) / max(run.duration_s, 1e-9)
    slope = np.gradient(w) if len(run) > 1 else 0.0 * w
    known = np.column_stack([np.ones(len(run)), w, t, t**2, np.abs(w), w**3, t * w, slope, t * slope])
    known /= np.maximum(np.linalg.norm(known, axis=0), 1e-12)
    y_dps = run.gyro_dps[:, axis] - run.rate_dps * (axis == run.axis_index)
    return np.asarray(y_dps - known @ np.linalg.lstsq(known, y_dps, rcond=1e-9)[0])


@once
def _lines(runs: Sequence[Run], axis: int) -> list[OrderPeak]:
    """The strongest lines over the table's angle, strongest first.

    Where a line may as well be a frequency, these are whole numbers per turn. One run shows neither, so that each of its lines
    fast enough for a vibration is a rival of one. There is none if the strongest has a strong harmonic, or if it is one of
    several at whole numbers per turn: the wave then has another shape, as a sawtooth or a pulse has.
    """
    spectrum = spectrum_over_turns(runs, axis)
    peaks = spectrum.peaks(4 * PEAKS)
    if any(_harmonic(p, peaks[0]) for p in peaks[1:]) or (peaks and peaks[0].whole is not None and _is_pulse(spectrum)):
        return []
    told, turning = told_from_frequency(runs, FEW_TURNS), [r for r in runs if turns(r)]
    slowest = LOWEST_HZ * 360 / float(np.abs(turning[0].rate_dps).max()) if len(turning) == 1 else np.inf
    return [p for p in peaks if p.whole is not None or told or p.order > slowest]


def told_from_frequency(runs: Sequence[Run], least_turns: float = LEAST_TURNS) -> bool:
    """True if runs tell a line over the table's angle from one over time: the table turns at several rates, or it turns back.

    At a known angle, a wave that is fixed to the table goes back with it. A vibration does not. Runs of fewer than
    ``least_turns`` do not count: a fit of both waves uses them, but the spectrum over turns does not.
    """
    turning = [r for r in runs if turns(r) and np.ptp(turned_turn(r)) >= least_turns]
    rates_dps = [float(np.sqrt(np.mean(r.rate_dps**2))) for r in turning]
    several = bool(rates_dps) and np.ptp(rates_dps) >= ONE_RATE * max(rates_dps)
    known = all(r.column("table_angle_deg") is not None for r in turning)
    both_ways = [min(r.rate_dps.max(), -r.rate_dps.min()) > BACK * np.abs(r.rate_dps).max() for r in turning]
    return bool(several or (known and any(both_ways)))


def _few_turns(runs: Sequence[Run]) -> bool:
    """True if the runs turn too little for a spectrum over the angle, and their angle or several rates show a tone yet."""
    turning = [r for r in runs if turns(r)]
    known = all(r.column("table_angle_deg") is not None for r in turning)
    shown = known or (len(turning) >= LEAST_RUNS and told_from_frequency(runs, FEW_TURNS))
    return shown and FEW_TURNS <= swept_turns(runs) < LEAST_TURNS


@once
def _over_few_turns(runs: Sequence[Run], axis: int) -> list[float]:
    """The orders with the largest power over runs that each turn too little for a spectrum."""
    turning = [r for r in runs if turns(r)]
    return strongest_orders([_rest_dps(r, axis) for r in turning], [turned_turn(r) for r in turning], PEAKS)


def _harmonic(peak: OrderPeak, strongest: OrderPeak) -> bool:
    ratio = peak.order / strongest.order
    multiple = round(ratio) > 1 and abs(ratio - round(ratio)) * strongest.order < peak.resolution
    strong = peak.amplitude_dps > HARMONIC * strongest.amplitude_dps and peak.chance < POLICY.name_alarm
    return multiple and strong


def _is_pulse(spectrum: OrderSpectrum) -> bool:
    """True if several of the first orders stand out, as those of what passes the sensor once a turn."""
    at = [int(np.argmin(np.abs(spectrum.order - k))) for k in OF_A_PULSE]
    amplitude_dps, tail = np.sqrt(spectrum.power[at]), spectrum.tail[at]
    return int(np.count_nonzero((amplitude_dps > HARMONIC * amplitude_dps.max()) & (tail < STANDS_OUT))) >= SEVERAL


def strong_orders(runs: Sequence[Run], axis: int) -> dict[int, float]:
    """The amplitudes, deg/s, of the significant lines at a whole number of periods per turn, by that number."""
    peaks = spectrum_over_turns(runs, axis).peaks(4 * PEAKS)
    return {p.whole: p.amplitude_dps for p in reversed(peaks) if p.whole is not None and p.chance < POLICY.name_alarm}


def harmonic_of_turn(runs: Sequence[Run], axis: int, f_hz: float) -> bool:
    """True if a frequency is one of several strong lines at whole numbers of periods per turn, at the only rate of the table.

    What passes the sensor once a turn, such as a magnet beside the table, has many of them. Each alone resembles a vibration.
    """
    turning = [r for r in runs if turns(r)]
    if not turning or told_from_frequency(runs, FEW_TURNS):
        return False
    turns_hz = float(np.mean([np.sqrt(np.mean(r.rate_dps**2)) for r in turning])) / 360
    order = round(f_hz / turns_hz)
    if abs(f_hz / turns_hz - order) * swept_turns(runs) > EXACT:
        return False
    lines = strong_orders(runs, axis)
    return any(size > HARMONIC * lines.get(order, 0.0) for k, size in lines.items() if k != order)


def swept_turns(runs: Sequence[Run]) -> float:
    """The largest angle that one of the runs sweeps, turns; lines over the angle are no finer than one over it."""
    return max((float(np.ptp(turned_turn(r))) for r in runs if turns(r)), default=0.0)


def turns(run: Run) -> bool:
    """True for a run whose true rate is known from moment to moment and is not zero throughout."""
    return not run.rate_is_mean and bool(np.any(run.rate_dps))


def _ripple_dps(order: int, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]) -> float:
    """The largest amplitude of a ripple of the same order among the ``known`` effects, deg/s; 0 if there is none.

    Where a table of known angle reverses, a ripple leaves a small tone over, because readings are late.
    """
    largest_dps = max((float(np.abs(rate_about(r, axis)).max()) for r in runs), default=0.0)
    return max((
        of[name] * largest_dps
        for effect, of in known
        if isinstance(effect, TableWave)
        for name, k in zip(effect.linear, effect.orders, strict=True)
        if k == order and name in of
    ), default=0.0)  # fmt: skip


class OrderTone(Tone):
    id = "order_tone"
    title = "A tone fixed to the table's angle"
    cause = (
        "A motor's poles, a gear's teeth, a belt's seam or a bearing's balls pass at a fixed number per turn and shake or tilt "
        "the table. The size is the same at every rate, but the frequency follows the rate. Gravity on a tilted table and "
        "magnets beside it are such tones too, on any axis."
    )
    equation = "A_dps·sin(order·th + phase), where th is the table's angle"
    looks_like = (
        "vibration_tone, if the table turns at one rate only; table_ripple, whose size grows with the rate; g_sensitivity "
        "on a tilted table, once per turn"
    )
    measure_next = (
        "a second rate of the table: an order keeps its number per turn and its size, a vibration keeps its frequency, and a "
        "ripple of the table's speed grows with the rate"
    )
    parameters = (
        Parameter(
            "order", "per turn", (0.5, 64.0), "poles, teeth and balls of tables: one to some tens per turn", 5.0, POSITIVE,
            search=(0.3, HIGHEST), sized=False,
        ),
        Parameter("A_dps", "dps", (0.005, 0.3), "shaking of small turntables, as vibration_tone", 0.03),
        Parameter("phase_deg", "deg", (-180.0, 180.0), "the table's angle at the start", sized=False),
    )  # fmt: skip
    nonlinear = ("order",)
    fixed_by = "table_angle_deg"
    rate_power = 0.0
    on_device = True
    law = Law({"order": 5.0, "A_dps": 0.02, "phase_deg": 90.0}, "0.02*cos(5*theta)")
    cases = (Case({"order": 5.0, "A_dps": 0.05}, ("order",), "full"), Case({"order": 2.5, "A_dps": 0.05}, ("order",), "full"))

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if any(map(turns, runs)) else TURNING_AT_ALL

    @staticmethod
    def holds_unknown(run: Run) -> bool:
        """True at rest: a tilt's or a magnet's tone then holds its value at the standing angle, which is not in the model."""
        return not run.rate_is_mean and not turns(run)

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """The strongest line over the table's angle and other significant ones.

        An order is a whole number per turn where the runs cannot tell it from one. Over few turns, the first whole numbers
        and the orders of the largest power are tried.
        """
        if _few_turns(runs):
            return [{"order": order, "A_dps": 0.0} for order in (*WHOLE, *_over_few_turns(runs, axis))]
        lines = _lines(runs, axis)[:PEAKS]
        peaks = [p for p in lines if p is lines[0] or p.chance <= POLICY.false_discovery_rate]
        return [{"order": float(p.whole or p.order), "A_dps": 0.0} for p in peaks] or [{"order": 1.0, "A_dps": 0.0}]

    def looks(self, runs: Sequence[Run], axis: int) -> Looks:
        if _few_turns(runs):
            return Looks(len(WHOLE) + round(HIGHEST * swept_turns(runs)))
        return Looks(max(len(WHOLE), int(spectrum_over_turns(runs, axis).order.size)))

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        """The line that counts is the strongest one over the table's angle. Over few turns there is no spectrum of it."""
        if _few_turns(runs):
            return super().tried_on(runs, axis, 0.0)
        peaks = _lines(runs, axis)
        return super().tried_on(runs, axis, peaks[0].chance) if peaks else None

    def highest_hz(self, runs: Sequence[Run], values: Mapping[str, float]) -> float:
        return values["order"] * max(float(np.abs(r.rate_dps).max()) for r in runs) / 360

    def refinement(self, name: str, values: Mapping[str, float], runs: Sequence[Run], axis: int) -> Refinement:
        turned = max((float(np.ptp(turned_turn(r))) for r in runs if turns(r)), default=1.0)
        return Refinement(0.1 / (values["order"] * max(turned, 0.1)))

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """Nothing fixes an order beside a whole number to the table's angle at the only rate of the table.

        Once per turn, an axis in the table's plane reads the Earth's rate, and a ripple leaves a small tone of its own order.
        """
        order = round(values["order"])
        beside, several = abs(values["order"] - order), sum(map(turns, runs)) > 1
        if several and not told_from_frequency(runs, FEW_TURNS) and beside * swept_turns(runs) >= NOT_WHOLE:
            yield Objection.UNSEEN
        if beside <= NEAR_WHOLE:
            of_earth = order == 1 and may_be_in_plane(runs, axis, values["A_dps"])
            if of_earth or values["A_dps"] < LEFT_OF_RIPPLE * _ripple_dps(order, runs, axis, known):
                yield Objection.REPEATS

    def periods(self, run: Run, values: Mapping[str, float]) -> Array:
        return values["order"] * turned_turn(run)

    def wave(self, run: Run, axis: int, values: Mapping[str, float], name: str) -> NDArray[np.complex128]:
        """The wave of a tone, shape [n]. It is zero on a table at rest, where it would be an offset."""
        return super().wave(run, axis, values, name) if turns(run) else np.zeros(len(run), dtype=complex)
