"""Real recordings through the importer and, in raw counts, through the simulated device: the figures of their makers.

They lie in `shared/realdata` beside the repository (`GYROCAL_REALDATA` names another place); where not, this skips.
"""

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.interpolate import CubicSpline
from scipy.io import loadmat
from scipy.spatial.transform import Rotation, Slerp

from gyrocal.calibration.calibrate import calibrate
from gyrocal.cli import main
from gyrocal.device import simulated
from gyrocal.diagnosis.answer.explain import Explanation, explain
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.plausibility import check
from gyrocal.recording.session import AXES, Session
from gyrocal.recording.stamps import regression
from gyrocal.recording.timing import smoothing_spline
from make_runs import make_run, make_session
from real_recordings import recording

DOCS = Path(__file__).parents[2] / "docs"


def maps(*mappings: str) -> list[str]:
    return [word for mapping in mappings for word in ("--map", mapping)]


@pytest.fixture(scope="module")
def nilspod(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Six rests and one turn about each axis."""
    source = recording("nilspod_ferraris_360", "example_ferraris_session.csv")
    out = tmp_path_factory.mktemp("nilspod") / "session"
    columns = maps("t_s=n_samples:samples", *(f"g{a}_dps=gyr_{a}" for a in AXES), *(f"a{a}_g=acc_{a}:m/s2" for a in AXES))
    sections = ["--sections", str(source.with_name("example_ferraris_session_list.json")), "--rate", "0"]
    rules = ["x_*:axis=x", "y_*:axis=y", "z_*:axis=z", "*_a:face=down", "*_rot:turn=-360"]
    options = [word for rule in rules for word in ("--run-meta", rule)]
    assert main(["import", str(source), str(out), *columns, "--rate-hz", "102.4", *sections, *options]) == 0
    return Session.open(out)


def test_nilspod_poses_agree_with_gravity(nilspod: Session) -> None:
    for run in nilspod.runs[:6]:
        assert run.acc_g is not None
        assert abs(run.acc_g[:, run.axis_index].mean() - run.face_sign) < 0.08


def test_nilspod_over_the_wire(nilspod: Session, require_tool: Callable[[str], str]) -> None:
    """The bias at rest of each pose, the scale of each turn of 360 degrees."""
    require_tool("cc")
    sentences = simulated.replay(nilspod, stream="off")
    answers = [s for s in sentences if s.tag == "CAL"]
    rests = [s for s in answers if s.fields["method"] == "rest"]
    turns = [s for s in answers if s.fields["method"] == "turn"]
    assert (len(rests), [s.fields["axis"] for s in turns]) == (6, list(AXES))
    ends = [s for s in sentences if s.tag == "RUN" and s.fields["state"] == "end"][:6]
    bias_dps = np.mean([[s.real(f"mean_{a}_dps") for a in AXES] for s in ends], axis=0)
    assert bias_dps == pytest.approx([-0.600, -0.370, 0.059], abs=0.001)
    for axis, expected in zip(AXES, [-0.600, -0.370, 0.059], strict=True):
        along = [s.real("bias_dps") for s in rests if s.fields["axis"] == axis]
        assert along == pytest.approx([expected] * 2, abs=0.01)
    assert [1.0 + (s.real("scale") or 0.0) for s in turns] == pytest.approx([1.0279, 0.9824, 0.9982], abs=0.0001)


def test_mpu6050_over_the_wire(tmp_path: Path, require_tool: Callable[[str], str]) -> None:
    """449 s at rest: the mean rates."""
    require_tool("cc")
    source = recording("mpu6050_multipose_tedaldi", "example_data_tinit_calc.csv")
    columns = maps(*(f"g{a}_dps=g{a}/131" for a in AXES), *(f"a{a}_g=a{a}/16384" for a in AXES))
    out = tmp_path / "session"
    assert main(["import", str(source), str(out), *columns, "--rate-hz", "100", "--rate", "0"]) == 0
    sentences = simulated.replay(out, stream="off")
    (rest,) = [s for s in sentences if s.tag == "CAL"]
    assert rest.fields["method"] == "rest"
    assert rest.real("seconds") == pytest.approx(449.29, abs=0.01)
    (end,) = [s for s in sentences if s.tag == "RUN" and s.fields["state"] == "end"]
    assert [end.real(f"mean_{a}_dps") for a in AXES] == pytest.approx([-3.345, 1.089, -0.498], abs=0.0006)
    assert rest.real("bias_dps") == end.real("mean_z_dps")


@pytest.fixture(scope="module")
def chamber(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """At rest in a thermal chamber: down to -18, up to 74, and back to 36 degC in 70 minutes."""
    source = recording("thermal_chamber_imu", "imu_raw_data.tsv")
    columns = maps("t_s=timestamp:us", *(f"g{a}_dps=imu.gyro.{a}:rad/s" for a in AXES), "temp_c=imu.temperature")
    out = tmp_path_factory.mktemp("chamber") / "session"
    assert main(["import", str(source), str(out), *columns, "--rate", "0"]) == 0
    return Session.open(out)


def test_thermal_chamber_is_read_by_its_tabs(chamber: Session) -> None:
    run = chamber.runs[0]
    assert len(run) == 8400
    assert run.duration_s / 60 == pytest.approx(70.7, abs=0.1)
    assert run.temp_c is not None
    assert (run.temp_c[0], run.temp_c.min(), run.temp_c.max()) == pytest.approx((51.6, -17.6, 74.0), abs=0.05)


def test_thermal_chamber_begins_with_a_reading_that_is_off(chamber: Session) -> None:
    """x reads -2.70 dps first and -4.05 from then on."""
    assert [(w.code, w.axis) for w in check(chamber)] == [("first_sample", "x")]


def test_thermal_chamber_in_rad_is_unsure(tmp_path: Path) -> None:
    source = recording("thermal_chamber_imu", "imu_raw_data.tsv")
    columns = maps("t_s=timestamp:us", *(f"g{a}_dps=imu.gyro.{a}" for a in AXES))
    assert main(["import", str(source), str(tmp_path / "s"), *columns, "--rate", "0"]) == 0
    assert "unit_unsure" in {w.code for w in check(Session.open(tmp_path / "s"))}


def test_nilspod_contradicts_nothing(nilspod: Session) -> None:
    assert [(w.code, w.axis, w.blocking) for w in check(nilspod)] == [("turn_exact", a, False) for a in AXES]
    turned = [replace(r, turn_deg=-r.turn_deg) if r.turn_deg else r for r in nilspod.runs]
    told = check(nilspod.with_runs(turned))
    assert [(w.code, w.axis) for w in told if w.blocking] == [("sign_flipped", a) for a in AXES]


@pytest.mark.parametrize("file", ["example_data_tinit_calc.csv", "imu_static_test.csv"])
def test_mpu6050_at_rest_contradicts_nothing(tmp_path: Path, file: str) -> None:
    source = recording("mpu6050_multipose_tedaldi", file)
    columns = maps(*(f"g{a}_dps=g{a}/131" for a in AXES), *(f"a{a}_g=a{a}/16384" for a in AXES))
    out = tmp_path / "session"
    assert main(["import", str(source), str(out), *columns, "--rate-hz", "100", "--rate", "0"]) == 0
    assert check(Session.open(out)) == []


@pytest.fixture(scope="module")
def explained(chamber: Session) -> Explanation:
    return explain(chamber)


@pytest.mark.wide
@pytest.mark.slow
def test_thermal_chamber_is_explained(explained: Explanation) -> None:
    """y follows a curve over temperature; on x a curve and a loop are certain only together."""
    named = {(effect, axis) for step in explained.steps for effect in step.effects for axis in step.axes}
    assert ("bias_temperature", "y") in named
    assert {effect for effect, axis in named if axis == "x"} <= {"bias_temperature", "thermal_hysteresis"}
    old, new = (d.comparison.per_axis["y"] for d in (explained.first, explained.last))
    assert new.rms_dps < 0.2 * old.rms_dps
    assert new.excess_dps < 0.2 * old.excess_dps
    assert explained.last.verdict == "unknown"
    assert {f.axis for f in explained.last.comparison.where} == {"x", "z"}  # each jumps once


PAGES = {"walkthrough.md": "## The same on a real recording", "explain.md": "## On a real recording"}
WORD = re.compile(r"[A-Za-z_°]+|[+-]?\d+(?:\.\d+)?")


def commands(page: str) -> list[tuple[list[str], str]]:
    """The words of each command of a page about the chamber, with the output that the page shows below it."""
    text = (DOCS / page).read_text(encoding="utf-8").split(PAGES[page])[1].split("\n## ")[0]
    found = re.findall(r"^    (gyrocal [^\n]*(?:(?<=\\)\n[^\n]*)*)|^```\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    shown = [output for _, output in found[1:]] + [""]
    return [(c.replace("\\\n", " ").split()[1:], out) for (c, _), out in zip(found, shown, strict=True) if c]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_the_pages_show_what_the_commands_print(
    page: str, explained: Explanation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    """Word for word, and each number within a twentieth or 1 of its unit. The session is explained once for all pages."""
    shutil.copy(recording("thermal_chamber_imu", "imu_raw_data.tsv"), tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gyrocal.diagnosis.answer.explain.explain", lambda *_, **__: explained)
    monkeypatch.setattr("gyrocal.diagnosis.answer.compare.compare", lambda *_, **__: explained.first.comparison)
    shown = 0
    for words, theirs in commands(page):
        assert main(words) == 0
        told = WORD.findall(capsys.readouterr().out)
        if theirs:
            page_told = WORD.findall(theirs)
            assert [w for w in told if w.isalpha()] == [w for w in page_told if w.isalpha()]
            numbers = [[float(w) for w in words if w[-1].isdigit()] for words in (told, page_told)]
            assert numbers[0] == pytest.approx(numbers[1], rel=0.05, abs=1.0)
            shown += 1
    assert shown > 0
    html = (tmp_path / "chamber.html").read_text(encoding="utf-8")
    assert html.count("shows it against temperature: ") == 2  # each step against the variable of its effects
    assert "<h2>What remains</h2>" in html


def test_nilspod_on_the_host(nilspod: Session) -> None:
    """Bias from the rests and scale from the turns, about each axis, by the model method."""
    found = {e.axis: e for e in calibrate(nilspod, methods=["model"])}
    assert [1 + found[a].scale for a in AXES] == pytest.approx([1.0279, 0.9824, 0.9982], abs=0.001)
    assert [found[a].bias_dps for a in AXES] == pytest.approx([-0.600, -0.370, 0.059], abs=0.004)


def test_mpu6050_at_rest_on_the_host(tmp_path: Path) -> None:
    """At rest there is no scale to find, and `calibrate` says so; the bias is the model's."""
    source = recording("mpu6050_multipose_tedaldi", "example_data_tinit_calc.csv")
    columns = maps(*(f"g{a}_dps=g{a}/131" for a in AXES), *(f"a{a}_g=a{a}/16384" for a in AXES))
    out = tmp_path / "session"
    assert main(["import", str(source), str(out), *columns, "--rate-hz", "100", "--rate", "0"]) == 0
    session = Session.open(out)
    with pytest.raises(InputError, match="cannot be determined"):
        calibrate(session, methods=["model"])
    model = fit(session, Model.builtin("paper")).model
    bias_dps = [model.value("bias", a, "bias_dps") for a in AXES]
    assert bias_dps == pytest.approx([-3.345, 1.089, -0.498], abs=0.001)


@pytest.mark.parametrize("file", ["raw_pitch_slow.mat", "raw_pitch_medium.mat"])
def test_stepper_reads_12_ms_behind_its_encoder(file: str) -> None:
    """Its times repeat now and then; the encoder's angle is differentiated as a smoothing spline."""
    loaded = loadmat(recording("mpu6050_encoder_stepper", file))
    stamps = regression(loaded["all_time"].ravel())
    assert 1 / stamps.period_s == pytest.approx(99.89, abs=0.01)
    rows = slice(3000, 33000)  # 300 s from second 30 on
    t_s = stamps.t_s[rows]
    angle_deg = smoothing_spline(t_s, loaded["all_encoder"].ravel()[rows], 16 * stamps.period_s**3)
    rate_dps = CubicSpline(t_s, angle_deg)(t_s, 1)
    gyro = np.column_stack([loaded[f"all_gyro_2_{a}"].ravel()[rows] for a in AXES])
    parts = [slice(k, k + 7500) for k in range(0, 30000, 7500)]
    runs = [make_run(t_s[p], gyro[p], axis="y", rate_ref_dps=rate_dps[p], rate_hz=100.0) for p in parts]
    model = fit(make_session(*runs, axis="y"), Model.builtin("default").with_term(Term("lag", "y")), axes="y").model
    lag, scale = model.term("lag", "y"), model.term("scale", "y")
    assert lag is not None
    assert scale is not None
    assert lag.values["tau_s"] == pytest.approx(0.012, abs=2.5 * lag.se["tau_s"])
    assert lag.se["tau_s"] < 0.001
    assert scale.values["scale"] == pytest.approx(-0.0148, abs=2.5 * scale.se["scale"])


@pytest.fixture(scope="module")
def broad(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, dict[str, np.ndarray]]:
    """A minute of a hand-held sensor before optical motion capture, imported as docs/references.md says."""
    raw = dict(np.load(recording("broad_optical_ref", "01_undisturbed_slow_rotation_A.npz")))
    rows = slice(17000, 34000)
    part = {"gyro": raw["gyr_rad_s"][rows], "quaternion": raw["opt_quat"][rows], "fs": raw["fs"]}
    folder = tmp_path_factory.mktemp("broad")
    names = ["gx", "gy", "gz", "qw", "qx", "qy", "qz"]
    table = pl.DataFrame(np.column_stack([part["gyro"], part["quaternion"]]), schema=names).fill_nan(None)
    table.write_csv(folder / "broad.csv")
    gyro = maps(*(f"g{a}_dps=g{a}:rad/s" for a in "xyz"), *(f"ref_q{c}=q{c}" for c in "wxyz"))
    assert main(["import", str(folder / "broad.csv"), str(folder / "broad"), "--rate-hz", str(float(raw["fs"])), *gyro]) == 0
    header = folder / "broad" / "session.toml"
    header.write_text(header.read_text() + '\n[reference]\nclock = "own"\n')
    return Session.open(folder / "broad"), part


@pytest.mark.wide
@pytest.mark.slow
def test_motion_capture_agrees_with_a_plain_least_squares_fit(broad: tuple[Session, dict[str, np.ndarray]]) -> None:
    session, raw = broad
    model = Model.builtin("default")
    for axis in AXES:
        model = model.add("misalignment", axis)
    found = fit(session, model)
    registration = found.session.runs[0].registration
    matrix = np.eye(3)
    for i, a in enumerate(AXES):
        matrix[i, i] += found.model.value("scale", a, "scale")
        for j, b in enumerate(AXES):
            matrix[i, j] += found.model.value("misalignment", a, f"m_{b}") if a != b else 0.0
    offset_s, own = own_fit(np.rad2deg(raw["gyro"]), raw["quaternion"], float(raw["fs"]))
    assert registration.offset_s == pytest.approx(offset_s, abs=5e-4)
    assert 0.003 < registration.offset_s < 0.0055  # its maker's figure is 4.0-4.5 ms
    np.testing.assert_allclose(matrix @ registration.matrix, own, atol=0.006)  # that fit's own halves differ by up to 0.011
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)


def own_fit(gyro_dps: np.ndarray, q: np.ndarray, rate_hz: float) -> tuple[float, np.ndarray]:
    """Offset and map [3, 3] of least squares on means over 0.1 s, by the angle between quaternions a block apart."""
    size = round(0.1 * rate_hz)
    best = (np.inf, 0.0, np.eye(3))
    t_s = np.arange(len(q)) / rate_hz
    known = np.isfinite(q).all(axis=1)
    slerp = Slerp(t_s[known], Rotation.from_quat(q[known][:, [1, 2, 3, 0]]))
    turned = np.cumsum(gyro_dps, axis=0) / rate_hz - gyro_dps / 2 / rate_hz
    at = np.arange(size, len(q) - 2 * size, size)
    whole = np.convolve(known, np.ones(2 * size), "same")[at + size // 2] > 2 * size - 0.5
    for offset_s in np.arange(0.0, 0.009, 0.0005):
        step = slerp(t_s[at] - offset_s).inv() * slerp(t_s[at + size] - offset_s)
        w = np.rad2deg(step.as_rotvec())[whole] * rate_hz / size
        y = (turned[at + size] - turned[at])[whole] * rate_hz / size
        columns = np.column_stack([w, np.ones(len(w))])
        solved, squares, *_ = np.linalg.lstsq(columns, y, rcond=None)
        if squares.sum() < best[0]:
            best = (float(squares.sum()), float(offset_s), solved[:3].T)
    return best[1:]
