"""A tone that is fixed to the table holds its value while the table rests, at an angle that nobody wrote down."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Session
from known import ON_Z, add_measured
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers", "tests_alone")]


def session(seed: int, asymmetry: float = 0.0) -> Session:
    """Three power cycles of five rates. The tone of 30 mdps goes twice per turn and stands where each rest happens to be."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(1000) / 50.0
    runs = []
    for cycle in range(3):
        bias_dps = rng.normal(0, 0.003, 3)
        for rate_dps in (-120.0, -60.0, 0.0, 60.0, 120.0):
            start_rad = 0.4 if rate_dps == 0 else rng.uniform(0, 2 * np.pi)
            gyro = 0.2 + bias_dps + rng.normal(0, 0.04, (t_s.size, 3))
            gyro[:, 2] += 1.003 * rate_dps + asymmetry * abs(rate_dps)
            gyro[:, 2] += 0.03 * np.cos(2 * (start_rad + np.deg2rad(rate_dps) * t_s))
            runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario=f"s{cycle}"))
    return make_session(*runs)


def named(diagnosed: Session, model: Model = ON_Z) -> list[str]:
    return [c.effect.id for c in diagnose(diagnosed, model).candidates if c.decision == "add"]


@pytest.mark.wide
def test_its_value_at_rest_is_no_even_error_of_the_rate() -> None:
    of = session(9701)
    assert named(of) == ["order_tone"]
    model = add_measured(of, ON_Z, "order_tone").model
    assert not {"scale_asymmetry", "centripetal"} & set(named(of, model))


@pytest.mark.wide
def test_an_asymmetry_that_the_speeds_show_is_named_beside_it() -> None:
    of = session(9703, asymmetry=2e-3)
    model = add_measured(of, ON_Z, "order_tone").model
    assert named(of, model) == ["scale_asymmetry"]
