"""Network `gyrocal`: int8 ONNX = C kernel, each number of the table counts, and what it answers is worth having."""

import re
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal.calibration import limit
from gyrocal.calibration.network import FLAT, STAGES_S, FaceAnswers, FaceNetwork, Prior, merge
from gyrocal.core.networks import CoreFaceNetwork
from gyrocal.core.verify import TOLERANCE, counts, held_to, verify
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import LSB_DPS, paper_windows
from parity.surgery import WEIGHTS, with_largest_negated

DATA = Path(str(files("gyrocal"))) / "data"
INT8 = DATA / "gyrocal.int8.onnx"
LAYERS = ("first", "second", "third", "fourth", "last")
ARRAYS = [f"gc_gyrocal_{layer}_{part}" for layer in LAYERS for part in ("code", "step", "bias")]
KNOWN = Prior(limit.table2().scale, limit.table2().bias_dps)
STAGES = range(len(STAGES_S))
FACES = (("up", 78.0), ("down", -78.0))


@pytest.fixture(autouse=True)
def _cc(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")


def test_ten_seeds_differ_by_half_of_what_is_allowed() -> None:
    found = [verify(INT8, seed=seed, n=300) for seed in range(10)]
    assert min(f["windows"] for f in found) > 1200, "most windows are within the range of the training data"
    assert max(f["max_diff_of_range"] for f in found) <= 0.5 * TOLERANCE


def test_an_output_that_hardly_varies_is_granted_rounding_and_no_more() -> None:
    reference = np.column_stack([np.linspace(-1, 1, 9), 0.03 + 1e-7 * np.arange(9)])
    granted = TOLERANCE * held_to(reference)
    assert granted[0] == pytest.approx(2 * TOLERANCE)
    assert granted[1] == pytest.approx(4 * np.finfo(np.float32).eps * reference[-1, 1])


@pytest.mark.slow
@pytest.mark.parametrize("name", [*ARRAYS, "gc_gyrocal_straight"])
def test_one_wrong_number_in_any_array_is_noticed(name: str, tmp_path: Path) -> None:
    """The largest number of the array changes its sign."""
    assert verify(INT8, with_largest_negated(name, tmp_path), n=300)["ok"] is False


@pytest.mark.parametrize("name", ["leak", "unit_dps", "column_range_dps", "sample_range_dps"])
def test_each_constant_of_the_table_counts(name: str, tmp_path: Path) -> None:
    broken = tmp_path / "weights.h"
    table = WEIGHTS.read_text().partition("gc_gyrocal = {")
    broken.write_text(table[0] + table[1] + re.sub(rf"\.{name} = ", rf".{name} = 1.5f * ", table[2], count=1))
    try:
        noticed = verify(INT8, broken, n=300)["ok"] is False
    except InputError as error:
        noticed = "export both together" in str(error)
    assert noticed


def test_the_host_gives_the_devices_answer_of_a_face() -> None:
    core, net = CoreFaceNetwork(), FaceNetwork.shipped()
    drawn = counts(net, 5, 200)
    for face, w_dps in (("up", 79.5), ("down", -76.25)):
        for stage in STAGES:
            x = drawn[face][:, : net.samples(stage)]
            got, want = core.face(x, stage, LSB_DPS, w_dps), net.face(x * LSB_DPS - w_dps, stage, w_dps)
            assert np.array_equal(np.isfinite(got[:, 0]), want.in_range)
            rows = want.in_range
            np.testing.assert_allclose(got[rows, 0], want.u_dps[rows], atol=3e-6)
            np.testing.assert_allclose(got[rows, 1], want.precision[rows], rtol=3e-5)


def test_merging_is_bayes_rule_on_host_and_device() -> None:
    rng, core = np.random.default_rng(1), CoreFaceNetwork()
    for informed in (False, True):
        for _ in range(20):
            w = 78.0 * np.array([1, -1]) * rng.uniform(0.97, 1.03, 2)
            u, p = rng.normal(0, 5, 2), np.exp(rng.normal(4, 3, 2))
            mean, sd = np.array([rng.normal(0, 0.01), rng.normal(0, 3)]), np.exp(rng.normal([-6, -1], 1))
            prior = Prior((mean[0], sd[0]), (mean[1], sd[1])) if informed else FLAT
            precision = np.diag(1 / sd**2) if informed else np.zeros((2, 2))
            rows = np.column_stack([w, np.ones(2)])
            cov = np.linalg.inv(precision + rows.T @ np.diag(p) @ rows)
            want = [*(cov @ (precision @ mean + rows.T @ (p * u))), *np.sqrt(np.diag(cov))]
            one = [FaceAnswers(w[i], u[i : i + 1], p[i : i + 1], np.array([True])) for i in range(2)]
            np.testing.assert_allclose(merge(one[0], one[1], prior)[0], want, rtol=1e-7)
            root = np.diag(1 / sd[::-1]) if informed else np.zeros((2, 2))
            got = core.merge([[w[0], u[0], p[0]]], [[w[1], u[1], p[1]]], mean[::-1], root)
            np.testing.assert_allclose(got[0], want, rtol=1e-7)


def test_a_prior_that_ties_bias_to_scale_is_taken_whole() -> None:
    root = np.array([[20.0, 900.0], [0.0, 1500.0]])
    mean = np.array([0.1, 0.003])
    w, u, p = np.array([78.0, -77.0]), np.array([0.5, -0.2]), np.array([300.0, 500.0])
    rows = np.column_stack([np.ones(2), w])
    cov = np.linalg.inv(root.T @ root + rows.T @ np.diag(p) @ rows)
    want = cov @ (root.T @ root @ mean + rows.T @ (p * u))
    got = CoreFaceNetwork().merge([[w[0], u[0], p[0]]], [[w[1], u[1], p[1]]], mean, root)[0]
    np.testing.assert_allclose(got, [want[1], want[0], *np.sqrt(np.diag(cov))[::-1]], rtol=1e-9)


def answers(data: dict[str, Any], net: FaceNetwork, prior: Prior = FLAT) -> np.ndarray:
    """[stages, scenarios, 4]."""
    out = []
    for stage in STAGES:
        up, down = (data[face][:, : net.samples(stage)] for face, _ in FACES)
        out.append(net.estimate(up, down, stage, data["w_up_dps"], data["w_down_dps"], prior))
    return np.array(out)


@pytest.fixture(scope="module")
def fresh() -> dict[str, Any]:
    return paper_windows(3000, 20_260_002)


@pytest.mark.parametrize("prior", [FLAT, KNOWN], ids=["flat", "campaign"])
def test_within_a_twentieth_of_the_limit_at_2_4_and_6_s(fresh: dict[str, Any], prior: Prior) -> None:
    """Against the exact posterior that knows as much beforehand."""
    truth = np.column_stack([fresh["scale"], fresh["bias_dps"]])
    y = answers(fresh, FaceNetwork.shipped(), prior)
    off = np.abs(y[..., :2] - truth).mean(1)
    for stage, seconds in enumerate(STAGES_S):
        best = limit.limit(fresh["up"], fresh["down"], seconds, grid=12, known=prior is KNOWN)
        assert np.all(off[stage] < 1.05 * np.abs(np.column_stack([best.scale, best.bias_dps]) - truth).mean(0))


def test_quantising_costs_at_most_one_percent(fresh: dict[str, Any]) -> None:
    truth = np.column_stack([fresh["scale"], fresh["bias_dps"]])
    off = [
        np.abs(answers(fresh, net)[..., :2] - truth).mean(1)
        for net in (FaceNetwork.shipped(), FaceNetwork.open(DATA / "gyrocal.onnx"))
    ]
    assert np.all(off[0] <= 1.01 * off[1])


def test_a_constant_added_to_the_readings_is_added_to_the_answer() -> None:
    """On the device to the last bit that a double has; on the host to float rounding of what is added."""
    net, core = FaceNetwork.shipped(), CoreFaceNetwork()
    drawn = counts(net, 3, 60)
    for face, w_dps in FACES:
        for stage in STAGES:
            x = drawn[face][:30, : net.samples(stage)].astype(int)
            base, here = core.face(x, stage, LSB_DPS, w_dps), net.face(x * LSB_DPS - w_dps, stage, w_dps)
            for added in (-12_000, -1, 7, 1000, 12_000):
                moved = core.face(x + added, stage, LSB_DPS, w_dps)
                assert np.array_equal(moved[:, 1], base[:, 1])
                np.testing.assert_allclose(moved[:, 0] - base[:, 0], added * LSB_DPS, rtol=1e-12, atol=1e-13)
                there = net.face((x + added) * LSB_DPS - w_dps, stage, w_dps)
                np.testing.assert_allclose(there.u_dps - here.u_dps, added * LSB_DPS, atol=1e-6)


def test_a_population_of_sensors_is_answered_like_the_campaigns() -> None:
    """Scale anywhere within 3 %, bias within 10 deg/s: the same errors, and errors as large as it says."""
    n, rng = 2000, np.random.default_rng(11)
    data = paper_windows(n, 20_261_122)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    scale, bias = rng.uniform(-0.03, 0.03, n), rng.uniform(-10.0, 10.0, n)
    moved, shift = dict(data), []
    for face, w_dps in FACES:
        added = np.rint((scale * w_dps + bias) / LSB_DPS) * LSB_DPS
        moved[face] = data[face].astype(float) + added[:, None]
        shift.append(added)
    added = np.column_stack([(shift[0] - shift[1]) / 156.0, (shift[0] + shift[1]) / 2])
    at_home, abroad = (answers(d, FaceNetwork.shipped()) for d in (data, moved))
    np.testing.assert_allclose(abroad[..., :2] - added, at_home[..., :2], atol=2e-6)
    z = (abroad[..., :2] - added - truth) / abroad[..., 2:]
    assert np.all((z.std(1) > 0.85) & (z.std(1) < 1.2)), z.std(1)
    covered = np.mean(np.abs(z) < 1, axis=1)
    assert np.all(np.abs(covered - 0.68) < 0.09), covered


def test_readings_unlike_the_training_data_get_no_answer() -> None:
    """A spike, a saturated run, a reading that is no number; a jump of 2 deg/s. But a constant has deviations of zero."""
    net, core = FaceNetwork.shipped(), CoreFaceNetwork()
    plain = counts(net, 4, 20)["up"][0].astype(int)
    spike, jump, wild = plain.copy(), plain.copy(), np.where(np.arange(870) % 2, 28_000, -28_000)
    spike[100] += round(1.0 / LSB_DPS)
    jump[100:200] += round(2.0 / LSB_DPS)
    for stage in STAGES:
        n = net.samples(stage)
        for x, known in ((plain, True), (np.full(870, 9000), True), (spike, False), (jump, False), (wild, False)):
            y = x[None, :n] * LSB_DPS - 78.0
            assert net.face(y, stage, 78.0).in_range[0] == known
            assert np.isfinite(core.face(x[None, :n], stage, LSB_DPS, 78.0)[0]).all() == known
            assert np.isfinite(net.estimate(y, -y, stage, 78.0, -78.0)).all() == known
        for bad in (np.nan, np.inf, 1e300):
            y = plain[None, :n] * LSB_DPS - 78.0
            y[0, 5] = bad
            assert not net.face(y, stage, 78.0).in_range[0]


def test_the_training_data_are_in_range() -> None:
    data = paper_windows(2000, 5, effects=2.0)
    for stage in STAGES:
        for face, w_dps in FACES:
            net = FaceNetwork.shipped()
            assert net.face(data[face][:, : net.samples(stage)], stage, w_dps).in_range.mean() >= 0.999


def test_both_refuse_another_table() -> None:
    net, core = FaceNetwork.shipped(), CoreFaceNetwork()
    for w_dps in (80.0, -76.0):
        assert np.isfinite(core.face(np.zeros((1, 290)), 0, LSB_DPS, w_dps)).all()
        assert net.face(np.zeros((1, 290)), 0, w_dps).in_range.all()
    for w_dps in (81.0, -75.0, 0.0, np.nan):
        with pytest.raises(InputError, match="trained at"):
            core.face(np.zeros((1, 290)), 0, LSB_DPS, w_dps)
        with pytest.raises(InputError, match="trained at"):
            net.face(np.zeros((1, 290)), 0, w_dps)
    with pytest.raises(InputError, match="do not tell scale from bias"):
        net.estimate(np.zeros((1, 290)), np.zeros((1, 290)), 0, 78.0, 78.0)


def test_it_is_small() -> None:
    text = WEIGHTS.read_text()
    size = {"gc_convnet_code_t": 1, "float": 4}
    arrays = re.findall(r"static const (gc_convnet_code_t|float) gc_gyrocal_\w+\[(\d+)\]", text)
    assert 1000 < sum(size[kind] * int(n) for kind, n in arrays) < 20_000


def test_a_header_without_it_says_so(tmp_path: Path) -> None:
    header = tmp_path / "weights.h"
    header.write_text(WEIGHTS.read_text().replace("    .convnet = &gc_gyrocal,\n", ""))
    with pytest.raises(InputError, match="no network gyrocal"):
        CoreFaceNetwork(header)
