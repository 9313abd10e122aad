"""Encoders with coarse steps, or slower than the sensor and held until their next reading: no contradiction."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from encoders import SCALE, encoder_session, session_of_moves
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.effects.quantities import sense_of_rotation
from gyrocal.plausibility import check
from gyrocal.recording.orientation import count_deg, jumps
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run


def judged(session: Session) -> tuple[str, float, float]:
    told = compare(session, ON_Z).to_json()
    (found,) = [p for p in told["parameters"] if p["effect"] == p["name"] == "scale"]
    return told["verdict"], (found["value"] - SCALE) / found["se"], found["se"]


@pytest.mark.wide
@pytest.mark.parametrize(
    ("step_deg", "rate_hz", "swing_dps"),
    [
        pytest.param(1.0, 100.0, 25.0, marks=pytest.mark.wide), pytest.param(1.0, 200.0, 50.0, marks=pytest.mark.wide),
        pytest.param(0.36, 200.0, 15.0, marks=pytest.mark.wide), (3.0, 50.0, 60.0),
    ],
)
def test_coarse_steps_are_no_jumps_and_no_wrong_scale(step_deg: float, rate_hz: float, swing_dps: float) -> None:
    """The samples beside each step were left out, and what remained said a scale error of -46 %."""
    session = encoder_session(61, rate_hz, step_deg=step_deg, swing_dps=swing_dps)
    assert check(session) == []
    verdict, z, se = judged(session)
    assert verdict == "adequate"
    assert abs(z) < 4
    assert se < 2e-3


@pytest.mark.parametrize(
    ("encoder_hz", "rate_hz", "step_deg", "swing_dps"),
    [
        pytest.param(7.3, 50.0, 0.02, 20.0, marks=pytest.mark.wide),
        pytest.param(12.7, 100.0, 0.02, 60.0, marks=pytest.mark.wide),
        pytest.param(7.3, 50.0, 0.5, 20.0, marks=pytest.mark.wide), (31.0, 200.0, 0.3, 20.0),
    ],
)
def test_a_held_angle_is_read_at_its_own_rate(encoder_hz: float, rate_hz: float, step_deg: float, swing_dps: float) -> None:
    """Each change of a held angle was a jump, and "z reads 0.06 of the true rate"."""
    session = encoder_session(71, rate_hz, step_deg=step_deg, swing_dps=swing_dps, encoder_hz=encoder_hz)
    assert check(session) == []
    _, z, se = judged(session)
    assert abs(z) < 4
    assert se < 2e-3
    true_dps = (session.runs[0].gyro_dps[:, 2] + 0.4) / (1 + SCALE)
    reference = session.runs[0].reference_dps
    assert reference is not None
    known = np.isfinite(reference)
    assert known.mean() > 0.9
    steps = 4 * step_deg * encoder_hz  # four counts within a reading of the encoder
    assert np.std(reference[known] - true_dps[known]) < 0.05 * swing_dps + steps


def repeated(session: Session, every: int) -> Session:
    """The session with the angle of each ``every``-th sample held, as a loop makes it that asks the encoder less often."""
    def held(angle_deg: Any) -> Any:
        values = angle_deg.to_numpy()
        return np.repeat(values[::every], every)[: values.size]

    return session.with_runs(
        replace(r, frame=r.table.with_columns(ref_angle_deg=held(r.table["ref_angle_deg"]))) for r in session.runs
    )


@pytest.mark.parametrize(("every", "step_deg"), [(4, 0.02), pytest.param(10, 0.02, marks=pytest.mark.wide), (4, 0.3)])
def test_a_repeated_angle_is_as_good_as_one_with_empty_cells(every: int, step_deg: float) -> None:
    session = repeated(encoder_session(81, step_deg=step_deg, swing_dps=40.0), every)
    assert check(session) == []
    verdict, z, se = judged(session)
    assert verdict == "adequate"
    assert abs(z) < 4
    assert se < 1e-3


def test_a_slip_of_a_coarse_encoder_is_still_a_jump() -> None:
    rng = np.random.default_rng(5)
    angle_deg = np.round(40 * np.sin(np.arange(4000) / 300) + rng.uniform(0, 1))
    slipped = angle_deg + 12.0 * (np.arange(4000) > 2100)
    assert count_deg(np.diff(angle_deg)[:, None]) == 1.0
    assert not jumps(np.diff(angle_deg)[:, None]).any()
    assert np.flatnonzero(jumps(np.diff(slipped)[:, None])).tolist() == [2100]
    assert count_deg(np.diff(angle_deg + rng.normal(0, 0.1, 4000))[:, None]) == 0.0


@pytest.mark.parametrize(("seed", "step_deg", "white_dps"), [(2, 0.05, 0.1), (3, 0.36, 0.05)])
def test_the_noise_of_small_rates_is_no_lost_part_of_them(seed: int, step_deg: float, white_dps: float) -> None:
    """Between moves the steps of an encoder are small rates that nothing has read, at 10 standard errors."""
    assert measure(session_of_moves(seed, step_deg, white_dps), ON_Z).where == []


def test_the_noise_of_an_angle_has_no_direction() -> None:
    """The rate's noise about zero was sorted by its own sign: "rms 8 mdps, the table's negative direction", at 6.6 sigma."""
    rng, t_s = np.random.default_rng(2), np.arange(2000) / 100.0
    angle_deg = np.cumsum(np.where(t_s > 10, 20.0, 0.0)) / 100.0 + rng.normal(0, 0.03, t_s.size)
    sense = sense_of_rotation(make_run(t_s, 0.0, table_rate_dps=None, ref_angle_deg=angle_deg))
    assert not sense[100:900].any()
    assert (sense[1100:1900] == 1).all()
