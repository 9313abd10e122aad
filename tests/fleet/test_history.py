"""One sensor over months: lines through planted values, and a simulated sensor whose bias ages."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy import stats

from gyrocal.api import Model, Session
from gyrocal.cli import main
from gyrocal.fleet.history import histories, line
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES

DATES = ("2025-01-10", "2025-05-10", "2025-09-10", "2026-01-10")


def test_a_line_through_values_with_equal_errors_is_that_of_least_squares() -> None:
    years, y = np.array([-4.0, -3.0, -2.0, -1.0, -0.5, 0.0]), np.array([-6.01, -4.02, -2.0, 0.02, 1.01, 1.99])
    slope, at_last = np.polyfit(years, y, 1)
    found = line(years, y, np.full(6, 0.1))
    assert found.value == pytest.approx(at_last)
    assert found.per_year == pytest.approx(slope)
    centred = years - years.mean()
    assert found.per_year_se == pytest.approx(stats.t.isf(stats.norm.sf(1), 4) * 0.1 / np.sqrt(centred @ centred))
    assert found.scatter == 0, "they scatter by less than their errors"
    assert found.ages


def test_two_sessions_cannot_tell_ageing_from_scatter() -> None:
    found = line(np.array([-1.0, 0.0]), np.array([1.0, 9.0]), np.array([0.1, 0.1]))
    assert found.per_year == pytest.approx(8)
    assert not found.ages
    assert found.scatter > 1


@pytest.mark.parametrize("n", [3, *(pytest.param(n, marks=pytest.mark.wide) for n in (4, 6)), 10])
def test_the_errors_hold_the_scatter_between_sessions(n: int) -> None:
    """Without a slope: over many histories, the mean lies within its error as often as it should, and slopes seldom count."""
    rng, within, false = np.random.default_rng(3), 0, 0
    years = np.sort(rng.uniform(-2, 0, n))
    for _ in range(1000):
        se = rng.uniform(0.5, 2.0, n)
        found = line(years, 5 + rng.normal(0, np.hypot(se, 1.5)), se)
        within += abs(found.value - 5) < found.se
        false += found.ages
    assert 0.62 < within / 1000 < 0.78
    assert false / 1000 < 0.015, f"{POLICY.ages_errors} errors"


def test_sessions_of_one_day_have_a_mean_and_no_slope() -> None:
    found = line(np.zeros(3), np.array([1.0, 2.0, 3.0]), np.full(3, 1.0))
    assert found.value == pytest.approx(2)
    assert (found.per_year, found.per_year_se) == (None, None)


def session_of(bias_dps: float, date: str, rng: np.random.Generator, board: str = "SN7") -> Session:
    """A rest and two turns about z, with this bias on z."""
    frames, facts = [], []
    for rate in (0.0, 60.0, -60.0):
        t_s = np.arange(1500) / 100
        rates = {f"g{a}_dps": rng.normal(0.02 if a != "z" else 1.004 * rate + bias_dps, 0.05, t_s.size) for a in AXES}
        frames.append(pl.DataFrame({"t_s": t_s, **rates}))
        facts.append({"face": "up", "table_rate_dps": rate})
    return Session.from_frames(frames, facts, sample_rate_hz=100.0, board=board, made_on=date)


@pytest.fixture(scope="module")
def months(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four sessions over a year, in which the bias on z grows by 0.6 deg/s."""
    folder, rng = tmp_path_factory.mktemp("history") / "months", np.random.default_rng(5)
    for k, date in enumerate(DATES):
        session_of(0.3 + 0.2 * k, date, rng).save(folder / f"s{3 - k}")  # names do not tell the order
    return folder


def test_a_sensor_that_ages_is_told_and_followed(months: Path) -> None:
    (found,) = histories(months, "paper")
    assert (found.board, found.dates) == ("SN7", DATES)
    aging = {(a.effect, a.axis): a for a in found.aging}
    bias = aging["bias", "z"]
    assert bias.ages
    assert bias.per_year == pytest.approx(0.6, abs=0.03)
    assert bias.value == pytest.approx(0.9, abs=0.02)
    assert found.model.value("bias", "z", "bias_dps") == bias.value
    scale = aging["scale", "z"]
    assert not scale.ages
    assert scale.value == pytest.approx(0.004, abs=4 * scale.se)
    assert not aging["bias", "x"].ages


def test_the_verb_tells_it_and_writes_the_model(months: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["calibrate", str(months), "--history", "--model", "paper", "-o", str(tmp_path / "m.toml")]
    assert main([*words, "--axis", "z"]) == 0
    out = capsys.readouterr().out
    assert "SN7: 4 sessions, 2025-01-10 to 2026-01-10" in out
    assert "Ageing: bias on z." in out
    assert Model.open(tmp_path / "m.toml").value("bias", "z", "bias_dps") == pytest.approx(0.9, abs=0.02)
    assert main([*words[:-2], "--json"]) == 0
    (board,) = json.loads(capsys.readouterr().out)["boards"]
    assert [s["made_on"] for s in board["sessions"]] == list(DATES)


@pytest.mark.parametrize(
    ("board", "date", "says"),
    [("", "2026-02-01", "no board"), ("SN8", "", "no made_on"), ("SN8", "spring", "made_on is 'spring'"),
     ("SN8", "2026-02-01", "one session of the board SN8")],
)  # fmt: skip
def test_what_a_history_needs(
    months: Path, tmp_path: Path, board: str, date: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    session_of(0.3, date, np.random.default_rng(1), board).save(tmp_path / "months" / "one")
    assert main(["calibrate", str(tmp_path / "months"), "--history"]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--seconds", "2"], ["--method", "model"]])
def test_whole_sessions_are_fitted(months: Path, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", str(months), "--history", *words]) == 2
    assert "leave out --seconds and --method" in capsys.readouterr().err
    assert main(["calibrate", str(months), "-o", "m.toml"]) == 2
    assert "--out is for --history" in capsys.readouterr().err


def test_what_the_bias_scatters_by_between_sessions_is_the_turn_on_bias_of_the_model(tmp_path: Path) -> None:
    """Eight sessions of one power cycle each: none shows the spread, and together they do."""
    rng = np.random.default_rng(8)
    biases_dps = 0.3 + rng.normal(0, 0.05, 8)
    for k, bias_dps in enumerate(biases_dps):
        session_of(bias_dps, f"2025-0{k + 1}-10", rng).save(tmp_path / f"s{k}")
    (found,) = histories(tmp_path, "default")
    scatter = next(a.scatter for a in found.aging if (a.effect, a.axis) == ("bias", "z"))
    turn_on = found.model.noise_on("z").turn_on_bias
    assert turn_on is not None
    assert turn_on.sd_dps == scatter == pytest.approx(np.std(biases_dps, ddof=1), rel=0.1)
    assert turn_on.se["sd_dps"] == pytest.approx(scatter / np.sqrt(14), rel=0.1)
    assert found.model.noise_on("x").turn_on_bias.sd_dps is None, "the bias about x is the same in all"  # type: ignore[union-attr]
