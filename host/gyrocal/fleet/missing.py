"""Pooled diagnosis: effects that are too small for any single board, named from all boards of a fleet.

A candidate's size differs from board to board: a share of the boards has it, with a mean and a spread. Two tests see any of
these: the mean over boards against its standard error (which includes the spreads over boards and rigs), and the mean square of
the boards' own z values against one. Both are corrected for the number of tests. A candidate is named only if a population with
the effect, estimated from the other boards, predicts the boards that were left out better than no effect does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gyrocal.fleet.pooling import Labels, Pooled, furthest, pool
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

STEPS = 200


@dataclass(frozen=True)
class Missing:
    """An effect that the model lacks: a ``share`` of the boards has it, with the mean and spread given."""

    effect: str
    axis: str
    parameter: str
    nonlinear: dict[str, float]
    mean: float
    mean_se: float
    sd: float
    share: float
    p_value: float
    heldout_gain: float
    named_alone_by: int
    belongs_to: str
    group: list[str] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        return dict(self.__dict__)


@dataclass(frozen=True)
class Evidence:
    """Score [n, k] and information [n, k, k] of the candidates ``names`` on one axis; boards and rigs of the n sessions."""

    axis: str
    names: list[str]
    score: Array
    information: Array
    board: Labels
    rig: Labels
    rigs_known: int

    def given(self, j: int, mean: float, variance: float) -> Evidence:
        """The evidence for the others if candidate ``j`` is in the model, its size drawn from a population for each board."""
        column, own = self.information[:, :, j], self.information[:, j, j]
        left = self.score[:, j] - own * mean
        factor = variance / (1 + variance * own)
        score = self.score - column * (mean + factor * left)[:, None]
        products: Array = column[:, :, None] * column[:, None, :]
        information = self.information - factor[:, None, None] * products
        information[:, j], information[:, :, j] = 0.0, 0.0
        return replace(self, score=score, information=information)


@dataclass(frozen=True)
class Share:
    """A population in which a share of the boards has an effect, with normal sizes: the others do not have it."""

    share: float
    mean: float
    sd: float

    @staticmethod
    def of(c: Array, variance: Array) -> Share:
        """Maximum likelihood by expectation and maximisation for sizes ``c`` [n] with error variances [n]."""
        unit = float(np.sqrt(np.mean(c**2)))
        found = Share(0.5, float(np.average(c, weights=1 / variance)), unit)
        for _ in range(STEPS):
            has = found.has(c, variance)
            shrunk = found.sd**2 / (found.sd**2 + variance)
            size = found.mean + shrunk * (c - found.mean)
            total = max(float(has.sum()), 1e-9)
            mean = float(has @ size) / total
            spread = float(has @ ((size - mean) ** 2 + shrunk * variance)) / total
            found = Share(float(has.mean()), mean, float(np.sqrt(spread)))
        return found

    def has(self, c: Array, variance: Array) -> Array:
        """Probability [n] that each board has the effect, from sizes [n] with error variances [n]."""
        return self.share * self.ratio(c, variance) / (1 - self.share + self.share * self.ratio(c, variance))

    def ratio(self, c: Array, variance: Array) -> Array:
        """Likelihood ratio [n] of having the effect over not having it, at most 1e300."""
        wide = variance + self.sd**2
        log = 0.5 * (np.log(variance / wide) + c**2 / variance - (c - self.mean) ** 2 / wide)
        return np.asarray(np.exp(np.minimum(log, 690.0)))

    def gain(self, c: Array, variance: Array) -> Array:
        """Log-likelihood ratio [n] of each board, with this population over without the effect."""
        return np.asarray(np.log(1 - self.share + self.share * self.ratio(c, variance)))

    @property
    def overall(self) -> tuple[float, float]:
        """Mean and variance over all boards."""
        mean = self.share * self.mean
        return mean, self.share * (self.sd**2 + self.mean**2) - mean**2


@dataclass(frozen=True)
class _Test:
    """The sizes of one candidate, and the probability of such sizes in a fleet without it."""

    j: int
    c: Array
    variance: Array
    pooled: Pooled
    p_mean: float
    p_spread: float

    @property
    def p_value(self) -> float:
        return min(1.0, 2 * min(self.p_mean, self.p_spread))


def find(evidence: Sequence[Evidence]) -> list[Missing]:
    """The effects that a fleet's model lacks, best first. None is named from fewer than ``POLICY.fleet_boards`` boards."""
    boards = [np.count_nonzero(np.einsum("bii->bi", e.information), axis=0) for e in evidence]
    tests = sum(int((b >= POLICY.fleet_boards).sum()) for b in boards)
    found = [named for one in evidence for named in _on_axis(one, POLICY.fleet_names / max(1, tests))]
    return sorted(found, key=lambda m: -m.heldout_gain)


def _on_axis(evidence: Evidence, limit: float) -> list[Missing]:
    named: list[Missing] = []
    left, done = evidence, set[int]()
    for _ in range(POLICY.fleet_effects):
        passed = _passing(left, limit, done)
        if not passed:
            break
        test, share = passed[0].test, passed[0].share
        after = left.given(test.j, *share.overall)
        done |= {j for j, name in enumerate(left.names) if _key(name) == _key(left.names[test.j])}
        still = {left.names[t.j].split(".")[0] for t in (p.test for p in _passing(after, limit, done))}
        effect = left.names[test.j].split(".")[0]
        near = [p.test.j for p in passed if passed[0].gain - p.gain < POLICY.fleet_rival_gain]
        close = {left.names[j].split(".")[0] for j in near} - still - {effect}
        named.append(_described(evidence, passed[0], limit, sorted({effect, *close}) if close else []))
        left = after
    return named


def _key(name: str) -> str:
    return name.split(";")[0]


@dataclass(frozen=True)
class _Passed:
    """A candidate that passes the tests; ``gain`` is the log-likelihood that it gains on boards that were left out."""

    gain: float
    test: _Test
    share: Share


def _passing(evidence: Evidence, limit: float, done: set[int]) -> list[_Passed]:
    """The candidates that pass the tests and predict boards that were left out, best first."""
    out = []
    for j in range(len(evidence.names)):
        test = None if j in done else _tested(evidence, j)
        if test is None or test.p_value > limit:
            continue
        gain = _heldout_gain(test.c, test.variance, evidence.board[evidence.information[:, j, j] > 0])
        if gain > 0:
            out.append(_Passed(gain, test, Share.of(test.c, test.variance)))
    return sorted(out, key=lambda found: (-found.gain, found.test.j))


def _tested(evidence: Evidence, j: int) -> _Test | None:
    from scipy.stats import norm

    own = evidence.information[:, j, j]
    seen = own > 0
    if np.count_nonzero(seen) < POLICY.fleet_boards:
        return None
    c, variance = evidence.score[seen, j] / own[seen], 1 / own[seen]
    found = pool(c, np.sqrt(variance), evidence.board[seen], evidence.rig[seen])
    if found is None:
        return None
    n = c.size
    z = np.clip(np.abs(c) / np.sqrt(variance), 0, furthest(n))
    excess = float(np.mean(z**2)) - 1 - POLICY.error_of_variance
    p_mean, p_spread = 2 * float(norm.sf(abs(found.mean) / found.se)), _upper(excess, n)
    return _Test(j, c, variance, found, p_mean, p_spread)


def _upper(excess: float, n: int) -> float:
    """Probability that the mean square of n standard normal numbers exceeds one by ``excess``."""
    from scipy.stats import chi2

    return float(chi2.sf(n * (1 + max(excess, -1.0)), n))


def _heldout_gain(c: Array, variance: Array, board: Labels) -> float:
    """Log-likelihood ratio of the effect, summed over parts of the boards that are predicted from the other parts."""
    number = np.unique(board, return_inverse=True)[1]
    fold = np.random.default_rng(0).permutation(number.max() + 1)[number] % POLICY.fleet_folds
    total = 0.0
    for k in np.unique(fold):
        out = fold == k
        total += float(Share.of(c[~out], variance[~out]).gain(c[out], variance[out]).sum())
    return total


def _described(evidence: Evidence, passed: _Passed, limit: float, group: list[str]) -> Missing:
    from scipy.stats import norm

    test, share = passed.test, passed.share
    name, _, at = evidence.names[test.j].partition(";")
    effect, axis, parameter = name.split(".")
    nonlinear = {key: float(value) for key, value in (part.split("=") for part in at.split(",") if part)}
    alone = int(np.count_nonzero(np.abs(test.c) / np.sqrt(test.variance) > norm.isf(limit / 2)))
    return Missing(
        effect, axis, parameter, nonlinear, test.pooled.mean, test.pooled.se, share.sd, share.share, test.p_value,
        passed.gain, alone,        _belongs_to(evidence, test, limit), group,
    )  # fmt: skip


def _belongs_to(evidence: Evidence, test: _Test, limit: float) -> str:
    """The owner of the effect in words. An effect that is common to all boards of one rig may be the rig's."""
    found = test.pooled
    if found.rig_sd is not None and found.rig_sd_se is not None and found.rig_sd > max(2 * found.rig_sd_se, found.sd):
        return "rig: it differs more between rigs than between the boards of one rig"
    if test.p_mean > limit / 2:
        return "boards: it differs from board to board about zero, which an effect of a rig does not"
    if evidence.rigs_known < 2:
        return "boards or rig: all boards were on one rig, or no session names its rig, so a common effect may be of either"
    return "boards: it is the same on every rig"
