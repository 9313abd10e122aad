"""What a warning's buttons write, and that it takes the warning away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.plausibility import check
from gyrocal.recording.run import Run
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from gyrocal.web.values.views import RunView
from gyrocal.web.worker.mend import KEPT_AS, Mend, apply, mends


def reversed_gyro(run: Run) -> Run:
    return replace(run, path=None, frame=run.table.with_columns(-pl.col("gx_dps", "gy_dps", "gz_dps")))


def radians(run: Run) -> Run:
    table = run.table.with_columns(pl.col("gx_dps", "gy_dps", "gz_dps") * (np.pi / 180))
    return replace(run, path=None, frame=table)


def rate_in_radians(run: Run) -> Run:
    assert run.table_rate_dps is not None
    return replace(run, table_rate_dps=run.table_rate_dps * np.pi / 180)


def other_face(run: Run) -> Run:
    return replace(run, face="up") if run.file == "008_down.csv" else run


CASES: dict[str, tuple[Callable[[Run], Run], str]] = {
    "face_wrong": (other_face, "face"), "sign_flipped": (reversed_gyro, "sign"), "unit_rad_s": (radians, "units"),
    "of the reference": (rate_in_radians, "units"),
}  # fmt: skip


def views(session: Session) -> list[RunView]:
    return [RunView(r.file, r.scenario, r.face, r.axis, r.table_rate_dps, r.day, 0, len(r), r.duration_s) for r in session.runs]


def offered(folder: Path, code: str) -> list[Mend]:
    return [m for w in check(Session.open(folder)) if w.code == code for m in mends(w.to_json(), views(Session.open(folder)))]


@pytest.mark.parametrize("name", CASES)
def test_the_offered_way_takes_the_warning_away(tmp_path: Path, name: str) -> None:
    spoil, kind = CASES[name]
    code = "unit_rad_s" if name == "of the reference" else name
    session, _ = simulate(None, "full", (), 3, scenarios=1, seconds=5.0)
    folder = tmp_path / "slip"
    session.with_runs(list(map(spoil, session.runs))).save(folder)
    before = (folder / "session.toml").read_text()
    ways = [m for m in offered(folder, code) if m.kind == kind]
    assert ways, [w.code for w in check(Session.open(folder))]
    mended = apply(folder, ways[0], lambda: tmp_path / "mended")
    assert not any(w.blocking for w in check(Session.open(mended)))
    if kind == "units":
        assert mended == tmp_path / "mended"
        assert (folder / "session.toml").read_text() == before  # the measured files stay
    else:
        assert mended == folder
        assert (folder / KEPT_AS).read_text() == before


@pytest.mark.parametrize("rows", [1, 3])
def test_the_first_samples_can_be_dropped(tmp_path: Path, rows: int) -> None:
    """"Drop the first sample" was an advice without a button."""
    session, _ = simulate(None, "full", (), 3, scenarios=1, seconds=5.0)
    off = pl.when(pl.int_range(pl.len()) < rows).then(pl.col("gx_dps") + 4.0).otherwise(pl.col("gx_dps")).alias("gx_dps")
    spoiled = [
        replace(r, path=None, frame=r.table.with_columns(off)) if r.file == "008_down.csv" else r for r in session.runs
    ]  # fmt: skip
    folder = tmp_path / "slip"
    session.with_runs(spoiled).save(folder)
    (way, *_) = offered(folder, "first_sample")
    assert way.kind == "drop_first"
    assert "008_down.csv" in way.told
    mended = Session.open(apply(folder, way, lambda: tmp_path / "mended"))
    assert not [w for w in check(mended) if w.code == "first_sample"]
    for before, after in zip(Session.open(folder).runs, mended.runs, strict=True):
        gone = rows if before.file == "008_down.csv" else 0
        assert len(after) == len(before) - gone
        assert after.power_on_s == pytest.approx(before.power_on_s + gone / before.sample_rate_hz, abs=1e-3)
        assert np.array_equal(after.gyro_dps, before.gyro_dps[gone:])


def test_an_accepted_warning_stays_and_no_longer_blocks(tmp_path: Path) -> None:
    session, _ = simulate(None, "full", (), 3, scenarios=1, seconds=5.0)
    folder = tmp_path / "slip"
    session.with_runs(list(map(other_face, session.runs))).save(folder)
    accept = next(m for m in offered(folder, "face_wrong") if m.kind == "accept")
    apply(folder, accept, lambda: tmp_path / "none")
    found = [w for w in check(Session.open(folder)) if w.code == "face_wrong"]
    assert found
    assert not any(w.blocking for w in found)
    assert not any(m.kind == "accept" for m in offered(folder, "face_wrong"))


def test_every_offer_says_what_is_written() -> None:
    warning = {"code": "face_wrong", "axis": "z", "file": "1.csv", "text": "", "blocking": True}
    ways = mends(warning, [])
    assert [m.kind for m in ways] == ["face", "leave_out", "accept"]
    assert all(m.told.endswith(".") and ("session.toml" in m.told or "files stay" in m.told) for m in ways)
    assert mends({"code": "sample_rate", "axis": None, "file": None, "text": "", "blocking": False}, []) == []


def test_the_only_run_in_the_fits_is_not_offered_to_be_left_out() -> None:
    warning = {"code": "clipped", "axis": "x", "file": "1.csv", "text": "", "blocking": False}
    assert [m.kind for m in mends(warning, [])] == ["leave_out"]
    assert [m.kind for m in mends(warning, [], last_run="2.csv")] == ["leave_out"]
    assert mends(warning, [], last_run="1.csv") == []


@pytest.mark.parametrize(("face", "rate_dps"), [("up", 78.0), ("down", 78.0), ("up", -30.0), ("down", -150.0)])
def test_the_words_of_another_face_are_what_the_session_then_says(tmp_path: Path, face: str, rate_dps: float) -> None:
    """The true rates before and after, as the words state them, are those of the session before and after."""
    session, _ = simulate(None, "full", (), 3, scenarios=1, seconds=2.0)
    run = replace(session.runs[0], face=face, table_rate_dps=rate_dps)
    folder = tmp_path / "s"
    session.with_runs([run, *session.runs[1:]]).save(folder)
    warning = {"code": "face_wrong", "axis": "z", "file": run.file, "text": "", "blocking": True}
    way = mends(warning, views(Session.open(folder)))[0]
    apply(folder, way, lambda: tmp_path / "none")
    new = next(r for r in Session.open(folder).runs if r.file == run.file)
    before_dps, after_dps = (float(r.rate_dps.mean()) for r in (run, new))
    assert f'face = "{face}" of {run.file} becomes face = "{new.face}"' in way.told
    assert f"The table's {rate_dps:g} dps are then a true rate of {after_dps:g} dps about z, not {before_dps:g}." in way.told
    assert f"lay face {new.face} on the table" in way.told
    assert KEPT_AS in way.told


def test_what_stays_at_rest_and_what_turns_the_other_way_is_said() -> None:
    run = RunView("1.csv", "s", "up", "z", 0.0, None, 0, 10, 1.0)
    warning = {"code": "face_wrong", "axis": "z", "file": "1.csv", "text": "", "blocking": True}
    assert "at rest, so its true rate stays 0" in mends(warning, [run])[0].told
    assert "reference in the file stays" in mends(warning, [replace(run, rate_dps=None)])[0].told
    flipped = {**warning, "code": "sign_flipped", "file": None}
    told = mends(flipped, [replace(run, rate_dps=78.0), replace(run, rate_dps=-30.0)])[0].told
    assert "78 becomes -78, -30 becomes 30. This says that the table turned the other way. face stays as it is." in told
