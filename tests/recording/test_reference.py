"""The table [reference] of session.toml: read, kept by save, and its unknown keys warned of."""

import numpy as np

from gyrocal import plausibility
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Session
from make_runs import make_run, make_session


def test_noises_are_read_and_saved_and_unknown_keys_told(tmp_path):
    t_s = np.arange(300) / 100.0
    make_session(make_run(t_s)).save(tmp_path / "plain")
    header = tmp_path / "plain" / "session.toml"
    noises = "ref_noise_dps = 0.03\ntemp_noise_c = 0.05\ntemp_nois = 1\n"
    header.write_text(f"{header.read_text()}\n[reference]\n{noises}")
    session = Session.open(tmp_path / "plain").save(tmp_path / "again")
    assert session.reference.ref_noise_dps == session.runs[0].reference.ref_noise_dps == 0.03
    assert session.reference.temp_noise_c == 0.05
    told = [w.text for w in plausibility.check(session, Model.open(None)) if w.code == "unknown_key"]
    assert len(told) == 1
    assert "reference.temp_noise_c" in told[0]
