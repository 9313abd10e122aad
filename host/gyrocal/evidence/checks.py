"""Two checks of an effect that leads, which a person understands and a picture can show.

*Share*: of what the effect and a rest without a name explain together on the axis, the effect explains most. *The same in
parts*: its coefficient is the same early and late in the runs, slow and fast, in both directions, in early and late power
cycles, cold and warm, soon and long after power-on. A disturbance that resembles an effect passes for it as a whole, but hardly
in each part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Effect, elapsed_s
from gyrocal.effects.quantities import cycle_time_s, temperature_c, true_rate_dps
from gyrocal.evidence.checked import Checks
from gyrocal.evidence.hypotheses import Free, Option
from gyrocal.evidence.matrix import Index, Matrix, runs_of
from gyrocal.evidence.states import beside_model, integrated
from gyrocal.evidence.weights import Scales, Weighed
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Run

STATES = 6
"""Number of the likeliest states of the noise over which the probability of different coefficients is averaged."""
LEAST_APART = 1e-9
"""Power of a part's column beside the model, as a part of the effect's, below which it is the rounding of sums."""


@dataclass(frozen=True, eq=False)
class _Part(Free):
    """A fitted term in one half of the data, less its mean in both."""

    option: Option
    coefficients: Array
    half: Callable[[Run], Array | None]
    share: float

    @property
    def effect(self) -> Effect:
        return self.option.effect

    def columns(self, run: Run, axis: int) -> Array:
        half = self.half(run)
        if half is None:
            return np.zeros((len(run), 1))
        return np.asarray((self.option.columns(run, axis) @ self.coefficients * (half - self.share))[:, None])


def check(scales: Scales, weighed: Weighed, effects: Sequence[str]) -> dict[str, Checks]:
    """Both checks of some effects of a set."""
    matrix, forms = scales.matrix, weighed.forms
    found = scales.coefficients(weighed, int(np.argmax(weighed.bare)), None)
    parts: list[tuple[str, _Part]] = []
    for effect in effects:
        option = matrix.options[forms[effect][0]]
        term = found[effect] * option.unit
        parts += [(effect, part) for part in _parts(matrix, option, term)]
    shares = _shares(scales, weighed)
    chances = _chances(scales, weighed, found, parts)
    return {effect: Checks(shares[effect], *chances.get(effect, (None, 0.0))) for effect in effects}


def _shares(scales: Scales, weighed: Weighed) -> dict[str, float]:
    """Each effect's part of the power of effect and rest, beside bias and scale."""
    rest = weighed.rest or scales.likeliest_rest(weighed)
    found = scales.coefficients(weighed, weighed.state, rest)
    plain = scales.states.products[0]

    def power(at: Index, coefficients: Array) -> float:
        return float(coefficients @ plain[np.ix_(at, at)] @ coefficients)

    left = power(scales.matrix.left[rest.shape], found[""]) if rest is not None else 0.0
    own = {e: power(scales.matrix.at[weighed.forms[e][0]], found[e]) for e in weighed.effects}
    return {e: p / max(p + left, 1e-300) for e, p in own.items()}


def _parts(matrix: Matrix, option: Option, coefficients: Array) -> Iterator[_Part]:
    runs = [run for run in runs_of(matrix.fit) if not run.rate_is_mean]
    for half in _halves(runs):
        known = [h for run in runs if (h := half(run)) is not None]
        share = float(np.mean(np.concatenate(known))) if known else 0.0
        if 0.0 < share < 1.0:
            yield _Part(option, coefficients, half, share)


def _halves(runs: Sequence[Run]) -> list[Callable[[Run], Array | None]]:
    """For each way to part the data, the samples of the second half: 1, the others 0; None where a run does not know."""
    cycles = list(dict.fromkeys(run.scenario for run in runs))
    late = set(cycles[(len(cycles) + 1) // 2 :])

    def above(values: Callable[[Run], Array | None]) -> Callable[[Run], Array | None]:
        known = [found for run in runs if (found := values(run)) is not None]
        middle = float(np.median(np.concatenate(known))) if known else 0.0

        def of(run: Run) -> Array | None:
            found = values(run)
            return None if found is None else (found > middle).astype(float)

        return of

    return [
        above(elapsed_s), above(lambda run: np.abs(true_rate_dps(run))), above(temperature_c), above(cycle_time_s),
        lambda run: (true_rate_dps(run) > 0).astype(float),
        lambda run: np.full(len(run), float(run.scenario in late)),
    ]  # fmt: skip


def _chances(
    scales: Scales, weighed: Weighed, found: Mapping[str, Array], parts: Sequence[tuple[str, _Part]]
) -> dict[str, tuple[float, float]]:
    """For each effect, the probability that noise makes its coefficients differ as much between the parts of any pair.

    It is averaged over the states in which the noise may be. Beside it stands the rms of the largest difference that noise does
    not explain, in parts of the effect's rms. ``found`` holds the coefficients of the effects.
    """
    if not parts:
        return {}
    whole = scales.matrix
    order = sorted(weighed.effects)
    options = [whole.options[weighed.forms[e][0]] for e in order]
    matrix = Matrix.of(
        whole.fit, options, further=[part for _, part in parts], released=whole.released, white_sd_dps=whole.white_sd_dps
    )
    taken, columns = np.concatenate(matrix.at), np.concatenate(matrix.further)
    sd = np.concatenate([scales.sd(*weighed.forms[e]) for e in order])
    states = scales.states
    white = beside_model(matrix, states.noises[0], states.spreads[0])
    plain = np.diagonal(white)[columns]
    power = {e: float(found[e] @ white[np.ix_(at, at)] @ found[e]) for e, at in zip(order, matrix.at, strict=True)}
    apart = plain > LEAST_APART * np.array([power[e] for e, _ in parts])  # else rounding alone is left beside the model
    likeliest = np.argsort(weighed.bare)[::-1][:STATES]
    chances, differences, shown = np.zeros(columns.size), np.zeros(columns.size), np.zeros(columns.size, dtype=bool)
    for state in likeliest.tolist():
        products = integrated(beside_model(matrix, states.noises[state], states.spreads[state])[None], taken, sd)[0][0]
        norm, variance = np.diagonal(products)[columns], products[0, 0] / states.degrees
        seen = apart & (norm > POLICY.shown_in_part * plain)
        statistic = np.where(seen, products[columns, 0] ** 2 / np.where(seen, norm, 1.0) / variance, 0.0)
        chances += weighed.bare[state] * np.array([float(tails.chi_square(s, 1)) for s in statistic])
        differences += weighed.bare[state] * np.where(seen, np.abs(products[columns, 0]) / np.where(seen, norm, 1.0), 0.0)
        shown |= seen
    known = weighed.bare[likeliest].sum()
    chances, differences = chances / known, differences / known
    out: dict[str, tuple[float, float]] = {}
    for effect in dict.fromkeys(effect for effect, _ in parts):
        mine = np.array([other == effect for other, _ in parts]) & shown
        if mine.any():
            count = int(mine.sum())
            beyond = mine & (chances * count < POLICY.different_chance)
            largest = differences[beyond] * np.sqrt(plain[beyond] / max(power[effect], 1e-300))
            out[effect] = min(1.0, float(chances[mine].min()) * count), float(largest.max(initial=0.0))
    return out
