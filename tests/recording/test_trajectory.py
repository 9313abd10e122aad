"""Trajectories of other programs as a reference of orientation: the order of the quaternion's parts, headers, refusals."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import Imported, read_recording
from gyrocal.recording.second_file import SecondFile
from gyrocal.recording.session import Session

START_S = 1_305_031_098.5
T_S = np.arange(1200) / 100
RATE_DPS = np.array([12.0, -7.0, 30.0])
"""The body's true rate, which is constant in its own frame."""
U_S = np.arange(0, 11.9, 0.02)
Q = Rotation.from_rotvec(np.radians(RATE_DPS) * U_S[:, None]).as_quat()
"""Orientations x, y, z, w."""
PLACE = np.column_stack([np.sin(U_S), np.cos(U_S), 0.1 * U_S])
TUM = "timestamp tx ty tz qx qy qz qw"


@pytest.fixture
def imu(tmp_path: Path) -> Path:
    noise = np.random.default_rng(0).normal(0, 0.05, (T_S.size, 3))
    rows = np.column_stack([START_S + T_S, RATE_DPS + noise])
    np.savetxt(tmp_path / "imu.csv", rows, "%.6f", ",", header="time,gx,gy,gz", comments="")
    return tmp_path / "imu.csv"


def trajectory(imu: Path, head: str, columns: np.ndarray | None = None, separator: str = " ") -> Path:
    columns = np.column_stack([START_S + U_S, PLACE, Q]) if columns is None else columns
    path = imu.with_name("poses.txt")
    np.savetxt(path, columns, "%.9f", separator, header=head, comments="")
    return path


def read(imu: Path, poses: Path, **given: object) -> Imported:
    return read_recording(imu, Options(second=SecondFile(poses, (), **given)))  # type: ignore[arg-type]


def check(found: Imported) -> None:
    """The reference turns as the body does: another order of the parts gives other rates."""
    run = found.session.runs[0]
    rates = [np.nanmedian(run.about(axis).rate_dps) for axis in "xyz"]
    assert rates == pytest.approx(RATE_DPS, abs=0.02)


@pytest.mark.parametrize(
    "head",
    [
        f"# {TUM}",
        f"#{TUM}",
        TUM,
        f"# ground truth trajectory\n# file: 'rgbd_dataset.bag'\n# {TUM}",
        "# ground truth trajectory\n# file: 'rgbd_dataset.bag'",
        "",
    ],
)
@pytest.mark.parametrize("separator", [" ", ",", "\t"])
def test_a_tum_trajectory_is_read_with_and_without_its_header(imu: Path, head: str, separator: str) -> None:
    named = head.replace(TUM, TUM.replace(" ", separator)).strip()
    poses = trajectory(imu, named, separator=separator)
    poses.write_text(poses.read_text().lstrip("\n"))
    found = read(imu, poses)
    check(found)
    assert ("--ref-columns" in {g.option for g in found.guessed}) == ("qw" not in head)


def test_the_guess_of_a_trajectory_can_be_stated_as_it_is_shown(imu: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses, out = trajectory(imu, "# 50 Hz").rename(imu.with_name("a.txt")), imu.with_name("out")
    command = ["import", str(imu), str(out), "--reference", str(poses)]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert f"--ref-columns '{TUM.replace(' ', ',')}' --ref-map 't_s=timestamp:s' --ref-map 'ref_qw=qw'" in said
    import shlex

    words = shlex.split(said.partition("change it: ")[2])
    assert main([*command, *words]) == 0
    assert Session.open(out).runs[0].table["ref_qw"][0] == pytest.approx(Q[0, 3], abs=1e-6)


def test_another_order_is_stated_by_the_columns(imu: Path) -> None:
    names = ["t", "x", "y", "z", "qw", "qx", "qy", "qz"]
    poses = trajectory(imu, "# w first", np.column_stack([START_S + U_S, PLACE, Q[:, [3, 0, 1, 2]]]))
    check(read(imu, poses, names=names))


def test_the_ground_truth_of_euroc_is_its_orientation_and_not_the_bias_of_its_gyroscope(imu: Path) -> None:
    head = (
        "#timestamp,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],v_RS_R_x [m s^-1],"
        "v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1]"
    )
    still = np.tile([0.0, 0, 0, 0.001, 0.002, 0.003], (U_S.size, 1))
    columns = np.column_stack([START_S + U_S, PLACE, Q[:, [3, 0, 1, 2]], still])
    found = read(imu, trajectory(imu, head, columns, ","))
    assert "ref_qw=q_RS_w []" in {g.map for g in found.guessed}
    check(found)
    with pytest.raises(InputError, match="no time and reference are recognized"):
        read(imu, trajectory(imu, ",".join([head.split(",")[0], *head.split(",")[-3:]]), columns[:, [0, -3, -2, -1]], ","))


def test_poses_of_kitti_say_that_their_times_are_missing(imu: Path) -> None:
    poses = np.concatenate([Rotation.from_quat(Q).as_matrix(), PLACE[:, :, None]], axis=2).reshape(-1, 12)
    with pytest.raises(InputError, match=r"poses of KITTI, which have no times; .* of times.txt as a row of TUM: timestamp tx"):
        read(imu, trajectory(imu, "", poses))


def test_what_is_advised_for_a_reference_serves_its_file(imu: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``--columns`` names the columns of the sensor's file."""
    numbers = np.column_stack([START_S + U_S, 40 * U_S, 0 * U_S])
    for maps in ([], ["--ref-map", "t_s=t", "--ref-map", "ref_angle_deg=enc"]):
        path = trajectory(imu, "# an encoder", numbers, ",")
        assert main(["import", str(imu), str(imu.with_name("out")), "--reference", str(path), *maps]) == 2
        said = capsys.readouterr().err
        assert "--ref-columns" in said
        assert "--columns" not in said
        assert "--map" not in said
        assert "gx" not in said
    command = ["import", str(imu), str(imu.with_name("out")), "--reference", str(path), *maps, "--ref-columns", "t,enc,flag"]
    assert main([*command, "--yes"]) == 0
    assert "ref_angle_deg" in Session.open(imu.with_name("out")).runs[0].table.columns
    assert main(["import", str(imu), str(imu.with_name("new")), "--ref-columns", "t,enc"]) == 2
    assert "--ref-columns takes columns of a second file" in capsys.readouterr().err


@pytest.mark.parametrize("place", ["times.txt", "poses/times.txt"])
def test_poses_of_kitti_have_the_times_of_the_file_beside_them(imu: Path, place: str) -> None:
    matrices = np.concatenate([Rotation.from_quat(Q).as_matrix(), PLACE[:, :, None]], axis=2).reshape(-1, 12)
    poses = trajectory(imu, "", matrices)
    (imu.parent / place).parent.mkdir(exist_ok=True)
    np.savetxt(imu.parent / place, START_S + U_S, "%.6f")
    check(read(imu, poses))
    np.savetxt(imu.parent / place, START_S + U_S[:-3], "%.6f")
    with pytest.raises(InputError, match=r"times.txt: \d+ times, and .*poses.txt has \d+ poses"):
        read(imu, poses)


@pytest.mark.parametrize("names", ["QUATERNION_{}", "q{}", "rigid.rot[{}]"])
def test_numbers_from_zero_are_w_x_y_and_z(imu: Path, names: str) -> None:
    head = ",".join(["time", *(names.format(i) for i in range(4))])
    found = read(imu, trajectory(imu, head, np.column_stack([START_S + U_S, Q[:, [3, 0, 1, 2]]]), ","))
    assert {f"ref_q{part}={names.format(i)}" for i, part in enumerate("wxyz")} <= {g.map for g in found.guessed}
    check(found)


@pytest.mark.parametrize("names", ["r{}{}", "R{}{}", "rot_{}_{}", "m[{}][{}]"])
@pytest.mark.parametrize("first", [0, 1])
def test_a_rotation_matrix_is_an_orientation(imu: Path, names: str, first: int) -> None:
    cells = Rotation.from_quat(Q).as_matrix().reshape(-1, 9)
    head = ",".join(["time", *(names.format(i + first, j + first) for i in range(3) for j in range(3))])
    found = read(imu, trajectory(imu, head, np.column_stack([START_S + U_S, cells]), ","))
    assert "ref_qw=matrix.qw" in {g.map for g in found.guessed}
    check(found)


@pytest.mark.parametrize("name", ["rots", "R", "rotmat"])
@pytest.mark.parametrize("last", [True, False])
def test_rotation_matrices_of_a_mat_file_are_orientations(imu: Path, name: str, last: bool) -> None:
    """Matrices [3, 3, n] or [n, 3, 3] were no columns at all."""
    matrices = Rotation.from_quat(Q).as_matrix()
    path = imu.parent / "poses.mat"
    savemat(path, {name: np.moveaxis(matrices, 0, -1) if last else matrices, "ts": START_S + U_S})
    found = read(imu, path)
    assert "ref_qw=matrix.qw" in {g.map for g in found.guessed}
    check(found)


def test_a_rotation_matrix_of_zeros_is_missing(imu: Path) -> None:
    """A tracker that lost the body wrote two of them, and the whole reference was refused."""
    cells = Rotation.from_quat(Q).as_matrix().reshape(-1, 9)
    cells[[5, 40]] = 0.0
    head = ",".join(["time", *(f"r{i}{j}" for i in "123" for j in "123")])
    found = read(imu, trajectory(imu, head, np.column_stack([START_S + U_S, cells]), ","))
    assert "ref_qw=matrix.qw" in {g.map for g in found.guessed}
    check(found)


def test_nine_columns_that_are_no_rotation_are_no_reference(imu: Path) -> None:
    cells = -Rotation.from_quat(Q).as_matrix().reshape(-1, 9)
    head = ",".join(["time", *(f"r{i}{j}" for i in "123" for j in "123")])
    with pytest.raises(InputError, match="no time and reference are recognized"):
        read(imu, trajectory(imu, head, np.column_stack([START_S + U_S, cells]), ","))
