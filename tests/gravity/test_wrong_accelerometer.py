"""An accelerometer whose scale or bias is far off: told, and calibrated from the rests, so that the gyroscope is right."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from by_hand import turned_by
from gyrocal.gravity.calibrate import calibrate
from gyrocal.plausibility import check
from gyrocal.recording.session import Session

AXES = "xyz"
TURNS = [(AXES[k % 3], (90.0, -90.0, 120.0, 75.0, -60.0)[k % 5]) for k in range(18)]


def with_accelerometer(session: Session, scale: list[float], bias_g: list[float]) -> Session:
    run = session.runs[0]
    assert run.acc_g is not None
    acc_g = run.acc_g * scale + bias_g
    frame = run.table.with_columns(pl.Series(f"a{a}_g", acc_g[:, i]) for i, a in enumerate(AXES))
    return replace(session, runs=(replace(run, frame=frame),))


@pytest.mark.parametrize(
    ("scale", "bias_g"),
    [([0.42] * 3, [0.0] * 3), ([0.8] * 3, [0.0] * 3), ([1.3] * 3, [0.05, 0, 0]), ([0.5, 0.6, 0.7], [0.05, -0.1, 0.2])],
)
def test_a_wrong_accelerometer_is_told_and_the_gyroscope_is_right(scale: list[float], bias_g: list[float]) -> None:
    session = with_accelerometer(turned_by(TURNS), scale, bias_g)
    told = [w for w in check(session) if w.code == "accel_unit"]
    assert len(told) == 1
    assert "the scale or the bias of the accelerometer is wrong" in told[0].text
    found = calibrate(session)
    for estimate in found.estimates:
        assert estimate.scale == pytest.approx(0.0, abs=0.004), estimate
    assert np.diag(next(iter(found.fits.values())).scene.accelerometer.matrix) == pytest.approx(scale, rel=0.02)


def test_a_sound_accelerometer_is_not_accused() -> None:
    session = with_accelerometer(turned_by(TURNS), [1.03, 0.97, 1.02], [0.04, -0.05, 0.06])
    assert not [w for w in check(session) if w.code == "accel_unit"]
