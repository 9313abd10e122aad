"""The simulated device's answers: baseline, network, model, rest and turn, each against its own reference."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from .conftest import HERE, LSB_DPS, Build, make_pair, make_run, run, sentences, ticks, without_gyrocal, write_rows
from .test_baseline import closed_form
from .test_estimator import Blocks, Case, dense

Sim = Callable[..., str]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("order", [1, -1])
def test_baseline_answers_are_the_closed_form(sim: Sim, tmp_path: Path, axis: int, order: int) -> None:
    rng = np.random.default_rng([axis, 5])
    runs = []
    for face in (order, -order):
        t = ticks(900) + rng.integers(0, 700, 900)
        keep = rng.random(900) > 0.03
        keep[0] = True
        w = -78.3 * face
        runs.append(make_run(rng, np.full(keep.sum(), 0.995 * w + 0.3), t[keep], face, axis, table_dps=-78.3))
    w = tuple(-78.3 * r["face"] for r in runs)
    said = [s for s in sentences(sim(write_rows(tmp_path / "a.rows", runs)), "CAL") if s["method"] == "baseline"]
    assert [s["seconds"] for s in said] == ["2", "4", "6"]
    for s in said:
        halves = [(r["t_us"], r["counts"][:, 1 + axis].astype(np.int64)) for r in runs]
        want = closed_form(*halves, w, float(s["seconds"]), 145.0)
        got = [s.number(name) for name in ("scale", "bias_dps")]  # the errors: tests/parity/test_trust.py
        np.testing.assert_allclose(got, [want[0], want[2]], rtol=6e-9, atol=1e-12)
        assert s["axis"] == "xyz"[axis]
        n = [int((r["t_us"] - r["t_us"][0] < float(s["seconds"]) * 1e6).sum()) for r in runs]
        assert int(s["last"]) - int(s["first"]) + 1 == n[1]
        temp = np.concatenate([r["counts"][:k, 0] for r, k in zip(runs, n, strict=True)]).mean() / 256 + 25
        assert s.number("temp_c") == pytest.approx(temp, rel=1e-8)


def test_the_papers_answers_are_means_over_consecutive_windows(sim: Sim, build: Build, tmp_path: Path) -> None:
    runs = make_pair(np.random.default_rng(2))
    paper = without_gyrocal(tmp_path / "include")
    counts = [r["counts"][:, 3] for r in runs]
    text = f"{LSB_DPS} 78 -78 870\n" + "\n".join(str(c) for half in counts for c in half[:870])
    windows = np.array([line.split() for line in run(build(HERE / "cnn.c"), text).splitlines()], float)
    for answers in (runs, runs[::-1]):  # the order of the faces does not matter
        text = sim(write_rows(tmp_path / "a.rows", answers), include=paper)
        said = [s for s in sentences(text, "CAL") if s["method"] == "cnn"]
        assert [s["seconds"] for s in said] == ["2", "4", "6"]
        for k, s in enumerate(said):
            got = [s.number("scale"), s.number("bias_dps")]
            np.testing.assert_allclose(got, windows[: k + 1].mean(axis=0), rtol=3e-8)
            assert s["scale_se"] == s["bias_se_dps"] == ""


def test_readings_unlike_the_training_data_get_no_answer_by_network(sim: Sim, tmp_path: Path) -> None:
    """Two dps off for a quarter of a second, or one spike: told once; no answer of a stage that holds it."""
    runs = make_pair(np.random.default_rng(17))
    assert "net_range" not in sim(write_rows(tmp_path / "a.rows", runs))
    clean = runs[1]["counts"].copy()
    for first, until, answered in ((100, 140, []), (100, 101, []), (400, 440, ["2"])):
        runs[1]["counts"] = clean.copy()
        runs[1]["counts"][first:until, 3] += round(2.0 / LSB_DPS)
        text = sim(write_rows(tmp_path / "b.rows", runs))
        assert [s["name"] for s in sentences(text, "ERR")].count("net_range") == 1
        assert [s["seconds"] for s in sentences(text, "CAL") if s["method"] == "cnn"] == answered
        assert sum(s["method"] == "baseline" for s in sentences(text, "CAL")) == 3


def test_a_sensor_far_from_the_campaigns_is_answered_as_well(sim: Sim, tmp_path: Path) -> None:
    """True scale -1 %, bias 0.1 dps, and the other way about -3 % and 10 dps: within five of its standard errors, in range."""
    for scale, bias_dps in ((-0.01, 0.1), (0.03, -10.0), (-0.03, 10.0)):
        rng = np.random.default_rng(31)
        runs = [make_run(rng, np.full(900, (1 + scale) * f * 78.0 + bias_dps), ticks(900), f) for f in (1, -1)]
        text = sim(write_rows(tmp_path / "a.rows", runs))
        said = [s for s in sentences(text, "CAL") if s["method"] == "cnn"]
        assert [s["seconds"] for s in said] == ["2", "4", "6"]
        for s in said:
            assert abs(s.number("scale") - scale) < 5 * s.number("scale_se")
            assert abs(s.number("bias_dps") - bias_dps) < 5 * s.number("bias_se_dps")
        assert abs(said[-1].number("scale") - scale) < 0.0002


@pytest.mark.parametrize("run_with_gap", [0, 1])
@pytest.mark.parametrize(
    ("gap_at", "answered"), [(0, "246"), (1, ""), (289, ""), (290, "2"), (579, "2"), (580, "24"), (870, "246"), (880, "246")]
)
def test_a_gap_in_a_window_gives_no_answer_by_network(
    sim: Sim, tmp_path: Path, run_with_gap: int, gap_at: int, answered: str
) -> None:
    """The sample before `gap_at` is missing: windows hold consecutive samples from the first one on."""
    runs = make_pair(np.random.default_rng(21))
    spoilt = runs[run_with_gap]
    keep = np.arange(900) != gap_at
    keep[0] = gap_at != 0
    spoilt["t_us"], spoilt["counts"] = spoilt["t_us"][keep], spoilt["counts"][keep]
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert "".join(s["seconds"] for s in sentences(text, "CAL") if s["method"] == "cnn") == answered
    assert sum(s["method"] == "baseline" for s in sentences(text, "CAL")) == 3
    assert [s["name"] for s in sentences(text, "ERR")] == ["net_gap"] * (answered != "246")
    ends = [s["missed"] for s in sentences(text, "RUN") if s["state"] == "end"]
    assert ends == ["1" if i == run_with_gap and gap_at > 0 else "0" for i in (0, 1)]


def test_late_samples_are_no_gap(sim: Sim, tmp_path: Path) -> None:
    """Up to half a period late, as of a board that had something else to do."""
    rng = np.random.default_rng(22)
    runs = make_pair(rng)
    for r in runs:
        r["t_us"] = r["t_us"] + rng.integers(0, int(0.49e6 / 145), 900)
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert [s["seconds"] for s in sentences(text, "CAL") if s["method"] == "cnn"] == ["2", "4", "6"]
    assert not sentences(text, "ERR")


def test_a_network_for_other_settings_is_refused_once_a_pair(sim: Sim, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for rate_hz, w, name in ((104.0, 78.0, "net_sample_rate"), (145.0, 60.0, "net_table_rate")):
        n = int(6.5 * rate_hz)
        runs = [make_run(rng, np.full(n, f * w), ticks(n, rate_hz), f, table_dps=w) for f in (1, -1)]
        text = sim(write_rows(tmp_path / "a.rows", runs, rate_hz))
        assert [s["name"] for s in sentences(text, "ERR")] == [name]
        assert {s["method"] for s in sentences(text, "CAL")} == {"baseline"}


CALIBRATION = """
#include "gc_calibration.h"
GC_EFFECT(table_ripple);
GC_EFFECT(spin_up);
static const gc_effect_column_t columns[] = {
    {gc_effect_table_ripple, {1.0f, 0.0f}}, {gc_effect_table_ripple, {1.0f, 1.0f}}, {gc_effect_spin_up, {1.5f}}};
static const double prior_mean[] = {0, 0, 0.002, -0.04, 0.0035};
static const double prior_root[] = {
    800, 0, 0, 0, 0,  0, 800, 0, 0, 0,  0, 0, 300, 0, 0,  0, 0, 0, 20, 5,  0, 0, 0, 0, 0};
static const gc_calibration_t gc_calibration = {
    .name = "ripple", .axis = '%s', .rate_hz = 145.0f, .table_dps = 78.0f, .n_run_columns = 2, .n_shared_columns = 1,
    .columns = columns, .white_sd_dps = 0.0448f, .ou_sd_dps = 0.002f, .ou_tau_s = 30.0f,
    .prior_mean = prior_mean, .prior_sqrt_information = prior_root};
"""


def _moved(include: Path) -> Path:
    """The same headers under a name of their own, so that they are compiled anew."""
    other = include.with_name("other")
    include.rename(other)
    return other


def test_model_answers_are_generalised_least_squares(sim: Sim, tmp_path: Path) -> None:
    include = tmp_path / "include"
    include.mkdir()
    (include / "calibration.h").write_text(CALIBRATION % "z")
    rng = np.random.default_rng(4)
    runs, truth = [], (0.004, -0.05)
    for face in (1, -1):
        w, t = 78.0 * face, ticks(900)
        turn = 78.0 * t * 1e-6 / 360
        ripple = w * (0.0011 * np.cos(2 * np.pi * turn) - 0.0016 * np.sin(2 * np.pi * turn))
        rate = (1 + truth[0]) * w + truth[1] + ripple - w * 0.0018 * np.exp(-t * 1e-6 / 1.5)
        runs.append(make_run(rng, rate, t, face))
    text = sim(write_rows(tmp_path / "a.rows", runs), include=include)
    said = [s for s in sentences(text, "CAL") if s["method"] == "model"]
    assert [s["seconds"] for s in said] == ["2", "4", "6"]
    root = np.array([[800, 0, 0, 0, 0], [0, 800, 0, 0, 0], [0, 0, 300, 0, 0], [0, 0, 0, 20, 5], [0] * 5], float)
    mean = np.array([0, 0, 0.002, -0.04, 0.0035])
    for s in said:
        blocks = []
        for r in runs:
            w = 78.0 * r["face"]
            keep = r["t_us"] < float(s["seconds"]) * 1e6
            t, y = r["t_us"][keep], r["counts"][keep, 3] * LSB_DPS - w
            turn = 2 * np.pi * 78.0 * t * 1e-6 / 360
            x = np.column_stack([w * np.cos(turn), w * np.sin(turn), -w * np.exp(-t * 1e-6 / 1.5)])
            number = t // 250_000
            each = np.unique(number)
            n = np.array([(number == k).sum() for k in each])
            blocks.append(
                Blocks(
                    each,
                    n,
                    np.array([y[number == k].mean() for k in each]),
                    np.full(len(each), w),
                    np.array([x[number == k].mean(axis=0) for k in each]),
                )
            )
        want = dense(Case(2, 1, float(np.float32(0.002)), 30.0, mean, root, blocks))
        got = np.array([s.number(name) for name in ("scale", "scale_se", "bias_dps", "bias_se_dps", "misfit")])
        assert abs(got[0] - want[0]) < 1e-4 * want[1]
        assert abs(got[2] - want[2]) < 1e-4 * want[3]
        np.testing.assert_allclose(got[[1, 3, 4]], want[[1, 3, 4]], rtol=1e-5)
        assert abs(got[0] - truth[0]) < 4 * got[1]
        assert abs(got[2] - truth[1]) < 4 * got[3]
    baseline = [s for s in sentences(text, "CAL") if s["method"] == "baseline"]
    assert baseline[2].number("misfit") > 2 > 1.4 > said[2].number("misfit")

    (include / "calibration.h").write_text(CALIBRATION % "x")
    errors = sentences(sim(write_rows(tmp_path / "a.rows", runs), include=_moved(include)), "ERR")
    assert [s["name"] for s in errors] == ["calibration_axis", "misfit"], "the baseline judges, and the ripple does not fit"


def test_rest_and_turn(sim: Sim, tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    t = ticks(700)
    bias = 0.6
    shape = 200 * np.sin(np.pi * np.arange(700) / 699) ** 2
    true_deg = float(np.trapezoid(shape, t * 1e-6))
    unknown = {"table_dps": np.nan}
    turns = [make_run(rng, 1.03 * f * shape + bias, t, f, turn_deg=true_deg, **unknown) for f in (1, -1)]
    rest = make_run(rng, np.full(700, bias), t, table_dps=0.0)
    text = sim(write_rows(tmp_path / "a.rows", [turns[0], rest, *turns]))
    assert [s["name"] for s in sentences(text, "ERR")] == ["no_rest"]
    first, up, down = sentences(text, "CAL")
    assert (first["method"], first["scale"]) == ("rest", "")
    y = rest["counts"][:, 3] * LSB_DPS
    assert first.number("bias_dps") == pytest.approx(y.mean(), rel=1e-8)
    assert first.number("bias_se_dps") == pytest.approx(np.sqrt((np.diff(y) ** 2).sum() / (2 * 699) / 700), rel=1e-8)
    assert first.number("seconds") == pytest.approx(699 / 145, rel=1e-6)
    for s, r in ((up, turns[0]), (down, turns[1])):
        integral = np.trapezoid(r["counts"][:, 3] * LSB_DPS, t * 1e-6)
        want = (integral - y.mean() * t[-1] * 1e-6) / (r["face"] * float(str(np.float32(true_deg)))) - 1
        assert s["method"] == "turn"
        assert s.number("scale") == pytest.approx(want, abs=1e-8)
        assert abs(s.number("scale") - 0.03) < 4 * s.number("scale_se")
    ends = [s for s in sentences(text, "RUN") if s["state"] == "end"]
    assert ends[0]["table_dps"] == ""
    assert ends[1]["table_dps"] == "0"
    for name, k in (("mean_x_dps", 1), ("mean_y_dps", 2), ("mean_z_dps", 3)):
        assert ends[1].number(name) == pytest.approx((rest["counts"][:, k] * LSB_DPS).mean(), rel=1e-8, abs=1e-12)


def test_a_run_of_unknown_rate_gives_no_answer(sim: Sim, tmp_path: Path) -> None:
    t = ticks(400)
    runs = [make_run(np.random.default_rng(8), np.full(400, 50.0), t, table_dps=np.nan)]
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert not sentences(text, "CAL")
    assert not sentences(text, "ERR")


def test_wrong_direction_gives_an_error_and_no_answer(sim: Sim, tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    runs = make_pair(rng)
    runs[1]["counts"][:, 3] *= -1
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert [s["name"] for s in sentences(text, "ERR")] == ["wrong_direction"]
    assert not sentences(text, "CAL")


def test_over_a_population_the_baseline_is_trusted_where_it_is_right(sim: Sim, tmp_path: Path) -> None:
    """Sound sensors of any scale within 3 % and bias within 10 dps: trusted, and off by what their standard errors say.

    These allow for drift, of which each face's 0.7 mdps, nearly constant over 6 s, are drawn here.
    """
    rng = np.random.default_rng(40)
    n, truth, runs = 900, [], []
    for cycle in range(40):
        scale, bias = rng.uniform(-0.03, 0.03), rng.uniform(-10.0, 10.0)
        truth.append((scale, bias))
        for face in (1, -1):
            drift_dps = rng.normal(0, 0.0007)
            level = np.full(n, (1 + scale) * face * 78.0 + bias + drift_dps)
            runs.append(make_run(rng, level, ticks(n), face, power_cycle=cycle))
    said = [s for s in sentences(sim(write_rows(tmp_path / "a.rows", runs)), "CAL") if s["method"] == "baseline"]
    at_6_s = [s for s in said if s["seconds"] == "6"]
    assert len(at_6_s) == len(truth)
    assert sum(s["trusted"] == "1" for s in at_6_s) >= 36
    for k, name in enumerate(("scale", "bias")):
        unit = "" if name == "scale" else "_dps"
        off = [(s.number(name + unit) - t[k]) / s.number(f"{name}_se{unit}") for s, t in zip(at_6_s, truth, strict=True)]
        assert np.abs(off).max() < 5
        assert 0.75 < np.std(off) < 1.3
