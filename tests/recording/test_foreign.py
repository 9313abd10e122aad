"""Files of formats that are not read are answered with the tool that converts them."""

import sqlite3
from pathlib import Path

import pytest

from gyrocal.cli import main


@pytest.mark.parametrize(
    ("name", "content", "tool"),
    [
        ("a.bin", b"\xa3\x95\x80\x80" + bytes(4000), "mavlogdump.py --format csv --types IMU"),
        ("a.log", b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n" * 9, "mavlogdump.py --format csv"),
        ("a.bbl", b"H Product:Blackbox flight data recorder\nH Data version:2\n", "blackbox_decode"),
    ],
)
@pytest.mark.parametrize("verb", ["import", "apply", "info"])
def test_logs_of_autopilots(
    name: str, content: bytes, tool: str, verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    model = tmp_path / "m.toml"
    model.write_text('format = "gyrocal-model/1"\neffects = [{ id = "bias", axis = "z", bias_dps = 0.5 }]\n')
    applied = ["--model", str(model), "-o", str(tmp_path / "o.csv"), "--yes"]
    more = {"import": [str(tmp_path / "out"), "--yes"], "apply": applied}
    assert main([verb, str(tmp_path / name), *more.get(verb, [])]) == 2
    err = capsys.readouterr().err
    assert tool in err
    assert str(tmp_path / name) in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_data_of_a_ros_2_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with sqlite3.connect(tmp_path / "bag_0.db3") as database:
        database.execute("create table topics (name text)")
    assert main(["import", str(tmp_path / "bag_0.db3"), str(tmp_path / "out"), "--yes"]) == 2
    assert f"ros2 bag reindex {tmp_path}" in capsys.readouterr().err
