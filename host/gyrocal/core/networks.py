"""The networks of a C header, run by the core as the device runs them."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.core.library import SHARED, CacheError, build, compiler
from gyrocal.errors import GyrocalError, InputError
from gyrocal_firmware import CORE, INCLUDE

SHIM = Path(__file__).with_name("net_shim.c")


class _Conv(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_uint32) for name in ("channels", "kernel", "pool", "columns"))


class _Net(ctypes.Structure):
    """The fields of ``gc_cnn_net_t`` up to its weights."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        *((name, ctypes.c_float) for name in ("rate_hz", "table_dps", "clip_dps", "leak")),
        ("window", ctypes.c_uint32),
        ("head", _Conv),
        ("combined", _Conv),
        *((name, ctypes.c_uint32) for name in ("hidden", "outputs", "scratch_floats")),
    )


def _build_net(header: Path, fixed: bool) -> ctypes.CDLL:
    try:
        text = header.read_text() if header.is_file() else None
    except (OSError, UnicodeDecodeError):
        text = None
    if text is None:
        raise InputError(f"{header}: not a readable header; write one with `gyrocal export`")
    compiler()
    sources = [CORE / f"gc_{name}.c" for name in ("cnn", "convnet", "convnet_fixed", "convnet_float", "math")]
    flags = [*SHARED, f"-DGC_NET_FIXED={int(fixed)}"]
    try:
        built = build("net", sources, [CORE], flags, {"weights.h": text, SHIM.name: SHIM.read_text()})
    except CacheError:
        raise
    except GyrocalError as error:
        raise InputError(f"{header}: not a network's header ({error}); write one with `gyrocal export`") from error
    return ctypes.CDLL(str(built))


class _HeaderNetwork:
    """What both networks of a ``weights.h`` have in common.

    Attributes:
        source: the header's path.
        name: the network's name.
        rate_hz: the sample rate that it was trained for.
        table_dps: the table's rate that it was trained for.
    """

    def __init__(self, header: Path, accessor: str, struct: type[ctypes.Structure], *, fixed: bool = False) -> None:
        self.source = str(header)
        self._library = _build_net(header, fixed)
        function = self._library[accessor]
        function.restype = ctypes.POINTER(struct)
        self._pointer = function()
        if not self._pointer:
            raise InputError(f"{header}: holds no network gyrocal; write one with `gyrocal export`")
        net = self._net = self._pointer.contents
        self.name: str = net.name.decode()
        self.rate_hz: float = net.rate_hz
        self.table_dps: float = net.table_dps


class CoreNetwork(_HeaderNetwork):
    """Network `paper` of a C header, run by the core as the device runs it.

    Args:
        header: a ``weights.h`` as ``gyrocal export`` writes it; the shipped one by default.

    Attributes:
        clip_dps: a measured minus true rate beyond it is set to it.
        window: samples of each face in one window.
        outputs: numbers that one pair of windows gives.
        scratch_floats: working memory of one answer, in floats.
        convnet: True if the header also holds network `gyrocal`, which then answers in this one's place.

    Raises:
        InputError: the file does not exist or is not such a header.
    """

    def __init__(self, header: Path = INCLUDE / "weights.h") -> None:
        super().__init__(header, "gyrocal_net", _Net)
        self.clip_dps: float = self._net.clip_dps
        self.window: int = self._net.window
        self.outputs: int = self._net.outputs
        self.scratch_floats: int = self._net.scratch_floats
        self._library.gyrocal_convnet.restype = ctypes.c_void_p
        self.convnet = bool(self._library.gyrocal_convnet())
        self._run = self._library.gyrocal_net_run
        pointer = np.ctypeslib.ndpointer(np.float32, flags="C_CONTIGUOUS")
        self._run.argtypes = [pointer, pointer, ctypes.c_uint32, ctypes.c_float, ctypes.c_float, pointer]

    def run(
        self, up_residual_dps: ArrayLike, down_residual_dps: ArrayLike, w_up_dps: float, w_down_dps: float
    ) -> NDArray[np.float32]:
        """Estimate scale and bias (dps) from each pair of windows.

        Args:
            up_residual_dps, down_residual_dps: measured minus true rate in dps, [n, window].
            w_up_dps, w_down_dps: the true rates about the sensed axis in dps.

        Returns:
            [n, 2]: scale and bias in dps.

        Raises:
            InputError: a shape is wrong, or the core refuses a rate or a NaN.
        """
        up, down = (np.ascontiguousarray(np.atleast_2d(x), np.float32) for x in (up_residual_dps, down_residual_dps))
        if up.shape != down.shape or up.shape[1] != self.window:
            raise InputError(
                f"network {self.name} takes two [n, {self.window}] windows, not {up.shape} and {down.shape}"
            )
        out = np.empty((len(up), self.outputs), np.float32)
        error = self._run(up, down, len(up), w_up_dps, w_down_dps, out)
        if error:
            raise InputError(
                f"network {self.name} was trained at {self.table_dps:g} and {-self.table_dps:g} dps and takes no NaN: "
                f"error {error} at true rates {w_up_dps:g} and {w_down_dps:g} dps"
            )
        return out


class _Convnet(ctypes.Structure):
    """The first fields of ``gc_convnet_t``."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        *((name, ctypes.c_float) for name in ("rate_hz", "table_dps", "unit_dps", "column_range_dps", "sample_range_dps")),
    )


class CoreFaceNetwork(_HeaderNetwork):
    """Network `gyrocal` of a C header, run by the core on raw counts as the device runs it.

    Args:
        header: a ``weights.h`` as ``gyrocal export`` writes it; the shipped one by default.
        fixed: True for the layers in integers (GC_NET_FIXED), False for those in float32.

    Attributes:
        unit_dps: the rate that is 1 in the network's own unit.
        column_range_dps: the largest difference between a column and the mean of the run in the training data.
        sample_range_dps: the largest difference between a reading and its column that is accepted.

    Raises:
        InputError: the file does not exist or holds no such network.
    """

    def __init__(self, header: Path = INCLUDE / "weights.h", *, fixed: bool = False) -> None:
        super().__init__(header, "gyrocal_convnet", _Convnet, fixed=fixed)
        library = self._library
        self.unit_dps: float = self._net.unit_dps
        self.column_range_dps: float = self._net.column_range_dps
        self.sample_range_dps: float = self._net.sample_range_dps
        library.gc_convnet_samples.argtypes = [ctypes.c_void_p, ctypes.c_uint]
        library.gc_convnet_samples.restype = ctypes.c_uint32
        self._samples = [library.gc_convnet_samples(self._pointer, stage) for stage in range(3)]
        for function, number in ((library.gyrocal_convnet_infer, np.float32), (library.gyrocal_convnet_face, np.float64)):
            function.argtypes = [
                np.ctypeslib.ndpointer(np.int16, flags="C_CONTIGUOUS"), ctypes.c_uint32, ctypes.c_uint, ctypes.c_double,
                ctypes.c_double, np.ctypeslib.ndpointer(number, flags="C_CONTIGUOUS"),
            ]  # fmt: skip

    def infer(self, counts: ArrayLike, stage: int, lsb_dps: float, w_dps: float) -> NDArray[np.float32]:
        """The network's own outputs for n recordings of one face.

        Args:
            counts: raw readings, [n, samples].
            stage: 0, 1 or 2 for the answer after 2, 4 or 6 s.
            lsb_dps: the rate of one count.
            w_dps: the true rate about the sensed axis.

        Returns:
            [n, 2]: u less the mean, in units of ``unit_dps``, and the logarithm of its precision; NaN where the readings are
            out of the range of the training.

        Raises:
            InputError: a wrong number of samples, or the core refuses the rate.
        """
        x = self._counts(counts, stage)
        out = np.empty((len(x), 2), np.float32)
        self._check(self._library.gyrocal_convnet_infer(x, len(x), stage, lsb_dps, w_dps, out), w_dps)
        return out

    def face(self, counts: ArrayLike, stage: int, lsb_dps: float, w_dps: float) -> NDArray[np.float64]:
        """The sum w·scale + bias (dps) and its precision (1/dps^2), [n, 2]; NaN where the readings are out of range.

        The arguments and errors are those of ``infer``.
        """
        x = self._counts(counts, stage)
        out = np.empty((len(x), 2))
        self._check(self._library.gyrocal_convnet_face(x, len(x), stage, lsb_dps, w_dps, out), w_dps)
        return out

    def merge(self, up: ArrayLike, down: ArrayLike, prior_mean: ArrayLike, prior_root: ArrayLike) -> NDArray[np.float64]:
        """Scale, bias (dps) and their standard deviations, [n, 4], of n pairs of faces.

        Args:
            up, down: w (dps), u (dps) and precision (1/dps^2) of each face, [n, 3].
            prior_mean: the prior's bias (dps) and scale, [2].
            prior_root: the upper-triangular square root of the prior's information, [2, 2].
        """
        faces = np.ascontiguousarray(np.stack([np.asarray(up, float), np.asarray(down, float)], axis=1))
        out = np.empty((len(faces), 4))
        pointer = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
        function = self._library.gyrocal_convnet_merge
        function.argtypes, function.restype = [pointer, pointer, pointer, ctypes.c_uint32, pointer], None
        function(*(np.ascontiguousarray(x, float) for x in (prior_mean, prior_root)), faces, len(faces), out)
        return out

    def _counts(self, counts: ArrayLike, stage: int) -> NDArray[np.int16]:
        x = np.ascontiguousarray(np.atleast_2d(counts), np.int16)
        if x.shape[1:] != (self._samples[stage],):
            raise InputError(f"network {self.name} takes [n, {self._samples[stage]}] readings, not {x.shape}")
        return x

    def _check(self, error: int, w_dps: float) -> None:
        if error:
            raise InputError(
                f"network {self.name} was trained at {self.table_dps:g} and {-self.table_dps:g} dps: error {error} at a true "
                f"rate of {w_dps:g} dps"
            )
