"""The smallest change of labels that makes a session consistent is told; slopes are judged by their own relative errors."""

from collections.abc import Sequence

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.plausibility import check
from gyrocal.recording.session import Run, Session
from make_runs import make_run, make_session

DEG = 180 / np.pi


def turn(
    rate_dps: float,
    face: str = "up",
    *,
    scenario: str = "s0",
    stated: float | None = None,
    labelled: str = "",
    scale: float = 1.005,
    bias_dps: float = 1.2,
    noise_dps: float = 0.05,
) -> Run:
    """Six seconds at a constant rate; ``stated`` and ``labelled`` are what session.toml says instead."""
    rng = np.random.default_rng([int(abs(rate_dps) * 8), len(face), *scenario.encode()])
    t_s = np.arange(600) / 100.0
    sign = 1.0 if face == "up" else -1.0
    gyro = rng.normal([0.2, -0.1, bias_dps + scale * sign * rate_dps], noise_dps, (600, 3))
    return make_run(t_s, gyro, table_rate_dps=rate_dps if stated is None else stated, face=labelled or face, scenario=scenario)


def pairs(rate_dps: float, offsets: Sequence[float], unit: float = 1.0) -> Session:
    return make_session(
        *(
            turn(rate_dps, face, scenario=f"s{k}", bias_dps=offset, stated=rate_dps / unit)
            for k, offset in enumerate(offsets)
            for face in ("up", "down")
        )
    )


@pytest.mark.parametrize("rate_dps", [20.0, 30.0, 50.0, 78.0, 150.0])
@pytest.mark.parametrize("offsets", [[0.5], [0.5, -0.3, 0.9], [0.1 * k for k in range(8)]], ids=["1", "3", "8"])
def test_a_table_in_rad_s(rate_dps: float, offsets: list[float]) -> None:
    assert check(pairs(rate_dps, offsets)) == []
    assert [(w.code, w.file) for w in check(pairs(rate_dps, offsets, DEG))] == [("unit_rad_s", None)]


def test_a_table_in_rad_s_is_never_adequate() -> None:
    runs = [turn(r, f, scenario=f"{f}{r}", stated=r / DEG) for f in ("up", "down") for r in (0.0, 30.0, -30.0, 78.0, -78.0)]
    compared = compare(make_session(*runs))
    assert ([w.code for w in compared.warnings], compared.verdict) == (["unit_rad_s"], "implausible")


@pytest.mark.parametrize("noise_dps", [0.0, 0.3])
@pytest.mark.parametrize("unit", [1.0, DEG])
def test_a_reference_in_rad_s(noise_dps: float, unit: float) -> None:
    """A swing whose reference moves by less than 1 in rad/s; the noise of one that stands is no movement."""
    rng = np.random.default_rng(1)
    t_s = np.arange(2000) / 100.0
    for rate in (40 * np.sin(3 * t_s), np.full(2000, 60.0)):
        gyro = rng.normal(0, 0.05, (2000, 3)) + np.outer(rate * 1.004 + 0.4, [0, 0, 1])
        reference = (rate + rng.normal(0, noise_dps, 2000)) / unit
        told = check(make_session(make_run(t_s, gyro, rate_ref_dps=reference)))
        assert [w.code for w in told] == ([] if unit == 1 else ["unit_rad_s"])


def test_cycles_that_differ_by_their_offsets() -> None:
    assert [(w.code, w.axis) for w in check(pairs(60.0, [18.0, -16.0, 17.0]))] == [("turn_on_implausible", "z")]


@pytest.mark.parametrize("faces", [("up", "down"), ("up",)], ids=["pairs", "single runs"])
@pytest.mark.parametrize(("spread_dps", "axes"), [((9.0, 0.0, 0.0), "x"), ((9.0, 0.1, 8.0), "xz"), ((3.0, 3.0, 3.0), "")])
def test_cycles_that_differ_by_their_offsets_on_any_axis(
    faces: tuple[str, ...], spread_dps: tuple[float, ...], axes: str
) -> None:
    """The rate that a tilted axis reads, here a tenth, is no scatter of its bias."""
    runs = []
    for k, draw in enumerate(np.array([-1.2, 0.3, 1.1, -0.7, 0.9, -0.4]) / 0.92):
        for face in faces:
            run = turn((40.0, 78.0, -78.0)[k % 3], face, scenario=f"s{k}")
            gyro = run.gyro_dps + np.outer(run.rate_dps, [0.1, -0.1, 0.0]) + draw * np.array(spread_dps)
            runs.append(make_run(run.t_s, gyro, table_rate_dps=run.table_rate_dps, face=face, scenario=run.scenario))
    assert [(w.code, w.axis) for w in check(make_session(*runs)) if w.blocking] == [("turn_on_implausible", a) for a in axes]


@pytest.mark.parametrize("factor", [0.95, 1.05, 1.2])
def test_one_rate_in_cycles_of_pairs(factor: float) -> None:
    session = pairs(78.0, [0.5, 0.45, 0.52])
    wrong = turn(78.0, "down", scenario="s1", stated=78.0 * factor)
    told = check(make_session(*(wrong if i == 3 else r for i, r in enumerate(session.runs))))
    assert [(w.code, w.file) for w in told] == [("rate_wrong", "003_down.csv")]


def staircase(top_dps: float, k: int, scale: float = 1.005, dead_dps: float = 0.0) -> Run:
    """A minute on levels up to ``top_dps`` in an order of its own, by a reference; rates within ``dead_dps`` read zero."""
    rng = np.random.default_rng(k)
    levels = rng.permutation(np.array([-1, -0.5, -0.2, -0.1, 0, 0.1, 0.2, 0.5, 1])) * top_dps
    rate = np.interp(np.arange(6000), np.arange(9)[:, None].repeat(2, 1).ravel() * 660 + np.tile([0, 560], 9), levels.repeat(2))
    read = scale * np.where(np.abs(rate) < dead_dps, 0.0, rate) + 0.7
    gyro = rng.normal(0, 0.05, (6000, 3)) + np.outer(read, [0, 0, 1])
    return make_run(np.arange(6000) / 100.0, gyro, rate_ref_dps=rate + rng.normal(0, 0.01, 6000), scenario=f"s{k // 2}")


def test_a_dead_band_is_no_scatter_of_the_scale() -> None:
    """Runs of small rates show no scale, whatever part of them a dead band takes."""
    assert not any(w.blocking for w in check(make_session(*(staircase(4.0, k, dead_dps=1.0) for k in range(8)))))


def test_scales_of_swings_that_scatter_are_told() -> None:
    scales = [0.9, 1.0, 1.1, 1.0]
    told = check(make_session(*(staircase(200.0, k, scales[k // 2]) for k in range(8))))
    assert "turn_on_implausible" in {w.code for w in told} or "rate_wrong" in {w.code for w in told}
    assert not any(w.blocking for w in check(make_session(*(staircase(200.0, k) for k in range(8)))))


@pytest.mark.parametrize("factor", [0.9, 0.96, 1.04, 1.3])
@pytest.mark.parametrize("offsets", [[0.5, 0.45, 0.52, 0.4], [6.5, 6.4, 6.55, 6.45]])
def test_the_rate_that_is_told_is_the_true_one(factor: float, offsets: list[float]) -> None:
    """The wrong run moves the line of all runs; the rate comes from the others, and its error is that of their scatter."""
    session = pairs(78.0, offsets)
    wrong = turn(78.0, "up", scenario="s1", stated=78.0 * factor, bias_dps=offsets[1])
    (told,) = check(make_session(*(wrong if i == 2 else r for i, r in enumerate(session.runs))))
    assert (told.code, told.file) == ("rate_wrong", "002_up.csv")
    likely, se = (float(word) for word in told.text.split("seems to be ")[1].split(" dps")[0].split(" +- "))
    assert abs(likely - 78.0) < 3 * se
    assert se < 0.2


def test_a_table_that_stood_still_is_told_as_that() -> None:
    runs = [*pairs(78.0, [0.5, 0.45, 0.52]).runs]
    runs[2] = turn(0.0, scenario="s1", stated=78.0, bias_dps=0.45)
    (told,) = check(make_session(*runs))
    assert (told.code, told.file) == ("rate_wrong", "002_up.csv")
    assert "the table seems to have stood still" in told.text


def test_one_run_in_rad_s_is_told_with_its_own_number() -> None:
    """The bias of the other runs is in deg/s, so it is not taken from this run's mean."""
    runs = [turn(r, scenario=f"s{k}", bias_dps=7.0) for k, r in enumerate((0.0, 30.0, -30.0, 78.0, -78.0, 150.0, -150.0))]
    rad = make_run(runs[3].t_s, runs[3].gyro_dps / DEG, table_rate_dps=78.0, scenario="s3")
    told = [w for w in check(make_session(*runs[:3], rad, *runs[4:])) if w.axis == "z"]
    assert [(w.code, w.file) for w in told] == [("unit_rad_s", "003_up.csv")]
    assert float(told[0].text.split("reads ")[1].split()[0]) == pytest.approx(1 / DEG, rel=0.12)


def test_what_is_57_times_too_large_is_told_with_both_explanations() -> None:
    (told,) = check(pairs(60.0, [0.5, 0.4], DEG))
    assert "the reference is in rad/s, or readings in deg/s were converted once more" in told.text
    assert "Give table_rate_dps in degrees a second, or leave the unit of gz_dps out" in told.text


def test_one_rate_among_slow_runs() -> None:
    """Slow runs, each a power cycle, scatter by their offsets; the fast ones are as sure as they are."""
    offsets = [0.87, 1.14, 2.0, 2.06, 2.5, 2.6]
    rates = [29.7, -29.6, 155.7, -30.2, 29.9, -150.0]
    runs = [turn(r, scenario=f"s{k}", bias_dps=b, scale=1.0) for k, (r, b) in enumerate(zip(rates, offsets, strict=True))]
    assert check(make_session(*runs)) == []
    runs[2] = turn(155.7, scenario="s2", bias_dps=offsets[2], stated=136.4)
    assert [(w.code, w.file) for w in check(make_session(*runs))] == [("rate_wrong", "002_up.csv")]


@pytest.mark.parametrize("rate_dps", [30.0, 78.0, 200.0])
@pytest.mark.parametrize("count", [3, 4])
def test_one_face_wins_over_a_scale_and_a_bias(rate_dps: float, count: int) -> None:
    runs = [turn(rate_dps, scenario=f"s{k}", labelled="down" if k == count - 1 else "up") for k in range(count)]
    assert [(w.code, w.file) for w in check(make_session(*runs))] == [("face_wrong", f"{count - 1:03d}_down.csv")]


def test_scales_that_scatter_from_cycle_to_cycle() -> None:
    rates = [-30.0, 29.0, 76.0, -79.0, 0.0, 30.5, -30.3, -77.0, 78.6, 0.0]
    scales = [0.70, 0.95, 1.04, 1.01, 1.0, 0.93, 0.96, 1.0, 0.98, 1.0]
    runs = [turn(r, scenario=f"s{k}", scale=s) for k, (r, s) in enumerate(zip(rates, scales, strict=True))]
    assert [w.code for w in check(make_session(*runs))] == ["turn_on_implausible"]
    offsets = [3.0, -1.0, 0.5, 2.0, 1.2, -2.5, 0.0, 1.0, 2.0, 1.5]
    runs = [turn(r, scenario=f"s{k}", bias_dps=b) for k, (r, b) in enumerate(zip(rates, offsets, strict=True))]
    assert "turn_on_implausible" not in {w.code for w in check(make_session(*runs))}


@pytest.mark.parametrize(("scatter", "codes"), [(0.086, ["turn_on_implausible"]), (0.03, [])])
def test_cycles_of_one_run_at_one_rate_scatter(scatter: float, codes: list[str]) -> None:
    """No bias can be told at a single rate; 8.6 % of 78 dps are more than 5 dps and 5 % make together."""
    scales = 1.004 + scatter * np.array([-1.2, 0.3, 1.1, -0.7, 0.9, -0.4]) / 0.92
    runs = [turn(78.0, scenario=f"s{k}", scale=s) for k, s in enumerate(scales)]
    assert [w.code for w in check(make_session(*runs))] == codes


@pytest.mark.parametrize(("scale", "codes"), [(0.1, ["scale_implausible"]), (0.9, []), (1.005, [])])
def test_a_scale_that_no_bias_explains(scale: float, codes: list[str]) -> None:
    runs = [turn(150.0, scenario=f"s{k}", scale=scale) for k in range(3)]
    assert [w.code for w in check(make_session(*runs))] == codes


def test_a_bias_that_cancels_a_slow_rate_is_no_unit() -> None:
    """The readings of one run are near zero by chance, about pi/180 of the rate."""
    assert check(pairs(5.0, [4.937, 4.937, 4.937])) == []


def swing(frequency_hz: float, tau_s: float, scale: float = 1.0) -> Run:
    """Thirty seconds of a swing that the sensor reads behind a first-order low-pass; the reference is true."""
    t_s = np.arange(3000) / 100.0
    omega = 2 * np.pi * frequency_hz
    gain = scale * 60.0 / np.hypot(1.0, omega * tau_s)
    read_dps = gain * np.sin(omega * t_s - np.arctan(omega * tau_s))
    noise_dps = np.random.default_rng(int(10 * frequency_hz)).normal(0.0, 0.02, (3000, 3))
    reading = noise_dps + np.outer(read_dps, [0.0, 0.0, 1.0])
    return make_run(t_s, reading, rate_ref_dps=60.0 * np.sin(omega * t_s))


def test_a_low_pass_that_takes_from_fast_swings_is_no_wrong_rate() -> None:
    """The slopes differ by a tenth, as one time constant and one scale make them."""
    assert check(make_session(*(swing(f, 0.15) for f in (0.2, 0.35, 0.6)))) == []


def test_a_slow_swing_of_another_scale_is_a_wrong_rate() -> None:
    runs = [swing(0.2, 0.0), swing(0.35, 0.0, scale=1.1), swing(0.6, 0.0)]
    assert [w.code for w in check(make_session(*runs))] == ["rate_wrong"]
