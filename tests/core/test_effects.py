"""Each effect that runs on the device: its C file against its Python file, on the same samples."""

from pathlib import Path

import numpy as np
import pytest

from gyrocal.effects.base import effects
from gyrocal_firmware import CORE
from make_runs import make_run

from .conftest import Build, run

IDS = sorted(path.stem for path in (CORE / "effects").glob("*.c"))

PROGRAM = """
#include "gc_calibration.h"
#include <stdio.h>
GC_EFFECT(%(id)s);
int main(void) {
    gc_effect_input_t in;
    float arg[GC_EFFECT_ARGS];
    while (scanf("%%f %%f %%f %%f %%f %%f %%f %%f %%f %%f %%f %%f", &in.t_s, &in.rate_dps, &in.theta_turn, &in.temp_c,
                 &in.power_on_s, in.acc_g, in.acc_g + 1, in.acc_g + 2, arg, arg + 1, arg + 2, arg + 3) == 12) {
        printf("%%.9g\\n", (double)gc_effect_%(id)s(&in, arg));
    }
    return 0;
}
"""


def test_the_folders_hold_the_same_effects() -> None:
    assert sorted(e.id for e in effects().values() if e.on_device) == IDS


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the program of each effect, so that each is built once."""
    folder = tmp_path_factory.mktemp("effects")
    for effect_id in IDS:
        (folder / f"{effect_id}.c").write_text(PROGRAM % {"id": effect_id})
    return folder


@pytest.mark.parametrize("effect_id", IDS)
@pytest.mark.parametrize(("face", "table_dps"), [("up", 78.0), ("down", 78.0), ("up", -30.5), ("down", 0.0)])
def test_c_column_is_the_python_column(
    build: Build, programs: Path, effect_id: str, face: str, table_dps: float
) -> None:
    rng = np.random.default_rng(1)
    t_s = np.round(np.arange(200) / 145, 6)
    sign = 1.0 if face == "up" else -1.0
    acc_g, temp_c = rng.normal([0, 0, sign], 0.5, (200, 3)), rng.uniform(-20, 70, 200)
    columns = {f"a{a}_g": acc_g[:, k] for k, a in enumerate("xyz")} | {"temp_c": temp_c}
    recorded = make_run(t_s, table_rate_dps=table_dps, face=face, power_on_s=3.0, **columns)
    effect = effects()[effect_id]
    for values in filter(effect.runs_on_device, effect.variants([recorded], 2)):
        expected = effect.columns(recorded.as_measured(), 2, values)
        arguments = effect.device_arguments(values)
        assert len(arguments) == expected.shape[1]
        rows = np.column_stack([t_s, np.full(200, sign * table_dps), table_dps * t_s / 360, temp_c, t_s + 3.0, *acc_g.T])
        for k, arg in enumerate(arguments):
            line = " ".join(repr(float(x)) for x in (*arg, 0, 0, 0, 0)[:4])
            text = "".join(" ".join(map(repr, map(float, row))) + f" {line}\n" for row in rows)
            got = np.array(run(build(programs / f"{effect_id}.c"), text).split(), float)
            np.testing.assert_allclose(got, expected[:, k], rtol=1e-5, atol=1e-5 * np.abs(expected).max())
