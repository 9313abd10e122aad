"""The residual against the true rate: pairs of opposite rates, and words that are true of the residual."""

import re

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.noise.drift import ou_noise
from make_runs import make_run, make_session

RATE_HZ = 100.0


def pairs(seed, rates=(78.0, -78.0), cycles=4, asymmetry=0.0, misaligned=0.0):
    rng = np.random.default_rng(seed)
    t_s = np.arange(3000) / RATE_HZ
    made = []
    for cycle in range(cycles):
        turn_on = rng.normal(0, 0.005, 3)
        for rate in rates:
            gyro = rng.normal(0, 0.044, (t_s.size, 3)) + ou_noise(t_s.size, 1 / RATE_HZ, 0.002, 30.0, 3, rng) - 0.05 + turn_on
            gyro[:, 2] += 1.004 * rate + asymmetry * abs(rate)
            gyro[:, 0] += misaligned * rate
            made.append(make_run(t_s, gyro, table_rate_dps=rate, scenario=f"s{cycle}", power_on_s=5.0, rate_hz=RATE_HZ))
    return make_session(*made)


@pytest.mark.parametrize(
    ("seed", "rates", "cycles"),
    [(0, (78.0, -78.0), 4), pytest.param(1, (78.0, -78.0), 4, marks=pytest.mark.wide), (2, (78.0, -78.0, 30.0, -30.0), 2)],
)
def test_pairs_without_an_effect_are_adequate(seed, rates, cycles):
    assert compare(pairs(seed, rates, cycles)).verdict == "adequate"


def test_one_pair_shows_a_misalignment_against_the_rate_and_where():
    found = compare(pairs(0, misaligned=5e-4)).where
    first = next(f for f in found if f.axis == "x")
    assert first.against == "rate"
    assert abs(stated_mdps(first.note)) == pytest.approx(39.0, abs=3.0)  # 5e-4 times 78 deg/s, either direction


@pytest.mark.parametrize(("rates", "cycles"), [((78.0, -78.0, 30.0, -30.0), 2), ((78.0, -78.0, 30.0, -30.0, 150.0, -150.0), 1)])
def test_pairs_of_several_speeds_show_an_asymmetry_against_the_rate(rates, cycles):
    assert [(f.axis, f.against) for f in compare(pairs(1, rates, cycles, asymmetry=1e-3)).where] == [("z", "rate")]


def stated_mdps(note):
    found = re.search(r"mostly ([+-][0-9.e+-]+) mdps", note)
    assert found is not None, note
    return float(found.group(1))
