"""The simulated device: what goes in as rows comes out as samples and answers."""

import fcntl
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal_firmware import INCLUDE, SIM

from .conftest import HERE, LSB_DPS, Build, make_run, run, sentences, ticks, write_rows
from .test_baseline import closed_form
from .test_estimator import Blocks, Case, dense

Sim = Callable[..., str]


def pair(rng: np.random.Generator, n: int = 900, w: float = 78.0, **more: object) -> list[dict]:
    """Face up then face down, scale 0.4 %, bias -0.05 dps."""
    return [make_run(rng, np.full(n, 1.004 * f * w - 0.05), ticks(n), f, table_dps=w, **more) for f in (1, -1)]


def check_served(text: str, runs: list[dict]) -> None:
    """Each row exactly once, at its own time, with its own counts."""
    said = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    assert len(said) == sum(len(r["t_us"]) for r in runs)
    at = 0
    for r in runs:
        n = len(r["t_us"])
        mine = said[at : at + n]
        at += n
        assert [int(s["0"]) for s in mine] == list(range(n))
        got = np.array([s.t_us for s in mine])
        np.testing.assert_array_equal(got - got[0], r["t_us"] - r["t_us"][0])
        counts = np.array([[int(s[str(k)]) for k in (7, 1, 2, 3, 4, 5, 6)] for s in mine])
        np.testing.assert_array_equal(counts, r["counts"])


@pytest.mark.parametrize("rate_hz", [145.0, 104.0, 416.0, 102.4, 12.5])
def test_each_row_is_served_once_at_its_time(sim: Sim, tmp_path: Path, rate_hz: float) -> None:
    rng = np.random.default_rng(1)
    runs = []
    for axis in range(3):
        period = int(1e6 / rate_hz)
        gaps = rng.choice([40, 300, period, period + 700, 400_000], 500, p=[0.1, 0.1, 0.4, 0.38, 0.02])
        t_us = 7_000_000 + np.cumsum(gaps)
        runs.append(make_run(rng, rng.uniform(-100, 100, 500), t_us, axis=axis, power_cycle=axis // 2, power_on_s=3.0))
    text = sim(write_rows(tmp_path / "a.rows", runs, rate_hz), "--stream", "raw")
    check_served(text, runs)
    first = [s for s in sentences(text, "RAW") if s["0"] == "0"]
    assert first[0].t_us == first[2].t_us == 3_000_000
    seqs = np.array([s.seq for s in sentences(text)])
    assert set(np.diff(seqs)) <= {1, -seqs[: len(seqs)].max()}


def test_ten_minutes_at_416_hz_lose_nothing(sim: Sim, tmp_path: Path) -> None:
    n = 416 * 600
    t = ticks(n, 416.0)
    counts = np.zeros((n, 7), np.int16)
    counts[:, 3] = 8000 + np.arange(n) % 1000
    text = sim(write_rows(tmp_path / "a.rows", [{"t_us": t, "counts": counts}], 416.0), "--stream", "raw")
    lines = [line.split(",") for line in text.splitlines() if line.startswith("$RAW")]
    np.testing.assert_array_equal(np.array([int(x[4]) for x in lines]), np.arange(n))
    np.testing.assert_array_equal(np.array([int(x[7]) for x in lines]), counts[:, 3])
    np.testing.assert_array_equal(np.diff([int(x[1]) for x in lines]), 1)


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


def without_gyrocal(folder: Path) -> Path:
    """A folder with a weights.h of network `paper` alone."""
    folder.mkdir()
    (folder / "weights.h").write_text((INCLUDE / "weights.h").read_text().replace("    .convnet = &gc_gyrocal,\n", ""))
    return folder


def test_the_papers_answers_are_means_over_consecutive_windows(sim: Sim, build: Build, tmp_path: Path) -> None:
    runs = pair(np.random.default_rng(2))
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
    runs = pair(np.random.default_rng(17))
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
    runs = pair(np.random.default_rng(21))
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
    runs = pair(rng)
    for r in runs:
        r["t_us"] = r["t_us"] + rng.integers(0, int(0.49e6 / 145), 900)
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert [s["seconds"] for s in sentences(text, "CAL") if s["method"] == "cnn"] == ["2", "4", "6"]
    assert not sentences(text, "ERR")


@pytest.mark.parametrize("rate_hz", [52.0, 104.0, 416.0])
def test_through_the_fifo_each_row_comes_once(sim: Sim, tmp_path: Path, rate_hz: float) -> None:
    rng = np.random.default_rng(23)
    n = int(6.5 * rate_hz)
    runs = [make_run(rng, np.full(n, 1.004 * f * 78.0 - 0.05), ticks(n, rate_hz), f) for f in (1, -1)]
    rows = write_rows(tmp_path / "a.rows", runs, rate_hz)
    text, single = (sim(rows, "--stream", "raw", *option) for option in (["--fifo", "12"], []))
    said = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    assert len(said) == 2 * n
    for r, mine in zip(runs, (said[:n], said[n:]), strict=True):
        assert [int(s["0"]) for s in mine] == list(range(n))
        np.testing.assert_array_equal([[int(s[str(k)]) for k in range(1, 7)] for s in mine], r["counts"][:, 1:])
        t_us = np.array([s.t_us for s in mine])
        assert np.ptp(t_us - r["t_us"]) <= 1.1e6 / rate_hz
    assert {s["missed"] for s in sentences(text, "RUN") if s["state"] == "end"} == {"0"}
    for a, b in zip(sentences(text, "CAL"), sentences(single, "CAL"), strict=True):
        assert (a["method"], a["seconds"]) == (b["method"], b["seconds"])
        assert a.number("scale") == pytest.approx(b.number("scale"), abs=a.number("scale_se"))
        assert a.number("bias_dps") == pytest.approx(b.number("bias_dps"), abs=a.number("bias_se_dps"))


def test_the_fifo_keeps_the_sensors_own_rates_only(sim: Sim, tmp_path: Path) -> None:
    text = sim(write_rows(tmp_path / "a.rows", pair(np.random.default_rng(24))), "--fifo", "12")
    assert [s["name"] for s in sentences(text, "ERR")] == ["fifo_rate"]
    assert sum(s["method"] == "baseline" for s in sentences(text, "CAL")) == 3


def test_a_busy_board_misses_samples_and_with_the_fifo_only_those_it_cannot_hold(sim: Sim, tmp_path: Path) -> None:
    rng = np.random.default_rng(25)
    n = int(6.5 * 104)
    rows = write_rows(tmp_path / "a.rows", [make_run(rng, np.full(n, 78.0), ticks(n, 104.0))], 104.0)
    for option, low, high in ((["--fifo", "12"], 80, 130), ([], 305, 320)):
        text = sim(rows, "--fault", "busy", *option)
        end = sentences(text, "RUN")[1]
        assert low < int(end["missed"]) < high
        assert int(end["n"]) + int(end["missed"]) == pytest.approx(n, abs=1)
        assert [s["name"] for s in sentences(text, "ERR")] == ["fifo_overrun"] * bool(option)


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


def _moved(include: Path) -> Path:
    """The same headers under a name of their own, so that they are compiled anew."""
    other = include.with_name("other")
    include.rename(other)
    return other


def test_a_power_cycle_starts_afresh_and_pairs_do_not_cross_it(sim: Sim, tmp_path: Path) -> None:
    runs = pair(np.random.default_rng(6))
    runs[1]["power_cycle"] = 1
    said = sentences(sim(write_rows(tmp_path / "a.rows", runs)))
    assert not [s for s in said if s.tag == "CAL"]
    hellos = [s for s in said if s.tag == "HEL"]  # at boot, and again with the recording's settings
    assert [s.seq == 0 for s in hellos] == [True, False, True, False]
    told = [s["state"] + " " + s["face"] for s in said if s.tag == "RUN"]
    assert told == ["start up", "end up", "start down", "end down"]


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
    runs = pair(rng)
    runs[1]["counts"][:, 3] *= -1
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert [s["name"] for s in sentences(text, "ERR")] == ["wrong_direction"]
    assert not sentences(text, "CAL")


def test_clipped_samples_are_counted(sim: Sim, tmp_path: Path) -> None:
    runs = [make_run(np.random.default_rng(10), np.full(300, 100.0), ticks(300), table_dps=np.nan)]
    runs[0]["counts"][50:60, 3] = 28571
    runs[0]["counts"][60:63, 3] = -32768
    text = sim(write_rows(tmp_path / "a.rows", runs))
    assert [s["name"] for s in sentences(text, "ERR")] == ["clipped"]
    assert sentences(text, "RUN")[1]["clipped"] == "13"


FAULTS = {
    "nack": "bus_nack",
    "wrong_id": "wrong_id",
    "stale": "stale",
    "brownout": "config_lost",
    "stuck_bit": "stuck_bit",
    "reset_timeout": "reset_timeout",
    "bad_tags": "fifo_tag",
    "busy": "net_gap",
}


def test_each_fault_is_reported_by_its_own_code(sim: Sim, build: Build, tmp_path: Path) -> None:
    rows = write_rows(tmp_path / "a.rows", pair(np.random.default_rng(11)))
    listed = run(build(SIM / "main.c"), "", "--fault", "list").splitlines()
    assert [line.split("\t")[0] for line in listed] == list(FAULTS)
    assert not sentences(sim(rows), "ERR")
    for fault, name in FAULTS.items():
        if fault == "bad_tags":  # of the FIFO, which keeps to the sensor's own rates
            half = [make_run(np.random.default_rng(11), np.full(700, f * 78.0), ticks(700, 104.0), f) for f in (1, -1)]
            text = sim(write_rows(tmp_path / "fifo.rows", half, 104.0), "--fault", fault, "--fifo", "8")
            assert {s["name"] for s in sentences(text, "ERR")} == {name, "net_sample_rate"}
            continue
        text = sim(rows, "--fault", fault)
        told = {s["name"] for s in sentences(text, "ERR")}
        assert name in told, fault
        passes = fault in ("nack", "stale", "brownout")  # and the device goes on
        assert told - {name} == ({"net_gap"} if passes else told & {"not_ready", "no_run"}), fault
        if passes:
            assert sum(s["method"] == "baseline" for s in sentences(text, "CAL")) == 3
            assert 800 < int(sentences(text, "RUN")[1]["n"]) < 900


def test_a_device_that_is_set_up_again_reads_right_values(sim: Sim, tmp_path: Path) -> None:
    runs = pair(np.random.default_rng(12))
    text = sim(write_rows(tmp_path / "a.rows", runs), "--fault", "brownout", "--stream", "raw")
    origin = next(s.t_us for s in sentences(text, "RAW") if s["0"] == "0")
    by_time = dict(zip(runs[0]["t_us"], runs[0]["counts"][:, 3], strict=True))
    read = [s for s in sentences(text, "RAW") if s.t_us - origin in by_time and s["0"] != "-1"]
    assert len(read) > 850
    assert all(int(s["3"]) == by_time[s.t_us - origin] for s in read)


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b[:20],
        lambda b: b"XCSIM01\0" + b[8:],
        lambda b: b[:-1],
        lambda b: b + b"\0",
        lambda b: b[:8] + b"\xff\xff\xff\xff" + b[12:],
        lambda b: b[:16] + np.float32(np.nan).tobytes() + b[20:],
        lambda b: b[:20] + np.float32(300).tobytes() + b[24:],
        lambda b: b[:32] + b"\xff\xff\xff\xff" + b[36:],
        lambda b: b[:40] + b"\x02\0\0\0" + b[44:],
        lambda b: b[:44] + b"\x03\0\0\0" + b[48:],
        lambda b: b[:48] + np.float32(np.inf).tobytes() + b[52:],
        lambda b: b[:64] + b[64 + 24 : 64 + 48] + b[64 : 64 + 24] + b[64 + 48 :],
        lambda b: b[:71] + b"\xff" + b[72:],
        lambda b: b"",
    ],
)
def test_a_malformed_file_is_one_line_and_exit_2(
    build: Build, tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    path = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(13), np.zeros(50), ticks(50))])
    path.write_bytes(damage(path.read_bytes()))
    done = subprocess.run([build(SIM / "main.c"), path], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("gyrocal-sim: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("arguments", ["", "no/such.rows", "--speed 0 a", "--imu 256 a", "--fault x a", "--x a", "a b"])
def test_bad_usage_is_one_line_and_exit_2(build: Build, arguments: str) -> None:
    done = subprocess.run([build(SIM / "main.c"), *arguments.split()], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_in_real_time_whole_sentences_are_dropped_and_counted(build: Build, tmp_path: Path) -> None:
    n = 145 * 4
    rows = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(14), np.full(n, 78.0), ticks(n))])
    command = [build(SIM / "main.c"), rows, "--speed", "1", "--stream", "raw", "--hold", "--imu", "3"]
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)  # full after some sixty samples
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=writing) as process, open(reading, "rb") as stdout:
        os.close(writing)
        assert process.stdin is not None
        time.sleep(3.0)
        text = b""
        process.stdin.write(b"stream off\nstatus\n")
        process.stdin.flush()
        while b"$STA" not in text or not text.endswith(b"\n"):
            text += stdout.read1(65536)
        process.stdin.close()
        assert process.wait(timeout=20) == 0
    said = sentences(text.decode())
    assert {s.imu for s in said} == {3}
    seqs = np.array([s.seq for s in said])
    lost = int(seqs[-1] + 1 - len(seqs))
    assert lost > 200
    assert int(next(s for s in said if s.tag == "STA")["lost"]) <= lost
    assert int(said[-1].seq) + 1 == len(said) + lost


def test_faster_than_real_time_waits_for_its_reader(build: Build, tmp_path: Path) -> None:
    n = 145 * 4
    rows = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(14), np.full(n, 78.0), ticks(n))])
    command = [build(SIM / "main.c"), rows, "--speed", "50", "--stream", "raw"]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        time.sleep(0.5)  # the pipe is full long since
        said = sentences(process.stdout.read().decode())
    assert [s.seq for s in said] == list(range(len(said)))
    assert sum(s.tag == "RAW" for s in said) >= n


def test_real_time_is_real(build: Build, tmp_path: Path) -> None:
    rows = write_rows(tmp_path / "a.rows", [make_run(np.random.default_rng(15), np.full(290, 78.0), ticks(290))])
    start = time.monotonic()
    run(build(SIM / "main.c"), "", str(rows), "--speed", "2")
    assert 0.9 < time.monotonic() - start < 2.5


def test_over_a_population_the_baseline_is_trusted_where_it_is_right(sim: Sim, tmp_path: Path) -> None:
    """Sound sensors of any scale within 3 % and bias within 10 dps: trusted, and off by what their standard errors say.

    These allow for drift and for effects that 6 s cannot exclude, so white noise alone leaves less than one of them; each
    face's drift of 2.3 mdps, nearly constant over 6 s, is drawn here.
    """
    rng = np.random.default_rng(40)
    n, truth, runs = 900, [], []
    for cycle in range(40):
        scale, bias = rng.uniform(-0.03, 0.03), rng.uniform(-10.0, 10.0)
        truth.append((scale, bias))
        for face in (1, -1):
            drift_dps = rng.normal(0, 0.0023)
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


@pytest.mark.parametrize(
    ("fault", "flag"), [("stuck_bit", "misfit"), ("stale", "missed"), ("nack", "missed"), ("busy", "missed")]
)
def test_a_fault_of_the_sensor_is_flagged(sim: Sim, tmp_path: Path, fault: str, flag: str) -> None:
    rows = write_rows(tmp_path / "a.rows", pair(np.random.default_rng(41)))
    said = sentences(sim(rows, "--fault", fault), "CAL")
    assert said
    assert all(flag in s["flags"].split("+") and s["trusted"] == "0" for s in said), [s["flags"] for s in said]
    sound = [s for s in sentences(sim(rows), "CAL") if s["seconds"] == "6"]
    assert {s["flags"] for s in sound} == {""}
