"""The import of a foreign file in the browser: guessed, shown, corrected, and written as the command line writes it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from gyrocal.web import intake
from gyrocal.web.intake import Asked

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


def test_the_wizard_writes_the_session_that_was_shown(
    foreign: Path, serve: Callable[..., Any], look: Callable[..., Any], chromium: Any
) -> None:
    served = serve(foreign)
    page = look(f"{served.url}import")
    page.locator("input[type=file]").set_input_files(foreign / "table.csv")
    becomes = page.locator("[aria-label='what it would become']")
    becomes.get_by_text("gyr_z:rad/s").wait_for()
    assert not page.get_by_text("This folder has no file").is_visible()  # it stayed under an upload that worked
    becomes.get_by_text("its true rate is not known; give the table rate (0 at rest)").wait_for()
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
    assert not (foreign / "table").exists()
    becomes.get_by_role("button", name="Import and open").click()
    page.locator(".session-name", has_text="table").wait_for()
    page.locator(".figure b").first.wait_for()
    run = Session.open(foreign / "table").runs[0]
    assert abs(run.gyro_dps[:, 2].mean() - (RATE_DPS + 0.5)) < 0.01
    assert abs(run.column("az_g").mean() - 9.81 / 9.80665) < 1e-3
