"""The network's chain: torch = float ONNX ~ int8 ONNX = C kernel; and each link is seen to break."""

import re
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration.network import Network
from gyrocal.core.networks import CoreNetwork
from gyrocal.core.verify import TOLERANCE, verify, windows
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import paper_windows
from parity.surgery import WEIGHTS, with_largest_negated

DATA = Path(str(files("gyrocal"))) / "data"
ARRAYS = [
    f"gc_net_{layer}_{part}" for layer in ("up", "down", "combined", "fc1", "fc2") for part in ("code", "step", "bias")
]


@pytest.fixture(autouse=True)
def _cc(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")


def test_c_gives_the_numbers_of_the_quantised_graph() -> None:
    found = verify(DATA / "paper.int8.onnx", seed=1, n=3000)
    assert found["windows"] == 3000
    assert found["max_diff_of_range"] <= TOLERANCE == 2e-6
    assert found["ok"] is True


def test_the_windows_hold_the_extremes() -> None:
    up, down = windows(Network.shipped(), seed=0)
    assert len(up) >= 1000
    for x in (up, down):
        assert np.any(np.all(np.abs(x) == 250.0, axis=1)), "saturated"
        assert np.any(np.all(x == x[:, :1], axis=1) & (x[:, 0] != 0)), "constant"
        assert np.any(np.abs(x) > 1e30), "huge"
        assert np.any((x != 0) & (np.abs(x) < np.finfo(np.float32).tiny)), "denormal"
        assert not np.isnan(x).any()


@pytest.mark.parametrize("name", ARRAYS)
def test_one_wrong_number_in_any_array_is_noticed(name: str, tmp_path: Path) -> None:
    """The largest number of the array changes its sign."""
    assert verify(DATA / "paper.int8.onnx", with_largest_negated(name, tmp_path))["ok"] is False


def test_a_code_off_by_one_is_noticed(tmp_path: Path) -> None:
    text = WEIGHTS.read_text()
    found = re.search(r"gc_net_up_code\[\d+\] = {\s*(-?\d+)", text)
    assert found is not None
    broken = tmp_path / "weights.h"
    broken.write_text(text[: found.start(1)] + str(int(found[1]) - 1) + text[found.end(1) :])
    assert verify(DATA / "paper.int8.onnx", broken)["ok"] is False


def test_faces_taken_for_each_other_are_noticed(tmp_path: Path) -> None:
    text = WEIGHTS.read_text()
    swap = {"up": "down", "down": "up"}
    broken = tmp_path / "weights.h"
    broken.write_text(re.sub(r"\.(up|down) = {", lambda m: f".{swap[m[1]]} = {{", text))
    assert verify(DATA / "paper.int8.onnx", broken)["ok"] is False


def test_quantising_costs_at_most_one_percent() -> None:
    data = paper_windows(3000, seed=20_260_001)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    errors = {}
    for name in ("paper.onnx", "paper.int8.onnx"):
        net = Network.open(DATA / name)
        per_run = data["up"].shape[1] // net.window
        up, down = (data[f][:, : per_run * net.window].reshape(-1, net.window) for f in ("up", "down"))
        y = net.estimate(up, down, data["w_up_dps"], data["w_down_dps"]).reshape(-1, per_run, 2)
        errors[name] = np.array([np.abs(y[:, :k].mean(1) - truth).mean(0) for k in (1, 2, 3)])
    assert np.all(errors["paper.int8.onnx"] <= 1.01 * errors["paper.onnx"])


def test_the_answer_does_not_depend_on_the_level_of_optimisation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    import gyrocal.core.library

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    up, down = windows(Network.shipped(), seed=2, n=300)
    answers = []
    for level in ("-O0", "-O2", "-O3"):
        monkeypatch.setattr(gyrocal.core.library, "FLAGS", ("-std=c99", level, "-ffp-contract=off"))
        answers.append(CoreNetwork().run(up, down, 78.0, -78.0))
    assert np.array_equal(answers[0], answers[1])
    assert np.array_equal(answers[0], answers[2])


def test_readings_beyond_the_training_range_count_as_its_ends() -> None:
    core = CoreNetwork()
    shape = (1, core.window)
    for sign in (1.0, -1.0):
        at_the_end = core.run(np.full(shape, sign * core.clip_dps), np.zeros(shape), 78.0, -78.0)
        for beyond in (1.001 * core.clip_dps, 1e30, np.inf):
            assert np.array_equal(core.run(np.full(shape, sign * beyond), np.zeros(shape), 78.0, -78.0), at_the_end)


def test_both_refuse_another_table_and_nan() -> None:
    quiet = np.zeros((1, 290), np.float32)
    for call in (CoreNetwork().run, Network.shipped().estimate):
        call(quiet, quiet, 80.0, -76.0)
        for w_up, w_down in ((81.0, -78.0), (78.0, -75.0), (-78.0, 78.0), (78.0, 78.0), (0.0, 0.0), (np.nan, -78.0)):
            with pytest.raises(InputError, match="trained at"):
                call(quiet, quiet, w_up, w_down)
        for at in (0, 140, 287):
            bad = quiet.copy()
            bad[0, at] = np.nan
            with pytest.raises(InputError, match="NaN"):
                call(quiet, bad, 78.0, -78.0)
        with pytest.raises(InputError, match="290"):
            call(quiet[:, :289], quiet[:, :289], 78.0, -78.0)
