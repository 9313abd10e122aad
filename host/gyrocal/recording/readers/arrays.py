"""Arrays by name: NumPy's ``.npz`` and MATLAB's ``.mat``."""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError, first_line
from gyrocal.recording.column_names import GYRO, every_named
from gyrocal.recording.run import AXES
from gyrocal.recording.source import Source, of_arrays

ZIP = b"PK\x03\x04"
GYROSCOPE_OBJECT = r"(?i)gyr|angular|omega|imu"
"""Words in the name of an object with the readings of a gyroscope."""
HDF5 = b"\x89HDF\r\n\x1a\n"
MATLAB = b"MATLAB "
MATLAB_4_TYPES = (0, 10, 20, 30, 40, 50)
"""First words of MATLAB 4's files on little-endian machines: full matrices of numbers, by their precision."""


def is_mat(data: bytes) -> bool:
    """True for the first bytes of MATLAB's binary files; its ``save -ascii`` makes a text."""
    first = int.from_bytes(data[:4], "little")
    old = len(data) > 20 and first in MATLAB_4_TYPES and int.from_bytes(data[12:16], "little") in (0, 1) and data[4] != 0
    return data.startswith((MATLAB, HDF5)) or data[512:520] == HDF5 or old


def read_npz(path: Path) -> Source:
    """The arrays of an ``.npz`` as columns; pickled objects are not read."""
    import numpy as np

    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {}
            if not any(name.endswith(".npy") for name in archive.zip.namelist()):
                raise InputError(f"{path}: {_what_else(archive.zip.namelist())}")
            for name in archive.files:
                try:
                    arrays[name] = archive[name]
                except ValueError:  # an array of objects, which would have to be executed
                    continue
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a readable .npz file: {first_line(error)}") from None
    return of_arrays(path, arrays, holds=_a_gyroscope)


def _what_else(members: list[str]) -> str:
    """What a ZIP archive without arrays is, and what to do with it."""
    if any(name.startswith("xl/") or name == "content.xml" for name in members):
        return "a spreadsheet, which is not read; save its sheet as CSV (File, Save As, CSV UTF-8)"
    return f"a ZIP archive of {', '.join(members[:5]) or 'nothing'}; unpack it, and import a file of it or the folder"


def read_mat(path: Path, file: Path | io.BytesIO, head: bytes) -> Source:
    """The arrays of a ``.mat`` up to version 7 as columns; the fields of a structure are ``structure.field``.

    ``path`` names the ``file``, which begins with ``head``.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque, MatReadWarning

    if HDF5 in head:
        raise InputError(f"{path}: a MATLAB file of version 7.3, which is not read; save it with: save FILE -v7")
    try:
        with warnings.catch_warnings():  # of the workspace of functions, which holds no arrays
            warnings.simplefilter("ignore", MatReadWarning)
            loaded = loadmat(file, simplify_cells=True)
    except Exception as error:  # scipy raises many kinds on a damaged file
        raise InputError(f"{path}: not a readable MATLAB file: {first_line(error)}") from None
    arrays = dict(_flat(loaded))
    try:
        return of_arrays(path, arrays, holds=_a_gyroscope)
    except InputError:
        if any(isinstance(value, MatlabOpaque) for value in arrays.values()):
            raise InputError(f"{path}: {_what_object(_objects(file))}") from None
        raise


def _objects(file: Path | io.BytesIO) -> dict[str, str]:
    """The objects of MATLAB's own classes in a file: the class of each by its name, which are all that the file shows.

    A file holds them without a variable's name, so that each has to be read as a file of its own.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque, varmats_from_mat

    found: dict[str, str] = {}
    for _, part in varmats_from_mat(io.BytesIO(file.read_bytes()) if isinstance(file, Path) else file):
        for value in loadmat(part).values():
            if isinstance(value, MatlabOpaque):
                words = (word.decode() if isinstance(word, bytes) else str(word) for word in value.ravel()[0].tolist()[:3])
                name, _, kind = words
                found[name] = kind
    return found


def _what_object(kinds: dict[str, str]) -> str:
    """What objects of MATLAB's own classes are, and what to do with that of the gyroscope, or the first if none is named so."""
    name = next((name for name in kinds if re.search(GYROSCOPE_OBJECT, name)), next(iter(kinds)))
    kind = kinds[name]
    writes = {"timetable": f"writetimetable({name}, '{name}.csv')", "table": f"writetable({name}, '{name}.csv')"}
    advice = writes.get(kind, "save its arrays of numbers as variables, or as columns of a CSV")
    others = [other for other in kinds if other != name]
    beside = f"; beside it are {', '.join(others)}" if others else ""
    return f"{name} is an object of MATLAB's class {kind}, which MATLAB alone reads. There: {advice}{beside}"


def _a_gyroscope(table: Source) -> bool:
    return any(every_named(table, GYRO, axis) for axis in AXES)


def _flat(tree: dict[str, Any], above: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in tree.items():
        if name.startswith("__"):
            continue
        found += _flat(value, f"{above}{name}.") if isinstance(value, dict) else [(above + name, value)]
    return found
