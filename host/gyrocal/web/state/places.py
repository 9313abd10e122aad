"""The files that the page may read and write: only sessions inside the chosen folders. An upload is never executed."""

from __future__ import annotations

import re
import shutil
import stat
import tomllib
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from gyrocal.errors import InputError
from gyrocal.files import UNREADABLE, new_folder
from gyrocal.web.values.views import NOT_NAMED

TABLES = (".csv", ".parquet")
LARGEST_BYTES = 8 << 30
LARGEST_RATIO = 200
"""Largest compression ratio of a zip member. Tables of rates stay below it; zip bombs exceed it."""
DEPTH = 2
MOST_SHOWN = 200


@dataclass(frozen=True)
class Listed:
    """A session as a list shows it, read from its session.toml alone; ``problem`` says why it cannot be read."""

    path: Path
    name: str
    sensor: str
    date: str
    """Of the recording if the session states it, otherwise of the file."""
    runs: int
    size_bytes: int
    problem: str = ""


class Places:
    """The folders that the page may use. It writes in the first one."""

    def __init__(self, roots: Iterable[Path]) -> None:
        self.roots = list(dict.fromkeys(root.resolve() for root in roots))

    @property
    def home(self) -> Path:
        return self.roots[0]

    def inside(self, path: str | Path) -> Path:
        """The path with links resolved. A relative path starts from the first folder. Raises InputError if it lies outside."""
        found = (self.home / path).resolve()
        if not any(found == root or root in found.parents for root in self.roots):
            raise InputError(
                f"{path}: outside {self.home}, where the workbench was started; start it with that folder as SESSION"
            )
        return found

    def session(self, path: str | Path) -> Path:
        """Check a session's folder: all of its tables must lie within it."""
        from gyrocal.recording.header import check_inside, read_header

        folder = self.inside(path)
        for entry in read_header(folder).run:
            check_inside(folder, entry.file)
        return folder

    def new(self, name: str) -> Path:
        """The path of a new folder in the first folder. Raises InputError if it exists or the name is not plain."""
        if not re.fullmatch(r"[\w][\w .+-]{0,80}", name):
            raise InputError(f"{name!r}: give a name of letters, digits, - and _ alone")
        folder = self.inside(name)
        if folder.exists():
            raise InputError(f"{name}: is there already; choose another name")
        return folder

    def free(self, name: str) -> Path:
        """A path for the name, with the first number that makes it new if the name is taken."""
        plain = re.sub(r"[^\w+-]+", "-", name).strip("-")[:60] or "session"
        candidates = [plain, *(f"{plain}-{i}" for i in range(2, 1000))]
        return next(self.new(n) for n in candidates if not (self.home / n).exists())

    def sessions(self) -> list[Path]:
        """Session folders in the chosen folders, newest first."""
        found = {}
        for root in self.roots:
            for depth in range(DEPTH + 1):
                for header in root.glob("/".join([*("*",) * depth, "session.toml"])):
                    folder = header.parent.resolve()
                    if any(part.startswith(".") for part in header.relative_to(root).parts):
                        continue
                    if folder in self.roots or any(r in folder.parents for r in self.roots):
                        found[folder] = header.stat().st_mtime
        return sorted(found, key=lambda f: -found[f])[:MOST_SHOWN]

    def files(self, kinds: Sequence[str]) -> list[Path]:
        """Files of these endings that belong to no session, in the chosen folders and those directly in them."""
        found: list[Path] = []
        for root in self.roots:
            for folder in (root, *sorted(p for p in root.iterdir() if p.is_dir() and not p.name.startswith("."))):
                if not (folder / "session.toml").is_file():
                    found += sorted(p for p in folder.iterdir() if p.name.lower().endswith(tuple(kinds)) and p.is_file())
        return [file for file in found if self._is_inside(file)][:MOST_SHOWN]

    def _is_inside(self, path: Path) -> bool:
        return any(root in path.resolve().parents for root in self.roots)

    def listed(self) -> list[Listed]:
        """The sessions with what a person knows them by, newest first."""
        return [self._listed(folder) for folder in self.sessions()]

    def _listed(self, folder: Path) -> Listed:
        header = folder / "session.toml"
        date = "changed " + datetime.fromtimestamp(header.stat().st_mtime).date().isoformat()
        try:
            told = tomllib.loads(header.read_text(encoding="utf-8"))
            files = [folder / str(run["file"]) for run in told["run"]]
            size = sum(file.stat().st_size for file in files if file.resolve().parent == folder)
        except (*UNREADABLE, TypeError, KeyError):
            return Listed(folder, self.name(folder), "", date, 0, 0, "cannot be read")
        made = told.get("made_on", date)
        return Listed(folder, self.name(folder), str(told.get("sensor") or NOT_NAMED), str(made), len(files), size)

    def is_by_gravity(self, folder: Path) -> bool:
        """True if session.toml says that the reference is gravity."""
        with (folder / "session.toml").open("rb") as header:
            reference = tomllib.load(header).get("reference")
        return isinstance(reference, dict) and reference.get("kind") == "gravity"

    def name(self, path: Path) -> str:
        """The name of a folder for display, relative to the folder in which it was found."""
        for root in self.roots:
            if root == path:
                return path.name
            if root in path.parents:
                return str(path.relative_to(root))
        return str(path)

    def unpack(self, archive: Path | BinaryIO, name: str) -> Path:
        """Unpack a zip of a session into a new folder: only session.toml and the tables that it names."""
        target = self.free(Path(name).stem)
        try:
            with new_folder(target) as partial:
                with zipfile.ZipFile(archive) as packed:
                    _extract(packed, partial, name)
                Places([partial]).session(partial)
        except (zipfile.BadZipFile, RuntimeError, NotImplementedError, OSError, EOFError) as error:
            raise InputError(f"{name}: cannot be unpacked: {error}") from None
        return target


def _extract(packed: zipfile.ZipFile, target: Path, name: str) -> None:
    headers = [PurePosixPath(i.filename) for i in packed.infolist() if PurePosixPath(i.filename).name == "session.toml"]
    if not headers:
        raise InputError(f"{name}: no session.toml in it; zip a session's folder")
    top = min(headers, key=lambda p: len(p.parts)).parent
    budget = LARGEST_BYTES
    for info in packed.infolist():
        path = PurePosixPath(info.filename)
        wanted = path.name == "session.toml" or path.suffix in TABLES
        if info.is_dir() or not wanted:
            continue
        if ".." in path.parts or path.is_absolute() or "\\" in info.filename or stat.S_ISLNK(info.external_attr >> 16):
            raise InputError(f"{name}: {info.filename!r} points outside of it")
        if top not in path.parents:
            continue
        relative = path.relative_to(top)
        budget -= info.file_size
        if budget < 0 or info.file_size > LARGEST_RATIO * max(info.compress_size, 1024):
            raise InputError(f"{name}: {info.filename!r} is too large to unpack")
        out = target.joinpath(*relative.parts)
        out.parent.mkdir(parents=True, exist_ok=True)
        with packed.open(info) as source, out.open("xb") as sink:
            shutil.copyfileobj(source, sink, 1 << 20)
