"""How surely a parameter is known to a tenth when runs are added.

Its standard error follows from the information of all power cycles, beside the model (D_s-optimality). Its estimate will lie
about the present one with the variance that the added runs take from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal import tails
from gyrocal.planning.columns import Columns, Member
from gyrocal.planning.contest import Chosen, solved
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Precision:
    """The main parameter of an effect: its ``value``, and the information of planned kinds and of the session's own cycles.

    ``grams`` [kinds + cycles, p, p] hold the information on the shared columns of the model and the effect, and on one at a
    neighbouring value of its nonlinear parameter, which stands for that parameter's own uncertainty. Where the effect has none,
    because its size differs from run to run, ``random`` [kinds + cycles] holds the information on its spread.
    """

    grams: Array
    random: Array
    column: int | None
    name: str
    value: float
    typical: tuple[float, float] | None
    """The range of the typical size where the session does not show the effect, else None."""
    n_new: int

    @staticmethod
    def of(columns: Columns, member: Member) -> Precision:
        """The precision of the size of one effect."""
        kept = (columns.owner == -1) | np.any(columns.variants(0)[:2], axis=0)
        grams = columns.grams(0, member, None)
        sizes = columns.coefficients(0, member)[kept]
        own, new = columns.plain()
        rms = np.sqrt(np.diag(own + new.sum(axis=0)))[kept]
        places = [at for at, keep in zip(columns.place, kept, strict=True) if keep]
        mine = np.array([at is not None and at[0] == 0 for at in places])
        column = int(np.argmax(np.where(mine, np.abs(sizes) * rms + 1e-12 * rms, -1.0))) if mine.any() else None
        used = member.effect.coding.used(member.values) or member.effect.linear
        place = places[column] if column is not None else None
        name = used[min(place[1], len(used) - 1)] if place is not None else used[0]
        of_runs = float(member.values.get(f"{name}_sd", member.values.get(name, 0.0)))
        value = of_runs if column is None else float(sizes[column])
        typical = None if member.measured else member.effect.parameter(name).typical
        return Precision(
            np.concatenate([grams.new, grams.own])[:, kept][:, :, kept], columns.spread_information(member), column, name,
            abs(value), typical, len(grams.new),
        )  # fmt: skip

    def errors(self, chosen: Chosen, candidates: Chosen = ((0, 0.0),)) -> Array:
        """Standard error [candidates] of the parameter after the plan with each candidate added; inf where nothing shows it."""
        own = np.arange(self.n_new, len(self.grams))
        kinds = np.concatenate([own, [k for k, _ in chosen]]).astype(int)
        times = np.concatenate([np.ones(own.size), [n for _, n in chosen]])
        extra, number = (np.array([c[i] for c in candidates]) for i in (0, 1))
        if self.column is None:
            known = times @ self.random[kinds] + number * self.random[extra.astype(int)]
        else:
            total = np.tensordot(times, self.grams[kinds], 1) + number[:, None, None] * self.grams[extra.astype(int)]
            others = np.arange(total.shape[1]) != self.column
            g = total[:, others, self.column]
            known = total[:, self.column, self.column] - np.einsum("ci,ci->c", g, solved(total[:, others][:, :, others], g))
            known = np.where(known > 1e-8 * total[:, self.column, self.column], known, 0.0)
        return np.asarray(1 / np.sqrt(np.maximum(known, 1e-300)))

    def power(self, chosen: Chosen) -> float:
        """Probability that the standard error is at most a tenth of the estimate."""
        before, after = float(self.errors(())[0]), float(self.errors(chosen)[0])
        needed = after / POLICY.precision
        if self.typical is not None:
            low, high = np.log(self.typical)
            return float(np.clip((high - np.log(needed)) / (high - low), 0.0, 1.0))
        moves = np.sqrt(max(before**2 - after**2, 0.0))
        if moves <= 1e-9 * max(self.value, 1e-300):
            return float(self.value >= needed)
        return float(tails.normal((needed - self.value) / moves) + tails.normal((needed + self.value) / moves))
