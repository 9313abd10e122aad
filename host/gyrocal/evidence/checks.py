"""Two checks of an effect that leads, which a person understands and a picture can show.

*Share*: of what the effect and a rest without a name explain together on the axis, the effect explains most. *The same in
parts*: its coefficient is the same in both parts of each pair of :data:`PAIRS` of which the data have both and which show it. A
disturbance that resembles an effect passes for it as a whole, but hardly in each part.
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
Half = Callable[[Run], Array | None]
"""The samples of the second half of the data: 1, the others 0; None where a run does not know."""


@dataclass(frozen=True, eq=False)
class _Part(Free):
    """A fitted term in one half of the data, less its mean in both."""

    option: Option
    coefficients: Array
    pair: str
    half: Half
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
    return {effect: Checks(shares[effect], *chances.get(effect, (None, 0.0, ()))) for effect in effects}


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
    for pair, half in _halves(runs).items():
        known = [h for run in runs if (h := half(run)) is not None]
        share = float(np.mean(np.concatenate(known))) if known else 0.0
        if 0.0 < share < 1.0:
            yield _Part(option, coefficients, pair, half, share)


def turns_both_ways(rate_dps: Array) -> bool:
    """True if rates of either sign, [n], are more than the noise of a reference beside those of the other."""
    power = [float(np.sum(rate_dps[sign * rate_dps > 0] ** 2)) for sign in (-1, 1)]
    return min(power) > POLICY.shown_in_part * sum(power)


def _halves(runs: Sequence[Run]) -> dict[str, Half]:
    """The ways to part the data by the keys of :data:`PAIRS`."""
    cycles = list(dict.fromkeys(run.scenario for run in runs))
    late = set(cycles[(len(cycles) + 1) // 2 :])

    def above(values: Callable[[Run], Array | None]) -> Callable[[Run], Array | None]:
        known = [found for run in runs if (found := values(run)) is not None]
        middle = float(np.median(np.concatenate(known))) if known else 0.0

        def of(run: Run) -> Array | None:
            found = values(run)
            return None if found is None else (found > middle).astype(float)

        return of

    halves: dict[str, Half] = {
        "time": above(elapsed_s), "speed": above(lambda run: np.abs(true_rate_dps(run))), "temperature": above(temperature_c),
        "cycle_time": above(cycle_time_s), "power_cycle": lambda run: np.full(len(run), float(run.scenario in late)),
    }  # fmt: skip
    if runs and turns_both_ways(np.concatenate([true_rate_dps(run) for run in runs])):
        halves["direction"] = lambda run: (true_rate_dps(run) > 0).astype(float)
    return halves


def _chances(
    scales: Scales, weighed: Weighed, found: Mapping[str, Array], parts: Sequence[tuple[str, _Part]]
) -> dict[str, tuple[float, float, tuple[str, ...]]]:
    """For each effect, the probability that noise makes its coefficients differ as much between the parts of any pair.

    It is averaged over the states in which the noise may be. Beside it stands the rms of the largest difference that noise does
    not explain, in parts of the effect's rms, and the pairs that show the effect, the one that differs most first. ``found``
    holds the coefficients of the effects.
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

    def of_state(s: int) -> Array:
        return beside_model(matrix, states.noises[s], states.spreads[s], carried=states.carried[s])

    white = of_state(0)
    plain = np.diagonal(white)[columns]
    power = {e: float(found[e] @ white[np.ix_(at, at)] @ found[e]) for e, at in zip(order, matrix.at, strict=True)}
    apart = plain > LEAST_APART * np.array([power[e] for e, _ in parts])  # else rounding alone is left beside the model
    likeliest = np.argsort(weighed.bare)[::-1][:STATES]
    chances, differences, shown = np.zeros(columns.size), np.zeros(columns.size), np.zeros(columns.size, dtype=bool)
    for state in likeliest.tolist():
        products = integrated(of_state(state)[None], taken, sd)[0][0]
        norm, variance = np.diagonal(products)[columns], products[0, 0] / states.degrees
        seen = apart & (norm > POLICY.shown_in_part * plain)
        statistic = np.where(seen, products[columns, 0] ** 2 / np.where(seen, norm, 1.0) / variance, 0.0)
        chances += weighed.bare[state] * np.array([float(tails.chi_square(s, 1)) for s in statistic])
        differences += weighed.bare[state] * np.where(seen, np.abs(products[columns, 0]) / np.where(seen, norm, 1.0), 0.0)
        shown |= seen
    known = weighed.bare[likeliest].sum()
    chances, differences = chances / known, differences / known
    out: dict[str, tuple[float, float, tuple[str, ...]]] = {}
    for effect in dict.fromkeys(effect for effect, _ in parts):
        mine = np.flatnonzero(shown & np.array([other == effect for other, _ in parts]))
        if mine.size:
            sizes = differences[mine] * np.sqrt(plain[mine] / max(power[effect], 1e-300))
            sizes[chances[mine] * mine.size >= POLICY.different_chance] = 0.0
            pairs = tuple(parts[mine[i]][1].pair for i in np.argsort(-sizes, kind="stable"))
            out[effect] = min(1.0, float(chances[mine].min()) * mine.size), float(sizes.max()), pairs
    return out
