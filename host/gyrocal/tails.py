"""Probabilities that a random variable of a usual distribution exceeds a value.

They are those of ``scipy.stats``, which takes half a second to import, computed with ``scipy.special`` alone. Values may be
arrays; all arguments are broadcast.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Z95 = 1.959964
"""Standard deviations of a normal variable within which 95 % of it lie."""
ROBUST = 1.4826
"""Standard deviation of a normal variable over the median of its distance from its median."""


def normal(z: Any) -> Any:
    """P(Z > z) of a standard normal variable."""
    from scipy.special import ndtr

    return ndtr(-np.asarray(z))


def normal_z(chance: Any) -> Any:
    """The z that a standard normal variable exceeds with a probability."""
    from scipy.special import ndtri

    return -ndtri(chance)


def chi_square(value: Any, freedom: Any) -> Any:
    """P(X > value) of chi-square with ``freedom`` degrees of freedom."""
    from scipy.special import chdtrc

    return chdtrc(freedom, np.maximum(value, 0.0))


def chi_square_value(chance: Any, freedom: Any) -> Any:
    """The value that chi-square with ``freedom`` degrees of freedom exceeds with a probability."""
    from scipy.special import chdtri

    return chdtri(freedom, chance)


def f_ratio(value: Any, above: Any, below: Any) -> Any:
    """P(X > value) of the F distribution with ``above`` and ``below`` degrees of freedom of numerator and denominator."""
    from scipy.special import fdtrc

    return fdtrc(above, below, np.maximum(value, 0.0))


def binomial(least: float, number: float, share: float) -> float:
    """P(X >= least) of successes in ``number`` trials, each with the probability ``share``."""
    from scipy.special import betainc

    return 1.0 if least <= 0 else 0.0 if least > number else float(betainc(least, number - least + 1, share))


def poisson(least: float, mean: float) -> float:
    """P(X >= least) of a Poisson variable with a mean."""
    from scipy.special import gammainc

    return 1.0 if least <= 0 else float(gammainc(least, mean))


def student(value: Any, freedom: Any) -> Any:
    """P(X > value) of Student's t with ``freedom`` degrees of freedom."""
    from scipy.special import stdtr

    return stdtr(freedom, -np.asarray(value))


def student_value(chance: Any, freedom: Any) -> Any:
    """The value that Student's t with ``freedom`` degrees of freedom exceeds with a probability."""
    from scipy.special import stdtrit

    return -stdtrit(freedom, chance)


def widening_to_95(freedom: float) -> float:
    """The factor on a standard error of ``freedom`` degrees of freedom, at least one, with which 1.96 of it hold 95 %."""
    return float(student_value(0.025, max(freedom, 1.0))) / Z95


def student_log_density(value: Any, freedom: float) -> Any:
    """Logarithm of the density of Student's t with ``freedom`` degrees of freedom."""
    from scipy.special import gammaln

    norm = gammaln((freedom + 1) / 2) - gammaln(freedom / 2) - 0.5 * np.log(freedom * np.pi)
    return norm - (freedom + 1) / 2 * np.log1p(np.square(value) / freedom)
