"""A network for the model on the screen: trained, verified and exported from the page; stopped; not to be had without torch."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gyrocal.calibration.network import FaceNetwork
from gyrocal.simulation.simulate import simulate
from gyrocal.web.panels.calibrate import SHIPPED_FOR
from gyrocal.web.state import training
from gyrocal.web.state.jobs import Cancelled
from gyrocal.web.state.training import Training
from gyrocal.web.state.workbench import Workbench

from .loop import finish


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    simulate(workbench.folder / "training", "paper", ["table_ripple"], 3, scenarios=3, seconds=8)
    return workbench


def opened(look: Callable[..., Any], served: Any, require_module: Callable[[str], None]) -> tuple[Any, Any]:
    """The page, and its part about the network."""
    for module in training.NEEDED:
        require_module(module)
    page = look(f"{served.url}calibrate?session=training")
    page.locator("table.plain tbody tr").first.wait_for()
    return page, page.locator("[aria-label=network]")


@pytest.mark.wide
@pytest.mark.slow
def test_a_training_is_stopped_from_the_page(
    served: Any, look: Callable[..., Any], require_module: Callable[[str], None]
) -> None:
    page, network = opened(look, served, require_module)
    network.get_by_label("folder").fill("stopped")
    network.get_by_role("button", name="Train it").click()
    network.get_by_text(re.compile(r"epoch \d+ of 40, loss [-\d.]+, \d+ (s|min) left")).wait_for()
    page.wait_for_function(
        "() => { const network = document.querySelector('[aria-label=network]');"
        " const part = network.querySelector('[role=progressbar]').getAttribute('aria-valuenow');"
        " return Math.abs(40 * part - network.innerText.match(/epoch (\\d+) of 40/)[1]) < 1e-9; }"
    )
    network.get_by_role("button", name="Stop training").click()
    page.get_by_text("Training: stopped").wait_for()
    assert not (served.folder / "stopped").exists()


@pytest.mark.wide
@pytest.mark.slow
def test_trained_verified_and_exported(
    served: Any, look: Callable[..., Any], require_tool: Callable[[str], str], require_module: Callable[[str], None]
) -> None:
    """A whole training. That a training can be exported and verified is proven beside the page (tests/model_export)."""
    require_tool("cc")
    page, network = opened(look, served, require_module)
    folder = served.folder
    network.get_by_label("folder").fill("mine")
    network.get_by_label("epochs").fill("1")
    network.get_by_role("button", name="Train it").click()
    network.get_by_role("status").wait_for()
    network.locator("tbody tr").nth(2).wait_for()
    assert network.get_by_text("The network in C and in onnxruntime").is_visible()
    errors = json.loads((folder / "mine/metrics.json").read_text())["errors"]
    last = {e["method"]: e for e in errors if e["seconds"] == 6}
    assert network.locator("tbody tr").nth(2).inner_text().split("\t")[1:3] == [
        f"{100 * last[method]['scale_mae']:.4f}" for method in ("net", "model")
    ]
    assert FaceNetwork.open(folder / "mine/model.int8.onnx").rate_hz == 145.0
    assert json.loads((folder / "mine/config.json").read_text())["epochs"] == 1

    device = page.locator("[aria-label='to the device']")
    device.get_by_text("by the network trained for it").wait_for()
    device.get_by_role("button", name="Write it").click()
    device.get_by_text("largest difference").wait_for()
    assert (folder / "firmware/include/weights.h").read_bytes() == (folder / "mine/weights.h").read_bytes()
    assert (folder / "firmware/model.toml").read_bytes() == (folder / "mine/model.toml").read_bytes()


TRAINS = """#!{python}
import sys, time
from pathlib import Path
folder = Path(sys.argv[sys.argv.index("--out") + 1])
folder.mkdir()
rows = ["epoch,train_loss,validation_loss"]
for epoch in range(3):
    rows.append(f"{{epoch}},0.9,{{0.5 - 0.1 * epoch}}")
    (folder / "history.csv").write_text("\\n".join(rows) + "\\n")
    time.sleep(0.1)
time.sleep(600)
"""
"""What the process of a training leaves of its first three epochs; it then hangs."""


def test_a_training_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each epoch is told with its loss and the time that is left; nothing of a stopped training stays."""
    command, folder = tmp_path / "trains", tmp_path / "stopped"
    command.write_text(TRAINS.format(python=sys.executable))
    command.chmod(0o755)
    monkeypatch.setattr(training, "LOOK_S", 0.05)
    monkeypatch.setattr("gyrocal.web.state.training.sys.executable", str(command))
    told: list[tuple[int, float | None, float | None]] = []

    def changed() -> None:
        told.append((one.done, one.loss, one.left_s))
        if one.done == 3:
            one.cancel()

    one = Training(tmp_path / "m.toml", "z", 40, folder, changed)

    async def story() -> None:
        with pytest.raises(Cancelled, match="Training: stopped"):
            await one.run()

    finish(story())
    assert told[-1][:2] == (3, pytest.approx(0.3))
    assert told[-1][2] is not None
    assert 0 < told[-1][2] < 60
    assert one._process is not None
    assert one._process.returncode is not None
    assert not folder.exists()


@pytest.mark.wide
def test_what_the_command_says_reaches_the_person(tmp_path: Path, require_module: Callable[[str], None]) -> None:
    for module in training.NEEDED:
        require_module(module)

    async def story() -> None:
        with pytest.raises(training.GyrocalError, match=r"^Training: .*no\.toml"):
            await Training(tmp_path / "no.toml", "z", 1, tmp_path / "out", lambda: None).run()
        assert not (tmp_path / "out").exists()

    finish(story())


def test_a_training_is_under_way_until_its_network_was_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page shows no untrained state, and no button that starts a second training, between the two."""
    seen: list[bool] = []

    async def trained(self: Training) -> list[Any]:
        return []

    async def story() -> None:
        bench = Workbench([tmp_path], lambda topic: None)

        async def check(*asked: Any) -> dict[str, Any]:
            seen.append(bench.training is not None)
            return {"ok": True}

        monkeypatch.setattr(bench.jobs, "run", check)
        bench.steps = [step]
        try:
            await bench.train("network", "z", 1)
            assert bench.training is None
            assert bench.network("z") is not None
        finally:
            bench.close()

    step: Any = SimpleNamespace(view=SimpleNamespace(toml="name = 'x'\n"))
    monkeypatch.setattr(Training, "run", trained)
    finish(story())
    assert seen == [True]


def test_the_page_says_for_which_rates_the_shipped_network_is_trained() -> None:
    rate_dps, rate_hz = (float(number) for number in re.findall(r"\d+", SHIPPED_FOR))
    net = FaceNetwork.shipped()
    assert net.suits(rate_hz, rate_dps)
    assert not net.suits(rate_hz, 1.05 * rate_dps)
    assert not net.suits(1.01 * rate_hz, rate_dps)


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "find_spec", lambda name: None if name == "torch" else object())
    assert training.missing() == ["torch"]
