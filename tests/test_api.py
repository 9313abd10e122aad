"""The Python interface: the README's lines, and what people expect of results in Python and in a notebook."""

import builtins
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import gyrocal.api
from gyrocal.api import (
    InputError,
    Model,
    Session,
    add,
    allan,
    apply,
    calibrate,
    compare,
    diagnose,
    explain,
    export,
    import_recording,
    plan,
    simulate,
)  # fmt: skip
from gyrocal.present.output import plus_minus

pytestmark = pytest.mark.usefixtures("known_answers")
TABLE2 = files("gyrocal") / "data" / "table2" / "model.toml"


@pytest.fixture(scope="module")
def session() -> Session:
    return simulate(None, "paper", ["table_ripple"], 3, scenarios=3, seconds=8.0)[0]


@pytest.fixture(scope="module")
def results(session: Session) -> dict[str, Any]:
    found = diagnose(session)
    return {"Session": session, "Diagnosis": found, "Comparison": found.comparison, "Calibration": calibrate(session),
            "Model": found.comparison.fit.model, "Fit": found.comparison.fit, "Explanation": explain(session)}  # fmt: skip


def test_the_steps_of_the_readme(session: Session) -> None:
    model = Model.open("default")
    best = diagnose(session, model).best
    assert best is not None
    model = model.add(best.effect.id, best.axis)
    assert model.ids[-1] == "table_ripple"
    assert compare(session, model).verdict == "adequate"


@pytest.mark.parametrize("kind", ["Session", "Diagnosis", "Comparison", "Calibration", "Model", "Fit", "Explanation"])
def test_results_show_themselves(results: dict[str, Any], kind: str) -> None:
    shown = results[kind]
    assert repr(shown).startswith(f"<{kind}: ")
    assert len(repr(shown)) < 300
    assert repr(shown)[len(kind) + 3 : -1] == shown.summary().splitlines()[0]
    table = shown.to_dataframe()
    assert isinstance(table, pl.DataFrame)
    assert table.height
    assert isinstance(shown.plot(), Figure)
    page = shown._repr_html_()
    assert "<table" in page
    assert len(page) < 100_000
    assert shown == shown
    assert shown != results["Session" if kind != "Session" else "Model"]


def test_pictures_name_what_they_show(results: dict[str, Any]) -> None:
    def words(kind: str) -> str:
        figure = results[kind].plot()
        figure.canvas.draw()
        return " ".join(text.get_text() for text in figure.findobj(Text))

    diagnosis, model = results["Diagnosis"], results["Model"]
    assert f"{diagnosis.best.effect.id} on z: add" in words("Diagnosis")
    assert {f"{e.scenario} {e.axis}\n2, first {e.seconds:g} s" for e in results["Calibration"]} <= {
        text.get_text() for text in results["Calibration"].plot().findobj(Text)
    }
    (row,) = model.to_dataframe().filter(effect="scale", axis="z", parameter="scale").rows(named=True)
    assert plus_minus(row["value"], row["se"]) in words("Model")


def test_tables_hold_what_the_results_say(results: dict[str, Any], session: Session) -> None:
    assert results["Session"].to_dataframe().height == session.rows
    assert (
        results["Comparison"].to_dataframe().row(by_predicate=pl.col("axis") == "all")[1]
        == results["Comparison"].pooled.rms_dps
    )
    assert results["Diagnosis"].to_dataframe()["effect"][0] == "table_ripple"
    found = results["Diagnosis"]
    assert found.to_dataframe()["decision"].to_list() == [c.decision for c in found.candidates]
    group = tuple(c.effect.id for c in found.candidates[:2])
    rivals = [replace(c, decision="add", group=group) for c in found.candidates[:2]]
    open_ = replace(found, verdict="ambiguous", candidates=rivals).to_dataframe()
    assert open_["decision"].to_list() == ["ambiguous"] * 2
    assert open_["group"].to_list() == [list(group)] * 2
    assert results["Calibration"].to_dataframe()["scale"].to_list() == [e.scale for e in results["Calibration"]]
    assert results["Explanation"].to_dataframe()["effects"].to_list() == [["table_ripple"]]
    model = results["Model"]
    (row,) = model.to_dataframe().filter(effect="scale", axis="z", parameter="scale").rows()
    assert row[3] == model.value("scale", "z", "scale")


def test_a_session_by_gravity_is_read_by_the_same_calls() -> None:
    session = simulate(None, "hands", ["misalignment"], 1, scenarios=20)[0]
    found = explain(session)
    for result in (compare(session), diagnose(session), calibrate(session), found):
        assert len(repr(result)) < 200
        assert result.summary()
        assert isinstance(result.plot(), Figure)
        assert result.to_dataframe().height
        assert result == result
    assert found.model.ids[-1] == "misalignment"
    assert compare(session, found.model, as_is=True).verdict == "adequate"
    assert add(session, None, "misalignment").model.ids == found.model.ids
    with pytest.raises(InputError, match="only_day: not for a session whose reference is gravity"):
        compare(session, only_day=1)


def test_two_comparisons_can_be_compared(session: Session) -> None:
    one = diagnose(session).comparison
    assert (one == diagnose(session).comparison) in (True, False)


@pytest.mark.parametrize("kind", ["polars", "pandas", "arrays"])
def test_a_session_from_frames(session: Session, kind: str) -> None:
    make: Any = {
        "polars": lambda t: t,
        "pandas": lambda t: pd.DataFrame({c: t[c].to_numpy() for c in t.columns}),
        "arrays": lambda t: {c: t[c].to_numpy() for c in t.columns},
    }[kind]
    keys = ("face", "scenario", "table_rate_dps", "day")
    frames = [make(run.table) for run in session.runs]
    again = Session.from_frames(
        frames, [{key: getattr(run, key) for key in keys} for run in session.runs], lsb_dps=session.lsb_dps
    )
    assert again.sample_rate_hz == pytest.approx(session.sample_rate_hz, rel=1e-3)
    assert [run.rate_dps[0] for run in again.runs] == [run.rate_dps[0] for run in session.runs]
    assert np.array_equal(again.runs[1].gyro_dps, session.runs[1].gyro_dps)
    expected = [e.scale for e in calibrate(session, [4.0], ["baseline"])]
    assert [e.scale for e in calibrate(again, [4.0], ["baseline"])] == pytest.approx(expected, rel=1e-9)


T = {"t_s": np.arange(9) / 10, "gx_dps": np.zeros(9), "gy_dps": np.zeros(9), "gz_dps": np.ones(9)}


def test_a_session_by_gravity_and_its_origin_from_frames() -> None:
    frame = {**T, "ax_g": np.zeros(9), "ay_g": np.zeros(9), "az_g": np.ones(9)}
    session = Session.from_frames([frame], [{}], reference={"kind": "gravity"}, board="b1", made_on="2026-05-03")
    assert (session.reference.kind, session.board, session.made_on) == ("gravity", "b1", "2026-05-03")


@pytest.mark.parametrize(
    ("frames", "runs", "header", "says"),
    [
        ([], [], {}, "no frames"),
        ([T], [], {}, "1 frames and 0 runs"),
        ([T], [{"fase": "up"}], {}, "did you mean face"),
        ([T], [{"table_rate_dps": "fast"}], {}, "table_rate_dps"),
        ([T], [{}], {}, "true rate is not known"),
        ([{"t_s": T["t_s"]}], [{"table_rate_dps": 0.0}], {}, "frame 0: no column gx_dps"),
        ([T], [{"table_rate_dps": 0.0}], {"sampel_rate_hz": 10.0}, "did you mean sample_rate_hz"),
        ([3], [{"table_rate_dps": 0.0}], {}, "give a frame of polars or pandas"),
    ],
)
def test_frames_that_are_no_session(frames: list[Any], runs: list[dict[str, Any]], header: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        Session.from_frames(frames, runs, **header)


def test_a_recording_is_imported_by_the_names_of_its_facts(tmp_path: Path) -> None:
    rows = np.column_stack([T["t_s"], 131 * np.ones(9)])
    np.savetxt(tmp_path / "log.csv", rows, "%.1f", ",", header="t,w", comments="")
    maps = ["t_s=t", "gz_dps=w:counts"]
    facts: dict[str, Any] = {"face": "down", "table_rate_dps": 78.0, "lsb_dps": 1 / 131, "cuts": ["one:1:8"]}
    session = import_recording(tmp_path / "log.csv", tmp_path / "lab", maps, **facts)
    (run,) = session.runs
    assert (run.file, run.face, run.table_rate_dps, len(run)) == ("one.csv", "down", 78.0, 7)
    assert run.gyro_dps[:, 2] == pytest.approx(1.0)
    with pytest.raises(InputError, match="no argument 'rate_hs' \\(did you mean rate_hz\\?\\)"):
        import_recording(tmp_path / "log.csv", tmp_path / "new", maps, rate_hs=100.0)


def test_a_folder_will_do_and_errors_speak_python(session: Session, tmp_path: Path) -> None:
    session.save(tmp_path / "s")
    assert [e.scale for e in calibrate(str(tmp_path / "s"), [4.0], ["baseline"])] == pytest.approx(
        [e.scale for e in calibrate(session, [4.0], ["baseline"])], abs=1e-8
    )
    for wrong in (
        lambda: calibrate(tmp_path / "s", methods=["guess"]),
        lambda: calibrate(tmp_path / "s", seconds=[-1.0]),
        lambda: compare(tmp_path / "s", "defualt"),
        lambda: add(tmp_path / "s", None, "no_effect"),
        lambda: simulate(None, "papr"),
        lambda: import_recording(tmp_path / "s" / "000_up.csv", tmp_path / "o", ["x"]),
        lambda: diagnose(tmp_path / "none"),
    ):
        with pytest.raises(InputError) as error:
            wrong()
        assert "--" not in str(error.value)


WRONG: dict[str, Callable[[Path], Any]] = {
    "most_steps is -1; give": lambda s: explain(s, most_steps=-1),
    "model is a int; give a Model": lambda s: compare(s, 3),  # type: ignore[arg-type]
    "frame is a list; give": lambda s: Model.open(str(TABLE2)).correct([1.0]),
    "reading_dps is one sample": lambda s: Model.open(str(TABLE2)).corrector()([1.0, 2.0]),
    "methods q: there are": lambda s: calibrate(s, methods="q"),
    "only_day 9: no such day": lambda s: compare(s, only_day=9),
    "methods guess: there are": lambda s: calibrate(s, methods=["guess"]),
    "between drift: give two different effects": lambda s: plan(s, between=["drift"]),
    "between and measure ask two questions": lambda s: plan(s, between=["drift", "warmup"], measure="drift"),
    "table_dps -1: want": lambda s: plan(s, table_dps=-1.0),
    "chamber_c 30:10: want": lambda s: plan(s, chamber_c=(30.0, 10.0)),
    "minutes -5: want": lambda s: plan(s, minutes=-5.0),
    "effects drift:k_dps_per_s: 'k_dps_per_s' is not": lambda s: simulate(None, "paper", ["drift:k_dps_per_s"]),
    "bias rest:x: give seconds": lambda s: apply(s, "default", s.with_name("out"), "rest:x"),
    "bias none: No such file or directory; give model, rest:S or the JSON of `gyrocal calibrate": lambda s: apply(
        s, "default", s.with_name("out"), "none"
    ),
    "no time: map t_s, or give rate_hz": lambda s: imported(s, "gz_dps=w"),
    "turn_deg, or gravity (turned by hand), or map rate_ref_dps or ref_angle_deg": lambda s: imported(s, "t_s=t", "gz_dps=w"),
    "maps gz_dps=w:rpm: unit": lambda s: imported(s, "gz_dps=w:rpm"),
    "maps gz_dps=w:counts: the unit counts needs lsb_dps": lambda s: imported(s, "gz_dps=w:counts"),
}


def test_no_builtin_is_shadowed() -> None:
    assert [name for name in gyrocal.api.__all__ if hasattr(builtins, name)] == []
    for name in gyrocal.api.__all__:
        assert getattr(gyrocal.api, name) is not None
    with pytest.deprecated_call(match="now SessionWarning"):
        assert gyrocal.api.Warning is gyrocal.api.SessionWarning  # type: ignore[attr-defined]


def test_one_value_will_do_where_several_are_taken(session: Session) -> None:
    one, listed = calibrate(session, 6, "baseline"), calibrate(session, [6.0], ["baseline"])  # type: ignore[arg-type]
    assert [e.to_json() for e in one] == [e.to_json() for e in listed]


def test_a_model_corrects_arrays_by_name(session: Session) -> None:
    frame, model = session.runs[0].table.head(100), Model.open(str(TABLE2))
    by_name = model.correct({name: frame[name].to_numpy() for name in frame.columns})
    assert isinstance(by_name, dict)
    assert by_name["gz_dps"] == pytest.approx(model.correct(frame)["gz_dps"].to_numpy())


def imported(session: Path, *maps: str) -> Session:
    source = session.with_name("log.csv")
    source.write_text("t,w\n0,1\n1,1\n2,1\n")
    return import_recording(source, session.with_name("lab"), maps)


@pytest.mark.parametrize("says", WRONG)
def test_an_error_names_the_argument(says: str, session: Session, tmp_path: Path) -> None:
    session.save(tmp_path / "s")
    with pytest.raises(InputError) as error:
        WRONG[says](tmp_path / "s")
    assert says in str(error.value)


def test_allan_deviation_of_a_session_is_allantools(session: Session, require_module: Callable[[str], None]) -> None:
    require_module("allantools")
    import allantools

    one = session.with_runs(session.runs[:1])
    taus_s, ours = allan(one, "z", [0.1, 0.5, 2.0])
    readings = one.runs[0].gyro_dps[:, 2]
    _, theirs, _, _ = allantools.oadev(readings, rate=session.sample_rate_hz, data_type="freq", taus=taus_s)
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)
    assert taus_s == pytest.approx([0.1, 0.5, 2.0], abs=0.501 / session.sample_rate_hz)
    assert len(allan(session)[0]) > 10
    with pytest.raises(InputError, match=r"taus_s 30: it cannot be shown; give times from 0\.0069 to 2\.6"):
        allan(session, "z", [30.0])
    with pytest.raises(InputError, match="axis is 'w', not x, y or z"):
        allan(session, "w")


def test_a_model_is_exported(results: dict[str, Any], tmp_path: Path) -> None:
    written = results["Model"].export(tmp_path / "new" / "folder", "json")
    assert written.file == tmp_path / "new" / "folder" / "model.json"
    assert written.file.is_file()
    assert "noise" not in written.left
    assert results["Model"].export(tmp_path).file.name == "calibration.h"
    with pytest.raises(InputError, match=r"^form kalibr needs rate_hz"):
        export(results["Model"], tmp_path, "kalibr")
    with pytest.raises(InputError, match=r"^form jsn: there are header, ardupilot"):
        results["Model"].export(tmp_path, "jsn")
    with pytest.raises(InputError, match="axis is 'w'"):
        results["Model"].export(tmp_path, axis="w")


def test_what_results_hold_shows_itself_in_a_line(results: dict[str, Any]) -> None:
    shown = [results["Session"].runs[0], results["Diagnosis"].best, next(iter(results["Calibration"]))]
    assert [repr(one).split(":")[0] for one in shown] == ["<Run", "<Candidate", "<Estimate"]
    assert max(len(repr(one)) for one in shown) < 120


def test_tables_become_those_of_pandas_without_pyarrow(results: dict[str, Any]) -> None:
    assert "pyarrow" not in sys.modules
    for name, result in results.items():
        table, found = result.to_dataframe(), result.to_pandas()
        assert list(found.columns) == table.columns, name
        assert len(found) == table.height
        for column in table.get_columns():
            if column.dtype.is_float():
                assert np.array_equal(found[column.name].to_numpy(), column.fill_null(float("nan")).to_numpy(), equal_nan=True)
    assert "pyarrow" not in sys.modules
