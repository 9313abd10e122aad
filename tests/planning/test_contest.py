"""The strength of a contest against generalised least squares with dense matrices, and laws of information."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.planning.columns import Columns
from gyrocal.planning.contest import Contest
from gyrocal.planning.expected import Expected
from gyrocal.planning.precision import Precision
from gyrocal.planning.question import Question
from gyrocal.planning.rig import Rig
from gyrocal.recording.session import Array

SECONDS = 20.0
MOST = 3
"""Kinds of power cycles that are compared."""


@pytest.fixture(scope="module")
def question() -> Question:
    return Question("tell_apart", ("bias_temperature", "drift"), "z", "")


@pytest.fixture(scope="module")
def columns(diagnosis: Diagnosis, question: Question) -> Columns:
    session = diagnosis.comparison.fit.session
    rig = Rig.of(session, chamber_c=(5.0, 45.0))
    cycles = [cycle for cycle in rig.cycles() if all(pose.temp_c is not None for pose in cycle)][:: 40][:MOST]
    return Columns(
        Current.of(diagnosis.comparison, "z"), question.members(diagnosis), rig, Expected.of(session), cycles, SECONDS
    )  # fmt: skip


def dense(columns: Columns, runs: list[int], white_dps: float, ou: tuple[float, float], offset: tuple[float, ...]) -> Array:
    """Products [p, p] of the shared columns over runs of one power cycle, weighted by the inverse of their whole covariance."""
    x = np.concatenate([columns.design.columns(i)[1 : 1 + len(columns.owner)] for i in runs], axis=1)
    parts = [columns.design.blocks[i] for i in runs]
    size = sum(b.t_s.size for b in parts)
    covariance, start = np.zeros((size, size)), 0
    for b in parts:
        here = slice(start, start := start + b.t_s.size)
        covariance[here, here] = ou[0] ** 2 * np.exp(-np.abs(b.t_s[:, None] - b.t_s) / ou[1]) + np.diag(white_dps**2 / b.n)
    covariance += sum(sd**2 * np.outer(x[j], x[j]) for j, sd in enumerate(offset) if sd)
    return np.asarray(x @ np.linalg.solve(covariance, x.T))


@pytest.mark.wide
def test_the_mismatch_is_that_of_generalised_least_squares(diagnosis: Diagnosis, question: Question, columns: Columns) -> None:
    members = question.members(diagnosis)
    contest = Contest.of(columns, members, 0, 1, 0.0)
    fit = members[0].fit
    spread = dict(zip(fit.design.layout.scenario, fit.spreads.scenario, strict=True))
    offset = tuple(float(spread.get(j, 0.0)) for j in range(len(columns.owner)))
    noise = fit.noise
    labels = columns.design.scenarios[: columns.n_own]
    own = [list(np.flatnonzero(labels == one)) for one in np.unique(labels)]
    planned = [rooms[0] for rooms in columns.kinds]
    grams = [dense(columns, runs, noise.white_sd_dps, (noise.ou_sd_dps, noise.ou_tau_s), offset) for runs in [*own, *planned]]
    total, size = sum(grams), contest.size
    rest = contest.model | contest.rivals[0]
    mismatch = size.copy()
    mismatch[rest] -= np.linalg.solve(total[np.ix_(rest, rest)], total[rest] @ size)
    expected = [float(mismatch @ g @ mismatch) for g in grams]
    number, first, second, _ = contest.strengths([(k, 1.0) for k in range(len(planned))])
    assert number[0] == len(grams)
    assert first[0] == pytest.approx(sum(expected), rel=0.02)
    assert second[0] == pytest.approx(sum(e**2 for e in expected), rel=0.04)


def test_the_same_runs_again_halve_the_variance(diagnosis: Diagnosis, question: Question, columns: Columns) -> None:
    precision = Precision.of(columns, question.members(diagnosis)[0])
    own = [(k, 1.0) for k in range(precision.n_new, len(precision.grams))]
    before, after = precision.errors(())[0], precision.errors(own)[0]
    assert after == pytest.approx(before / np.sqrt(2))
    candidate = next(c for c in diagnosis.candidates if c.effect.id == "bias_temperature" and c.axis == "z")
    assert before == pytest.approx(candidate.se["k1_dps_per_c"], rel=0.25), "the standard error that the diagnosis gives"


def test_more_power_cycles_that_show_as_much_are_surer(diagnosis: Diagnosis, question: Question, columns: Columns) -> None:
    contest = Contest.of(columns, question.members(diagnosis), 0, 1, 0.0)
    n = np.arange(2.0, 400.0)
    for strength in (0.1, 1.0, 20.0):
        margins = contest.margin(n, n * strength, n * strength**2, np.full(n.size, 0.9))
        assert np.all(np.diff(margins) > 0)
        assert margins[-1] > 1.0
    assert max(contest.power([(kind, 400.0)], 0.1) for kind in range(contest.n_new)) > 0.99


def test_one_power_cycle_proves_nothing(diagnosis: Diagnosis, question: Question, columns: Columns) -> None:
    """However clear it is: the scatter of the cycles' gains is then the gain itself."""
    contest = Contest.of(columns, question.members(diagnosis), 0, 1, 0.0)
    n, strength = np.array([5.0]), np.array([1e6])
    assert contest.margin(n, strength, strength**2, np.array([0.9]))[0] < 0
    assert contest.margin(n, strength, strength**2 / 5, np.array([0.9]))[0] > 5
