"""The cases: fixed by their seed, in the stated proportions, and as far from their rivals as they say."""

from __future__ import annotations

import subprocess
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.recording.session import Session

from . import disturbances, drawn, frozen, library, planting, protocols, recording
from .apart import Judge
from .drawn import Case, Draw, draws
from .library import LIMITS, TYPICAL
from .noise import Metric
from .recording import AXES


def test_a_case_is_the_same_each_time(edge: Case) -> None:
    again = Draw("work", "edge", 0).case()
    assert drawn.truth(again) == drawn.truth(edge)
    assert all(np.array_equal(a, b) for a, b in zip(again.readings, edge.readings, strict=True))
    assert drawn.truth(Draw("work", "edge", 1).case())["name"] != drawn.truth(edge)["name"]


@pytest.mark.parametrize(("part", "cases"), [("work", 600), ("calibration", 300), ("frozen", 1500)])
def test_parts_hold_their_kinds_in_proportion(part: str, cases: int) -> None:
    listed = draws(part)
    assert len({draw.name for draw in listed}) == len(listed)
    main = Counter(draw.kind for draw in listed[:cases])
    assert main == {"misspecified": cases // 2, "edge": 3 * cases // 10, "null": cases // 5}
    assert Counter(draw.kind for draw in listed[:20]) == {"misspecified": 10, "edge": 6, "null": 4}
    rest = Counter(draw.kind for draw in listed[cases:])
    assert rest == ({"sets": 200, "unknown": 200, "confounded": 200} if part == "frozen" else {})


def test_the_frozen_part_is_drawn_from_the_code_that_it_judges(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*arguments: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@b")
        subprocess.run(["git", "-C", str(tmp_path), *who, *arguments], check=True, capture_output=True)

    monkeypatch.delenv(frozen.TREE, raising=False)
    with pytest.raises(ValueError, match="needs the git checkout"):
        frozen.tree(tmp_path)
    code = tmp_path / frozen.JUDGED / "a.py"
    code.parent.mkdir(parents=True)
    git("init", "-q")
    trees = []
    for text in ("x = 1", "x = 2", "x = 1"):
        code.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match="commit them"):
            frozen.tree(tmp_path)
        git("add", ".")
        git("commit", "-q", "-m", text)
        trees.append(frozen.tree(tmp_path))
    assert trees[0] == trees[2] != trees[1]
    seeds = []
    for told in trees[:2]:
        monkeypatch.setenv(frozen.TREE, told)
        seeds.append(drawn.seed_of("frozen"))
    assert len({tuple(seed) for seed in (*seeds, drawn.seed_of("work"), drawn.seed_of("calibration"))}) == 4


def test_an_edge_lies_where_it_was_wanted(edge: Case) -> None:
    assert edge.wanted_sigma is not None
    assert edge.seen[0].nearest == pytest.approx(edge.wanted_sigma, rel=0.03)
    assert edge.seen[0].alone >= drawn.LEAST_SEEN
    assert edge.seen[0].cosine <= drawn.ALIKE


def _covariance(case: Case, runs: list[recording.Run], block: int) -> np.ndarray:
    """Of means over blocks: white noise with its low-pass's gain, drift and turn-on bias."""
    s = case.made.sensor
    t = np.concatenate([(r.start_s + r.t_s)[: r.t_s.size // block * block].reshape(-1, block).mean(axis=1) for r in runs])
    cycle = np.concatenate([np.full(r.t_s.size // block, r.scenario) for r in runs])
    same = cycle[:, None] == cycle[None]
    slow = s.ou_sd_dps**2 * np.exp(-np.abs(t[:, None] - t[None]) / s.ou_tau_s) + s.turn_on_sd_dps**2
    return same * slow + np.eye(t.size) * (s.white_sd_dps**2 + s.lsb_dps**2 / 12) / block


def test_the_distance_is_that_of_plain_least_squares(tmp_path: Path) -> None:
    """Of the made file's own columns, by numpy alone: a scale over temperature beside a table that spins up."""
    case = Draw("work", "edge", 1).case()
    recording.write(case.made, case.readings, tmp_path, case.random)
    one, seen, made = case.planted[0], case.seen[0], case.made
    assert (one.id, seen.rival, made.reference, made.sensor.cutoff_hz) == ("scale_temperature", "spin_up", "stated", None)
    listed, block = tomllib.loads((tmp_path / "session.toml").read_text(encoding="utf-8"))["run"], int(made.sensor.rate_hz / 5)
    columns = []
    for said in listed:
        frame = pl.read_parquet(tmp_path / said["file"])
        t_s, measured_c = (frame[name].to_numpy() for name in ("t_s", "temp_c"))
        dt = np.polynomial.Polynomial.fit(t_s, measured_c, 4)(t_s) - 25.0  # the thermometer's noise is no effect
        rate = np.full(t_s.size, said["table_rate_dps"] * (1 if said["face"] == "up" else -1))
        rows = [one.parameters["k_per_c"] * dt * rate, np.ones(t_s.size), rate]
        rows += [rate * np.exp(-t_s / tau_s) for tau_s in library.TAUS_S[:4]]
        columns.append(np.array(rows)[:, : t_s.size // block * block].reshape(len(rows), -1, block).mean(axis=2))
    white = np.linalg.solve(np.linalg.cholesky(_covariance(case, made.runs, block)), np.concatenate(columns, axis=1).T)

    def left(known: list[int]) -> float:
        beside = white[:, known]
        return float(np.linalg.norm(white[:, 0] - beside @ np.linalg.lstsq(beside, white[:, 0], rcond=None)[0]))

    assert left([1, 2]) == pytest.approx(seen.alone, rel=0.03)
    assert min(left([1, 2, k]) for k in range(3, 7)) == pytest.approx(seen.nearest, rel=0.03)


def test_the_metric_is_the_inverse_covariance(edge: Case) -> None:
    """Products of block means against those of the dense covariance of all samples of one short run."""
    made, n = edge.made, 1500
    sensor = made.sensor
    run = made.runs[0]
    short = recording.Run(
        0, 1, run.face, run.axis, run.t_s[:n], 0.0, 3.0, 0.0, run.w_at, run.angle_deg[:n], run.temp_c[:n], run.acc_g[:, :n],
        run.stated_dps,
    )  # fmt: skip
    one = recording.Recording("long", sensor, [short], made.axis, "stated")
    rows = np.array([np.ones(n), np.sin(short.t_s / 3), short.t_s])
    apart_s = np.abs(short.t_s[:, None] - short.t_s[None])
    covariance = sensor.ou_sd_dps**2 * np.exp(-apart_s / sensor.ou_tau_s) + sensor.turn_on_sd_dps**2
    covariance += np.eye(n) * (sensor.white_sd_dps**2 + sensor.lsb_dps**2 / 12)
    assert sensor.cutoff_hz is None
    exact = rows @ np.linalg.solve(covariance, rows.T)
    np.testing.assert_allclose(Metric(one, 0).gram([rows]), exact, rtol=0.02)


def test_a_disturbance_is_orthogonal_to_scale_and_bias_and_outside_the_library(misspecified: Case) -> None:
    d, made = misspecified.disturbance, misspecified.made
    assert d is not None
    flat = np.concatenate(d.signal)
    assert np.sqrt(np.mean(flat**2)) == pytest.approx(d.rms_dps)
    for known in np.concatenate(library.nuisance(made, d.axis), axis=1):
        assert abs(flat @ known) < 1e-6 * np.linalg.norm(flat) * np.linalg.norm(known)
    judge = Judge(made, misspecified.ideal)
    sigma, single, joint = judge.own_share(d.axis, d.signal)
    assert sigma == pytest.approx(d.sigma, rel=1e-6)
    assert single >= drawn.OWN_SHARE
    assert drawn.OWN_SHARE_OF_ALL <= joint <= single
    base = library.nuisance(made, d.axis)
    for shape in library.shapes(made, d.axis, {}):  # the same share by plain numpy, in unit noise
        both = np.concatenate([np.vstack([b, c]) for b, c in zip(base, shape.columns, strict=True)], axis=1)
        both = both / np.maximum(np.linalg.norm(both, axis=1, keepdims=True), 1e-12)
        left = flat - both.T @ np.linalg.lstsq(both.T, flat, rcond=1e-9)[0]
        assert np.linalg.norm(left) > 0.4 * np.linalg.norm(flat)


def test_there_are_many_kinds_of_disturbances_and_recordings() -> None:
    assert len(disturbances.KINDS) >= 20
    random = np.random.default_rng(5)
    made = [drawn.draw_recording(random) for _ in range(60)]
    assert len({m.protocol for m in made}) >= 12
    assert {m.reference for m in made} == {"stated", "rate", "angle", "three", "turns", "gravity"}
    assert {m.has_temp for m in made} == {m.has_acc for m in made} == {True, False}
    samples = [m.samples for m in made]
    assert min(samples) > 18_000
    assert max(samples) < 155_000
    assert 30_000 < np.mean(samples) < 50_000


@pytest.fixture(scope="module")
def four_recordings() -> list[recording.Recording]:
    return [drawn.draw_recording(np.random.default_rng([7, seed])) for seed in range(4)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(disturbances.KINDS))
def test_every_disturbance_is_finite_wherever_it_is_drawn(kind: str, four_recordings: list[recording.Recording]) -> None:
    for seed, made in enumerate(four_recordings):
        raw = disturbances.KINDS[kind](made, made.axis, np.random.default_rng(seed))
        assert [signal.shape for signal in raw] == [run.t_s.shape for run in made.runs]
        assert all(np.all(np.isfinite(signal)) for signal in raw)


def test_every_effect_of_the_blind_benchmark_is_planted() -> None:
    from blind.drawn import EFFECTS

    assert set(planting.SIZES) == set(EFFECTS) == set(TYPICAL)
    assert set(LIMITS) <= set(TYPICAL)


@pytest.mark.wide
def test_sets_and_confounded_cases_are_what_their_kind_says() -> None:
    several = drawn.truth(Draw("work", "sets", 1).case())
    assert len(several["effects"]) == 3
    assert all(e["nearest_sigma"] >= drawn.APART and e["alone_sigma"] >= drawn.SEEN for e in several["effects"])
    alike = drawn.truth(Draw("work", "confounded", 2).case())
    assert alike["effects"][0]["nearest"] in alike["effects"][0]["equivalents"]
    assert alike["effects"][0]["alone_sigma"] >= drawn.SEEN > 3 * alike["effects"][0]["nearest_sigma"]
    alone = drawn.truth(Draw("work", "unknown", 0).case())
    assert (alone["effects"], alone["right"]) == ([], [])
    assert 12 <= alone["disturbance"]["sigma"] <= 80


@pytest.mark.parametrize("seed", range(8))
def test_the_session_format_reads_every_recording(seed: int, tmp_path: Path) -> None:
    only = list(protocols.PROTOCOLS)[seed::8]
    made = drawn.draw_recording(np.random.default_rng(seed), only)
    recording.refer(made, np.random.default_rng(1))
    readings = recording.counts(made, recording.analogue(made, np.random.default_rng(2)))
    recording.write(made, readings, tmp_path, np.random.default_rng(3))
    session = Session.open(tmp_path)
    assert len(session.runs) == len(made.runs)
    assert session.runs[0].axis == AXES[made.runs[0].axis]


@pytest.mark.parametrize("reference", [pytest.param("stated", marks=pytest.mark.wide), "rate"])
def test_noise_is_of_unit_size_in_the_metric(reference: str) -> None:
    random = np.random.default_rng(11)
    ratios = []
    for _ in range(8):
        made = drawn.draw_recording(random, ["pairs", "full"] if reference == "stated" else ["staircase", "hand"])
        recording.refer(made, random)
        judge = Judge(made, recording.analogue(made, random))
        for axis in range(3):
            oracle = judge.oracle(axis, [], None, recording.counts(made, judge.ideal))
            for id_ in {"drift", "centripetal", "warmup"} & oracle.variants.keys():
                index = oracle.variants[id_][0].index[0]
                if made.reference == reference:
                    ratios.append(oracle.gram[index, 0] / np.sqrt(oracle.gram[index, index]))
    assert len(ratios) > 20
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.3)


def test_no_disturbance_is_larger_than_the_rig_could_hide() -> None:
    for number in range(3):
        found = drawn.truth(Draw("work", "unknown", number).case())["disturbance"]
        assert 0 < found["rms_dps"] <= drawn.LARGEST_DPS
        assert found["own_share_of_all"] <= found["own_share"] * 1.001
