"""The model as it stands on one axis, against which candidates are judged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from gyrocal.diagnosis.residual.bounded_noise import at_most
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.levels import Floor, MeanSquares, floor_of
from gyrocal.diagnosis.residual.rate_wave import RateWave, rate_wave
from gyrocal.diagnosis.residual.rounding import beside_rounding
from gyrocal.effects.base import Effect, Values
from gyrocal.error_model.model import Term
from gyrocal.inference import heldout
from gyrocal.inference.blocks import BLOCK_S, Blocks, by_sample
from gyrocal.inference.design import Mask
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried, fit_noise, with_noise
from gyrocal.inference.nonlinear import refine
from gyrocal.inference.reml import unknown_spreads
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.structure import choose_variant
from gyrocal.recording.session import AXES, Run


@dataclass(frozen=True)
class Current:
    """One axis of a comparison, with its fit and with the folds that are used for the model and for every candidate."""

    comparison: Comparison
    axis: str
    fit: AxisFit
    changed: bool = False
    """True if ``fit`` holds other effects than the comparison's model."""

    @classmethod
    def of(cls, comparison: Comparison, axis: str) -> Current:
        """The model of a comparison on one axis."""
        rounded = beside_rounding(comparison.likeliest, axis)
        return cls(comparison, axis, rounded, changed=rounded is not comparison.likeliest.axes[axis])

    @property
    def index(self) -> int:
        """The axis as an index from 0 to 2."""
        return AXES.index(self.axis)

    @property
    def runs(self) -> list[Run]:
        """The runs of the fit."""
        return [b.run for b in self.fit.design.blocks]

    @cached_property
    def rate_wave(self) -> RateWave | None:
        """The wave over the rate that describes best what the fit leaves."""
        return rate_wave(self.fit)

    @cached_property
    def folds(self) -> list[heldout.Fold]:
        """The parts of the data that are left out in turn."""
        return heldout.folds(self.comparison.likeliest)

    @cached_property
    def squares(self) -> MeanSquares:
        """Mean squares of the model's own held-out residuals, dps^2."""
        return self.squares_of(self.fit) if self.changed else self.comparison.squares[self.axis]

    def of_samples(self) -> Current:
        """The same model fitted to samples instead of block means, for effects that are faster than a block."""
        design = self.fit.design
        samples = design.over(self.samples, cell_s=design.cell_s or BLOCK_S)
        return replace(self, fit=fit_noise(samples, start=carried(self.fit, samples)))

    @property
    def samples(self) -> list[Blocks]:
        """The samples of each run as blocks of one."""
        return by_sample([b.about(self.axis) for b in self.comparison.fit.blocks])

    def with_effect(self, effect: Effect, values: Values) -> Current:
        """The model with one more effect on this axis, fitted with the noise.

        ``values`` are those of a fit of the effect: a fault of the reading keeps them, other effects are fitted again.
        """
        if effect.fault_of(values) is None:
            fitted = refine(choose_variant(self.fit, Term.of(effect, self.axis)))
        else:
            old = self.fit.design
            design = old.over(self.comparison.fit.blocks, [*old.terms, Term(effect.id, self.axis, values)])
            fitted = fit_noise(design, start=carried(self.fit, design))
        return replace(self, fit=finish(fitted), changed=True)

    def of_runs(self, kept: Mask) -> Current:
        """The same model fitted to the runs with True in ``kept`` [runs], for an effect whose data the others lack."""
        whole = self.comparison.fit
        blocks = [b for b, keep in zip(self.fit.design.given, kept, strict=True) if keep]
        design = self.fit.design.over(blocks)
        fitted = fit_noise(design, start=with_noise(design, self.fit.noise, unknown_spreads(design)))
        part = replace(
            whole, session=whole.session.with_runs(b.run for b in blocks), blocks=blocks, axes={self.axis: fitted}
        )  # fmt: skip
        return Current(replace(self.comparison, fit=part, likeliest=part), self.axis, fitted)

    @property
    def units(self) -> list[str]:
        """The held-out units, in the order of a candidate's gains."""
        return [name for step in heldout.steps(self.fit, self.folds) for name in step.gain]

    def predictions(self, fitted: AxisFit) -> Iterator[heldout.Prediction]:
        """The predictions of another fit on this axis: of held-out samples, or in sample if nothing can be held out."""
        alone = self.comparison.fit.on(self.axis, fitted)
        return heldout.predictions(alone, self.folds) if self.folds else heldout.fitted(alone)

    def squares_of(self, fitted: AxisFit) -> MeanSquares:
        """Mean squares of another fit's held-out residuals, dps^2."""
        return MeanSquares.of(heldout.predictions(self.comparison.fit.on(self.axis, self._drawn(fitted)), self.folds))

    def floor_of(self, fitted: AxisFit) -> Floor:
        """The floor of another fit's held-out residuals."""
        return floor_of(self._drawn(fitted), self.folds, self.comparison.scatter[self.axis])

    def _drawn(self, fitted: AxisFit) -> AxisFit:
        """Another fit with no more drift than the comparison found beside the misfit of its model."""
        bound = self.comparison.fit.axes[self.axis].noise
        return fitted if bound == self.comparison.likeliest.axes[self.axis].noise else at_most(fitted, bound)
