"""The shipped network on the host: what it takes, what it refuses, and that it is worth shipping."""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration.network import FaceNetwork, Network
from gyrocal.calibration.network_answer import TRAINED_DPS, TRAINED_HZ
from gyrocal.calibration.runtime import onnxruntime
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import paper_windows

SHIPPED = Path(str(files("gyrocal"))) / "data"


def test_the_contract_of_the_graph() -> None:
    for name in ("paper.onnx", "paper.int8.onnx"):
        session = onnxruntime().InferenceSession(SHIPPED / name)
        assert [(i.name, i.type, i.shape) for i in session.get_inputs()] == [
            (face, "tensor(float)", ["N", 1, 2, 290]) for face in ("up", "down")
        ]
        assert [(o.name, o.type, o.shape[1]) for o in session.get_outputs()] == [("y", "tensor(float)", 2)]


def test_it_beats_the_mean_and_the_baseline_on_scenarios_it_never_saw() -> None:
    net = Network.shipped()
    data = paper_windows(2000, seed=987_654)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    up, down = (data[face].reshape(-1, net.window) for face in ("up", "down"))
    y = net.estimate(up, down, data["w_up_dps"], data["w_down_dps"]).reshape(2000, 3, 2)
    means = data["up"].mean(1), data["down"].mean(1)
    baseline = np.column_stack([(means[0] - means[1]) / 156.0, (means[0] + means[1]) / 2])
    error, of_mean, of_baseline = (np.abs(v - truth).mean(0) for v in (y.mean(1), truth.mean(0), baseline))
    assert np.all(error < 0.75 * of_mean)
    assert np.all(error < 0.85 * of_baseline)


def test_the_signs_of_both_outputs() -> None:
    """A reading that is higher on both faces means more bias; higher up and lower down, more scale."""
    net = Network.shipped()
    quiet = np.full((1, 290), 0.26), np.full((1, 290), -0.36)
    scale, bias = net.estimate(*quiet, 78.0, -78.0)[0]
    more_bias = net.estimate(quiet[0] + 0.05, quiet[1] + 0.05, 78.0, -78.0)[0]
    more_scale = net.estimate(quiet[0] + 0.05, quiet[1] - 0.05, 78.0, -78.0)[0]
    assert more_bias[1] - bias > 0.01
    assert more_scale[0] - scale > 0.01 / 78
    assert abs(more_bias[0] - scale) < 0.005 / 78
    assert abs(more_scale[1] - bias) < 0.005


def test_the_clip_leaves_the_training_range_alone() -> None:
    net = Network.shipped()
    x = np.zeros((1, 290), np.float32)
    answers = [net.estimate(x + v, x, 78.0, -78.0)[0, 1] for v in (0.0, 0.3, 0.6, 0.9)]
    assert np.all(np.diff(answers) != 0)
    assert np.array_equal(net.estimate(x + 1e30, x, 78.0, -78.0), net.estimate(x + np.inf, x, 78.0, -78.0))


def test_how_it_was_made_is_beside_it() -> None:
    made = json.loads((SHIPPED / "paper.json").read_text())
    assert made["command"].startswith("gyrocal train")
    assert {"torch", "gyrocal", "numpy", "python"} <= set(made["versions"])
    assert {row["method"] for row in made["metrics"]["errors"]} == {"net", "mean", "baseline"}


@pytest.mark.parametrize("content", [b"", b"no onnx", b"\x08\x07\x12\x00"])
def test_a_malformed_file_is_one_line_of_bad_input(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "net.onnx"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"net\.onnx") as caught:
        Network.open(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no such file"):
        Network.open(tmp_path / "absent.onnx")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_truncated_file_is_bad_input(share: float, tmp_path: Path) -> None:
    whole = (SHIPPED / "paper.int8.onnx").read_bytes()
    path = tmp_path / "net.onnx"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"net\.onnx"):
        Network.open(path)


def test_what_is_known_of_the_training_without_onnxruntime_is_what_the_graph_states() -> None:
    net = FaceNetwork.shipped()
    assert (net.rate_hz, net.table_dps) == (TRAINED_HZ, TRAINED_DPS)
