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


def numbers(values: list[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def ask(program: Path, case: Case) -> str:
    text = f"estimator {case.n_run} {case.n_shared} {WHITE!r} {case.ou_sd!r} {case.ou_tau!r}\n"
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

    assert run(estimate, "estimator 0 0 0 0 1\n0 0\n0 0 0 0\n").strip() == "no_white_noise"
    assert run(estimate, "estimator 5 4 0.04 0 1\n" + "0 " * (11 + 121)).strip() == "too_many_columns"


def test_a_column_that_is_zero_throughout_changes_nothing(estimate: Path) -> None:
    case = draw(np.random.default_rng(6), 1, 1, True, "flat")
    for r in case.runs:
        r.x[:] = 0.0
    got = ask(estimate, case).split()
    bare = [Blocks(r.block, r.count, r.y, r.w, r.x[:, :0]) for r in case.runs]
    none = Case(0, 0, case.ou_sd, case.ou_tau, np.zeros(2), np.zeros((2, 2)), bare)
    assert got == ask(estimate, none).split()
