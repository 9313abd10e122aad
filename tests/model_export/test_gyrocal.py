"""Network gyrocal: merging two Gaussians, training on what a model says, float ONNX = torch, files of a run."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gyrocal
from answers import check
from gyrocal.calibration import limit
from gyrocal.calibration.network import STAGES_S, FaceNetwork
from gyrocal.calibration.scenarios import Faces, Protocol, Simulation, block_means
from gyrocal.cli import main
from gyrocal.core.networks import CoreFaceNetwork
from gyrocal.core.verify import counts, verify
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.simulation.simulate import LSB_DPS, paper_windows
from parity.fixed_point import FixedNetwork


@pytest.fixture(autouse=True)
def _packages(require_module: Callable[[str], None]) -> None:
    require_module("torch")
    require_module("onnx")


def small(**more: Any) -> Any:
    """A smaller network, trained for seconds."""
    from gyrocal_export.nets.gyrocal import GyrocalShape
    from gyrocal_export.train_gyrocal import GyrocalConfig

    shape = GyrocalShape(first_channels=5, first_kernel=4, second_channels=3, second_kernel=4, second_pool=3, hidden=9)
    few = {"faces": 64, "validation_faces": 400, "range_faces": 40_000, "test_scenarios": 400, "settling_steps": 50}
    return GyrocalConfig(epochs=1, shape=shape, **(few | more))


@pytest.fixture
def smallest(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """A network of a few steps: how it was drawn is seen in its weights, however good they are."""
    monkeypatch.setattr("gyrocal_export.train_gyrocal.STEPS_AN_EPOCH", 20)
    return lambda **more: small(validation_faces=64, range_faces=2000, test_scenarios=16, settling_steps=2, **more)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, require_module: Callable[[str], None]) -> Path:
    """A run folder of a smaller network, trained for a quarter of an epoch: files and formats say nothing of its errors."""
    require_module("torch")
    from gyrocal_export import train_gyrocal

    out = tmp_path_factory.mktemp("runs") / "small"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train_gyrocal, "STEPS_AN_EPOCH", 100)
        train_gyrocal.train_gyrocal(small(), out, lambda *_: None)
    return out


@pytest.fixture(scope="module")
def exported(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from gyrocal_export.export import export_run
    from gyrocal_export.files import write_all

    out = tmp_path_factory.mktemp("export")
    write_all(out, export_run(run))
    return out


def fitted_model() -> Model:
    """A sensor with drift and a rippling table, as `gyrocal add` leaves it."""
    values = {
        "scale": {"scale": 0.002}, "bias": {"bias_dps": 0.1}, "table_ripple": {"amplitude_1": 0.001},
    }  # fmt: skip
    noise = AxisNoise(0.04, Drift(0.002, 30.0), TurnOnBias(0.03), TurnOnScale(0.001))
    return Model("m", tuple(Term(name, "z", own) for name, own in values.items()), {"z": noise})


def test_onnxruntime_gives_the_numbers_of_torch(run: Path, exported: Path) -> None:
    import torch

    from gyrocal_export.train_gyrocal import load

    net, _ = load(run)
    onnx = FaceNetwork.open(exported / "model.onnx")
    data = paper_windows(1000, 4)
    for stage in range(3):
        y = data["up"][:, : onnx.samples(stage)].astype(float)
        got = onnx.infer(y, stage, 78.0)
        readings = np.zeros((1000, 1, 870), np.float32)
        readings[:, 0, : y.shape[1]] = y - y.mean(1, keepdims=True)
        with torch.no_grad():
            want = net(torch.from_numpy(readings), torch.eye(3)[stage].expand(1000, 3)).numpy()
        assert np.all(np.abs(got - want) <= 3e-6 * np.ptp(want, axis=0))


def test_weights_are_settled_on_the_int8_that_is_exported(exported: Path) -> None:
    """Float and quantised graph are one network: rounding costs nothing."""
    data = paper_windows(200, 5)
    nets = [FaceNetwork.open(exported / name) for name in ("model.onnx", "model.int8.onnx")]
    for stage in range(3):
        y = data["down"][:, : nets[0].samples(stage)]
        one, other = (net.infer(y, stage, -78.0) for net in nets)
        np.testing.assert_allclose(one, other, atol=1e-5 * np.ptp(one))


def test_a_run_of_another_shape_goes_to_c(exported: Path, require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    assert verify(exported / "model.int8.onnx", exported / "weights.h")["ok"] is True
    with pytest.raises(InputError, match="export both together"):
        verify(exported / "model.int8.onnx")
    with pytest.raises(InputError, match="export both together"):
        verify(Path(gyrocal.__file__).parent / "data" / "paper.int8.onnx", exported / "weights.h")


def test_its_integers_in_c_are_numpys(exported: Path, require_tool: Callable[[str], str]) -> None:
    """Of another shape than the shipped network: outputs that are no multiple of four, a pool of three."""
    require_tool("cc")
    net = FaceNetwork.open(exported / "model.int8.onnx")
    core, twin = CoreFaceNetwork(exported / "weights.h", fixed=True), FixedNetwork(exported / "weights.h")
    for stage in range(3):
        x = counts(net, 6, 200)["down"][:, : net.samples(stage)]
        got = core.infer(x, stage, LSB_DPS, -78.0)
        known = np.isfinite(got[:, 0])
        assert known.sum() > 100
        assert np.array_equal(got[known].view(np.uint32), twin.infer(x[known], stage, LSB_DPS, -78.0).view(np.uint32))


def test_a_network_whose_sums_do_not_fit_is_not_exported(exported: Path) -> None:
    import onnx

    from gyrocal_export.gyrocal_header import tables

    for layer in ("second.bias", "start", "last.bias"):
        model = onnx.load(exported / "model.int8.onnx")
        (bias,) = (i for i in model.graph.initializer if i.name == layer)
        spoilt = onnx.numpy_helper.to_array(bias).copy()
        spoilt.ravel()[0] = 1e9
        bias.CopyFrom(onnx.numpy_helper.from_array(spoilt, layer))
        with pytest.raises(InputError, match="does not fit 32 bits"):
            tables(model, "model.int8.onnx")


def test_a_run_folder_says_how_it_was_made(run: Path) -> None:
    made = json.loads((run / "made_by.json").read_text())
    assert made["command"] == "gyrocal train --net gyrocal --seed 0 --epochs 1 --out small"
    metrics = json.loads((run / "metrics.json").read_text())
    check("train", {"run": str(run), **metrics})
    rows = metrics["errors"]
    assert [row["seconds"] for row in rows if row["method"] == "net"] == list(STAGES_S)
    error = {(row["method"], row["seconds"]): row["bias_mae_dps"] for row in rows}
    assert all(error["model", s] < 1.1 * error["net", s] for s in STAGES_S), "nothing beats the exact answer"
    assert all(error["net", s] < 1.05 * error["mean", s] for s in STAGES_S)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_network(smallest: Callable[..., Any], tmp_path: Path) -> None:
    from gyrocal_export.train_gyrocal import load, train_gyrocal

    weights = []
    for number, seed in enumerate((0, 0, 1)):
        train_gyrocal(smallest(seed=seed), tmp_path / str(number), lambda *_: None)
        weights.append(load(tmp_path / str(number))[0].second.weight)
    assert bool((weights[0] == weights[1]).all())
    assert not bool((weights[0] == weights[2]).all())


@pytest.mark.parametrize("net", ["gyrocal", "paper"])
def test_training_simulates_from_a_model(
    net: str, smallest: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Faces, or labels and windows, are the model's; the network's weights know nothing of its scale and bias."""
    fitted_model().save(tmp_path / "m.toml")
    if net == "gyrocal":
        from gyrocal_export.train_gyrocal import load, train_gyrocal

        train_gyrocal(smallest(model=str(tmp_path / "m.toml")), tmp_path / "run", lambda *_: None)
        sizes = load(tmp_path / "run")[0].sizes
        assert 0.05 < sizes.unit_dps < 0.12, "a ripple of 0.1 % is 78 mdps"
        other = fitted_model()
        terms = [replace(x, values={"bias_dps": -9.0}) if x.effect_id == "bias" else x for x in other.terms]
        replace(other, terms=tuple(terms)).save(tmp_path / "other.toml")
        train_gyrocal(smallest(model=str(tmp_path / "other.toml")), tmp_path / "run2", lambda *_: None)
        weights = [load(tmp_path / name)[0].state_dict() for name in ("run", "run2")]
        assert all(bool((weights[0][name] == weights[1][name]).all()) for name in weights[0])
    else:
        from gyrocal_export.data import simulated

        data = simulated(3000, 1, 290, str(tmp_path / "m.toml"))
        assert data.label.mean(0).numpy() == pytest.approx([0.002, 0.1], abs=0.003)
        assert data.label.std(0).numpy() == pytest.approx([0.001, 0.03], rel=0.05)
        assert data.up.shape == (3000, 3, 290)
    assert main(["train", "--model", str(tmp_path / "m.toml"), str(tmp_path)]) == 2
    assert "sessions train network paper alone" in capsys.readouterr().err


@pytest.mark.wide
def test_what_is_drawn_has_the_moments_of_the_model() -> None:
    """Variance of each block mean over scenarios: priors, effects and noise together; and the drift's correlation."""
    calibration = limit.table2(16)
    for by_sample in (False, True):
        simulation = Simulation(calibration, Protocol(), 2.0, by_sample=by_sample)
        up, down, scale, bias_dps = simulation.draw(20_000, np.random.default_rng(1))
        assert scale.std() == pytest.approx(calibration.scale[1], rel=0.02)
        assert bias_dps.mean() == pytest.approx(calibration.bias_dps[0], abs=0.002)
        data = paper_windows(20_000, 2, 2.0)
        for drawn, face in ((up, "up"), (down, "down")):
            run = Protocol().runs(2.0)[0]
            other = data[face] if by_sample else block_means(data[face].astype(float), run)
            assert drawn.mean(0) == pytest.approx(other.mean(0), abs=0.006)
            assert np.cov(drawn[:, ::7].T) == pytest.approx(np.cov(other[:, ::7].T), rel=0.06, abs=5e-4)


@pytest.mark.wide
def test_faces_have_the_moments_of_the_campaign() -> None:
    """Means of 29 samples, scale and bias taken out: those of windows drawn sample by sample; and effects spread as asked."""
    columns = Faces(limit.table2(64), Protocol(), 30, 29).draw(40_000, np.random.default_rng(3))
    data = paper_windows(20_000, 4)
    w_dps, u = 78.0, {face: sign * 78.0 * data["scale"] + data["bias_dps"] for face, sign in (("up", 1), ("down", -1))}
    assert w_dps == data["w_up_dps"]
    for drawn, face, sign in ((columns[:20_000], "up", 1), (columns[20_000:], "down", -1)):
        other = sign * (data[face].reshape(20_000, 30, 29).mean(2) - u[face][:, None])
        np.testing.assert_allclose(np.cov(drawn[:, ::5].T), np.cov(other[:, ::5].T), rtol=0.06, atol=6e-4)
    wide = Faces(limit.table2(64), Protocol(), 30, 29, spread=2.0).draw(40_000, np.random.default_rng(3))
    squares = (2**2 - 2**-2) / (4 * np.log(2))  # the mean square of what is log-uniform within a factor of two
    assert wide.var(0).mean() == pytest.approx(squares * columns.var(0).mean(), rel=0.05)


def test_a_model_without_spreads_cannot_be_drawn_from(tmp_path: Path) -> None:
    from gyrocal_export.data import simulated

    replace(Model.builtin("paper"), noise={"z": AxisNoise(0.04)}).save(tmp_path / "m.toml")
    with pytest.raises(InputError, match="three power cycles"):
        simulated(10, 0, 290, str(tmp_path / "m.toml"))
