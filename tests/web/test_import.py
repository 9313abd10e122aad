"""The import of a foreign file in the browser: guessed, shown, corrected, and written as the command line writes it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from gyrocal.web.worker import intake
from gyrocal.web.worker.intake import Asked

from .test_charts import CHART, able

RATE_DPS = 78.0


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table in ms, rad/s and m/s2, with names of its own."""
    folder = tmp_path_factory.mktemp("foreign")
    rng = np.random.default_rng(4)
    n = 2000
    gyro = np.deg2rad(np.array([0.1, -0.2, RATE_DPS + 0.5]) + rng.normal(0, 0.05, (n, 3)))
    acceleration = np.array([0.0, 0.0, 9.81]) + rng.normal(0, 0.01, (n, 3))
    rows = np.column_stack([np.arange(n) * 10.0, gyro, acceleration])
    header = "time_ms,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z"
    np.savetxt(folder / "table.csv", rows, delimiter=",", header=header, comments="", fmt="%.8g")
    t_s, rate = np.arange(1200) * 0.01, np.repeat([0.0, 78.0], 600)
    readings = np.column_stack([t_s, *rng.normal(0, 0.05, (2, 1200)), rate + rng.normal(0, 0.05, 1200)])
    np.savetxt(folder / "rates.csv", readings, delimiter=",", header="t_s,gx_dps,gy_dps,gz_dps", comments="", fmt="%.6f")
    of_table = np.column_stack([t_s, rate])
    np.savetxt(folder / "truth.csv", of_table, delimiter=",", header="t_s,rate_ref_dps", comments="", fmt="%.6f")
    return folder


def test_a_guess_is_shown_with_its_reasons_before_the_rate_is_known(foreign: Path) -> None:
    looked = intake.look(foreign / "table.csv", Asked())
    assert looked.columns[0] == "time_ms"
    assert {text for text, _ in looked.maps} >= {"t_s=time_ms:ms", "gz_dps=gyr_z:rad/s", "ax_g=acc_x:m/s2"}
    assert all(why for _, why in looked.maps)
    assert "true rate" in looked.problem
    assert looked.recorded is None


def test_an_unreadable_file_says_why(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_bytes(b"\x00\x01")
    assert intake.look(tmp_path / "x.csv", Asked()).problem


def test_a_log_by_hand_becomes_a_session_by_gravity(tmp_path: Path) -> None:
    session, _ = simulate(campaign="hands", seed=0, scenarios=6)
    session.runs[0].table.write_csv(tmp_path / "log.csv")
    assert "true rate" in intake.look(tmp_path / "log.csv", Asked()).problem
    looked = intake.look(tmp_path / "log.csv", Asked(gravity=True))
    assert (looked.problem, looked.warnings) == ("", [])
    intake.take(tmp_path / "log.csv", Asked(gravity=True), tmp_path / "out")
    assert Session.open(tmp_path / "out").reference.kind == "gravity"


@pytest.mark.wide
def test_the_wizard_writes_the_session_that_was_shown(
    foreign: Path, workbench: Any, look: Callable[..., Any], chromium: Any
) -> None:
    page = look(f"{workbench.url}import")
    page.locator("input[type=file]").first.set_input_files(foreign / "table.csv")
    becomes = page.locator("[aria-label='what it would become']")
    becomes.get_by_text("gyr_z:rad/s").wait_for()
    assert not page.get_by_text("This folder has no file").is_visible()  # it stayed under an upload that worked
    becomes.get_by_text("its true rate is not known; give the table rate (0 at rest), a known turn").wait_for()
    assert "--" not in becomes.inner_text()  # the page has fields, not options
    page.get_by_role("radio", name="by hand between rests").click()
    becomes.get_by_text("1 run, 2,000 samples at 100 Hz, 20.0 s").wait_for()
    assert not page.get_by_label("table rate, dps").is_visible()
    page.get_by_role("radio", name="on a table, or with").click()
    becomes.get_by_text("its true rate is not known").wait_for()
    page.get_by_label("table rate, dps").fill(str(RATE_DPS))
    page.get_by_role("button", name="Look again").click()
    becomes.get_by_text("1 run, 2,000 samples at 100 Hz, 20.0 s").wait_for()
    able(page, 1)
    columns = page.evaluate(f"{CHART % '.content'}.getOption().series.map(s => s.name)")
    assert set(columns) == {"gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g"}
    rates = page.evaluate(f"{CHART % '.content'}.getOption().series.find(s => s.name === 'gz_dps').data.map(p => p[1])")
    assert all(abs(rate - RATE_DPS - 0.5) < 5.0 for rate in rates if rate is not None)  # rad/s became deg/s
    assert not (workbench.folder / "table").exists()
    becomes.get_by_role("button", name="Import and open").click()
    page.locator(".session-name", has_text="table").wait_for()
    page.locator(".figure b").first.wait_for()
    run = Session.open(workbench.folder / "table").runs[0]
    assert abs(run.gyro_dps[:, 2].mean() - (RATE_DPS + 0.5)) < 0.01
    assert abs(run.column("az_g").mean() - 9.81 / 9.80665) < 1e-3
    page.goto(f"{workbench.url}import")
    page.locator("input[type=file]").first.set_input_files(foreign / "rates.csv")
    runs = page.get_by_role("group", name="runs of the file")
    runs.get_by_text("These 2 stretches can be its runs").wait_for()
    assert "rates.csv: its true rate is not known" in becomes.inner_text()
    for rate, field in zip((0, 78), runs.get_by_label("table rate from").all(), strict=True):
        field.fill(str(rate))
    page.get_by_role("button", name="Look again").click()
    becomes.get_by_text("2 runs, ").wait_for()
    assert [field.input_value() for field in runs.get_by_label("table rate from").all()] == ["0", "78"]
    page.get_by_text("The true rate is in a second file").click()
    page.locator("input[type=file]").nth(1).set_input_files(foreign / "truth.csv")
    becomes.get_by_text("rate_ref_dps:dps").wait_for()
    assert becomes.get_by_text("1 run, ").is_visible()  # the reference says the rates
    assert not runs.inner_text().strip()


def test_a_file_of_four_rates_is_offered_as_four_runs(tmp_path: Path) -> None:
    """One rate for all of it gave a scale error of -100 %."""
    rng = np.random.default_rng(2)
    rate = np.repeat([0.0, 78.0, 0.0, -78.0], 600)
    table = np.column_stack([np.arange(rate.size) * 0.01, *rng.normal(0, 0.05, (2, rate.size)), 1.01 * rate + 0.3])
    table[:, 3] += rng.normal(0, 0.05, rate.size)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t_s,gx_dps,gy_dps,gz_dps", comments="", fmt="%.6f")
    looked = intake.look(tmp_path / "log.csv", Asked())
    assert "true rate" in looked.problem
    assert [round(s.mean_dps) for s in looked.stretches] == [0, 79, 0, -78]
    true_rates = (0.0, 78.0, 0.0, -78.0)
    asked = Asked(cuts=tuple(s.cut("up", r) for s, r in zip(looked.stretches, true_rates, strict=True)))
    again = intake.look(tmp_path / "log.csv", asked)
    assert again.problem == ""
    assert again.told.startswith("4 runs, ")
    assert again.stretches == looked.stretches  # so that what was said of them stays
    intake.take(tmp_path / "log.csv", asked, tmp_path / "out")
    runs = Session.open(tmp_path / "out").runs
    assert [run.table_rate_dps for run in runs] == list(true_rates)
    assert all(abs(run.gyro_dps[:, 2].mean() - 1.01 * run.table_rate_dps - 0.3) < 0.02 for run in runs)


def test_a_known_turn_and_a_second_file_are_references(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t_s = np.arange(3000) * 0.01
    rate = 40 * np.sin(2 * np.pi * 0.2 * t_s)
    gyro = np.column_stack([t_s, *rng.normal(0, 0.05, (2, t_s.size)), rate + rng.normal(0, 0.05, t_s.size)])
    np.savetxt(tmp_path / "log.csv", gyro, delimiter=",", header="t_s,gx_dps,gy_dps,gz_dps", comments="", fmt="%.6f")
    of_table = np.column_stack([t_s, rate])
    np.savetxt(tmp_path / "table.csv", of_table, delimiter=",", header="t_s,rate_ref_dps", comments="", fmt="%.6f")
    asked = Asked(reference=tmp_path / "table.csv", own_clock=True)
    looked = intake.look(tmp_path / "log.csv", asked)
    assert looked.problem == ""
    assert [text.partition("=")[0] for text, _ in looked.of_reference] == ["t_s", "rate_ref_dps"]
    intake.take(tmp_path / "log.csv", asked, tmp_path / "out")
    out = Session.open(tmp_path / "out")
    assert out.reference.clock == "own"
    assert np.nanmax(np.abs(out.runs[0].column("rate_ref_dps") - rate)) < 0.01
    intake.take(tmp_path / "log.csv", Asked(turn_deg=0.0), tmp_path / "turned")
    assert Session.open(tmp_path / "turned").runs[0].turn_deg == 0.0
