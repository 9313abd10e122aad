"""The columns of all hypotheses beside those of the model, and their whitened sums by run."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.effects.quantities import RATE_STEP_DPS, with_faster_rate
from gyrocal.evidence.discrepancy import Shape
from gyrocal.evidence.hypotheses import Form, Option, of_reference, of_terms
from gyrocal.inference.carried_drift import follow_each_other, times_of_cycles
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.noise.whitening import Noise, Summed
from gyrocal.recording.session import Array, Run

Index = np.ndarray[tuple[int, ...], np.dtype[np.intp]]

CELLS = 1500
"""Number of cells of time, within each of which drift is constant, that a session is cut into at most."""
LONGEST_CELL_S = 1.0
"""Cells are no longer than this, so that the fastest drift is resolved, unless a recording of hours needs longer ones."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """The columns ``[y | shared | of each run | hypotheses | shapes]`` of one axis, summed by run.

    ``shared`` are the columns of the model's own terms, whose coefficients are free; those of each run have the spreads that
    the fit found. ``at`` holds the columns of each option, ``left`` those of each shape, ``further`` others. Columns of
    hypotheses are in units of the largest physical size of their coefficients. Terms of the fit whose effects are ``released``
    are hypotheses themselves: the fit holds them only because it sees the readings at the times that they describe.
    """

    fit: AxisFit
    white_sd_dps: float
    released: frozenset[str]
    free: Index
    """The columns of the reference's frame and clock, and of nonlinear parameters of the model, whose coefficients are free."""
    options: tuple[Option, ...]
    shapes: tuple[Shape, ...]
    at: tuple[Index, ...]
    left: tuple[Index, ...]
    further: tuple[Index, ...]
    summed: tuple[Summed, ...]
    noise_power: Array
    """What noise adds to the square of each column in each run, shape [runs, q]."""
    noise_products: Array
    """What it adds to the products of the model's columns, and to those of two different columns, shape [runs, q, q]."""

    @staticmethod
    def of(
        fit: AxisFit, options: Sequence[Option], shapes: Sequence[Shape] = (), *, further: Sequence[Form] = (),
        released: Set[str] = frozenset(), white_sd_dps: float | None = None,
    ) -> Matrix:  # fmt: skip
        """The columns of an axis as fitted, with those of options and shapes.

        ``white_sd_dps`` is the expected noise of one sample, that of the fit unless it is given.
        """
        design = fit.design
        first = 1 + len(design.layout.fixed) + len(design.layout.run)
        registered: list[Form] = [*of_reference(runs_of(fit), design.axis), *of_terms(fit.terms, runs_of(fit))]
        forms: list[Form] = [*registered, *options, *further]
        counts = [len(form.sizes) for form in forms] + [shape.count for shape in shapes]
        edges = first + np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
        own = [np.arange(low, high, dtype=np.intp) for low, high in pairwise(edges)]
        free, at, beyond, left = _parted(own, len(registered), len(options), len(further))
        cell_s, lacking = _cell_s(design), [_lacking(form, design) for form in forms]

        def columns(i: int) -> Array:
            return _columns(fit, i, forms, lacking, shapes, released)

        summed = [
            Summed.of(map(columns, index), b.t_s, b.precision, cell_s, design.color)
            for index, b in ((index, design.blocks[index[0]]) for index in design.alike)
        ]
        noise = [_noise(design, i, forms, lacking, shapes, int(edges[-1])) for i in range(len(design.blocks))]
        white = fit.noise.white_sd_dps if white_sd_dps is None else white_sd_dps
        return Matrix(
            fit, white, frozenset(released), np.concatenate([np.zeros(0, dtype=np.intp), *free]), tuple(options), tuple(shapes),
            at, left, beyond, tuple(summed), np.array([power for power, _ in noise]), np.array([shared for _, shared in noise]),
        )  # fmt: skip

    @property
    def design(self) -> Design:
        """The model's own equations."""
        return self.fit.design

    @property
    def shared(self) -> Index:
        """The columns whose coefficients are free."""
        design = self.design
        kept = (1 + j for j, (t, _) in enumerate(design.layout.fixed) if design.terms[t].effect_id not in self.released)
        return np.concatenate([np.fromiter(kept, dtype=np.intp), self.free])

    @property
    def of_runs(self) -> Index:
        """The columns that have a coefficient of their own in each run."""
        return 1 + len(self.design.layout.fixed) + np.arange(len(self.design.layout.run), dtype=np.intp)

    @property
    def of_cycles(self) -> Index:
        """The columns of bias and scale, as far as they differ from power cycle to power cycle."""
        return 1 + np.array(self.design.layout.scenario, dtype=np.intp)

    def role(self, role: Role) -> int | None:
        """The column of bias or scale; None if the model has none."""
        found = (1 + j for j, (t, _) in enumerate(self.design.layout.fixed) if self.design.terms[t].effect.role is role)
        return next(found, None)

    @cached_property
    def n(self) -> int:
        """Number of block means."""
        return int(self.design.n_blocks.sum())

    @cached_property
    def second_dps(self) -> float:
        """Standard deviation of the white noise's mean over a second, deg/s."""
        n = float(np.median(np.concatenate([b.n for b in self.design.blocks])))
        return float(self.white_sd_dps * np.sqrt(self.design.extent_s[1] / n))

    @cached_property
    def measured(self) -> bool:
        """True if columns of the model are measured with noise."""
        return bool(self.noise_products.any())

    def grams(self, noise: Noise, *, as_measured: bool = False) -> tuple[Array, Array]:
        """Whitened sums of products of each run, shape [runs, q, q], and log-determinants of the noise, shape [runs].

        What noise adds is taken out, unless they are wanted ``as_measured``. Squares of the columns of hypotheses keep theirs:
        beside each other they may be mostly noise, and nothing is left to subtract it from.
        """
        q = self.noise_power.shape[1]
        grams, logdet = np.zeros((len(self.design.blocks), q, q)), np.zeros(len(self.design.blocks))
        for index, summed in zip(self.design.alike, self.summed, strict=True):
            found, of_one = summed.normal_equations(noise)
            grams[index], logdet[index] = found, of_one
        if self.measured and not as_measured:
            left = self.design.left_white(noise) / noise.white_sd_dps**2
            grams -= left[:, None, None] * self.noise_products
        for i, j in self._free:
            if grams[i, j, j] > 0:
                own = grams[i, j].copy()
                logdet[i] += np.log(own[j])
                grams[i] -= np.outer(own, own / own[j])
        return grams, logdet

    @cached_property
    def going_on(self) -> tuple[Summed, ...]:
        """The sums of each power cycle as of one run, whose drift goes on from run to run.

        Empty where no power cycle has several runs, or where two of them are at the same time. Where runs have coefficients of
        their own, or columns have noise, drift begins anew in each run.
        """
        if self.of_runs.size or self.measured or self._free:
            return ()
        known = list(times_of_cycles(self.design))
        if not follow_each_other(known):
            return ()
        at = {run: (of, k) for index, of in zip(self.design.alike, self.summed, strict=True) for k, run in enumerate(index)}
        blocks = self.design.blocks
        return tuple(
            Summed.joined([at[i] for i in runs], [float(t[0] - blocks[i].t_s[0]) for i, t in zip(runs, times_s, strict=True)])
            for runs, times_s in known
        )

    @cached_property
    def _free(self) -> list[tuple[int, int]]:
        """Pairs of a run that lacks the data of a hypothesis and the column whose coefficient is its own in that run."""
        pairs = set()
        for option in self.options:
            column = self.role(option.effect.stands_for)
            if column is not None:
                pairs |= {(i, column) for i, lacks in enumerate(_lacking(option, self.design)) if lacks}
        return sorted(pairs)


def _parted(own: Sequence[Index], *counts: int) -> tuple[tuple[Index, ...], ...]:
    """Parts of a sequence of the given lengths, and the rest."""
    edges = np.cumsum([0, *counts, len(own) - sum(counts)])
    return tuple(tuple(own[low:high]) for low, high in pairwise(edges))


def _lacking(option: Form, design: Design) -> list[bool]:
    """For each run, whether it lacks the data of an option that other runs have."""
    lacks = [option.effect.lacks(b.run) for b in design.blocks]
    return lacks if not all(lacks) else [False] * len(lacks)


def _columns(
    fit: AxisFit, i: int, forms: Sequence[Form], lacking: Sequence[Sequence[bool]], shapes: Sequence[Shape], released: Set[str]
) -> Array:  # fmt: skip
    """All columns of one run as block means, shape [q, m]; ``lacking`` says of each form which runs lack its data."""
    b, own = fit.design.blocks[i], fit.design.columns(i)
    for j, (t, _) in enumerate(fit.design.layout.fixed):
        if fit.design.terms[t].effect_id in released:  # the readings as they are without what the timing took out
            own[0] += fit.design.origin[j] * own[1 + j]
    return np.concatenate([own, *_further(fit.design, i, forms, lacking, shapes, b.run)])


def _further(
    design: Design, i: int, forms: Sequence[Form], lacking: Sequence[Sequence[bool]], shapes: Sequence[Shape], run: Run
) -> list[Array]:  # fmt: skip
    """The columns of forms and shapes in one run as block means, each [k, m]; ``run`` is that run, or with another rate."""
    b, rows = design.blocks[i], []
    for form, lacks in zip(forms, lacking, strict=True):
        found = np.zeros((b.t_s.size, len(form.sizes))) if lacks[i] else b.mean(form.columns(run, design.axis))
        rows.append((found * form.unit).T)
    return rows + [b.mean(shape.columns(run)).T for shape in shapes]


def _noise(
    design: Design, i: int, forms: Sequence[Form], lacking: Sequence[Sequence[bool]], shapes: Sequence[Shape], size: int
) -> tuple[Array, Array]:  # fmt: skip
    """What noise adds in one run to the square of each column, shape [q], and to the products it is taken out of, [q, q]."""
    power, products, b = np.zeros(size), np.zeros((size, size)), design.blocks[i]
    if not b.t_s.size:
        return power, products
    fixed = 1 + len(design.layout.fixed)
    power[1:fixed] = design.column_noise[i, :, 0]
    first = at = fixed + len(design.layout.run)
    products[:first, :first] = design.noise_products[i]
    for form in forms:
        found = form.noise(b.run, design.axis, float(b.n[0]))
        if found is not None:
            variance = b.n @ b.mean(found[0])
            power[at : at + variance.size] = variance * form.unit[: variance.size] ** 2
        at += len(form.sizes)
    of_rate = design.rate_noises[i]
    if of_rate is not None:
        faster, run = (np.concatenate(_further(design, i, forms, lacking, shapes, r)) for r in (with_faster_rate(b.run), b.run))
        rows = np.zeros((size, b.t_s.size))
        rows[:fixed], rows[first:] = design.rate_slopes(i), (faster - run) / RATE_STEP_DPS
        shared = (rows * of_rate.power) @ rows.T
        power[first:] += np.diag(shared)[first:]
        np.fill_diagonal(shared[first:, first:], 0.0)
        products[first:], products[:, first:] = shared[first:], shared[:, first:]
    return power, products


def _cell_s(design: Design) -> float:
    """How long drift is taken to be constant, s, in whole blocks; 0 = one block."""
    block_s = design.extent_s[1]
    total_s = block_s * float(design.n_blocks.sum())
    blocks = int(max(min(LONGEST_CELL_S, total_s / CELLS * 2), total_s / CELLS) / block_s)
    return blocks * block_s if blocks > 1 else 0.0


def runs_of(fit: AxisFit) -> list[Run]:
    """The runs of a fit, as its blocks see them."""
    return [b.run for b in fit.design.blocks]
