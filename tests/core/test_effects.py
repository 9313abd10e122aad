"""Each effect that runs on the device: its C file against its Python file, on the same samples."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.effects.base import effects
from gyrocal.recording.session import Run
from gyrocal_firmware import CORE

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


@pytest.mark.parametrize("effect_id", IDS)
@pytest.mark.parametrize(("face", "table_dps"), [("up", 78.0), ("down", 78.0), ("up", -30.5), ("down", 0.0)])
def test_c_column_is_the_python_column(
    build: Build, tmp_path: Path, effect_id: str, face: str, table_dps: float
) -> None:
    source = tmp_path / f"{effect_id}.c"
    source.write_text(PROGRAM % {"id": effect_id})
    rng = np.random.default_rng(1)
    t_s = np.round(np.arange(200) / 145, 6)
    sign = 1.0 if face == "up" else -1.0
    frame = pl.DataFrame(
        {
            "t_s": t_s,
            **{name: rng.normal(0, 1, 200) for name in ("gx_dps", "gy_dps", "gz_dps")},
            **{name: rng.normal(0, 0.1, 200) for name in ("ax_g", "ay_g")},
            "az_g": sign + rng.normal(0, 0.01, 200),
            "temp_c": 25 + 0.01 * np.arange(200),
        }
    )
    recorded = Run(0, "a.csv", "s000", face, "z", table_dps, None, None, 3.0, 145.0, frame=frame)
    effect = effects()[effect_id]
    for values in effect.variants([recorded], 2):
        expected = effect.columns(recorded, 2, values)
        arguments = effect.device_arguments(values)
        assert len(arguments) == expected.shape[1]
        rows = np.column_stack(
            [t_s, np.full(200, sign * table_dps), table_dps * t_s / 360, frame["temp_c"], t_s + 3.0]
            + [frame[name] for name in ("ax_g", "ay_g", "az_g")]
        )
        for k, arg in enumerate(arguments):
            line = " ".join(repr(float(x)) for x in (*arg, 0, 0, 0, 0)[:4])
            text = "".join(" ".join(map(repr, map(float, row))) + f" {line}\n" for row in rows)
            got = np.array(run(build(source), text).split(), float)
            np.testing.assert_allclose(got, expected[:, k], rtol=1e-5, atol=1e-5 * np.abs(expected).max())
