"""An error that grows with the square of the rate's slope is no effect of the library, and takes no other effect's name."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")


def session(seed: int, of_slope: float = 0.0, of_square: float = 0.0, of_size: float = 0.0) -> Session:
    """Four power cycles of a random motion of some 40 dps and 100 dps/s."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(4000) / 100.0
    runs = []
    for cycle in range(4):
        motion = gaussian_filter1d(rng.normal(0, 1, t_s.size), 40)
        rate_dps = 40 * motion / motion.std()
        gyro = rng.normal(0, 0.05, (t_s.size, 3)) + rng.normal(0, 0.01, 3)
        extra_dps = of_slope * np.gradient(rate_dps, t_s) ** 2 + of_square * rate_dps**2 + of_size * np.abs(rate_dps)
        gyro[:, 2] += 1.002 * rate_dps + extra_dps
        runs.append(make_run(t_s, gyro, rate_ref_dps=rate_dps, scenario=f"s{cycle}"))
    return make_session(*runs)


def named(of: Session) -> list[str]:
    return [c.effect.id for c in diagnose(of, ON_Z).candidates if c.decision == "add"]


@pytest.mark.parametrize(("seed", "of_slope"), [(9601, 4e-6), pytest.param(9602, -4e-6, marks=pytest.mark.wide)])
def test_the_square_of_the_slope_is_not_that_of_the_rate(seed: int, of_slope: float) -> None:
    assert not {"centripetal", "scale_asymmetry"} & set(named(session(seed, of_slope)))


@pytest.mark.wide
def test_a_square_of_the_rate_and_an_asymmetry_keep_their_names() -> None:
    assert named(session(9603, of_square=1e-5)) == ["centripetal"]
    assert named(session(9604, of_size=1e-3)) == ["scale_asymmetry"]
