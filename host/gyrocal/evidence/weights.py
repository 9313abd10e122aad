"""The evidence of one set of effects: the probability of the readings, with everything that is not known integrated out.

A coefficient is normal about zero. Its standard deviation is one of :data:`SIZES` values between the smallest typical size and
the largest physical one, equally likely. The sum over the forms and sizes of each effect is taken at the best ones of the
others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gyrocal.effects.timing import TimingEffect
from gyrocal.evidence.matrix import Index, Matrix
from gyrocal.evidence.states import LEAST_OF_NOISE, States
from gyrocal.inference.factors import inverse_factor
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

SIZES = 5
"""Number of standard deviations of a coefficient that are tried."""
AMPLITUDES = (0.05, 0.15, 0.5, 1.5, 5.0, 15.0)
"""Amplitudes of what is left over, in standard deviations of the white noise's mean over a second."""
LEFT_OVER = 0.5
"""Probability that something is left over which no effect describes."""
STATES = 4
"""Number of the likeliest states in which forms and sizes are chosen."""
ROUNDS = 2
LEAST_CHI2 = 1e-3
"""Least chi-square for each degree of freedom. Below it, more noise of measured columns was taken out than is there, and what
is left says nothing."""


@dataclass(frozen=True)
class Rest:
    """A shape that is left over (its number) with its amplitude, deg/s, and the logarithm of its probability."""

    shape: int
    amplitude_dps: float
    log_prior: float


@dataclass(frozen=True, eq=False)
class Weighed:
    """A set of effects with its evidence.

    ``forms`` holds for each effect the option and the size [0, SIZES) that count most. ``log_evidence`` is that with and
    without something left over; ``by_rest`` splits it: the key is a shape's number, or None.
    """

    effects: frozenset[str]
    forms: Mapping[str, tuple[int, int]]
    log_evidence: float
    by_rest: Mapping[int | None, float]
    state: int
    """The likeliest state of the noise."""
    rest: Rest | None
    """The likeliest rest in it, None if nothing is left over."""
    bare: Array
    """The probability [s] of each state if nothing is left over."""
    places: Sequence[tuple[int, Rest | None]]
    """The likeliest states, with and without the likeliest rests."""


@dataclass(frozen=True, eq=False)
class Scales:
    """The evidence of sets on one axis."""

    matrix: Matrix
    states: States

    @cached_property
    def of_effect(self) -> dict[str, list[int]]:
        """The measurable options of each effect."""
        norm = np.diagonal(self.states.products[0])
        found: dict[str, list[int]] = {}
        for k, option in enumerate(self.matrix.options):
            if self.measurable[k] and norm[self.matrix.at[k]].min() > 0 and not self._owned_by_a_simpler(k):
                found.setdefault(option.effect.id, []).append(k)
        return found

    def _owned_by_a_simpler(self, k: int) -> bool:
        """True if an effect without a nonlinear parameter has the shape that an option has at one value of such a parameter."""
        products, option = self.states.products[0], self.matrix.options[k]
        if not option.effect.nonlinear or isinstance(option.effect, TimingEffect):
            return False
        mine = self.matrix.at[k][0]
        for other, at in zip(self.matrix.options, self.matrix.at, strict=True):
            if other.effect.nonlinear or at.size > 1 or not products[at[0], at[0]] > 0:
                continue
            if abs(products[mine, at[0]]) > POLICY.same_shape * np.sqrt(products[mine, mine] * products[at[0], at[0]]):
                return True
        return False

    @cached_property
    def measurable(self) -> Array:
        """For each option, whether the session can tell it from the model's own columns, shape [options]."""
        grams, _ = self.matrix.grams(self.states.noises[0])
        whole, beside = np.diagonal(grams.sum(axis=0)), np.diagonal(self.states.products[0])
        share = beside / np.maximum(whole, 1e-300)
        return np.array([bool((share[at] > POLICY.weighable).any()) for at in self.matrix.at], dtype=bool)

    @cached_property
    def rests(self) -> list[Rest]:
        """What may be left over."""
        shapes = [k for k, at in enumerate(self.matrix.left) if np.diagonal(self.states.products[0])[at].max() > 1e-6]
        if not shapes:
            return []
        each = float(np.log(LEFT_OVER / len(shapes) / len(AMPLITUDES)))
        return [Rest(k, size * self.matrix.second_dps, each) for k in shapes for size in AMPLITUDES]

    @cached_property
    def _noise_power(self) -> Array:
        """What noise adds to the square of each column in each state, as whitening leaves it, shape [s, q]."""
        power, noises = self.matrix.noise_power, self.states.noises
        if not power.any():
            return np.zeros((len(noises), power.shape[1]))
        of_noise = {noise: self.matrix.design.left_white(noise) @ power / noise.white_sd_dps**2 for noise in set(noises)}
        return np.array([of_noise[noise] for noise in noises])

    def sd(self, option: int, size: int) -> Array:
        """Standard deviations of an option's coefficients at one of the sizes, in units of its columns, shape [k]."""
        return self._sds[option][size]

    @cached_property
    def _sds(self) -> list[Array]:
        """Those of each option at every size, shape [SIZES, k]."""
        part = 1 - (np.arange(SIZES) + 0.5) / SIZES
        return [(o.sizes[:, 0] / o.sizes[:, 1]) ** part[:, None] for o in self.matrix.options]

    def weigh(self, effects: frozenset[str], start: Mapping[str, tuple[int, int]]) -> Weighed:
        """The evidence of a set. The search for forms and sizes begins at ``start``, which may lack effects."""
        forms = {e: start.get(e, (self.of_effect[e][0], SIZES - 1)) for e in sorted(effects)}
        inner = dict.fromkeys(forms, 0.0)
        places = self._likeliest(forms)
        beside: dict[str, Mapping[str, tuple[int, int]]] = {}
        for _ in range(ROUNDS):
            for effect in forms:
                others = {e: form for e, form in forms.items() if e != effect}
                if beside.get(effect) != others:
                    beside[effect], (forms[effect], inner[effect]) = others, self._chosen(effect, others, places)
        return self._over_all(frozenset(effects), forms, sum(inner.values()))

    def gains(self, weighed: Weighed) -> dict[str, float]:
        """The logarithm of the factor by which each other effect raises a set's evidence, in the likeliest states."""
        places = weighed.places[::2]
        base = -np.inf
        out = dict.fromkeys((e for e in self.of_effect if e not in weighed.effects), -np.inf)
        for state, rest in places:
            at, sd = self._columns(weighed.forms, rest)
            conditioned, weight = _conditioned(self.states.products[state], at, sd)
            weight += self.states.log_weight[state] + (np.log(1 - LEFT_OVER) if rest is None else rest.log_prior)
            base = max(base, weight - float(self._misfit(conditioned[0, 0])))
            options = [k for effect in out for k in self.of_effect[effect]]
            logs = self._of_forms(conditioned, options)
            first = 0
            for effect in out:
                mine = logs[first : first + len(self.of_effect[effect])]
                first += len(mine)
                out[effect] = max(out[effect], weight + _logsum(mine) - float(np.log(mine.size)))
        return {effect: found - base for effect, found in out.items()}

    def _likeliest(self, forms: Mapping[str, tuple[int, int]]) -> list[tuple[int, Rest | None]]:
        """The likeliest states, each with and without the likeliest rest."""
        at, sd = self._columns(forms)
        bare = self._logs(np.arange(len(self.states.log_weight)), at, sd)
        near = self._near(bare)
        return self._places(near, self._with_rests(near, at, sd) if self.rests else None)

    def _places(self, near: Index, beside: Array | None) -> list[tuple[int, Rest | None]]:
        """The first of the states ``near``, and those of the likeliest rests by their evidence ``beside`` them [s, rests]."""
        places: list[tuple[int, Rest | None]] = [(int(s), None) for s in near[:STATES]]
        if beside is not None:
            for flat in np.argsort(beside, axis=None)[::-1][:STATES].tolist():
                s, r = np.unravel_index(flat, beside.shape)
                places.append((int(near[s]), self.rests[int(r)]))
        return places

    def _near(self, bare: Array) -> Index:
        """The likeliest states by those without a rest (``bare`` [s]), and the likeliest of each drift: a rest replaces it."""
        order = np.argsort(bare)[::-1]
        of_drift = {id(self.states.noises[s]): s for s in order[::-1].tolist()}
        top = order[:STATES].tolist()
        return np.array([*top, *(s for s in of_drift.values() if s not in top)], dtype=np.intp)

    def _columns(self, forms: Mapping[str, tuple[int, int]], rest: Rest | None = None) -> tuple[Index, Array]:
        """The columns of a set with their standard deviations, [c] and [c]."""
        at = [self.matrix.at[option] for option, _ in forms.values()]
        sd = [self.sd(option, size) for option, size in forms.values()]
        if rest is not None:
            at.append(self.matrix.left[rest.shape])
            sd.append(np.full(at[-1].size, rest.amplitude_dps))
        return (np.concatenate(at), np.concatenate(sd)) if at else (np.zeros(0, dtype=np.intp), np.zeros(0))

    def _logs(self, states: Index, at: Index, sd: Array) -> Array:
        """Logarithm of the evidence in given states [s] of columns with standard deviations [..., c], shape [s, ...]."""
        products = self.states.products
        chi2, weight = products[states, 0, 0], self.states.log_weight[states]
        if at.size:
            inner = products[states[:, None, None], at[:, None], at]
            inner = inner.reshape(len(states), *[1] * (sd.ndim - 1), at.size, at.size)
            cross = products[states[:, None], at, 0].reshape(len(states), *[1] * (sd.ndim - 1), at.size)
            root, logs = _factor(np.eye(at.size) + sd[..., :, None] * inner * sd[..., None, :])
            half = root @ (sd * cross)[..., None]
            shape = [len(states)] + [1] * (sd.ndim - 1)
            chi2 = chi2.reshape(shape) - (half**2).sum(axis=(-1, -2))
            weight = weight.reshape(shape) - logs
        return np.asarray(weight - self._misfit(chi2))

    def _misfit(self, chi2: Array) -> Array:
        """What chi-square costs in the logarithm: Student's t. It is infinite where the data say nothing."""
        known = chi2 > LEAST_CHI2 * self.states.degrees
        return np.asarray(np.where(known, 0.5 * self.states.degrees * np.log(np.where(known, chi2, 1.0)), np.inf))

    def _with_rests(self, states: Index, at: Index, sd: Array) -> Array:
        """The same beside each rest, with its probability, shape [s, rests]."""
        shapes = list(dict.fromkeys(rest.shape for rest in self.rests))
        beside = self._beside_cosines(states, at, sd, np.array([self.matrix.left[k] for k in shapes]))
        return beside.reshape(len(states), -1) + np.array([rest.log_prior for rest in self.rests])

    def _beside_cosines(self, states: Index, at: Index, sd: Array, left: Index) -> Array:
        """The evidence beside each row of cosines ``left`` [r, c], of each of :data:`AMPLITUDES`, shape [s, r, amplitudes].

        With the set integrated out once, the cosines are turned to where their products are tridiagonal. Each amplitude then
        costs a sum over the cosines.
        """
        products, size = self.states.products, at.size
        rows = np.column_stack([np.zeros(len(left), dtype=np.intp), left])  # the reading beside the cosines
        gram = products[states[:, None, None, None], rows[:, :, None], rows[:, None, :]]
        weight = self.states.log_weight[states]
        if size:
            scaled = sd[:, None] * products[states[:, None], at]
            root, logs = _factor(np.eye(size) + scaled[:, :, at] * sd)
            half = (root @ scaled)[:, :, rows].swapaxes(1, 2)
            gram = gram - half.swapaxes(-1, -2) @ half
            weight = weight - logs
        chi2, logdet = _without(gram, (np.array(AMPLITUDES) * self.matrix.second_dps) ** 2)
        return np.asarray(weight[:, None, None] - 0.5 * logdet - self._misfit(chi2))

    def _chosen(
        self, effect: str, others: Mapping[str, tuple[int, int]], places: Sequence[tuple[int, Rest | None]]
    ) -> tuple[tuple[int, int], float]:
        """The form and size of an effect that count most beside others, and the logarithm of all its forms' share over it."""
        options = self.of_effect[effect]
        logs = np.empty((len(places), len(options), SIZES))
        for p, (state, rest) in enumerate(places):
            at, sd = self._columns(others, rest)
            conditioned, weight = _conditioned(self.states.products[state], at, sd)
            weight += self.states.log_weight[state] + (np.log(1 - LEFT_OVER) if rest is None else rest.log_prior)
            logs[p] = weight + self._of_forms(conditioned, options)
        together = np.logaddexp.reduce(logs, axis=0)
        best = np.unravel_index(int(np.argmax(together)), together.shape)
        form = options[int(best[0])], int(best[1])
        if not np.isfinite(together[best]):
            return form, 0.0
        return form, _logsum(together) - float(together[best] + np.log(together.size))

    def _of_forms(self, products: Array, options: Sequence[int]) -> Array:
        """Logarithms [options, SIZES] of the evidence of single forms, given products without everything else."""
        out = np.empty((len(options), SIZES))
        by_count: dict[int, list[int]] = {}
        for k, option in enumerate(options):
            by_count.setdefault(self.matrix.at[option].size, []).append(k)
        for members in by_count.values():
            at = np.array([self.matrix.at[options[k]] for k in members])
            sd = np.array([self._sds[options[k]] for k in members])
            inner = products[at[:, :, None], at[:, None, :]][:, None]
            cross = products[at, 0][:, None]
            root, logs = _factor(np.eye(at.shape[1]) + sd[..., :, None] * inner * sd[..., None, :])
            half = root @ (sd * cross)[..., None]
            out[members] = -logs - self._misfit(products[0, 0] - (half**2).sum(axis=(-1, -2)))
        return out

    def _over_all(self, effects: frozenset[str], forms: Mapping[str, tuple[int, int]], inner: float) -> Weighed:
        """The evidence summed over all states and rests."""
        at, sd = self._columns(forms)
        bare = self._logs(np.arange(len(self.states.log_weight)), at, sd)
        inner += self._of_noise(int(np.argmax(bare)), at, sd)
        split: dict[int | None, float] = {None: _logsum(bare) + (np.log(1 - LEFT_OVER) if self.rests else 0.0)}
        state, rest = int(np.argmax(bare)), None
        top = float(bare.max()) + (np.log(1 - LEFT_OVER) if self.rests else 0.0)
        near, logs = self._near(bare), None
        if self.rests:
            logs = self._with_rests(near, at, sd)
            for k in dict.fromkeys(r.shape for r in self.rests):
                split[k] = _logsum(logs[:, [i for i, r in enumerate(self.rests) if r.shape == k]])
            s, r = np.unravel_index(int(np.argmax(logs)), logs.shape)
            if float(logs[s, r]) > top:
                state, rest = int(near[s]), self.rests[int(r)]
        split = {k: value + inner for k, value in split.items()}
        total, of_all = _logsum(np.array(list(split.values()))), _logsum(bare)
        of_state = np.exp(bare - of_all) if np.isfinite(of_all) else np.zeros_like(bare)
        return Weighed(effects, dict(forms), total, split, state, rest, of_state, self._places(near, logs))

    def _of_noise(self, state: int, at: Index, sd: Array) -> float:
        """The logarithm of what a set loses because the noise of its measured columns adds to the misfit, with fitted sizes."""
        power = self._noise_power[state, at]
        if not power.any():
            return 0.0
        found = self._expected(state, at, sd)
        chi2 = float(_conditioned(self.states.products[state], at, sd)[0][0, 0])
        without = max(chi2 - float(power @ found**2), LEAST_OF_NOISE * chi2)
        return float(0.5 * self.states.degrees * np.log(chi2 / without))

    def _expected(self, state: int, at: Index, sd: Array) -> Array:
        """The expected coefficients [c] of columns with standard deviations [c], in one state."""
        products = self.states.products[state]
        information = np.eye(at.size) + sd[:, None] * products[np.ix_(at, at)] * sd
        return np.asarray(sd * np.linalg.solve(information, sd * products[at, 0]))

    def chi2(self, weighed: Weighed) -> float:
        """What a set leaves of the readings in its likeliest state, in the variance of the expected noise."""
        at, sd = self._columns(weighed.forms, weighed.rest)
        return float(_conditioned(self.states.products[weighed.state], at, sd)[0][0, 0])

    def likeliest_rest(self, weighed: Weighed) -> Rest | None:
        """The rest that counts most beside a set in its likeliest state; None if nothing can be left over."""
        if not self.rests:
            return None
        at, sd = self._columns(weighed.forms)
        return self.rests[int(np.argmax(self._with_rests(np.array([weighed.state]), at, sd)))]

    def coefficients(self, weighed: Weighed, state: int, rest: Rest | None) -> dict[str, Array]:
        """The expected coefficients of each effect in units of its columns, in one state; the key of the rest is ``""``."""
        at, sd = self._columns(weighed.forms, rest)
        found = self._expected(state, at, sd)
        out, first = {}, 0
        for effect, (option, _) in weighed.forms.items():
            count = self.matrix.at[option].size
            out[effect] = found[first : first + count]
            first += count
        return out | {"": found[first:]}

    def with_all_left_over(self, weighed: Weighed) -> float:
        """The evidence of a set where all variables together may be left over, each with the same amplitude."""
        at, sd = self._columns(weighed.forms)
        shapes = list(dict.fromkeys(rest.shape for rest in self.rests))
        if not shapes or not np.isfinite(weighed.log_evidence):
            return weighed.log_evidence
        left = np.concatenate([self.matrix.left[k] for k in shapes])
        bare = self._logs(np.arange(len(self.states.log_weight)), at, sd)
        of_all = _logsum(bare)
        if not np.isfinite(of_all):
            return weighed.log_evidence
        beside = self._beside_cosines(self._near(bare), at, sd, left[None]) + np.log(LEFT_OVER / len(AMPLITUDES))
        inner = weighed.by_rest[None] - of_all - np.log(1 - LEFT_OVER)
        return float(np.logaddexp(of_all + np.log(1 - LEFT_OVER), _logsum(beside)) + inner)


def _logsum(logs: Array) -> float:
    """The logarithm of the sum of exponentials."""
    top = float(np.max(logs))
    if not np.isfinite(top):
        return top
    return top + float(np.log(np.exp(logs - top).sum()))


def _conditioned(products: Array, at: Index, sd: Array) -> tuple[Array, float]:
    """Products [q, q] with the coefficients of some columns integrated out, and the logarithm of the weight."""
    if not at.size:
        return products, 0.0
    rows = sd[:, None] * products[at]
    root, log = _factor(np.eye(at.size) + rows[:, at] * sd)
    half = root @ rows
    return products - half.T @ half, -float(log)


def _without(products: Array, variances: Array) -> tuple[Array, Array]:
    """What coefficients ~ N(0, variance) leave of the first column's square, and the log-determinants, [s, r, v] each.

    ``products`` [s, r, 1 + k, 1 + k] are those of the first column and of the k columns of the coefficients. Reflections make
    those of the columns tridiagonal, the first column in proportion to the first of them. From the last one back, each then
    leaves a pivot of ``1 + variance * products``, which the prior alone makes 1.
    """
    from scipy.linalg.lapack import dsytrd

    size = products.shape[-1]
    diagonal, beside = np.empty((*products.shape[:2], size)), np.empty((*products.shape[:2], size - 1))
    for at in np.ndindex(*products.shape[:2]):
        _, diagonal[at], beside[at], _, _ = dsytrd(products[at], lower=1)
    pivot, logdet = np.ones(1), np.zeros(1)
    squares = beside[..., None] ** 2 * variances**2
    for k in range(size - 1, 0, -1):
        taken = squares[..., k, :] / pivot if k < size - 1 else 0.0
        pivot = np.maximum(1 + variances * diagonal[..., k, None] - taken, 1.0)
        logdet = logdet + np.log(pivot)
    return diagonal[..., 0, None] - variances * beside[..., 0, None] ** 2 / pivot, logdet


def _factor(information: Array) -> tuple[Array, Array]:
    """Inverse Cholesky factors [..., k, k] of information with a prior, and the logarithms [...] of the factors' determinants.

    With the prior, every direction is known with 1 at least. Where one is not, more noise of measured columns was taken out
    than is there, and the logarithm is infinite: what is left of the data says nothing about these columns.
    """
    try:
        root, logdet = inverse_factor(information)
    except np.linalg.LinAlgError:
        positive = np.linalg.eigvalsh(information)[..., :1, None] > 0.0
        root, logdet = inverse_factor(np.where(positive, information, 0.5 * np.eye(information.shape[-1])))
    pivots = 1 / np.diagonal(root, axis1=-2, axis2=-1)
    sound = (pivots**2 >= 1 - np.sqrt(np.finfo(float).eps)).all(axis=-1)
    return root, np.where(sound, 0.5 * logdet, np.inf)
