"""Block-mean regressors of one axis for a list of terms: the equations that the fit solves.

The model is ``y = X·beta + Z_run·u + Z_scenario·v + noise``. The columns of X, Z_run and Z_scenario (one scenario is one power
cycle) are the effects' columns as block means of each run. A column that depends linearly on the others is left out.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gyrocal.effects.base import Role, Values, with_role
from gyrocal.effects.quantities import RATE_STEP_DPS, rate_noise, with_faster_rate, with_slower_rate
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Term
from gyrocal.inference.blocks import Blocks, step_s
from gyrocal.inference.identified import identified, left_out, sums_of
from gyrocal.inference.layout import Layout, assigned
from gyrocal.inference.measured_columns import part_taken
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.color import WHITE, Color
from gyrocal.noise.whitening import Noise, Summed
from gyrocal.recording.session import Array, Run
from gyrocal.recording.timing import SYNCHRONOUS, Timing

Mask = np.ndarray[Any, np.dtype[np.bool_]]

LEAST_DPS = 1e-9
"""Smallest root mean square of a column that is used, deg/s per unit of its coefficient."""
SLOW_S = 4.0
"""Shortest time scale of drift, s. Variations that are faster are left to the tests of whiteness."""
LEAST_CONTRAST = 0.1
"""Spread of the true rates of a power cycle over their rms from which on they determine its scale beside its offset."""

Means = list[Array | None]
"""Block means [m, k] of each term's columns in one run; None for a term without columns."""


@dataclass(frozen=True)
class RateNoise:
    """The noise of the true rate in one run: its variance times the number of samples in each block, ``power`` [m],
    (deg/s)^2, and the standard error of that variance as a fraction of it.
    """

    power: Array
    uncertainty: float

    @staticmethod
    def of(b: Blocks, axis: int) -> RateNoise | None:
        """None where the rate has no noise."""
        found = rate_noise(b.run, axis, float(b.n[0])) if b.t_s.size else None
        return None if found is None else RateNoise(b.n * b.mean(found[0][:, None])[:, 0], found[1])


class Design:
    """Block-mean regressors of one axis for a list of terms: ``[y | fixed | run]`` for each run.

    ``noise_model`` lists the noise components; with a turn-on bias, the bias is random from power cycle to power cycle.
    ``cell_s`` is the time over which drift is taken to be constant, s; 0 = one block. ``color`` is that of the white noise.
    ``about`` holds values of terms by the id of their effect: what they make is subtracted from
    the readings, and the coefficients are determined as differences from them.
    """

    def __init__(
        self, blocks: Sequence[Blocks], axis: int, terms: Sequence[Term], noise_model: AxisNoise, cell_s: float = 0.0,
        like: Design | None = None, color: Color = WHITE, about: Mapping[str, Values] | None = None,
        part: Sequence[Means] = (),
    ) -> None:  # fmt: skip
        self.axis = axis
        self.noise_model = noise_model
        self.cell_s = cell_s
        self.color = color
        self.terms = tuple(terms)
        self.about = about or {}
        self.given = list(blocks)
        self.timing = timing_of(terms)
        self.faults = [term for term in terms if term.fault is not None]
        self.blocks = self._seen(like)
        runs = [b.run for b in blocks]
        before = like or self
        self._before = self._unchanged(like)
        self.scopes = [term.effect.scope_in(runs) for term in terms]
        lacking = zip(terms, self._before, strict=True)
        self.lacking: list[Mask] = [self._lacking(term, runs) if k is None else before.lacking[k] for term, k in lacking]
        self.means = [self._means(i, before, part[i] if part else None) for i in range(len(self.blocks))]
        self.levels = {t: self._level(t) for t, lacks in enumerate(self.lacking) if lacks.any()}
        for t in self.levels:
            for i in np.flatnonzero(self.lacking[t]):
                self.means[i][t] = self.blocks[i].mean(self._stand_in(t, self.blocks[i]))
        self.noises = [self._noises(i, before) for i in range(len(self.blocks))]
        self.rate_noises: list[RateNoise | None] = [
            like.rate_noises[i] if like is not None and like.blocks[i] is b else RateNoise.of(b, axis)
            for i, b in enumerate(self.blocks)
        ]
        self.slopes = [self._slopes(i, before) for i in range(len(self.blocks))]
        self.alike = self._alike(like)
        self.layout, self._summed = self._build()

    def changed(self, terms: Sequence[Term]) -> Design:
        """The same runs with other terms. Columns of unchanged terms are not computed again."""
        return self._like(terms, self.color)

    def colored(self, color: Color) -> Design:
        """The same runs and terms with another ``color`` of the noise."""
        return self._like(self.terms, color)

    def _like(self, terms: Sequence[Term], color: Color) -> Design:
        return Design(self.given, self.axis, terms, self.noise_model, self.cell_s, like=self, color=color, about=self.about)

    def with_values(self, i: int, values: Values) -> Design:
        """The design with other values of one term, the same in all runs."""
        terms = list(self.terms)
        terms[i] = replace(terms[i], values={**terms[i].values, **values}, of_run={})
        return self.changed(terms)

    def over(self, blocks: Sequence[Blocks], terms: Sequence[Term] | None = None, cell_s: float | None = None) -> Design:
        """The same noise model on other blocks of these runs, with the same terms and cells unless others are given."""
        return self._on(blocks, self.terms if terms is None else terms, self.cell_s if cell_s is None else cell_s)

    def selected(self, kept: Sequence[Mask]) -> Design:
        """The same on the blocks with True in ``kept`` [m] of each run, without the runs of which none is left."""
        left = [(i, mask) for i, mask in enumerate(kept) if mask.any()]
        blocks, lacks = [self.blocks[i].select(mask) for i, mask in left], np.transpose(self.lacking)
        part = [
            [None if m is None or no else m[mask] for m, no in zip(self.means[i], lacks[i], strict=True)] for i, mask in left
        ]  # fmt: skip
        return self._on(blocks, self.terms, self.cell_s, part)

    def _on(self, blocks: Sequence[Blocks], terms: Sequence[Term], cell_s: float, part: Sequence[Means] = ()) -> Design:
        color = self.color if np.isclose(step_s(blocks), step_s(self.blocks), rtol=0.1) else WHITE
        return Design(blocks, self.axis, terms, self.noise_model, cell_s, color=color, about=self.about, part=part)

    def _means(self, i: int, before: Design, known: Means | None) -> Means:
        """The means in one run; ``known`` are those of a run of which this is a part."""
        out: Means = []
        for t, (term, k) in enumerate(zip(self.terms, self._before, strict=True)):
            same = None if k is None or before.blocks[i] is not self.blocks[i] else before.means[i][k]
            if not self.lacking[t][i]:
                same = known[t] if known is not None and same is None else same
                if same is None and term.fault is None:
                    columns = self._at_samples(term, self.blocks[i])
                    same = self.blocks[i].mean(columns) if columns.shape[1] else None
            out.append(same)
        return out

    def _unchanged(self, like: Design | None) -> list[int | None]:
        """For each term, the number of the same one in a design of the same runs and axis; None if that has no such term."""
        if like is None or like.axis != self.axis or not all(map(operator.is_, like.given, self.given)):
            return [None] * len(self.terms)
        old = [(k, term, term.effect) for k, term in enumerate(like.terms)]
        return [next((k for k, t, e in old if t is new or (t == new and e is new.effect)), None) for new in self.terms]

    def _lacking(self, term: Term, runs: Sequence[Run]) -> Mask:
        """Mask [runs] of those without the data of a term. If none has them, the term itself says what it does then."""
        lacks = np.array([term.effect.lacks(run) for run in runs], dtype=bool)
        return lacks & (not lacks.all())

    def _level(self, t: int) -> Array:
        """A term's columns as multiples of bias or scale over the runs that have its data, shape [k]."""
        top, norm = np.zeros(1), 0.0
        for i in np.flatnonzero(~self.lacking[t]):
            b, means = self.blocks[i], self.means[i][t]
            if means is not None and b.t_s.size:
                unit: Array = b.mean(self._unit(t, b))[:, 0]
                weighted: Array = b.n * unit
                top, norm = top + weighted @ means, norm + float(weighted @ unit)
        return top / norm if norm > 0 else top

    def _unit(self, t: int, b: Blocks) -> Array:
        """The column of bias or scale that stands for a term in a run without its data, [n, 1]."""
        role = self.terms[t].effect.stands_for
        return with_role(role).columns(b.run, self.axis, {})

    def _stand_in(self, t: int, b: Blocks) -> Array:
        """Columns of a term in a run without its data, [n, k]: as in the other runs on average. The run's own bias or scale is
        free (:meth:`grams`)."""
        return self._unit(t, b) * self.levels[t]

    def _noises(self, i: int, before: Design) -> list[Array | None]:
        """The part of the squared norm of each term's columns in one run that comes from noise, and its standard error.

        [k, 2] for each term, in (deg/s per unit)^2 summed over samples; None for a term whose columns have no noise.
        """
        out: list[Array | None] = []
        b = self.blocks[i]
        for term, k in zip(self.terms, self._before, strict=True):
            if k is not None and before.blocks[i] is b:
                out.append(before.noises[i][k])
                continue
            found = None
            if b.t_s.size and term.fault is None:
                values = term.values_in(b.run) or dict.fromkeys(term.effect.linear, 0.0)
                found = term.effect.noise(b.run, self.axis, values, float(b.n[0]))
            out.append(None if found is None else np.outer(b.n @ b.mean(found[0]), [1.0, found[1]]))
        return out

    def _slopes(self, i: int, before: Design) -> Means:
        """How the means of each term's columns in one run change with the true rate, [m, k], per deg/s.

        None where the rate has no noise, and for a term without columns. A column that jumps at a rate, as at the edge of a
        dead band, changes as it does on the side without the jump.
        """
        of_rate, b = self.rate_noises[i], self.blocks[i]
        if of_rate is None:
            return [None] * len(self.terms)
        faster = replace(b, run=with_faster_rate(b.run))
        out: Means = []
        for t, (term, k) in enumerate(zip(self.terms, self._before, strict=True)):
            means = self.means[i][t]
            if k is not None and before.blocks[i] is b:
                out.append(before.slopes[i][k])
            elif means is None:
                out.append(None)
            else:
                columns = self._stand_in(t, faster) if self.lacking[t][i] else self._at_samples(term, faster)
                slopes = (b.mean(columns) - means) / RATE_STEP_DPS
                if term.effect.fast and slopes.any() and not self.lacking[t][i]:
                    slower = self._at_samples(term, replace(b, run=with_slower_rate(b.run)))
                    below = (means - b.mean(slower)) / RATE_STEP_DPS
                    slopes = np.where(np.abs(below) < np.abs(slopes), below, slopes)
                out.append(slopes)
        return out

    def _seen(self, like: Design | None) -> list[Blocks]:
        """The blocks as the terms see them: against the rate of their timing, without useless samples."""
        if like is not None and like.timing == self.timing and like.faults == self.faults:
            pairs = zip(self.given, like.given, like.blocks, strict=True)
            return [seen if given is before else self._usable(given.timed(self.timing)) for given, before, seen in pairs]
        return [self._usable(given.timed(self.timing)) for given in self.given]

    def _usable(self, b: Blocks) -> Blocks:
        """The blocks of a run without samples that a fault of the reading makes useless."""
        for term in self.terms:
            fault = term.fault if term.values else None
            usable = None if fault is None else fault.usable(b.run, self.axis, term.values)
            if usable is not None and b.t_s.size:
                whole = b.mean(usable[:, None].astype(float))[:, 0] == 1.0
                b = b.select(whole) if not whole.all() else b
        return b

    def _build(self) -> tuple[Layout, list[Summed]]:
        fixed, run, group = assigned(self.terms, self.scopes, len(self.blocks))
        fixed = [f for f in fixed if self.terms[f[0]].fitted(f[1]) and self._says_anything(f)]
        summed = [
            Summed.of((self._columns(i, fixed, run) for i in index), b.t_s, b.precision, self.cell_s, self.color)
            for index, b in ((index, self.blocks[index[0]]) for index in self.alike)
        ]
        # of two dependent columns the bias stays, because each power cycle has its own offset
        order = sorted(range(len(fixed)), key=lambda j: self.terms[fixed[j][0]].effect.role is not Role.BIAS)
        noise = self._noise_in(fixed)
        least = LEAST_DPS**2 * self._samples + noise[:, :, 0].sum(axis=0)
        gram = sum((s.gram.sum(axis=0) for s in summed), np.zeros((1, 1)))
        kept = identified(gram, order, least)
        self.left_out = left_out(gram, [(self.terms[i], i, j) for i, j in fixed], kept, least)
        self.asked, self.sums = tuple(fixed), None if kept.all() else sums_of(gram, kept)
        if not kept.all():
            rows = np.flatnonzero(np.concatenate([[True], kept, np.ones(len(run), dtype=bool)]))
            fixed, summed = [f for f, keep in zip(fixed, kept, strict=True) if keep], [s.of_columns(rows) for s in summed]
        self.column_noise = noise[:, kept]
        self.noise_products = self._noise_products(fixed, len(run))
        if self.noise_products.any():
            own = 1 + np.flatnonzero(kept)
            self._limit(self.noise_products, gram[np.ix_(own, own)])
            summed = [s.less(self.noise_products[index]) for index, s in zip(self.alike, summed, strict=True)]
        scenario = [j for j, (i, _) in enumerate(fixed) if self._varies(self.terms[i].effect.role)]
        return Layout(tuple(fixed), tuple(run), tuple(group), tuple(scenario)), summed

    def _noise_in(self, fixed: Sequence[tuple[int, int]]) -> Array:
        """The noise of each shared column in each run, shape [runs, p, 2], as :meth:`_noises`, that of the rate included."""
        out = np.zeros((len(self.blocks), len(fixed), 2))
        for i, of_rate in self._with_noise():
            for place, (term, j) in enumerate(fixed):
                known, slopes = self.noises[i][term], self.slopes[i][term]
                if known is not None:
                    out[i, place] += known[j]
                if of_rate is not None and slopes is not None:
                    out[i, place] += float(of_rate.power @ slopes[:, j] ** 2) * np.array([1.0, of_rate.uncertainty])
        return out

    def _with_noise(self) -> list[tuple[int, RateNoise | None]]:
        """The runs in which a column has noise, each with that of its rate."""
        known = enumerate(zip(self.rate_noises, self.noises, strict=True))
        return [(i, of_rate) for i, (of_rate, of_terms) in known if of_rate is not None or any(n is not None for n in of_terms)]

    @staticmethod
    def _limit(products: Array, gram: Array) -> None:
        """Limit what noise adds to the ``products`` [runs, q, q] of ``[y | fixed | run]`` in place.

        ``gram`` [p, p] is that of the fixed columns in all runs.
        """
        own = slice(1, 1 + len(gram))
        part = part_taken(gram, products[:, own, own].sum(axis=0))
        if part is not None:
            products[:, own, own] = part @ products[:, own, own] @ part.T
            products[:, 0, own] = products[:, 0, own] @ (part @ part).T
            products[:, own, 0] = products[:, 0, own]

    def _noise_products(self, fixed: Sequence[tuple[int, int]], further: int) -> Array:
        """What noise is expected to add to the products of each run, shape [runs, q, q].

        The residual holds the reference's noise with the opposite sign, so its product with the scale's column has lost as much
        as the column's square has gained. All columns that change with the rate share that noise. The same holds of what
        ``about`` subtracts.
        """
        q = 1 + len(fixed)
        out = np.zeros((len(self.blocks), q + further, q + further))
        for i, of_rate in self._with_noise():
            noises = self.noises[i]
            for row, (term, j) in enumerate(fixed, start=1):
                known = noises[term]
                if known is not None:
                    out[i, row, row] += known[j, 0]
                    if self.terms[term].effect_id in self.about:
                        out[i, 0, row] -= self._known(term)[j] * known[j, 0]
                        out[i, row, 0] = out[i, 0, row]
            if of_rate is not None:
                rows = self._rate_slopes(i, fixed)
                products = (rows * of_rate.power) @ rows.T
                products[0, 0] = 0.0  # the noise of the readings themselves
                out[i, :q, :q] += products
        return out

    def rate_slopes(self, i: int) -> Array:
        """How ``[y | fixed]`` of one run change with the noise of its true rate, shape [1 + p, m]."""
        return self._rate_slopes(i, self.layout.fixed)

    def _rate_slopes(self, i: int, fixed: Sequence[tuple[int, int]]) -> Array:
        slopes, size = self.slopes[i], self.blocks[i].t_s.size
        rows = np.zeros((1 + len(fixed), size))
        rows[0] = -1.0 - self.subtracted(slopes.__getitem__, size)
        for row, (term, j) in zip(rows[1:], fixed, strict=True):
            of_term = slopes[term]
            if of_term is not None:
                row[:] = of_term[:, j]
        return rows

    def _varies(self, role: Role | None) -> bool:
        """True if an effect with this role varies over the power cycles of these runs. A single one has a bias of its own."""
        if self.noise_model.turn_on_bias is None or self.cycles < 2:
            return False
        return role is Role.BIAS or (role is Role.SCALE and self._scale_within_scenarios)

    @cached_property
    def _scale_within_scenarios(self) -> bool:
        """True if there are two power cycles or more that each show a scale of their own: true rates that differ within it."""
        rates: dict[int, list[Array]] = {}
        for b in self.blocks:
            if b.t_s.size:
                turns = b.run.axis_index == self.axis
                rates.setdefault(b.scenario, []).append(b.rate_dps if turns else np.zeros(b.t_s.size))
        return len(rates) > 1 and all(
            float(np.std(of)) > LEAST_CONTRAST * float(np.sqrt(np.mean(of**2))) for of in map(np.concatenate, rates.values())
        )

    @cached_property
    def origin(self) -> Array:
        """The values about which the shared coefficients are determined, shape [p]: of effects of time and of ``about``."""
        out = np.zeros(len(self.layout.fixed))
        for k, (i, j) in enumerate(self.layout.fixed):
            term = self.terms[i]
            if term.effect_id in self.about:
                out[k] = self._known(i)[j]
            elif isinstance(term.effect, TimingEffect) and term.values:
                out[k] = term.effect.coding.coefficients(term.values)[0]
        return out

    def _known(self, t: int) -> Array:
        """The coefficients [k] of a term that ``about`` holds."""
        return self.terms[t].effect.coding.coefficients(self.about[self.terms[t].effect_id])

    def subtracted(self, columns: Callable[[int], Array | None], size: int) -> Array:
        """What the terms of ``about`` make of their ``columns``, given by a term's index, [size], deg/s."""
        out = np.zeros(size)
        for t, term in enumerate(self.terms):
            found = columns(t) if term.effect_id in self.about and term.fault is None else None
            if found is not None:
                out += found @ self._known(t)
        return out

    def sample_columns(self, b: Blocks) -> dict[int, Array]:
        """Each term's columns at every sample of a run, by the term's index."""
        at = next((i for i, of in enumerate(self.blocks) if of.run is b.run), 0)
        return {
            t: self._stand_in(t, b) if self.lacking[t][at] else self._at_samples(term, b)
            for t, term in enumerate(self.terms) if term.fault is None
        }  # fmt: skip

    def _at_samples(self, term: Term, b: Blocks) -> Array:
        return term.effect.columns(b.run, self.axis, term.values_in(b.run) or dict.fromkeys(term.effect.linear, 0.0))

    def _says_anything(self, column: tuple[int, int]) -> bool:
        term, j = column
        return any(m is not None and bool(m[:, j].any()) for m in (means[term] for means in self.means))

    def _alike(self, like: Design | None) -> list[list[int]]:
        """Groups of indices of runs with the same block times."""
        if like is not None and len(like.blocks) == len(self.blocks) and all(map(operator.is_, like.blocks, self.blocks)):
            return like.alike
        together: dict[Any, list[int]] = {}
        for i, b in enumerate(self.blocks):
            if not b.t_s.size:
                continue
            off_grid_s = np.abs(b.t_s - np.linspace(b.t_s[0], b.t_s[-1], b.t_s.size)).max()
            even = b.t_s.size > 2 and np.ptp(b.n) == 0 and np.ptp(b.precision) == 0 and off_grid_s <= 1e-3 * SLOW_S
            key = (b.t_s.size, float(b.precision[0]), round(float(b.t_s[-1] - b.t_s[0]), 2)) if even else i
            together.setdefault(key, []).append(i)
        return list(together.values())

    def over_given(self, parts: Sequence[Array]) -> Array:
        """Values of the blocks that the terms see, [m] for each run, over all given ones, shape [blocks]; NaN in the others."""
        out = [np.full(given.start.size, np.nan) for given in self.given]
        for whole, given, seen, part in zip(out, self.given, self.blocks, parts, strict=True):
            whole[np.isin(given.start, seen.start)] = part
        return np.concatenate(out)

    def columns(self, i: int) -> Array:
        """``[y | fixed | run]`` of one run, shape [q, m]."""
        return self._columns(i, self.layout.fixed, self.layout.run)

    def _columns(self, i: int, fixed: Sequence[tuple[int, int]], run: Sequence[tuple[int, int]]) -> Array:
        out = np.empty((1 + len(fixed) + len(run), self.blocks[i].t_s.size))
        out[0] = self.blocks[i].y_dps[:, self.axis]
        if self.about:
            out[0] -= self.subtracted(lambda t: self.means[i][t], out.shape[1])
        for row, (term, j) in zip(out[1:], (*fixed, *run), strict=True):
            means = self.means[i][term]
            assert means is not None
            row[:] = means[:, j]
        return out

    def grams(self, noise: Noise) -> tuple[Array, Array]:
        """Whitened normal equations of each run, shape [runs, q, q], and log-determinants of the noise, shape [runs]."""
        grams, logdet = self.grams_near(noise, ())
        return grams[0], logdet[0]

    def grams_near(self, noise: Noise, others: Sequence[Noise]) -> tuple[Array, Array]:
        """The same, [1 + o, runs, q, q] and [1 + o, runs], also at noises near by (:meth:`Summed.near`)."""
        q, count = 1 + len(self.layout.fixed) + len(self.layout.run), 1 + len(others)
        grams, logdet = np.zeros((count, len(self.blocks), q, q)), np.zeros((count, len(self.blocks)))
        for index, summed in zip(self.alike, self._summed, strict=True):
            grams[:, index], found = summed.near(noise, others)
            logdet[:, index] = found[:, None]
        for i, j in self._free:
            own = grams[:, i, 1 + j].copy()
            if (own[:, 1 + j] > 0).all():
                grams[:, i] -= own[:, :, None] * (own / own[:, 1 + j, None])[:, None]
                logdet[:, i] += np.log(own[:, 1 + j])
        return grams, logdet

    def left_white(self, noise: Noise) -> Array:
        """The part of a column's white noise that is left in the normal equations of each run, shape [runs]."""
        out = np.zeros(len(self.blocks))
        for index, summed in zip(self.alike, self._summed, strict=True):
            out[index] = summed.left_white(noise)
        return out

    @cached_property
    def _free(self) -> list[tuple[int, int]]:
        """Pairs of a run that lacks the data of a term and the shared column whose value is its own in that run."""
        roles = {self.terms[t].effect.role: j for j, (t, _) in enumerate(self.layout.fixed)}
        wanted = {(i, self.terms[t].effect.stands_for) for t in self.levels for i in np.flatnonzero(self.lacking[t]).tolist()}
        return sorted((i, roles[role]) for i, role in wanted if role in roles)

    @cached_property
    def scenarios(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Number of the power cycle of each run, shape [runs]."""
        return np.array([b.scenario for b in self.blocks], dtype=np.intp)

    @cached_property
    def cycles(self) -> int:
        """Number of power cycles."""
        return len(set(self.scenarios.tolist()))

    @cached_property
    def n_blocks(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Number of blocks of each run, shape [runs]."""
        return np.array([b.t_s.size for b in self.blocks], dtype=np.intp)

    @cached_property
    def extent_s(self) -> tuple[float, float]:
        """Length of the longest run and shortest time between blocks, s."""
        longest_s, block_s = max(float(b.t_s[-1] - b.t_s[0]) for b in self.blocks if b.t_s.size), step_s(self.blocks)
        return max(longest_s, block_s), block_s  # a turn of known angle is one block

    @cached_property
    def column_rms(self) -> Array:
        """Root mean square of each column over all samples, shape [q], which sets the scale of its coefficient."""
        squares = sum(np.diagonal(s.gram, axis1=1, axis2=2).sum(axis=0) for s in self._summed)
        return np.asarray(np.sqrt(squares / self._samples) + 1e-300)

    @property
    def _samples(self) -> float:
        return max(1.0, sum(b.samples for b in self.blocks))


def timing_of(terms: Sequence[Term]) -> Timing:
    """The timing that the effects of time among the terms describe together."""
    timing = SYNCHRONOUS
    for term in terms:
        if isinstance(term.effect, TimingEffect) and term.values:
            timing = term.effect.set(timing, term.values)
    return timing
