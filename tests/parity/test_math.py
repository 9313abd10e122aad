"""gc_math against numpy's float64: the errors that gc_math.h states, and what it defines at the edges."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.core.library import Core

FLT_MIN = np.finfo(np.float32).tiny


@pytest.fixture(scope="module")
def core(require_tool: Callable[[str], str]) -> Core:
    require_tool("cc")
    return Core()


@pytest.fixture(scope="module")
def floats() -> np.ndarray:
    """Finite float32 of every size and both signs, denormal ones too: every 40 009th bit pattern."""
    x = np.arange(0, 2**32, 40009, dtype=np.uint64).astype(np.uint32).view(np.float32)
    return x[np.isfinite(x)]


def ulps(y: np.ndarray, exact: np.ndarray) -> float:
    step = np.spacing(np.maximum(np.abs(exact), FLT_MIN).astype(np.float32)).astype(np.float64)
    return float(np.max(np.abs(y.astype(np.float64) - exact) / step))


def test_exp_is_within_two_ulp(core: Core) -> None:
    x = np.linspace(-87.33, 88.72, 200_001, dtype=np.float32)
    assert ulps(core.exp(x), np.exp(x.astype(np.float64))) <= 1.1


def test_exp_at_its_edges(core: Core) -> None:
    x = [0.0, -0.0, 1e-45, -1e-45, 88.72, 88.73, np.inf, -87.336, -87.34, -np.inf]
    y = core.exp(x)
    assert list(y[:4]) == [1.0] * 4
    assert np.isfinite(y[4])
    assert y[5] == y[6] == np.inf
    assert y[7] >= FLT_MIN, "the smallest result is a normal number"
    assert y[8] == y[9] == 0.0
    assert np.isnan(core.exp(np.nan))


def test_tanh_is_within_two_ulp_everywhere(core: Core, floats: np.ndarray) -> None:
    near = np.linspace(-10, 10, 200_001, dtype=np.float32)
    for x in (near, floats):
        assert ulps(core.tanh(x), np.tanh(x.astype(np.float64))) <= 2.0


def test_tanh_is_odd_grows_and_saturates(core: Core) -> None:
    x = np.linspace(0, 12, 50_001, dtype=np.float32)
    y = core.tanh(x)
    assert np.array_equal(core.tanh(-x), -y)
    assert np.all(np.diff(y) >= -np.spacing(np.float32(1.0)))
    assert np.all(np.abs(y) <= 1.0)
    assert list(core.tanh([np.inf, -np.inf, 1e-45])) == [1.0, -1.0, np.float32(1e-45)]
    assert np.isnan(core.tanh(np.nan))


def test_sine_of_turns_is_within_1e_7(core: Core, floats: np.ndarray) -> None:
    near = np.linspace(-3, 3, 100_001, dtype=np.float32)
    for x in (near, floats[np.abs(floats) < 1e9]):
        turns = np.remainder(x.astype(np.float64), 1.0)  # exact
        assert np.max(np.abs(core.sin_turn(x) - np.sin(2 * np.pi * turns))) <= 1e-7
        assert np.max(np.abs(core.cos_turn(x) - np.cos(2 * np.pi * turns))) <= 1e-7


def test_quarter_turns_are_exact(core: Core) -> None:
    quarters = np.arange(-4000, 4000)
    assert np.array_equal(core.sin_turn(quarters / 4), np.array([0, 1, 0, -1])[quarters % 4])
    assert np.array_equal(core.cos_turn(quarters / 4), np.array([1, 0, -1, 0])[quarters % 4])


def test_whole_turns_change_no_bit(core: Core) -> None:
    x = np.arange(-512, 512, dtype=np.float32) / 1024
    for turns in (1, 1000, 2**13):
        assert np.array_equal(core.sin_turn(x + turns), core.sin_turn(x))
        assert np.array_equal(core.cos_turn(x - turns), core.cos_turn(x))


def test_sine_of_no_angle_is_nan(core: Core) -> None:
    assert np.all(np.isnan(core.sin_turn([np.nan, np.inf, -np.inf])))
    assert np.all(np.isnan(core.cos_turn([np.nan, np.inf, -np.inf])))
    assert list(core.cos_turn([1e30, -1e38, 2.0**23])) == [1.0, 1.0, 1.0]


def in_double(core: Core, name: str, x: np.ndarray) -> np.ndarray:
    function = core.library[name]
    function.argtypes, function.restype = [ctypes.c_double], ctypes.c_double
    return np.array([function(value) for value in x.tolist()])


def test_the_logarithm_in_double_is_within_two_ulp(core: Core) -> None:
    rng = np.random.default_rng(1)
    near = np.concatenate([1 + np.linspace(-0.3, 0.5, 4001), 2.0 ** np.arange(-1022, 1024)])
    for x in (near, np.exp(rng.uniform(-708, 709, 20_000))):
        exact = np.log(x)
        np.testing.assert_allclose(in_double(core, "gc_log", x), exact, rtol=5e-16, atol=3e-17)


def test_the_decay_in_double(core: Core) -> None:
    x = np.concatenate([np.linspace(0, 700, 40_001), np.geomspace(1e-300, 1, 2001)])
    np.testing.assert_allclose(in_double(core, "gc_decay", x), np.exp(-x), rtol=1e-15)
    assert list(in_double(core, "gc_decay", np.array([0.0, 700.1, np.inf]))) == [1.0, 0.0, 0.0]


def test_cosine_and_sine_in_double(core: Core) -> None:
    function = core.library["gc_cos_sin"]
    function.argtypes, function.restype = [ctypes.c_double, *[ctypes.POINTER(ctypes.c_double)] * 2], None
    for angle in np.linspace(-20, 20, 4001):
        cosine, sine = ctypes.c_double(), ctypes.c_double()
        function(angle, cosine, sine)
        assert (cosine.value, sine.value) == pytest.approx((np.cos(angle), np.sin(angle)), abs=1e-12)
