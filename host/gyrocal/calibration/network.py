"""The networks on this machine, by onnxruntime: `paper`, scale and bias from two windows of rate, and `gyrocal`, the same
with standard deviations from the block means of 2, 4 or 6 s."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, ClassVar, Self

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


class OnnxNetwork:
    """What both networks are: an ONNX graph as ``gyrocal export`` writes it, that takes both faces and answers with ``y``.

    Attributes:
        name: of the network.
        rate_hz, table_dps: sample rate and speed of the table that it was trained at.
    """

    FILE: ClassVar[str]
    """The graph that ships."""
    LACKS: ClassVar[str]
    """What is said of a graph whose metadata are not this network's."""

    def __init__(self, session: Any, source: str) -> None:
        self.source = source
        self._session = session
        try:
            self._read({value.name: value.shape for value in session.get_inputs()}, session.get_modelmeta().custom_metadata_map)
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"{source}: {self.LACKS}") from error

    def _read(self, shapes: Mapping[str, list[Any]], metadata: Mapping[str, str]) -> None:
        """Takes what is known of the graph. InputError where the ``shapes`` of its inputs are not this network's."""
        self.name: str = metadata["name"]
        self.rate_hz, self.table_dps = float(metadata["rate_hz"]), float(metadata["table_dps"])

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Read an ONNX file.

        Raises:
            InputError: no such file, or not a network of this kind.
        """
        return cls(_session(path), str(path))

    @classmethod
    @cache
    def shipped(cls) -> Self:
        """The quantised network that ships: the one whose numbers the device gives."""
        with as_file(files("gyrocal") / "data" / cls.FILE) as path:
            return cls.open(path)

    def _faces(
        self, up: ArrayLike, down: ArrayLike, shape: tuple[int, str], w_up_dps: float, w_down_dps: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Both faces [n, columns] as float32, ``shape`` columns of what. InputError: another shape or rate, a NaN."""
        first, second = (np.atleast_2d(np.asarray(x, np.float32)) for x in (up, down))
        columns, what = shape
        if first.shape != second.shape or first.shape[1:] != (columns,):
            raise InputError(f"network {self.name} takes two [n, {columns}] {what}, not {first.shape} and {second.shape}")
        off = (w_up_dps - self.table_dps, w_down_dps + self.table_dps)
        if not all(abs(x) <= RATE_TOLERANCE * self.table_dps for x in off):
            raise InputError(
                f"network {self.name} was trained at true rates {self.table_dps:g} and {-self.table_dps:g} dps, "
                f"not {w_up_dps:g} and {w_down_dps:g}; train one for this table"
            )
        if np.isnan(first).any() or np.isnan(second).any():
            raise InputError(f"network {self.name}: a reading is NaN")
        return first, second

    def _run(self, **inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        y: NDArray[np.float32] = self._session.run(["y"], inputs)[0]
        return y


class Network(OnnxNetwork):
    """Network `paper`: windows of both faces -> scale and bias.

    Attributes:
        window: samples of each run.
    """

    FILE = "paper.int8.onnx"
    LACKS = "not a gyrocal network: name, rate_hz, table_dps or its window is missing"

    def _read(self, shapes: Mapping[str, list[Any]], metadata: Mapping[str, str]) -> None:
        if list(shapes) != ["up", "down"] or any(len(s) != 4 or s[1:3] != [1, 2] for s in shapes.values()):
            raise InputError(f"{self.source}: not a gyrocal network: its inputs are not up and down, [N, 1, 2, window]")
        super()._read(shapes, metadata)
        self.window = int(shapes["up"][3])

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
        up, down = self._faces(up_residual_dps, down_residual_dps, (self.window, "windows"), w_up_dps, w_down_dps)
        return self._run(up=image(up, w_up_dps), down=image(down, w_down_dps))


def image(residual_dps: NDArray[np.float32], w_dps: float) -> NDArray[np.float32]:
    """The network's input: [n, 1, 2, window], row 0 measured - true rate, row 1 true rate (dps)."""
    return np.stack([residual_dps, np.full_like(residual_dps, w_dps)], axis=1)[:, None]


STAGES_S = (2.0, 4.0, 6.0)
BLOCK_S = 0.25
BLOCKS = 24


class BlockNetwork(OnnxNetwork):
    """Network `gyrocal`: block means of both faces and the stage -> scale, bias and their standard deviations.

    Attributes:
        clip_dps: the largest |measured - true rate| that it was trained on; what is beyond counts as this.
    """

    FILE = "gyrocal.int8.onnx"
    LACKS = "not network gyrocal: rate_hz, table_dps or clip_dps is missing"

    def _read(self, shapes: Mapping[str, list[Any]], metadata: Mapping[str, str]) -> None:
        of_one = {name: shape[1:] for name, shape in shapes.items()}
        if of_one != {"up": [BLOCKS], "down": [BLOCKS], "stage": [len(STAGES_S)]} or metadata.get("name") != "gyrocal":
            raise InputError(f"{self.source}: not network gyrocal: its inputs are not up and down [N, 24] and stage [N, 3]")
        super()._read(shapes, metadata)
        self.clip_dps = float(metadata["clip_dps"])

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
        up, down = self._faces(up_dps, down_dps, (BLOCKS, "block means"), w_up_dps, w_down_dps)
        one_hot = np.zeros((len(up), len(STAGES_S)), np.float32)
        one_hot[:, stage] = 1.0
        return self._run(up=up, down=down, stage=one_hot)


def open_network(path: str | Path) -> Network | BlockNetwork:
    """An ONNX file of either network.

    Raises:
        InputError: no such file, or neither network.
    """
    session = _session(path)
    kind = BlockNetwork if session.get_modelmeta().custom_metadata_map.get("name") == "gyrocal" else Network
    return kind(session, str(path))
