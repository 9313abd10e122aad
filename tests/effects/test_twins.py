"""Every ``effects/<id>.c`` of the core against the columns of ``<id>.py``, over the folder."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.core.library import build_core
from gyrocal.effects.base import effect, effects
from gyrocal_firmware import CORE

from .conftest import make

TWINS = sorted(path.stem for path in (CORE / "effects").glob("*.c"))
ARGUMENTS = 4


class Input(ctypes.Structure):
    """``gc_effect_input_t``"""

    _fields_ = (
        *((name, ctypes.c_float) for name in ("t_s", "rate_dps", "theta_turn", "temp_c", "power_on_s")),
        ("acc_g", ctypes.c_float * 3),
    )


@pytest.fixture(scope="module")
def core(require_tool: Callable[[str], str]) -> ctypes.CDLL:
    require_tool("cc")
    return ctypes.CDLL(str(build_core()))


def test_every_effect_that_runs_on_the_device_has_a_twin() -> None:
    assert sorted(kind.id for kind in effects().values() if kind.on_device) == TWINS


@pytest.mark.parametrize("face", ["up", "down"])
@pytest.mark.parametrize("effect_id", TWINS)
def test_twin_gives_the_same_columns(effect_id: str, face: str, core: ctypes.CDLL) -> None:
    kind = effect(effect_id)
    function = core[f"gc_effect_{effect_id}"]
    function.restype = ctypes.c_float
    function.argtypes = [ctypes.POINTER(Input), ctypes.c_float * ARGUMENTS]
    rng = np.random.default_rng(7)
    t_s = np.sort(rng.choice(np.arange(40_000), 300, replace=False)) / 1000.0
    acc_g = rng.normal(0, 1, (300, 3))
    run = make(
        t_s, table_rate_dps=78.5, face=face, power_on_s=4.25, temp_c=rng.uniform(-20, 70, 300),
        ax_g=acc_g[:, 0], ay_g=acc_g[:, 1], az_g=acc_g[:, 2],
    )  # fmt: skip
    assert run.temp_c is not None
    elapsed = t_s - t_s[0]
    inputs = [
        Input(
            t,
            run.rate_dps[i],
            run.rate_dps[i] * t / 360,
            run.temp_c[i],
            4.25 + t,
            (ctypes.c_float * 3)(*acc_g[i]),
        )
        for i, t in enumerate(elapsed)
    ]
    variants = kind.variants([run], 2)
    assert variants
    for values in variants:
        columns = kind.columns(run, 2, values)
        arguments = kind.device_arguments(values)
        assert len(arguments) == columns.shape[1] > 0
        for column, given in zip(columns.T, arguments, strict=True):
            assert len(given) <= ARGUMENTS
            arg = (ctypes.c_float * ARGUMENTS)(*given)
            got = np.array([function(ctypes.byref(one), arg) for one in inputs])
            if effect_id == "table_ripple":  # C's angle is of the true rate: face down it runs backwards, and so does its sine
                column = column * (-1.0 if face == "down" and given[1] else 1.0)
            np.testing.assert_allclose(got, column, rtol=2e-6, atol=4e-5 * np.max(np.abs(column)))
