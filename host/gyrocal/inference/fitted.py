"""The result of a fit on one axis, and a session's model with its axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl

from gyrocal.effects.base import Effect, Role
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.inference.blocks import Blocks
from gyrocal.inference.design import Design, Mask
from gyrocal.inference.reml import Equations, Solution, Spreads, fit_spreads
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array, Session
from gyrocal.shown import Shown

SampleColumns = Mapping[int, Array]
"""Columns [n, k] at the samples of a run by the index of their term."""


@dataclass(frozen=True)
class AxisFit:
    """A fitted axis. ``terms`` and ``noise_model`` carry values and standard errors; ``loglik`` is REML's."""

    design: Design
    noise: Noise
    spreads: Spreads
    solution: Solution
    terms: tuple[Term, ...]
    grams: Array = field(repr=False)
    logdet: Array = field(repr=False)
    noise_model: AxisNoise = field(default_factory=AxisNoise)

    @property
    def loglik(self) -> float:
        """Restricted log-likelihood."""
        return self.solution.loglik

    @property
    def turn_on_sd_dps(self) -> float:
        """Spread of the bias over power cycles, deg/s."""
        return self.scenario_sd(self.spreads.scenario, Role.BIAS)

    def scenario_sd(self, of: Array, role: Role) -> float:
        """The value of the bias or the scale in values [k], one for each spread over power cycles; 0 if there is none."""
        for k, j in enumerate(self.design.layout.scenario):
            if self.design.terms[self.design.layout.fixed[j][0]].effect.role is role:
                return float(np.nan_to_num(of[k]))
        return 0.0

    @property
    def attenuation_se(self) -> Array:
        """Standard error of each shared parameter [p] from the uncertain noise of measured columns."""
        slope = self.solution.beta + self.design.origin
        for j, (term, _) in enumerate(self.design.layout.fixed):
            slope[j] += self.design.terms[term].effect.role is Role.SCALE  # the residual holds the reference's noise too
        noise_se = self.design.left_white(self.noise) @ self.design.column_noise[:, :, 1] / self.noise.white_sd_dps**2
        return np.asarray(np.abs(slope) * noise_se * np.diag(self.solution.cov))

    @property
    def stand_ins(self) -> list[tuple[Effect, Effect]]:
        """Pairs of effects of the model: one that the data do not show, and one whose coefficient would be moved by it."""
        se, layout = np.sqrt(np.diag(self.solution.cov)), self.design.layout
        return [
            (self.terms[term].effect, self.terms[layout.fixed[j][0]].effect)
            for term, shift in self.design.left_out for j in np.flatnonzero(np.abs(shift) > se)
        ]  # fmt: skip

    def subset(self, runs: Mask, spreads: Spreads | None = None) -> Solution:
        """The solution from the runs with True in ``runs`` [runs]."""
        return self.equations(runs).solve(spreads or self.spreads)

    def equations(self, runs: Mask | slice = slice(None)) -> Equations:
        """The normal equations of the runs with True in ``runs`` [runs], or of all."""
        design = self.design
        n = int(design.n_blocks[runs].sum())
        return Equations(design.layout, self.grams[runs], self.logdet[runs], design.scenarios[runs], n)

    def spreads_without(self, held_out: Mask) -> Spreads:
        """Spreads over runs, estimated again without the runs with True in ``held_out`` [runs].

        The spread of power cycles is noise and stays as fitted, as white noise and drift do: re-estimating
        the spread from the training cycles can underestimate it when these agree by chance.
        """
        if not self.spreads.run.size:
            return self.spreads
        again = fit_spreads(self.design, self.equations(~held_out), self.spreads)
        return Spreads(again.run, self.spreads.scenario)

    def run_coefficients(self, run: int, beta: Array, spreads: Spreads) -> Array:
        """Posterior mean of a run's own random coefficients [k], given shared ``beta``; its scenario's offset is free too."""
        layout = self.design.layout
        if not layout.run:
            return np.zeros(0)
        random, sd = layout.random, spreads.of(layout)
        residual = np.concatenate([[1.0], -beta, np.zeros(len(layout.run))])
        gram = self.grams[run]
        m = np.eye(random.size) + sd[:, None] * gram[np.ix_(random, random)] * sd
        u = sd * np.linalg.solve(m, sd * (gram[random] @ residual))
        return np.asarray(u[: len(layout.run)])

    def cycle_coefficients(self, run: int) -> Array:
        """Posterior mean of the random coefficients [k] of a run's power cycle, from all runs of that cycle."""
        layout, beta = self.design.layout, self.solution.beta
        own, sd = layout.random[len(layout.run) :], self.spreads.scenario
        m, right = np.eye(own.size), np.zeros(own.size)
        for i in map(int, np.flatnonzero(self.design.scenarios == self.design.scenarios[run])):
            u = self.run_coefficients(i, beta, self.spreads)
            m += sd[:, None] * self.grams[i][np.ix_(own, own)] * sd
            right += sd * (self.grams[i][own] @ np.concatenate([[1.0], -beta, -u]))
        return np.asarray(sd * np.linalg.solve(m, right))

    def block_residuals(self, run: int) -> Array:
        """Block means of a run without the terms that the fit found, shape [m], deg/s; drift and power cycle remain."""
        columns, p = self.design.columns(run), len(self.design.layout.fixed)
        u = self.run_coefficients(run, self.solution.beta, self.spreads)
        return np.asarray(columns[0] - self.solution.beta @ columns[1 : 1 + p] - u @ columns[1 + p :])

    def of_cycle(self, run: int) -> Array:
        """What a run's power cycle adds to the modelled rate at every sample, shape [n], deg/s."""
        columns = self.design.sample_columns(self.design.blocks[run])
        own = [self.design.layout.fixed[k] for k in self.design.layout.scenario]
        out = np.zeros(len(self.design.blocks[run].run))
        for (i, j), u in zip(own, self.cycle_coefficients(run), strict=True):
            out += u * columns[i][:, j]
        return out

    def predict(self, run: int, beta: Array, u: Array, columns: SampleColumns | None = None) -> Array:
        """Modelled minus true rate at every sample of a run, shape [n], deg/s; ``columns`` are those of the run, if known."""
        columns = columns or self.design.sample_columns(self.design.blocks[run])
        out = self.design.subtracted(columns.get, len(self.design.blocks[run].run))
        for (i, j), b in zip(self.design.layout.fixed, beta, strict=True):
            out += b * columns[i][:, j]
        for (i, j), b in zip(self.design.layout.run, u, strict=True):
            out += b * columns[i][:, j]
        return out


@dataclass(frozen=True, repr=False)
class Fit(Shown):
    """A fitted model: one :class:`AxisFit` for each axis that the model covers."""

    session: Session
    blocks: list[Blocks]
    model: Model
    axes: dict[str, AxisFit]

    @property
    def loglik(self) -> float:
        """Restricted log-likelihood, summed over the axes."""
        return sum(a.loglik for a in self.axes.values())

    def on(self, axis: str, fitted: AxisFit | None = None) -> Fit:
        """One axis alone, as it is or ``fitted`` otherwise."""
        return replace(self, axes={axis: fitted or self.axes[axis]})

    def correlations(self, axis: str) -> pl.DataFrame:
        """How much an axis's linear parameters are confused: a row and a column for each, 1 on the diagonal.

        The noise and the nonlinear parameters are taken as fitted. Raises InputError if the model does not cover the axis.
        """
        if axis not in self.axes:
            raise InputError(f"axis {axis}: the fit covers {', '.join(self.axes)}")
        design, cov = self.axes[axis].design, self.axes[axis].solution.cov
        sd = np.sqrt(np.diag(cov))
        names = [f"{design.terms[i].effect_id}.{_column_name(design.terms[i], j)}" for i, j in design.layout.fixed]
        return pl.DataFrame({"parameter": names, **dict(zip(names, cov / np.outer(sd, sd), strict=True))})


def _column_name(term: Term, column: int) -> str:
    """The linear parameter of a column; its number where several columns make one parameter, as a cosine and a sine do."""
    used = term.effect.coding.used(term.values)
    return used[column] if len(used) == len(term.effect.coding.groups(term.values)) else str(column)
