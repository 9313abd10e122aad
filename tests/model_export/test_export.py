"""Export: torch to ONNX to int8 to C, for a net of another shape than the shipped one; malformed input."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal.calibration.network import Network, image
from gyrocal.cli import main
from gyrocal.core.verify import TOLERANCE, verify, windows
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal_firmware import INCLUDE


@pytest.fixture(autouse=True)
def _packages(require_module: Callable[[str], None]) -> None:
    require_module("torch")
    require_module("onnx")


def shipped(name: str) -> Path:
    import gyrocal

    return Path(gyrocal.__file__).parent / "data" / name


def test_onnxruntime_gives_the_numbers_of_torch(tiny_run: Path, tiny_files: Path) -> None:
    import torch

    from gyrocal_export.train import load

    net, _ = load(tiny_run)
    up, down = windows(Network.open(tiny_files / "model.onnx"), seed=3)
    finite = np.isfinite(up).all(1) & np.isfinite(down).all(1)
    with torch.no_grad():
        expected = net(torch.from_numpy(image(up, 78.0)), torch.from_numpy(image(down, -78.0))).numpy()[finite]
    y = Network.open(tiny_files / "model.onnx").estimate(up, down, 78.0, -78.0)[finite]
    assert len(y) >= 1000
    assert np.all(np.abs(y - expected) <= 3e-6 * np.ptp(expected, axis=0))

    net.down[1].weight.data[0, 0, 0, 0] *= -1
    with torch.no_grad():
        broken = net(torch.from_numpy(image(up, 78.0)), torch.from_numpy(image(down, -78.0))).numpy()[finite]
    assert np.any(np.abs(y - broken) > 3e-6 * np.ptp(expected, axis=0)), "a weight of the wrong sign is noticed"


def test_c_gives_the_numbers_of_the_quantised_graph(
    tiny_files: Path, tmp_path: Path, require_tool: Callable[[str], str]
) -> None:
    require_tool("cc")
    found = verify(tiny_files / "model.int8.onnx", tiny_files / "weights.h")
    assert found["max_diff_of_range"] <= TOLERANCE
    wrong = tmp_path / "weights.h"
    wrong.write_text((tiny_files / "weights.h").read_text().replace(".rate_hz = 145", ".rate_hz = 104"))
    with pytest.raises(InputError, match="export both together"):
        verify(tiny_files / "model.int8.onnx", wrong)
    assert verify(tiny_files / "model.int8.onnx")["ok"] is False, "another network's header is noticed"


def test_the_shipped_files_are_of_one_network() -> None:
    from gyrocal_export.export import shipped_header
    from gyrocal_export.graph import Graph
    from gyrocal_export.quantize import quantize

    quantised = quantize(Graph.open(shipped("paper.onnx")))
    assert quantised.SerializeToString(deterministic=True) == shipped("paper.int8.onnx").read_bytes()
    assert shipped_header() == (INCLUDE / "weights.h").read_text()


def test_the_graph_begins_with_clip_and_says_nothing_of_this_machine() -> None:
    import onnx

    for name in ("paper.onnx", "paper.int8.onnx"):
        graph = onnx.load(shipped(name)).graph
        for face in ("up", "down"):
            assert [node.op_type for node in graph.node if face in node.input] == ["Clip"]
        assert b"/" not in b"".join(bytes(str(node), "utf-8") for node in graph.node)
    codes = [i for i in onnx.load(shipped("paper.int8.onnx")).graph.initializer if i.data_type == onnx.TensorProto.INT8]
    assert len(codes) == 5, "every layer's weights are int8"


def test_exporting_twice_gives_the_same_bytes(tiny_run: Path, tiny_files: Path) -> None:
    from gyrocal_export.export import export_run

    for name, content in export_run(tiny_run).items():
        assert (tiny_files / name).read_bytes() == content


def test_batch_norm_is_folded_with_the_rounded_weights(tmp_path: Path) -> None:
    """A large mean of a channel, which BatchNorm takes away, must not come back as rounding times that mean."""
    import torch

    from gyrocal_export.graph import Graph
    from gyrocal_export.nets.paper import PaperNet, Shape
    from gyrocal_export.quantize import quantize
    from gyrocal_export.to_onnx import to_onnx

    torch.manual_seed(0)
    net = PaperNet(Shape(), 300.0, torch.zeros(2), torch.ones(2)).eval()
    for head, w_dps in ((net.up, 78.0), (net.down, -78.0)):
        head[0].running_mean[:] = torch.tensor([200.0, w_dps])
        head[0].running_var[:] = 0.01
    model = to_onnx(net, {"name": "paper", "rate_hz": "145", "table_dps": "78"})
    rng = np.random.default_rng(0)
    up, down = rng.normal(200.0, 0.1, (2, 50, 290))
    answers = []
    for name, graph in (("float", model), ("int8", quantize(Graph(model, "net")))):
        (tmp_path / name).write_bytes(graph.SerializeToString())
        answers.append(Network.open(tmp_path / name).estimate(up, down, 78.0, -78.0))
    exact, rounded = answers
    assert np.max(np.abs(exact - rounded)) < 0.02 * np.ptp(exact)


@pytest.mark.parametrize("damage", ["not onnx", "truncated", "another graph", "no metadata", "a float weight"])
def test_a_malformed_graph_is_one_line_of_bad_input(damage: str, tmp_path: Path) -> None:
    import onnx
    from onnx import numpy_helper

    from gyrocal_export.c_header import c_header
    from gyrocal_export.graph import Graph

    whole = shipped("paper.int8.onnx").read_bytes()
    model: Any = onnx.load_from_string(whole)
    if damage == "another graph":
        next(node for node in model.graph.node if node.op_type == "Tanh").op_type = "Sigmoid"
    if damage == "no metadata":
        model.ClearField("metadata_props")
    if damage == "a float weight":
        node = next(node for node in model.graph.node if node.op_type == "DequantizeLinear")
        model.graph.node.remove(node)
        model.graph.initializer.append(numpy_helper.from_array(np.zeros((4, 1, 1, 3), np.float32), node.output[0]))
    contents = {"not onnx": b"not onnx", "truncated": whole[: len(whole) // 2]}
    path = tmp_path / "net.onnx"
    path.write_bytes(contents.get(damage, model.SerializeToString()))
    with pytest.raises(InputError, match=r"net\.onnx") as caught:
        c_header(Graph.open(path))
    assert "\n" not in str(caught.value)


def test_a_shape_that_the_kernel_does_not_compute_is_refused(tmp_path: Path) -> None:
    import torch

    from gyrocal_export.c_header import c_header
    from gyrocal_export.graph import Graph
    from gyrocal_export.nets.paper import PaperNet, Shape
    from gyrocal_export.quantize import quantize
    from gyrocal_export.to_onnx import to_onnx

    net = PaperNet(Shape(head_pool=20), 1.0, torch.zeros(2), torch.ones(2)).eval()
    model = to_onnx(net, {"name": "paper", "rate_hz": "145", "table_dps": "78"})
    with pytest.raises(InputError, match="14 columns"):
        c_header(Graph(quantize(Graph(model, "net")), "net"))


def test_the_command_writes_all_files_or_none(
    tiny_run: Path, tiny_files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ["model.onnx", "model.int8.onnx", "model.json", "weights.h"]
    assert main(["export", "--run", str(tiny_run), "--out", str(tmp_path / "a"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"files": [str(tmp_path / "a" / name) for name in names], "left": []}
    assert all((tmp_path / "a" / name).read_bytes() == (tiny_files / name).read_bytes() for name in names)

    run = tmp_path / "run"
    run.mkdir()
    (run / "net.pt").write_bytes(b"no checkpoint")
    (run / "config.json").write_text('{"net": "paper"}')
    for broken in (run, tmp_path / "absent"):
        assert main(["export", "--run", str(broken), "--out", str(tmp_path / "b")]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert main(["export", "--model", str(tmp_path / "absent.toml"), "--out", str(tmp_path / "b")]) == 2
    assert not (tmp_path / "b").exists()
    (tmp_path / "c").write_text("a file")
    assert main(["export", "--out", str(tmp_path / "c")]) == 1
    assert (tmp_path / "c").read_text() == "a file"


def test_the_shipped_network_and_a_model_need_no_torch(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['torch'] = sys.modules['onnx'] = None\n"
        "from gyrocal.cli import main\n"
        f"sys.exit(main(['export', '--model', {str(tmp_path / 'm.toml')!r}, '--out', {str(tmp_path)!r}]))"
    )
    replace(Model.builtin("paper"), noise={"z": AxisNoise(0.04)}).save(tmp_path / "m.toml")
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.PIPE)
    assert (tmp_path / "calibration.h").is_file()
    assert (tmp_path / "model.int8.onnx").read_bytes() == shipped("paper.int8.onnx").read_bytes()
    assert (tmp_path / "gyrocal.int8.onnx").read_bytes() == shipped("gyrocal.int8.onnx").read_bytes()
    assert (tmp_path / "weights.h").read_text() == (INCLUDE / "weights.h").read_text()


def test_training_without_torch_says_what_to_install() -> None:
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "from gyrocal.cli import main\n"
        "sys.exit(main(['train', '--out', 'never']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pip install 'gyrocal[train]' --extra-index-url INDEX" in done.stderr


def test_the_verify_command(
    tiny_files: Path, capsys: pytest.CaptureFixture[str], require_tool: Callable[[str], str]
) -> None:
    require_tool("cc")
    assert main(["verify", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] is True
    assert found["windows"] >= 1000
    assert found["max_diff_of_range"] <= found["tolerance"]
    assert main(["verify", "--header", str(tiny_files / "weights.h"), "--trust", "--json"]) == 1
    captured = capsys.readouterr()
    assert json.loads(captured.out)["ok"] is False
    assert len(captured.err.splitlines()) == 1
    assert main(["verify", "--net", str(tiny_files / "model.json")]) == 2
    assert main(["verify", "--header", str(tiny_files / "model.json"), "--trust"]) == 2
