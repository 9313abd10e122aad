"""Frequency: lines, bumps and bands of the residual's spectrum."""

from __future__ import annotations

from gyrocal.variables.base import Variable


class Frequency(Variable):
    name, title, quantity, unit, order = "frequency", "Spectrum", "frequency", "Hz", 8
    picture = "spectrum"
    no_formula = "it is a line in the spectrum but not a steady tone; look for a source of vibration, or record for longer"
