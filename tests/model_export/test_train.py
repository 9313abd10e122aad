"""Training: the loss, the data, the run folder."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from answers import check
from gyrocal.cli import main
from gyrocal.errors import InputError
from make_runs import make_run, make_session


@pytest.fixture(autouse=True)
def _torch(require_module: Callable[[str], None]) -> None:
    require_module("torch")


def session(folder: Path, scenarios: int = 3, seconds: float = 8.0, **changes: float) -> Path:
    """A recorded session whose readings have scale 0.01, bias 0.2 dps on x and noise of 0.05 dps."""
    rng = np.random.default_rng(5)
    runs = []
    for i in range(scenarios):
        for face, w in (("up", 78.0), ("down", -78.0)):
            t_s = np.arange(round(seconds * 145)) / 145
            gyro = rng.normal(0, 0.05, (3, t_s.size)).T
            gyro[:, 0] += 1.01 * w + 0.2
            rate_dps = changes.get(f"rate_{i}", 78.0)
            runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, face=face, axis="x", scenario=f"s{i}"))
    make_session(*runs, axis="x").save(folder)
    return folder


def test_loss_is_eq_17_in_the_units_of_table_1() -> None:
    import torch

    from gyrocal_export.nets.paper import loss

    truth = torch.tensor([[0.004, -0.05], [0.003, 0.02]])
    off = torch.tensor([[0.001, 0.0], [0.0, -0.2]])  # 0.1 % and 0.2 dps
    assert float(loss(truth + off, truth)) == pytest.approx(100 * np.sqrt((0.1**2 + 0.2**2) / 4), rel=1e-5)
    assert float(loss(truth, truth)) == 0.0


def test_the_net_is_fig_2() -> None:
    import torch

    from gyrocal_export.nets.paper import PaperNet, Shape

    net = PaperNet(Shape(), 1.2, torch.zeros(2), torch.ones(2))
    block = ["BatchNorm2d", "Conv2d", "AvgPool2d", "LeakyReLU"]
    for part in (net.up, net.down, net.combined):
        assert [type(layer).__name__ for layer in part] == block
    names = [name for name, _ in net.named_children()]
    assert names == ["up", "down", "combined", "fc1", "dropout", "fc2", "labels"]
    shape = net.shape
    assert net.combined[1].in_channels == 2 * shape.head_channels
    assert net.fc1.in_features == shape.combined_channels * shape.combined_columns
    assert net(torch.zeros(5, 1, 2, 290), torch.zeros(5, 1, 2, 290)).shape == (5, 2)


def test_folding_the_labels_changes_no_answer() -> None:
    import torch

    from gyrocal_export.nets.paper import PaperNet, Shape

    net = PaperNet(Shape(), 1.2, torch.tensor([0.004, -0.05]), torch.tensor([0.0005, 0.04])).eval()
    x = torch.randn(2, 4, 1, 2, 290)
    with torch.no_grad():
        assert torch.allclose(net(*x), net.folded()(*x), rtol=1e-5, atol=1e-9)


def test_recorded_sessions_give_residuals_and_baseline_labels(tmp_path: Path) -> None:
    from gyrocal_export.data import recorded

    data = recorded([session(tmp_path / "a"), session(tmp_path / "b", scenarios=1)], 290)
    assert data.up.shape == data.down.shape == (4, 6, 290), "8 s in windows of 2 s, 1.2 s apart"
    assert (data.table_dps, data.rate_hz) == (78.0, 145.0)
    assert data.label.numpy() == pytest.approx(np.tile([0.01, 0.2], (4, 1)), abs=0.01)
    assert data.up.numpy().mean() == pytest.approx(0.78 + 0.2, abs=0.01)
    assert data.down.numpy().mean() == pytest.approx(-0.78 + 0.2, abs=0.01)


def test_a_table_that_turns_the_other_way_swaps_the_heads(tmp_path: Path) -> None:
    """The up head sees the run whose true rate is positive."""
    from gyrocal_export.data import recorded

    there = recorded([session(tmp_path / "there", scenarios=2)], 290)
    folder = session(tmp_path / "back", scenarios=2)
    text = (folder / "session.toml").read_text()
    toml = (
        text.replace('face = "up"', 'face = "x"')
        .replace('face = "down"', 'face = "up"')
        .replace('"x"\n', '"down"\n', 0)
    )
    toml = toml.replace('face = "x"', 'face = "down"').replace("table_rate_dps = 78.0", "table_rate_dps = -78.0")
    (folder / "session.toml").write_text(toml.replace('face = "x"', 'face = "down"'))
    back = recorded([folder], 290)
    assert np.array_equal(back.up, there.up)
    assert np.allclose(back.label, there.label)


def test_what_cannot_be_trained_on_is_bad_input(tmp_path: Path) -> None:
    from gyrocal_export.data import recorded, split

    with pytest.raises(InputError, match="one table rate"):
        recorded([session(tmp_path / "rates", rate_1=30.0)], 290)
    with pytest.raises(InputError, match="shorter than a window"):
        recorded([session(tmp_path / "short", seconds=1.0)], 290)
    with pytest.raises(InputError, match="nothing to train on"):
        recorded([], 290)
    with pytest.raises(InputError, match="two scenarios"):
        split(recorded([session(tmp_path / "one", scenarios=1)], 290), seed=0)


@pytest.mark.wide
def test_a_run_folder_says_how_it_was_made(tiny_run: Path) -> None:
    assert {path.name for path in tiny_run.iterdir()} == {
        "config.json", "history.csv", "metrics.json", "made_by.json", "net.pt",
    }  # fmt: skip
    with (tiny_run / "history.csv").open() as handle:
        history = list(csv.DictReader(handle))
    metrics = json.loads((tiny_run / "metrics.json").read_text())
    assert len(history) == 2
    assert metrics["validation_loss"] == pytest.approx(min(float(row["validation_loss"]) for row in history), abs=1e-4)
    made = json.loads((tiny_run / "made_by.json").read_text())
    assert made["command"] == "gyrocal train --seed 0 --epochs 2 --out tiny"
    assert {row["method"] for row in made["metrics"]["errors"]} == {"net", "mean", "baseline"}


def test_one_seed_gives_one_net(tmp_path: Path) -> None:
    import torch

    from gyrocal_export.train import Config, load, train

    nets = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        config = Config(seed=seed, epochs=1, scenarios=64, validation_scenarios=32)
        train(config, tmp_path / name, lambda *_: None)
        nets.append(load(tmp_path / name)[0].fc1.weight)
    assert torch.equal(nets[0], nets[1])
    assert not torch.equal(nets[0], nets[2])


def test_draws_that_workers_made_give_the_same_net_and_are_not_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    import torch

    from gyrocal.fleet.engine import InProcess
    from gyrocal_export import draws
    from gyrocal_export.train import Config, load, train

    config = Config(seed=3, epochs=2, scenarios=64, validation_scenarios=32)
    train(config, tmp_path / "alone", lambda *_: None)
    train(config, tmp_path / "ahead", lambda *_: None, InProcess(), tmp_path / "draws")
    monkeypatch.setattr(draws.Draw, "made", None)
    train(config, tmp_path / "again", lambda *_: None, InProcess(), tmp_path / "draws")
    alone, ahead, again = (load(tmp_path / name)[0].fc1.weight for name in ("alone", "ahead", "again"))
    assert torch.equal(alone, ahead)
    assert torch.equal(alone, again)
    assert len(list((tmp_path / "draws").glob("*.npz"))) == 2


def test_training_stops_when_validation_no_longer_falls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import torch

    from gyrocal_export import train

    losses = iter([5.0, 4.0, 4.5, 4.2, 4.1, 1.0])
    monkeypatch.setattr(train, "_epoch", lambda *_: 0.0)
    monkeypatch.setattr(train, "loss", lambda *_: torch.tensor(next(losses)))
    config = train.Config(epochs=6, patience=3, scenarios=8, validation_scenarios=8)
    metrics = train.train(config, tmp_path / "run", lambda *_: None)
    assert (metrics["best_epoch"], metrics["validation_loss"]) == (1, 4.0)
    assert len((tmp_path / "run" / "history.csv").read_text().splitlines()) == 1 + 5


def test_the_command_trains_on_sessions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, out = session(tmp_path / "session", scenarios=5), tmp_path / "run"
    assert main(["train", str(folder), "--epochs", "2", "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    check("train", found)
    assert found["run"] == str(out)
    assert str(tmp_path) not in (out / "made_by.json").read_text(), "names no path of this machine"

    assert main(["train", "--epochs", "1", "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["train", "--net", "resnet", "--out", str(tmp_path / "x")]) == 2
    assert main(["train", str(tmp_path / "absent"), "--out", str(tmp_path / "y")]) == 2
    assert not (tmp_path / "x").exists()
    assert not (tmp_path / "y").exists(), "nothing half-written"
