"""Probes: tests that ask *against what* a model fails, without naming a cause.

A probe is a set of columns like an effect's, but with no physics in it: steps of time, of temperature, a wave in the table's
angle. It is fitted like an effect, noise and all, and judged by the size of its coefficients against their covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from gyrocal.effects.base import Effect, Values, elapsed_s, table_angle_rad
from gyrocal.effects.quantities import rate_about, rate_slope_dps_s, rate_varies
from gyrocal.error_model.model import Term
from gyrocal.inference.blocks import BLOCK_S
from gyrocal.inference.design import SLOW_S
from gyrocal.inference.fit import AxisFit, carry_spreads, fit_noise, likelihood_ratio, with_noise
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array, Run, Session

HANN_NEIGHBOURS = 1.95
"""Neighbouring bins under a Hann window share their noise: so many count as one."""
BANDS = 6
"""Of frequency, between drift and the blocks' own, in which residuals may have more power than noise."""
MAX_STEPS = 16
ORDERS = 6


class Steps(Effect):
    """Indicator columns: the variable in steps, alone or times the true rate. The first step is left to the bias or scale."""

    id, title, cause, equation, looks_like, measure_next = "steps", "", "", "", "", ""
    parameters = ()

    def __init__(self, variable: Callable[[Run], Array], edges: Array, times_rate: bool = False) -> None:
        self.variable = variable
        self.edges = edges
        self.times_rate = times_rate
        self.linear = tuple(f"step_{k}" for k in range(1, edges.size + 1))

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        step = np.searchsorted(self.edges, self.variable(run), side="right")
        columns = (step[:, None] == np.arange(1, self.edges.size + 1)).astype(float)
        if not self.times_rate:
            return columns
        return columns * run.rate_dps[:, None] if axis == run.axis_index else np.zeros_like(columns)


class Linear(Effect):
    """The variable's own columns."""

    id, title, cause, equation, looks_like, measure_next = "linear", "", "", "", "", ""
    parameters = ()

    def __init__(self, variable: Callable[[Run], Array], count: int) -> None:
        self.variable = variable
        self.linear = tuple(f"c{k}" for k in range(count))

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return self.variable(run)


class Transient(Effect):
    """A start-up transient of a size and sign of its own in each run."""

    id, title, cause, equation, looks_like, measure_next = "transient", "", "", "", "", ""
    parameters = ()
    linear = ("size",)
    scope = "run"

    def __init__(self, tau_s: float) -> None:
        self.tau_s = tau_s

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.exp(-elapsed_s(run) / self.tau_s)[:, None]


class Wave(Effect):
    """A wave in the table's angle, of a phase of its own in each run."""

    id, title, cause, equation, looks_like, measure_next = "wave", "", "", "", "", ""
    parameters = ()
    scope = "run"

    def __init__(self, order: int) -> None:
        self.order = order
        self.linear = ("a", "b")

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        angle = self.order * table_angle_rad(run)
        turning = float(np.any(run.rate_dps != 0)) if not run.rate_is_mean else 0.0
        return turning * np.column_stack([np.cos(angle), np.sin(angle)])

    def groups(self, values: Mapping[str, float]) -> list[int]:
        return [0, 0]

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {"sd": float(spread[0])}


@dataclass(frozen=True)
class Finding:
    """What a probe found on one axis. ``chance``: that noise alone does as much; ``strength``: signal to noise, in sigma."""

    axis: str
    against: str
    strength: float
    chance: float
    amplitude_dps: float
    note: str
    kind: Effect | None = field(default=None, repr=False, compare=False)


def beside(current: AxisFit, axis: str, kinds: Sequence[Effect]) -> AxisFit:
    """The model fitted with probes beside it: the noise that is left when what they found is taken out."""
    terms = [Term(f"probe_{i}", axis, dict.fromkeys(kind.linear, 0.0), own=kind) for i, kind in enumerate(kinds)]
    design = current.design.changed([*current.design.terms, *terms])
    return fit_noise(design, start=with_noise(design, current.noise, carry_spreads(current, design)))


def time_edges(longest_s: float) -> Array:
    """Steps of time, fine where transients live."""
    edges = np.concatenate([[0.5, 1, 2, 3, 4.5, 6, 8, 11, 15], np.linspace(20, max(longest_s, 21), 7)[:-1]])
    return edges[edges < 0.95 * longest_s][:MAX_STEPS]


def quantile_edges(values: Array, resolution: float, steps: int) -> Array:
    """Steps that hold equally many samples each, no finer than ``resolution``."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, steps + 1)[1:-1]))
    return (
        edges[np.concatenate([[True], np.diff(edges) > resolution])] if np.ptp(values) > 2 * resolution else np.zeros(0)
    )


def slow_probes(session: Session, axis: int) -> list[tuple[str, list[Effect]]]:
    """The probes that a session allows on one axis, by what they hold the residual against."""
    runs = [r for r in session.runs if not r.rate_is_mean]
    if not runs:
        return []
    probes: list[tuple[str, list[Effect]]] = []
    longest_s = max(r.duration_s for r in runs)
    turning = any(r.axis_index == axis and np.any(r.rate_dps) for r in runs)

    def steps(variable: Callable[[Run], Array], edges: Array) -> list[Effect]:
        return [Steps(variable, edges), *([Steps(variable, edges, times_rate=True)] if turning else [])]

    probes.append(("time", [*steps(elapsed_s, time_edges(longest_s)), Transient(1.0), Transient(4.0)]))
    steps_between = max(2, len(runs) // 3)  # what differs between runs has only so many of them to be judged by
    if all(r.power_on_s is not None for r in runs):
        p_s = np.array([r.power_on_s for r in runs])
        if np.ptp(p_s) > 1.0:  # else it is the time in the run again
            last_s = float(p_s.max()) + longest_s
            edges = np.linspace(float(p_s.min()), last_s, min(12, steps_between + 1))[1:-1]
            probes.append(("power_on_time", steps(lambda r: (r.power_on_s or 0.0) + elapsed_s(r), edges)))
    if all(r.temp_c is not None and np.all(np.isfinite(r.temp_c)) for r in runs):
        pooled = np.concatenate([r.temp_c for r in runs if r.temp_c is not None])
        edges = quantile_edges(pooled, 0.05, min(8, steps_between))
        if edges.size:
            probes.append(("temperature", steps(_temperature, edges)))
    edges = _rate_edges(runs, axis, steps_between)
    if edges.size:
        probes.append(("rate", [Steps(lambda r: _rate(r, runs, axis), edges)]))
    if rate_varies(runs, axis):
        probes.append(("rate", [Linear(lambda r: _rate_slope(r, axis), 2)]))
    if all(r.acc_g is not None and np.all(np.isfinite(r.acc_g)) for r in runs):
        probes.append(("acceleration", [Linear(_acceleration, 3)]))
    if turning:
        if all(r.column("table_angle_deg") is not None for r in runs):
            probes.append(("table_angle", [Linear(_angle_waves, 2 * ORDERS)]))
        else:
            probes.append(("table_angle", [Wave(k) for k in range(1, ORDERS + 1)]))
    return probes


def _one_axis(runs: Sequence[Run]) -> bool:
    return len({r.axis_index for r in runs}) == 1


def _rate(run: Run, runs: Sequence[Run], axis: int) -> Array:
    """The table's rate where it turns about one axis in all runs (that may show on any axis), else the rate about this axis."""
    return run.rate_dps if _one_axis(runs) else rate_about(run, axis)


def _rate_edges(runs: Sequence[Run], axis: int, most: int) -> Array:
    """Between the rates that runs were made at, or of a rate that varies; none where they are too few or too many to judge."""
    rates = [_rate(r, runs, axis) for r in runs]
    largest = max(float(np.abs(rate).max(initial=0.0)) for rate in rates)
    if _one_axis(runs) and rate_varies(runs, runs[0].axis_index):
        return quantile_edges(np.concatenate(rates), 0.02 * largest, 8)
    means = np.unique([float(np.mean(rate)) for rate in rates])
    apart = np.diff(means) > 0.1 * largest  # "78 dps, give or take" is one rate
    edges = ((means[1:] + means[:-1]) / 2)[apart]
    return edges if 2 <= edges.size <= most else np.zeros(0)


def _temperature(run: Run) -> Array:
    assert run.temp_c is not None
    return run.temp_c


def _rate_slope(run: Run, axis: int) -> Array:
    slope = rate_slope_dps_s(run, axis)
    return np.column_stack([slope, slope * elapsed_s(run)])


def _acceleration(run: Run) -> Array:
    assert run.acc_g is not None
    return run.acc_g


def _angle_waves(run: Run) -> Array:
    angle = table_angle_rad(run)
    return np.column_stack([wave(k * angle) for k in range(1, ORDERS + 1) for wave in (np.cos, np.sin)])


def probe(current: AxisFit, axis: str, against: str, kind: Effect, alarm: float) -> Finding | None:
    """Fit a probe beside the model and judge it. None where the session cannot tell it from the model's own terms.

    Judged first with no drift at all, which only a wave that is nowhere can survive; what passes is judged again with drift and
    spreads estimated together with the probe.
    """
    from scipy.stats import chi2

    term = Term("probe", axis, dict.fromkeys(kind.linear, 0.0), own=kind)
    design = current.design.changed([*current.design.terms, term])
    mine = len(design.terms) - 1
    if kind.scope == "run":
        start = with_noise(design, current.noise, carry_spreads(current, design))
        gain = start.loglik - current.loglik
        if gain < 2.0 and current.noise.ou_sd_dps == 0:
            return None
        fitted = fit_noise(design, start=start) if gain > 0.5 else start
        without = with_noise(current.design, fitted.noise, current.spreads).loglik
        gain = max(0.0, fitted.loglik - max(current.loglik, without))
        sd = float(fitted.spreads.run[-1])
        amplitude = sd * float(np.sqrt(2))
        shape = (
            f"{kind.order} a turn, of another phase"
            if isinstance(kind, Wave)
            else "dying away from the start, of another size"
        )
        note = f"{amplitude * 1e3:.3g} mdps, {shape} in each run"
        chance = float(0.5 * chi2.sf(2 * gain, 1)) if sd > 0 else 1.0
        return Finding(axis, against, float(np.sqrt(2 * gain)), chance, amplitude, note, kind)
    columns = [j for j, (i, _) in enumerate(design.layout.fixed) if i == mine]
    if not columns:
        return None
    white = Noise(current.noise.white_sd_dps)
    statistic = _wald(with_noise(design, white, current.spreads), columns)
    chance = float(chi2.sf(statistic, len(columns)))
    if chance < alarm:
        # Wald's statistic trusts a noise that the probe may just have emptied; the likelihood ratio does not
        fitted = fit_noise(design, start=with_noise(design, current.noise, current.spreads))
        statistic, chance = likelihood_ratio(current, fitted, len(columns))
    fit = with_noise(design, current.noise, current.spreads)
    parts = [_part(fit, i, columns) for i in range(len(design.blocks))]
    amplitude = float(np.std(np.concatenate(parts)) * np.sqrt(2))
    strength = float(np.sqrt(max(0.0, statistic - len(columns))))
    return Finding(axis, against, strength, chance, amplitude, _where(kind, fit, columns, amplitude), kind)


def too_much_power(fit: AxisFit, axis: str, alarm: float) -> Finding | None:
    """Residuals with more power in a band of frequencies than white noise and drift have there: the test of whiteness.

    Periodograms (Hann) of the block means' residuals, against their expectation under the fitted noise, which is exact: the
    transform of its autocovariance times the window's. Slower than SLOW_S is drift and not judged; nor are samples, which a
    sensor's low-pass makes anything but white.
    """
    from scipy.signal import fftconvolve
    from scipy.signal.windows import hann
    from scipy.stats import gamma

    noise, p = fit.noise, len(fit.design.layout.fixed)
    parts: list[tuple[Array, Array, Array, Array]] = []  # of each bin: frequency, sum of ratios, runs, power beyond noise
    for index in fit.design.alike:
        first = fit.design.blocks[index[0]]
        t_s, n, m = first.t_s, first.n, first.t_s.size
        if m < 64 or np.ptp(n) > 0 or t_s[1] - t_s[0] < BLOCK_S / 2 or first.run.rate_is_mean:
            continue
        step_s = float(t_s[-1] - t_s[0]) / (m - 1)
        window = hann(m, sym=False)
        lags = np.arange(m)
        covariance = noise.ou_sd_dps**2 * np.exp(-lags * step_s / noise.ou_tau_s)
        covariance[0] += noise.white_sd_dps**2 / float(n[0])
        tapered = covariance * fftconvolve(window, window[::-1])[m - 1 :]
        expected = 2 * np.fft.rfft(tapered, 2 * m).real[::2] - tapered[0]
        residual = np.empty((len(index), m))
        for row, i in zip(residual, index, strict=True):
            columns, u = fit.design.columns(i), fit.run_coefficients(i, fit.solution.beta, fit.spreads)
            row[:] = columns[0] - fit.solution.beta @ columns[1 : 1 + p] - u @ columns[1 + p :]
        power: Array = np.abs(np.fft.rfft((residual - residual.mean(axis=1, keepdims=True)) * window)) ** 2
        ratio, beyond = power / expected, 2 * (power - expected) / (m * float(window @ window))
        frequency: Array = np.fft.rfftfreq(m, step_s).astype(np.float64)
        use = (frequency > max(1 / SLOW_S, 2.5 / (m * step_s))) & (frequency < 0.49 / step_s)
        runs: Array = np.full(frequency.size, float(len(index)))
        parts.append((frequency[use], ratio.sum(axis=0)[use], runs[use], beyond.sum(axis=0)[use]))
    if not parts:
        return None
    frequencies, ratios, counts, powers = (np.concatenate(x) for x in zip(*parts, strict=True))
    edges = np.geomspace(frequencies.min(), frequencies.max() * (1 + 1e-9), BANDS + 1)
    worst: Finding | None = None
    for low, high in pairwise(edges):
        band = (frequencies >= low) & (frequencies < high)
        looks = float(counts[band].sum()) / HANN_NEIGHBOURS
        if looks < 4:
            continue
        mean = float(ratios[band].sum() / counts[band].sum())
        chance = min(1.0, BANDS * float(gamma.sf(mean * looks, looks)))
        amplitude = float(np.sqrt(max(0.0, 2 * powers[band].sum() / counts[band].mean())))
        note = f"{amplitude * 1e3:.3g} mdps between {low:.2g} and {high:.2g} Hz beyond noise"
        if chance < alarm and (worst is None or chance < worst.chance):
            worst = Finding(axis, "frequency", (mean - 1) * float(np.sqrt(looks)), chance, amplitude, note)
    return worst


def _where(kind: Effect, fit: AxisFit, columns: Sequence[int], amplitude_dps: float) -> str:
    size = f"{amplitude_dps * 1e3:.3g} mdps"
    if not isinstance(kind, Steps):
        return f"{size} in all"
    unit, scaled = ("1e-6 of the rate", 1e6) if kind.times_rate else ("mdps", 1e3)
    names = [fit.design.layout.fixed[c][1] for c in columns]
    values = dict(zip(names, fit.solution.beta[list(columns)], strict=True))
    centred = {k: v - float(np.mean(list(values.values()) or [0.0])) for k, v in values.items()}
    k = max(centred, key=lambda j: abs(centred[j]))
    low = f"{kind.edges[k]:.4g}"
    high = f" to {kind.edges[k + 1]:.4g}" if k + 1 < kind.edges.size else " and more"
    return f"{size} in all; most, {centred[k] * scaled:+.3g} {unit}, from {low}{high}"


def _wald(fit: AxisFit, columns: Sequence[int]) -> float:
    beta = fit.solution.beta[list(columns)]
    cov = fit.solution.cov[np.ix_(columns, columns)]
    return float(beta @ np.linalg.solve(cov, beta))


def _part(fit: AxisFit, i: int, columns: Sequence[int]) -> Array:
    return fit.solution.beta[list(columns)] @ fit.design.columns(i)[[1 + c for c in columns]]
