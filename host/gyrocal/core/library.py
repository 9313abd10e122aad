"""The C core on this machine: compiled by the system's ``cc``, or by Python's ``ziglang``, into a cache, loaded by ctypes.

The cache is keyed by the sources, headers, flags and compiler, so an edited source or a newly exported header is
used at the next call, and processes that build at the same time do not disturb each other. A built file's name also holds the
hash of its content. A file that does not match it, or that another user owns or may write, is not used but built anew.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrocal.errors import GyrocalError
from gyrocal_firmware import CORE, INCLUDE, SIM

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
SHARED = ("-fPIC", "-shared")
HASH_DIGITS = 24
"""Hexadecimal digits of a hash in the name of a built file."""


class CacheError(GyrocalError):
    """The folder of compiled files cannot be written."""


def cache_dir() -> Path:
    """The folder of compiled files: ``$XDG_CACHE_HOME/gyrocal`` or ``~/.cache/gyrocal``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gyrocal"


@cache
def compiler() -> tuple[str, ...]:
    """The command of the C compiler: ``$CC`` if it is set, otherwise ``cc``, otherwise that of the package ``ziglang``.

    Raises:
        GyrocalError: there is none of them.
    """
    chosen = shlex.split(os.environ.get("CC", ""))
    command = chosen or ["cc"]
    if shutil.which(command[0]) is not None:
        return tuple(command)
    if not chosen and importlib.util.find_spec("ziglang") is not None:
        return (sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline")  # else for this processor alone
    raise GyrocalError(
        f"no C compiler: `{command[0]}` is not on the PATH; pip install ziglang, or install gcc or clang "
        "(Debian: apt install gcc; macOS: xcode-select --install), or set CC"
    )


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
    """Compile ``sources`` into one file of the cache, unless it exists already, and return its path.

    Args:
        name: the first part of the built file's name.
        sources: the ``.c`` files.
        include_dirs: folders that are searched for headers in this order, after the folder of ``texts``.
        flags: options added to ``FLAGS``; ``*SHARED`` makes a library instead of an executable.
        texts: further files by name: ``.c`` files are compiled, ``.h`` files are found before all others.

    Raises:
        GyrocalError: there is no compiler, or it failed; the error holds the first of its messages.
    """
    command, texts = compiler(), texts or {}
    headers = [header for folder in include_dirs for header in sorted(folder.rglob("*.h"))]
    key = (command, _compiler_version(command), FLAGS, tuple(flags), sorted(texts.items()))
    digest = hashlib.sha256(repr(key).encode())
    for path in (*sources, *headers):
        digest.update(str(path).encode() + b"\0" + path.read_bytes() + b"\0")
    folder_of_all, key_name = cache_dir(), f"{name}-{digest.hexdigest()[:HASH_DIGITS]}-"
    kept = next((path for path in sorted(folder_of_all.glob(f"{key_name}*")) if _sound(path)), None)
    if kept is not None:
        return kept
    try:
        folder_of_all.mkdir(mode=0o700, parents=True, exist_ok=True)
        work = tempfile.TemporaryDirectory(prefix="build-", dir=folder_of_all)
    except OSError as error:
        raise CacheError(
            f"{folder_of_all}: cannot keep compiled files there ({error.strerror}); set XDG_CACHE_HOME"
        ) from error
    with work as folder:
        for file, text in texts.items():
            Path(folder, file).write_text(text)
        units = [*map(str, sources), *(str(Path(folder, file)) for file in texts if file.endswith(".c"))]
        includes = [f"-I{path}" for path in (folder, *include_dirs)]
        output = Path(folder, "out")
        done = _compile([*command, *FLAGS, *flags, *includes], units, output)
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines()
            first = next((line for line in lines if "error:" in line), lines[0] if lines else f"exit {done.returncode}")
            raise GyrocalError(f"the C compiler refused {name}: {first.replace(folder + os.sep, '')}")
        output.chmod(0o700)
        built = folder_of_all / f"{key_name}{_hash_of(output)}{'.so' if '-shared' in flags else ''}"
        os.replace(output, built)
    return built


def _compile(command: Sequence[str], units: Sequence[str], output: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*command, *units, "-o", str(output), "-lm"], capture_output=True, text=True, check=False)


def _hash_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:HASH_DIGITS]


def _sound(built: Path) -> bool:
    """Whether a file of the cache is this user's, nobody else's to write, and of the content that its name states."""
    try:
        found = built.lstat()
        mine = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o022)
        return mine and stat.S_ISREG(found.st_mode) and built.stem.rpartition("-")[2] == _hash_of(built)
    except OSError:
        return False


def core_sources() -> list[Path]:
    """Every ``.c`` file of the core."""
    return sorted(CORE.rglob("*.c"))


def build_core() -> Path:
    """Compile the core into a shared library and return its path."""
    return build("core", core_sources(), [CORE], SHARED)


def build_sim(include: Path = INCLUDE, flags: Sequence[str] = ()) -> Path:
    """Compile the simulated device and return the path of the executable.

    Args:
        include: the folder of ``calibration.h`` and ``weights.h``; a header that is missing there is the shipped one.
        flags: options added to ``FLAGS``.
    """
    folders = [include] if include == INCLUDE else [include, INCLUDE]
    return build("sim", [*core_sources(), *sorted(SIM.glob("*.c"))], [*folders, CORE, SIM], flags)


class Core:
    """The core's mathematical functions on arrays. ``library`` gives access to its other functions by ctypes."""

    def __init__(self) -> None:
        self.library = ctypes.CDLL(str(build_core()))

    def _map(self, name: str, x: ArrayLike) -> NDArray[np.float32]:
        function = self.library[name]
        function.argtypes, function.restype = [ctypes.c_float], ctypes.c_float
        values = np.asarray(x, np.float32)
        return np.fromiter(map(function, values.ravel().tolist()), np.float32, values.size).reshape(values.shape)

    def exp(self, x: ArrayLike) -> NDArray[np.float32]:
        """The core's ``exp`` in float32."""
        return self._map("gc_exp", x)

    def tanh(self, x: ArrayLike) -> NDArray[np.float32]:
        """The core's ``tanh`` in float32."""
        return self._map("gc_tanh", x)

    def sin_turn(self, turns: ArrayLike) -> NDArray[np.float32]:
        """The core's sine in float32 of an angle given in turns."""
        return self._map("gc_sin_turn", turns)

    def cos_turn(self, turns: ArrayLike) -> NDArray[np.float32]:
        """The core's cosine in float32 of an angle given in turns."""
        return self._map("gc_cos_turn", turns)
