"""rms, floor and excess: noise alone leaves the floor, a planted effect its own power, and the verdicts agree."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.comparison import Comparison, measure, of_excess, with_floor_of
from gyrocal.diagnosis.residual.levels import Floor, Level, MeanSquares, excess_of, explained
from gyrocal.diagnosis.residual.residual_table import residual_table
from gyrocal.inference.heldout import Prediction
from gyrocal.noise.drift import ou_noise
from gyrocal.recording.header import Reference
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

RATE_HZ, WHITE_DPS = 104.0, 0.044


def one_run(seconds: float, drift: tuple[float, float], seed: int) -> Session:
    """A sensor at rest with white noise and a drift (sd in deg/s, correlation time in s)."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    gyro = rng.normal(0, WHITE_DPS, (t_s.size, 3)) + ou_noise(t_s.size, 1 / RATE_HZ, *drift, 3, rng)
    return make_session(make_run(t_s, gyro, table_rate_dps=0.0, rate_hz=RATE_HZ))


def pairs(cycles: int, seed: int, *, bias_sd_dps: float = 0.0, scale_sd: float = 0.0, transient_dps: float = 0.0) -> Session:
    """Up and down runs of 20 s at 78 deg/s in each power cycle, with an offset and a scale of its own."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(20 * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(cycles):
        offset, scale = rng.normal(0, bias_sd_dps, 3), rng.normal(0.004, scale_sd)
        for face, w in (("up", 78.0), ("down", -78.0)):
            gyro = rng.normal(0, WHITE_DPS, (t_s.size, 3)) + offset
            gyro[:, 2] += (1 + scale) * w + transient_dps * np.exp(-t_s / 3)
            runs.append(make_run(t_s, gyro, face=face, scenario=f"s{cycle}", rate_hz=RATE_HZ))
    return make_session(*runs)


def differences(found: Comparison) -> list[float]:
    """(rms^2 - floor^2) over its standard error, of each axis, of all and within power cycles."""
    pairs = [(found.squares[a], found.floors[a]) for a in found.per_axis]
    return [(s.all - f.all) / f.error for s, f in pairs] + [(s.within - f.within) / f.error_within for s, f in pairs]


@pytest.mark.parametrize(
    "session",
    [
        one_run(300, (0.01, 2000.0), 1), one_run(300, (0.005, 30.0), 2), pairs(4, 3, bias_sd_dps=0.02),
        pairs(9, 4, scale_sd=5e-4),
    ],
    ids=["one run, drift of 2000 s", "one run, drift of 30 s", "turn-on bias", "turn-on scale"],
)
def test_noise_alone_leaves_the_floor(session: Session) -> None:
    found = measure(session)
    for level in found.per_axis.values():
        assert level.rms_dps == pytest.approx(level.floor_dps, rel=0.01)
    assert max(map(abs, differences(found))) < 3.5


def test_drift_counts_with_what_the_rest_of_the_run_cannot_predict() -> None:
    """Within five minutes a drift of 2000 s moves little, so its marginal spread of 50 mdps must not be in the floor."""
    found = measure(one_run(300, (0.05, 2000.0), 5))
    assert found.held_out == "time"
    for level in found.per_axis.values():
        assert level.floor_dps < np.hypot(WHITE_DPS, 0.03)


def test_a_scale_that_differs_from_power_cycle_to_power_cycle_is_in_the_floor() -> None:
    found = measure(pairs(9, 6, scale_sd=5e-4))
    spread = 5e-4 * 78
    assert found.per_axis["z"].floor_dps == pytest.approx(np.hypot(WHITE_DPS, spread), rel=0.15)


def test_a_planted_transient_leaves_its_own_power() -> None:
    """A transient that all runs share, 0.05·exp(-t / 3 s); its mean is in the bias."""
    level = measure(pairs(6, 7, bias_sd_dps=0.01, transient_dps=0.05)).per_axis["z"]
    t_s = np.arange(0, 20, 1 / RATE_HZ)
    planted = np.std(0.05 * np.exp(-t_s / 3))
    assert level.excess_within_dps == pytest.approx(planted, rel=0.05)
    assert level.excess_within_dps > 2 * level.excess_within_se_dps
    assert level.excess_dps > level.excess_within_dps  # the transient also pulls the bias that it is predicted with


def test_within_figures_have_no_offset_and_scale_of_a_power_cycle() -> None:
    quiet, moving = (measure(pairs(5, 8, bias_sd_dps=b, scale_sd=s)) for b, s in ((0.0, 0.0), (0.1, 1e-3)))
    for axis in "xyz":
        assert moving.squares[axis].within == pytest.approx(quiet.squares[axis].within, rel=1e-2)
        assert moving.squares[axis].all > 2 * quiet.squares[axis].all


def test_the_error_of_the_excess_is_that_of_the_mean_square() -> None:
    excess, se = excess_of(1.0, 0.001, 0.0)
    assert (excess, se) == pytest.approx((1.0, 0.0005), rel=1e-3)  # d sqrt(x) = dx / (2 sqrt(x))
    assert excess_of(-1.0, 0.02, 0.0) == pytest.approx((0.0, np.sqrt(3 * 0.02) / 3))


def test_explained_counts_squares_and_needs_a_certain_excess() -> None:
    floor = Floor(1.0, 1.0, 0.01, 0.01, 1.0)

    def level(excess_all: float, excess_within: float) -> Level:
        return Level.of(MeanSquares(1.0 + excess_all**2, 1.0 + excess_within**2, 10**6), floor)

    assert explained(level(2.0, 1.0), level(1.0, 0.1), cycles=8) == pytest.approx(0.75)
    assert explained(level(2.0, 1.0), level(1.0, 0.1), cycles=7) == pytest.approx(0.99)
    assert explained(level(0.05, 0.05), level(0.0, 0.0), cycles=8) is None
    assert explained(level(0.0, 1.0), level(0.0, 0.5), cycles=8) == pytest.approx(0.75)


def test_an_excess_that_no_shape_explains_is_a_finding() -> None:
    found = measure(pairs(6, 9))
    floor, squares = found.floors["y"], found.squares["y"]
    assert of_excess(squares, floor, found.nearest["y"]).chance > 1e-3
    more = replace(squares, within=floor.within + 8 * floor.error_within)
    finding = of_excess(more, floor, found.nearest["y"])
    assert (finding.axis, finding.against) == ("y", found.nearest["y"].against)
    assert finding.strength == pytest.approx(8)
    assert finding.chance < 1e-12


def test_before_and_after_share_the_richer_model_s_floor() -> None:
    session = pairs(4, 10, bias_sd_dps=0.01)
    before, after = measure(session, "paper"), measure(session)
    moved = with_floor_of(before, after)
    assert moved.pooled.floor_dps == after.pooled.floor_dps
    assert moved.pooled.rms_dps == before.pooled.rms_dps


@pytest.mark.wide
@pytest.mark.parametrize(
    "effect", ["bias_temperature:k1_dps_per_c=0.0006", pytest.param("scale_asymmetry:k=0.00006", marks=pytest.mark.wide)]
)
def test_compare_and_diagnose_agree_on_weak_effects(effect: str) -> None:
    """So weak that the effect's own test may find it where the general tests do not."""
    session = simulate(None, "full", [effect], 0, scenarios=1, seconds=10.0)[0]
    assert (compare(session, ON_Z).verdict == "adequate") == (diagnose(session, ON_Z).verdict == "adequate")


def test_samples_without_a_reference_neither_lower_the_rms_nor_have_a_residual() -> None:
    rng = np.random.default_rng(5)
    t_s = np.arange(2000) / RATE_HZ
    rates = 60 * np.sin(2 * np.pi * np.outer(t_s, [0.3, 0.5, 0.8])) + 20 * np.sin(2 * np.pi * np.outer(t_s, [1.1, 0.9, 0.2]))
    recorded = np.where(((t_s > 3) & (t_s < 13))[:, None], rates, np.nan)
    columns = {f"ref_{axis}_dps": recorded[:, i] for i, axis in enumerate("xyz")}
    own = Reference(clock="own")
    gyro = [rng.normal(0, WHITE_DPS, (t_s.size, 3)) + rates for _ in range(3)]
    runs = [
        replace(make_run(t_s, y, table_rate_dps=None, **columns), scenario=f"s{k}", reference=own) for k, y in enumerate(gyro)
    ]  # fmt: skip
    found = measure(make_session(*runs, reference=own))
    z = found.per_axis["z"]
    assert z.rms_dps == pytest.approx(WHITE_DPS, rel=0.05)
    assert z.rms_dps == pytest.approx(z.floor_dps, rel=0.02)
    table = residual_table(found).filter(axis="z")
    assert table["t_s"].min() > 3
    assert table["t_s"].max() < 13
    assert (table["measured_dps"] != table["modelled_dps"]).all()


@pytest.mark.parametrize("errors", [0.5, 2.0, 2.9, 3.1, 10.0, 1000.0])
def test_an_excess_is_beyond_three_of_its_errors_exactly_if_its_mean_square_is(errors: float) -> None:
    excess, se = excess_of(errors * 0.02, 0.02, 0.0)
    assert (excess > 3 * se) == (errors > 3)


def test_rounding_moves_no_excess_beyond_three_of_its_errors() -> None:
    """Of an excess between 1.5 and 3 errors of its mean square, three errors are the excess itself, or were an ulp less."""
    drawn = np.random.default_rng(9).uniform([1.0, 1e-6], [3.0, 1.0], (2000, 2))
    found = [excess_of(errors * size, size, 0.0) for errors, size in drawn]
    assert all(excess <= 3 * se for excess, se in found)


def test_a_prediction_that_is_no_number_leaves_no_level() -> None:
    """The other data of a fold may not determine the model: rms "nan" had an excess of 0.00 +- 0.31 dps beside it."""
    (run,) = one_run(4.0, (0.0, 1.0), 1).runs
    held = [Prediction(run, 2, slice(0, 200), np.zeros(200)), Prediction(run, 2, slice(200, 400), np.full(200, np.nan))]
    assert MeanSquares.of(held[:1]).samples == 200
    squares = MeanSquares.of(held)
    assert squares == MeanSquares(0.0, 0.0, 0)
    assert Level.of(squares, Floor(0.01, 0.01, 0.001, 0.001, 0.01)).excess_dps is None
