"""Every verb on every real recording, in each form in which the recording can be a session, on parts of the recordings.

`python benchmarks/real_forms.py` does it with the whole recordings. They lie in `shared/realdata` beside the repository
(`GYROCAL_REALDATA` names another place); where not, this skips.
"""

from pathlib import Path

import pytest

from real_recordings import REALDATA
from study import study

real_forms = study("real_forms")
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers")]


AGAIN = (
    "nilspod_ferraris_360", "thermal_chamber_imu", "mpu6050_encoder_stepper", "broad_optical_ref", "mpu6050_multipose_tedaldi"
)  # fmt: skip
"""At rest, by known turns and by an encoder, which test_recordings.py and recording/test_real.py import and diagnose, too."""


@pytest.mark.parametrize(
    "folder", [pytest.param(name, marks=[pytest.mark.wide] * (name in AGAIN)) for name in real_forms.RECORDINGS]
)
def test_no_verb_fails_or_contradicts_itself_on_a_real_recording(folder: str, tmp_path: Path) -> None:
    if not (REALDATA / folder).is_dir():
        pytest.skip(f"{REALDATA / folder} is not there; GYROCAL_REALDATA names the folder of real recordings")
    for number, (name, form) in enumerate(real_forms.RECORDINGS[folder](REALDATA / folder, True)):
        found = list(real_forms.faults(form, tmp_path / str(number), short=True))
        assert found == [], name


def test_verdicts_that_contradict_each_other_are_seen() -> None:
    warning = {"code": "sign_flipped", "axis": "z", "blocking": True}
    level = {"excess_dps": 1.37, "excess_se_dps": 0.05}
    fine = {"verdict": "adequate", "warnings": []}
    left = {**fine, "residual": "rate", **level, "per_axis": {"y": level}}
    assert list(real_forms.contradictions({"compare": fine, "diagnose": {**fine, "verdict": "add"}}, "z")) == [
        "compare says adequate, diagnose add"
    ]
    assert list(real_forms.contradictions({"compare": {**fine, "warnings": [warning]}}, "z")) == [
        "compare: adequate beside the blocking warning sign_flipped"
    ]
    assert list(real_forms.contradictions({"compare": left}, "z")) == [
        "compare: adequate beside an excess of 1.370 ± 0.050 dps on y"
    ]
    assert not list(real_forms.contradictions({"compare": fine, "diagnose": {**fine}}, "z"))
