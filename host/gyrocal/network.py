"""Network `paper` on this machine, by onnxruntime: scale and bias from two windows of rate."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.errors import InputError

RATE_TOLERANCE = 0.03  # of the table's rate; gc_cnn.c has the same


class Network:
    """An ONNX graph as ``gyrocal export`` writes it.

    Attributes:
        name: of the network.
        rate_hz, table_dps: sample rate and speed of the table that it was trained at.
        window: samples of each run.
    """

    def __init__(self, session: Any, source: str) -> None:
        self.source = source
        self._session = session
        shapes = {value.name: value.shape for value in session.get_inputs()}
        if list(shapes) != ["up", "down"] or any(len(s) != 4 or s[1:3] != [1, 2] for s in shapes.values()):
            raise InputError(f"{source}: not a gyrocal network: its inputs are not up and down, [N, 1, 2, window]")
        metadata = session.get_modelmeta().custom_metadata_map
        try:
            self.name: str = metadata["name"]
            self.rate_hz, self.table_dps = float(metadata["rate_hz"]), float(metadata["table_dps"])
            self.window = int(shapes["up"][3])
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(
                f"{source}: not a gyrocal network: name, rate_hz, table_dps or its window is missing"
            ) from error

    @classmethod
    def open(cls, path: str | Path) -> Network:
        """Read an ONNX file.

        Raises:
            InputError: no such file, or not a network of this kind.
        """
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.log_severity_level = 4
        if not Path(path).is_file():
            raise InputError(f"{path}: no such file; write a network with `gyrocal export`")
        try:
            session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors share no base class of their own
            reason = str(error).splitlines()[0][:120]
            raise InputError(f"{path}: not an ONNX network ({reason}); write one with `gyrocal export`") from error
        return cls(session, str(path))

    @classmethod
    @cache
    def shipped(cls) -> Network:
        """The quantised network that ships: the one whose numbers the device gives."""
        with as_file(files("gyrocal") / "data" / "paper.int8.onnx") as path:
            return cls.open(path)

    def estimate(
        self, up_residual_dps: ArrayLike, down_residual_dps: ArrayLike, w_up_dps: float, w_down_dps: float
    ) -> NDArray[np.float32]:
        """Scale and bias (dps) of each pair of windows.

        Args:
            up_residual_dps, down_residual_dps: measured - true rate, [n, window].
            w_up_dps, w_down_dps: the true rates about the sensed axis: +table_dps and -table_dps within 3 %.

        Returns:
            [n, 2]: scale, bias_dps.

        Raises:
            InputError: a wrong shape or true rate, or a NaN.
        """
        up, down = (np.atleast_2d(np.asarray(x, np.float32)) for x in (up_residual_dps, down_residual_dps))
        if up.ndim != 2 or up.shape != down.shape or up.shape[1] != self.window:
            raise InputError(
                f"network {self.name} takes two [n, {self.window}] windows, not {up.shape} and {down.shape}"
            )
        off = (w_up_dps - self.table_dps, w_down_dps + self.table_dps)
        if not all(abs(x) <= RATE_TOLERANCE * self.table_dps for x in off):
            raise InputError(
                f"network {self.name} was trained at true rates {self.table_dps:g} and {-self.table_dps:g} dps, "
                f"not {w_up_dps:g} and {w_down_dps:g}; train one for this table"
            )
        if np.isnan(up).any() or np.isnan(down).any():
            raise InputError(f"network {self.name}: a reading is NaN")
        y: NDArray[np.float32] = self._session.run(["y"], {"up": image(up, w_up_dps), "down": image(down, w_down_dps)})[
            0
        ]
        return y


def image(residual_dps: NDArray[np.float32], w_dps: float) -> NDArray[np.float32]:
    """The network's input: [n, 1, 2, window], row 0 measured - true rate, row 1 true rate (dps)."""
    return np.stack([residual_dps, np.full_like(residual_dps, w_dps)], axis=1)[:, None]
