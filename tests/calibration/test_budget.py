"""The error budget of a calibration on a table: its squares add up, and each source is what its cause makes of it."""

import json
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.budget import BudgetRow, beside, largest
from gyrocal.calibration.calibrate import Estimate, calibrate
from gyrocal.cli import main
from gyrocal.recording.session import AXES, Run, Session
from gyrocal.simulation.simulate import LSB_DPS, RATE_HZ, WHITE_SD_DPS, simulate
from make_runs import make_run, make_session

TABLE_DPS = 78.0
CAMPAIGN = Path(str(files("gyrocal"))) / "data" / "table2" / "model.toml"


def session(
    seconds: float = 6.5, *, white_sd_dps: float = WHITE_SD_DPS, table_rate_se_dps: float | None = None,
    latitude_deg: float | None = None, tilt_deg: float | None = None, temp_c: tuple[float, float] | None = None,
    both_directions: bool = False,
) -> Session:  # fmt: skip
    """A sound sensor with each face up; ``temp_c`` is the temperature of the first and of the last run."""
    rng = np.random.default_rng(1)
    t_s = np.round(np.arange(round(seconds * RATE_HZ)) / RATE_HZ, 6)
    runs = []
    rates = [("up", 1), ("down", 1)] + [("up", -1), ("down", -1)] * both_directions
    for i, (face, direction) in enumerate(rates):
        sign = 1.0 if face == "up" else -1.0
        y = 1.004 * sign * direction * TABLE_DPS + 0.1 + rng.normal(0, white_sd_dps, t_s.size)
        columns = {f"g{a}_dps": np.round(y / LSB_DPS) * LSB_DPS for a in AXES}
        if tilt_deg is not None:
            lean = np.deg2rad(tilt_deg)
            gravity = {"ax_g": np.sin(lean), "ay_g": 0.0, "az_g": sign * np.cos(lean)}
            columns |= {name: np.full(t_s.size, g) for name, g in gravity.items()}
        if temp_c is not None:
            columns["temp_c"] = np.full(t_s.size, temp_c[min(i, 1)])
        runs.append(
            Run(i, f"{i:03d}_{face}.csv", "s000", face, "z", direction * TABLE_DPS, None, None, None, RATE_HZ,  # type: ignore[arg-type]
                frame=pl.DataFrame({"t_s": t_s, **columns}), lsb_dps=LSB_DPS, table_rate_se_dps=table_rate_se_dps,
                latitude_deg=latitude_deg)
        )  # fmt: skip
    return Session(RATE_HZ, tuple(runs), "z", "simulated", 250.0, LSB_DPS, latitude_deg)


def at_6_s(of: Session, method: str = "baseline", model: Path | None = None) -> Estimate:
    (found,) = calibrate(of, [6.0], [method], model)
    return found


def rows(found: Estimate) -> dict[str, BudgetRow]:
    return {row.source: row for row in found.budget}


def assert_adds_up(found: Estimate) -> None:
    own = [row for row in found.budget if row.in_se]
    assert own
    assert sum((row.scale or 0.0) ** 2 for row in own) == pytest.approx((found.scale_se or 0.0) ** 2, rel=1e-6)
    assert sum((row.bias_dps or 0.0) ** 2 for row in own) == pytest.approx((found.bias_se_dps or 0.0) ** 2, rel=1e-6)


@pytest.mark.parametrize("table_rate_se_dps", [None, 0.02])
@pytest.mark.parametrize(
    ("method", "model"), [("baseline", None), ("cnn", None), ("cnn", CAMPAIGN), ("model", None), ("model", CAMPAIGN)]
)
def test_the_squares_add_up(method: str, model: Path | None, table_rate_se_dps: float | None) -> None:
    assert_adds_up(at_6_s(session(table_rate_se_dps=table_rate_se_dps), method, model))


def test_the_squares_add_up_with_every_campaign_of_runs(tmp_path: Path) -> None:
    for campaign in ("swing", "full"):
        folder = tmp_path / campaign
        simulate(folder, campaign, seed=3, scenarios=2, seconds=6.0)
        for found in calibrate(Session.open(folder)):
            assert_adds_up(found)


def test_a_planted_error_of_the_table_is_the_largest_source() -> None:
    found = at_6_s(session(table_rate_se_dps=0.78))
    top = largest(found.budget)
    assert top is not None
    assert (top.source, top.scale, top.in_se) == ("table rate", pytest.approx(0.01), True)
    unstated = rows(at_6_s(session()))["table rate"]
    assert (unstated.scale, unstated.in_se) == (None, False), "an error that nobody stated is not zero"


def test_white_noise_is_that_of_a_mean() -> None:
    """Two faces at +-w: sd of the bias = sd of a face's mean / sqrt(2), that of the scale is 1/w of it."""
    white_sd_dps = 0.5
    found = rows(at_6_s(session(white_sd_dps=white_sd_dps)))["white noise"]
    expected_dps = white_sd_dps / np.sqrt(2 * 6.0 * RATE_HZ)
    assert found.bias_dps == pytest.approx(expected_dps, rel=0.1)
    assert found.scale == pytest.approx(expected_dps / TABLE_DPS, rel=0.1)


def test_a_fitted_model_splits_noise_as_its_parts_do() -> None:
    """Without drift in the model's noise, the budget has none; with four times the variance of white noise, twice the row."""
    from gyrocal.calibration.budget import by_posterior
    from gyrocal.calibration.estimator import Calibration, estimate
    from gyrocal.noise.whitening import Noise

    runs = [run for run in (r.first(6.0) for r in session().runs) if run is not None]
    plain = Calibration("plain", "z", (), (), (0.0, np.inf), (0.0, np.inf), Noise(0.1))
    for calibration in (plain, replace(plain, noise=Noise(0.2))):
        answer = estimate(calibration, runs)
        assert answer is not None
        (row,) = by_posterior(calibration, runs, answer)
        assert (row.source, row.scale) == ("white noise", pytest.approx(answer.scale_se))
    drifting = replace(plain, noise=Noise(1e-6, 0.003, 30.0))
    answer = estimate(drifting, runs)
    assert answer is not None
    drift = max(by_posterior(drifting, runs, answer), key=lambda row: row.scale or 0.0)
    assert (drift.source, drift.scale) == ("drift", pytest.approx(answer.scale_se, rel=1e-3))


@pytest.mark.parametrize("both_directions", [False, True])
def test_no_turns_are_asked_for_that_were_made(both_directions: bool) -> None:
    """The Earth's rate keeps its sign where the table turns the other way, so both ways on each face cancel it."""
    runs = session(both_directions=both_directions).runs
    (row,) = (r for r in beside(runs, "z", None) if r.source == "Earth's rate")
    assert ("turn in both directions" in row.advice) == (not both_directions)
    assert "state latitude_deg" in row.advice
    assert row.bias_dps == 0.0, "rounding errors are no share"
    assert (row.scale == 0.0) == both_directions


@pytest.mark.parametrize("turn_se_deg", [None, 1.8])
def test_a_turn_by_hand_has_the_error_of_its_angle_and_not_of_a_table(turn_se_deg: float | None) -> None:
    t_s = np.arange(round(8 * RATE_HZ)) / RATE_HZ
    rest, turned = make_run(t_s, 0.1, table_rate_dps=0.0), make_run(t_s, 45.1, turn_deg=360.0)
    of = make_session(rest, replace(turned, turn_se_deg=turn_se_deg))
    (found,) = (e for e in calibrate(of) if e.axis == "z")
    assert "table rate" not in rows(found)
    row = rows(found)["turn angle"]
    known = turn_se_deg is not None
    assert (row.scale, row.in_se) == (pytest.approx(1.8 / 360, rel=1e-3) if known else None, known)
    assert "turn_se_deg" in row.advice
    assert not any("table" in row.advice for row in found.budget)


def test_turns_that_the_fit_weighs_by_their_scatter_are_no_bound() -> None:
    t_s = np.arange(100) / RATE_HZ
    turns = [make_run(t_s, 0.0, turn_deg=angle) for angle in (360.0, -360.0)]
    assert "turn angle" not in {row.source for row in beside(turns, "z", None, weighed=True)}
    assert "turn angle" in {row.source for row in beside(turns[:1], "z", None, weighed=True)}


@pytest.mark.parametrize("method", ["cnn", "model"])
def test_the_model_of_a_campaign_is_not_asked_for_where_it_is_given(method: str) -> None:
    assert any("--model" in row.advice for row in at_6_s(session(), method).budget)
    assert not any("--model" in row.advice for row in at_6_s(session(), method, CAMPAIGN).budget)


def test_without_a_latitude_the_earths_row_is_the_bound_of_all_places_and_says_how_to_correct_it() -> None:
    found = rows(at_6_s(session()))["Earth's rate"]
    assert found.scale == pytest.approx(15.041067 / 3600 / TABLE_DPS, abs=1e-12), "its sign follows the face as w does"
    assert found.bias_dps == pytest.approx(0.0, abs=1e-9)
    assert not found.in_se
    assert "latitude_deg" in found.advice


@pytest.mark.parametrize(("method", "model"), [("baseline", None), ("cnn", None), ("model", None), ("model", CAMPAIGN)])
@pytest.mark.parametrize("latitude_deg", [90.0, -30.0])
def test_a_latitude_corrects_every_answer_and_leaves_no_row(method: str, model: Path | None, latitude_deg: float) -> None:
    """The rate of the Earth is part of the true rate: a scale is smaller by it over the table's rate."""
    plain, corrected = (at_6_s(session(latitude_deg=x), method, model) for x in (None, latitude_deg))
    assert "Earth's rate" not in rows(corrected)
    assert plain.scale is not None
    assert corrected.scale is not None
    share = 15.041067 / 3600 * np.sin(np.deg2rad(latitude_deg)) / TABLE_DPS
    assert corrected.scale - plain.scale == pytest.approx(-share, rel=0.1)
    assert corrected.bias_dps == pytest.approx(plain.bias_dps, abs=2e-4)


def test_both_directions_on_each_face_cancel_the_earths_rate() -> None:
    found = rows(at_6_s(session(both_directions=True), "model"))["Earth's rate"]
    assert (found.scale, found.bias_dps) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.0, abs=1e-9))


def test_tilt_is_that_of_the_accelerometer_or_assumed() -> None:
    offset = np.rad2deg(0.02)  # an accelerometer's own, by its datasheet 20 mg
    assert rows(at_6_s(session(tilt_deg=5.0)))["tilt"].scale == pytest.approx(1 - np.cos(np.deg2rad(5.0 + offset)))
    assumed = 1 - np.cos(np.deg2rad(2.0))
    assert rows(at_6_s(session()))["tilt"].scale == pytest.approx(assumed)
    assert rows(at_6_s(session(tilt_deg=90.0)))["tilt"].scale == pytest.approx(assumed), "gravity does not show that axis"


def test_temperature_is_its_spread_times_the_datasheets_slopes() -> None:
    found = rows(at_6_s(session(temp_c=(24.0, 28.0))))["temperature"]
    assert (found.scale, found.bias_dps, found.in_se) == (pytest.approx(4 * 7e-5), pytest.approx(4 * 0.01), False)
    assert rows(at_6_s(session()))["temperature"].scale is None


def test_the_advice_asks_for_nothing_that_was_recorded() -> None:
    """"Record temp_c" was the advice of a session with temp_c, where the lack of two effects in the model makes the row."""
    known = session(temp_c=(24.0, 28.0), tilt_deg=1.0)
    warm, tilted = (rows(at_6_s(known))[name].advice for name in ("temperature", "tilt"))
    assert "record" not in warm
    assert "scale over temperature and bias over temperature" in warm
    assert "4 °C" in warm
    assert "record" not in tilted
    bare = rows(at_6_s(session()))
    assert "record temp_c" in bare["temperature"].advice
    assert "record the accelerometer" in bare["tilt"].advice
    runs = known.runs
    (only,) = (r for r in beside(runs, "z", 4.0, ["scale_temperature"]) if r.source == "temperature")
    assert (only.scale, only.bias_dps) == (0.0, pytest.approx(0.04))
    assert "by a model with bias over temperature:" in only.advice
    stated = rows(at_6_s(session(table_rate_se_dps=0.01)))["table rate"]
    assert "smaller table_rate_se_dps" in stated.advice


def test_the_clock_counts_where_the_rate_comes_from_an_angle() -> None:
    known = session()
    assert rows(at_6_s(known))["sample clock"].scale == 0.0
    turned = [replace(r, table_rate_dps=None, turn_deg=TABLE_DPS * r.duration_s) for r in known.runs]
    (found,) = calibrate(known.with_runs(turned), methods=["model"])
    assert rows(found)["sample clock"].scale == 1e-4
    assert_adds_up(found)


def test_the_command_prints_the_budget(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulate(tmp_path / "s", "paper", seed=1, scenarios=2, seconds=7.0)
    assert main(["calibrate", str(tmp_path / "s"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told) == {"estimates", "budget", "warnings"}
    keys = {"scenario", "method", "seconds", "axis", "source", "scale", "bias_dps", "in_se", "advice"}
    assert all(set(row) == keys for row in told["budget"])
    assert "budget" not in told["estimates"][0]
    assert main(["calibrate", str(tmp_path / "s")]) == 0
    text = capsys.readouterr().out
    assert "Where the error comes from" in text
    assert "from the first 6 s of 2 recordings" in text
    assert "The largest known source is" in text
    assert "To lower it," in text
