"""What `calibrate` says of its own answers: standard errors, misfit, flags."""

import json
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.calibrate import Estimate, calibrate
from gyrocal.calibration.estimator import Answer
from gyrocal.calibration.flags import FLAGS
from gyrocal.calibration.trust import Evidence
from gyrocal.calibration.uncertainty import (
    DRIFT_SD_DPS,
    LATEST_US,
    LONG_DRIFT_SD_DPS,
    Combined,
    FaceSums,
    drift_sd_dps,
    face_posterior,
    last_turn,
    misfit,
    misfit_limit,
    white_variance,
)
from gyrocal.cli import main
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.simulation.simulate import LSB_DPS, RATE_HZ, WHITE_SD_DPS, simulate

TABLE_DPS = 78.0
CAMPAIGN = Path(str(files("gyrocal"))) / "data" / "table2" / "model.toml"


def session(
    change: Callable[[Array, float], Array] = lambda y, w: y, *, scale: float = 0.004, bias_dps: float = 0.1, seed: int = 1,
    table_dps: float = TABLE_DPS, kept: Array | None = None, table_rate_se_dps: float | None = None,
) -> Session:  # fmt: skip
    """An up and a down run of 6.5 s; ``change`` takes readings and true rate."""
    rng = np.random.default_rng(seed)
    t_s = np.round(np.arange(round(6.5 * RATE_HZ)) / RATE_HZ, 6)
    runs = []
    for i, (face, w) in enumerate((("up", TABLE_DPS), ("down", -TABLE_DPS))):
        y = change((1 + scale) * w + bias_dps + rng.normal(0, WHITE_SD_DPS, t_s.size), w)
        y = np.round(y / LSB_DPS) * LSB_DPS
        frame = pl.DataFrame({"t_s": t_s, **{f"g{a}_dps": y for a in AXES}})
        frame = frame if kept is None else frame.filter(pl.Series(kept))
        runs.append(
            Run(i, f"{i:03d}_{face}.csv", "s000", face, "z", table_dps, None, None, None, RATE_HZ,  # type: ignore[arg-type]
                frame=frame, lsb_dps=LSB_DPS, table_rate_se_dps=table_rate_se_dps)
        )  # fmt: skip
    return Session(RATE_HZ, tuple(runs), "z", "simulated", 250.0, LSB_DPS)


def at_6_s(of: Session, method: str = "baseline") -> Estimate:
    (found,) = calibrate(of, [6.0], [method])
    return found


def spiked(y: Array, w: float) -> Array:
    y = y.copy()
    y[200] = 249.0 * np.sign(w)
    return y


def still(y: Array, w: float) -> Array:
    y = y.copy()
    y[300:380] = y[300]
    return y


def rippling(y: Array, w: float) -> Array:
    t_s = np.arange(y.size) / RATE_HZ
    return y + 0.002 * w * np.cos(np.deg2rad(TABLE_DPS) * t_s + 1.0)


@pytest.mark.parametrize("method", ["baseline", "cnn", "model"])
@pytest.mark.parametrize(("scale", "bias_dps"), [(0.004, 0.1), (-0.03, 10.0), (0.02, -8.0)])
def test_a_sound_sensor_is_trusted_wherever_its_scale_and_bias_are(method: str, scale: float, bias_dps: float) -> None:
    found = at_6_s(session(scale=scale, bias_dps=bias_dps), method)
    assert found.flags == ()
    assert found.trusted
    assert found.misfit == pytest.approx(1.0, abs=0.3)
    assert found.scale == pytest.approx(scale, abs=5 * (found.scale_se or 0.0))
    assert found.bias_dps == pytest.approx(bias_dps, abs=5 * (found.bias_se_dps or 0.0))


@pytest.mark.parametrize("method", ["baseline", "model"])
def test_constant_readings_are_not_a_perfect_answer(method: str) -> None:
    found = at_6_s(session(lambda y, w: np.full_like(y, 1.004 * w)), method)
    assert found.flags == ("constant_reading",)
    assert not found.trusted
    assert found.scale_se is not None
    assert found.scale_se > 1e-5


def test_a_reading_that_stands_still_for_half_a_second() -> None:
    assert "constant_reading" in at_6_s(session(still)).flags
    short = session(lambda y, w: np.where(np.arange(y.size) // 30 == 9, y[270], y))
    assert "constant_reading" not in at_6_s(short).flags


@pytest.mark.parametrize("method", ["baseline", "model"])
def test_one_spike_does_not_hide_in_the_noise_that_it_makes(method: str) -> None:
    found = at_6_s(session(spiked), method)
    assert found.flags == ("misfit",)
    assert found.misfit is not None
    assert found.misfit > 10


def test_readings_at_full_scale() -> None:
    full = session(lambda y, w: np.where(np.arange(y.size) == 100, 250.0, y))
    assert "clipped" in at_6_s(full).flags


def test_a_table_at_another_rate_than_stated() -> None:
    found = at_6_s(session(lambda y, w: y * 100 / 78))
    assert found.flags == ("implausible",)
    standing = at_6_s(session(lambda y, w: y - w))
    assert standing.flags == ("implausible",)


def test_a_sensor_that_turns_the_other_way() -> None:
    assert at_6_s(session(lambda y, w: -y)).flags == ("direction", "implausible")


def test_a_missing_sample() -> None:
    kept = np.ones(round(6.5 * RATE_HZ), bool)
    kept[50] = False
    assert at_6_s(session(kept=kept)).flags == ("missed",)
    late = np.ones_like(kept)
    late[-20] = False
    assert at_6_s(session(kept=late)).flags == ()  # after the seconds that are used


@pytest.mark.parametrize("table_dps", [TABLE_DPS, 60.0])
def test_a_network_that_cannot_answer_says_so(table_dps: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outside = session(lambda y, w: y + 5.0 * np.linspace(-1, 1, y.size), table_dps=table_dps)
    folder = tmp_path / "s"
    outside.save(folder)
    assert main(["calibrate", str(folder), "--seconds", "6", "--method", "cnn", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["estimates"]
    assert [found[key] for key in ("scale", "scale_se", "bias_dps", "bias_se_dps", "misfit")] == [None] * 5
    assert "net_range" in found["flags"]
    assert found["trusted"] is False


def test_a_network_of_another_sample_rate_has_no_answer() -> None:
    """Every second sample, at 72.5 Hz: no answer and net_range, also where the network is the only method."""
    kept = np.arange(round(6.5 * RATE_HZ)) % 2 == 0
    half = replace(session(kept=kept), sample_rate_hz=RATE_HZ / 2)
    runs = [replace(run, sample_rate_hz=RATE_HZ / 2) for run in half.runs]
    found = at_6_s(half.with_runs(runs), "cnn")
    assert (found.scale, found.bias_dps, found.flags) == (None, None, ("net_range",))


def test_a_table_that_ripples_twice_a_turn_is_not_what_the_network_knows() -> None:
    twice = session(lambda y, w: y + 0.0012 * w * np.cos(2 * np.deg2rad(TABLE_DPS) * np.arange(y.size) / RATE_HZ + 0.5))
    flags = at_6_s(twice, "cnn").flags
    assert {"misfit", "disagrees", "net_range"} & set(flags)


def test_the_words_of_disagrees_hold_for_an_answer_that_is_the_fits_own() -> None:
    """The rule weighs errors: the same scale and bias are flagged where the error that they state is much too small."""
    evidence = Evidence.of(session().runs)
    assert evidence is not None
    fit = Combined.of(evidence.faces, evidence.w_dps)
    same = [float(v[0]) for v in (fit.scale, np.sqrt(fit.scale_variance), fit.bias_dps, np.sqrt(fit.bias_variance))]
    answer = Answer(*same, None)
    assert not evidence.disagrees(answer)
    assert evidence.disagrees(replace(answer, scale_se=0.1 * answer.scale_se))
    assert "error" in FLAGS["disagrees"]
    assert "another answer" not in FLAGS["disagrees"]


def test_a_rippling_table_makes_the_baselines_errors_large_and_a_steady_one_does_not() -> None:
    steady, moved = at_6_s(session()), at_6_s(session(rippling))
    assert steady.scale_se == pytest.approx(1.5e-5, rel=0.2)
    assert moved.scale_se is not None
    assert moved.scale is not None
    assert moved.flags == ("misfit",)
    assert moved.scale_se > 3 * steady.scale_se  # type: ignore[operator]
    assert abs(moved.scale - 0.004) < 3 * moved.scale_se


def test_noise_behind_a_low_pass_is_not_underestimated() -> None:
    """Means of 4 samples in a row: successive differences show a sixteenth of its variance at long times."""

    def filtered(y: Array, w: float) -> Array:
        noise = np.random.default_rng(int(w) + 100).normal(0, 0.3, y.size + 3)
        return y + np.convolve(noise, np.full(4, 1 / 4), "valid")

    found = at_6_s(session(filtered))
    at_long_times = 0.3 / np.sqrt(870 * 2) / TABLE_DPS
    assert found.scale_se is not None
    assert found.scale_se > 0.8 * at_long_times
    assert found.misfit == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("samples", [4, 6])
def test_sound_sensors_behind_a_low_pass_are_trusted(samples: int) -> None:
    """Means of so many samples in a row, at 145 Hz: at least 90 % of sound sensors are trusted after 6 s."""
    rng = np.random.default_rng(samples)
    t_us = np.round(np.arange(870) / RATE_HZ * 1e6).astype(np.int64)
    kernel = np.full(samples, WHITE_SD_DPS / np.sqrt(samples))
    faces = []
    for _ in range(2):
        white = rng.normal(size=(400, 870 + samples - 1))
        noise = np.apply_along_axis(lambda y: np.convolve(y, kernel, "valid"), 1, white)
        faces.append(FaceSums.of(np.round((0.3 + noise) / LSB_DPS) * LSB_DPS, t_us, RATE_HZ))
    variance = white_variance(faces)
    found = [face_posterior(f, variance, w, LSB_DPS) for f, w in zip(faces, (TABLE_DPS, -TABLE_DPS), strict=True)]
    assert np.mean(misfit(found) <= misfit_limit(sum(f.blocks for f in found))) >= 0.9


@pytest.mark.parametrize("between_dps", [0.0, 0.02])
def test_a_bias_that_moves_between_the_runs_of_a_power_cycle_is_in_the_errors(between_dps: float) -> None:
    """Thirteen runs at seven rates, each with a bias of its own: two runs cannot show that, more can."""
    rng = np.random.default_rng(5)
    rates_dps = [0.0, 45.0, 0.0, -45.0, 0.0, 90.0, 0.0, -90.0, 0.0, 180.0, 0.0, -180.0, 0.0]
    t_us = np.round(np.arange(580) / RATE_HZ * 1e6).astype(np.int64)
    sums = [
        FaceSums.of(rng.normal(0, WHITE_SD_DPS, (200, 580)) + rng.normal(0, between_dps, (200, 1)), t_us, RATE_HZ)
        for _ in rates_dps
    ]  # fmt: skip
    variance = white_variance(sums)
    faces = [face_posterior(f, variance, w) for f, w in zip(sums, rates_dps, strict=True)]
    fit = Combined.of(faces, rates_dps)
    for error, of in ((fit.scale, fit.scale_variance), (fit.bias_dps, fit.bias_variance)):
        assert 0.75 < np.std(error / np.sqrt(of)) < 1.2
    sound = np.mean(misfit(faces, fit) <= misfit_limit(sum(f.blocks for f in faces)))
    assert sound >= 0.9 if between_dps == 0 else sound <= 0.02


def test_runs_that_a_pair_leaves_out_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pair = session()
    more = [replace(run, index=2 + k, file=f"more_{k}.csv") for k, run in enumerate(pair.runs)]
    pair.save(tmp_path / "two")
    pair.with_runs([*pair.runs, *more]).save(tmp_path / "four")
    for folder, options, told in (("two", [], False), ("four", [], True), ("four", ["--method", "model"], False)):
        assert main(["calibrate", str(tmp_path / folder), "--seconds", "6", *options]) == 0
        assert ("--method model takes all 4, and --seconds all whole ones." in capsys.readouterr().out) is told


def test_a_network_claims_its_own_errors_only_where_the_campaign_is_known() -> None:
    """A slow spin-up, three times the campaign's usual size: the network's own error is too small."""
    spun = session(lambda y, w: y - 0.004 * w * np.exp(-np.arange(y.size) / RATE_HZ / 8.0))
    (anywhere,) = calibrate(spun, [6.0], ["cnn"])
    (known,) = calibrate(spun, [6.0], ["cnn"], CAMPAIGN)
    assert anywhere.scale is not None
    assert anywhere.scale_se is not None
    assert known.scale_se is not None
    assert anywhere.scale_se > 1.5 * known.scale_se
    assert abs(anywhere.scale - 0.004) < 5 * anywhere.scale_se


def test_what_is_not_known_of_the_tables_rate_counts(tmp_path: Path) -> None:
    known, unsure = at_6_s(session()), at_6_s(session(table_rate_se_dps=0.078))
    assert known.scale_se is not None
    assert unsure.scale_se == pytest.approx(np.hypot(known.scale_se, 0.001))
    assert unsure.bias_se_dps == known.bias_se_dps
    again = session(table_rate_se_dps=0.078).save(tmp_path / "s")
    assert at_6_s(again).scale_se == pytest.approx(unsure.scale_se)


def test_the_table_of_answers_says_it_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session(spiked).save(tmp_path / "s")
    assert main(["calibrate", str(tmp_path / "s"), "--seconds", "6", "--method", "baseline"]) == 0
    said = capsys.readouterr().out
    assert "no: misfit" in said
    assert "misfit (1 of 1): the readings scatter more than model and noise allow" in said


@pytest.mark.parametrize("method", ["baseline", "cnn", "model"])
def test_a_warm_up_that_first_seconds_hide_is_seen_in_the_rest_of_the_run(method: str) -> None:
    """It moves the bias between the faces, which reads as scale: by more than five of the errors that noise alone leaves."""
    warming, truth = simulate(None, "paper", ["warmup:A_dps=0.05,tau_s=60"], seed=11, scenarios=5, seconds=40.0)
    whole = calibrate(warming, [6.0], [method])
    cut = calibrate(warming.with_runs(run.part(0, 1000) for run in warming.runs), [6.0], [method])
    off = [abs(e.scale - truth["runs"][0]["scale"][2]) / e.scale_se for e in whole]  # type: ignore[operator]
    assert all(e.flags == ("misfit",) or z < 3 for e, z in zip(whole, off, strict=True)), "flagged, or within its error"
    assert sum(not e.trusted for e in whole) >= 4
    assert [(e.scale, e.scale_se) for e in cut] == [(e.scale, e.scale_se) for e in whole], "answers are from the first seconds"
    assert sum(e.trusted for e in cut) >= 3
    assert max(off) > 5
    sound, _ = simulate(None, "paper", seed=11, scenarios=5, seconds=40.0)
    assert sum(e.trusted for e in calibrate(sound, [2.0, 4.0, 6.0], [method])) >= 14


def test_the_rest_of_a_run_that_was_recorded_later_is_not_needed() -> None:
    """The device has only the first run's when it answers."""
    warming, _ = simulate(None, "paper", ["warmup:A_dps=0.05,tau_s=60"], seed=12, scenarios=1, seconds=40.0)
    up, down = warming.runs
    known = [up, down.part(0, 900)], [up.part(0, 900), down]
    found = [calibrate(warming.with_runs(runs), [6.0], ["baseline"])[0] for runs in known]
    assert [e.flags for e in found] == [("misfit",), ()]


def test_a_turn_is_whole_after_the_seconds_and_within_the_first_minute() -> None:
    """A ripple of any order cancels in it; what is later than a minute does not count."""
    t_us = np.round(np.arange(round(100 * RATE_HZ)) / RATE_HZ * 1e6).astype(np.int64)
    angle = np.deg2rad(TABLE_DPS * 1e-6 * t_us)
    y = np.cos(angle + 1.0) + 0.3 * np.sin(2 * angle) + np.where(t_us > LATEST_US, 5.0, 0.0)
    turn = last_turn(y, t_us, -TABLE_DPS, 6_000_000)
    assert turn is not None
    assert turn.samples == pytest.approx(360 / TABLE_DPS * RATE_HZ, abs=1)
    assert abs(turn.mean_dps[0]) < 0.005
    turn_us = 360e6 / TABLE_DPS
    cases = (6.0, 2.9, False), (6.0, 3.1, False), (6.0, 3.3, True), (4.7, 2.3, False), (4.6, 2.3, True), (2.0, 0.9, False)
    for begins, ends, answered in cases:
        first = t_us[t_us <= ends * turn_us]
        assert (last_turn(y[: first.size], first, TABLE_DPS, round(begins * 1e6)) is not None) == answered, (begins, ends)
    assert last_turn(y, t_us, 0.0, 0) is None


def test_a_table_that_is_stopped_before_the_run_ends_moves_nothing() -> None:
    """Its last second is left out, in the one turn that it would spoil as in fast ones."""
    t_us = np.round(np.arange(round(23.5 * RATE_HZ)) / RATE_HZ * 1e6).astype(np.int64)
    for w_dps in (TABLE_DPS, 900.0):
        y = np.where(t_us > t_us[-1] - 990_000, -w_dps, 0.001)
        turn = last_turn(y, t_us, w_dps, 6_000_000)
        assert turn is None or turn.mean_dps[0] == pytest.approx(0.001)
        assert (turn is None) == (w_dps == 900.0)


def test_the_longer_the_runs_the_more_they_drift() -> None:
    """White noise averages out over a minute and a drift does not; over the device's six seconds the drift is one."""
    presumed = [DRIFT_SD_DPS, DRIFT_SD_DPS, 2 * DRIFT_SD_DPS, LONG_DRIFT_SD_DPS]
    assert [drift_sd_dps(s) for s in (2.0, 6.0, 24.0, 600.0)] == presumed
    session, _ = simulate(None, "paper", seed=13, scenarios=2, seconds=60.0)
    drift_dps = []
    for span_s in (6.0, 60.0):
        rows = {row.source: row for row in calibrate(session, [span_s], ["baseline"])[0].budget}
        drift_dps.append(rows["drift"].bias_dps or 0.0)
    assert drift_dps[1] > 1.5 * drift_dps[0]
