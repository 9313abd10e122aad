"""A fleet from folders to population.toml: the contract's keys, work that is never done twice, and boards that fail."""

import json
import shutil
import tracemalloc
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.estimator import calibration_of
from gyrocal.calibration.header import render
from gyrocal.cli import main
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.fleet.board import Done, of_fleet, plain_fit, summarise
from gyrocal.fleet.drift import FleetDrift
from gyrocal.fleet.engine import InProcess
from gyrocal.fleet.fit import _estimates, _summaries, fit_fleet
from gyrocal.fleet.likelihood import CycleSpreads
from gyrocal.fleet.listing import sessions
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from gyrocal.simulation.production import BIAS_SD_DPS, SCALE, SCALE_SD, Production
from gyrocal.simulation.simulate import OU_SD_DPS, OU_TAU_S, RATE_HZ, WHITE_SD_DPS

BOARDS = 10


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten small boards, one of them odd, and a broken session."""
    root = tmp_path_factory.mktemp("fleet") / "boards"
    production = Production(seconds=2.0, seed=3)
    production.write(root, range(BOARDS))
    replace(production, scale_step=0.05).write(root, range(BOARDS, BOARDS + 1))
    shutil.copytree(root / "board000000", root / "broken")
    (root / "broken" / "004_up.csv").write_text("t_s,gx_dps,gy_dps,gz_dps\n0.0,1.0,nonsense,1.0\n0.1,1.0,1.0,1.0\n")
    return root


@pytest.fixture(scope="module")
def fitted(folder: Path) -> dict[str, Any]:
    return told(folder)


def told(folder: Path) -> dict[str, Any]:
    return fit_fleet(str(folder), Model.open(), InProcess(), folder.parent / "out").to_json()


def test_the_contracts_keys(fitted: dict[str, Any]) -> None:
    assert {"boards", "failed", "population", "outliers", "missing", "sessions_per_s"} <= set(fitted)
    assert fitted["boards"] == BOARDS + 1
    assert set(fitted["population"]["scale.z.scale"]) == {"mean", "se", "sd", "sd_se"}
    assert set(fitted["population"]) == {"scale.z.scale", *(f"bias.{axis}.bias_dps" for axis in "xyz")}
    assert fitted["missing"] == []
    assert "boards or rig" in fitted["attribution"]


def test_the_planted_population_is_found(fitted: dict[str, Any]) -> None:
    scale, bias = fitted["population"]["scale.z.scale"], fitted["population"]["bias.x.bias_dps"]
    assert abs(scale["mean"] - SCALE) < 4 * scale["se"]
    assert abs(scale["sd"] - SCALE_SD) < 4 * scale["sd_se"]
    assert abs(bias["sd"] - BIAS_SD_DPS) < 4 * bias["sd_se"]


def test_the_odd_board_and_the_broken_one_are_told(fitted: dict[str, Any]) -> None:
    (odd,) = fitted["outliers"]
    assert {"session", "z", "why"} <= set(odd)
    assert odd["session"].endswith("board000010")
    assert odd["z"] > 5
    assert "scale.z.scale" in odd["why"]
    (failed,) = fitted["failed"]
    assert failed["session"].endswith("broken")
    assert "row 2" in failed["reason"]


def test_finished_work_is_kept_and_a_missing_part_alone_is_done_again(folder: Path, fitted: dict[str, Any]) -> None:
    results = folder.parent / "out" / "results"
    before = {path: path.stat().st_mtime_ns for path in results.glob("*.npz")}
    lost = sorted(before)[3]
    lost.unlink()
    again = told(folder)
    after = {path: path.stat().st_mtime_ns for path in results.glob("*.npz")}
    assert {path for path in before if before[path] != after[path]} == {lost}
    again.pop("sessions_per_s")
    assert again == {k: v for k, v in fitted.items() if k != "sessions_per_s"}


def test_population_is_a_model_whose_priors_are_used(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fleet", "fit", str(folder), "--workers", "0", "--out", str(folder.parent / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["population"]
    model = Model.open(folder.parent / "out" / "population.toml")
    prior = calibration_of(model, "z")
    scale, bias = found["scale.z.scale"], found["bias.z.bias_dps"]
    assert prior.scale == pytest.approx((scale["mean"], scale["sd"]), rel=0.2)
    assert prior.bias_dps == pytest.approx((bias["mean"], bias["sd"]), rel=0.2)
    assert prior.scale[1] >= scale["sd"]
    assert "gyrocal_prior_mean" in render(model)
    board = Production(seconds=2.0).board(77).save(tmp_path / "new")
    again = fit(board, model, axes=("z",)).model  # the spreads over boards are no parameters of one board
    assert set(again.line("bias", "z").values) == {"bias_dps"}  # type: ignore[union-attr]
    arguments = ["calibrate", str(board.path), "--method", "model", "--model", str(folder.parent / "out" / "population.toml")]
    assert main([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["estimates"]
    page = (folder.parent / "out" / "report.html").read_text(encoding="utf-8")
    assert "broken" in page
    assert page.count("data:image/png") >= 4


def test_the_fit_of_a_board_is_the_ordinary_fit(folder: Path) -> None:
    """It is the same fit where the model gives the structure, and differs by the search's tolerance where that is searched."""
    session, model = Session.open(folder / "board000001"), Model.open()
    given = replace(model, terms=tuple(replace(t, values={t.effect.linear[0]: 0.0}) for t in model.terms))
    fast, same, searched = plain_fit(session, model), fit(session, given).axes, fit(session, model).axes
    for axis, one in fast.items():
        for term, other, free in zip(one.terms, same[axis].terms, searched[axis].terms, strict=True):
            for name, value in other.values.items():
                assert term.values[name] == pytest.approx(value, abs=1e-12)
                assert term.values[name] == pytest.approx(free.values[name], abs=0.05 * free.se[name])


def test_lists_of_paths_are_read(folder: Path, tmp_path: Path) -> None:
    paths = [str(folder / "board000001"), str(folder / "board000000")]
    (tmp_path / "list.json").write_text(json.dumps(paths))
    pl.DataFrame({"path": paths}).write_parquet(tmp_path / "list.parquet")
    assert sessions(str(tmp_path / "list.json")) == sessions(str(tmp_path / "list.parquet")) == sorted(paths)
    (tmp_path / "bad.json").write_text('{"path": 1}')
    for wrong in ("bad.json", "absent.json", "absent"):
        with pytest.raises(InputError):
            sessions(str(tmp_path / wrong))


def test_a_session_that_is_being_written_is_left_out(tmp_path: Path) -> None:
    for name in ("line/a", "b", ".c.x1"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "session.toml").touch()
    assert sessions(str(tmp_path)) == [str(tmp_path / "b"), str(tmp_path / "line" / "a")]


def test_a_url_is_read_by_fsspec(folder: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    memory.put(str(folder / "board000001"), "/fleet/one", recursive=True)
    (path,) = sessions("memory://fleet")
    from gyrocal.fleet.listing import at_hand

    with at_hand(path) as local:
        assert Session.open(local).board == "B000001"


class Backwards(InProcess):
    """An engine that finishes the last session first."""

    def run(self, task: Any, jobs: Sequence[Any], given_up: Any = None) -> Iterator[Any]:
        yield from map(task, reversed(jobs))


def test_the_order_of_the_sessions_does_not_matter(folder: Path, fitted: dict[str, Any]) -> None:
    again = fit_fleet(str(folder), Model.open(), Backwards(), folder.parent / "out").to_json()
    assert {**again, "sessions_per_s": None} == {**fitted, "sessions_per_s": None}


def test_a_board_is_fitted_with_the_drift_of_the_fleet(folder: Path) -> None:
    session, drift = Session.open(folder / "board000001"), FleetDrift(0.05, 30.0)
    for one in plain_fit(session, of_fleet(Model.open(), dict.fromkeys("xyz", drift))).values():
        assert one.noise.ou_sd_dps == pytest.approx(0.05 * one.noise.white_sd_dps)
        assert one.noise.ou_tau_s == 30.0


def test_the_noise_of_a_sample_is_that_which_was_simulated(tmp_path: Path) -> None:
    """Also on the third board, whose fit finds a colour by chance and therefore a fifth more white noise."""
    true_dps = float(np.hypot(WHITE_SD_DPS, OU_SD_DPS * np.sqrt(1 - np.exp(-1 / (RATE_HZ * OU_TAU_S)))))
    off = []
    for number in (1, 2, 14):
        Production(seed=20).write(tmp_path, range(number, number + 1))
        drifts = dict.fromkeys("xyz", FleetDrift(OU_SD_DPS / WHITE_SD_DPS, OU_TAU_S))
        axes = summarise(tmp_path / f"board{number:06d}", "one", Model.open(), drifts).axes
        off += [(one.noise["sample_sd_dps"] - true_dps) / one.noise["sample_sd_se_dps"] for one in axes.values()]
    assert np.abs(off).max() < 3.5
    assert 0.4 < np.std(off) < 1.6  # nine values, 98 %


@pytest.mark.usefixtures("fitted")
def test_the_docs_commands_lead_to_priors_on_the_device(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As they stand on the page, in one process, on the boards above and a new one."""
    shutil.copytree(folder, tmp_path / "boards")
    shutil.copytree(folder.parent / "out", tmp_path / "boards.fleet")
    Production(seconds=2.0).board(77).save(tmp_path / "new-board")
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text(encoding="utf-8")
    part = page.split("## From sessions to priors on the device")[1].split("\n## ")[0]
    commands = [line.split("#")[0].split()[1:] for line in part.splitlines() if line.startswith("    gyrocal ")]
    assert [words[0] for words in commands] == ["fleet", "calibrate", "export"]
    for words in commands:
        assert main([*words, *(["--workers", "0"] if words[0] == "fleet" else [])]) == 0, words
    assert "gyrocal_prior_mean" in (tmp_path / "headers" / "calibration.h").read_text(encoding="utf-8")


def test_the_memory_of_the_reduction_hardly_grows_with_the_boards(folder: Path, fitted: dict[str, Any]) -> None:
    """Summaries are read one by one; each board leaves its numbers, and no normal equations beside the score's."""
    results = folder.parent / "out" / "results"
    keys = [path.stem for path in sorted(results.glob("*.npz"))][:BOARDS]

    def peak(boards: int) -> int:
        fleet = [Done(f"{i:04d}", keys[i % BOARDS]) for i in range(boards)]
        tracemalloc.start()
        collected, numbers = _estimates(_summaries(results, fleet, equations=False))
        cycles = CycleSpreads()
        for summary in _summaries(results, fleet):
            cycles.add(summary.axes["z"], np.array([0.0, 1.0, 0.0]))
        assert numbers
        size = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        assert len(collected) == boards
        return size

    few = peak(BOARDS)
    assert peak(5 * BOARDS) - few < 4 * BOARDS * 4000


def test_a_fleet_that_grows_costs_only_its_new_boards(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """The drift near which sessions are fitted stays; before, that of other pilot sessions had every board fitted again."""
    for module in ("drift", "fit"):
        monkeypatch.setattr(f"gyrocal.fleet.{module}.PILOT", 3)
    boards = [str(folder / f"board{i:06d}") for i in range(6)]
    for some in (boards[:4], boards):
        (tmp_path / "list.json").write_text(json.dumps(some))
        fitted = fit_fleet(str(tmp_path / "list.json"), Model.open(), InProcess(), tmp_path / "out")
        assert len(fitted.boards) == len(some)
        assert len(list((tmp_path / "out" / "results").glob("*.npz"))) == len(some)
