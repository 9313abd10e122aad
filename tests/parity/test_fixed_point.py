"""Network `gyrocal` in integers: C = numpy bit for bit, nothing overflows, and it answers as the float network does."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration.network import STAGES_S, FaceNetwork
from gyrocal.core.library import build_sim
from gyrocal.core.networks import CoreFaceNetwork
from gyrocal.core.verify import INTEGERS_MAX, INTEGERS_RMS, counts, verify
from gyrocal.device.rows import rows_bytes
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import LSB_DPS, paper_windows, simulate
from parity.fixed_point import LAYERS, FixedNetwork
from parity.surgery import WEIGHTS, with_largest_negated

STAGES = range(len(STAGES_S))
FACES = (("up", 78.0), ("down", -78.0))
INT8 = Path(__file__).parents[2] / "host" / "gyrocal" / "data" / "gyrocal.int8.onnx"
ARRAYS = [f"gc_gyrocal_{layer}_{part}" for layer in LAYERS[:-1] for part in ("gain", "start")]
ARRAYS += [f"gc_gyrocal_{name}" for name in ("straight_code", "straight_step", "last_start", "last_unit")]


@pytest.fixture(autouse=True)
def _cc(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")


@pytest.mark.parametrize(("lsb_dps", "seed"), [(LSB_DPS, 1), (0.0043, 2), (0.07, 3)])
def test_the_core_gives_numpys_integers(lsb_dps: float, seed: int) -> None:
    """Windows of a table, and others up to the network's range; counts of three sizes; every bit of both outputs."""
    net, core, twin = FaceNetwork.shipped(), CoreFaceNetwork(fixed=True), FixedNetwork(WEIGHTS)
    drawn = counts(net, seed, 400)
    answered = 0
    for stage in STAGES:
        for face, w_dps in FACES:
            near = np.rint((drawn[face][:, : net.samples(stage)] * LSB_DPS) / lsb_dps).clip(-32768, 32767).astype(np.int16)
            got = core.infer(near, stage, lsb_dps, w_dps)
            known = np.isfinite(got[:, 0])
            want = twin.infer(near[known], stage, lsb_dps, w_dps)
            assert want.dtype == np.float32
            assert np.array_equal(got[known].view(np.uint32), want.view(np.uint32))
            answered += int(known.sum())
    assert answered > 1200


def test_no_input_within_the_range_overflows() -> None:
    """The bounds of each layer's sums, from the columns on: each fits 32 bits, and so does an output times the leak."""
    net, twin = FaceNetwork.shipped(), FixedNetwork(WEIGHTS)
    largest = round(net.column_range_dps / twin.unit_dps * twin.columns_a_unit)
    low, high = np.full(twin.kernel, -largest), np.full(twin.kernel, largest)
    for name in LAYERS:
        layer = twin.layers[name]
        if name == "second":  # times before channels, as its codes are, and summed over its pool
            low, high = (np.tile(y, twin.second_kernel) * twin.second_pool for y in (low, high))
        if name in ("first", "second", "third"):
            assert low.min() >= -(2**15), "inputs of 16 bits"
            assert high.max() < 2**15
        low, high = np.minimum(low, 0), np.maximum(high, 0)  # for the first terms of a sum, and for a stage that lacks times
        if name == "third":
            low, high = (np.tile(y, layer.code.shape[1] // len(y)) for y in (low, high))
        starts = np.atleast_2d(layer.start)
        least = np.minimum(layer.code * low, layer.code * high).sum(1) + starts.min(0)
        most = np.maximum(layer.code * low, layer.code * high).sum(1) + starts.max(0)
        assert 2**22 < max(-least.min(), most.max()) < 2**31, "of a size that keeps precision, and fits"
        if name != "last":
            least, most = least * layer.gain >> 32, most * layer.gain >> 32
            assert -least.min() * twin.leak + 2**14 < 2**31
            low, high = twin.leaky(least), twin.leaky(most)


def test_ten_seeds_differ_by_half_of_what_is_allowed() -> None:
    found = [verify(INT8, seed=seed, n=300) for seed in range(10)]
    assert max(f["integers_max_of_se"] for f in found) <= 0.6 * INTEGERS_MAX
    assert max(f["integers_rms_of_se"] for f in found) <= 0.6 * INTEGERS_RMS


@pytest.mark.slow
@pytest.mark.parametrize("name", ARRAYS)
def test_one_wrong_number_in_any_array_is_noticed(name: str, tmp_path: Path) -> None:
    """The largest number of the array changes its sign; the layers in float32 do not use it."""
    found = verify(INT8, with_largest_negated(name, tmp_path), n=300)
    assert found["ok"] is False
    assert found["max_diff_of_range"] <= found["tolerance"]


@pytest.mark.parametrize("name", ["leak", "columns_a_unit"])
def test_each_constant_of_the_table_counts(name: str, tmp_path: Path) -> None:
    broken = tmp_path / "weights.h"
    before, integers, after = WEIGHTS.read_text().rpartition("    .leak = 3277,")
    broken.write_text(before + re.sub(rf"\.{name} = ", rf".{name} = 2 * ", integers + after, count=1))
    try:
        noticed = verify(INT8, broken, n=300)["ok"] is False
    except InputError as error:
        noticed = "export both together" in str(error)
    assert noticed


def test_its_errors_are_those_of_the_float_network() -> None:
    """The rms error of a face's answer is the same within half a percent at each stage."""
    data = paper_windows(2000, 20_260_003)
    net, core = FaceNetwork.shipped(), CoreFaceNetwork(fixed=True)
    for stage in STAGES:
        for face, w_dps in FACES:
            x = np.rint((data[face][:, : net.samples(stage)].astype(float) + w_dps) / LSB_DPS).astype(np.int16)
            truth = data["scale"] * w_dps + data["bias_dps"]
            float_u, fixed_u = net.face(x * LSB_DPS - w_dps, stage, w_dps).u_dps, core.face(x, stage, LSB_DPS, w_dps)[:, 0]
            errors = [np.sqrt(np.mean((u - truth) ** 2)) for u in (float_u, fixed_u)]
            assert errors[1] == pytest.approx(errors[0], rel=5e-3)


def test_a_constant_added_to_the_counts_is_added_to_the_answer() -> None:
    core = CoreFaceNetwork(fixed=True)
    x = counts(FaceNetwork.shipped(), 3, 60)["up"][:30, :580].astype(int)
    base, moved = (core.face(x + added, 1, LSB_DPS, 78.0) for added in (0, 1000))
    assert np.array_equal(moved[:, 1], base[:, 1])
    np.testing.assert_allclose(moved[:, 0] - base[:, 0], 1000 * LSB_DPS, rtol=1e-12)


def test_it_refuses_what_the_float_network_refuses() -> None:
    net = FaceNetwork.shipped()
    drawn = counts(net, 8, 300)["up"]
    for stage in STAGES:
        x = drawn[:, : net.samples(stage)]
        both = [np.isfinite(CoreFaceNetwork(fixed=fixed).infer(x, stage, LSB_DPS, 78.0)) for fixed in (False, True)]
        assert np.array_equal(*both)
        assert 0 < both[0].mean() < 1
    even = np.full((1, 290), 9000)
    assert np.isfinite(CoreFaceNetwork(fixed=True).infer(even, 0, 1e300, 78.0)).all(), "no deviation in any unit"


def test_the_device_answers_in_integers_as_in_float32(tmp_path: Path) -> None:
    """Every `$CAL` of two power cycles: those of the network within a tenth of their standard error, all others the same."""
    session, _ = simulate(None, "table2", seed=6, scenarios=2, seconds=7.0)
    rows = tmp_path / "session.rows"
    rows.write_bytes(rows_bytes(session))
    said = []
    for fixed in (0, 1):
        device = build_sim(flags=[f"-DGC_NET_FIXED={fixed}"])
        done = subprocess.run([device, rows, "--speed", "max", "--stream", "off"], capture_output=True, text=True, check=True)
        lines = (line.partition("*")[0].split(",")[4:] for line in done.stdout.splitlines() if line.startswith("$CAL"))
        said.append([dict(field.split("=") for field in fields) for fields in lines])
    apart = []
    for one, other in zip(*said, strict=True):
        for name, value in one.items():
            if one["method"] == "cnn" and name in ("scale", "bias_dps"):
                se = float(one[name.replace("scale", "scale_se").replace("bias_dps", "bias_se_dps")])
                apart.append(abs(float(other[name]) - float(value)) / se)
            elif one["method"] == "cnn" and name in ("scale_se", "bias_se_dps", "misfit"):
                assert float(other[name]) == pytest.approx(float(value), rel=0.02)
            else:
                assert other[name] == value
    assert len(apart) == 12
    assert 0 < max(apart) < 0.1
