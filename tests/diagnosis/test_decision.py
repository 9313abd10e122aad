"""Which sizes are physical: up to ten times the typical one, as far as the data can tell."""

import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import in_range
from gyrocal.effects.base import effect
from gyrocal.policy import POLICY
from gyrocal.simulation.simulate import simulate
from known import ON_Z

pytestmark = pytest.mark.usefixtures("tests_alone")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_size_is_physical_within_its_error(sign: float) -> None:
    warmup = effect("warmup")
    limit_dps = POLICY.range_factor * warmup.parameter("A_dps").typical[1]

    def of(size: float, error: float) -> bool:
        values = {"A_dps": sign * size * limit_dps, "tau_s": 90.0}
        return in_range(Candidate(warmup, "z", "reject", values, {"A_dps": error * limit_dps, "tau_s": 5.0}))

    assert of(1.0, 0.0)
    assert of(1.05, 0.1)
    assert not of(1.05, 0.01)
    assert not of(1.5, 0.1)


@pytest.mark.wide
@pytest.mark.parametrize("seeds", [2, pytest.param(5, marks=pytest.mark.wide)])
def test_the_largest_physical_warm_up_is_named_whichever_way_noise_moves_its_estimate(seeds: int) -> None:
    """An estimate just above the limit had a drift named in its place."""
    found = []
    for seed in range(seeds):
        session, _ = simulate(None, "paper", ["warmup:A_dps=-0.5,tau_s=60"], seed, scenarios=4, seconds=30.0)
        best = diagnose(session, ON_Z).best
        assert best is not None
        assert (best.effect.id, best.decision) == ("warmup", "add")
        found.append(abs(best.values["A_dps"]))
    assert min(found) < 0.5 < max(found)
