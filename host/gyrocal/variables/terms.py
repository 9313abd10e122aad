"""Terms of formulas in one variable, as text, that ``keep`` chooses among for what no effect explains."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array

KNOTS = 31
"""Bends that a piecewise-linear curve may have, where the variable's values are evenly many."""
HARMONICS = 8
DECAYS = (2, 5, 10, 20, 40)
"""Time constants of decays, as parts of the longest time."""


def functions(symbol: str, values: Array) -> list[str]:
    """Powers, sines, exponentials and a kink in a variable, centred and scaled so that coefficients are in deg/s."""
    low, high = np.quantile(values, [0.01, 0.99])
    half = rounded((high - low) / 2)
    if half == 0:
        return []
    middle = 0.0 if low < 0 < high else rounded((high + low) / 2, 3)
    u = f"({symbol}/{half:g})" if middle == 0 else f"(({symbol} - {middle:g})/{half:g})"
    return [u, f"{u}**2", f"{u}**3", f"{u}**4", f"abs{u}", f"exp{u}", f"exp(-{u})", f"sin(pi*{u})", f"cos(pi*{u})"]


def of_time(symbol: str, values: Array) -> list[str]:
    """Powers of a time and decays from its beginning."""
    low, high = np.quantile(values, [0.01, 0.99])
    if rounded((high - low) / 2) == 0:
        return []
    u = f"({symbol}/{rounded(high):g})"
    return [u, f"{u}**2", f"{u}**3", *(f"exp(-{symbol}/{rounded(high / k):g})" for k in DECAYS)]


def of_turns(symbol: str, angle: str) -> list[str]:
    """Harmonics of an angle (rad), a sawtooth and a triangle in the part of a turn that ``symbol`` is."""
    waves = [f"{wave}({k}*{angle})" for k in range(1, HARMONICS + 1) for wave in ("cos", "sin")]
    return [*waves, f"({symbol} - 0.5)", f"abs({symbol} - 0.5)"]


def hinges(symbol: str, values: Array) -> list[str]:
    """A line, and a bend at each of some knots: together any piecewise-linear curve."""
    if float(np.ptp(values)) == 0:
        return []
    knots = [rounded(float(k), 3) for k in np.quantile(values, np.arange(1, KNOTS + 1) / (KNOTS + 1))]
    return [symbol, *dict.fromkeys(f"max({symbol} - {k:g}, 0)".replace("- -", "+ ") for k in knots)]


def rounded(value: float, digits: int = 2) -> float:
    """A number to so many significant digits."""
    return float(f"{value:.{digits}g}")
