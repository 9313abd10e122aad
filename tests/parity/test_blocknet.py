"""Network `gyrocal`: int8 ONNX = C kernel, each number of the table counts, and what it answers is worth having."""

import re
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration import limit
from gyrocal.calibration.network import STAGES_S, BlockNetwork
from gyrocal.core.library import CoreBlockNetwork
from gyrocal.core.verify import TOLERANCE, block_means, held_to, verify
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import BIAS_MEAN_DPS, SCALE_MEAN, paper_windows
from parity.surgery import WEIGHTS, with_largest_negated

DATA = Path(str(files("gyrocal"))) / "data"
INT8 = DATA / "gyrocal.int8.onnx"
ARRAYS = [f"gc_blocks_{layer}_{part}" for layer in ("first", "second", "last") for part in ("code", "step", "bias")]


@pytest.fixture(autouse=True)
def _cc(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")


def test_c_gives_the_numbers_of_the_quantised_graph() -> None:
    found = verify(INT8, seed=1, n=3000)
    assert found["windows"] == 9000
    assert found["max_diff_of_range"] <= TOLERANCE


def test_an_output_that_hardly_varies_is_granted_rounding_and_no_more() -> None:
    reference = np.column_stack([np.linspace(-1, 1, 9), 0.03 + 1e-7 * np.arange(9)])
    granted = TOLERANCE * held_to(reference)
    assert granted[0] == pytest.approx(2 * TOLERANCE)
    assert granted[1] == pytest.approx(4 * np.finfo(np.float32).eps * reference[-1, 1])


@pytest.mark.parametrize("name", [*ARRAYS, "gc_blocks_straight"])
def test_one_wrong_number_in_any_array_is_noticed(name: str, tmp_path: Path) -> None:
    """The largest number of the array changes its sign."""
    assert verify(INT8, with_largest_negated(name, tmp_path))["ok"] is False


@pytest.mark.parametrize("name", ["gain", "offset", "units", "mean", "sd"])
def test_each_pair_of_constants_in_its_order(name: str, tmp_path: Path) -> None:
    broken = tmp_path / "weights.h"
    broken.write_text(re.sub(rf"\.{name} = {{(\S+), (\S+)}}", rf".{name} = {{\2, \1}}", WEIGHTS.read_text()))
    assert verify(INT8, broken)["ok"] is False


@pytest.fixture(scope="module")
def errors() -> dict[str, np.ndarray]:
    """[stages, scenarios, 2] absolute errors and the network's own standard deviations on fresh scenarios."""
    data = paper_windows(3000, 20_260_002)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    out: dict[str, list[np.ndarray]] = {name: [] for name in ("float", "int8", "sd", "limit", "prior")}
    nets = {"float": BlockNetwork.open(DATA / "gyrocal.onnx"), "int8": BlockNetwork.shipped()}
    for stage, seconds in enumerate(STAGES_S):
        for name, net in nets.items():
            means = [net.block_means(data[f][:, : net.samples(stage)]) for f in ("up", "down")]
            y = net.estimate(means[0], means[1], stage, data["w_up_dps"], data["w_down_dps"])
            out[name].append(np.abs(y[:, :2] - truth))
        out["sd"].append(y[:, 2:])
        best = limit.limit(data["up"], data["down"], seconds, grid=12)
        out["limit"].append(np.abs(np.column_stack([best.scale, best.bias_dps]) - truth))
        out["prior"].append(np.abs([SCALE_MEAN, BIAS_MEAN_DPS] - truth))
    return {name: np.array(parts) for name, parts in out.items()}


def test_within_a_tenth_of_the_limit_at_2_4_and_6_s(errors: dict[str, np.ndarray]) -> None:
    assert np.all(errors["int8"].mean(1) < 1.10 * errors["limit"].mean(1))
    assert np.all(errors["int8"].mean(1) < errors["prior"].mean(1))


def test_quantising_costs_at_most_one_percent(errors: dict[str, np.ndarray]) -> None:
    assert np.all(errors["int8"].mean(1) <= 1.01 * errors["float"].mean(1))


def test_it_knows_how_sure_it_is(errors: dict[str, np.ndarray]) -> None:
    covered = np.mean(errors["int8"] < errors["sd"], axis=1)
    assert np.all(np.abs(covered - 0.68) < 0.05), covered


def test_it_is_small() -> None:
    text = WEIGHTS.read_text()
    size = {"int8_t": 1, "float": 4}
    arrays = re.findall(r"static const (int8_t|float) gc_blocks_\w+\[(\d+)\]", text)
    assert 1000 < sum(size[kind] * int(n) for kind, n in arrays) < 20_000


def test_both_refuse_another_table_and_nan() -> None:
    quiet = np.zeros((1, 24), np.float32)
    bad = quiet.copy()
    bad[0, 3] = np.nan
    for call in (CoreBlockNetwork().run, BlockNetwork.shipped().estimate):
        call(quiet, quiet, 0, 80.0, -76.0)
        for w_up, w_down in ((81.0, -78.0), (78.0, -75.0), (-78.0, 78.0), (np.nan, -78.0)):
            with pytest.raises(InputError, match="trained at"):
                call(quiet, quiet, 0, w_up, w_down)
        with pytest.raises(InputError, match="NaN"):
            call(quiet, bad, 0, 78.0, -78.0)


def test_what_comes_after_the_stage_does_not_count() -> None:
    up, down = block_means(BlockNetwork.shipped(), 3, 60)
    for call in (CoreBlockNetwork().run, BlockNetwork.shipped().estimate):
        for stage in (0, 1):
            cut = [np.where(np.arange(24) < 8 * (stage + 1), x, 0.0) for x in (up, down)]
            whole = [np.where(np.isfinite(x), x, 0.0) for x in (up, down)]
            finite = [np.where(np.isfinite(x), x, 0.0) for x in cut]
            assert np.array_equal(call(*whole, stage, 78.0, -78.0), call(*finite, stage, 78.0, -78.0))


def test_a_header_without_it_says_so(tmp_path: Path) -> None:
    header = tmp_path / "weights.h"
    header.write_text(WEIGHTS.read_text().replace("    .blocks = &gc_blocks,\n", ""))
    with pytest.raises(InputError, match="no network gyrocal"):
        CoreBlockNetwork(header)
