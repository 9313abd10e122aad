"""The C core on this machine: compiled by the system's ``cc`` into a cache, loaded by ctypes.

The cache is keyed by the sources, headers, flags and compiler, so an edited source or a newly exported header is
picked up at the next call, and processes that build at the same time do not meet.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.errors import GyrocalError, InputError
from gyrocal_firmware import CORE, INCLUDE, SIM

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
SHARED = ("-fPIC", "-shared")

NET_SHIM = """
#include "gc_convnet.h"
#include "gc_error.h"
#include "weights.h"

#include <math.h>

const gc_cnn_net_t *gyrocal_net(void);
const gc_convnet_t *gyrocal_convnet(void);
int gyrocal_convnet_infer(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double sign, float *out);
int gyrocal_convnet_face(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double w_dps, double *out);
void gyrocal_convnet_merge(const double *prior_mean, const double *prior_root, const double *faces, uint32_t n, double *out);
int gyrocal_net_run(const float *up, const float *down, uint32_t n, float w_up_dps, float w_down_dps, float *out);

const gc_cnn_net_t *gyrocal_net(void) { return &gc_net; }
const gc_convnet_t *gyrocal_convnet(void) { return gc_net.convnet; }

/* out: [n][2], NaN where out of range */
int gyrocal_convnet_infer(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double sign, float *out)
{
    for (uint32_t i = 0; i < n; i++, counts += gc_convnet_samples(gc_net.convnet, stage), out += 2) {
        float columns[GC_CONVNET_MAX_COLUMNS];
        double mean;
        int error = gc_convnet_columns(gc_net.convnet, counts, stage, lsb_dps, sign, columns, &mean);
        if (!error) {
            error = gc_convnet_infer(gc_net.convnet, columns, stage, out);
        } else if (error == GC_E_NET_RANGE) {
            out[0] = out[1] = (float)NAN;
            error = GC_OK;
        }
        if (error) {
            return error;
        }
    }
    return GC_OK;
}

/* out: [n][2], u and its precision, NaN where out of range */
int gyrocal_convnet_face(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double w_dps, double *out)
{
    for (uint32_t i = 0; i < n; i++, counts += gc_convnet_samples(gc_net.convnet, stage), out += 2) {
        gc_convnet_face_t face = {0.0, NAN, NAN};
        int error = gc_convnet_face(gc_net.convnet, counts, stage, lsb_dps, w_dps, &face);
        if (error && error != GC_E_NET_RANGE) {
            return error;
        }
        out[0] = face.u_dps;
        out[1] = face.precision;
    }
    return GC_OK;
}

/* prior of bias and scale, NULL: none; faces: [n][2][w, u, precision]; out: [n][4] */
void gyrocal_convnet_merge(const double *prior_mean, const double *prior_root, const double *faces, uint32_t n, double *out)
{
    const gc_calibration_t calibration = {.prior_mean = prior_mean, .prior_sqrt_information = prior_root};
    for (uint32_t i = 0; i < n; i++, faces += 6, out += 4) {
        const gc_convnet_face_t up = {faces[0], faces[1], faces[2]}, down = {faces[3], faces[4], faces[5]};
        gc_answer_t answer = {0};
        gc_convnet_merge(&calibration, &up, &down, &answer);
        out[0] = answer.scale;
        out[1] = answer.bias_dps;
        out[2] = answer.scale_se;
        out[3] = answer.bias_se_dps;
    }
}

int gyrocal_net_run(const float *up, const float *down, uint32_t n, float w_up_dps, float w_down_dps, float *out)
{
    float scratch[GC_NET_SCRATCH_FLOATS];
    for (uint32_t i = 0; i < n; i++) {
        int error = gc_cnn_run(&gc_net, up + i * gc_net.window, down + i * gc_net.window, w_up_dps, w_down_dps, scratch,
                               out + i * gc_net.outputs);
        if (error) {
            return error;
        }
    }
    return 0;
}
"""


def cache_dir() -> Path:
    """Where compiled files are kept: ``$XDG_CACHE_HOME/gyrocal`` or ``~/.cache/gyrocal``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gyrocal"


@cache
def compiler() -> tuple[str, ...]:
    """The C compiler's command: ``$CC``, else ``cc``.

    Raises:
        GyrocalError: there is none.
    """
    command = shlex.split(os.environ.get("CC", "")) or ["cc"]
    if shutil.which(command[0]) is None:
        raise GyrocalError(
            f"no C compiler: `{command[0]}` is not on the PATH; install gcc or clang "
            "(Debian: apt install gcc; macOS: xcode-select --install), or set CC"
        )
    return tuple(command)


@cache
def _compiler_version(command: tuple[str, ...]) -> bytes:
    return subprocess.run([*command, "--version"], capture_output=True, check=False).stdout


def build(
    name: str,
    sources: Sequence[Path],
    include_dirs: Sequence[Path] = (),
    flags: Sequence[str] = (),
    texts: Mapping[str, str] | None = None,
) -> Path:
    """Compile ``sources`` into one file of the cache, unless it is there already.

    Args:
        name: the first part of the built file's name.
        sources: ``.c`` files.
        include_dirs: searched for headers in this order, after the folder of ``texts``.
        flags: added to ``FLAGS``; ``*SHARED`` makes a library, without it an executable.
        texts: further files by name, written beside the build: ``.c`` are compiled, ``.h`` found first.

    Raises:
        GyrocalError: no compiler, or it refused; the first of its messages is in the error.
    """
    command, texts = compiler(), texts or {}
    headers = [header for folder in include_dirs for header in sorted(folder.rglob("*.h"))]
    key = (command, _compiler_version(command), FLAGS, tuple(flags), sorted(texts.items()))
    digest = hashlib.sha256(repr(key).encode())
    for path in (*sources, *headers):
        digest.update(str(path).encode() + b"\0" + path.read_bytes() + b"\0")
    built = cache_dir() / f"{name}-{digest.hexdigest()[:24]}{'.so' if '-shared' in flags else ''}"
    if built.exists():
        return built
    try:
        built.parent.mkdir(parents=True, exist_ok=True)
        work = tempfile.TemporaryDirectory(prefix="build-", dir=built.parent)
    except OSError as error:
        raise GyrocalError(
            f"{built.parent}: cannot keep compiled files there ({error.strerror}); set XDG_CACHE_HOME"
        ) from error
    with work as folder:
        for file, text in texts.items():
            Path(folder, file).write_text(text)
        units = [*map(str, sources), *(str(Path(folder, file)) for file in texts if file.endswith(".c"))]
        includes = [f"-I{path}" for path in (folder, *include_dirs)]
        output = Path(folder, "out")
        done = subprocess.run(
            [*command, *FLAGS, *flags, *includes, *units, "-o", str(output), "-lm"], capture_output=True, text=True
        )
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines()
            first = next((line for line in lines if "error" in line), lines[0] if lines else f"exit {done.returncode}")
            raise GyrocalError(f"the C compiler refused {name}: {first.replace(folder + os.sep, '')}")
        os.replace(output, built)
    return built


def core_sources() -> list[Path]:
    """Every ``.c`` file of the core."""
    return sorted(CORE.rglob("*.c"))


def build_core() -> Path:
    """The core as a shared library; its path."""
    return build("core", core_sources(), [CORE], SHARED)


def build_sim(include: Path = INCLUDE) -> Path:
    """The simulated device as an executable; its path.

    Args:
        include: folder of ``calibration.h`` and ``weights.h``; one that is not there is taken from the shipped ones.
    """
    folders = [include] if include == INCLUDE else [include, INCLUDE]
    return build("sim", [*core_sources(), *sorted(SIM.glob("*.c"))], [*folders, CORE, SIM])


class Core:
    """The core's functions on arrays. ``library`` gives the rest of it to ctypes."""

    def __init__(self) -> None:
        self.library = ctypes.CDLL(str(build_core()))

    def _map(self, name: str, x: ArrayLike) -> NDArray[np.float32]:
        function = self.library[name]
        function.argtypes, function.restype = [ctypes.c_float], ctypes.c_float
        values = np.asarray(x, np.float32)
        return np.fromiter(map(function, values.ravel().tolist()), np.float32, values.size).reshape(values.shape)

    def exp(self, x: ArrayLike) -> NDArray[np.float32]:
        return self._map("gc_exp", x)

    def tanh(self, x: ArrayLike) -> NDArray[np.float32]:
        return self._map("gc_tanh", x)

    def sin_turn(self, turns: ArrayLike) -> NDArray[np.float32]:
        return self._map("gc_sin_turn", turns)

    def cos_turn(self, turns: ArrayLike) -> NDArray[np.float32]:
        return self._map("gc_cos_turn", turns)


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


def _build_net(header: Path) -> ctypes.CDLL:
    try:
        text = header.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{header}: not a readable header; write one with `gyrocal export`") from error
    compiler()
    sources = [CORE / "gc_cnn.c", CORE / "gc_convnet.c", CORE / "gc_math.c"]
    try:
        built = build("net", sources, [CORE], SHARED, {"weights.h": text, "net_shim.c": NET_SHIM})
    except GyrocalError as error:
        raise InputError(f"{header}: not a network's header ({error}); write one with `gyrocal export`") from error
    return ctypes.CDLL(str(built))


class CoreNetwork:
    """A network's C header run by the core: what the device computes.

    Args:
        header: a ``weights.h`` as ``gyrocal export`` writes it; the shipped one by default.

    Raises:
        InputError: no such file, or not such a header.
    """

    def __init__(self, header: Path = INCLUDE / "weights.h") -> None:
        self.source = str(header)
        library = _build_net(header)
        library.gyrocal_net.restype = ctypes.POINTER(_Net)
        net = library.gyrocal_net().contents
        self.name: str = net.name.decode()
        self.rate_hz: float = net.rate_hz
        self.table_dps: float = net.table_dps
        self.clip_dps: float = net.clip_dps
        self.window: int = net.window
        self.outputs: int = net.outputs
        self.scratch_floats: int = net.scratch_floats
        library.gyrocal_convnet.restype = ctypes.c_void_p
        self.convnet = bool(library.gyrocal_convnet())
        """Does network gyrocal answer in this one's place?"""
        self._run = library.gyrocal_net_run
        pointer = np.ctypeslib.ndpointer(np.float32, flags="C_CONTIGUOUS")
        self._run.argtypes = [pointer, pointer, ctypes.c_uint32, ctypes.c_float, ctypes.c_float, pointer]

    def run(
        self, up_residual_dps: ArrayLike, down_residual_dps: ArrayLike, w_up_dps: float, w_down_dps: float
    ) -> NDArray[np.float32]:
        """Scale and bias (dps) of each pair of windows.

        Args:
            up_residual_dps, down_residual_dps: measured - true rate, [n, window].
            w_up_dps, w_down_dps: the true rates about the sensed axis.

        Returns:
            [n, 2]: scale, bias_dps.

        Raises:
            InputError: a wrong shape, or the core's refusal of a rate or a NaN.
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


class CoreFaceNetwork:
    """Network `gyrocal` of a C header run by the core on raw counts: what the device computes.

    Raises:
        InputError: no such file, or no such network in it.
    """

    def __init__(self, header: Path = INCLUDE / "weights.h") -> None:
        self.source = str(header)
        library = self._library = _build_net(header)
        library.gyrocal_convnet.restype = ctypes.POINTER(_Convnet)
        pointer = library.gyrocal_convnet()
        if not pointer:
            raise InputError(f"{header}: holds no network gyrocal; write one with `gyrocal export`")
        net = pointer.contents
        self.name: str = net.name.decode()
        self.rate_hz: float = net.rate_hz
        self.table_dps: float = net.table_dps
        self.unit_dps: float = net.unit_dps
        self.column_range_dps: float = net.column_range_dps
        self.sample_range_dps: float = net.sample_range_dps
        library.gc_convnet_samples.argtypes = [ctypes.c_void_p, ctypes.c_uint]
        library.gc_convnet_samples.restype = ctypes.c_uint32
        self._samples = [library.gc_convnet_samples(pointer, stage) for stage in range(3)]
        for function, number in ((library.gyrocal_convnet_infer, np.float32), (library.gyrocal_convnet_face, np.float64)):
            function.argtypes = [
                np.ctypeslib.ndpointer(np.int16, flags="C_CONTIGUOUS"), ctypes.c_uint32, ctypes.c_uint, ctypes.c_double,
                ctypes.c_double, np.ctypeslib.ndpointer(number, flags="C_CONTIGUOUS"),
            ]  # fmt: skip

    def infer(self, counts: ArrayLike, stage: int, lsb_dps: float, w_dps: float) -> NDArray[np.float32]:
        """What the graph gives, [n, 2]: u less the mean, in units, and the logarithm of its precision; NaN out of range.

        ``counts`` [n, samples] are raw readings of one face at true rate ``w_dps``.
        """
        x = self._counts(counts, stage)
        out = np.empty((len(x), 2), np.float32)
        self._check(self._library.gyrocal_convnet_infer(x, len(x), stage, lsb_dps, np.sign(w_dps), out), w_dps)
        return out

    def face(self, counts: ArrayLike, stage: int, lsb_dps: float, w_dps: float) -> NDArray[np.float64]:
        """w·scale + bias (dps) and its precision (1/dps^2), [n, 2]; NaN out of range. InputError where the core refuses."""
        x = self._counts(counts, stage)
        out = np.empty((len(x), 2))
        self._check(self._library.gyrocal_convnet_face(x, len(x), stage, lsb_dps, w_dps, out), w_dps)
        return out

    def merge(self, up: ArrayLike, down: ArrayLike, prior_mean: ArrayLike, prior_root: ArrayLike) -> NDArray[np.float64]:
        """Scale, bias (dps) and their standard deviations [n, 4] of faces [n, 3], each w, u and precision.

        ``prior_mean`` [2] of bias and scale, ``prior_root`` [2, 2] the square root of their information, upper triangular.
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
