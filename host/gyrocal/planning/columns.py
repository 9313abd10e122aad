"""The normal equations of recorded and of planned power cycles, with columns of the model and of the effects in question."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.effects.base import Effect, OfEachRun, Role, Values
from gyrocal.error_model.model import Term
from gyrocal.inference.blocks import Blocks
from gyrocal.inference.design import Design, Mask
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import integrate
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.noise.whitening import Noise
from gyrocal.planning.expected import Expected
from gyrocal.planning.rig import Cycle, Rig
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array

NOBODY = -2
"""The owner of columns that only stand for a rival at other values; the model's columns have the owner -1."""
FREE = 1e3
"""The spread of a coefficient of one run that is free, in standard errors with which the run knows it."""
NEIGHBOURS = (1.4, 0.7, 2.0, 0.5, 2.8, 0.35)
"""Factors on a nonlinear parameter, nearest first: a rival may take these values too, within the range that a fit searches."""

Index = np.ndarray[Any, np.dtype[np.intp]]


@dataclass(frozen=True)
class Member:
    """An effect in question on one axis, with the sizes that the session gives it, or typical ones where it shows none.

    ``fit`` is the axis fitted with the effect, or without it where the session cannot measure it.
    """

    effect: Effect
    values: Values
    fit: AxisFit
    measured: bool

    @property
    def term(self) -> Term:
        """The effect at its values."""
        return Term.of(self.effect, AXES[self.fit.design.axis], self.values)

    @property
    def neighbours(self) -> list[Term]:
        """The effect at other values of its nonlinear parameters, which a fit could take as well."""
        if isinstance(self.effect, OfEachRun):
            return []
        moved = []
        for name in (n for n in self.effect.nonlinear if n in self.values):
            low, high = self.effect.parameter(name).search_range
            tried = [factor * self.values[name] for factor in NEIGHBOURS]
            moved += [{**self.values, name: value} for value in tried if low <= value <= high]
        return [Term.of(self.effect, AXES[self.fit.design.axis], values) for values in moved]


@dataclass(frozen=True)
class Grams:
    """Normal equations of power cycles, the offset of each integrated out: ``own`` [cycles, p, p] and ``new`` [kinds, p, p].

    ``own_random`` [cycles] and ``new_random`` [kinds] hold what the truth's random part in each run adds to a likelihood.
    """

    own: Array
    new: Array
    own_random: Array
    new_random: Array


class Columns:
    """The columns of one axis over the session's runs and every power cycle that a plan may hold, each run ``seconds`` long."""

    def __init__(
        self, current: Current, members: Sequence[Member], rig: Rig, expected: Expected, cycles: Sequence[Cycle], seconds: float
    ) -> None:  # fmt: skip
        fit = current.fit
        own = list(fit.design.given)
        inside = {term.effect_id for term in fit.design.terms}
        terms = list(fit.design.terms)
        owner = [next((k for k, m in enumerate(members) if m.effect.id == t.effect_id), -1) for t in terms]
        for k, member in enumerate(members):
            if member.effect.id not in inside:
                terms.append(member.term)
                owner.append(k)
        near = [(k, term) for k, member in enumerate(members) for term in member.neighbours]
        runs, self.kinds = _planned(rig, expected, cycles, seconds, len(own))
        every = [*terms, *(term for _, term in near)]
        self.design = Design([*own, *runs], fit.design.axis, every, fit.design.noise_model, fit.design.cell_s)
        layout = self.design.layout
        self.fit, self.n_own = fit, len(own)
        owner += [NOBODY] * len(near)
        self.owner = np.array([owner[t] for t, _ in layout.fixed], dtype=int)
        of_term = np.array([t for t, _ in layout.fixed], dtype=int)
        self.near = [(k, of_term == len(terms) + i) for i, (k, _) in enumerate(near)]
        """The member and the mask [p] of the shared columns of each neighbour."""
        self.run_owner = np.array([owner[t] for t, _ in layout.run], dtype=int)
        main = {owner.index(k): k for k in range(len(members)) if k in owner}
        self.place = [(main[t], j) if t in main else None for t, j in layout.fixed]
        """The member and its coefficient of each shared column; None for the others."""
        self._plain = self.design.grams(Noise(1.0))[0]

    def variants(self, k: int) -> list[Mask]:
        """Masks [p] of the shared columns of a member, one for each value that its nonlinear parameters may take."""
        return [self.owner == k, *(mask for member, mask in self.near if member == k and mask.any())]

    def coefficients(self, k: int, member: Member) -> Array:
        """The member's sizes as coefficients of the shared columns, shape [p]; zero for columns that are not its own."""
        sizes = np.atleast_1d(member.effect.coding.coefficients(member.values))
        return np.array([sizes[at[1]] if at is not None and at[0] == k else 0.0 for at in self.place])

    def plain(self) -> tuple[Array, Array]:
        """Products of the shared columns over all samples of the session [p, p] and of each planned kind [kinds, p, p]."""
        p = len(self.owner)
        sums = self._plain[:, 1 : 1 + p, 1 : 1 + p]
        new = [np.mean([sums[runs].sum(axis=0) for runs in rooms], axis=0) for rooms in self.kinds]
        return sums[: self.n_own].sum(axis=0), np.array(new)

    def grams(self, truth: int, member: Member, rival: int | None) -> Grams:
        """The normal equations at the noise of the fit with the true effect; coefficients of each run are integrated out.

        Those of the model have their fitted spread; those of the rival are free.
        """
        grams = self.design.grams(member.fit.noise)[0]
        p, own_random = len(self.owner), np.zeros(len(grams))
        shared, random = 1 + np.arange(p), np.arange(1 + p, grams.shape[-1])
        if random.size:
            sd = self._spreads(grams, member, rival)
            mine = random[self.run_owner == truth]
            others = self.run_owner != truth
            if mine.size and rival != truth:
                seen = integrate(grams, random[others], mine, sd[others]).grams
                power = np.diagonal(seen, axis1=1, axis2=2) * sd[self.run_owner == truth] ** 2
                own_random = np.sum(power - np.log1p(power), axis=1)
            grams = integrate(grams, random, shared, sd).grams
        else:
            grams = grams[:, 1:, 1:]
        return self._by_cycle(grams, own_random, member.fit)

    def spread_information(self, member: Member) -> Array:
        """Information on the spread of the first member over the runs, [kinds + cycles]: Fisher's, of a variance component."""
        grams = self.design.grams(member.fit.noise)[0]
        mine = 1 + len(self.owner) + np.flatnonzero(self.run_owner == 0)
        sd = np.concatenate([member.effect.coding.spread(member.values), np.zeros(1)])[0]
        known = np.diagonal(grams, axis1=1, axis2=2)[:, mine]
        of_run = np.sum(2 * (sd * known / (1 + sd**2 * known)) ** 2, axis=1)
        labels = self.design.scenarios[: self.n_own]
        new = [np.mean([of_run[runs].sum() for runs in rooms]) for rooms in self.kinds]
        return np.array([*new, *(of_run[: self.n_own][labels == one].sum() for one in np.unique(labels))])

    def _spreads(self, grams: Array, member: Member, rival: int | None) -> Array:
        """Standard deviation of each column's coefficient of a run, shape [k]; 0 for effects that neither act nor compete."""
        p, layout = len(self.owner), self.design.layout
        diagonal = np.diagonal(grams, axis1=1, axis2=2)[:, 1 + p :].mean(axis=0)
        free = FREE / np.sqrt(np.maximum(diagonal, 1e-300))
        model = self.fit.spreads.run
        of_member = np.concatenate([member.effect.coding.spread(member.values), np.zeros(1)])
        out = np.zeros(len(layout.run))
        for i, (group, owner) in enumerate(zip(layout.run_group, self.run_owner, strict=True)):
            if owner == -1:
                out[i] = model[group] if group < model.size else 0.0
            elif owner == rival:
                out[i] = free[i]
            else:
                out[i] = of_member[min(layout.run[i][1], of_member.size - 1)]
        return out

    def _by_cycle(self, grams: Array, random: Array, fit: AxisFit) -> Grams:
        """Normal equations [runs, p, p] summed over power cycles, the offset and scale of each integrated out."""
        scenario, sd = self._turn_on(fit)
        keep = np.arange(grams.shape[-1])

        def cycle(runs: Index | Sequence[int]) -> Array:
            total = grams[runs].sum(axis=0)
            return integrate(total, scenario, keep, sd).grams if scenario.size else total

        labels = self.design.scenarios[: self.n_own]
        members = [np.flatnonzero(labels == one) for one in np.unique(labels)]
        own = np.array([cycle(runs) for runs in members])
        new = np.array([np.mean([cycle(runs) for runs in rooms], axis=0) for rooms in self.kinds])
        return Grams(
            own, new, np.array([random[runs].sum() for runs in members]),
            np.array([np.mean([random[runs].sum() for runs in rooms]) for rooms in self.kinds]),
        )  # fmt: skip

    def _turn_on(self, fit: AxisFit) -> tuple[Index, Array]:
        """The columns that vary from power cycle to power cycle as in the session, and their spread.

        Where few cycles show the spread of the bias, it is at least a typical one.
        """
        before = fit.design.layout
        fitted = {before.fixed[j]: sd for j, sd in zip(before.scenario, fit.spreads.scenario, strict=True)}
        few = fit.design.cycles < POLICY.least_scenarios
        columns, spreads = [], []
        for j, at in enumerate(self.design.layout.fixed):
            bias = self.design.terms[at[0]].effect.role is Role.BIAS
            if at in fitted or (bias and j in self.design.layout.scenario):
                sd = float(np.nan_to_num(fitted.get(at, 0.0)))
                columns.append(j)
                spreads.append(max(sd, TurnOnBias.parameters[0].default or 0.0) if few and bias else sd)
        return np.array(columns, dtype=np.intp), np.array(spreads)


def _planned(
    rig: Rig, expected: Expected, cycles: Sequence[Cycle], seconds: float, first: int
) -> tuple[list[Blocks], list[list[list[int]]]]:  # fmt: skip
    """The blocks of every run of the planned cycles, and for each cycle and each room the indices of its runs."""
    known: dict[tuple[object, float, float], int] = {}
    blocks: list[Blocks] = []
    kinds = []
    for cycle in cycles:
        rooms = []
        for room in range(max(len(expected.rooms(pose)) for pose in cycle)):
            runs = []
            for i, pose in enumerate(cycle):
                airs = expected.rooms(pose)
                power_on_s = rig.start_s + i * (seconds + rig.gap_s)
                key = (pose, power_on_s, airs[room % len(airs)])
                if key not in known:
                    known[key] = first + len(blocks)
                    blocks.append(expected.blocks(pose, seconds, power_on_s, key[2], first + len(blocks)))
                runs.append(known[key])
            rooms.append(runs)
        kinds.append(rooms)
    return blocks, kinds


def typical(effect: Effect) -> Values:
    """The sizes of an effect that a session cannot measure: those that the simulator plants, else the middle of the typical."""
    chosen = {}
    for parameter in effect.parameters:
        if parameter.name in (*effect.linear, *effect.nonlinear):
            size = parameter.default
            if size is None:
                size = float(np.sqrt(parameter.typical[0] * parameter.typical[1])) if parameter.typical[0] > 0 else 0.0
            if size or parameter.name in effect.nonlinear:
                chosen[parameter.name] = size
    return chosen


def member_of(current: Current, effect: Effect, values: Values) -> Member:
    """An effect beside the model on an axis; ``values`` are those of its fit, empty where the session cannot measure it."""
    term = next((t for t in current.fit.terms if t.effect_id == effect.id), None)
    if term is not None:
        return Member(effect, term.values, current.fit, True)
    if not values:
        return Member(effect, typical(effect), current.fit, False)
    richer = current.with_effect(effect, values)
    return Member(effect, richer.fit.terms[-1].values, richer.fit, True)
