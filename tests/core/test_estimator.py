"""The square-root information filter against dense generalised least squares by scipy in float64."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg

from .conftest import HERE, LSB_DPS, Build, run, ticks
from .test_baseline import baseline

Array = NDArray[np.float64]
WHITE = float(np.float32(0.0448))


@pytest.fixture(scope="module")
def estimate(build: Build) -> Path:
    return build(HERE / "estimate.c")


@dataclass
class Blocks:
    """One run: block numbers, samples a block, y = measured - w, w, effect columns [blocks, columns]."""

    block: NDArray[np.int64]
    count: NDArray[np.int64]
    y: Array
    w: Array
    x: Array


@dataclass
class Case:
    n_run: int
    n_shared: int
    ou_sd: float
    ou_tau: float
    prior_mean: Array
    prior_root: Array
    runs: list[Blocks]
    n_alternatives: int = 0


def numbers(values: list[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def ask(program: Path, case: Case) -> str:
    text = f"estimator {case.n_run} {case.n_alternatives} {case.n_shared} {WHITE!r} {case.ou_sd!r} {case.ou_tau!r}\n"
    text += numbers([*case.prior_mean, *case.prior_root.ravel()])
    for r in case.runs:
        text += f"\n{len(r.y)}\n"
        for k in range(len(r.y)):
            text += f"{r.block[k]} {r.count[k]} {numbers([r.y[k], r.w[k], *r.x[k]])}\n"
    return run(program, text).strip()


def dense(case: Case) -> Array:
    """Scale, se, bias, se, misfit by one big whitened least-squares problem."""
    n_run, n_shared = case.n_run, case.n_shared
    total = 2 * n_run + n_shared + 2
    common = 2 * n_run + np.arange(n_shared + 2)
    rows, rhs = [], []
    for i, r in enumerate(case.runs):
        lag = np.abs(np.subtract.outer(r.block, r.block)) * 0.25
        cov = case.ou_sd**2 * np.exp(-lag / case.ou_tau) + np.diag(WHITE**2 / r.count)
        own = i * n_run + np.arange(n_run)
        design = np.zeros((len(r.y), total))
        design[:, own] = r.x[:, :n_run]
        design[:, common] = np.column_stack([r.x[:, n_run:], np.ones(len(r.y)), r.w])
        chol = linalg.cholesky(cov, lower=True)
        rows.append(linalg.solve_triangular(chol, design, lower=True))
        rhs.append(linalg.solve_triangular(chol, r.y, lower=True))
        for k in range(n_run):
            row = np.zeros((1, total))
            row[0, own] = case.prior_root[k, :n_run]
            rows.append(row)
            rhs.append(row[:, own] @ case.prior_mean[:n_run])
    for k in range(n_run, n_run + n_shared + 2):
        row = np.zeros((1, total))
        row[0, common] = case.prior_root[k, n_run:]
        rows.append(row)
        rhs.append(row[:, common] @ case.prior_mean[n_run:])
    a, b = np.vstack(rows), np.concatenate(rhs)
    informative = np.any(a != 0, axis=1)
    q, r = linalg.qr(a, mode="economic")
    solution = linalg.solve_triangular(r, q.T @ b)
    inverse = linalg.solve_triangular(r, np.eye(total))
    se = np.sqrt((inverse**2).sum(axis=1))
    chi2 = ((a @ solution - b) ** 2).sum()
    return np.array([solution[-1], se[-1], solution[-2], se[-2], np.sqrt(chi2 / (informative.sum() - total))])


def draw(rng: np.random.Generator, n_run: int, n_shared: int, ou: bool, prior: str, n_blocks: int = 24) -> Case:
    n = n_run + n_shared + 2
    ou_sd, ou_tau = (float(np.float32(0.01)), float(np.float32(rng.uniform(1, 40)))) if ou else (0.0, 1.0)
    root = np.zeros((n, n))
    if prior != "flat":
        root[:n_run, :n_run] = np.triu(rng.normal(0, 5, (n_run, n_run))) + 10 * np.eye(n_run)
        root[n_run:, n_run:] = np.triu(rng.normal(0, 50, (n_shared + 2, n_shared + 2))) + 100 * np.eye(n_shared + 2)
        if prior == "some":
            root[n - 1] = 0
            root[n_run : n_run + 1] = 0
    mean = rng.normal(0, 0.01, n)
    runs = []
    for w in (78.0, -78.0):
        block = np.sort(rng.choice(n_blocks + 6, n_blocks, replace=False))
        t = 0.25 * block
        phase = 2 * np.pi * np.outer(t, np.arange(1, n - 1)) / 4.6 + rng.uniform(0, 6, n - 2)
        x = w * np.cos(phase)
        count = rng.integers(20, 38, n_blocks)
        y = 0.004 * w - 0.05 + x @ rng.normal(0, 0.001, n - 2) + rng.normal(0, WHITE / np.sqrt(count))
        runs.append(Blocks(block, count, y, np.full(n_blocks, w), x))
    return Case(n_run, n_shared, ou_sd, ou_tau, mean, root, runs)


@pytest.mark.parametrize("ou", [False, True])
@pytest.mark.parametrize("prior", ["flat", "some", "full"])
@pytest.mark.parametrize(("n_run", "n_shared"), [(0, 0), (2, 0), (0, 3), (3, 2), (8, 0), (0, 8), (4, 4)])
def test_against_dense_least_squares(estimate: Path, n_run: int, n_shared: int, prior: str, ou: bool) -> None:
    rng = np.random.default_rng([n_run, n_shared, ou, len(prior)])
    case = draw(rng, n_run, n_shared, ou, prior)
    got = np.array(ask(estimate, case).split(), float)
    want = dense(case)
    assert abs(got[0] - want[0]) < 1e-6 * want[1]
    assert abs(got[2] - want[2]) < 1e-6 * want[3]
    np.testing.assert_allclose(got[[1, 3, 4]], want[[1, 3, 4]], rtol=1e-6)


def draw_alternatives(rng: np.random.Generator, n_plain: int, n_alternatives: int, n_shared: int) -> Case:
    """Readings that one alternative of each run makes; the others are much like it."""
    n_run = n_plain + n_alternatives
    case = draw(rng, n_run, n_shared, True, "full")
    root = case.prior_root
    root[:n_plain, n_plain:n_run] = 0
    root[n_plain:n_run, n_plain:n_run] = np.diag(rng.uniform(200, 800, n_alternatives))
    case.n_alternatives = n_alternatives
    case.prior_mean[n_plain:n_run] = 0.001
    for r in case.runs:
        t = 0.25 * r.block
        r.x[:, n_plain:n_run] = -r.w[:, None] * np.exp(-t[:, None] / np.geomspace(0.7, 5, n_alternatives))
        r.y[:] = 0.004 * r.w - 0.05 + r.x[:, n_plain + 1] * 0.002 + rng.normal(0, WHITE / np.sqrt(r.count))
    return case


def dense_average(case: Case) -> Array:
    """Each pair of alternatives by dense least squares, averaged by the density of the readings."""
    n_plain, n = case.n_run - case.n_alternatives, case.n_run + case.n_shared + 2
    answers, weights = [], []
    for i in range(case.n_alternatives):
        for j in range(case.n_alternatives):
            kept = [[*range(n_plain), n_plain + c, *range(case.n_run, n)] for c in (i, j)]
            values = np.concatenate([r.y for r in case.runs])
            designs = []
            for r, keep in zip(case.runs, kept, strict=True):
                x = np.column_stack([r.x, np.ones(len(r.y)), r.w])[:, keep]
                lag = np.abs(np.subtract.outer(r.block, r.block)) * 0.25
                designs.append((x, case.ou_sd**2 * np.exp(-lag / case.ou_tau) + np.diag(WHITE**2 / r.count)))
            k = n_plain + 1
            blocks = []
            for keep in kept:
                root = case.prior_root[np.ix_(keep[:k], keep[:k])]
                blocks.append((np.linalg.inv(root.T @ root), case.prior_mean[keep[:k]]))
            shared = range(case.n_run, n)
            root = case.prior_root[np.ix_(shared, shared)]
            p_shared, m_shared = np.linalg.inv(root.T @ root), case.prior_mean[case.n_run :]
            common = np.vstack([x[:, k:] for x, _ in designs])
            y_cov = common @ p_shared @ common.T
            mean = common @ m_shared
            at = 0
            for (x, noise), (p, m) in zip(designs, blocks, strict=True):
                own = slice(at, at + len(x))
                y_cov[own, own] += x[:, :k] @ p @ x[:, :k].T + noise
                mean[own] += x[:, :k] @ m
                at += len(x)
            solve = linalg.cho_factor(y_cov)
            off = linalg.cho_solve(solve, values - mean)
            gain = p_shared @ common.T
            cov = p_shared - gain @ linalg.cho_solve(solve, gain.T)
            chi2 = (values - mean) @ off
            answers.append([*(m_shared + gain @ off)[[-1, -2]], *np.diag(cov)[[-1, -2]], chi2])
            weights.append(-0.5 * chi2 - np.log(np.diag(solve[0])).sum())
    weight = np.exp(np.array(weights) - max(weights))
    weight /= weight.sum()
    table = np.array(answers)
    mean = weight @ table[:, :2]
    sd = np.sqrt(weight @ (table[:, 2:4] + (table[:, :2] - mean) ** 2))
    dof = sum(len(r.y) for r in case.runs)  # every parameter has a prior
    return np.array([mean[0], sd[0], mean[1], sd[1], np.sqrt(weight @ table[:, 4] / dof)])


@pytest.mark.parametrize(("n_plain", "n_alternatives", "n_shared"), [(2, 6, 0), (0, 8, 0), (1, 4, 3), (0, 2, 6), (2, 2, 1)])
def test_alternatives_are_averaged_by_their_evidence(estimate: Path, n_plain: int, n_alternatives: int, n_shared: int) -> None:
    case = draw_alternatives(np.random.default_rng([n_plain, n_alternatives]), n_plain, n_alternatives, n_shared)
    got, want = np.array(ask(estimate, case).split(), float), dense_average(case)
    assert abs(got[0] - want[0]) < 1e-5 * want[1]
    assert abs(got[2] - want[2]) < 1e-5 * want[3]
    np.testing.assert_allclose(got[[1, 3, 4]], want[[1, 3, 4]], rtol=1e-5)


def test_alternatives_stand_alone(estimate: Path) -> None:
    rng = np.random.default_rng(12)
    flat = draw_alternatives(rng, 1, 3, 0)
    flat.prior_root[2] = 0
    assert ask(estimate, flat) == "unidentified"
    tied = draw_alternatives(rng, 1, 3, 0)
    tied.prior_root[0, 2] = 0.1
    assert ask(estimate, tied) == "prior_coupled"
    many = draw_alternatives(rng, 0, 3, 0)
    many.n_alternatives = 4
    assert ask(estimate, many) == "too_many_columns"


@pytest.mark.parametrize("ou_tau", [0.05, 1e5])
def test_drift_from_white_to_random_walk(estimate: Path, ou_tau: float) -> None:
    case = draw(np.random.default_rng(3), 1, 1, True, "flat")
    case.ou_tau = float(np.float32(ou_tau))
    got, want = np.array(ask(estimate, case).split(), float), dense(case)
    assert abs(got[2] - want[2]) < 1e-6 * want[3]
    np.testing.assert_allclose(got[[1, 3, 4]], want[[1, 3, 4]], rtol=1e-6)


def test_without_effects_it_is_the_baseline(estimate: Path) -> None:
    rng = np.random.default_rng(8)
    t = ticks(870)
    counts = [np.rint(rng.normal(r, 5, 870)).astype(np.int64) for r in (8900, -8905)]
    runs = []
    for w, c in zip((78.0, -78.0), counts, strict=True):
        block = t // 250_000
        number = np.unique(block)
        n = np.array([(block == k).sum() for k in number])
        y = np.array([c[block == k].mean() * LSB_DPS for k in number]) - w
        runs.append(Blocks(number, n, y, np.full(len(number), w), np.zeros((len(number), 0))))
    got = np.array(ask(estimate, Case(0, 0, 0.0, 1.0, np.zeros(2), np.zeros((2, 2)), runs)).split(), float)
    want = baseline(estimate, (t, counts[0]), (t, counts[1]), (78.0, -78.0))[2]
    assert got[0] == pytest.approx(want[0], abs=1e-13)
    assert got[2] == pytest.approx(want[2], abs=1e-11)


def test_refuses_what_it_cannot_know(estimate: Path) -> None:
    rng = np.random.default_rng(4)
    same = draw(rng, 0, 0, False, "flat")
    same.runs[1].w[:] = 78.0
    assert ask(estimate, same) == "unidentified"

    twin = draw(rng, 2, 0, False, "flat")
    for r in twin.runs:
        r.x[:, 1] = 3 * r.x[:, 0]
    assert ask(estimate, twin) == "unidentified"

    constant = draw(rng, 1, 0, False, "flat")
    for r in constant.runs:
        r.x[:, 0] = 1.0
    assert ask(estimate, constant) == "unidentified"

    coupled = draw(rng, 1, 1, False, "full")
    coupled.prior_root[0, 2] = 0.5
    assert ask(estimate, coupled) == "prior_coupled"

    assert run(estimate, "estimator 0 0 0 0 0 1\n0 0\n0 0 0 0\n").strip() == "no_white_noise"
    assert run(estimate, "estimator 5 0 4 0.04 0 1\n" + "0 " * (11 + 121)).strip() == "too_many_columns"


def test_a_column_that_is_zero_throughout_changes_nothing(estimate: Path) -> None:
    case = draw(np.random.default_rng(6), 1, 1, True, "flat")
    for r in case.runs:
        r.x[:] = 0.0
    got = ask(estimate, case).split()
    bare = [Blocks(r.block, r.count, r.y, r.w, r.x[:, :0]) for r in case.runs]
    none = Case(0, 0, case.ou_sd, case.ou_tau, np.zeros(2), np.zeros((2, 2)), bare)
    assert got == ask(estimate, none).split()
