"""One file that holds several runs: the plateaus are proposed, a known turn gets its rests, and a hang is left out."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration.calibrate import calibrate
from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.plateaus import find
from gyrocal.recording.session import Session
from real_recordings import recording

HZ = 100
RNG = np.random.default_rng(0)
SCALE, BIAS_DPS = 0.012, np.array([0.4, -0.7, 1.1])


def log(path: Path, rates: list[tuple[float, float]]) -> Path:
    """A sensor about z at (rate, seconds) in turn, 0.5 s between two rates."""
    parts = []
    for k, (rate, seconds) in enumerate(rates):
        if k:
            parts.append(np.linspace(rates[k - 1][0], rate, HZ // 2))
        parts.append(np.full(round(seconds * HZ), rate))
    true = np.concatenate(parts)
    gyro = np.column_stack([0 * true, 0 * true, (1 + SCALE) * true]) + BIAS_DPS + RNG.normal(0, 0.1, (true.size, 3))
    rows = np.column_stack([np.arange(true.size) / HZ, gyro])
    np.savetxt(path, rows, "%.5f", ",", header="t_s,gx_dps,gy_dps,gz_dps", comments="")
    return path


@pytest.mark.parametrize("rate", [[], ["--rate", "78"]])
def test_the_plateaus_of_one_file_are_proposed(rate: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = log(tmp_path / "log.csv", [(0, 8), (78, 10), (-78, 10), (0, 6)])
    assert main(["import", str(path), str(tmp_path / "out"), *rate]) == 2
    proposed, said = capsys.readouterr()
    assert "the readings show 4 plateaus" in said
    assert max(map(len, (said, *proposed.splitlines()))) <= 200
    options = shlex.split(proposed.partition("one by one:")[2].partition("or all")[0])
    assert len(options) == 8
    assert main(["import", str(path), str(tmp_path / "out"), *options]) == 0
    runs = Session.open(tmp_path / "out").runs
    assert [run.file for run in runs] == ["rest_1.csv", "z_1.csv", "z_2.csv", "rest_2.csv"]
    assert [float(np.mean(run.rate_dps)) for run in runs] == pytest.approx([0, 80, -77.8, 0], abs=0.3)
    assert all(np.std(run.gyro_dps[:, 2]) < 0.15 for run in runs)
    assert main(["import", str(path), str(tmp_path / "whole"), "--rate", "78", "--run", "all::"]) == 0


def test_one_rate_and_a_movement_by_hand_are_no_plateaus(tmp_path: Path) -> None:
    for rates in ([(78.0, 20.0)], [(0.0, 20.0)]):
        path = log(tmp_path / "log.csv", rates)
        assert len(read_recording(path, Options.of((), {"table_rate_dps": rates[0][0]})).session.runs) == 1
    with pytest.raises(InputError, match="its true rate is not known; give --rate"):
        read_recording(path, Options())


def test_a_known_turn_gets_scale_and_bias_from_the_rests_about_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = log(tmp_path / "turn.csv", [(0, 8), (90, 7.5), (0, 8)])
    assert main(["import", str(path), str(tmp_path / "out"), "--turn-deg", str(90 * 8), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["repaired"] == {"rests": 2}
    session = Session.open(tmp_path / "out")
    assert [run.turn_deg for run in session.runs] == [None, 720.0, None]
    assert len({run.scenario for run in session.runs}) == 1
    estimate = calibrate(session, methods=["model"])[0]
    assert estimate.scale == pytest.approx(SCALE, abs=4e-4)
    assert estimate.bias_dps == pytest.approx(BIAS_DPS[2], abs=0.03)


def test_a_stretch_in_which_the_sensor_hung_is_left_out_and_told(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", [(0, 60)])
    lines = path.read_text().splitlines()
    for k in range(2001, 2241):
        lines[k] = ",".join([lines[k].partition(",")[0], lines[2000].partition(",")[2]])
    path.write_text("\n".join(lines) + "\n")
    found = read_recording(path, Options.of((), {"table_rate_dps": 0.0}))
    run = found.session.runs[0]
    assert len(run) == 6000 - 240
    assert found.repaired["hung"] == 1
    assert [w.code for w in found.warnings] == ["constant_reading"]
    assert "repeats one reading from 20 to 22.39 s. These 240 samples are left out" in found.warnings[0].text
    assert not found.warnings[0].blocking


def test_a_run_that_is_named_for_its_axis_turns_about_it(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", [(0, 8), (78, 10)])
    cuts = ["x_rot:850:1800:turn=740", "z_rest:0:800:rate=0", "y_p:0:800:rate=0,axis=z"]
    runs = read_recording(path, Options.of((), {"cuts": cuts})).session.runs
    assert [run.axis for run in runs] == ["x", "z", "z"]


def test_a_real_turn_between_rests_gives_the_scale_of_its_integral(tmp_path: Path) -> None:
    path = recording("mpu6050_multipose_tedaldi", "imu_90_x_rot.csv")
    maps = [f"g{a}_dps=g{a}/131" for a in "xyz"]
    known = {"rate_hz": 100.0, "turn_deg": 90.0, "axis": "x"}
    session = read_recording(path, Options.of(maps, known)).session
    assert [run.turn_deg for run in session.runs] == [None, 90.0, None]
    rows = path.read_text().splitlines()
    head = next(k for k, row in enumerate(rows) if row.startswith("ax,ay,az,gx"))
    gx_dps = np.array([float(row.split(",")[3]) for row in rows[head + 1 :]]) / 131
    first, last = len(session.runs[0]), len(session.runs[0]) + len(session.runs[1])
    bias_dps = float(np.mean(np.concatenate([gx_dps[:first], gx_dps[last:]])))
    turned_deg = float(np.sum(gx_dps[first:last] - bias_dps)) / 100
    estimate = next(e for e in calibrate(session, methods=["model"]) if e.axis == "x")
    assert estimate.bias_dps == pytest.approx(bias_dps, abs=0.02)
    assert estimate.scale == pytest.approx(turned_deg / 90 - 1, abs=0.01)


@pytest.mark.parametrize(("face", "sign"), [("up", 1), ("down", -1)])
def test_the_table_s_rates_make_a_run_of_each_plateau(face: str, sign: int, tmp_path: Path) -> None:
    rates = [0.0, 45.0, 0.0, -45.0, 78.0, 45.0]
    path = log(tmp_path / "log.csv", [(sign * rate, 6) for rate in rates])
    out = tmp_path / "out"
    assert main(["import", str(path), str(out), "--rates", "45,-45,78", "--face", face, "--power-on-s", "3"]) == 0
    runs = Session.open(out).runs
    assert [run.table_rate_dps for run in runs] == rates
    assert float(runs[-1].gyro_dps[-1, 2]) == pytest.approx(float(np.loadtxt(path, delimiter=",", skiprows=1)[-1, 3]))
    assert [run.file for run in runs] == ["rest_1.csv", "z_1.csv", "rest_2.csv", "z_2.csv", "z_3.csv", "z_4.csv"]
    (estimate,) = calibrate(Session.open(out), [5.0], ["model"])
    assert estimate.scale == pytest.approx(SCALE, abs=4e-4)
    assert estimate.bias_dps == pytest.approx(BIAS_DPS[2], abs=0.03)


@pytest.mark.parametrize(
    ("rates", "more", "says"),
    [
        ("78", [], "and no stated rate is near; add the table's rate there"),
        ("78,-78,30", [], "is at 30 dps; there are plateaus at 80, -77.8"), ("78,82,-78", [], "near 82 and 78 dps"),
        ("fast", [], "with commas"), ("78,-78", ["--rate", "78"], "leave out --rate"),
        ("78,-78", ["--run", "a:0:9"], "leave out --run"), ("78,-78", ["--gravity"], "leave out --gravity"),
    ],
)  # fmt: skip
def test_rates_that_do_not_fit_the_plateaus_are_refused(
    rates: str, more: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = log(tmp_path / "log.csv", [(0, 6), (78, 6), (-78, 6)])
    assert main(["import", str(path), str(tmp_path / "out"), "--rates", rates, *more]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_runs_that_are_cut_from_one_file_have_their_own_time_since_power_on(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", [(0, 60)])
    cuts = ["--run", "a:0:1000", "--run", "b:25s:40s", "--run", "c:45s:55s:power_on_s=7"]
    assert main(["import", str(path), str(tmp_path / "out"), "--rate", "0", "--power-on-s", "3", *cuts]) == 0
    assert [run.power_on_s for run in Session.open(tmp_path / "out").runs] == [3.0, 28.0, 7.0]


def test_a_table_that_shakes_at_high_rates_and_one_that_wobbles_has_plateaus_there() -> None:
    """At 361 to 723 dps the other axes wobble by 1 to 2 dps with the table, and the motor shakes at 120 to 240 dps."""
    rng = np.random.default_rng(2)
    rates, shakes = (60.0, 120.0, 240.0, 360.0, 540.0, 720.0, 0.0), (2.0, 8.0, 14.0, 6.0, 3.0, 0.4, 0.05)
    parts = []
    for k, (rate, sd) in enumerate(zip(rates, shakes, strict=True)):
        ramp = np.linspace(rates[k - 1] if k else 0.0, rate, HZ)
        parts.append(np.column_stack([np.concatenate([ramp, np.full(8 * HZ, rate)]), np.r_[np.zeros(HZ), np.full(8 * HZ, sd)]]))
    rate_dps, sd = np.concatenate(parts).T
    t_s = np.arange(rate_dps.size) / HZ
    wobble = rate_dps * 0.002 * np.sin(2 * np.pi * 0.9 * t_s)
    shaken_dps = rate_dps * (1 + 1e-3 * np.sin(t_s)) + rng.normal(0, 1, t_s.size) * sd
    gyro = [wobble, shaken_dps, -wobble + rng.normal(0, 0.1, t_s.size)]
    found = [p for p in find(t_s, gyro) if p.stop_s - p.start_s > 2]
    assert [round(p.mean_dps[1]) for p in found] == pytest.approx(rates, abs=1.5)
    assert all(p.stop_s - p.start_s > 7.4 for p in found)
