"""Level and colour of the noise, where a term that is still missing looks like either."""

import numpy as np
import pytest

from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from make_runs import make_run, make_session

RATE_HZ, WHITE_DPS, RIPPLE, SCALE = 50.0, 0.01, 0.004, 0.024


def test_a_ripple_and_a_scale_error_of_a_fast_motion_leave_white_noise() -> None:
    """The colour of the residual without the ripple stayed, and slews of the table counted as moments of a louder noise."""
    rng = np.random.default_rng(2)
    t_s = np.arange(round(60 * RATE_HZ)) / RATE_HZ
    rate = 150 * np.clip(2 * np.sin(2 * np.pi * t_s / 20), -1, 1)
    angle = np.cumsum(rate) / RATE_HZ
    runs = []
    for cycle in range(3):
        gyro = rng.normal(0, WHITE_DPS, (t_s.size, 3))
        gyro[:, 2] += (1 + SCALE) * rate + RIPPLE * rate * np.cos(np.radians(2 * angle))
        runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", rate_hz=RATE_HZ, rate_ref_dps=rate, table_angle_deg=angle))
    model = Model.builtin("default").with_term(Term.of(effect("table_ripple"), "z"))
    fitted = fit(make_session(*runs), model, axes=["z"]).axes["z"]
    assert not fitted.design.color.neighbours
    assert fitted.noise.white_sd_dps == pytest.approx(WHITE_DPS, rel=0.05)
    assert fitted.noise.ou_sd_dps < WHITE_DPS
    assert fitted.terms[-1].values["amplitude_2"] == pytest.approx(RIPPLE, rel=0.02)
