"""Effects of time in a fit: where the search begins, and Gauss-Newton steps until their values no longer move.

The design holds the derivative of the true rate by each parameter of time at its current value. The linear solution is
therefore one Gauss-Newton step of the exact model, taken together with all other parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from gyrocal.effects.base import Effect, Mask, Values
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Term
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried, fit_noise
from gyrocal.policy import POLICY
from gyrocal.recording.once import once
from gyrocal.recording.session import Array, Run
from gyrocal.recording.timing import SYNCHRONOUS, Motion, Timing

SETTLED = 0.02
"""A value has settled if a step moves it by less than this fraction of its standard error."""
ROUNDS = 20
REACHED = 0.5
"""Values at which fewer of the samples or blocks lie within the reference are not tried: too little would be compared."""
FIRST_S = 20.0
"""The search for a clock's error begins with so much of each run, s, and doubles it until it has all of it."""
LATEST_S = 0.5
"""Largest delay at which the search begins, s; either sign."""
MOST_SAMPLES = 30_000
"""The search for start values uses at most so many samples of all runs, evenly chosen."""
LEAST_SAMPLES = 10
"""Samples of a run, fewer of which are left out of the search."""
HALVINGS = 4
CLOCKS = np.linspace(-0.03, 0.03, 13)
"""Clock errors that are tried on the first part of each run."""


def with_timing(current: AxisFit, term: Term) -> AxisFit:
    """Add an effect of time to a fit, with the noise fitted beside it."""
    runs = [b.run for b in current.design.given]
    terms = started([*current.design.terms, term], runs, current.design.axis)
    design = current.design.changed(terms)
    return settle(fit_noise(design, start=carried(current, design)))


def settle(current: AxisFit) -> AxisFit:
    """Repeat Gauss-Newton steps at the fit's noise until every effect of time stands at its value; then fit the noise again."""
    settled = current
    for _ in range(ROUNDS):
        moved: dict[int, Values] = {}
        for j, (i, _) in enumerate(settled.design.layout.fixed):
            term, step = settled.design.terms[i], float(settled.solution.beta[j])
            if isinstance(term.effect, TimingEffect) and abs(step) > SETTLED * float(np.sqrt(settled.solution.cov[j, j])):
                (name,) = term.effect.linear
                moved[i] = {**term.values, name: term.values[name] + step}
        if not moved:
            break
        terms = [replace(t, values=moved.get(i, t.values)) for i, t in enumerate(settled.design.terms)]
        design = settled.design.changed(terms)
        if design.n_blocks.sum() < REACHED * settled.design.n_blocks.sum():
            break
        settled = carried(settled, design)
    return settled if settled is current else fit_noise(settled.design, start=settled)


def started(terms: Sequence[Term], runs: Sequence[Run], axis: int) -> list[Term]:
    """The terms with start values for the effects of time, which are found together; other terms as they are.

    The delay with the largest correlation is taken for a start. A clock's error is first tried on a grid over the beginning
    of each run. Least squares over twice as much time follow until the whole of each run is used, because a motion that
    repeats itself leaves the error ambiguous over a long time.
    """
    timed = [i for i, t in enumerate(terms) if isinstance(t.effect, TimingEffect)]
    if not timed:
        return list(terms)
    out = [replace(t, values=t.effect.structure(t.values)) if i in timed else t for i, t in enumerate(terms)]
    used = [r.untimed for r in runs if r.axis_index == axis and r.motion is not None]
    if any(out[i].effect.missing([r.timed(SYNCHRONOUS) for r in used], axis) for i in timed):
        return out
    found = _best(used, axis, tuple((out[i].effect, *out[i].values.items()) for i in timed))
    for i, values in zip(timed, found, strict=True):
        out[i] = replace(out[i], values=dict(values))
    return out


@once
def _best(runs: Sequence[Run], axis: int, kinds: Sequence[tuple[Any, ...]]) -> list[Values]:
    """The likeliest values of effects of time, each given as the effect and its values to begin with."""
    return _Search([effect for effect, *_ in kinds], runs, axis).best([dict(values) for _, *values in kinds])


@dataclass(frozen=True)
class _Reading:
    """Some samples of a run: their times [n], readings [n] and the motion of the reference."""

    t_s: Array
    y_dps: Array
    motion: Motion

    @cached_property
    def recorded(self) -> Mask:
        """True for the samples [n] at whose own times the reference was recorded."""
        return np.asarray(self.motion.reached(self.t_s, SYNCHRONOUS))

    @staticmethod
    def of(run: Run, axis: int, every: int) -> _Reading:
        assert run.motion is not None
        return _Reading(run.sample_s[::every], run.gyro_dps[::every, axis], run.motion)


class _Search:
    """Ordinary least squares of the readings on the true rate, each run with its own offset, by the parameters of time."""

    def __init__(self, kinds: Sequence[Effect], runs: Sequence[Run], axis: int) -> None:
        self.kinds = [k for k in kinds if isinstance(k, TimingEffect)]
        every = max(1, round(sum(map(len, runs)) / MOST_SAMPLES))
        self.runs = [_Reading.of(r, axis, every) for r in runs]
        self.samples = sum(r.t_s.size for r in self.runs)
        self.longest_s = max(float(r.t_s[-1] - r.t_s[0]) for r in self.runs)

    def best(self, values: Sequence[Values]) -> list[Values]:
        """The likeliest values of each effect, in the order of the effects."""
        simplest, *others = (list(s) for s in product(*(k.shapes(v) for k, v in zip(self.kinds, values, strict=True))))
        start = self._start(simplest)
        best, least = self._values(simplest, start), self._squares(simplest, start, self.longest_s)
        for shape in others:
            x = self._refined(shape, start, self.longest_s)
            squares = self._squares(shape, x, self.longest_s)
            if squares < least * (1 - 2 * POLICY.shape_gain / self.samples):
                best, least = self._values(shape, x), squares
        return best

    def _start(self, shape: Sequence[Values]) -> Array:
        """The parameters [k] in the simplest shapes of their effects."""
        x = np.zeros(len(shape))
        clock = next((k for k in range(x.size) if self._timing(shape, np.eye(x.size)[k]).clock != 0), None)
        span_s = self.longest_s
        if clock is None:
            x[:] = self._delay_s()
        else:
            span_s = min(FIRST_S, self.longest_s)
            grid = np.outer(CLOCKS, np.eye(x.size)[clock])
            x = min((self._refined(shape, g, span_s) for g in grid), key=lambda g: self._squares(shape, g, span_s))
        x = self._refined(shape, x, span_s)
        while span_s < self.longest_s:
            span_s = min(2 * span_s, self.longest_s)
            x = self._refined(shape, x, span_s)
        return x

    def _values(self, shape: Sequence[Values], x: Array) -> list[Values]:
        return [{**v, k.linear[0]: float(value)} for k, v, value in zip(self.kinds, shape, x, strict=True)]

    def _timing(self, shape: Sequence[Values], x: Array) -> Timing:
        timing = SYNCHRONOUS
        for kind, values in zip(self.kinds, self._values(shape, x), strict=True):
            timing = kind.set(timing, values)
        return timing

    def _equations(self, timing: Timing, span_s: float, slopes: bool = True) -> tuple[Array, Array]:
        """Readings [n] and regressors [n, 1 + k], the true rate and its slopes, without each run's mean."""
        ys, columns = [], []
        for run in self.runs:
            t_s = run.t_s[: int(np.searchsorted(run.t_s, run.t_s[0] + span_s, side="right"))]
            use = run.motion.reached(t_s, timing)
            if use.sum() < LEAST_SAMPLES:
                continue
            by = [kind.derivative(run.motion, t_s, timing) for kind in self.kinds] if slopes else []
            matrix = np.column_stack([run.motion.rate_dps(t_s, timing), *by])[use]
            y = run.y_dps[: t_s.size][use]
            ys.append(y - y.mean())
            columns.append(matrix - matrix.mean(axis=0))
        if not ys:
            return np.zeros(0), np.zeros((0, 1 + len(self.kinds) * slopes))
        return np.concatenate(ys), np.concatenate(columns)

    def _squares(self, shape: Sequence[Values], x: Array, span_s: float) -> float:
        """Mean square of what the true rate leaves of the readings, dps^2; infinite where few lie within the reference."""
        y, columns = self._equations(self._timing(shape, x), span_s, slopes=False)
        recorded = sum(int(np.count_nonzero(r.recorded & (r.t_s <= r.t_s[0] + span_s))) for r in self.runs)
        if y.size < max(1.0, REACHED * recorded):
            return np.inf
        rate = columns[:, 0]
        left = y - rate * (rate @ y) / max(float(rate @ rate), 1e-300)
        return float(np.mean(left**2))

    def _refined(self, shape: Sequence[Values], x: Array, span_s: float) -> Array:
        """Gauss-Newton steps over the first ``span_s`` of each run, halved until the mean square falls."""
        least = self._squares(shape, x, span_s)
        for _ in range(ROUNDS):
            y, columns = self._equations(self._timing(shape, x), span_s)
            size = np.linalg.norm(columns, axis=0) + 1e-300
            found = np.linalg.lstsq(columns / size, y, rcond=1e-9)[0] / size
            step = found[1:] / (found[0] or 1.0)
            trials = ((x + step * 0.5**k, self._squares(shape, x + step * 0.5**k, span_s)) for k in range(HALVINGS))
            trial = next((t for t in trials if t[1] < least * (1 - 1e-6)), None)
            if trial is None:
                break
            x, least = trial
        return x

    def _delay_s(self) -> float:
        """The delay at which readings and true rate correlate most, on an even grid of times."""
        period_s = min(float(r.t_s[-1] - r.t_s[0]) / (r.t_s.size - 1) for r in self.runs)
        most = round(LATEST_S / period_s)
        total = np.zeros(2 * most + 1)
        for run in self.runs:
            even_s = np.arange(run.t_s[0], run.t_s[-1], period_s)
            size = 2 ** int(np.ceil(np.log2(even_s.size + most + 1)))
            parts = (np.interp(even_s, run.t_s, run.y_dps), run.motion.rate_dps(even_s))
            of_reading, of_rate = (np.fft.rfft(p - p.mean(), size) for p in parts)
            total += np.roll(np.fft.irfft(of_reading * of_rate.conj(), size), most)[: 2 * most + 1]
        return (int(np.argmax(np.abs(total))) - most) * period_s
