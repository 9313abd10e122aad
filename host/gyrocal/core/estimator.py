"""The C estimator with a ``calibration.h`` on many scenarios at once: what the device answers by method `model`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.calibration.scenarios import Protocol
from gyrocal.core.library import SHARED, build, core_sources
from gyrocal.errors import GyrocalError, InputError
from gyrocal_firmware import CORE

SHIM = """
#include "calibration.h"
#include "gc_error.h"
#include "gc_estimator.h"

typedef struct {
    double rate_hz, table_dps, power_on_s[2], temp_c;
    uint32_t samples, times;
    const uint64_t *until_us;
} protocol_t;

char gyrocal_axis(void);
int gyrocal_run(const protocol_t *p, const double *up, const double *down, uint32_t n, double *out);

char gyrocal_axis(void) { return gc_calibration.axis; }

static void record(const protocol_t *p, unsigned face, const double *residual, gc_marginal_t *at)
{
    const double sign = face == 0u ? 1.0 : -1.0;
    gc_estimator_t e;
    uint32_t next = 0;
    gc_estimator_begin_run(&e, &gc_calibration, p->rate_hz);
    for (uint32_t i = 0; i < p->samples; i++) {
        const uint64_t t_us = (uint64_t)(1e6 * (double)i / p->rate_hz + 0.5);
        const double t_s = 1e-6 * (double)t_us, w_dps = sign * p->table_dps;
        gc_effect_input_t in = {
            .t_s = (float)t_s, .rate_dps = (float)w_dps, .theta_turn = (float)(p->table_dps * t_s / 360.0),
            .temp_c = (float)p->temp_c, .power_on_s = (float)(p->power_on_s[face] + t_s)};
        in.acc_g[gc_calibration.axis - 'x'] = (float)sign;
        while (next < p->times && t_us >= p->until_us[next]) {
            gc_estimator_marginal(&e, &at[next++]);
        }
        gc_estimator_add_sample(&e, t_us / GC_BLOCK_US, w_dps + residual[i], w_dps, &in);
    }
    while (next < p->times) {
        gc_estimator_marginal(&e, &at[next++]);
    }
}

int gyrocal_run(const protocol_t *p, const double *up, const double *down, uint32_t n, double *out)
{
    gc_marginal_t at[2][GC_CHECKPOINTS];
    int error = gc_estimator_check(&gc_calibration);
    for (uint32_t i = 0; i < n && error == GC_OK; i++) {
        record(p, 0, up + i * p->samples, at[0]);
        record(p, 1, down + i * p->samples, at[1]);
        for (uint32_t k = 0; k < p->times && error == GC_OK; k++) {
            gc_answer_t a;
            error = gc_estimator_solve(&gc_calibration, &at[0][k], &at[1][k], &a);
            double *row = out + (k * n + i) * 5u;
            row[0] = a.scale;
            row[1] = a.scale_se;
            row[2] = a.bias_dps;
            row[3] = a.bias_se_dps;
            row[4] = a.misfit;
        }
    }
    return error;
}
"""

MOST_TIMES = 3
"""GC_CHECKPOINTS."""


class _Protocol(ctypes.Structure):
    _fields_ = (
        ("rate_hz", ctypes.c_double),
        ("table_dps", ctypes.c_double),
        ("power_on_s", ctypes.c_double * 2),
        ("temp_c", ctypes.c_double),
        ("samples", ctypes.c_uint32),
        ("times", ctypes.c_uint32),
        ("until_us", ctypes.POINTER(ctypes.c_uint64)),
    )


class CoreEstimator:
    """A ``calibration.h`` as ``gyrocal export`` writes it, in the core's estimator.

    Raises:
        InputError: no such file, or not such a header.
    """

    def __init__(self, header: Path) -> None:
        try:
            text = header.read_text()
            built = build("model", core_sources(), [CORE], SHARED, {"calibration.h": text, "model_shim.c": SHIM})
        except (OSError, UnicodeDecodeError, GyrocalError) as error:
            raise InputError(f"{header}: not a calibration ({error}); write one with `gyrocal export --model`") from error
        self.source = str(header)
        library = ctypes.CDLL(str(built))
        library.gyrocal_axis.restype = ctypes.c_char
        self.axis: str = library.gyrocal_axis().decode()
        self._run = library.gyrocal_run
        array = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
        self._run.argtypes = [ctypes.POINTER(_Protocol), array, array, ctypes.c_uint32, array]

    def answers(
        self, up_dps: ArrayLike, down_dps: ArrayLike, seconds: Sequence[float], protocol: Protocol, temp_c: float = 25.0
    ) -> NDArray[np.float64]:
        """Scale, its standard error, bias (dps), its standard error and misfit, shape [len(seconds), n, 5].

        Args:
            up_dps, down_dps: measured - true rate of consecutive samples from the runs' first on, [n, samples].
            seconds: after how long, ascending, at most three.

        Raises:
            InputError: a wrong shape, or the core's refusal.
        """
        up, down = (np.ascontiguousarray(x, np.float64) for x in (up_dps, down_dps))
        if up.ndim != 2 or up.shape != down.shape:
            raise InputError(f"both faces want [n, samples] of one shape, not {up.shape} and {down.shape}")
        if not 0 < len(seconds) <= MOST_TIMES or list(seconds) != sorted(seconds):
            raise InputError(f"seconds want 1 to {MOST_TIMES} values, ascending, not {seconds}")
        until_us = (ctypes.c_uint64 * len(seconds))(*(round(1e6 * s) for s in seconds))
        setup = _Protocol(
            protocol.rate_hz, protocol.table_dps, protocol.power_on_s, temp_c, up.shape[1], len(seconds), until_us
        )
        out = np.empty((len(seconds), len(up), 5))
        error = self._run(setup, up, down, len(up), out)
        if error:
            raise InputError(f"{self.source}: the core refuses it: error {error}")
        return out
