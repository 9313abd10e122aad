"""Terms of formulas in one variable, as text, from which ``keep`` chooses."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array

KNOTS = 31
"""Largest number of bends of a piecewise-linear curve. Equally many values lie between them."""
HARMONICS = 8
DECAYS = (2, 5, 10, 20, 40)
"""The time constants of decays are the longest time divided by these."""


def functions(symbol: str, values: Array) -> list[str]:
    """Powers, sines, exponentials and a kink of a variable, which is centred and scaled so that coefficients are in deg/s."""
    low, high = np.quantile(values, [0.01, 0.99])
    half = rounded((high - low) / 2)
    if half == 0:
        return []
    middle = 0.0 if low < 0 < high else rounded((high + low) / 2, 3)
    u = f"({symbol}/{half:g})" if middle == 0 else f"(({symbol} - {middle:g})/{half:g})"
    return [u, f"{u}**2", f"{u}**3", f"{u}**4", f"abs{u}", f"exp{u}", f"exp(-{u})", f"sin(pi*{u})", f"cos(pi*{u})"]


def of_time(symbol: str, values: Array) -> list[str]:
    """Powers of a time with values [n], s, and exponential decays from zero."""
    low, high = np.quantile(values, [0.01, 0.99])
    if rounded((high - low) / 2) == 0:
        return []
    u = f"({symbol}/{rounded(high):g})"
    return [u, f"{u}**2", f"{u}**3", *(f"exp(-{symbol}/{rounded(high / k):g})" for k in DECAYS)]


def of_turns(symbol: str, angle: str) -> list[str]:
    """Harmonics of an angle (rad), and a sawtooth and a triangle wave of ``symbol``, which is a fraction of a turn."""
    waves = [f"{wave}({k}*{angle})" for k in range(1, HARMONICS + 1) for wave in ("cos", "sin")]
    return [*waves, f"({symbol} - 0.5)", f"abs({symbol} - 0.5)"]


def hinges(symbol: str, values: Array) -> list[str]:
    """A line and a bend at each of the knots within values [n]. Their sums are the piecewise-linear curves with these knots."""
    if float(np.ptp(values)) == 0:
        return []
    knots = [rounded(float(k), 3) for k in np.quantile(values, np.arange(1, KNOTS + 1) / (KNOTS + 1))]
    return [symbol, *dict.fromkeys(f"max({symbol} - {k:g}, 0)".replace("- -", "+ ") for k in knots)]


def rounded(value: float, digits: int = 2) -> float:
    """A number rounded to a few significant digits, as text."""
    return float(f"{value:.{digits}g}")
