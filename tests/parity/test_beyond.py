"""A calibration at temperatures beyond those of its model: the C core and the host take the nearest end of the range."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.estimator import calibration_of, estimate
from gyrocal.calibration.header import render_calibration
from gyrocal.calibration.limit import PROTOCOL
from gyrocal.core.estimator import CoreEstimator
from gyrocal.effects import base
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model, Term
from gyrocal.noise.axis import AxisNoise
from gyrocal.simulation.simulate import paper_windows

LOW_C, HIGH_C, SECONDS = 12.0, 38.5, 6.0
TERMS = (
    Term("scale", "z"), Term("bias", "z"),
    replace(Term.of(base.effect("bias_temperature"), "z", {"k1_dps_per_c": 0.02}), se={"k1_dps_per_c": 1e-4}),
    replace(Term.of(base.effect("scale_temperature"), "z", {"k_per_c": 1e-4}), se={"k_per_c": 1e-6}),
)  # fmt: skip
MODEL = Model("chamber", TERMS, {"z": AxisNoise(0.0448)}, FittedOn({"temp_c": (LOW_C, HIGH_C)}))


@pytest.mark.parametrize(("beyond_c", "end_c"), [(HIGH_C + 20, HIGH_C), (LOW_C - 20, LOW_C)])
def test_the_core_and_the_host_clamp_alike(
    tmp_path: Path, require_tool: Callable[[str], str], beyond_c: float, end_c: float
) -> None:
    require_tool("cc")
    data, calibration = paper_windows(1, 5), calibration_of(MODEL, "z")
    (tmp_path / "calibration.h").write_text(render_calibration(calibration))
    core = CoreEstimator(tmp_path / "calibration.h")

    def in_c(temp_c: float) -> np.ndarray:
        return core.answers(data["up"], data["down"], [SECONDS], PROTOCOL, temp_c)[0, 0]

    def in_python(temp_c: float) -> np.ndarray:
        runs = []
        for run, residual in zip(PROTOCOL.runs(SECONDS, temp_c=temp_c), (data["up"], data["down"]), strict=True):
            reading = pl.Series("gz_dps", run.rate_dps + residual[0, : len(run)])
            runs.append(replace(run, frame=run.table.with_columns(reading)))
        found = estimate(calibration, runs)
        assert found is not None
        return np.array([found.scale, found.scale_se, found.bias_dps, found.bias_se_dps])

    assert np.array_equal(in_c(beyond_c), in_c(end_c))
    assert np.array_equal(in_python(beyond_c), in_python(end_c))
    assert in_c(beyond_c)[:4] == pytest.approx(in_python(beyond_c), rel=1e-5)
    assert in_c(25.0)[2] - in_c(end_c)[2] == pytest.approx(0.02 * (end_c - 25), abs=1e-3)
