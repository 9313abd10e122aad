"""Objects of C sources, each compiled once for the same source, headers and options, by whichever worker comes first."""

import contextlib
import fcntl
import hashlib
import os
import shutil
import subprocess
import time
from collections import deque
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

KEPT_S = 14 * 86400.0


class Objects:
    """A folder of objects by the hash of what makes them; those that no run has asked for within two weeks go."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        for path in folder.iterdir():
            with contextlib.suppress(FileNotFoundError):
                if path.stat().st_mtime < time.time() - KEPT_S:
                    path.unlink()

    def of_all(self, command: Sequence[str], sources: Iterable[Path]) -> list[Path]:
        """The object of each source. What another worker is compiling comes last, so that two workers share the work."""
        given = list(sources)
        built: dict[Path, Path] = {}
        left = deque((source, False) for source in given)
        while left:
            source, waits = left.popleft()
            try:
                built[source] = self.of(command, source, waits=waits)
            except BlockingIOError:
                left.append((source, True))
        return [built[source] for source in given]

    def of(self, command: Sequence[str], source: Path, *, waits: bool = True) -> Path:
        """The object of ``source`` by a compiler with its options, of which ``-I`` names where headers are.

        Raises BlockingIOError if another worker is compiling it and this one does not wait.
        """
        included = [Path(word[2:]) for word in command if word.startswith("-I")]
        headers = [path for folder in (source.parent, *included) for path in sorted(folder.rglob("*.h"))]
        made_of = hashlib.sha256("\0".join((_version(command[0]), *command)).encode())
        for path in (source, *headers):
            made_of.update(f"\0{path}\0".encode() + path.read_bytes())
        built = self._folder / f"{made_of.hexdigest()}.o"
        if not built.exists():
            _keep(self._of_text(command, source, waits), built)
        os.utime(built)
        return built

    def _of_text(self, command: Sequence[str], source: Path, waits: bool) -> Path:
        """The object of what the preprocessor makes of ``source``: most sources are the same for all settings of the core."""
        text = subprocess.run([*command, "-E", str(source)], check=True, capture_output=True).stdout
        settings = [word for word in command if not word.startswith(("-D", "-I"))]
        settings.append(_version(command[0]))
        built = self._folder / f"{hashlib.sha256(chr(0).join(settings).encode() + text).hexdigest()}.o"
        if not built.exists():
            with built.with_suffix(".lock").open("w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
                if not built.exists():
                    own = built.with_suffix(f".{os.getpid()}")
                    subprocess.run([*command, "-c", str(source), "-o", str(own)], check=True, capture_output=True)
                    _keep(own, built)
                    own.unlink()
        return built

    def into(self, folder: Path, command: Sequence[str], sources: Iterable[Path]) -> None:
        """Put the object of each source into a folder, as ``command -c SOURCES`` does there."""
        given = list(sources)
        for source, built in zip(given, self.of_all(command, given), strict=True):
            shutil.copy(built, folder / f"{source.stem}.o")


def _keep(made: Path, built: Path) -> None:
    """Give an object a further name. Of two workers the first one stays: what replaces a file cannot be linked meanwhile."""
    with contextlib.suppress(FileExistsError):
        os.link(made, built)


@cache
def _version(compiler: str) -> str:
    """What a compiler says of its version."""
    return subprocess.run([compiler, "--version"], check=False, capture_output=True, text=True).stdout
