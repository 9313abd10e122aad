"""Units that no name states: decided by gravity, a stated motion or noise, and asked for where none of them decides."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.column_map import Scaling
from gyrocal.recording.guess import guess
from gyrocal.recording.guess_units import Known
from gyrocal.recording.session import Session
from gyrocal.recording.source import Source

N = 6000
T_S = np.arange(N) / 100


def tumbled(size_dps: float, acc: float, unit: float, rng: np.random.Generator) -> pl.DataFrame:
    """A sensor that is turned to and fro about changing axes, by hand, with gravity as its accelerometer shows it."""
    from scipy.spatial.transform import Rotation

    phases = rng.uniform(0, 6.28, 3)
    rate_dps = size_dps * np.sin(2 * np.pi * np.outer(T_S, [0.31, 0.43, 0.23]) + phases)
    turn = Rotation.identity()
    up = np.empty((N, 3))
    for k, step in enumerate(Rotation.from_rotvec(np.radians(rate_dps) / 100)):
        up[k] = turn.inv().apply([0, 0, 1])
        turn = turn * step
    gyro = unit * (rate_dps + np.array([0.8, -0.5, 0.3]) + rng.normal(0, 0.1, (N, 3)))
    shaken = acc * (up + rng.normal(0, 0.01, (N, 3)))
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    return pl.DataFrame(np.column_stack([T_S, gyro, shaken]), schema=names)


@pytest.mark.parametrize("acc", [1.0, 9.80665, 0.62])
@pytest.mark.parametrize(("unit", "one"), [("dps", 1.0), ("rad/s", np.pi / 180)])
@pytest.mark.parametrize("size_dps", [8.0, pytest.param(30.0, marks=pytest.mark.wide)])
def test_gravity_decides_and_the_unit_of_the_accelerometer_does_not(size_dps: float, unit: str, one: float, acc: float) -> None:
    found = guess(Source("a.csv", tumbled(size_dps, acc, one, np.random.default_rng(1))), Scaling())
    mine = [g for g in found if g.map.startswith("g")]
    assert [g.map for g in mine] == [f"g{a}_dps=g{a}:{unit}" for a in "xyz"]
    assert all("as gravity does" in g.why and not g.asks for g in mine)


def test_a_wrong_scale_of_the_accelerometer_is_told_and_not_mended() -> None:
    found = guess(Source("a.csv", tumbled(20.0, 0.62, 1.0, np.random.default_rng(1))), Scaling())
    ax = next(g for g in found if g.map.startswith("ax_g"))
    assert ax.map == "ax_g=ax:g"
    assert "the scale of this accelerometer is wrong" in ax.why


@pytest.mark.parametrize("count_mdps", [8.75, 70.0])
def test_whole_multiples_of_a_count_of_st_s_parts_are_mdps(count_mdps: float) -> None:
    """Their drivers write mdps; readings of 910 and -700 were taken for deg/s, or for counts."""
    table = tumbled(20.0, 1000.0, 1.0, np.random.default_rng(1))
    written = table.with_columns((pl.col(f"g{a}") * 1000 / count_mdps).round() * count_mdps for a in "xyz")
    mine = [g for g in guess(Source("a.csv", written), Scaling()) if g.map.startswith("g")]
    assert [g.map for g in mine] == [f"g{a}_dps=g{a}:mdps" for a in "xyz"]
    assert not any(g.asks for g in mine)


def test_counts_and_degrees_are_no_multiples_of_a_count_in_mdps() -> None:
    table = tumbled(20.0, 1.0, 1.0, np.random.default_rng(1))
    counts = table.with_columns((pl.col(f"g{a}") / 0.07).round() for a in "xyz")
    with pytest.raises(InputError, match="raw counts"):
        guess(Source("a.csv", counts), Scaling())
    degrees = counts.with_columns(pl.col(f"g{a}") * 0.07 for a in "xyz")
    assert {g.map for g in guess(Source("a.csv", degrees), Scaling())} >= {f"g{a}_dps=g{a}:dps" for a in "xyz"}


def accelerations(kind: str) -> pl.DataFrame:
    """The rim of a wheel that rests now and then, or a phone's without gravity, of one who walks and stands, m/s2."""
    rng = np.random.default_rng(2)
    if kind == "wheel":
        rate_dps = 900 * np.clip(2 * np.sin(T_S / 8) + 1, 0, 1)
        angle = np.cumsum(np.radians(rate_dps)) / 100
        acc = np.column_stack([-0.15 * np.radians(rate_dps) ** 2, 9.81 * np.sin(angle), 9.81 * np.cos(angle)])
    else:
        rate_dps = 30 * np.sin(T_S)
        acc = np.exp(1.5 * np.sin(T_S / 3))[:, None] * rng.normal(0, 0.65, (N, 3))
    rates = np.column_stack([rate_dps, 0.3 * rate_dps, 0.2 * rate_dps]) + rng.normal(0, 0.1, (N, 3))
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    return pl.DataFrame(np.column_stack([T_S, rates, acc + rng.normal(0, 0.05, (N, 3))]), schema=names)


def test_what_a_wheel_adds_to_gravity_is_no_other_unit() -> None:
    """Half of its accelerations exceed 2 g, and m/s2 were taken for thousandths of g."""
    table = accelerations("wheel")
    assert np.median(np.linalg.norm(table[["ax", "ay", "az"]].to_numpy(), axis=1)) > 2 * 9.81
    ax = next(g for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("ax_g"))
    assert ax.map == "ax_g=ax:m/s2"
    assert "wrong" not in ax.why


def test_accelerations_without_gravity_are_not_taken_for_g() -> None:
    """Their median is 1 m/s2, which looks like 1 g, but they go up and down as gravity does not."""
    table = accelerations("phone")
    assert 0.8 < np.median(np.linalg.norm(table[["ax", "ay", "az"]].to_numpy(), axis=1)) < 1.25
    assert not [g for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("a")]


def test_what_a_filter_leaves_of_gravity_is_no_accelerometer_with_a_wrong_scale() -> None:
    """A part's linear acceleration at rest, 0.33 m/s2 along z, was taken for gravity."""
    rng = np.random.default_rng(5)
    columns = np.column_stack([T_S, rng.normal(0, 0.1, (N, 3)), rng.normal([0, 0, -0.33], 0.02, (N, 3))])
    table = pl.DataFrame(columns, schema=["ms", "gx", "gy", "gz", "ax", "ay", "az"]).with_columns(1000 * pl.col("ms"))
    found = guess(Source("a.csv", table), Scaling())
    assert [g.map for g in found if g.map.startswith(("t", "a"))] == ["t_s=ms:ms"]


def test_a_counter_of_samples_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whether a stamp that goes on by one is a sample or a millisecond, nothing in the file says."""
    table = turned(20.0).with_columns(pl.int_range(pl.len()).alias("Timestamp")).drop("t")
    table.rename({f"g{a}": f"Gyro_{a}_deg_per_s" for a in "xyz"}).write_csv(tmp_path / "ble.csv")
    args = ["import", str(tmp_path / "ble.csv"), str(tmp_path / "out"), "--rate", "20", "--json"]
    assert main(args) == 2
    told = capsys.readouterr().err
    assert "Timestamp is not known (it goes on by one: it counts the samples, or ms with 1000 samples a second)" in told
    for option, rate_hz in (["--rate-hz", "50"], 50.0), (["--map", "t_s=Timestamp:ms"], 1000.0):
        assert main([*args, *option]) == 0
        assert json.loads(capsys.readouterr().out)["sample_rate_hz"] == pytest.approx(rate_hz)
        shutil.rmtree(tmp_path / "out")


@pytest.mark.parametrize("first", ["slow", "fast"])
def test_the_files_of_a_folder_have_one_unit(first: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A slow run's unit nothing decides: it became rad/s beside dps of the others, and nobody was asked."""
    rng = np.random.default_rng(4)
    acc = rng.normal([0, 0, 9.81], 1.5, (N, 3))
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    for kind, size_dps in (("slow", 9.0), ("fast", 300.0)):
        rates = size_dps * np.column_stack([np.sin(T_S), 0.3 * np.sin(0.7 * T_S), 0.2 * np.cos(T_S)])
        table = pl.DataFrame(np.column_stack([T_S, rates + rng.normal(0, 0.06, (N, 3)), acc]), schema=names)
        table.write_csv(tmp_path / f"{'a' if kind == first else 'b'}_{kind}.csv")
    args = [str(tmp_path), str(tmp_path / "out"), "--rate", "0", "--json"]
    assert main(["import", *args]) == 0
    assert "gx_dps=gx:dps" in json.loads(capsys.readouterr().out)["guessed"]
    largest = sorted(float(np.abs(run.gyro_dps).max()) for run in Session.open(tmp_path / "out").runs)
    assert largest == pytest.approx([9, 300], rel=0.05)
    shutil.rmtree(tmp_path / "out")
    (fast,) = tmp_path.glob("*_fast.csv")
    fast.unlink()
    shutil.copy(next(tmp_path.glob("*_slow.csv")), tmp_path / "c_slow.csv")
    assert main(["import", *args]) == 2
    assert re.search(r"\w_slow\.csv: the unit of gx is not known", capsys.readouterr().err)


def turned(rate: float) -> pl.DataFrame:
    """A turn about z at a constant rate, without an accelerometer."""
    rates = np.random.default_rng(0).normal([0, 0, rate], 0.02 * rate, (N, 3))
    return pl.DataFrame(np.column_stack([T_S, rates]), schema=["t", "gx", "gy", "gz"])


@pytest.mark.parametrize("stated", ["--run=a:100:2500:rate=25", "--run=a:1s:25s:rate=25", "--rates=25,-10"])
@pytest.mark.parametrize(("one", "unit"), [(1.0, "dps"), (np.pi / 180, "rad/s")])
def test_the_rates_of_runs_decide(
    stated: str, one: float, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table that turns to and fro, whose rates are stated: it was asked for the unit."""
    rng = np.random.default_rng(3)
    rates = np.where(T_S < 30, 25.0, -10.0)[:, None] * [0.02, -0.01, 1.0] + rng.normal(0, 0.3, (N, 3))
    columns = np.column_stack([T_S, one * rates, rng.normal([0.01, -0.01, 1.0], 0.002, (N, 3))])
    path = tmp_path / "log.csv"
    pl.DataFrame(columns, schema=["t", "gx", "gy", "gz", "ax", "ay", "az"]).write_csv(path)
    args = ["import", str(path), str(tmp_path / "out"), stated, "--yes", "--json"]
    assert main(args) == 0
    assert f"gz_dps=gz:{unit}" in json.loads(capsys.readouterr().out)["guessed"]


@pytest.mark.parametrize(("rate", "unit"), [(20.0, "dps"), (np.radians(20), "rad/s")])
@pytest.mark.parametrize("known", [Known(rate_dps=-20.0), Known(reference_dps=lambda: 19.0)])
def test_a_known_motion_decides(rate: float, unit: str, known: Known) -> None:
    found = next(g for g in guess(Source("a.csv", turned(rate)), Scaling(), known=known) if g.map.startswith("gz"))
    assert found.map == f"gz_dps=gz:{unit}"
    assert not found.asks


@pytest.mark.parametrize(("noise", "unit"), [(0.0008, "rad/s"), (0.12, "dps")])
def test_the_noise_at_rest_decides(noise: float, unit: str) -> None:
    rates = np.random.default_rng(0).normal([0.01, 0.02, -0.01], noise, (N, 3))
    table = pl.DataFrame(np.column_stack([T_S, rates]), schema=["t", "gx", "gy", "gz"])
    found = next(g for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("gz"))
    assert found.map == f"gz_dps=gz:{unit}"
    assert not found.asks


@pytest.mark.parametrize("consent", ["--yes", "--json"])
def test_what_nothing_decides_is_asked_for(consent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    turned(1.0).write_csv(tmp_path / "log.csv")
    command = ["import", str(tmp_path / "log.csv"), str(tmp_path / "out"), "--rate", "0"]
    assert main([*command, consent]) == 2
    said = capsys.readouterr().err
    assert "the unit of gx is not known" in said
    assert "--map 'gz_dps=gz:dps', or :rad/s in each" in said
    assert not (tmp_path / "out").exists()
    maps = [part for a in "xyz" for part in ("--map", f"g{a}_dps=g{a}:rad/s")]
    assert main([*command, "--map", "t_s=t", *maps, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["guessed"] == []


@pytest.mark.parametrize(
    ("word", "unit"),
    [(word, "mdps") for word in ("mdps", "mDeg", "mdeg/s", "mDeg/sec", "milli-deg/s", "millidps", "m°/s", "mdeg s^-1")]
    + [(word, "mrad/s") for word in ("mrad/s", "mrad", "mRad/sec", "millirad/s", "mrad s^-1")],
)
def test_a_thousandth_of_a_unit_in_a_name_is_understood(word: str, unit: str) -> None:
    """A BMI160 logged in mDeg is no table of raw counts up to a million."""
    names = ["t [ms]", *(f"bmi160_g_{axis}[{word}]" for axis in "xyz")]
    rates = np.random.default_rng(8).integers(-1_300_000, 1_300_000, (100, 3))
    table = pl.DataFrame(np.column_stack([4 * np.arange(100), rates]), schema=names)
    found = {g.map for g in guess(Source("a.csv", table), Scaling())}
    assert {f"gx_dps={names[1]}:{unit}", f"gz_dps={names[3]}:{unit}"} <= found
    with pytest.raises(InputError, match=r"up to 1\.2[0-9]*e\+06, more than a reading of 16 bits; say their unit"):
        guess(Source("a.csv", table.rename(dict(zip(names[1:], ("gx", "gy", "gz"), strict=True)))), Scaling())


def test_a_thousandth_of_an_angle_is_no_rate() -> None:
    table = pl.DataFrame({"t [s]": np.arange(100) / 100, **{f"gyr_{axis} [dps]": np.zeros(100) for axis in "xyz"}})
    for name, mapped in (("encoder_angle [mdeg]", "ref_angle_deg=encoder_angle [mdeg]:mdeg"), ("encoder [mrad]", None)):
        found = {g.map for g in guess(Source("a.csv", table.with_columns(pl.lit(1.0).alias(name))), Scaling())}
        assert {text for text in found if "encoder" in text} == ({mapped} if mapped else set())


def _as_rostopic(again: int) -> pl.DataFrame:
    """A boat at 4 Hz in rad/s, whose motion is too fast for these samples and looks white; rows are written several times."""
    rng = np.random.default_rng(4)
    sizes = np.repeat([0.1, 0.3, 0.2], 70)[:, None]
    t_ns = (1_783_583_646_000_000_000 + 250_000_000 * np.arange(210)).repeat(again)
    names = [f"field.angular_velocity.{a}" for a in "xyz"]
    rates = pl.DataFrame((sizes * rng.normal(0, 1, (210, 3)) * [0.1, 1, 1]).repeat(again, axis=0), schema=names)
    up = pl.DataFrame(rng.normal([0, 0, 9.8], 0.1, (210, 3)).repeat(again, axis=0), schema=[f"acc_{a}" for a in "xyz"])
    return pl.concat([pl.DataFrame({"time": t_ns}), rates, up], how="horizontal")


@pytest.mark.parametrize("again", [1, 25])
def test_the_path_of_a_field_in_a_ros_message_defines_its_unit(again: int) -> None:
    """A table of ``rostopic echo -p`` whose rows are written 25 times was told as 100 Hz, and its unit as not known."""
    found = guess(Source("a.csv", _as_rostopic(again)), Scaling())
    assert "gx_dps=field.angular_velocity.x:rad/s" in {g.map for g in found if not g.asks}
    assert "make 4 samples a second" in found[0].why


def test_a_motion_that_looks_white_is_no_noise_of_a_sensor_in_dps() -> None:
    """Its size changes from minute to minute, which noise does not."""
    table = _as_rostopic(1).rename(lambda name: name.replace("field.angular_velocity.", "gyro_"))
    assert all(g.asks for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("g"))


@pytest.mark.parametrize(("unit", "one"), [("dps", 1.0), ("rad/s", np.pi / 180)])
def test_a_steady_turn_that_gravity_does_not_show_is_a_bias_in_dps(unit: str, one: float) -> None:
    """A cart that is shaken now and then, whose bias of 2 dps would be 125 dps in rad/s; a turntable in rad/s is none such."""
    rng = np.random.default_rng(6)
    shaken = 3.0 * (T_S < 6)[:, None]
    up = np.array([0.2, 0.3, 9.7]) + rng.normal(0, 0.05 + shaken, (N, 3))
    rates = np.array([-2.2, 0.0, -1.1]) + rng.normal(0, 0.15 + 0.2 * shaken, (N, 3))
    if unit == "rad/s":
        angle = np.radians(125.0 * T_S)
        rates = one * (np.array([125.0, 0.0, 0.0]) + rng.normal(0, 0.15, (N, 3)))
        up = np.column_stack([0 * angle, 9.8 * np.sin(angle), 9.8 * np.cos(angle)]) + rng.normal(0, 0.05, (N, 3))
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    found = guess(Source("a.csv", pl.DataFrame(np.column_stack([T_S, rates, up]), schema=names)), Scaling())
    assert ("gx_dps=gx:dps" in {g.map for g in found if not g.asks}) == (unit == "dps")


@pytest.mark.parametrize("one", [1.0, 9.80665])
def test_the_unit_of_an_accelerometer_is_that_where_it_is_still(one: float) -> None:
    """One that is shaken for most of the time was not recognized at all, and then asked for."""
    rng = np.random.default_rng(7)
    acc = one * (np.array([0.1, -0.2, 0.97]) + rng.normal(0, 1, (N, 3)) * np.where(T_S < 2, 0.01, 1.2)[:, None])
    rates = rng.normal(0, 1, (N, 3)) * np.where(T_S < 2, 0.1, 90.0)[:, None]
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    found = guess(Source("a.csv", pl.DataFrame(np.column_stack([T_S, rates, acc]), schema=names)), Scaling())
    assert f"az_g=az:{'g' if one == 1.0 else 'm/s2'}" in {g.map for g in found}
