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

SHIM = Path(__file__).with_name("estimator_shim.c")

MOST_TIMES = 3
"""The largest number of times at which the core answers: GC_CHECKPOINTS."""


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
    """The core's estimator with a ``calibration.h`` as ``gyrocal export`` writes it.

    Raises:
        InputError: the file does not exist or is not such a header.
    """

    def __init__(self, header: Path) -> None:
        try:
            text = header.read_text()
            built = build("model", core_sources(), [CORE], SHARED, {"calibration.h": text, SHIM.name: SHIM.read_text()})
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
            up_dps, down_dps: measured minus true rate (dps) of consecutive samples, from each run's first on, [n, samples].
            protocol: sample rate, table's rate and power-on times of the runs.
            seconds: the durations after which to answer, ascending, at most three.
            temp_c: the temperature of both runs, degC.

        Raises:
            InputError: a shape is wrong, or the core refuses the calibration.
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
            raise InputError(f"{self.source}: the core rejects it: error {error}")
        return out
