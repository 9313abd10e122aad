"""Recordings by hand: the importer takes gravity as the reference, and refuses what contradicts it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.gravity.calibrate import calibrate
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

G = 9.80665
MAPS = [
    *(text for a in "xyz" for text in ("--map", f"g{a}_dps=w{a}:rad/s", "--map", f"a{a}_g=f{a}:m/s2")),
    "--map", "t_s=time:ms",
]  # fmt: skip


@pytest.fixture(scope="module")
def part() -> tuple[Session, dict[str, Any]]:
    return simulate(campaign="hands", seed=0, scenarios=14)


@pytest.fixture
def log(part: tuple[Session, dict[str, Any]], tmp_path: Path) -> Path:
    """The log of a phone: times in ms, rates in rad/s, accelerations in m/s2; its name states a rest, as a person's would."""
    run = part[0].runs[0]
    assert run.acc_g is not None
    columns = {"time": run.t_s * 1e3}
    for i, a in enumerate("xyz"):
        columns |= {f"w{a}": np.deg2rad(run.gyro_dps[:, i]), f"f{a}": run.acc_g[:, i] * G}
    file = tmp_path / "hands_rest.csv"
    pl.DataFrame(columns).write_csv(file)
    return file


def test_a_log_by_hand_becomes_a_session_that_calibrates(
    part: tuple[Session, dict[str, Any]], log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["import", str(log), str(out), "--gravity", *MAPS, "--preview", str(tmp_path / "p.png"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == []
    session = Session.open(out)
    assert session.reference.kind == "gravity"
    assert [(r.file, r.table_rate_dps, r.turn_deg) for r in session.runs] == [("000_hands.csv", None, None)]
    truth = part[1]["runs"][0]
    for e, scale in zip(calibrate(session).estimates, truth["scale"], strict=True):
        assert e.scale is not None
        assert e.scale_se is not None
        assert abs(e.scale - scale) < 5 * e.scale_se


@pytest.mark.parametrize(
    ("factor", "told"),
    [("0.5", "turns by 0.5 of the angles"), ("1.4", "turns by 1.4 of the angles"), ("0.017453", "give the unit when")],
)
def test_import_tells_rates_of_the_wrong_size(
    factor: str, told: str, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half the range that was set was told by compare alone, and a reader of the session had the rates by then."""
    maps = [f"{text}*{factor}" if text.endswith("rad/s") else text for text in MAPS]
    assert main(["import", str(log), str(tmp_path / "out"), "--gravity", *maps, "--json"]) == 0
    (warning,) = [w for w in json.loads(capsys.readouterr().out)["warnings"] if w["code"] == "scale_implausible"]
    assert told in warning["text"]
    assert ("another range of the sensor" in warning["text"]) == (factor == "0.5")
    assert warning["blocking"]


def test_runs_added_to_a_session_by_gravity_need_no_rate_either(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["import", str(log), str(out), "--gravity", *MAPS]) == 0
    assert main(["import", str(log), str(out), "--append", "--scenario", "s001", *MAPS]) == 0
    assert Session.open(out).scenarios == ["s000", "s001"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([*MAPS, "--gravity", "--rate", "78"], "a true rate is given too"),
        ([*MAPS, "--gravity", "--run", "a:0:900:rate=5"], "a true rate is given too"),
        ([*MAPS[:2], *MAPS[-2:], "--gravity"], "map ax_g, ay_g and az_g"),
        ([*MAPS, "--run", "a:0:900"], "--gravity"),
    ],
)
def test_contradictions_are_told_with_a_remedy(
    options: list[str], said: str, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = log.rename(tmp_path / "log.csv")
    assert main(["import", str(log), str(tmp_path / "out"), *options]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_session_with_rates_takes_no_run_by_hand(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["import", str(log), str(out), "--rate", "0", *MAPS]) == 0
    assert main(["import", str(log), str(out), "--append", "--gravity", "--scenario", "s001", *MAPS]) == 2
    assert "a session of its own" in capsys.readouterr().err


def test_a_recording_by_hand_without_rests_is_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Import was silent, and every verb after it refused the session."""
    rng, t_s = np.random.default_rng(0), np.arange(3000) / 100
    moves = np.column_stack([np.sin(2 * np.pi * f * t_s) for f in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)])
    readings = moves * [60, 50, 40, 0.3, 0.3, 0.3] + [0, 0, 0, 0, 0, 1] + rng.normal(0, 0.02, (3000, 6))
    names = ["t_s", "gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g"]
    pl.DataFrame(np.column_stack([t_s, readings]), schema=names).write_csv(tmp_path / "log.csv")
    assert main(["import", str(tmp_path / "log.csv"), str(tmp_path / "out"), "--gravity", "--json"]) == 0
    (told,) = (w for w in json.loads(capsys.readouterr().out)["warnings"] if w["code"] == "not_at_rest")
    assert "rests found" in told["text"]
    assert "and 4 are needed at least. Leave the sensor still for two seconds in each pose" in told["text"]
