"""Network gyrocal: merging two Gaussians, training on what a model says, float ONNX = torch, files of a run."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration import limit
from gyrocal.calibration.network import STAGES_S, BlockNetwork
from gyrocal.calibration.scenarios import Protocol, Simulation
from gyrocal.cli import main
from gyrocal.core.verify import verify
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.simulation.simulate import paper_windows


@pytest.fixture(autouse=True)
def _packages(require_module: Callable[[str], None]) -> None:
    require_module("torch")
    require_module("onnx")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, require_module: Callable[[str], None]) -> Path:
    """A run folder of a smaller network, trained for seconds."""
    require_module("torch")
    from gyrocal_export.nets.gyrocal import GyrocalShape
    from gyrocal_export.train_gyrocal import GyrocalConfig, train_gyrocal

    out = tmp_path_factory.mktemp("runs") / "small"
    config = GyrocalConfig(epochs=1, scenarios=64, validation_scenarios=200, shape=GyrocalShape(hidden=9))
    train_gyrocal(config, out, lambda *_: None)
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


def test_merging_is_bayes_rule() -> None:
    import torch

    from gyrocal_export.nets.gyrocal import merge

    rng = np.random.default_rng(1)
    for _ in range(20):
        a, b = rng.uniform(0.1, 3.0, 2)
        m, p = rng.normal(0, 2, 2), np.exp(rng.normal(0, 3, 2))
        rows = np.array([[a, b], [a, -b]])
        cov = np.linalg.inv(np.eye(2) + rows.T @ np.diag(p) @ rows)
        want = cov @ rows.T @ (p * m)
        tensors = [torch.tensor([[v]], dtype=torch.float64) for v in (m[0], p[0], m[1], p[1])]
        mean, variance = merge(a, b, *tensors)
        np.testing.assert_allclose(mean.numpy()[0], want, rtol=1e-9)
        np.testing.assert_allclose(variance.numpy()[0], np.diag(cov), rtol=1e-9)


def test_onnxruntime_gives_the_numbers_of_torch(run: Path, exported: Path) -> None:
    import torch

    from gyrocal_export.train_gyrocal import load

    net, _ = load(run)
    onnx = BlockNetwork.open(exported / "model.onnx")
    data = paper_windows(1000, 4)
    up, down = (onnx.block_means(data[f]) for f in ("up", "down"))
    for stage in range(3):
        with torch.no_grad():
            want = net(torch.from_numpy(up), torch.from_numpy(down), torch.eye(3)[stage].expand(1000, 3)).numpy()
        assert np.all(np.abs(onnx.estimate(up, down, stage, 78.0, -78.0) - want) <= 3e-6 * np.ptp(want, axis=0))


def test_a_run_of_another_shape_goes_to_c(exported: Path, require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    assert verify(exported / "model.int8.onnx", exported / "weights.h")["ok"] is True
    assert verify(exported / "model.int8.onnx")["ok"] is False, "another network's header is noticed"
    with pytest.raises(InputError, match="export both together"):
        verify(Path(str(limit.__file__)).parent / "data" / "paper.int8.onnx", exported / "weights.h")


def test_a_run_folder_says_how_it_was_made(run: Path) -> None:
    made = json.loads((run / "made_by.json").read_text())
    assert made["command"] == "gyrocal train --net gyrocal --seed 0 --epochs 1 --out small"
    rows = json.loads((run / "metrics.json").read_text())["errors"]
    assert [row["seconds"] for row in rows if row["method"] == "net"] == list(STAGES_S)
    error = {(row["method"], row["seconds"]): row["bias_mae_dps"] for row in rows}
    assert all(error["model", s] < 1.1 * error["net", s] for s in STAGES_S), "nothing beats the exact answer"
    assert all(error["net", s] < 1.05 * error["mean", s] for s in STAGES_S)


def test_the_same_seed_gives_the_same_network(run: Path, tmp_path: Path) -> None:
    from gyrocal_export.nets.gyrocal import GyrocalShape
    from gyrocal_export.train_gyrocal import GyrocalConfig, load, train_gyrocal

    weights = [load(run)[0].second.weight]
    for seed in (0, 1):
        config = GyrocalConfig(seed=seed, epochs=1, scenarios=64, validation_scenarios=200, shape=GyrocalShape(hidden=9))
        train_gyrocal(config, tmp_path / str(seed), lambda *_: None)
        weights.append(load(tmp_path / str(seed))[0].second.weight)
    assert bool((weights[0] == weights[1]).all())
    assert not bool((weights[0] == weights[2]).all())


@pytest.mark.parametrize("net", ["gyrocal", "paper"])
def test_training_simulates_from_a_model(net: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The network's knowledge is the model's: with nothing but its prior it would answer 0.002 and 0.1 dps."""
    fitted_model().save(tmp_path / "m.toml")
    if net == "gyrocal":
        from gyrocal_export.train_gyrocal import GyrocalConfig, load, train_gyrocal

        config = GyrocalConfig(model=str(tmp_path / "m.toml"), epochs=1, scenarios=32, validation_scenarios=100)
        train_gyrocal(config, tmp_path / "run", lambda *_: None)
        know = load(tmp_path / "run")[0].knowledge
        assert (know.scale[0], know.bias_dps[0]) == (0.002, 0.1)
        assert know.scale[1] == pytest.approx(0.001, rel=0.01)
    else:
        from gyrocal_export.data import simulated

        data = simulated(3000, 1, 290, str(tmp_path / "m.toml"))
        assert data.label.mean(0).numpy() == pytest.approx([0.002, 0.1], abs=0.003)
        assert data.label.std(0).numpy() == pytest.approx([0.001, 0.03], rel=0.05)
        assert data.up.shape == (3000, 3, 290)
    assert main(["train", "--model", str(tmp_path / "m.toml"), str(tmp_path)]) == 2
    assert "sessions train network paper alone" in capsys.readouterr().err


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
            other = data[face] if by_sample else BlockNetwork.shipped().block_means(data[face])[:, :8]
            assert drawn.mean(0) == pytest.approx(other.mean(0), abs=0.006)
            assert np.cov(drawn[:, ::7].T) == pytest.approx(np.cov(other[:, ::7].T), rel=0.06, abs=5e-4)


def test_a_model_without_spreads_cannot_be_drawn_from(tmp_path: Path) -> None:
    from gyrocal_export.train_gyrocal import GyrocalConfig, train_gyrocal

    replace(Model.builtin("paper"), noise={"z": AxisNoise(0.04)}).save(tmp_path / "m.toml")
    with pytest.raises(InputError, match="three power cycles"):
        train_gyrocal(GyrocalConfig(model=str(tmp_path / "m.toml")), tmp_path / "run", lambda *_: None)
