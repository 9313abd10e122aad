"""The Allan deviation is that of noise, and not of a motion."""

import numpy as np
import pytest

from gyrocal.errors import InputError
from gyrocal.noise.allan import of_session
from gyrocal.recording.header import Reference
from make_runs import make_run, make_session

T_S = np.arange(3000) / 100
NOISE_DPS = np.random.default_rng(3).normal(0, 0.05, (T_S.size, 3))
SWING_DPS = 40 * np.sin(2 * np.pi * 0.5 * T_S)


def test_a_run_whose_true_rate_changes_is_left_out() -> None:
    still = make_run(T_S, NOISE_DPS, table_rate_dps=0.0)
    moving = make_run(T_S, NOISE_DPS + SWING_DPS[:, None] * [0, 0, 1], rate_ref_dps=SWING_DPS)
    np.testing.assert_array_equal(of_session(make_session(still, moving))[1], of_session(make_session(still))[1])


def test_a_measured_rate_that_is_constant_is_no_motion() -> None:
    rng = np.random.default_rng(4)
    encoder_dps = 40 + rng.normal(0, 0.2, T_S.size)
    steady = make_run(T_S, NOISE_DPS + np.array([0, 0, 40]), rate_ref_dps=encoder_dps)
    taus_s, deviations_dps = of_session(make_session(steady))
    assert deviations_dps[0] == pytest.approx(0.05, rel=0.05)
    assert taus_s.size > 10


def test_a_session_that_moves_throughout_is_refused_with_what_to_record() -> None:
    by_hand = make_run(T_S, NOISE_DPS + SWING_DPS[:, None], table_rate_dps=None, ax_g=0.0, ay_g=0.0, az_g=1.0)
    swinging = make_run(T_S, NOISE_DPS + SWING_DPS[:, None], rate_ref_dps=SWING_DPS)
    turned = make_run(T_S, NOISE_DPS, turn_deg=360.0)
    for session in (
        make_session(by_hand, reference=Reference(kind="gravity")), make_session(swinging), make_session(turned),
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"it moves.*--rate 0"):
            of_session(session)
