"""The networks on this machine, run by onnxruntime. `paper` gives scale and bias from two windows of rate; `gyrocal` gives
them with standard deviations from the readings of 2, 4 or 6 s."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.calibration.network_answer import near_training
from gyrocal.calibration.runtime import onnxruntime
from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

"""Of the sample rate; the device has the same."""


def _session(path: str | Path) -> Any:
    runtime = onnxruntime()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 4
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file; write a network with `gyrocal export`")
    try:
        return runtime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no base class in common
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"{path}: not an ONNX network ({reason}); write one with `gyrocal export`") from error


class OnnxNetwork:
    """An ONNX graph as ``gyrocal export`` writes it, with the output ``y``: the base of both networks.

    Attributes:
        name: the name of the network.
        rate_hz, table_dps: the sample rate and the table rate of its training.
    """

    FILE: ClassVar[str]
    """The shipped graph."""
    LACKS: ClassVar[str]
    """The end of the error message for a graph whose metadata are not those of this network."""

    def __init__(self, session: Any, source: str) -> None:
        self.source = source
        self._session = session
        try:
            self._read({value.name: value.shape for value in session.get_inputs()}, session.get_modelmeta().custom_metadata_map)
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"{source}: {self.LACKS}") from error

    def _read(self, shapes: Mapping[str, list[Any]], metadata: Mapping[str, str]) -> None:
        """Read the graph's metadata. Raises InputError if the ``shapes`` of its inputs are not those of this network."""
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
        """The shipped quantised network, whose numbers the device gives."""
        with as_file(files("gyrocal") / "data" / cls.FILE) as path:
            return cls.open(path)

    def _run(self, **inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        y: NDArray[np.float32] = self._session.run(["y"], inputs)[0]
        return y


class Network(OnnxNetwork):
    """Network `paper`, which estimates scale and bias from windows of both faces.

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
        up, down = (np.atleast_2d(np.asarray(x, np.float32)) for x in (up_residual_dps, down_residual_dps))
        if up.shape != down.shape or up.shape[1:] != (self.window,):
            raise InputError(f"network {self.name} takes two [n, {self.window}] windows, not {up.shape} and {down.shape}")
        off = (w_up_dps - self.table_dps, w_down_dps + self.table_dps)
        if not all(abs(x) <= POLICY.network_table_rate * self.table_dps for x in off):
            raise InputError(
                f"network {self.name} was trained at true rates {self.table_dps:g} and {-self.table_dps:g} dps, "
                f"not {w_up_dps:g} and {w_down_dps:g}; train one for this table"
            )
        if np.isnan(up).any() or np.isnan(down).any():
            raise InputError(f"network {self.name}: a reading is NaN")
        return self._run(up=image(up, w_up_dps), down=image(down, w_down_dps))


def image(residual_dps: NDArray[np.float32], w_dps: float) -> NDArray[np.float32]:
    """The network's input [n, 1, 2, window], dps. Row 0 is the measured minus the true rate, row 1 the true rate."""
    return np.stack([residual_dps, np.full_like(residual_dps, w_dps)], axis=1)[:, None]


STAGES_S = (2.0, 4.0, 6.0)


@dataclass(frozen=True)
class Prior:
    """Priors of scale and bias, each as (mean, sd). The prior is flat if the sd is infinite."""

    scale: tuple[float, float] = (0.0, np.inf)
    bias_dps: tuple[float, float] = (0.0, np.inf)

    @property
    def is_known(self) -> bool:
        """True unless both priors are flat."""
        return bool(np.isfinite(self.scale[1]) or np.isfinite(self.bias_dps[1]))


FLAT = Prior()


@dataclass(frozen=True)
class FaceAnswers:
    """Estimates of u = w·scale + bias from one face at true rate ``w_dps``; arrays [n].

    Attributes:
        u_dps, precision: mean, and 1/variance (1/dps^2).
        in_range: True if the readings less their mean are in the range of the training data. Other estimates are meaningless.
    """

    w_dps: float
    u_dps: Array
    precision: Array
    in_range: NDArray[np.bool_]


def merge(up: FaceAnswers, down: FaceAnswers, prior: Prior = FLAT) -> Array:
    """Scale, bias (dps) and their standard deviations, [n, 4]; NaN where a face is out of range.

    Two points of a line are combined with a Gaussian prior in closed form, as ``gc_convnet_merge`` does.
    """
    of_scale, of_bias = (0.0 if np.isinf(sd) else 1 / sd**2 for _, sd in (prior.scale, prior.bias_dps))
    p_up, p_down, w_up, w_down = up.precision, down.precision, up.w_dps, down.w_dps
    bb = of_bias + p_up + p_down
    bs = p_up * w_up + p_down * w_down
    ss = of_scale + p_up * w_up**2 + p_down * w_down**2
    b = of_bias * prior.bias_dps[0] + p_up * up.u_dps + p_down * down.u_dps
    s = of_scale * prior.scale[0] + p_up * w_up * up.u_dps + p_down * w_down * down.u_dps
    det = bb * ss - bs**2
    y = np.column_stack([(bb * s - bs * b) / det, (ss * b - bs * s) / det, np.sqrt(bb / det), np.sqrt(ss / det)])
    return np.where((up.in_range & down.in_range)[:, None], y, np.nan)


class FaceNetwork(OnnxNetwork):
    """Network `gyrocal`, which estimates w·scale + bias and its precision from the readings of one face.

    Attributes:
        unit_dps: the unit of the graph's answer.
        column_range_dps: the largest deviation of a column (the mean of ``pool`` samples) from the mean of all readings.
        sample_range_dps: the largest deviation of a reading from its column.
        pool: the number of samples in a column.
    """

    FILE = "gyrocal.int8.onnx"
    LACKS = "not network gyrocal: rate_hz, table_dps, pool, unit_dps or a range is missing"

    def _read(self, shapes: Mapping[str, list[Any]], metadata: Mapping[str, str]) -> None:
        of_one = {name: shape[1:] for name, shape in shapes.items()}
        stages = len(STAGES_S)
        if of_one.keys() != {"readings", "stage"} or of_one["stage"] != [stages] or metadata.get("name") != "gyrocal":
            what = "readings [N, 1, samples] and stage [N, 3]"
            raise InputError(f"{self.source}: not network gyrocal: its inputs are not {what}")
        super()._read(shapes, metadata)
        self.unit_dps, self.column_range_dps, self.sample_range_dps = (
            float(metadata[name]) for name in ("unit_dps", "column_range_dps", "sample_range_dps")
        )
        self.pool = int(metadata["pool"])
        self._samples = int(of_one["readings"][1])

    def samples(self, stage: int) -> int:
        """Number of samples of each run that stage 0, 1 or 2 takes, which are those of the first 2, 4 or 6 s."""
        return self._samples // len(STAGES_S) * (stage + 1)

    def suits(self, rate_hz: float, w_dps: float) -> bool:
        """True if the network was trained at this sample rate, and at this true rate or its opposite."""
        return near_training(rate_hz, w_dps, self.rate_hz, self.table_dps)

    def face(self, residual_dps: ArrayLike, stage: int, w_dps: float) -> FaceAnswers:
        """Estimate u = w·scale + bias from the readings of one face.

        Args:
            residual_dps: measured minus true rate, [n, samples(stage)], of consecutive samples from the first one of the run.
                A reading that is not a number is out of range.
            stage: 0, 1 or 2 for the answer after 2, 4 or 6 s.
            w_dps: the true rate about the sensed axis, +table_dps or -table_dps within 3 %.

        Raises:
            InputError: a wrong shape or true rate.
        """
        answer = self.infer(residual_dps, stage, w_dps)
        with np.errstate(invalid="ignore"):
            mean = np.mean(np.atleast_2d(np.asarray(residual_dps, float)), axis=1)
        u_dps = mean + np.sign(w_dps) * self.unit_dps * answer[:, 0]
        return FaceAnswers(w_dps, u_dps, np.exp(answer[:, 1]) / self.unit_dps**2, np.isfinite(answer[:, 0]))

    def infer(self, residual_dps: ArrayLike, stage: int, w_dps: float) -> Array:
        """The graph's own output for :meth:`face`, [n, 2], in the network's units.

        It is the correction of the mean in the direction of the true rate, and the logarithm of its precision. Both are NaN if
        the readings are out of range.
        """
        y = np.atleast_2d(np.asarray(residual_dps, float))
        if y.shape[1:] != (self.samples(stage),):
            raise InputError(f"network {self.name} takes [n, {self.samples(stage)}] readings, not {y.shape}")
        if not self.suits(self.rate_hz, w_dps):
            raise InputError(
                f"network {self.name} was trained at true rates {self.table_dps:g} and {-self.table_dps:g} dps, "
                f"not {w_dps:g}; train one for this table"
            )
        with np.errstate(invalid="ignore"):
            x = y - y.mean(axis=1, keepdims=True)
            columns = x.reshape(len(x), -1, self.pool)
            means = columns.mean(axis=2)
            off = np.abs(columns - means[:, :, None]).max(axis=(1, 2))
            in_range = (np.abs(means).max(axis=1) <= self.column_range_dps) & (off <= self.sample_range_dps)
        readings = np.zeros((len(x), 1, self._samples), np.float32)
        readings[in_range, 0, : y.shape[1]] = np.sign(w_dps) * x[in_range]
        one_hot = np.zeros((len(x), len(STAGES_S)), np.float32)
        one_hot[:, stage] = 1.0
        return np.where(in_range[:, None], self._run(readings=readings, stage=one_hot).astype(float), np.nan)

    def estimate(
        self, up_dps: ArrayLike, down_dps: ArrayLike, stage: int, w_up_dps: float, w_down_dps: float, prior: Prior = FLAT
    ) -> Array:
        """Scale, bias (dps) and their standard deviations, [n, 4], from :meth:`face` of both faces and :func:`merge`."""
        up, down = self.face(up_dps, stage, w_up_dps), self.face(down_dps, stage, w_down_dps)
        if np.sign(w_up_dps) == np.sign(w_down_dps):
            said = f"true rates of {w_up_dps:g} and {w_down_dps:g} dps"
            raise InputError(f"{said} do not tell scale from bias; turn the sensor over")
        return merge(up, down, prior)


def open_network(path: str | Path) -> Network | FaceNetwork:
    """An ONNX file of either network.

    Raises:
        InputError: no such file, or neither network.
    """
    session = _session(path)
    kind = FaceNetwork if session.get_modelmeta().custom_metadata_map.get("name") == "gyrocal" else Network
    return kind(session, str(path))
