"""The networks on this machine, by onnxruntime: `paper`, scale and bias from two windows of rate, and `gyrocal`, the same
with standard deviations from the block means of 2, 4 or 6 s."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.errors import InputError

RATE_TOLERANCE = 0.03  # of the table's rate; gc_cnn.c has the same


def _session(path: str | Path) -> Any:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 4
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file; write a network with `gyrocal export`")
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors share no base class of their own
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"{path}: not an ONNX network ({reason}); write one with `gyrocal export`") from error


def _check_rates(net: Network | BlockNetwork, w_up_dps: float, w_down_dps: float) -> None:
    off = (w_up_dps - net.table_dps, w_down_dps + net.table_dps)
    if not all(abs(x) <= RATE_TOLERANCE * net.table_dps for x in off):
        raise InputError(
            f"network {net.name} was trained at true rates {net.table_dps:g} and {-net.table_dps:g} dps, "
            f"not {w_up_dps:g} and {w_down_dps:g}; train one for this table"
        )


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
            raise InputError(f"{source}: not a gyrocal network: name, rate_hz, table_dps or its window is missing") from error

    @classmethod
    def open(cls, path: str | Path) -> Network:
        """Read an ONNX file.

        Raises:
            InputError: no such file, or not a network of this kind.
        """
        return cls(_session(path), str(path))

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
            raise InputError(f"network {self.name} takes two [n, {self.window}] windows, not {up.shape} and {down.shape}")
        _check_rates(self, w_up_dps, w_down_dps)
        if np.isnan(up).any() or np.isnan(down).any():
            raise InputError(f"network {self.name}: a reading is NaN")
        y: NDArray[np.float32] = self._session.run(["y"], {"up": image(up, w_up_dps), "down": image(down, w_down_dps)})[0]
        return y


def image(residual_dps: NDArray[np.float32], w_dps: float) -> NDArray[np.float32]:
    """The network's input: [n, 1, 2, window], row 0 measured - true rate, row 1 true rate (dps)."""
    return np.stack([residual_dps, np.full_like(residual_dps, w_dps)], axis=1)[:, None]


STAGES_S = (2.0, 4.0, 6.0)
BLOCK_S = 0.25
BLOCKS = 24


class BlockNetwork:
    """Network `gyrocal`: block means of both faces and the stage -> scale, bias and their standard deviations.

    Attributes:
        name: of the network.
        rate_hz, table_dps: sample rate and speed of the table that it was trained at.
        clip_dps: the largest |measured - true rate| that it was trained on; what is beyond counts as this.
    """

    def __init__(self, session: Any, source: str) -> None:
        self.source = source
        self._session = session
        metadata = session.get_modelmeta().custom_metadata_map
        shapes = {value.name: value.shape[1:] for value in session.get_inputs()}
        if shapes != {"up": [BLOCKS], "down": [BLOCKS], "stage": [len(STAGES_S)]} or metadata.get("name") != "gyrocal":
            raise InputError(f"{source}: not network gyrocal: its inputs are not up and down [N, 24] and stage [N, 3]")
        try:
            self.name: str = metadata["name"]
            self.rate_hz, self.table_dps = float(metadata["rate_hz"]), float(metadata["table_dps"])
            self.clip_dps = float(metadata["clip_dps"])
        except (KeyError, ValueError) as error:
            raise InputError(f"{source}: not network gyrocal: rate_hz, table_dps or clip_dps is missing") from error

    @classmethod
    def open(cls, path: str | Path) -> BlockNetwork:
        """Read an ONNX file.

        Raises:
            InputError: no such file, or not a network of this kind.
        """
        return cls(_session(path), str(path))

    @classmethod
    @cache
    def shipped(cls) -> BlockNetwork:
        """The quantised network that ships: the one whose numbers the device gives."""
        with as_file(files("gyrocal") / "data" / "gyrocal.int8.onnx") as path:
            return cls.open(path)

    def samples(self, stage: int) -> int:
        """Samples of each run that stage 0, 1 or 2 takes: those of the first 2, 4 or 6 s."""
        return int(STAGES_S[stage] * self.rate_hz + 0.5)

    def block_means(self, residual_dps: ArrayLike) -> NDArray[np.float32]:
        """Means [n, 24] over blocks of 0.25 s of consecutive samples [n, m]; zero where there are none."""
        y = np.atleast_2d(np.asarray(residual_dps, float))
        block = (np.arange(y.shape[1]) * (1 / BLOCK_S / self.rate_hz)).astype(np.int64)
        numbers, first, count = np.unique(block, return_index=True, return_counts=True)
        means = np.zeros((len(y), BLOCKS), np.float32)
        means[:, numbers[:BLOCKS]] = (np.add.reduceat(y, first, axis=1) / count)[:, :BLOCKS]
        return means

    def estimate(
        self, up_dps: ArrayLike, down_dps: ArrayLike, stage: int, w_up_dps: float, w_down_dps: float
    ) -> NDArray[np.float32]:
        """Scale, bias (dps) and their standard deviations, [n, 4].

        Args:
            up_dps, down_dps: block means of measured - true rate, [n, 24].
            stage: 0, 1 or 2: of 2, 4 or 6 s.
            w_up_dps, w_down_dps: the true rates about the sensed axis: +table_dps and -table_dps within 3 %.

        Raises:
            InputError: a wrong shape or true rate, or a NaN.
        """
        up, down = (np.atleast_2d(np.asarray(x, np.float32)) for x in (up_dps, down_dps))
        if up.shape != down.shape or up.shape[1:] != (BLOCKS,):
            raise InputError(f"network {self.name} takes two [n, {BLOCKS}] block means, not {up.shape} and {down.shape}")
        _check_rates(self, w_up_dps, w_down_dps)
        if np.isnan(up).any() or np.isnan(down).any():
            raise InputError(f"network {self.name}: a reading is NaN")
        one_hot = np.zeros((len(up), len(STAGES_S)), np.float32)
        one_hot[:, stage] = 1.0
        y: NDArray[np.float32] = self._session.run(["y"], {"up": up, "down": down, "stage": one_hot})[0]
        return y


def open_network(path: str | Path) -> Network | BlockNetwork:
    """An ONNX file of either network.

    Raises:
        InputError: no such file, or neither network.
    """
    session = _session(path)
    kind = BlockNetwork if session.get_modelmeta().custom_metadata_map.get("name") == "gyrocal" else Network
    return kind(session, str(path))
