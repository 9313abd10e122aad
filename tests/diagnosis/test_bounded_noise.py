"""With an effect missing, noise, residual and excess are those beside the effect."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.inference import heldout
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import OU_SD_DPS, WHITE_SD_DPS, simulate
from known import ON_Z
from make_runs import Array, make_run, make_session
from study import study

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
excess = study("excess")
SPIN_UP, RAMP = "spin_up:A=0.002,tau_s=2", "bias_temperature:k1_dps_per_c=0.02,k2_dps_per_c2=0.0005"
CASES = (
    excess.Case("full", SPIN_UP, seed=31, how={"scenarios": 1}),
    excess.Case("paper", SPIN_UP, seed=32, how={"scenarios": 6}),
    excess.Case("chamber", RAMP, seed=33, how={"scenarios": 2, "seconds": 900.0}),
)


@pytest.fixture(scope="module", params=CASES, ids=str)
def compared(request: pytest.FixtureRequest) -> tuple[Session, Comparison, float]:
    """A session, its comparison, and what least squares leaves of it, deg/s."""
    session, turn_on_dps = request.param.session()
    return session, measure(session, ON_Z), excess.least_squares_dps(session, turn_on_dps, "z", 1.0)[0]


def test_the_excess_is_what_least_squares_leaves(compared: tuple[Session, Comparison, float]) -> None:
    """The likeliest drift alone makes it two times too large, or a third of it."""
    _, found, left_dps = compared
    assert found.per_axis["z"].excess_dps == pytest.approx(left_dps, rel=0.03)
    assert found.per_axis["z"].excess_within_dps == pytest.approx(left_dps, rel=0.03)


def test_the_noise_is_that_of_the_sensor(compared: tuple[Session, Comparison, float]) -> None:
    _, found, _ = compared
    noise, likeliest = found.fit.axes["z"].noise, found.likeliest.axes["z"].noise
    assert noise.white_sd_dps == pytest.approx(WHITE_SD_DPS, rel=0.02)
    assert noise.ou_sd_dps < 3 * OU_SD_DPS
    assert likeliest.ou_sd_dps > 10 * OU_SD_DPS


def test_what_is_drawn_is_the_best_line(compared: tuple[Session, Comparison, float]) -> None:
    """No scale and bias leave a noticeably smaller residual than those that are told."""
    _, found, _ = compared
    parts = [(p.residual_dps, p.run.rate_dps) for p in heldout.fitted(found.fit.on("z"))]
    residual, rate = (np.concatenate(x) for x in zip(*parts, strict=True))
    columns = np.column_stack([np.ones_like(rate), rate])
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(np.sqrt(np.mean(left**2)), rel=2e-3)


def test_an_effect_that_shows_as_an_excess_alone_does_not_stay_in_the_floor() -> None:
    """In one run, a drift explains a ramp of temperature as well as steps do; the excess follows it all the same."""
    session = simulate(None, "chamber", [RAMP], 33, scenarios=1, seconds=900.0)[0]
    found = measure(session, ON_Z)
    assert [f.against for f in found.where] == ["temperature"]
    assert found.per_axis["z"].floor_dps == pytest.approx(WHITE_SD_DPS, rel=0.03)
    assert found.likeliest.axes["z"].noise.ou_sd_dps > 10 * found.fit.axes["z"].noise.ou_sd_dps


@pytest.mark.wide
def test_what_a_candidate_removes_is_what_compare_shows() -> None:
    session, _ = CASES[1].session()
    found = diagnose(session, ON_Z)
    best = found.best
    assert best is not None
    assert best.effect.id == "spin_up"
    assert best.excess_drop_dps == pytest.approx(found.comparison.per_axis["z"].excess_within_dps, rel=0.05)


def test_a_candidate_has_no_more_drift_than_what_is_left_beside_the_misfit() -> None:
    """A fit of an effect that does not act has the spin-up in its drift, and so had its floor."""
    found = measure(CASES[1].session()[0], ON_Z)
    current = Current.of(found, "z")
    floor, squares = current.floor_of(current.fit), current.squares_of(current.fit)
    assert floor.within == pytest.approx(found.floors["z"].within, rel=0.01)
    assert squares.within == pytest.approx(found.squares["z"].within, rel=0.01)
    assert current.fit.noise.ou_sd_dps > 3 * found.fit.axes["z"].noise.ou_sd_dps


def test_where_nothing_is_found_the_noise_is_the_likeliest() -> None:
    found = measure(simulate(None, "paper", [], 34, scenarios=4, seconds=30.0)[0])
    assert not found.where
    assert all(found.fit.axes[axis] is found.likeliest.axes[axis] for axis in found.fit.axes)


@pytest.mark.wide
def test_the_error_of_an_excess_counts_the_offsets_of_power_cycles() -> None:
    """An asymmetry over runs that each have an offset: its excess varies with the offsets from session to session."""
    found = []
    for seed in range(8):
        case = excess.Case("full", "scale_asymmetry:k=0.0005", seed=40 + seed, how={"scenarios": 1, "seconds": 20.0})
        level = measure(case.session()[0], ON_Z).per_axis["z"]
        assert level.excess_dps is not None
        assert level.excess_se_dps is not None
        found.append((level.excess_dps, level.excess_se_dps))
    sizes, errors = np.transpose(found)
    assert 0.5 < np.std(sizes, ddof=1) / np.sqrt(np.mean(errors**2)) < 2.0


@pytest.mark.parametrize(("tau_s", "part"), [(1e-3, 1.0), (30.0, None), (1e7, 0.0)])
def test_a_drift_within_a_run(tau_s: float, part: float | None) -> None:
    """Of a fast drift all shows within a run, of a slow one nothing; between, as its autocovariance says."""
    seconds, sd_dps = 40.0, 0.01
    if part is None:
        t_s = (np.arange(2000) + 0.5) * seconds / 2000
        part = 1 - float(np.mean(np.exp(-np.abs(t_s[:, None] - t_s) / tau_s)))
    assert Noise(0.04, sd_dps, tau_s).drift_within(seconds) == pytest.approx(part * sd_dps**2, rel=1e-3, abs=1e-9)


def warming(a_dps: float, tau_s: float, seed: int) -> tuple[Session, Array]:
    """Two power cycles of six runs whose bias settles alike in both, and what least squares of the others leaves of each run.

    The second are block means of 1 s, [n], deg/s.
    """
    rng, runs, means = np.random.default_rng(seed), [], []
    t_s = np.arange(3000) / 50
    for cycle in range(2):
        for k, rate_dps in enumerate((78.0, -78.0, 40.0, -40.0, 120.0, -120.0)):
            gyro = rng.normal(0, 0.06, (t_s.size, 3))
            power_on_s = 30.0 + 120 * k
            gyro[:, 2] += 1.004 * rate_dps + 0.1 + a_dps * np.exp(-(power_on_s + t_s) / tau_s)
            runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario=f"s{cycle}", power_on_s=power_on_s))
            means.append(np.column_stack([(gyro[:, 2] - rate_dps).reshape(-1, 50).mean(1), np.ones(60), np.full(60, rate_dps)]))
    left = []
    for k, own in enumerate(means):
        others = np.vstack(means[:k] + means[k + 1 :])
        left.append(own[:, 0] - own[:, 1:] @ np.linalg.lstsq(others[:, 1:], others[:, 0], rcond=None)[0])
    return make_session(*runs), np.concatenate(left)


@pytest.mark.wide
@pytest.mark.parametrize(("a_dps", "tau_s"), [(0.03, 200.0), pytest.param(0.05, 100.0, marks=pytest.mark.wide)])
def test_an_effect_that_its_name_alone_shows_does_not_stay_in_the_noise(a_dps: float, tau_s: float) -> None:
    """With two power cycles, a drift explains a warm-up as well. The excess was 0 ± 8 mdps beside a card that took 9 away."""
    session, left = warming(a_dps, tau_s, seed=5)
    found = compare(session, ON_Z)
    level, drop = found.per_axis["z"], diagnose(session, ON_Z)
    assert [f.note.partition("of: ")[2] for f in found.where] == ["warm-up after power-on"]
    assert level.excess_dps is not None
    assert level.excess_se_dps is not None
    assert level.excess_dps == pytest.approx(np.sqrt(np.mean(left**2) - 0.06**2 / 50), abs=2 * level.excess_se_dps)
    assert level.excess_dps > 5 * level.excess_se_dps
    assert drop.best is not None
    assert drop.best.excess_drop_dps == pytest.approx(level.excess_dps, abs=2 * level.excess_se_dps)
    assert drop.comparison.per_axis["z"] == level
