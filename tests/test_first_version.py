"""Files of the first version open: a session, a model, and the models that the workbench keeps beside a session.

``first_version/`` was written by that version's own code and is never written again.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from gyrocal.api import Model, Session
from gyrocal.cli import main
from gyrocal.error_model.correction import correct_frame
from gyrocal.web.values.models import read_models

FIRST = Path(__file__).with_name("first_version")


def test_its_session_opens() -> None:
    session = Session.open(FIRST / "session")
    assert [(r.scenario, r.face, r.table_rate_dps, len(r)) for r in session.runs] == [
        (f"s00{k}", face, 78.0, 145) for k in (0, 1) for face in ("up", "down")
    ]
    assert (session.sample_rate_hz, session.full_scale_dps, session.lsb_dps) == (145.0, 250.0, 0.00875)
    assert session.runs[1].gyro_dps[:, 2].mean() == pytest.approx(-78, abs=15)


def test_its_model_opens_with_its_values_and_corrects() -> None:
    model = Model.open(FIRST / "model.toml")
    assert model.name == "default+table_ripple"
    assert model.value("table_ripple", "z", "amplitude_1") == 0.00162094923
    assert model.fitted_on.ranges == {}
    assert model.accelerometer is None
    run = Session.open(FIRST / "session").runs[0]
    scale, bias_dps = model.value("scale", "z", "scale"), model.value("bias", "z", "bias_dps")
    corrected = correct_frame(model, run.table)["gz_dps"].to_numpy()
    assert corrected == pytest.approx((run.gyro_dps[:, 2] - bias_dps) / (1 + scale))


def test_its_model_is_written_so_that_it_reads_the_same(tmp_path: Path) -> None:
    model = Model.open(FIRST / "model.toml")
    model.save(tmp_path / "again.toml")
    again = Model.open(tmp_path / "again.toml")
    assert again.terms == model.terms
    assert again.noise == model.noise


def test_the_workbench_s_models_beside_a_session_open() -> None:
    kept = read_models(FIRST / "session")
    assert kept.current == "with ripple"
    first, second = kept.of["with ripple"]
    assert first.source == "default"
    assert (second.effect, second.doubts) == ("table_ripple", ("its gain is small",))
    assert second.cards == second.limits == ()
    assert "table_ripple" in second.source


def test_verbs_take_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = tmp_path / "session"
    shutil.copytree(FIRST / "session", session)
    words = ["--seconds", "1", "--method", "baseline,model", "--model", str(FIRST / "model.toml")]
    assert main(["calibrate", str(session), *words, "--json"]) == 0
    estimates = json.loads(capsys.readouterr().out)["estimates"]
    assert {e["method"] for e in estimates} == {"baseline", "model"}
    assert all(e["scale"] is None or np.isfinite(e["scale"]) for e in estimates)
    assert sorted(p.name for p in session.iterdir()) == sorted(p.name for p in (FIRST / "session").iterdir())
